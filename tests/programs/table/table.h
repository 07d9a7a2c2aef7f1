#ifndef TABLE_H
#define TABLE_H

#include "fmi2Functions.h"

typedef struct {
    double u, y, gain, scale;
    int on, size, most, failure;
    const fmi2CallbackFunctions *callbacks;
} Table;

double integral(const Table *t, double size);

#endif

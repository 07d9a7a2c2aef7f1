/* What the files of a program share. scene.h, generated, includes this and has the scene's data. */

#ifndef PROGRAM_H
#define PROGRAM_H

#include "loop.h"

/* PCG64 as NumPy has it, with a state and an increment of 128 bits each, the high words first. */
typedef struct {
    uint64_t state[2], increment[2];
} Pcg64;

/* A latency is drawn: ceil((low + spread u) / unit) ticks, u uniform from 0 to 1 and before it the
 * sample is lost with a probability `loss`; all but that are whole numbers. */
typedef struct {
    int64_t hold;
    uint64_t low, spread, unit;
    double loss;
    Pcg64 generator;
} Latency;

/* Draws the next latency (ticks), -1 for a lost sample: Link.draw of orchestrator/system/latency_and_loss.py. */
int64_t latency_draw(const Latency *latency, Pcg64 *generator);

/* A uniform number from 0 to 1. */
double uniform(Pcg64 *generator);

#endif

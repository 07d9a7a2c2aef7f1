/* What the loop asks of an operating system and of its process, for a program: nothing. No clock is read, so that equal
 * states have equal bytes, and the loop returns after each event, as if a signal had come. */

#include "loop.h"

int64_t now(void) { return 0; }

void wait_until(int64_t time) { (void)time; }

void watch_signals(int on) { (void)on; }

int signal_came(void) { return 1; }

void note_arithmetic(void) {}

void keep_arithmetic(StepState *p) { (void)p; }

void hapticlink_guard(int on) { (void)on; }

void hapticlink_python(int (*ensure)(void), void *(*occurred)(void), void (*release)(int)) {
    (void)ensure, (void)occurred, (void)release;
}

int exception_left(void) { return 0; }

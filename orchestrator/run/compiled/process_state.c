/* What an FMU may change of the whole process: how numbers are rounded, that it goes on, and the
 * exceptions that a Python FMU leaves behind. */

#include "loop.h"

#include <stdio.h>
#include <stdlib.h>
#ifdef _WIN32
#include <process.h>
#else
#include <unistd.h>
#endif

#if defined(__x86_64__) || defined(_M_X64)
#include <xmmintrin.h>
enum { CONTROL = 0xffc0, USUAL = 0x1f80 }; /* of MXCSR: rounding, masks of exceptions, tiny numbers taken for zero */

static inline unsigned control(void) { return _mm_getcsr() & CONTROL; }

static void set_control(unsigned value) {
    unsigned short x87;
    __asm__ volatile("fnstcw %0" : "=m"(x87));
    x87 &= ~0xc00; /* to the nearest */
    __asm__ volatile("fldcw %0" : : "m"(x87));
    _mm_setcsr((_mm_getcsr() & ~(unsigned)CONTROL) | value);
}
#else
#include <fenv.h>
enum { USUAL = FE_TONEAREST };

static inline unsigned control(void) { return (unsigned)fegetround(); }

static void set_control(unsigned value) { fesetround((int)value); }
#endif

static unsigned before = USUAL;

void note_arithmetic(void) { before = control(); }

void keep_arithmetic(StepState *p) {
    if (control() == before) return;
    set_control(before);
    p->altered++;
}

static int running;

/* Called by exit(), and not when Python ends the process, which has left every run by then. */
static void ended(void) {
    if (!running) return;
    fflush(NULL);
    _exit(1);
}

void hapticlink_guard(int on) {
    static int registered;
    if (!registered) registered = !atexit(ended);
    running += on ? 1 : -1;
}

/* The library of a Python FMU goes on with a wrong number after some exceptions, such as an integer
 * of Python that C cannot hold. */
static int (*ensure_)(void);
static void *(*occurred_)(void);
static void (*release_)(int);

void hapticlink_python(int (*ensure)(void), void *(*occurred)(void), void (*release)(int)) {
    ensure_ = ensure;
    occurred_ = occurred;
    release_ = release;
}

/* Whether there is one, which stays: ctypes raises it when the loop returns. */
int exception_left(void) {
    const int state = ensure_();
    const int occurred = occurred_() != NULL;
    release_(state);
    return occurred;
}

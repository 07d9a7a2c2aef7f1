/* Exceptions that a Python FMU leaves behind: its library goes on with a wrong number after some of
 * them, such as an integer of Python that C cannot hold. */

#include "loop.h"

static int (*ensure_)(void);
static void *(*occurred_)(void);
static void (*release_)(int);

void use_python(int (*ensure)(void), void *(*occurred)(void), void (*release)(int)) {
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

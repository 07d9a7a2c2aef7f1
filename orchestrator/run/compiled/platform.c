/* What differs between operating systems: the clock and signals. */

#include <stdint.h>

#ifdef _WIN32
#include <windows.h>

/* Time (ns) of a clock that is never set back. */
int64_t now(void) {
    LARGE_INTEGER frequency, count;
    QueryPerformanceFrequency(&frequency);
    QueryPerformanceCounter(&count);
    const int64_t f = frequency.QuadPart, c = count.QuadPart;
    return c / f * 1000000000 + c % f * 1000000000 / f;
}

void watch_signals(int on) { (void)on; }

int signal_came(void) { return 0; } /* Python notices it when it has its turn */
#else
#include <signal.h>
#include <time.h>

/* Time (ns) of a clock that is never set back. */
int64_t now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static const int SIGNALS[] = {SIGINT, SIGTERM};
static struct sigaction before[2];
static volatile sig_atomic_t came;

static void take(int number) {
    const struct sigaction *python = before + (number == SIGTERM);
    came = 1;
    if (python->sa_handler != SIG_DFL && python->sa_handler != SIG_IGN) python->sa_handler(number);
}

/* Notices signals beside Python, whose handlers run only when it has its turn: the loop then gives
 * it one after the event. */
void watch_signals(int on) {
    for (int i = 0; i < 2; i++) {
        struct sigaction found, ours = {.sa_handler = take};
        sigaction(SIGNALS[i], NULL, &found);
        if (!on && found.sa_handler == take) sigaction(SIGNALS[i], before + i, NULL);
        if (!on || found.sa_handler == take || found.sa_flags & SA_SIGINFO) continue;
        if (found.sa_handler == SIG_DFL || found.sa_handler == SIG_IGN) continue;
        before[i] = found;
        ours.sa_mask = found.sa_mask;
        ours.sa_flags = found.sa_flags;
        sigaction(SIGNALS[i], &ours, NULL);
    }
}

/* Whether a signal has come since this was last asked. */
int signal_came(void) {
    if (!came) return 0;
    came = 0;
    return 1;
}
#endif

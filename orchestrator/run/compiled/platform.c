/* What differs between operating systems: the clock and signals. */

#include <stdint.h>

enum { SPIN = 60000 };
/* ns before an instant at which sleeping ends. On a busy virtual machine with Linux half of the
 * wake-ups came 33 us late, one in ten 56; 82 and 171 where timers may be served together. */

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

/* Waits until `time` of that clock: sleeps up to SPIN before it, and reads the clock from there on. */
void wait_until(int64_t time) {
    static HANDLE timer;
#ifndef CREATE_WAITABLE_TIMER_HIGH_RESOLUTION
#define CREATE_WAITABLE_TIMER_HIGH_RESOLUTION 2 /* Windows 10 since 1803 */
#endif
    if (!timer)
        timer = CreateWaitableTimerExW(NULL, NULL, CREATE_WAITABLE_TIMER_HIGH_RESOLUTION,
                                       TIMER_ALL_ACCESS);
    const int64_t rest = time - SPIN - now();
    if (rest > 0) {
        LARGE_INTEGER after = {.QuadPart = -rest / 100}; /* units of 100 ns, from now on */
        if (timer && SetWaitableTimer(timer, &after, 0, NULL, NULL, FALSE))
            WaitForSingleObject(timer, INFINITE);
        else
            Sleep((DWORD)(rest / 1000000));
    }
    while (now() < time) {}
}

void watch_signals(int on) { (void)on; }

int signal_came(void) { return 0; } /* Python notices it when it has its turn */
#else
#include <errno.h>
#include <signal.h>
#include <time.h>
#ifdef __APPLE__
#include <mach/mach_time.h>
#endif
#ifdef __linux__
#include <sys/prctl.h>
#endif

/* Time (ns) of a clock that is never set back. */
int64_t now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

/* Waits until `time` of that clock, or for a signal: sleeps up to SPIN before it, and reads the clock
 * from there on. */
void wait_until(int64_t time) {
    const int64_t wake = time - SPIN;
#ifdef __APPLE__ /* has no clock_nanosleep */
    mach_timebase_info_data_t unit;
    mach_timebase_info(&unit);
    const int64_t rest = wake - now();
    if (rest > 0) mach_wait_until(mach_absolute_time() + (uint64_t)rest * unit.denom / unit.numer);
#else
#ifdef __linux__ /* timers are served together otherwise, up to 50 us late */
    static __thread int asked;
    if (!asked) asked = 1, prctl(PR_SET_TIMERSLACK, 1UL);
#endif
    const struct timespec at = {.tv_sec = wake / 1000000000, .tv_nsec = wake % 1000000000};
    if (wake > now() && clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL) == EINTR) return;
#endif
    while (now() < time) {}
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
        struct sigaction present, ours = {.sa_handler = take};
        sigaction(SIGNALS[i], NULL, &present);
        if (!on && present.sa_handler == take) sigaction(SIGNALS[i], before + i, NULL);
        if (!on || present.sa_handler == take || present.sa_flags & SA_SIGINFO) continue;
        if (present.sa_handler == SIG_DFL || present.sa_handler == SIG_IGN) continue;
        before[i] = present;
        ours.sa_mask = present.sa_mask;
        ours.sa_flags = present.sa_flags;
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

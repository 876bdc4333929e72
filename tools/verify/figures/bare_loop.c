/* A loop that does nothing but be on time: what the machine itself can keep of a period.

   bare_loop CORE PRIORITY PERIOD_NS SECONDS LATE_NS
   It sleeps to absolute deadlines of the monotonic clock on one core, at SCHED_FIFO where PRIORITY is not 0, its memory
   locked. A deadline that passed while it was late by more than a period is missed, as the flight's runtime counts it.
   Standard output, one line each: "ticks missed worst_ns real_time locked", then "when_ns late_ns" of each tick that
   was later than LATE_NS, the first LATE_KEPT of them, then "lateness" and the ticks by their lateness, in us below. */
#define _GNU_SOURCE
#include <sched.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <time.h>

enum { LATE_KEPT = 20000, WIDTHS = 10 };
static const int64_t EDGES[WIDTHS - 1] = {100000, 200000, 500000, 1000000, 2000000, 5000000, 10000000, 20000000, 50000000};
static int64_t late_at[LATE_KEPT][2], counts[WIDTHS];

static int64_t now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

int main(int argc, char **argv) {
    if (argc != 6) return 2;
    const int core = atoi(argv[1]), priority = atoi(argv[2]);
    const int64_t period = atoll(argv[3]), length = (int64_t)(atof(argv[4]) * 1e9), late_limit = atoll(argv[5]);
    cpu_set_t cores;
    CPU_ZERO(&cores);
    CPU_SET(core, &cores);
    if (period <= 0 || sched_setaffinity(0, sizeof cores, &cores) != 0) return 2;
    struct sched_param parameter = {.sched_priority = priority};
    const int real_time = priority > 0 && sched_setscheduler(0, SCHED_FIFO, &parameter) == 0;
    const int locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
    int64_t ticks = 0, missed = 0, worst = 0, kept = 0, due = now() + period;
    const int64_t end = due + length;
    while (due < end) {
        const struct timespec wake = {.tv_sec = due / 1000000000, .tv_nsec = due % 1000000000};
        while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &wake, NULL) != 0) {}
        const int64_t woken = now(), late = woken - due;
        int width = 0;
        while (width < WIDTHS - 1 && late >= EDGES[width]) width++;
        counts[width]++;
        ticks++;
        if (late > worst) worst = late;
        if (late > late_limit && kept < LATE_KEPT) late_at[kept][0] = woken, late_at[kept++][1] = late;
        for (due += period; due < woken && due < end; due += period) missed++;
    }
    printf("%lld %lld %lld %d %d\n", (long long)ticks, (long long)missed, (long long)worst, real_time, locked);
    for (int64_t i = 0; i < kept; i++) printf("%lld %lld\n", (long long)late_at[i][0], (long long)late_at[i][1]);
    printf("lateness");
    for (int i = 0; i < WIDTHS; i++) printf(" %lld", (long long)counts[i]);
    printf("\n");
    return 0;
}

/* Wakes up at absolute deadlines and says how late, as cyclictest does: for machines without cyclictest.

   sleeper INTERVAL_US COUNT PRIORITY CPU      PRIORITY 0: ordinary scheduling; CPU -1: any

   Prints one lateness in us (with three decimals) per wake-up. */
#define _GNU_SOURCE
#include <errno.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>

static int fail(const char *what)
{
    fprintf(stderr, "sleeper: %s: %s\n", what, strerror(errno));
    return 1;
}

int main(int argc, char **argv)
{
    if (argc != 5) {
        fprintf(stderr, "sleeper: expected INTERVAL_US COUNT PRIORITY CPU\n");
        return 2;
    }
    long long interval_ns = atoll(argv[1]) * 1000;
    long count = atol(argv[2]);
    int priority = atoi(argv[3]), cpu = atoi(argv[4]);
    long long *late_ns = calloc(count, sizeof *late_ns);
    if (!late_ns)
        return fail("memory");
    memset(late_ns, 1, count * sizeof *late_ns); /* so that no page is missing later */
    if (cpu >= 0) {
        cpu_set_t set;
        CPU_ZERO(&set);
        CPU_SET(cpu, &set);
        if (sched_setaffinity(0, sizeof set, &set))
            return fail("CPU");
    }
    if (priority > 0) {
        struct sched_param parameter = {.sched_priority = priority};
        if (mlockall(MCL_CURRENT | MCL_FUTURE) || sched_setscheduler(0, SCHED_FIFO, &parameter))
            return fail("SCHED_FIFO");
    }
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    long long due_ns = now.tv_sec * 1000000000LL + now.tv_nsec;
    for (long i = 0; i < count; i++) {
        due_ns += interval_ns;
        struct timespec due = {due_ns / 1000000000LL, due_ns % 1000000000LL};
        while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL) == EINTR)
            ;
        clock_gettime(CLOCK_MONOTONIC, &now);
        late_ns[i] = now.tv_sec * 1000000000LL + now.tv_nsec - due_ns;
    }
    for (long i = 0; i < count; i++)
        printf("%.3f\n", late_ns[i] * 1e-3);
    return 0;
}

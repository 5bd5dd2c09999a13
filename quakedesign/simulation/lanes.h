/* A step is long chains of sums: instructions of several are put in turn as far as there are registers. */
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("schedule-insns", "sched-pressure")
#endif
#ifndef LANES
#define LANES ${lanes}
#endif

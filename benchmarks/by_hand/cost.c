/* Time of one operation of an FMU, called from C:
 *
 *     cost LIBRARY PLAN OPERATION N [STEP SIZE]
 *
 * prints nanoseconds an operation, the mean of N: step; acted_on (a step after all inputs of the plan have been set);
 * start (instantiate, initialize, free); get, set (all outputs, all inputs, in one call); save (into the same memory). */
#define _POSIX_C_SOURCE 200809L
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmu.h"

static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void start(Fmu *it, const Library *library) {
    if (fmu_instantiate(it, library, CO_SIMULATION) == NULL || fmu_enter_initialization(it, 1e-8) != 0
        || fmu_exit_initialization(it) != 0)
        fail("cost", "the instance does not start");
}

static const Plan *plan;
static double *values, size;
static long steps;

static int start_and_free(Fmu *it) {
    Fmu other;
    start(&other, it->library);
    fmu_free(&other);
    return 0;
}
static int get(Fmu *it) { return fmu_get(it, &plan->outputs, values); }
static int set(Fmu *it) { return fmu_set(it, &plan->inputs, plan->inputs.values); }
static int step(Fmu *it) { return fmu_step(it, (double)steps++ * size, size); }

static const struct {
    const char *name;
    int (*run)(Fmu *it);
} OPERATIONS[] = {{"step", step}, {"acted_on", step}, {"start", start_and_free}, {"get", get}, {"set", set}, {"save", fmu_save}};

int main(int count, char **words) {
    if (count < 5) fail("usage", "cost LIBRARY PLAN OPERATION N [STEP SIZE]");
    const Library library = open_library(words[1], words[2]);
    const long n = atol(words[4]);
    int (*run)(Fmu *) = NULL, bad = 0;
    double begin = 0;
    Fmu it;
    plan = &library.plan;
    size = count > 5 ? atof(words[5]) : 0.01;
    values = calloc(plan->outputs.count + 1, sizeof *values);
    for (size_t i = 0; i < sizeof OPERATIONS / sizeof *OPERATIONS; i++)
        if (strcmp(OPERATIONS[i].name, words[3]) == 0) run = OPERATIONS[i].run;
    if (run == NULL || values == NULL) fail("no such operation", words[3]);
    start(&it, &library);
    if (strcmp(words[3], "acted_on") == 0) bad |= set(&it);
    for (long i = -n / 10; i < n; i++) { /* the first ones warm up */
        if (i == 0) begin = seconds();
        bad |= run(&it);
    }
    printf("%.3f\n", (seconds() - begin) / (double)n * 1e9);
    if (bad) fail("cost", "a call was refused");
    return 0;
}

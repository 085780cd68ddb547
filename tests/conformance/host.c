/* An importer in C alone.  It loads the shared library of an FMU and does one of these:
 *
 *     host LIBRARY PLAN life FILE     steps, saves, restores, serializes to FILE, frees
 *     host LIBRARY PLAN resume FILE   goes on, in this new process, from what `life` left in FILE
 *     host LIBRARY PLAN exchange      model exchange, with the classical Runge-Kutta method as the importer's solver
 *     host LIBRARY PLAN crowd N       N instances at a time
 *     host LIBRARY PLAN threads N     N threads, a life in each
 *     host LIBRARY PLAN lives N       N lives, one after another, with refused calls
 *     host LIBRARY PLAN long N        N steps of one instance
 *
 * Numbers are printed as the 16 digits of their bits.  The exit status is 0 if every call returned what it has to. */
#ifndef _WIN32
#define _POSIX_C_SOURCE 200809L
#include <pthread.h>
#include <sys/resource.h>
#endif
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmu.h"

enum { STEPS = 20 };

#define OK(call) \
    do { if ((call) != 0) fail("not OK", #call); } while (0)
#define HOLDS(condition) \
    do { if (!(condition)) fail("does not hold", #condition); } while (0)

static double *numbers(size_t n) {
    double *result = calloc(n + 1, sizeof *result);
    if (result == NULL) fail("host", "out of memory");
    return result;
}

static void print(double time, const double values[], size_t n) {
    uint64_t bits;
    printf("%.9g", time);
    for (size_t i = 0; i < n; i++) {
        memcpy(&bits, &values[i], sizeof bits);
        printf(" %016" PRIx64, bits);
    }
    printf("\n");
}

/* Inputs that jump a little at each step, and of which no two are alike. */
static void drive(Fmu *it, long k) {
    const Group *inputs = &it->library->plan.inputs;
    if (inputs->n == 0) return;
    const double size = it->library->plan.indicators > 0 ? 1e-5 : 1e-3; /* larger ones would push bodies into others */
    double *values = numbers(inputs->count);
    for (size_t i = 0; i < inputs->count; i++) values[i] = inputs->values[i] + size * ((k * 7 + (long)i * 3) % 11 - 5);
    OK(fmu_set(it, inputs, values));
    free(values);
}

static void start(Fmu *it, const Library *library, Interface kind) {
    if (fmu_instantiate(it, library, kind) == NULL) fail("host", "no instance");
    OK(fmu_enter_initialization(it, 1e-8));
    OK(fmu_set(it, &library->plan.parameters, library->plan.parameters.values));
    OK(fmu_exit_initialization(it));
}

/* Steps from the `begin`th to the `end`th; *rows, if wanted, take the outputs after each. */
static void run(Fmu *it, long begin, long end, double *rows) {
    const Plan *plan = &it->library->plan;
    for (long k = begin; k < end; k++) {
        drive(it, k);
        OK(fmu_step(it, (double)k * plan->step, plan->step));
        if (rows) OK(fmu_get(it, &plan->outputs, rows + (size_t)(k - begin) * plan->outputs.count));
    }
}

static void print_rows(const Plan *plan, long begin, const double *rows) {
    for (long k = 0; k < STEPS; k++)
        print((double)(begin + k + 1) * plan->step, rows + (size_t)k * plan->outputs.count, plan->outputs.count);
}

static void life(const Library *library, const char *file) {
    const size_t size = STEPS * library->plan.outputs.count;
    double *once = numbers(size), *again = numbers(size);
    char *bytes;
    size_t byte_count;
    Fmu it;
    start(&it, library, CO_SIMULATION);
    run(&it, 0, STEPS, once);
    print_rows(&library->plan, 0, once);
    OK(fmu_save(&it));
    OK(fmu_serialize(&it, &bytes, &byte_count));
    run(&it, STEPS, 2 * STEPS, once);
    print_rows(&library->plan, STEPS, once);
    OK(fmu_restore(&it));
    run(&it, STEPS, STEPS + 3, again); /* another past, which has to be forgotten */
    drive(&it, 5);
    OK(fmu_step(&it, (STEPS + 3) * library->plan.step, 0.37 * library->plan.step));
    OK(fmu_restore(&it));
    run(&it, STEPS, 2 * STEPS, again);
    HOLDS(memcmp(once, again, size * sizeof *once) == 0);
    FILE *saved = fopen(file, "wb");
    HOLDS(saved != NULL && fwrite(bytes, 1, byte_count, saved) == byte_count && fclose(saved) == 0);
    OK(fmu_terminate(&it));
    fmu_free(&it);
    free(bytes);
    free(once);
    free(again);
}

static void resume(const Library *library, const char *file) {
    static char bytes[1 << 20];
    double *rows = numbers(STEPS * library->plan.outputs.count);
    Fmu it;
    FILE *saved = fopen(file, "rb");
    HOLDS(saved != NULL);
    const size_t byte_count = fread(bytes, 1, sizeof bytes, saved);
    fclose(saved);
    HOLDS(byte_count < sizeof bytes);
    HOLDS(fmu_instantiate(&it, library, CO_SIMULATION) != NULL);
    OK(fmu_deserialize(&it, bytes, byte_count));
    OK(fmu_restore(&it));
    run(&it, STEPS, 2 * STEPS, rows);
    print_rows(&library->plan, STEPS, rows);
    fmu_free(&it);
    free(rows);
}

/* y + h * f */
static void add(size_t n, const double *y, double h, const double *f, double *sum) {
    for (size_t i = 0; i < n; i++) sum[i] = y[i] + h * f[i];
}

/* Rates at (t, y), in continuous-time mode. */
static void rates(Fmu *it, double t, const double *y, double *f) {
    OK(fmu_set_time_and_states(it, t, y));
    OK(fmu_get_derivatives(it, f));
}

static void exchange(const Library *library) {
    const Plan *plan = &library->plan;
    const size_t n = plan->states;
    double *y = numbers(6 * n), *x = y + n, *f1 = x + n, *f2 = f1 + n, *f3 = f2 + n, *f4 = f3 + n;
    const int contacts = plan->indicators > 0; /* events of which are found late by a step at most */
    const double step = contacts ? plan->step / 4 : plan->step;
    double *row = numbers(plan->outputs.count), t = 0, next;
    Fmu it;
    start(&it, library, MODEL_EXCHANGE);
    OK(fmu_update_discrete_states(&it, &next));
    OK(fmu_enter_continuous_mode(&it));
    OK(fmu_get_states(&it, y));
    for (int k = 0; k < 2 * STEPS; k++) {
        const int event = next <= t + step;
        const double h = event ? next - t : step;
        rates(&it, t, y, f1);
        add(n, y, h / 2, f1, x);
        rates(&it, t + h / 2, x, f2);
        add(n, y, h / 2, f2, x);
        rates(&it, t + h / 2, x, f3);
        add(n, y, h, f3, x);
        rates(&it, t + h, x, f4);
        for (size_t i = 0; i < n; i++) y[i] += h / 6 * (f1[i] + 2 * f2[i] + 2 * f3[i] + f4[i]);
        t = event ? next : t + h;
        OK(fmu_set_time_and_states(&it, t, y));
        OK(fmu_get(&it, &plan->outputs, row));
        print(t, row, plan->outputs.count);
        if (!event && !contacts && k % 5 != 4) continue;
        OK(fmu_enter_event_mode(&it));
        drive(&it, k);
        OK(fmu_update_discrete_states(&it, &next));
        OK(fmu_enter_continuous_mode(&it));
        OK(fmu_get_states(&it, y)); /* which the jump of the inputs may have changed */
    }
    OK(fmu_terminate(&it));
    fmu_free(&it);
    free(y);
    free(row);
}

/* Outputs of an instance that has made all its steps at once, driven by the inputs of a place of its own. */
static double *alone(const Library *library, long place) {
    double *rows = numbers(STEPS * library->plan.outputs.count);
    Fmu it;
    start(&it, library, CO_SIMULATION);
    for (long k = 0; k < STEPS; k++) {
        drive(&it, k + place);
        OK(fmu_step(&it, (double)k * library->plan.step, library->plan.step));
        OK(fmu_get(&it, &library->plan.outputs, rows + (size_t)k * library->plan.outputs.count));
    }
    OK(fmu_terminate(&it));
    fmu_free(&it);
    return rows;
}

static void crowd(const Library *library, long n) {
    const Plan *plan = &library->plan;
    const size_t row = plan->outputs.count;
    Fmu *them = calloc((size_t)n, sizeof *them);
    double *values = numbers(row);
    HOLDS(them != NULL);
    for (long i = 0; i < n; i++) start(&them[i], library, CO_SIMULATION);
    for (long k = 0; k < STEPS; k++)
        for (long i = 0; i < n; i++) {
            drive(&them[i], k + i);
            OK(fmu_step(&them[i], (double)k * plan->step, plan->step));
        }
    for (long i = 0; i < n; i++) {
        OK(fmu_get(&them[i], &plan->outputs, values));
        if (i % (n / 3 + 1) == 0) {
            double *rows = alone(library, i);
            HOLDS(memcmp(values, rows + (STEPS - 1) * row, row * sizeof *values) == 0);
            free(rows);
        }
        fmu_free(&them[i]);
    }
    free(them);
    free(values);
}

static void lives(const Library *library, long n) {
    const Plan *plan = &library->plan;
    for (long i = 0; i < n; i++) {
        Fmu it;
        start(&it, library, i % 2 ? CO_SIMULATION : MODEL_EXCHANGE);
        OK(fmu_save(&it));
        if (it.kind == CO_SIMULATION) OK(fmu_step(&it, 0, plan->step));
        HOLDS(fmu_step(&it, 0, -1) != 0);
        HOLDS(fmu_exit_initialization(&it) != 0);
        OK(fmu_restore(&it));
        if (i % 3) OK(fmu_terminate(&it));
        fmu_free(&it);
    }
}

#ifndef _WIN32

static long memory(void) { /* [kB], the most so far */
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    return usage.ru_maxrss;
}

static void endure(const Library *library, long n) {
    const Plan *plan = &library->plan;
    double *values = numbers(plan->outputs.count), *largest = numbers(plan->outputs.count);
    long before = 0;
    Fmu it;
    start(&it, library, CO_SIMULATION);
    for (long k = 0; k < n; k++) {
        if (k == n / 100) before = memory();
        OK(fmu_step(&it, (double)k * plan->step, plan->step));
        if (k % 100) continue;
        OK(fmu_save(&it));
        OK(fmu_get(&it, &plan->outputs, values));
        for (size_t i = 0; i < plan->outputs.count; i++) largest[i] = fmax(largest[i], fabs(values[i]));
    }
    print((double)(memory() - before), largest, plan->outputs.count);
    fmu_free(&it);
    free(values);
    free(largest);
}

typedef struct {
    const Library *library;
    long place;
    double *rows;
} Task;

static void *work(void *task) {
    Task *it = task;
    for (int i = 0; i < 5; i++) {
        free(it->rows);
        it->rows = alone(it->library, it->place);
    }
    return NULL;
}

static void threads(const Library *library, long n) {
    pthread_t *them = calloc((size_t)n, sizeof *them);
    Task *tasks = calloc((size_t)n, sizeof *tasks);
    HOLDS(them != NULL && tasks != NULL);
    for (long i = 0; i < n; i++) {
        tasks[i] = (Task){library, i, NULL};
        HOLDS(pthread_create(&them[i], NULL, work, &tasks[i]) == 0);
    }
    for (long i = 0; i < n; i++) HOLDS(pthread_join(them[i], NULL) == 0);
    for (long i = 0; i < n; i++) {
        double *rows = alone(library, i);
        HOLDS(memcmp(rows, tasks[i].rows, STEPS * library->plan.outputs.count * sizeof *rows) == 0);
        free(rows);
        free(tasks[i].rows);
    }
    free(them);
    free(tasks);
}

#else

static void endure(const Library *library, long n) { (void)library, (void)n, fail("host", "not on Windows"); }

static void threads(const Library *library, long n) { (void)library, (void)n, fail("host", "not on Windows"); }

#endif

int main(int count, char **words) {
    if (count < 4) fail("usage", "host LIBRARY PLAN COMMAND [ARGUMENT]");
    Library library = open_library(words[1], words[2]);
    const char *command = words[3], *argument = count > 4 ? words[4] : "0";
    if (strcmp(command, "life") == 0) life(&library, argument);
    else if (strcmp(command, "resume") == 0) resume(&library, argument);
    else if (strcmp(command, "exchange") == 0) exchange(&library);
    else if (strcmp(command, "crowd") == 0) crowd(&library, atol(argument));
    else if (strcmp(command, "threads") == 0) threads(&library, atol(argument));
    else if (strcmp(command, "lives") == 0) lives(&library, atol(argument));
    else if (strcmp(command, "long") == 0) endure(&library, atol(argument));
    else fail("no such command", command);
    free_plan(&library.plan);
    return 0;
}

/* Right-hand sides of chains: the generated one, and that of the oscillator chain written by hand for a compiler that
 * vectorises.  Both take and return the same vectors; `isolated` is a chain that nothing is attached to, which has fewer
 * of them. */
#include <malloc.h>
#include <math.h>
#include <stdlib.h>
#include <time.h>

#include "core.h"

static double *vectors[5], *rates, *work; /* t, y, u, k, m */

/* In nanoseconds. */
static double processor_time(void) {
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return 1e9 * (double)now.tv_sec + (double)now.tv_nsec;
}

static int by_hand(const double **argument, double **result) {
    const size_t n = (model.states - 2) / 2;
    const double *restrict u = argument[1], *restrict p = u + n, *restrict force = argument[2], *restrict load = force + n;
    double *restrict u_dot = result[0], *restrict p_dot = u_dot + n;
    const double inverse = 1 / argument[3][0], stiffness = argument[3][1];
    double powers[8] = {0}, power = 0;
    p_dot[0] = stiffness * (u[1] - u[0]) + force[0] - load[0];
    for (size_t i = 1; i < n - 1; i++)
        p_dot[i] = stiffness * ((u[i + 1] - u[i]) - (u[i] - u[i - 1])) + (force[i] - load[i]);
    p_dot[n - 1] = -stiffness * (u[n - 1] - u[n - 2]) + force[n - 1] - load[n - 1];
    for (size_t i = 0; i < n; i++) u_dot[i] = p[i] * inverse;
    size_t i = 0;
    for (; i + 8 <= n; i += 8)
        for (size_t k = 0; k < 8; k++) powers[k] += (force[i + k] - load[i + k]) * u_dot[i + k];
    for (; i < n; i++) power += (force[i] - load[i]) * u_dot[i];
    for (size_t k = 0; k < 8; k++) power += powers[k];
    result[0][2 * n] = power;
    result[0][2 * n + 1] = 0;
    return 0;
}

static int isolated(const double **argument, double **result) {
    const size_t n = (model.states - 2) / 2;
    const double *restrict u = argument[1], *restrict p = u + n;
    double *restrict u_dot = result[0], *restrict p_dot = u_dot + n;
    const double inverse = 1 / argument[3][0], stiffness = argument[3][1];
    p_dot[0] = stiffness * (u[1] - u[0]);
    for (size_t i = 1; i < n - 1; i++) p_dot[i] = stiffness * ((u[i + 1] - u[i]) - (u[i] - u[i - 1]));
    p_dot[n - 1] = -stiffness * (u[n - 1] - u[n - 2]);
    for (size_t i = 0; i < n; i++) u_dot[i] = p[i] * inverse;
    return 0;
}

/* What no pendulum chain can do without: sine and cosine of each angle. */
static int trigonometry(const double **argument, double **result) {
    const size_t n = (model.states - 2) / 2;
    const double *restrict angle = argument[1];
    double *restrict sine = result[0], *restrict cosine = sine + n;
    for (size_t i = 0; i < n; i++) {
        sine[i] = sin(angle[i]);
        cosine[i] = cos(angle[i]);
    }
    return 0;
}

static int generated(const double **argument, double **result) {
    return model.motions[ACTIVITIES - 1].all(argument, result, NULL, work, 0);
}

/* Parameters as they start, small forces, and a state that is not at rest; 0 when memory runs out. */
int chain_open(void) {
    const size_t counts[] = {1, model.states, model.inputs, model.parameters, model.memory};
    for (size_t i = 0; i < 5; i++)
        if ((vectors[i] = calloc(counts[i] + 1, sizeof(double))) == NULL) return 0;
    rates = calloc(model.states, sizeof *rates);
    work = calloc(model.reals + 1, sizeof *work);
    if (rates == NULL || work == NULL) return 0;
    for (const Variable *v = model.variables; v->first < model.parameters; v++)
        for (size_t i = 0; i < v->count; i++) vectors[3][v->first + i] = v->start;
    for (size_t i = 0; i < model.inputs; i++) vectors[2][i] = 0.1 + 1e-3 * (double)(i % 7);
    for (size_t i = 0; i < model.states; i++) vectors[1][i] = 0.3 + 0.01 * (double)(i % 29);
    return 1;
}

/* Processor time of a call, the mean of some: of the functions below by their number. */
double chain_time(int which, long calls) {
    static int (*const FUNCTIONS[])(const double **, double **) = {generated, by_hand, isolated, trigonometry};
    const double *argument[16] = {vectors[0], vectors[1], vectors[2], vectors[3], vectors[4]};
    double *result[16] = {rates};
    const double begin = processor_time();
    for (long i = 0; i < calls; i++) FUNCTIONS[which](argument, result);
    const double end = processor_time();
    return (end - begin) / (double)calls;
}

/* The largest difference between what two of them calculate. */
double chain_difference(int which) {
    double *const kept = rates;
    double largest = 0;
    chain_time(0, 1);
    rates = calloc(model.states, sizeof *rates);
    chain_time(which, 1);
    for (size_t i = 0; i < model.states; i++) {
        const double difference = rates[i] > kept[i] ? rates[i] - kept[i] : kept[i] - rates[i];
        if (difference > largest) largest = difference;
    }
    free(rates);
    rates = kept;
    return largest;
}

static void tell(void *owner, Status status, const char *text) {
    (void)owner;
    (void)status;
    (void)text;
}

static Instance *instance;

/* As a co-simulation FMU with its start values; returns the bytes that it takes, or 0 if it does not start. */
double chain_start(double tolerance) {
    const Options options = {.use = USE_CO_SIMULATION, .report = tell};
    const struct mallinfo2 before = mallinfo2();
    instance = core_new(&model, &options);
    const struct mallinfo2 after = mallinfo2();
    if (instance == NULL || core_setup(instance, 0, NULL, tolerance) != SUCCESS) return 0;
    core_enter_initialization(instance);
    if (core_exit_initialization(instance) != SUCCESS) return 0;
    return (double)(after.uordblks + after.hblkhd) - (double)(before.uordblks + before.hblkhd);
}

/* Processor time of a communication step; < 0 if one is discarded. */
double chain_advance(double size, long steps) {
    Arrival arrival;
    Status status = SUCCESS;
    const double begin = processor_time();
    for (long i = 0; i < steps && status == SUCCESS; i++)
        status = core_step(instance, core_time(instance), size, &arrival);
    const double end = processor_time();
    if (status != SUCCESS) return -1;
    return (end - begin) / (double)steps;
}

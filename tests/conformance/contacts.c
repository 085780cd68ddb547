/* Many lives of an FMU with contacts, each with start values and motions of its own:
 *
 *     contacts LIBRARY PLAN < TRIALS
 *
 * TRIALS, words: the reference of input_reconstruction, or 0; how many gaps there are, positions that scale them,
 * prescribed coordinates; references of the gaps, the positions, impact_loss, energy, energy_balance, and of each
 * coordinate's value, rate, acceleration; then for each trial its number, mode, tolerance, communication step, number
 * of steps, and the values of all parameters, and of each coordinate: offset, amplitude, angular frequency and phase of a
 * sine, and height and half period of a triangular wave, whose rate jumps.
 *
 * For each trial it prints: its number, status, time reached, longest call [s], lowest gap in parts of its scale, largest
 * energy balance in parts of the energies, largest decrease of impact_loss, whether a refused step has left a trace, what
 * was said last. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmu.h"

enum { MOST = 16, EXPERIMENT = 6, INTERPOLATE = 2 };

typedef struct {
    unsigned references[2 * MOST + 3];
    size_t gaps, positions, coordinates;
    unsigned prescribed[3 * MOST], mode;
} Roles;

static char said[512];

static void note(void *environment, int status, const char *message) {
    (void)environment, (void)status;
    strncpy(said, message, sizeof said - 1);
}

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t); /* others may keep the machine busy */
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static double number(void) {
    double value;
    if (scanf("%lf", &value) != 1) fail("contacts", "a trial is cut off");
    return value;
}

/* A Group of scalars. */
static Group group(unsigned *references, size_t n) { return (Group){n, n, references, NULL, NULL}; }

/* Value, rate and acceleration of a prescribed coordinate. */
static void move(const double m[EXPERIMENT], double t, double s[3]) {
    const double phase = m[2] * t + m[3], part = t / m[5], folded = fmod(part, 2);
    s[0] = m[0] + m[1] * sin(phase) + m[4] * (folded < 1 ? folded : 2 - folded);
    s[1] = m[1] * m[2] * cos(phase) + m[4] / m[5] * (folded < 1 ? 1 : -1);
    s[2] = -m[1] * m[2] * m[2] * sin(phase);
}

static int prescribe(Fmu *it, Roles *roles, double motions[][EXPERIMENT], double t) {
    double values[3 * MOST];
    const Group prescribed = group(roles->prescribed, 3 * roles->coordinates);
    for (size_t i = 0; i < roles->coordinates; i++) move(motions[i], t, values + 3 * i);
    return roles->coordinates == 0 ? 0 : fmu_set(it, &prescribed, values);
}

static void live(const Library *library, Roles *roles, long trial) {
    const Plan *plan = &library->plan;
    const size_t n = roles->gaps + roles->positions + 3;
    const Group watched = group(roles->references, n);
    const int mode = (int)number();
    const double tolerance = number(), step = number(), steps = number();
    double parameters[256], motions[MOST][EXPERIMENT], z[2 * MOST + 3], before[2 * MOST + 3] = {0};
    double longest = 0, lowest = INFINITY, gained = 0, off = 0, energy = 0, loss = 0;
    int status, trace = 0;
    long k = 0;
    Fmu it;
    for (size_t i = 0; i < plan->parameters.count; i++) parameters[i] = number();
    for (size_t i = 0; i < roles->coordinates; i++)
        for (int j = 0; j < EXPERIMENT; j++) motions[i][j] = number();
    *said = '\0';
    if (fmu_instantiate(&it, library, CO_SIMULATION) == NULL) fail("contacts", "no instance");
    status = fmu_enter_initialization(&it, tolerance);
    if (status == 0 && roles->mode != 0)
        status = library->plan.version == 2
                     ? (int)library->fmi2.SetInteger(it.component, &roles->mode, 1, &mode)
                     : (int)library->fmi3.SetInt32(it.component, &roles->mode, 1, &mode, 1);
    if (status == 0) status = fmu_set(&it, &plan->parameters, parameters);
    if (status == 0) status = prescribe(&it, roles, motions, 0);
    const double begin = now();
    if (status == 0) status = fmu_exit_initialization(&it);
    longest = now() - begin;
    for (; status <= 1; k++) { /* warnings are no faults */
        double scale = 1;
        if (fmu_get(&it, &watched, z) != 0) fail("contacts", said);
        for (size_t i = 0; i < roles->positions; i++) scale += fabs(z[roles->gaps + i]);
        for (size_t i = 0; i < roles->gaps; i++) lowest = fmin(lowest, z[i] / scale);
        energy = fmax(energy, fabs(z[n - 2]));
        off = fmax(off, fabs(z[n - 1]));
        gained = fmax(gained, loss - z[n - 3]);
        loss = z[n - 3];
        memcpy(before, z, sizeof before);
        if (k >= steps) break;
        if (prescribe(&it, roles, motions, ((double)k + (mode == INTERPOLATE)) * step) > 1) fail("contacts", said);
        if (fmu_get(&it, &watched, before) != 0) fail("contacts", said);
        const double from = now();
        status = fmu_step(&it, (double)k * step, step);
        longest = fmax(longest, now() - from);
    }
    if (status > 1 && k > 0) trace = fmu_get(&it, &watched, z) != 0 || memcmp(z, before, n * sizeof *z) != 0;
    printf("%ld %d %.9g %.3g %.3g %.3g %.3g %d %s\n", trial, status, (double)k * step, longest, lowest,
           off / (1e-300 + energy + loss), gained / (1e-300 + energy + loss), trace, said);
    fflush(stdout);
    fmu_free(&it);
}

int main(int count, char **words) {
    Roles roles;
    long trial;
    if (count < 3) fail("usage", "contacts LIBRARY PLAN");
    Library library = open_library(words[1], words[2]);
    library.logger = note;
    roles.mode = (unsigned)number();
    roles.gaps = (size_t)number();
    roles.positions = (size_t)number();
    roles.coordinates = (size_t)number();
    for (size_t i = 0; i < roles.gaps + roles.positions + 3; i++) roles.references[i] = (unsigned)number();
    for (size_t i = 0; i < 3 * roles.coordinates; i++) roles.prescribed[i] = (unsigned)number();
    while (scanf("%ld", &trial) == 1) live(&library, &roles, trial);
    free_plan(&library.plan);
    return 0;
}

/* A component by the sources of its FMU: its own solver, and its right-hand side for others. */
#include <string.h>

#include "core.h"
#include "solvers.h"

enum { ROOM = 1 << 16 };

static long evaluated;
static double k[ROOM], u[ROOM], moving[ROOM], reals[ROOM];
static const double *in[ROOM];
static double *out[ROOM];
static long long integers[ROOM];

static void tell(void *owner, Status status, const char *text) {
    (void)owner;
    (void)status;
    (void)text;
}

static const Motion *motion = &model.motions[ACTIVITIES - 1];

/* Counted when asked for: that takes time. */
static int counted_all(const double **arguments, double **results, long long *i, double *w, int memory) {
    evaluated++;
    return motion->all(arguments, results, i, w, memory);
}

static int counted_coupled(const double **arguments, double **results, long long *i, double *w, int memory) {
    evaluated++;
    return motion->coupled(arguments, results, i, w, memory);
}

/* Values of parameters and inputs, in the order of the places; from them start and sizes of the states, and which of the
 * right-hand sides the FMU takes. */
void begin(const double *values, double *y, double *size) {
    const double zero = 0;
    double m[ROOM];
    memcpy(k, values, model.parameters * sizeof *k);
    memcpy(u, values + model.parameters, model.inputs * sizeof *u);
    memcpy(moving, u, model.inputs * sizeof *u);
    int activity = 0;
    for (const Variable *input = model.variables; input->first < model.parameters + model.inputs; input++)
        for (size_t i = 0; i < input->count && input->kind == INPUT; i++)
            if (u[input->first - model.parameters + i] != 0) activity |= input->activity;
    motion = &model.motions[activity];
    in[0] = &zero, in[1] = u, in[2] = k;
    out[0] = y, out[1] = m;
    model.start(in, out, integers, reals, 0);
    in[1] = y, in[2] = u, in[3] = k;
    out[0] = size;
    model.nominals(in, out, integers, reals, 0);
}

/* As the FMU finds them.  Coordinates that an operator moves go on as they do at the start. */
void rates(void *context, double t, const double y[], double f[]) {
    (void)context;
    for (const Active *at = model.active; at < model.active + model.active_rows; at++)
        moving[at->value] = u[at->value] + t * (u[at->rate] + t / 2 * u[at->acceleration]);
    in[0] = &t, in[1] = y, in[2] = moving, in[3] = k;
    out[0] = f;
    motion->all(in, out, integers, reals, 0);
}

static Model counted;

/* As a co-simulation FMU with the values given to `begin`; NULL if it refuses them. */
Instance *component_open(double tolerance, int symplectic_steps, int stiff, int counting) {
    const Options options = {.use = USE_CO_SIMULATION, .report = tell};
    const size_t settable = model.parameters + model.inputs;
    const unsigned first = first_reference(&model);
    const unsigned symplectic = first + (unsigned)(settable + model.outputs) + (model.inputs > 0);
    const unsigned solvers[] = {symplectic, symplectic + 1};
    const int chosen[] = {symplectic_steps, stiff};
    unsigned references[ROOM];
    double values[ROOM];
    counted = model;
    for (int i = 0; i < ACTIVITIES; i++) counted.motions[i] = (Motion){counted_all, counted_coupled};
    if (counting) evaluated = 0;
    Instance *instance = core_new(counting ? &counted : &model, &options);
    Status status = core_setup(instance, 0, NULL, tolerance);
    for (size_t i = 0; i < settable; i++) references[i] = first + (unsigned)i;
    memcpy(values, k, model.parameters * sizeof *k);
    memcpy(values + model.parameters, u, model.inputs * sizeof *u);
    core_enter_initialization(instance);
    status |= core_set(instance, references, settable, values, settable);
    status |= core_set_settings(instance, solvers, 2, chosen);
    status |= core_exit_initialization(instance);
    return status == SUCCESS ? instance : NULL;
}

/* Processor time of communication steps; < 0 if one is discarded. */
double component_advance(Instance *instance, double size, long steps) {
    Arrival arrival;
    Status status = SUCCESS;
    const double start = processor_time(), time = core_time(instance);
    for (long i = 0; i < steps && status == SUCCESS; i++)
        status = core_step(instance, time + (double)i * size, size, &arrival);
    return status == SUCCESS ? processor_time() - start : -1;
}

/* Processor time of so many right-hand sides, each of what the one before has moved a little. */
double component_rates(double y[], double f[], long count) {
    const double start = processor_time();
    for (long i = 0; i < count; i++) {
        rates(NULL, 0, y, f);
        y[0] += 1e-12 * f[0];
    }
    return processor_time() - start;
}

long component_evaluations(void) { return evaluated; }

void component_states(Instance *instance, double *y) { core_get_states(instance, y); }

void component_close(Instance *instance) { core_free(instance); }

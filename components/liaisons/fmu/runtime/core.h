/* One instance of a component: its variables, initialization, motion and saved states.  Nothing here knows FMI.
 *
 * Vectors, as in the generated functions: t time, y continuous states, u inputs, k parameters, m memory, z everything
 * that is calculated.  The reference of a variable is its place in (k, u, z).
 * A call that returns DISCARD or ERROR has reported why and has changed nothing. */
#ifndef LIAISONS_CORE_H
#define LIAISONS_CORE_H

#include <stddef.h>
#include <stdint.h>

/* ---- the component: constant tables and functions, generated into model.c ---- */

/* Dense columns in and out; NULL stands for zeros, or for a result that is not wanted. */
typedef int Function(const double **arguments, double **results, long long *integers, double *reals, int memory);

typedef enum { FIXED_PARAMETER, TUNABLE_PARAMETER, INPUT, CALCULATED } Kind;

typedef struct {
    const char *name;
    Kind kind;
    double start, minimum, maximum;
    int strict;         /* the bounds themselves are forbidden too */
    const char *domain; /* the allowed values in words */
} Variable;

typedef struct { /* places of a coordinate that an operator prescribes, among the inputs */
    size_t value, rate, acceleration;
} Active;

typedef struct {
    const char *name, *guid;
    double tolerance; /* where the importer gives none */
    size_t parameters, inputs, outputs, states, memory, actives, events;
    size_t conditions, start_conditions; /* asked of the motion, and of the start: these and more */
    const Variable *variables;
    const Active *active;
    const size_t *state_references;      /* of the variables that show the states */
    const size_t *derivative_references; /* of their derivatives */
    const char *const *condition_texts;
    Function *start;       /* (t, u, k) -> (y, m) */
    Function *derivatives; /* (t, y, u, k) -> dy/dt */
    Function *calculate;   /* (t, y, u, k, m) -> z */
    Function *jump;        /* (t, y, u, k, m) -> y */
    Function *remember;    /* (t, y, u, k, m) -> m */
    Function *nominals;    /* (t, y, u, k) -> sizes of y */
    Function *project;     /* (t, y, u, k) -> y put back onto the constraints after a step of the solver; or NULL */
    Function *distances;   /* (t, y, u, k) -> how far each condition is from failing: must stay > 0 */
    Function *instants;    /* (k) -> when the component is not smooth */
    /* directional derivatives: arguments, results, directions -> derivatives of the results */
    Function *start_forward, *calculate_forward, *remember_forward;
    size_t most_arguments, most_results, integers, reals; /* work space of any of them */
} Model;

extern const Model model;

/* ---- an instance ---- */

typedef enum { SUCCESS, WARNING, DISCARD, ERROR } Status;

typedef enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    EVENT = 4,
    CONTINUOUS = 8,
    STEP = 16,
    TERMINATED = 32
} Phase;

/* What the inputs do inside a communication step. */
enum { HOLD, EXTRAPOLATE, INTERPOLATE };

typedef struct Instance Instance;
typedef void Report(void *owner, Status status, const char *text);

/* NULL when memory runs out. */
Instance *core_new(const Model *model, int model_exchange, Report *report, void *owner);
void core_free(Instance *);
void core_reset(Instance *);

Phase core_phase(const Instance *);
double core_time(const Instance *);
/* Tolerances from 1e-14 to 1e-2 are kept; 0: the component's own. */
Status core_setup(Instance *, double start_time, double tolerance);
void core_enter_initialization(Instance *);
Status core_exit_initialization(Instance *);
void core_terminate(Instance *);

Status core_get(Instance *, const unsigned references[], size_t n, double values[]);
Status core_set(Instance *, const unsigned references[], size_t n, const double values[]);
Status core_get_reconstruction(Instance *, unsigned reference, int *value);
Status core_set_reconstruction(Instance *, unsigned reference, int value);
Status core_directional_derivative(Instance *, const unsigned unknowns[], size_t unknown_count,
                                   const unsigned knowns[], size_t known_count, const double direction[],
                                   double result[]);

/* co-simulation */
Status core_set_input_derivatives(Instance *, const unsigned references[], size_t n, const int orders[],
                                  const double values[]);
Status core_output_derivatives(Instance *, const unsigned references[], size_t n, double values[]);
Status core_step(Instance *, double time, double size);

/* model exchange */
Status core_set_time(Instance *, double time);
Status core_set_states(Instance *, const double y[]);
void core_get_states(Instance *, double y[]);
Status core_get_derivatives(Instance *, double f[]);
void core_get_nominals(Instance *, double sizes[]);
void core_enter_event_mode(Instance *);
void core_enter_continuous_mode(Instance *);
/* Book what a jump of the inputs brought in; returns whether states changed.  *next: next time event, or INFINITY. */
int core_update_discrete_states(Instance *, double *next);

/* saved states: plain bytes, valid in any process */
size_t core_state_size(const Instance *);
void core_save(const Instance *, void *bytes);
Status core_check_state(const Instance *, const void *bytes, size_t size);
Status core_restore(Instance *, const void *bytes, size_t size);

/* Report a text and return its status. */
Status core_report(const Instance *, Status status, const char *format, ...);

#endif

/* One instance of a component: its variables, initialization, motion and saved states.  Nothing here knows FMI.
 *
 * Vectors, as in the generated functions: t time, y continuous states, u inputs, k parameters, m memory, z everything
 * that is calculated; its last numbers, which only a picture needs, are calculated when they are read.  Numbers have an
 * index in (k, u, z, t).  Value references count from 1: structural sizes, numbers, settings; where they stand for whole
 * variables (see Options), these and the time replace the numbers.
 * A call that returns DISCARD or ERROR has reported why and has changed nothing; see core_told for WARNING. */
#ifndef LIAISONS_CORE_H
#define LIAISONS_CORE_H

#include <stddef.h>
#include <stdint.h>

#include "contact_record.h"
#include "contact_rules.h"

/* ---- the component: constant tables and functions, generated into model.c ---- */

/* Dense columns in and out.  Results must lie elsewhere than arguments; none may be NULL. */
typedef int Function(const double **arguments, double **results, long long *integers, double *reals, int memory);

typedef enum { FIXED_PARAMETER, TUNABLE_PARAMETER, INPUT, CALCULATED, INDEPENDENT } Kind;

enum { NO_STATE = -1 };

/* What inputs do that are not 0: they act, say as forces, or they move a coordinate that an operator prescribes. */
enum { LOADS = 1, MOVES = 2, ACTIVITIES = 4 };

typedef struct { /* (t, y, u, k) -> dy/dt, of all states, and of the coupled ones only */
    Function *all, *coupled;
} Motion;

typedef enum { NUMBER_REAL, NUMBER_INTEGER, NUMBER_BOOLEAN } NumberType; /* all are calculated as doubles */

typedef struct { /* a number, or an array of numbers */
    const char *name;
    Kind kind;
    size_t first, count; /* index of its first number, and how many there are */
    int array;           /* its numbers have an index: name[1], name[2], ... */
    long state;          /* index of its first number among the states, or NO_STATE */
    int activity;        /* of an input that is not 0: LOADS, MOVES or nothing */
    double start, minimum, maximum;
    int strict;         /* the bounds themselves are forbidden too */
    const char *domain; /* the allowed values in words; empty: all finite numbers */
    NumberType type;
} Variable;

typedef struct { /* a start value that is not that of its variable */
    size_t index;
    double value;
} Start;

typedef struct { /* a rate that constraints may change at the start, and its start value: their indices */
    size_t start, rate;
} StartRate;

enum { NOT_SHOWN = -1 };

typedef struct { /* a prescribed coordinate: indices of its first of `count` numbers among the inputs */
    size_t value, rate, acceleration, count;
    long mismatch, derived; /* where m has what is found of them, and what is derived; or NOT_SHOWN */
} Active;

typedef struct { /* an energy account: where z has T + V, and y the work done and what is dissipated */
    size_t energy, work, dissipated;
} Account;

/* What a jump of a prescribed coordinate does: it moves states; and for a pair: the rates of both are factors in those
 * of the states, so that a jump of both has no limit. */
enum { JUMPS = 1, MIXES = 2 };

typedef struct { /* of continuous states: which variable shows them, and which their derivatives */
    size_t variable, derivative;
} State;

typedef struct { /* a structural size */
    const char *name;
    size_t count;
} Dimension;

typedef struct { /* impulses out of a port: index of their first of `count` sums among the inputs, and of the loads */
    size_t sum, load, count;
} ImpulseInput;

typedef struct { /* jumps of a prescribed rate in reaction to impulses of its operator: inputs, output, memory */
    size_t sum, rate, acceleration, force, impulse;
} Reaction;

typedef struct { /* a unilateral liaison: where the memory has its mode and its account */
    const char *name;
    size_t closed, rests_from, impulse, impacts, loss;
} Gap;

typedef struct { /* dry friction: likewise; the gap whose force bounds it, or -1 */
    const char *name;
    size_t direction;
    long normal;
    size_t loss;
} DryFriction;

typedef struct { /* a constraint: what is said of it, and where `reach` has what is prescribed for it */
    const char *text;
    size_t first, count;
    const char *const *prescribed;
} Reach;

#define OFFSET(name) size_t name;
typedef struct { /* where the numbers of contacts are */
    CONTACT_NUMBERS(OFFSET)
    size_t count;
} ContactRows;
#undef OFFSET

typedef struct {
    const char *name, *guid;
    double tolerance; /* where the importer gives none */
    size_t parameters, inputs, outputs, states, memory, events; /* numbers */
    size_t coupled; /* the first so many states act on the motion; the others are integrals along it */
    size_t conditions, start_conditions; /* of the motion, and of the start: these and more */
    int guarded; /* rates and outputs have a second result, how far constraints are from losing rank */
    size_t redundant; /* so many constraints follow from the others: in model exchange all is calculated on them */
    size_t reach_rows, residuals; /* constraints, and numbers of `reach` */
    size_t drawn; /* so many of the outputs, the last ones, only a picture needs */
    int by_number;  /* in FMI 3.0, too, references stand for numbers: there are no arrays */
    size_t columns; /* of a table that the first parameters hold, and that a file may replace; or 0 */
    size_t variable_rows, start_rows, start_rate_rows, active_rows, account_rows, state_rows, dimension_rows;
    const Variable *variables; /* in the order of their indices; the time follows them */
    const Start *starts;
    const StartRate *start_rates;
    const Active *active;
    const Account *account; /* of mechanisms, where anything is prescribed */
    const unsigned char *jumps; /* of each pair of prescribed numbers; or NULL: jumps move no states */
    const State *state;
    const Dimension *dimensions;
    const char *const *condition_texts;
    const Reach *reaches;
    const unsigned char *configuration; /* of each state whether it is a coordinate; NULL unless guarded */
    Function *start;         /* (t, u, k) -> (y, m) */
    Motion motions[ACTIVITIES]; /* by what inputs do; the last ones are always right, the others are shorter */
    Function *calculate;     /* (t, y, u, k, m) -> z */
    Function *jump;          /* (t, y, u, k, m) -> y */
    Function *remember;      /* (t, y, u, k, m) -> m */
    Function *sample;        /* (t, y, u, k, m) -> m after the sample that is due; NULL: it does not sample */
    Function *nominals;      /* (t, y, u, k) -> sizes of y */
    Function *project;       /* (t, y, u, k) -> y put back onto the constraints after a step of the solver; or NULL */
    Function *reach;         /* (t, y, u, k) -> of each constraint what is left, from -1 to 1 if it is kept; what is prescribed */
    Function *draw;          /* (t, y, u, k) -> the last numbers of z; or NULL */
    Function *distances;     /* (t, y, u, k) -> how far each condition is from failing: must stay > 0 */
    Function *instants;      /* (k, t) -> when the component is not smooth; at least the first instant after t */
    /* directional derivatives: arguments, results, directions -> derivatives of the results; project: where constraints are redundant */
    Function *start_forward, *calculate_forward, *remember_forward, *project_forward;
    /* adjoint derivatives: arguments, results, weights of the results -> derivatives of the weighted sum; or NULL */
    Function *start_reverse, *calculate_reverse, *remember_reverse, *project_reverse;
    size_t most_arguments, most_results, integers, reals; /* work space of any of them */
    size_t gaps, frictions, operators, indicators; /* an indicator for each gap and dry friction; 0: no contacts */
    const Gap *gap;
    const DryFriction *friction;
    const size_t *operator;  /* where the memory sums the impulses of operators */
    const size_t *indicator; /* indices of the event indicators among the numbers */
    ContactRows rows;
    size_t momenta; /* of the product that G is, which `contact` leaves out; 0: G is among its numbers */
    Function *contact;  /* (t, y, u, k) -> numbers of the contacts, at these rows; or NULL, as the next two */
    Function *push;     /* (t, y, u, k, m, impulses, shifts) -> y, impulses of operators */
    Function *indicate; /* (t, y, u, k, m) -> event indicators */
    size_t impulse_rows, reaction_rows, impulses; /* impulses: sums of both */
    const ImpulseInput *impulse;
    const Reaction *reaction;
} Model;

extern const Model model;

/* Whether the component has contacts; where it has none, a linker that sees the whole program drops their code. */
static inline int has_contacts(void) { return model.indicators > 0; }

/* The reference of the first number or variable. */
static inline unsigned first_reference(const Model *component) { return 1 + (unsigned)component->dimension_rows; }

/* ---- an instance ---- */

typedef enum { SUCCESS, WARNING, DISCARD, ERROR } Status;

typedef enum {
    CONFIGURATION = 1,
    INSTANTIATED = 2,
    INITIALIZATION = 4,
    EVENT = 8,
    CONTINUOUS = 16,
    STEP = 32,
    INTERMEDIATE = 64, /* inside a communication step, after a step of the solver, in intermediate update mode */
    TERMINATED = 128,
    INPUT_REQUEST = 256 /* at the start of a communication step, when the importer may set inputs inside it */
} Phase;

typedef enum { USE_MODEL_EXCHANGE, USE_CO_SIMULATION, USE_CO_SIMULATION_WITH_EVENTS } Use;

/* What the inputs do inside a communication step. */
enum { HOLD, EXTRAPOLATE, INTERPOLATE };

typedef struct Instance Instance;
typedef void Report(void *owner, Status status, const char *text);
/* Called after each step of the solver; returns whether to return early, at the time *until. */
typedef int StepFinished(void *owner, double time, double *until);
/* Requests the inputs at a time, which the importer may set by core_set_requested_inputs. */
typedef void RequestInputs(void *owner, double time);

typedef struct {
    Use use;
    int whole; /* references stand for whole variables; a last one stands for the time */
    int early; /* communication steps may return early: where `step_finished` says so, and at time events */
    StepFinished *step_finished;   /* or NULL */
    RequestInputs *request_inputs; /* or NULL */
    Report *report;
    void *owner; /* passed to all three */
} Options;

/* NULL when memory runs out. */
Instance *core_new(const Model *model, const Options *options);
void core_free(Instance *);
void core_reset(Instance *);

/* Write down what contacts do at events from here on; NULL: no more. */
void core_record_contacts(Instance *, ContactRecord *);

Phase core_phase(const Instance *);
Use core_use(const Instance *);
double core_time(const Instance *);
/* Without a stop time NULL.  Tolerances from 1e-14 to 1e-2 are kept; 0: the component's own. */
Status core_setup(Instance *, double start_time, const double *stop_time, double tolerance);
void core_enter_configuration(Instance *);
void core_exit_configuration(Instance *);
void core_enter_initialization(Instance *);
Status core_exit_initialization(Instance *);
void core_terminate(Instance *);

/* `count` values of n variables; ERROR if they have more or less numbers.  What is read has to be finite: a number that
 * is not is an ERROR, in model exchange DISCARD, and so it is with derivatives. */
Status core_get(Instance *, const unsigned references[], size_t n, double values[], size_t count);
Status core_set(Instance *, const unsigned references[], size_t n, const double values[], size_t count);
/* Settings are "input_reconstruction", where there are inputs, and "symplectic_steps", where there are states. */
Status core_get_setting(const Instance *, unsigned reference, int *value);
Status core_set_settings(Instance *, const unsigned references[], size_t n, const int values[]);
const Dimension *core_dimension(const Instance *, unsigned reference); /* NULL if it is none */
/* Take a table, column after column, of which the first one ascends, instead of the one in the parameters. */
Status core_set_table(Instance *, const double numbers[], size_t count);
/* Until the first step has been done, a prescribed coordinate whose domain excludes 0 keeps its present start value where
 * 0 is set, with a warning: some importers set all inputs to 0 before they have read the outputs that these are
 * connected with.  A reset ends it; ERROR where there is no memory. */
Status core_ignore_zeros(Instance *);

/* J direction, and the sums of `weights` J, where J are the derivatives of the unknown by the known variables. */
Status core_directional_derivative(Instance *, const unsigned unknowns[], size_t unknown_count,
                                   const unsigned knowns[], size_t known_count, const double direction[],
                                   size_t direction_count, double result[], size_t result_count);
Status core_adjoint_derivative(Instance *, const unsigned unknowns[], size_t unknown_count, const unsigned knowns[],
                               size_t known_count, const double weights[], size_t weight_count, double result[],
                               size_t result_count);

/* co-simulation */
typedef struct { /* where a communication step has led */
    double time;
    int early; /* it did not get to its end */
    int event; /* the component is not smooth there: event mode is needed */
} Arrival;

Status core_set_input_derivatives(Instance *, const unsigned references[], size_t n, const int orders[],
                                  const double values[]);
Status core_output_derivatives(Instance *, const unsigned references[], size_t n, double values[], size_t count);
/* Inputs at a requested time; an input that is set at all of these follows their polynomial. */
Status core_set_requested_inputs(Instance *, const unsigned references[], size_t n, const double values[], size_t count);
/* A step that is refused is taken back: DISCARD if a shorter one would not be, and is not one that was discarded just
 * before from the same time as long or shorter; else ERROR.  So an importer that tries the same again comes to an end. */
Status core_step(Instance *, double time, double size, Arrival *arrival);
void core_enter_step_mode(Instance *);

/* model exchange */
Status core_set_time(Instance *, double time);
Status core_set_states(Instance *, const double y[]);
Status core_get_states(Instance *, double y[]);
Status core_get_derivatives(Instance *, double f[]);
void core_get_nominals(Instance *, double sizes[]);
void core_enter_continuous_mode(Instance *);

/* both, where events are used */
void core_enter_event_mode(Instance *);
/* Book what a jump of the inputs brought in, if it is finite; *changed: states have.  *next: time event, or INFINITY. */
Status core_update_discrete_states(Instance *, int *changed, double *next);


/* How many numbers references stand for. */
size_t core_count(const Instance *, const unsigned references[], size_t n);
/* An element of a variable that must be of this type; integers may be settings, too. */
Status core_get_typed(Instance *, NumberType type, unsigned reference, size_t element, double *value);
/* Refuse to set such a variable. */
Status core_refuse_typed(Instance *, NumberType type, unsigned reference, double value);
Status core_get_indicators(Instance *, double indicators[]);
/* Whether an event indicator is below 0. */
int core_has_event(Instance *, double time);

/* saved states: plain bytes, valid in any process */
size_t core_state_size(const Instance *);
void core_save(const Instance *, void *bytes);
/* Take back what core_save has written, or what core_check_state has found to be right. */
Status core_restore(Instance *, const void *bytes, size_t size);
/* Add the checksum that bytes need which leave the process; ERROR if it is wrong, or if they hold a number that no
 * instance can have. */
void core_seal(void *bytes);
Status core_check_state(Instance *, const void *bytes, size_t size);

/* Report a text and return its status. */
Status core_report(const Instance *, Status status, const char *format, ...);
/* What a call has to tell that returned WARNING, which it has not reported: text by text, then NULL. */
const char *core_told(Instance *);

#endif

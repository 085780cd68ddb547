/* What an instance is made of, for the files that move it. */
#ifndef LIAISONS_INSTANCE_H
#define LIAISONS_INSTANCE_H

#include <math.h>

#include "core.h"

/* Tolerances are kept between these: below, rounding errors take over. */
#define TIGHTEST 1e-14
#define LOOSEST 1e-2
/* A step of the solver may have this part of the tolerance as its error: those of many steps add up. */
#define SHARE 0.02

/* Index among the arguments, behind all others, where functions find the table that was taken: rows, columns; or NULL. */
enum { TABLE = 11 };

enum { TEXT = 512, NAME = 256, MOST_SYMPLECTIC_STEPS = 100000, MOST_STIFF_STATES = 1000 };
enum { ORDER = 5, COEFFICIENTS = ORDER + 1 }; /* of the polynomials that the inputs follow inside a step */

typedef struct { /* an input that moves inside a step */
    size_t index;
    const Variable *variable;
    int degree;
    double c[COEFFICIENTS]; /* of powers of the fraction of the step that has passed */
} Mover;

enum { EARLIER = 4 }; /* communication points before the present one that derivatives are derived from */
enum { ACCELERATION = 1, RATE_AND_ACCELERATION }; /* what is derived of a prescribed number */

typedef struct { /* of a prescribed number since the last communication point, or since events were handled */
    double value, rate, acceleration; /* at the start of the step */
    double size;                      /* of the step; 0: there was none */
    double followed;                  /* where its rate has led */
    double found, went, time;         /* the first mismatch, unless it is 0: what the rate said, and when */
    double given[2];                  /* rate and acceleration at the last point, as they were set */
    double still, turns, wrong;       /* steps without rates; with an acceleration that is wrong, by which part */
    double told;                      /* 1: that derivatives are missing */
    double points, times[EARLIER], values[EARLIER], rates[EARLIER]; /* the last ones, newest first */
} Past;

enum { PAST = sizeof(Past) / sizeof(double) }; /* numbers in one */

typedef struct { /* a prescribed number: its indices among the inputs, and its state */
    size_t value, rate, acceleration;
    double *mismatch, *derived; /* or NULL */
    Past *past;
    char *warned;             /* of its variable */
    double end[3];            /* in interpolation: value, rate and acceleration at the end of the step */
    int leaps;                /* and whether it jumps there, where its rates do not lead */
    int rests;                /* in the step that begins, as in the one before */
    int tells;                /* that derivatives are missing, from this step on */
    double jump, target, rest; /* while it jumps: how far, where to, and its rate aside from that */
} Prescribed;

/* The scalars of a saved state; of fixed size and without gaps.  Whoever adds one says in states.c what it may be. */
typedef struct {
    double time;
    double tolerance;
    double step;  /* that the solver goes on with; 0: unknown */
    double limit; /* the next time event: until then functions of time are taken from its left */
    int32_t phase;
    int32_t use;
    int32_t reconstruction;
    int32_t unstarted; /* y and m are still to be calculated from u and k */
    int32_t jumped;    /* inputs or parameters were set since m was remembered */
    int32_t expanded;  /* derivatives of inputs are given for the next step */
    int32_t symplectic_steps; /* in a communication step; 0: the error-controlled solver makes its own */
    int32_t known;            /* history holds something */
    int32_t stiff_solver;       /* 1: the implicit solver makes its own */
    int32_t stiffness_reported; /* of the explicit one */
} Scalars;

typedef struct { /* what references stand for, and how much memory a state takes */
    int by_variable;           /* references stand for variables, of which some are arrays */
    size_t numbers, references; /* how many there are of each, settings and sizes aside */
    unsigned first;            /* reference, which stands for the first of them */
    size_t state_size, moving_size; /* in bytes: of all, and of the front, which a communication step changes */
} Layout;

/* In one block of memory: what a saved state holds, the scalars in front; then what follows from it. */
typedef struct {
    double *u;       /* inputs at the present time */
    double *y, *low; /* states, and the part of their sum that is too small for them */
    double *m;
    Past *past;      /* of the prescribed numbers */
    double *history; /* of the symplectic solver */
    double *applied; /* sums of impulses, and of reactions, that the states have taken */
    double *taylor;  /* given derivatives of the inputs, COEFFICIENTS each; the 0th says whether there are any */
    double *size;    /* of the states: scales the tolerance */
    double *k, *set; /* parameters, inputs as they were set last */
    double *z, *t;   /* follow k and set in memory, but are no part of the state */
} Vectors;

typedef struct { /* what need not be done again */
    int current; /* z belongs to the state */
    int drawn;   /* and so do its last numbers, which only a picture needs */
    int apart;   /* u may have moved away from set */
    int allowed; /* k and set are known to be in their domains */
    int derives; /* rates of prescribed coordinates are derived, perhaps */
    int rests;   /* no input was set since a step in which none moved and all prescribed coordinates rested */
    unsigned asked; /* in model exchange: how often for derivatives; how many of the next ones are looked at closely */
    int suspect;
    double infinite; /* time at which it was said that a multiplier is */
} Known;

typedef struct { /* the communication step under way */
    Scalars *backup; /* the moving part of the state before it */
    double start, size;
    double reach;         /* how far it leads: its size, or less */
    int returning;        /* the importer has just shortened it */
    const Motion *motion; /* of the states, by what the inputs do */
    int curable;          /* it fails, and a shorter one would not */
    /* The last step that was discarded; from NAN there was none since a step, a reset, a saved state led elsewhere. */
    double discarded_from, discarded_size;
    double kept_until; /* constraints, as far as the solver has come */
    int torn;          /* it got where constraints are not kept */
    int event; /* it ends early at an event of a contact, which the importer is to handle */
    int apart; /* σ or σ̇ does not move as σ̇ and σ̈ say, as where they are held */
} Step;

typedef struct { /* a parameter or input that must be in a domain */
    size_t index;
    const Variable *variable;
} Bounded;

typedef struct { /* the inputs that move inside the step */
    Mover *list;
    size_t count, *of_input; /* index of an input among them */
    const Variable **variable_of; /* an input */
    double *given;           /* by the importer, at ORDER times inside the step; those of one input side by side */
    size_t requested;          /* which of these times it is */
} Movers;

typedef struct { /* the numbers that an operator prescribes */
    Prescribed *list;
    size_t count;
    char *warned; /* of each variable: it has been said that it contradicts itself */
} Operator;

typedef struct { /* directions along (t, y, u, k, m), what z does there, or weights of them */
    double t, *y, *u, *k, *m, *z;
} Directions;

typedef struct { /* scratch memory */
    double *work; /* of the solvers */
    double *kept; /* states on their way to the constraints, as often as they were projected, MOST_PROJECTIONS at most */
    size_t projections;
    double *aside; /* of limits: inputs, states, rates, and results on both sides */
    double *condition, *instant;
    double *residual;         /* of constraints, and what is prescribed for them */
    double *projected, *anchor; /* states, on their way onto the constraints, and where these were kept last */
} Scratch;

typedef struct { /* of generated functions */
    double now;
    double margin; /* of the last guarded function, how far constraints are from losing rank; INFINITY: none is guarded */
    /* Of those that `evaluate` calls: all but y and the first result stay as they are. */
    const double **arguments;
    double **results;
    const double **other_arguments; /* of the others */
    double **other_results;
    long long *integers;
    double *reals;
} Call;

typedef struct {
    char text[TEXT]; /* why the present call fails */
    char *name;      /* of a number that is named in a message */
} Words;

typedef struct {
    double *all, *operators, *indicators;
    ContactNumbers numbers; /* columns of all */
    double lowest; /* part of its scale below which bounces of a gap are summed */
    const double *before; /* rates before inputs have jumped in an impact; NULL: they have not */
    ContactRecord *record; /* NULL: nobody asks for it */
    long crossed; /* the contact whose indicator has ended a step of the solver, counted from 1; 0: none has */
} Contacts;

struct Instance {
    const Model *model;
    Options options;
    Layout layout;
    Scalars *s;
    Vectors v;
    Known known;
    Step step;
    Movers movers;
    Bounded *bounded; /* behind the last one: NULL for its variable */
    Operator prescribed;
    Directions d, e; /* e: what is to be added to d */
    double *table;   /* that was taken: how many rows, then its columns; or NULL */
    double *starts;  /* of the inputs, which prescribed coordinates keep where 0 is set before the first step; or NULL */
    Scratch scratch;
    struct Stiff *stiff; /* memory of the implicit solver; NULL until it is used */
    Call call;
    Words words;
    Contacts contacts;
    int refused; /* the start, for the reason in words */
};

typedef struct { /* consecutive numbers */
    size_t first, count;
} Span;

/* ---- variables ---- */

/* The variable of a number. */
const Variable *core_variable_at(const Model *, size_t index);
/* The index of a state, or of its derivative, among the variables. */
size_t core_index_of_state(const Model *, size_t i, int derivative);
const char *core_name(const Instance *, size_t index);
Status core_check_references(const Instance *, const unsigned references[], size_t n, size_t count);

/* What a reference, which exists, stands for. */
static inline Span span_of(const Instance *self, unsigned reference) {
    const size_t index = reference - self->layout.first;
    if (!self->layout.by_variable) return (Span){index, 1};
    const Variable *variable = &self->model->variables[index];
    return (Span){variable->first, variable->count};
}

static inline int allows(const Variable *variable, double value) {
    if (variable->strict) return value > variable->minimum && value < variable->maximum;
    return value >= variable->minimum && value <= variable->maximum;
}

/* ---- checks: 1, or 0 and the reason is noted ---- */

int core_because(Instance *, const char *format, ...);
/* The value of a parameter or input is not allowed. */
int core_outside(Instance *, size_t index, double value, double t);
int core_check_domains(Instance *, double t);
int core_check_conditions(Instance *, double t, const double *y, size_t count);
/* Whether states keep all constraints but for a multiple of rounding. */
int core_keeps(Instance *, double t, const double *y, double multiple);
/* Put states, of which `residual` has what is left of the constraints, onto these, as far as Newton's method leads. */
int core_approach_constraints(Instance *, double t, double *y);
static inline int core_put_onto_constraints(Instance *self, double t, double *y) {
    return self->model->reach_rows == 0 || core_keeps(self, t, y, 1) || core_approach_constraints(self, t, y);
}
/* States, or with `derivatives` those. */
int core_check_finite(Instance *, const double *values, int derivatives, double t);

/* Four at a time, for that is as fast as they can be read: x - x is 0 for finite numbers only. */
static inline int all_finite(const double *v, size_t n) {
    for (; n >= 4; n -= 4, v += 4)
        if (!(((v[0] - v[0]) + (v[1] - v[1])) + ((v[2] - v[2]) + (v[3] - v[3])) == 0)) return 0;
    for (; n > 0; n--, v++)
        if (!isfinite(*v)) return 0;
    return 1;
}

/* Report the first of these variables whose number is not finite; `what` it is of them. */
Status core_refuse_infinite(Instance *, const unsigned references[], const double *values, size_t count,
                            const char *what);

/* 0: the first of the calculated variables that is not finite. */
int core_because_infinite(Instance *);

/* A number that is not finite, alike on all platforms. */
const char *core_spelled(double value);

/* ---- prescribed coordinates ---- */

void core_find_prescribed(Instance *);
void core_follow(Instance *);       /* start again: the motion has followed what is prescribed now */
void core_depart(Instance *);       /* a communication step begins */
void core_arrive(Instance *);       /* and ends */
void core_stay(Instance *);         /* and ends, in which nothing that is prescribed moves, as in the one before */
void core_compare(Instance *);      /* what is prescribed now with what was at the start of the last step */
int core_compare_ends(Instance *);  /* in interpolation: both ends of the step that begins; whether any of them leaps */
/* Find whether rates are missing in what was given, and derive them; whether all that is prescribed rests. */
int core_look(Instance *);
void core_derive(Instance *);       /* missing rates at the present time */
void core_reach(Instance *);        /* the inputs at the end of a step that interpolates */
int core_watch(Instance *);         /* in model exchange: whether it is to be told that rates are missing */
int core_tell(Instance *);          /* whether rates begin to be missing in this step, which core_told tells */
void core_warn(Instance *, int last); /* of what has been found before the present step, once for each variable */
void core_leap(Instance *);         /* move the states along with jumps */

/* Size of the copies of states that are put onto constraints. */
static inline size_t states_of_constraints(const Model *model) { return model->reach_rows > 0 ? model->states : 0; }

/* ---- generated functions ---- */

/* Correct the rates of work: power is that along σ̇ and σ̈, work is done along the σ and σ̇ of this step; z is then another. */
void core_correct_work(Instance *, double t, const double y[], double f[]);
/* The derivatives of the rates of coupled states by these, row after row; z is then another. */
void core_jacobian(Instance *, double time, const double y[], double J[]);

void core_start(Instance *);    /* y and m at initialization, if they do not yet follow from u and k */
enum { MOST_PROJECTIONS = 4 };
const double *core_follow_constraints(Instance *);
/* The states that all is calculated from: y; in model exchange with redundant constraints those on them next to y, which
 * it follows. */
static inline const double *core_kept_states(Instance *self) {
    return self->model->redundant == 0 ? self->v.y : core_follow_constraints(self);
}
/* Replace what z, or a direction of it, has of the states and their derivatives, calculated from the kept ones. */
void core_correct_states(Instance *, double z[], const double y[], const double kept[]);
static const double RETURN = 20; /* rate at which y comes back to the kept ones [1/s] */
void core_measure(Instance *);  /* sizes of y */
void core_update(Instance *);   /* z at the present time, but for what only a picture needs */
/* m; 0 if it would not be finite, which leaves it. */
int core_remember(Instance *);
/* Take the sample that is due, or again that of this instant with the present inputs; 0 and a reason if it is not finite. */
int core_sample(Instance *);
void core_jump(Instance *);     /* the inputs have jumped: states that an impulse changes, say the work done */
/* The first instant after t at which the component with these parameters is not smooth; INFINITY if there is none. */
double core_next_instant(Instance *, const double *k, double t);

/* At an event a function of time may jump; it is not there yet. */
static inline double before_limit(const Instance *self, double t) {
    return t >= self->s->limit ? nextafter(self->s->limit, -INFINITY) : t;
}

static inline int evaluate_now(Instance *self, Function *function, const double *y, double *result) {
    self->call.arguments[1] = y;
    self->call.results[0] = result;
    return function(self->call.arguments, self->call.results, self->call.integers, self->call.reals, 0);
}

/* dy/dt of all states, whatever the inputs do. */
static inline Function *derivatives_of(const Model *model) { return model->motions[ACTIVITIES - 1].all; }

enum { ASIDE = 3 }; /* times on either side that limits are calculated from */
/* Margins below which rates and outputs are taken as limits, and below which what has no limit is no number. */
static const double NARROW = 1e-5, POLE = 1e-8;
/* Margin from which on numbers are good enough to have limits calculated from them. */
static const double WIDE = 4e-5;

/* Whether constraints lose rank where a guarded function was called last. */
static inline int core_is_singular(const Instance *self) { return self->call.margin < NARROW; }

/* Replace what a guarded function has at a time, where it is singular, by its limits; the first number without, or -1. */
long core_take_limits(Instance *, Function *function, double t, const double y[], double result[], size_t n);
int core_has_limits(Instance *); /* the outputs at the end of a step that constraints of little rank lead to; 0 and a reason */

int core_evaluate_at_limit(Instance *self, Function *function, const double *y, double *result);

/* Call a function of (t, y, u, k) or (t, y, u, k, m) with one result, which must be none of the arguments.  Returns what
 * the function does, 0, so that compilers make a jump of the call where that is returned in turn. */
static inline int evaluate(Instance *self, Function *function, double t, const double *y, double *result) {
    if (t >= self->s->limit) return core_evaluate_at_limit(self, function, y, result);
    self->call.now = t;
    return evaluate_now(self, function, y, result);
}

#endif

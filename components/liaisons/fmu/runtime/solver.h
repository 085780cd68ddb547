/* Solver with error control: DOP853, see solver.c. */
#ifndef LIAISONS_SOLVER_H
#define LIAISONS_SOLVER_H

#include <stddef.h>

/* A step below this fraction of the interval gets nowhere. */
#define SMALLEST 1e-13

typedef enum { GO_ON, STOP } Signal; /* GO_ON is 0, which generated functions return */
typedef enum { REACHED, STOPPED, STUCK, EXHAUSTED, CROSSED } Outcome;
typedef Signal Rates(void *context, double t, const double y[], double f[]); /* f = dy/dt */
typedef struct Events Events;

typedef struct {
    size_t n, coupled; /* states; the first so many act on the rates, the others are integrals along the motion */
    double tolerance;
    const double *size; /* of each component: the error of a step stays below tolerance * (size + |y|) */
    Rates *rates, *coupled_rates;                          /* of all, and of the coupled ones, which cost less */
    Signal (*accept)(void *context, double t, double y[]); /* called after each step; may correct y */
    void *context;
    const Events *events; /* at the first of which a step ends; or NULL */
    void (*report_stiffness)(void *context, double t); /* called where the steps are as long as stability allows; or NULL */
} Problem;

struct Events {
    /* Shorten an accepted step from t to the first event in it: *h, and the stages; *crossed: whether there is one. */
    Signal (*shorten)(const Problem *, double t, double *h, const double y[], double work[], int *crossed);
    size_t indicators; /* an event is where one of them falls below 0 */
    int (*watch)(void *context, double t, const double y[], double indicators[]); /* 0: it cannot be there */
    double least; /* how far apart events are: what the clock resolves */
    /* Told which indicator falls, or -1: one turns too near to 0 to tell; NULL: nobody asks for either. */
    void (*note)(void *context, double t, long which);
};

enum { SOLVER_COLUMNS = 14, MOST_STEPS = 100000, FEW_STEPS = 8192 };

typedef struct { /* towards an end; all 0 at the beginning */
    long steps, last; /* taken, and taken when it was looked at */
    double passed;    /* where that was */
} Pace;

/* Count a step at t; whether MOST_STEPS are not enough.  After FEW_STEPS, twice as many, ..., that is told from the pace
 * since the time before, so that what leads nowhere is given up soon. */
int solver_is_exhausted(Pace *, double t, double end);

/* All stages of a step but the first, which is in the first column of work already; the last two columns are then the
 * state of the last stage and the increment of order 8 divided by h.  *error: the estimated error of the step in units
 * of what is allowed. */
Signal solver_stages(const Problem *, double t, double h, const double y[], double work[], double *error);

/* Integrate from *t to exactly `end`.  y + low is the state, summed in twice the precision.  *step is the step size
 * to try, 0 if unknown, and on return the one to go on with.  work holds SOLVER_COLUMNS * n numbers, with events
 * EVENT_COLUMNS * n.
 * STOPPED: one of the functions said so.  STUCK: no step is small enough.  EXHAUSTED: it takes more than
 * MOST_STEPS, the rejected ones among them.  All three leave *t, y, low where they got.  CROSSED: an event indicator
 * has fallen below 0; the last step ends there. */
Outcome solver_advance(const Problem *problem, double *t, double end, double y[], double low[], double *step,
                       double work[]);

#endif

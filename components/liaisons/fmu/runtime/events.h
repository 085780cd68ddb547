/* The first event inside a step of the solver: see events.c. */
#ifndef LIAISONS_EVENTS_H
#define LIAISONS_EVENTS_H

#include "solver.h"

enum { EVENT_COLUMNS = 26, EVENT_DEGREE = 7 }; /* of the solver's work: its own, extra stages, polynomials and a state */

/* Where the work has the polynomials of a step, EVENT_DEGREE columns f: the state at its part x is
 * y + x (f0 + (1 - x) (f1 + x (f2 + (1 - x) (f3 + ...)))). */
static inline double *events_columns(const Problem *p, double *work) { return work + 18 * p->n; }

/* Repeat the step with another size: the state at its end.  STOP: it cannot be taken. */
typedef Signal Repeat(void *method, double h, double end[]);

/* Shorten an accepted step of any method, whose polynomials are in the work, to the first event in it: *h; whether there
 * is one.  The method has then taken the shorter step, whose end is moved to where an indicator is 0 for the step itself,
 * not only for its polynomials. */
Signal events_locate(const Problem *, double t, double *h, const double y[], double work[], Repeat *, void *method,
                     int *crossed);

/* What Events.shorten is. */
Signal events_shorten(const Problem *, double t, double *h, const double y[], double work[], int *crossed);

#endif

/* The first event inside a step of the solver: see events.c. */
#ifndef LIAISONS_EVENTS_H
#define LIAISONS_EVENTS_H

#include "solver.h"

enum { EVENT_COLUMNS = 26 }; /* of the solver's work: its own, then the extra stages, polynomials and a state */

/* What Events.shorten is. */
Signal events_shorten(const Problem *, double t, double *h, const double y[], double work[], int *crossed);

#endif

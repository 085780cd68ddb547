/* Stiff solver with error control: Radau IIA, of order 5, see stiff.c. */
#ifndef LIAISONS_STIFF_H
#define LIAISONS_STIFF_H

#include "solver.h"

typedef struct Stiff Stiff; /* memory: matrices, and vectors of the stages */

/* The derivatives of the coupled rates by the coupled states at t, y: row after row. */
typedef Signal Jacobian(void *context, double t, const double y[], double J[]);

/* NULL when memory runs out. */
Stiff *stiff_new(size_t n, size_t coupled);
void stiff_free(Stiff *);

/* Integrate from *t to exactly `end`, as solver_advance does, whose outcomes and step it has; `work` holds EVENT_COLUMNS
 * * n numbers if there are events, else it is not used. */
Outcome stiff_advance(const Problem *, Jacobian *, Stiff *, double *t, double end, double y[], double low[], double *step,
                      double work[]);

#endif

/* Symplectic solver with fixed steps: Gauss, of order 6, see symplectic.c. */
#ifndef LIAISONS_SYMPLECTIC_H
#define LIAISONS_SYMPLECTIC_H

#include <stdint.h>

#include "solver.h"

enum { SYMPLECTIC_COLUMNS = 7, HISTORY = 6 };

/* Whether inputs move so fast between t and t + h that three points say little of what integrals along the motion are. */
typedef int Rough(void *context, double t, double h);

/* Integrate from *t to exactly `end` in equal steps as large as `step` allows.  y + low is the state, summed in twice
 * the precision.  history holds HISTORY columns of the first `coupled` states, from which the next step is guessed;
 * *known says that it is filled.  `rough` may be NULL.  work holds SYMPLECTIC_COLUMNS * n numbers.
 * STOPPED: one of the functions said so.  STUCK: a step does not converge.  Both leave *t, y, low where they got. */
Outcome symplectic_advance(const Problem *problem, Rough *rough, double *t, double end, double step, double y[],
                           double low[], double history[], int32_t *known, double work[]);

#endif

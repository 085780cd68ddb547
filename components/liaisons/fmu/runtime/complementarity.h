/* Modes of contacts, gaps first, then dry friction: see complementarity.c.  Nothing here knows an instance. */
#ifndef LIAISONS_COMPLEMENTARITY_H
#define LIAISONS_COMPLEMENTARITY_H

#include <stddef.h>

#include "contact_limits.h"

enum { OPEN, CLOSED };                           /* modes of a gap; */
enum { BACKWARD = -1, STICKS = 0, FORWARD = 1 }; /* of dry friction */

typedef signed char Modes[MOST_CONTACTS];

typedef struct { /* which modes make rates, as they would be without forces, what they have to be */
    size_t gaps, contacts;
    const double *G;             /* change of the rates by forces, column after column */
    const double *stick, *slide; /* thresholds of dry frictions; parts of the force of the gap where there is one */
    int impulses;                /* forces are impulses: those of thresholds without a gap are 0 */
    long normal[MOST_CONTACTS];  /* of each dry friction: the gap whose force bounds it, or -1 */
    double rate[MOST_CONTACTS], tolerance[MOST_CONTACTS];
    size_t n, contact[MOST_CONTACTS]; /* whose modes are to be chosen */
} Complementarity;

typedef enum { CHOSEN, PARADOX, CONTRADICTION } Choice; /* no modes are consistent; or some of them have no forces */

/* Choose modes, the present ones first, then those that hold most; forces x, and rates with them. */
Choice complementarity_choose(const Complementarity *, Modes modes, double x[], double rate[]);

/* Whether a mode keeps the rate of a contact at 0. */
static inline int complementarity_holds(const Complementarity *p, const Modes modes, size_t i) {
    if (i < p->gaps) return modes[i] == CLOSED;
    const long normal = p->normal[i - p->gaps];
    return modes[i] == STICKS && (normal < 0 || modes[normal] == CLOSED);
}

/* Solve K x = right, row after row of MOST_CONTACTS numbers, in place.  Rows that depend on others are left out, and of
 * all solutions it is the one in the range of K: the shortest one if K is symmetric.  How many rows depend on others. */
size_t complementarity_solve(double K[], size_t n, double right[]);

#endif

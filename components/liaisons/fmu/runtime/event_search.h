/* The first event inside a step of any method, whose polynomials and repetition it has: see event_search.c.  Nothing here
 * knows an instance. */
#ifndef LIAISONS_EVENT_SEARCH_H
#define LIAISONS_EVENT_SEARCH_H

#include <stddef.h>

enum { MOST_INDICATORS = 64 };

typedef struct { /* a step; its functions return 0 where they fail */
    void *step;
    size_t indicators;
    int (*look)(void *step, double part, double values[]);   /* indicators by the polynomials at a part of the step */
    int (*repeat)(void *step, double part, double values[]); /* take that part of the step: indicators at its end */
} EventSearch;

/* Part of a step at which an indicator first falls below 0; 2 if none does.  *graze: part at which one turns so near to
 * 0 that rounding decides, if one does; NULL: nobody asks, and what dips by less than 1e-9 may be overlooked. */
double event_search_first(const EventSearch *, double *graze);

/* Repeat the step so that it ends where the indicator that falls at *part is 0 for the step itself, not only for its
 * polynomials; 0 where that fails. */
int event_search_repeat(const EventSearch *, double *part, size_t *which);

#endif

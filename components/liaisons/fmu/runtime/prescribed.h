/* Numbers that an operator prescribes, for the files that follow them from one communication point to the next. */
#ifndef LIAISONS_PRESCRIBED_H
#define LIAISONS_PRESCRIBED_H

#include <float.h>

#include "inputs.h"

/* So many steps in succession show that a rate is missing, or that an acceleration is wrong. */
enum { SEVERAL = 3 };
/* An acceleration is wrong where it misses this part of what both say of the change of the rate; by so much at most that
 * part changes from step to step. */
static const double WRONG = 0.25;
/* What is so many times as much as its rate and acceleration say is a jump. */
static const double FAR = 5;

#define FOR_EACH(p) \
    for (Prescribed *p = self->prescribed.list, *const end_of_##p = p + self->prescribed.count; p < end_of_##p; p++)

/* The number, or the largest one if it overflows: a saved state has finite numbers only. */
static inline double bounded(double x) { return x - x == 0 ? x : isnan(x) ? 0 : x > 0 ? DBL_MAX : -DBL_MAX; }

/* Whether rates are missing, and derived. */
static inline int derives(const Prescribed *p) { return p->derived != NULL && *p->derived > 0; }

/* Replace what is missing of value, rate and acceleration at a time; whether the polynomial was left at a jump. */
int prescribed_derive(const Prescribed *, double t, double numbers[3]);
/* Remember the present point, as the last one before the next. */
void prescribed_remember(Instance *, Prescribed *);
/* Look at what was given at both ends of a step: do rates stay 0 while the value goes on, or does the acceleration while
 * the rate does, then it is missing. */
void prescribed_look(Prescribed *, double H, const double from[3], const double to[3]);

#endif

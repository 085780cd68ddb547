/* Unilateral liaisons and dry friction: see unilateral.c.  What returns 0 has noted a reason.
 * In a component without contacts nothing happens. */
#ifndef LIAISONS_UNILATERAL_H
#define LIAISONS_UNILATERAL_H

#include "instance.h"

int core_settle_contacts(Instance *, double time);
/* Impacts, then modes, at the present state and an instant; a gap that overlaps by more than rounding is refused. */
static inline int core_settle(Instance *self, double time) {
    return !has_contacts() || core_settle_contacts(self, time);
}

/* Whether there are impacts, or other modes, at the present state: an event for an importer that handles them. */
int core_is_unsettled(Instance *, double time);
/* Put what is held back to 0 after a step of the solver. */
void core_uphold(Instance *, double time);
/* The same at an event of model exchange, before anything has jumped: what an importer's errors are is no impact. */
void core_uphold_before(Instance *);
/* Calculate the rates of all contacts. */
void core_contact_rates(Instance *, double time, double rate[]);
/* The first instant after a time at which bounces that have been summed end; infinity if there is none. */
double core_next_rest(const Instance *, double time);
/* Write down that an event indicator turns too near to 0 to tell whether it falls below. */
void core_note_graze(Instance *, double time);
/* A prescribed coordinate has jumped a little: bodies that it touches go with it. */
void core_follow_gaps(Instance *);

#endif

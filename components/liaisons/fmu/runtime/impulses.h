/* Impulses through ports: see impulses.c. */
#ifndef LIAISONS_IMPULSES_H
#define LIAISONS_IMPULSES_H

#include "instance.h"

/* Apply what the sums of impulses have grown by, with the impacts of its contacts; 0 with a reason if that fails. */
int core_take_impulses(Instance *);
/* The same unless it fails; the step that follows says why. */
void core_try_impulses(Instance *);
/* Take the sums as they are for those that have been applied. */
void core_note_impulses(Instance *);

#endif

/* What contacts do at events: an instance writes it down for those who ask, and derivatives replay it.  Nothing here knows
 * an instance. */
#ifndef LIAISONS_CONTACT_RECORD_H
#define LIAISONS_CONTACT_RECORD_H

#include <stddef.h>

/* Kinds of records.  An event has impacts, and bounces that end because they are too low to be followed; last come the modes
 * that are chosen.  Between events an indicator may turn so near to 0 that rounding decides.  The others are of numbers
 * by which modes are chosen and which are 0: where they are not, there are other impacts or modes. */
enum { SETTLED, STRUCK, CAME_TO_REST, GRAZED, WEAK_GAP, WEAK_RATE, WEAK_IMPACT, WEAK_REST };

typedef struct {
    double time;
    double scale;     /* of a number that is 0 */
    long kind, which; /* SETTLED: the contact whose indicator has fallen below 0, or -1; of a number: its contact */
} ContactEvent;

typedef struct {       /* of a contact in it */
    double impulse;    /* of an impact */
    double rests_from; /* instant from which a gap rests; SETTLED */
    long mode;         /* that is chosen; CAME_TO_REST: CLOSED if it is brought to rest */
    long approaches;   /* before an impact */
    long counts;       /* the impact, at this gap */
} ContactAct;

typedef struct { /* of all contacts one after another; beyond `most` records are only counted */
    ContactEvent *events;
    ContactAct *acts;
    size_t count, most;
} ContactRecord;

#endif

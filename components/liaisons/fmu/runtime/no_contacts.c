/* In place of unilateral.c, complementarity.c, events.c and event_search.c in a component without contacts, of which
 * these are a fifth of what is compiled. */
#include "events.h"
#include "unilateral.h"

double core_next_rest(const Instance *self, double time) { return (void)self, (void)time, INFINITY; }
int core_is_unsettled(Instance *self, double time) { return (void)self, (void)time, 0; }
int core_has_event(Instance *self, double time) { return (void)self, (void)time, 0; }

/* Not called: see has_contacts. */
int core_settle_contacts(Instance *self, double time) { return (void)self, (void)time, 1; }
void core_uphold(Instance *self, double time) { (void)self, (void)time; }
void core_uphold_before(Instance *self) { (void)self; }
void core_contact_rates(Instance *self, double time, double rate[]) { (void)self, (void)time, (void)rate; }
void core_note_graze(Instance *self, double time) { (void)self, (void)time; }
void core_follow_gaps(Instance *self) { (void)self; }

Signal events_locate(const Problem *p, double t, double *h, const double y[], double work[], Repeat *repeat, void *method,
                     int *crossed) {
    (void)p, (void)t, (void)h, (void)y, (void)work, (void)repeat, (void)method;
    *crossed = 0;
    return GO_ON;
}

Signal events_shorten(const Problem *p, double t, double *h, const double y[], double work[], int *crossed) {
    return events_locate(p, t, h, y, work, NULL, NULL, crossed);
}

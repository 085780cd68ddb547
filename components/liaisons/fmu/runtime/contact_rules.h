/* Rules of contacts at one instant: what is rounding, what takes part in an impact, what rests, which bounces are low.
 * Nothing here knows an instance. */
#ifndef LIAISONS_CONTACT_RULES_H
#define LIAISONS_CONTACT_RULES_H

#include <math.h>

#include "complementarity.h"

/* Numbers of contacts, gaps first, then dry friction, without contact forces: rates, accelerations, their change by
 * forces G, sizes of their terms; of gaps; thresholds of dry friction.  Of redundant contacts G is the product of changes of
 * rates by momenta, and of momenta by forces, column after column. */
#define CONTACT_NUMBERS(NUMBER) \
    NUMBER(v) NUMBER(a) NUMBER(G) NUMBER(rates_by_momenta) NUMBER(momenta_by_forces) NUMBER(rate_scale) NUMBER(acceleration_scale) \
    NUMBER(gap) NUMBER(scale) NUMBER(restitution) NUMBER(stick) NUMBER(slide)

#define COLUMN(name) const double *name;
typedef struct { CONTACT_NUMBERS(COLUMN) } ContactNumbers;
#undef COLUMN

/* Parts of the scale of a position and of an acceleration that are rounding errors; of a position, what is an overlap, and how
 * far a closed gap may drift. */
static const double TOUCHING = 1e-12, BALANCED = 1e-13, OVERLAP = 1e-9, DRIFT = 1e-3;
/* Bounces that are lower than this part of the scale are not followed; of what was closed.  Impacts count after a fall
 * from higher than this part of it: bounces that are summed, which are lower for every importer, do not. */
static const double LOWEST = 1e-12, LIFTED = 1e-9, COUNTED = 1e-6;
/* What sticks stays so where its rate is off by this part of its scale. */
static const double STICKING = 1e-9;

/* How far a gap may be from 0 by rounding of positions, and of the time at which others move. */
static inline double contact_rounding(const ContactNumbers *c, size_t i, double time) {
    const double tick = nextafter(fabs(time), INFINITY) - fabs(time);
    return TOUCHING * c->scale[i] + 2 * tick * c->rate_scale[i];
}

static inline int contact_approaches(const ContactNumbers *c, size_t i, double rate) { return rate < -STILL * c->rate_scale[i]; }

/* Add those to a problem of impulses that take part in an impact of all gaps that touch: v+ >= max(0, -e v-), with
 * friction; v-: `reflected` rates. */
static inline void contact_add_impact(const ContactNumbers *c, const int touching[], const double reflected[],
                                      Complementarity *p, Modes modes) {
    for (size_t i = 0; i < p->contacts; i++) {
        const int gap = i < p->gaps;
        const long pressed = gap ? (long)i : p->normal[i - p->gaps];
        const int takes = pressed >= 0 && touching[pressed]
                          && fmin(c->v[pressed], reflected[pressed]) <= STILL * c->rate_scale[pressed];
        p->rate[i] = c->v[i] - (gap && reflected[i] < 0 ? -c->restitution[i] * reflected[i] : 0);
        p->tolerance[i] = BALANCED * c->rate_scale[i];
        if (!gap) modes[i] = FORWARD; /* without a force it has no effect */
        if (!takes) continue;
        if (gap) modes[i] = CLOSED;
        p->contact[p->n++] = i;
    }
}

/* Add those to a problem of forces that touch and rest, and what does not slide; the modes of the others.  With others, an
 * importer has found the instant at which it does not; there it sticks if it can, as at a start. */
static inline void contact_add_rest(const ContactNumbers *c, const int touching[], int together, Complementarity *p, Modes modes) {
    for (size_t i = 0; i < p->contacts; i++) {
        const int gap = i < p->gaps, sticks = !gap && (together || complementarity_holds(p, modes, i));
        const int still = fabs(c->v[i]) <= (sticks ? STICKING : STILL) * c->rate_scale[i];
        const long normal = gap ? -1 : p->normal[i - p->gaps];
        p->rate[i] = c->a[i];
        p->tolerance[i] = BALANCED * c->acceleration_scale[i];
        if (gap && !(touching[i] && still)) modes[i] = OPEN;
        else if (normal >= 0 && !touching[normal]) modes[i] = STICKS; /* it has no force */
        else if (!still) modes[i] = c->v[i] > 0 ? FORWARD : BACKWARD;
        else {
            if (together && !gap) modes[i] = STICKS;
            p->contact[p->n++] = i;
        }
    }
}

/* Whether impulses x have added energy to rates before them, by more than rounding. */
static inline int contact_gains_energy(const ContactNumbers *c, size_t contacts, const double before[], const double x[]) {
    double gain = 0, size = 0;
    for (size_t i = 0; i < contacts; i++) {
        gain += x[i] * (before[i] + c->v[i]) / 2;
        size += fabs(x[i]) * (fabs(before[i]) + 1e-2 * c->rate_scale[i]); /* STILL is rounding */
    }
    return gain > ENERGY_GAIN * size;
}

/* Whether an impact at this rate counts. */
static inline int contact_counts(const ContactNumbers *c, size_t i, double rate) {
    return contact_approaches(c, i, rate) && rate * rate > 2 * fabs(c->a[i]) * COUNTED * c->scale[i];
}

/* Whether a gap with this rate and acceleration comes back. */
static inline int contact_bounces(const ContactNumbers *c, size_t i, double v, double a) {
    return v > STILL * c->rate_scale[i] && a < 0;
}

static inline double contact_bounce_height(double v, double a) { return v * v / (-2 * a); }

/* A step inside which the next impact lies. */
static inline double contact_bounce_step(double v, double a) { return -2.5 * v / a; }

/* Duration of a bounce with all that follow. */
static inline double contact_bounces_duration(double v, double a, double restitution) {
    return restitution < 1 ? 2 * v / (-a * (1 - restitution)) : 0;
}

#endif

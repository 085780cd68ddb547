/* The first event inside a step: a search over the polynomials of the step, then corrections by the step itself. */
#include "event_search.h"

#include <math.h>
#include <string.h>

enum { DEEPEST = 12, MOST_TRIALS = 60, MOST_CORRECTIONS = 4 };

/* Where an event is an indicator has this value: a gap of 0; what is below is an event, and not by rounding. */
static const double MARGIN = 1e-13;
/* Where an indicator turns nearer to 0 than this, rounding decides whether there is an event. */
static const double GRAZING = 1e-12;
/* Part of an interval at which it is divided: off the middle, so that no period hides between. */
static const double OFF = 0.4871;

/* Part at which an indicator that falls between parts a and b has the value MARGIN (regula falsi, Illinois). */
static double fall(const EventSearch *s, size_t which, double a, double at_a, double b, double at_b) {
    const double target = at_a > MARGIN ? MARGIN : 0;
    double values[MOST_INDICATORS], left = at_a - target, right = at_b - target;
    for (int i = 0; i < MOST_TRIALS && b - a > 1e-15 * b; i++) {
        const double part = fmax(a + (b - a) * left / (left - right), a + 1e-15 * b); /* left may be 0 */
        if (!(part < b) || !s->look(s->step, part, values)) break;
        const double value = values[which] - target;
        if (value <= 0) {
            b = part;
            right = value;
            left /= 2;
        } else {
            a = part;
            left = value;
            right /= 2;
        }
    }
    return b;
}

/* Find where an indicator turns between parts a and b (golden section: it may have a kink there), and grazes if it does so
 * below a value; the part at which it falls below 0, 2 if it does not. */
static double turn(const EventSearch *s, size_t which, double a, double at_a, double b, double below, double *graze) {
    static const double GOLDEN = 0.6180339887498949;
    double values[MOST_INDICATORS], low = a, high = b, left = b - GOLDEN * (b - a), right = a + GOLDEN * (b - a);
    double at_left, at_right;
    if (!s->look(s->step, left, values)) return 2;
    at_left = values[which];
    if (!s->look(s->step, right, values)) return 2;
    at_right = values[which];
    for (int i = 0; i < MOST_TRIALS && fmin(at_left, at_right) > -GRAZING; i++) {
        const int keeps_left = at_left < at_right;
        if (keeps_left) {
            high = right;
            right = left;
            at_right = at_left;
            left = high - GOLDEN * (high - low);
        } else {
            low = left;
            left = right;
            at_left = at_right;
            right = low + GOLDEN * (high - low);
        }
        if (!s->look(s->step, keeps_left ? left : right, values)) return 2;
        *(keeps_left ? &at_left : &at_right) = values[which];
    }
    const double part = at_left < at_right ? left : right, least = fmin(at_left, at_right);
    if (least < -GRAZING) return fall(s, which, a, at_a, part, least);
    if (least < fmin(GRAZING, below)) *graze = part;
    return 2;
}

/* The first fall between two parts; 2 if there is none.  An interval is left where each indicator is far above its
 * distance from a straight line, or so near to it that it only rises or only falls. */
static double scan(const EventSearch *s, double a, const double at_a[], double b, const double at_b[], int depth,
                   double *graze) {
    const double middle = a + OFF * (b - a);
    double values[MOST_INDICATORS], first = 2;
    int clear = 1;
    if (!s->look(s->step, middle, values)) return 2;
    for (size_t i = 0; i < s->indicators && clear; i++) {
        const double bend = fabs(values[i] - (at_a[i] + OFF * (at_b[i] - at_a[i]))), low = fmin(at_a[i], at_b[i]);
        const int far = fmin(low, values[i]) > 4 * bend, straight = fabs(at_b[i] - at_a[i]) > 8 * bend || bend == 0;
        clear = far || straight || (depth == 0 && low >= 0 && values[i] >= 0);
        if (at_b[i] < 0 && (straight || depth == 0)) first = fmin(first, fall(s, i, a, at_a[i], b, at_b[i]));
        else if (graze != NULL && clear && !far && !(straight && low <= GRAZING)) /* near a kink it is straight, too */
            first = fmin(first, turn(s, i, a, at_a[i], b, straight ? low / 2 : INFINITY, graze));
    }
    if (clear || depth == 0) return first;
    first = scan(s, a, at_a, middle, values, depth - 1, graze);
    return first < 2 ? first : scan(s, middle, values, b, at_b, depth - 1, graze);
}

double event_search_first(const EventSearch *s, double *graze) {
    static const double PARTS[] = {0, 0.23, 0.47, 0.71, 1};
    double before[MOST_INDICATORS], after[MOST_INDICATORS];
    if (!s->look(s->step, 0, before)) return 2;
    for (size_t i = 0; i < s->indicators; i++) before[i] = fmax(before[i], 0);
    for (size_t k = 1; k < sizeof PARTS / sizeof *PARTS; k++) {
        if (!s->look(s->step, PARTS[k], after)) return 2;
        const double part = scan(s, PARTS[k - 1], before, PARTS[k], after, DEEPEST, graze);
        if (part < 2) return part;
        memcpy(before, after, s->indicators * sizeof *before);
    }
    return 2;
}

int event_search_repeat(const EventSearch *s, double *part, size_t *which) {
    double low[MOST_INDICATORS], high[MOST_INDICATORS], values[MOST_INDICATORS], soonest = INFINITY, least = INFINITY;
    const double away = fmin(1e-3, *part / 2);
    if (!s->look(s->step, *part - away, high) || !s->look(s->step, *part, low)) return 0;
    *which = 0; /* the one that is at 0 first */
    for (size_t i = 0; i < s->indicators; i++) {
        const double fallen = high[i] - low[i], until = fallen > 0 ? low[i] / fallen : INFINITY;
        if (until < soonest) *which = i;
        soonest = fmin(soonest, until);
    }
    const double slope = (low[*which] - high[*which]) / away;
    double nearest = *part;
    for (int i = 0, back = 0; !back; i++) {
        back = *part == nearest && i > 0; /* the last correction led away: the clock resolves no more */
        if (!s->repeat(s->step, *part, values)) return 0;
        const double off = MARGIN - values[*which], change = off / slope;
        if (!(fabs(off) < least)) {
            *part = nearest;
            continue;
        }
        least = fabs(off);
        nearest = *part;
        if (i == MOST_CORRECTIONS || !(slope < 0) || !(fabs(change) > 1e-15 * *part) || !(fabs(change) < *part / 4)
            || *part + change > 1)
            break;
        *part += change;
    }
    return 1;
}

/* The equations of an FMU of Model Exchange, y' = f(t, y, u(t)), by DOP853: one step, and where an event indicator changes
   its sign in it.  dop853.py prepares it; solver.c is the solver that our FMUs of Co-Simulation have inside.

   Its search for events is not that of runtime/events.c.  There an event is a fall below 0, and indicators are functions
   of interpolated states that cost little and have no effect.  Here both changes of sign are events, 0 counts as
   negative, indicators may jump, there may be any number of them, and each look is calls of an FMU, which must never be
   left at states that were not integrated: trials are steps of their own. */
#include <float.h>
#include <math.h>

#include "calls.h"
#include "solver.h"

typedef int SetTime(void *instance, double time);
typedef int SetStates(void *instance, const double y[], size_t n);
typedef int GetNumbers(void *instance, double numbers[], size_t n);

enum { DONE, EVENT, STIFF, HARD, REFUSED };                      /* what became of a step */
enum { NOBODY, SET_TIME, SET_INPUTS, SET_STATES, GET_RATES, GET_INDICATORS }; /* who refused */
enum { SAMPLES = 4, MOST_TRIALS = 100 };

/* Hairer, Wanner, Solving Ordinary Differential Equations II, IV.2: the edge of the region of stability on the real axis,
   and how often it is met before equations are taken for stiff, and missed before they are not. */
static const double EDGE = 6.1;
enum { MET = 15, MISSED = 6 };

typedef struct {
    void *instance;
    SetTime *set_time;
    SetStates *set_states;
    GetNumbers *get_rates, *get_indicators;
    size_t states, indicators;
    double tolerance;
    double *y, *low, *size;          /* states, what they cannot hold, and their nominal values */
    const double *signs;             /* indicators when they were looked at last: their signs count */
    double *numbers;                 /* room for room(states, indicators) numbers */
    double time, step;               /* [s]; the step to try, 0 if unknown */
    const Call *put;                 /* sets the inputs that move; NULL if none does */
    size_t inputs, terms;            /* input[row] = first[row] + sum of slope (t - begin)^order */
    const ptrdiff_t *rows, *orders;
    const double *slopes, *first;
    double *input, begin;
    double at;                       /* the FMU was asked for last [s] */
    int function, status;            /* who refused what was asked last, and how */
    int met, missed;
} Equations;

static bool refused(Equations *e, int function, int status) {
    if (fine(status)) return false;
    e->function = function, e->status = status;
    return true;
}

static bool put_inputs(Equations *e, double t) {
    if (!e->put) return true;
    memcpy(e->input, e->first, e->inputs * sizeof *e->input);
    for (size_t k = 0; k < e->terms; k++) {
        double power = e->slopes[k];
        for (ptrdiff_t order = e->orders[k]; order > 0; order--) power *= t - e->begin;
        e->input[e->rows[k]] += power;
    }
    return !refused(e, SET_INPUTS, perform(e->put, 0, 0));
}

/* Whether the FMU goes to this time and these states. */
static bool place(Equations *e, double t, const double y[]) {
    e->at = t;
    return !refused(e, SET_TIME, e->set_time(e->instance, t)) && put_inputs(e, t)
           && !(e->states && refused(e, SET_STATES, e->set_states(e->instance, y, e->states)));
}

/* A shorter step may do where the FMU discards this one: it is rejected as one whose error is no number. */
static Signal rates(void *context, double t, const double y[], double f[]) {
    Equations *e = context;
    if (place(e, t, y) && !(e->states && refused(e, GET_RATES, e->get_rates(e->instance, f, e->states))))
        return GO_ON;
    if (e->status != DISCARD) return STOP;
    for (size_t i = 0; i < e->states; i++) f[i] = NAN;
    return GO_ON;
}

static Signal one_step(void *context, double t, double y[]) { (void)context, (void)t, (void)y; return STOP; }
static Signal go_on(void *context, double t, double y[]) { (void)context, (void)t, (void)y; return GO_ON; }

static Outcome advance(Equations *e, double *t, double end, double y[], double low[], double *step, double *work,
                       Signal (*accept)(void *, double, double[])) {
    const Problem p = {e->states, e->states, e->tolerance, e->size, rates, rates, accept, e, NULL, NULL};
    e->function = NOBODY, e->status = OK;
    return solver_advance(&p, t, end, y, low, step, work);
}

/* Whether an indicator has another sign than it had at t and y; as in FMI, one of 0 counts as negative. */
static bool changed(Equations *e, double t, const double y[], double z[], bool *works) {
    *works = place(e, t, y) && !refused(e, GET_INDICATORS, e->get_indicators(e->instance, z, e->indicators));
    for (size_t i = 0; *works && i < e->indicators; i++)
        if ((z[i] > 0) != (e->signs[i] > 0)) return true;
    return false;
}

/* Where the first of the straight lines through the indicators meets 0 between 0 and 1; between at least the borders. */
static double crossing(const Equations *e, const double *before, const double *after, double weight) {
    double first = 1;
    for (size_t i = 0; i < e->indicators; i++)
        if ((after[i] > 0) != (e->signs[i] > 0)) {
            const double where = weight * before[i] / (weight * before[i] - after[i]);
            if (where < first) first = where;
        }
    return first > 0.01 && first < 0.99 ? first : first <= 0.01 ? 0.01 : 0.99;
}

EXPORT size_t dop853_room(size_t states, size_t indicators) {
    return (2 * SOLVER_COLUMNS + 7) * states + 3 * indicators + 1;
}

typedef struct {
    double *work, *again, *y, *low, *f, *trial, *trial_low, *middle, *z, *z_before, *z_trial;
} Room;

static Room room(const Equations *e) {
    const size_t n = e->states, m = e->indicators;
    Room r;
    r.work = e->numbers, r.again = r.work + SOLVER_COLUMNS * n, r.y = r.again + SOLVER_COLUMNS * n, r.low = r.y + n;
    r.f = r.low + n, r.trial = r.f + n, r.trial_low = r.trial + n, r.middle = r.trial_low + n;
    r.z = r.middle + 2 * n, r.z_before = r.z + m, r.z_trial = r.z_before + m;
    return r;
}

/* The step once more, from where it began to a time within; in trial. */
static bool retried(Equations *e, const Room *r, double begin, double end) {
    double t = begin, step = end - begin;
    memcpy(r->trial, r->y, e->states * sizeof *r->y);
    memcpy(r->trial_low, r->low, e->states * sizeof *r->low);
    return advance(e, &t, end, r->trial, r->trial_low, &step, r->again, go_on) == REACHED;
}

static void take(Equations *e, const Room *r, double t) {
    memcpy(e->y, r->trial, e->states * sizeof *e->y);
    memcpy(e->low, r->trial_low, e->states * sizeof *e->low);
    e->time = t;
}

/* Go to the instant right behind the first change of sign between begin, where z_before was, and e->time, where z is:
   regula falsi (Illinois) with bisection; each trial is a step of its own, so that nothing is interpolated. */
static int locate(Equations *e, const Room *r, double begin) {
    const double tiny = 100 * DBL_EPSILON * fmax(fabs(begin), fabs(e->time));
    double before = begin, weight = 1;
    for (int k = 0, side = 0; k < MOST_TRIALS && e->time - before > tiny; k++) {
        const double part = k % 4 == 3 ? 0.5 : crossing(e, r->z_before, r->z, weight);
        const double t = before + part * (e->time - before);
        bool works;
        if (t <= before || t >= e->time) break;
        if (!retried(e, r, begin, t)) return e->function ? REFUSED : HARD;
        const bool found = changed(e, t, r->trial, r->z_trial, &works);
        if (!works) return REFUSED;
        memcpy(found ? r->z : r->z_before, r->z_trial, e->indicators * sizeof *r->z);
        if (found) take(e, r, t); else before = t;
        weight = found && side > 0 ? weight / 2 : !found && side < 0 ? weight * 2 : 1;
        side = found ? 1 : -1;
    }
    return EVENT;
}

/* Whether an indicator has another sign at an instant within the step, by the cubic through its ends; where, if so. */
static bool sampled(Equations *e, const Room *r, double begin, double *where, bool *works) {
    const double h = e->time - begin, *f = r->work;
    for (int k = 1; k <= SAMPLES; k++) {
        const double s = (double)k / (SAMPLES + 1), b = s * s * (3 - 2 * s), c = h * s * (1 - s) * (1 - s),
                     d = h * s * s * (s - 1);
        for (size_t i = 0; i < e->states; i++)
            r->middle[i] = r->y[i] + b * (e->y[i] - r->y[i]) + c * f[i] + d * r->f[i];
        *where = begin + s * h;
        if (changed(e, *where, r->middle, r->z_trial, works)) return true;
        if (!*works) return false;
    }
    return false;
}

/* Whether so short a step is due to stability, not to accuracy; f at its end, Hairer's estimate of h |lambda|. */
static bool stiff(Equations *e, const Room *r, double h) {
    const size_t n = e->states;
    const double *k12 = r->work + 11 * n, *y12 = r->work + 12 * n;
    double above = 0, below = 0;
    for (size_t i = 0; i < n; i++) {
        const double scale = 1 / (e->size[i] + fabs(e->y[i])), up = (r->f[i] - k12[i]) * scale,
                     down = (e->y[i] - y12[i]) * scale;
        above += up * up, below += down * down;
    }
    if (below > 0 && h * sqrt(above / below) > EDGE) {
        e->missed = 0;
        return ++e->met == MET;
    }
    if (++e->missed == MISSED) e->met = 0;
    return false;
}

/* One step from e->time, not beyond stop.  DONE: e->time and e->y are those of its end; STIFF: so they are, but another
   solver does better from there; EVENT: of an event in it; HARD: no step is small enough; REFUSED: by the FMU. */
EXPORT int dop853_step(Equations *e, double stop) {
    const Room r = room(e);
    const double begin = e->time;
    bool works = true;
    memcpy(r.y, e->y, e->states * sizeof *r.y);
    memcpy(r.low, e->low, e->states * sizeof *r.low);
    advance(e, &e->time, stop, e->y, e->low, &e->step, r.work, one_step);
    if (e->time == begin) return e->function ? REFUSED : HARD;
    e->function = NOBODY, e->status = OK; /* a longer step may have been discarded */
    const bool short_step = e->time < stop && e->states > 0;
    if ((e->indicators || short_step) && !(rates(e, e->time, e->y, r.f) == GO_ON && e->status != DISCARD)) return REFUSED;
    if (e->indicators) {
        double where;
        bool event = changed(e, e->time, e->y, r.z, &works);
        if (works && sampled(e, &r, begin, &where, &works) && retried(e, &r, begin, where)
            && changed(e, where, r.trial, r.z_trial, &works)) { /* in truth, not only on the cubic */
            take(e, &r, where);
            memcpy(r.z, r.z_trial, e->indicators * sizeof *r.z);
            event = true;
        }
        if (works && event) {
            changed(e, begin, r.y, r.z_before, &works);
            if (works) return locate(e, &r, begin);
        }
        if (!works) return REFUSED;
    }
    return short_step && stiff(e, &r, e->time - begin) ? STIFF : DONE;
}

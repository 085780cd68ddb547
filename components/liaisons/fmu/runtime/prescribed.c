/* Coordinates that an operator prescribes: how far σ, σ̇ and σ̈ contradict each other, and what a jump of σ does.
 *
 * The motion follows σ by its rate: from the value at the start of a step to `followed` at its end.  What σ is off that
 * at the next communication point it has jumped.  In interpolation σ is met, unless a polynomial through both ends would
 * have to move much faster than σ̇ and σ̈ there say, as in a short step after a long one whose inputs came late: such a
 * step is extrapolated, too, and σ jumps at its end. */
#include <float.h>
#include <string.h>

#include "inputs.h"
#include "solver.h"

/* Jumps below this part of σ are rounding errors. */
static const double ROUNDING = 1e-14;
/* Parts of σ, and of what its rate says of a step, that are owed to the tolerance of whoever computes it. */
static const double VALUE = 1e-6, RATE = 1e-3;
/* What is so many times as much as its rate and acceleration say is a jump. */
static const double FAR = 5;

/* The number, or the largest one if it overflows: a saved state has finite numbers only. */
static double bounded(double x) { return fmax(-DBL_MAX, fmin(DBL_MAX, x)); }

#define FOR_EACH(p) for (Prescribed *p = self->prescribed.list; p < self->prescribed.list + self->prescribed.count; p++)

void core_find_prescribed(Instance *self) {
    const Model *model = self->model;
    Prescribed *p = self->prescribed.list;
    for (const Active *at = model->active; at < model->active + model->active_rows; at++)
        for (size_t i = 0; i < at->count; i++, p++)
            *p = (Prescribed){.value = at->value + i,
                              .rate = at->rate + i,
                              .acceleration = at->acceleration + i,
                              .mismatch = at->mismatch == NO_MISMATCH ? NULL : &self->v.m[(size_t)at->mismatch + i],
                              .past = &self->v.past[p - self->prescribed.list],
                              .warned = &self->prescribed.warned[at - model->active]};
}

/* ---- from one communication point to the next -------------------------------------------------------------- */

void core_follow(Instance *self) {
    core_depart(self);
    FOR_EACH(p) {
        p->past->size = 0;
        p->past->followed = p->past->value;
    }
}

void core_depart(Instance *self) {
    FOR_EACH(p) {
        p->past->value = self->v.u[p->value];
        p->past->rate = self->v.u[p->rate];
        p->past->acceleration = self->v.u[p->acceleration];
    }
}

void core_arrive(Instance *self) {
    FOR_EACH(p) {
        const Mover *rate = mover_of(self, p->rate);
        const double went = rate == NULL ? self->step.reach * p->past->rate
                                         : input_integral(rate, self->step.reach / self->step.size) * self->step.size;
        p->past->size = self->step.reach;
        p->past->followed =
            self->s->reconstruction == INTERPOLATE ? self->v.u[p->value] : bounded(p->past->value + went);
    }
}

/* ---- contradictions ---------------------------------------------------------------------------------------- */

/* The larger absolute value at both ends of a step. */
static double larger(const double from[3], const double to[3], int i) { return fmax(fabs(from[i]), fabs(to[i])); }

/* Compare σ at the end of a step of size H with what its rates say, and note the mismatch; whether it jumps there. */
static int compare(Prescribed *p, double H, double said, const double from[3], const double to[3], double t) {
    const double difference = bounded(to[0] - said);
    const double went = bounded(H * (larger(from, to, 1) + H * larger(from, to, 2) / 2));
    const int jumps = fabs(difference) > FAR * went;
    if (p->mismatch == NULL) return jumps;
    /* A rate that jumps on the way moves σ by up to H times the jump, an acceleration by up to half of H². */
    const double explained = H * (fabs(to[1] - from[1]) + H * fabs(to[2] - from[2]) / 2) + RATE * went
                             + VALUE * larger(from, to, 0) + DBL_EPSILON;
    *p->mismatch = fabs(difference) > explained ? difference : 0;
    p->past->went = went;
    p->past->time = t;
    return jumps;
}

void core_compare(Instance *self) {
    const double *u = self->v.u;
    FOR_EACH(p) {
        const Past *past = p->past;
        if (p->mismatch == NULL || past->size == 0) continue;
        if (self->s->reconstruction == HOLD || u[p->value] == past->followed) {
            *p->mismatch = 0;
            continue;
        }
        const double from[] = {past->value, past->rate, past->acceleration};
        const double to[] = {u[p->value], u[p->rate], u[p->acceleration]};
        compare(p, past->size, past->followed, from, to, self->s->time);
    }
}

int core_compare_ends(Instance *self) {
    const double *u = self->v.u, *set = self->v.set, H = self->step.size;
    int leaps = 0;
    FOR_EACH(p) {
        const double from[] = {u[p->value], u[p->rate], u[p->acceleration]};
        const double to[] = {set[p->value], set[p->rate], set[p->acceleration]};
        p->leaps = compare(p, H, from[0] + H * (from[1] + H * from[2] / 2), from, to, self->s->time + H);
        leaps |= p->leaps;
    }
    return leaps;
}

/* What is done where σ jumps. */
static const char *treatment(const Instance *self, const Prescribed *p) {
    const size_t i = (size_t)(p - self->prescribed.list), n = self->prescribed.count;
    if (self->model->jumps != NULL && !(self->model->jumps[i * n + i] & MIXES))
        return "it is taken as the limit of an ever faster motion";
    return self->model->project == NULL ? "coordinates and momenta stay as they are"
                                        : "the state is put back onto the constraints";
}

void core_warn(Instance *self) {
    const size_t first = self->model->parameters;
    FOR_EACH(p) {
        if (p->mismatch == NULL || *p->mismatch == 0 || *p->warned) continue;
        char value[NAME], rate[NAME];
        strcpy(value, core_name(self, first + p->value));
        strcpy(rate, core_name(self, first + p->rate));
        const char *acceleration = core_name(self, first + p->acceleration);
        if (fabs(*p->mismatch) > FAR * p->past->went)
            core_report(self, WARNING, "%s jumps by %.6g at t = %.9g, of which %s and %s say nothing: %s", value,
                        *p->mismatch, p->past->time, rate, acceleration, treatment(self, p));
        else
            core_report(self, WARNING,
                        "%s, %s and %s contradict each other: at t = %.9g, after a step, %s is off by %.6g from what "
                        "they said", value, rate, acceleration, p->past->time, value, *p->mismatch);
        *p->warned = 1;
    }
}

/* ---- jumps ------------------------------------------------------------------------------------------------- */

/* Find which coordinates jump, and how far; whether that moves states and has a limit. */
static int find_jumps(Instance *self) {
    const size_t n = self->prescribed.count;
    int moves = 0;
    FOR_EACH(p) {
        const double value = self->v.u[p->value], followed = p->past->followed;
        const double rounding = ROUNDING * fmax(fabs(value), fabs(followed));
        p->target = value;
        p->rest = self->v.u[p->rate];
        p->jump = value == p->past->value || fabs(value - followed) <= rounding ? 0 : value - followed;
    }
    for (size_t i = 0; i < n; i++) {
        if (self->prescribed.list[i].jump == 0) continue;
        const unsigned char *row = &self->model->jumps[i * n];
        moves |= row[i] & JUMPS;
        for (size_t j = 0; j < n; j++) {
            if (!(row[j] & MIXES)) continue;
            if (self->prescribed.list[j].jump != 0) return 0;
            moves |= self->prescribed.list[j].rest != 0;
        }
    }
    return moves;
}

/* Set σ to a fraction of its jump, and its rate with the jump added to it or without. */
static void set_prescribed(Instance *self, double part, int jumping) {
    FOR_EACH(p) {
        if (p->jump == 0) continue;
        self->v.u[p->value] = p->past->followed + part * p->jump;
        self->v.u[p->rate] = jumping ? p->rest + p->jump : p->rest;
    }
}

/* What a jump adds to the rates of the states. */
static Signal leaping(void *context, double part, const double y[], double f[]) {
    Instance *self = context;
    const Model *model = self->model;
    Function *function = model->motions[ACTIVITIES - 1].coupled;
    set_prescribed(self, part, 0);
    evaluate(self, function, self->s->time, y, self->e.y);
    set_prescribed(self, part, 1);
    evaluate(self, function, self->s->time, y, f);
    for (size_t i = 0; i < model->coupled; i++) f[i] -= self->e.y[i];
    return GO_ON;
}

static Signal go_on(void *context, double t, double y[]) {
    (void)context, (void)t, (void)y;
    return GO_ON;
}

/* Take a tiny jump by the midpoint rule; 0 if that is not accurate enough. */
static int leap_at_once(const Problem *problem, double *y, double *work) {
    const size_t n = problem->n;
    double *begin = work, *middle = work + n, *x = work + 2 * n;
    leaping(problem->context, 0, y, begin);
    for (size_t i = 0; i < n; i++) x[i] = y[i] + begin[i] / 2;
    leaping(problem->context, 0.5, x, middle);
    for (size_t i = 0; i < n; i++)
        if (!(fabs(middle[i] - begin[i]) <= problem->tolerance * (problem->size[i] + fabs(y[i])))) return 0;
    for (size_t i = 0; i < n; i++) y[i] += middle[i];
    return 1;
}

void core_leap(Instance *self) {
    const size_t n = self->model->coupled;
    if (self->model->jumps == NULL || !find_jumps(self)) return;
    const Problem problem = {n, n, SHARE * self->s->tolerance, self->v.size, leaping, leaping, go_on, self, NULL, NULL};
    double *y = self->d.y, *low = self->d.z;
    double t = 0, step = 0;
    memcpy(y, self->v.y, n * sizeof *y);
    memcpy(low, self->v.low, n * sizeof *low);
    if (leap_at_once(&problem, y, self->scratch.work)
        || solver_advance(&problem, &t, 1, y, low, &step, self->scratch.work) == REACHED) {
        memcpy(self->v.y, y, n * sizeof *y);
        memcpy(self->v.low, low, n * sizeof *low);
    } /* else the way leads through a singularity, and there is no limit */
    FOR_EACH(p) {
        self->v.u[p->value] = p->target;
        self->v.u[p->rate] = p->rest;
    }
}

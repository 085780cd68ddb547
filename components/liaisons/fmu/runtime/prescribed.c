/* Coordinates that an operator prescribes, from one communication point to the next, and how far σ, σ̇ and σ̈ contradict
 * each other.
 *
 * The motion follows σ by its rate: from the value at the start of a step to `followed` at its end.  What σ is off that
 * at the next communication point it has jumped.  In interpolation σ is met, unless a polynomial through both ends would
 * have to move much faster than σ̇ and σ̈ there say, as in a short step after a long one whose inputs came late, or as in
 * the tiny step to an instant at which σ̇ jumps: such a step is extrapolated, too, and what is set jumps at its end. */
#include <string.h>

#include "prescribed.h"

/* Parts of σ, and of what its rate says of a step, that are owed to the tolerance of whoever computes it. */
static const double VALUE = 1e-6, RATE = 1e-3;

void core_find_prescribed(Instance *self) {
    const Model *model = self->model;
    Prescribed *p = self->prescribed.list;
    for (const Active *at = model->active; at < model->active + model->active_rows; at++)
        for (size_t i = 0; i < at->count; i++, p++)
            *p = (Prescribed){.value = at->value + i,
                              .rate = at->rate + i,
                              .acceleration = at->acceleration + i,
                              .mismatch = at->mismatch == NOT_SHOWN ? NULL : &self->v.m[(size_t)at->mismatch + i],
                              .derived = at->derived == NOT_SHOWN ? NULL : &self->v.m[(size_t)at->derived + i],
                              .past = &self->v.past[p - self->prescribed.list],
                              .warned = &self->prescribed.warned[at - model->active]};
}

void core_follow(Instance *self) {
    self->known.rests = 0;
    core_depart(self);
    FOR_EACH(p) {
        p->past->size = 0;
        p->past->followed = p->past->value;
        p->past->points = 0;
        p->past->given[0] = self->v.set[p->rate];
        p->past->given[1] = self->v.set[p->acceleration];
    }
}

void core_depart(Instance *self) {
    FOR_EACH(p) {
        p->past->value = self->v.u[p->value];
        p->past->rate = self->v.u[p->rate];
        p->past->acceleration = self->v.u[p->acceleration];
        if (self->s->reconstruction != EXTRAPOLATE) continue;
        prescribed_remember(self, p);
        p->past->given[0] = self->v.set[p->rate];
        p->past->given[1] = self->v.set[p->acceleration];
    }
}

void core_arrive(Instance *self) {
    FOR_EACH(p) {
        const Mover *rate = mover_of(self, p->rate);
        const double went = rate == NULL ? self->step.reach * p->past->rate
                                         : input_integral(rate, self->step.reach / self->step.size) * self->step.size;
        p->rests = 0;
        p->past->size = self->step.reach;
        p->past->followed =
            self->s->reconstruction == INTERPOLATE ? self->v.u[p->value] : bounded(p->past->value + went);
    }
}

void core_stay(Instance *self) {
    FOR_EACH(p) {
        p->past->times[0] = self->step.start;
        p->past->size = self->step.reach;
    }
}

void core_reach(Instance *self) {
    memcpy(self->v.u, self->v.set, self->model->inputs * sizeof *self->v.u);
    FOR_EACH(p) {
        self->v.u[p->rate] = p->end[1];
        self->v.u[p->acceleration] = p->end[2];
    }
}

int core_look(Instance *self) {
    const double *set = self->v.set;
    const int holds = self->s->reconstruction == HOLD;
    int all = !holds;
    self->known.derives = 0;
    FOR_EACH(p) {
        const Past *past = p->past;
        const double value = set[p->value], rate = set[p->rate], acceleration = set[p->acceleration];
        p->tells = 0;
        if (!holds && past->size > 0) {
            p->rests = value == past->value && rate == 0 && acceleration == 0 && past->given[0] == 0
                       && past->given[1] == 0 && past->still + past->turns == 0 && !derives(p);
            if (!p->rests)
                prescribed_look(p, past->size, (double[]){past->value, past->given[0], past->given[1]},
                     (double[]){value, rate, acceleration});
        }
        all &= p->rests;
        self->known.derives |= !p->rests && derives(p);
    }
    if (self->known.derives && !holds) core_derive(self);
    return all;
}

/* ---- contradictions ---------------------------------------------------------------------------------------- */

/* The larger absolute value at both ends of a step. */
static double larger(const double from[3], const double to[3], int i) {
    const double a = fabs(from[i]), b = fabs(to[i]);
    return a > b ? a : b; /* less than a call */
}

/* Part of what a jump of σ̇ would move σ in a whole step, by which it may come before the end; and parts of σ, and of
 * the time, to which an importer knows the instant of the jump. */
static const double LATE = 0.1, LOCATED = 1e-12, CLOCK = 4 * DBL_EPSILON;

/* Whether σ̇ jumps at the end, at t, of a step of size H: σ̈ says nothing of it, and σ has hardly moved by it. */
static int rate_jumps(double H, const double from[3], const double to[3], double t) {
    const double change = H * fabs(to[1] - from[1]), missed = to[0] - (from[0] + H * (from[1] + H * from[2] / 2));
    const double rounding = LOCATED * larger(from, to, 0) + CLOCK * fabs(t) * larger(from, to, 1);
    return change > FAR * H * H * larger(from, to, 2) && fabs(missed) <= LATE * change + rounding;
}

/* Compare σ at the end of a step of size H with what its rates say, and note the mismatch; whether it jumps there. */
static int compare(Prescribed *p, double H, const double from[3], const double to[3], double t) {
    Past *past = p->past;
    const double difference = bounded(to[0] - (from[0] + H * (from[1] + H * from[2] / 2)));
    const double went = bounded(H * (larger(from, to, 1) + H * larger(from, to, 2) / 2));
    const int jumps = fabs(difference) > FAR * went;
    if (p->mismatch == NULL) return jumps;
    /* A rate that jumps on the way moves σ by up to H times the jump, an acceleration by up to half of H². */
    const double explained = H * (fabs(to[1] - from[1]) + H * fabs(to[2] - from[2]) / 2) + RATE * went
                             + VALUE * larger(from, to, 0) + DBL_EPSILON;
    const int contradicts = fabs(difference) > explained || (past->turns >= SEVERAL && difference != 0);
    *p->mismatch = contradicts && !derives(p) ? difference : 0;
    if (*p->mismatch == 0 || past->found != 0) return jumps;
    past->found = difference;
    past->went = went;
    past->time = t;
    return jumps;
}

void core_compare(Instance *self) {
    const double *u = self->v.u;
    FOR_EACH(p) {
        const Past *past = p->past;
        if (p->mismatch == NULL || past->size == 0) continue;
        if (p->rests) {
            *p->mismatch = 0;
            continue;
        }
        const double from[] = {past->value, past->rate, past->acceleration};
        const double to[] = {u[p->value], u[p->rate], u[p->acceleration]};
        if (self->s->reconstruction == HOLD) *p->mismatch = 0;
        else compare(p, past->size, from, to, self->s->time);
    }
}

int core_compare_ends(Instance *self) {
    const double *u = self->v.u, *set = self->v.set, H = self->step.size;
    int leaps = 0;
    FOR_EACH(p) {
        double *end = p->end, *given = p->past->given;
        prescribed_remember(self, p);
        p->tells = 0;
        end[0] = set[p->value];
        end[1] = set[p->rate];
        end[2] = set[p->acceleration];
        prescribed_look(p, H, (double[]){u[p->value], given[0], given[1]}, end);
        memcpy(given, end + 1, 2 * sizeof *given);
        if (derives(p)) prescribed_derive(p, self->s->time + H, end);
        const double from[] = {u[p->value], u[p->rate], u[p->acceleration]}, t = self->s->time + H;
        p->leaps = compare(p, H, from, end, t) || rate_jumps(H, from, end, t);
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

/* Which of 0 value, 1 rate, 2 acceleration contradicts both others in the last step; -1: each contradicts each. */
static int odd_one(const Instance *self, const Prescribed *p) {
    const Past *past = p->past;
    const double *now = self->s->reconstruction == INTERPOLATE ? self->v.u : self->v.set;
    const double H = self->s->time - past->times[0];
    if (past->turns >= SEVERAL) return 2;
    if (past->points < 2 || !(H > 0)) return -1;
    const double change = now[p->rate] - past->rate, said = H * (now[p->acceleration] + past->acceleration) / 2;
    if (fabs(change - said) <= WRONG * (fabs(change) + fabs(said))) return 0;
    const double before = past->times[0] - past->times[1];
    const double slopes[] = {(past->values[0] - past->values[1]) / before, (now[p->value] - past->values[0]) / H};
    const double curvature = 2 * (slopes[1] - slopes[0]) / (H + before);
    return fabs(curvature - past->acceleration) <= WRONG * (fabs(curvature) + fabs(past->acceleration)) ? 1 : -1;
}

void core_warn(Instance *self, int last) {
    const size_t first = self->model->parameters;
    FOR_EACH(p) {
        const Past *past = p->past;
        if (past->found == 0 || *p->warned) continue;
        const int jumps = fabs(past->found) > FAR * past->went;
        /* A rate may be missing; which one is wrong is not known yet. */
        const int pending = past->still > 0 || (!jumps && (past->points < 2 || (past->turns > 0 && past->turns < SEVERAL)));
        if (pending && !last) continue;
        char names[3][NAME];
        const size_t indices[] = {p->value, p->rate, p->acceleration};
        for (int i = 0; i < 3; i++) strcpy(names[i], core_name(self, first + indices[i]));
        const int odd = last ? -1 : odd_one(self, p);
        if (jumps)
            core_report(self, WARNING, "%s jumps by %.6g at t = %.9g, of which %s and %s say nothing: %s", names[0],
                        past->found, past->time, names[1], names[2], treatment(self, p));
        else if (odd < 0)
            core_report(self, WARNING,
                        "%s, %s and %s contradict each other: at t = %.9g, after a step, %s is off by %.6g from what "
                        "they said", names[0], names[1], names[2], past->time, names[0], past->found);
        else
            core_report(self, WARNING,
                        "%s contradicts %s and %s: at t = %.9g, after a step, %s is off by %.6g from what %s and %s said",
                        names[odd], names[odd == 0], names[odd == 2 ? 1 : 2], past->time, names[0], past->found, names[1],
                        names[2]);
        *p->warned = 1;
    }
}

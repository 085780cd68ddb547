/* Coordinates that an operator prescribes: rates that nobody gives, how far σ, σ̇ and σ̈ contradict each other, and what a
 * jump of σ does.
 *
 * The motion follows σ by its rate: from the value at the start of a step to `followed` at its end.  What σ is off that
 * at the next communication point it has jumped.  In interpolation σ is met, unless a polynomial through both ends would
 * have to move much faster than σ̇ and σ̈ there say, as in a short step after a long one whose inputs came late: such a
 * step is extrapolated, too, and σ jumps at its end.
 *
 * Where σ̇ and σ̈, or σ̈ alone, stay 0 while σ, or σ̇, goes on, they are derived from what was given at the last
 * communication points: by the polynomial through the present one and up to EARLIER before it. */
#include <float.h>
#include <stdio.h>
#include <string.h>

#include "inputs.h"
#include "solver.h"

/* Jumps below this part of σ are rounding errors. */
static const double ROUNDING = 1e-14;
/* Parts of σ, and of what its rate says of a step, that are owed to the tolerance of whoever computes it. */
static const double VALUE = 1e-6, RATE = 1e-3;
/* What is so many times as much as its rate and acceleration say is a jump. */
static const double FAR = 5;
/* So many steps in succession show that a rate is missing, or that an acceleration is wrong. */
enum { SEVERAL = 3 };
/* An acceleration is wrong where it misses this part of what both say of the change of the rate; by so much at most that
 * part changes from step to step, and the mean of the rates misses that of their change: else the rate jumps. */
static const double WRONG = 0.25, STRAIGHT = 0.1;
/* Points that are nearer to each other than this part of their mean distance count once. */
static const double NEAR = 0.05;

/* The number, or the largest one if it overflows: a saved state has finite numbers only. */
static double bounded(double x) { return x - x == 0 ? x : isnan(x) ? 0 : x > 0 ? DBL_MAX : -DBL_MAX; }

#define FOR_EACH(p) \
    for (Prescribed *p = self->prescribed.list, *const end_of_##p = p + self->prescribed.count; p < end_of_##p; p++)

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

/* ---- derivatives that nobody gives -------------------------------------------------------------------------- */

static int derives(const Prescribed *p) { return p->derived != NULL && *p->derived > 0; }

/* First and second derivative at t of the polynomial through a value then and those of a series before; 0 where the value
 * is far from where the series leads: it has jumped.  Returns whether it has. */
static int differentiate(const Past *past, const double *series, double t, double value, double d[2]) {
    double x[EARLIER + 1] = {0}, c[EARLIER + 1] = {value}, led[EARLIER + 1];
    size_t n = 1;
    const size_t points = (size_t)past->points;
    const double near = points == 0 ? 0 : NEAR * (t - past->times[points - 1]) / (double)points;
    d[0] = d[1] = 0;
    for (size_t i = 0; i < points; i++) {
        if (!(x[n - 1] - (past->times[i] - t) > near)) continue;
        x[n] = past->times[i] - t;
        led[n] = c[n] = series[i];
        n++;
    }
    if (n > 2) {
        double low = INFINITY, high = -INFINITY;
        for (size_t i = 1; i < n; i++) {
            low = fmin(low, c[i]);
            high = fmax(high, c[i]);
        }
        for (size_t k = 1; k + 1 < n; k++) /* Neville's scheme, at t */
            for (size_t i = 1; i + k < n; i++) led[i] = (x[i] * led[i + 1] - x[i + k] * led[i]) / (x[i] - x[i + k]);
        if (fabs(value - led[1]) > FAR * (fmax(high, led[1]) - fmin(low, led[1]))) return 1;
    }
    for (size_t k = 1; k < n; k++) /* Newton's divided differences */
        for (size_t i = n - 1; i >= k; i--) c[i] = (c[i] - c[i - 1]) / (x[i] - x[i - k]);
    double product = 1, sum = 0; /* of Newton's polynomials: first derivative, half of the second */
    for (size_t k = 1; k < n; k++) {
        d[0] += c[k] * product;
        d[1] += 2 * c[k] * sum;
        sum = product - sum * x[k];
        product *= -x[k];
    }
    d[0] = bounded(d[0]);
    d[1] = bounded(d[1]);
    return 0;
}

/* Replace what is missing of value, rate and acceleration at a time; whether the polynomial was left at a jump. */
static int derive(const Prescribed *p, double t, double numbers[3]) {
    double d[2];
    const int rates_too = *p->derived > ACCELERATION;
    const int jumps = differentiate(p->past, rates_too ? p->past->values : p->past->rates, t, numbers[!rates_too], d);
    if (rates_too) numbers[1] = d[0];
    numbers[2] = d[rates_too];
    return jumps;
}

void core_derive(Instance *self) {
    double *u = self->v.u;
    FOR_EACH(p) {
        if (!derives(p)) continue;
        double numbers[] = {u[p->value], u[p->rate], u[p->acceleration]};
        derive(p, self->s->time, numbers);
        u[p->rate] = numbers[1];
        u[p->acceleration] = numbers[2];
    }
}

/* Remember the present point, as the last one before the next. */
static void remember(Instance *self, Prescribed *p) {
    Past *past = p->past;
    if (p->rests && past->points > 0) {
        past->points = 1;
        past->times[0] = self->s->time;
        return;
    }
    double numbers[] = {self->v.u[p->value], self->v.u[p->rate], self->v.u[p->acceleration]};
    if (derives(p) && derive(p, self->s->time, numbers)) past->points = 0;
    if (past->points > 0 && !(self->s->time > past->times[0])) past->points = 0; /* of another clock */
    const size_t kept = past->points < EARLIER ? (size_t)past->points : EARLIER - 1;
    for (size_t i = kept; i > 0; i--) { /* less than three calls */
        past->times[i] = past->times[i - 1];
        past->values[i] = past->values[i - 1];
        past->rates[i] = past->rates[i - 1];
    }
    past->times[0] = self->s->time;
    past->values[0] = self->v.u[p->value];
    past->rates[0] = self->v.u[p->rate];
    past->points = (double)kept + 1;
}

/* Whether a rate changes as if it had no jump, and not as its acceleration says; whether *wrong is that of the steps before. */
static int turns_otherwise(double H, const double from[3], const double to[3], double *wrong) {
    const double change = to[1] - from[1], said = H * (from[2] + to[2]) / 2, before = *wrong;
    const double went = to[0] - from[0] - H * (from[1] + to[1]) / 2;
    const double size = fabs(change) + fabs(H) * fmax(fabs(from[2]), fabs(to[2]));
    *wrong = 0;
    if (!(fabs(change - said) > WRONG * size) || !(fabs(change - said) > fabs(H * (to[2] - from[2])) / 2)) return 0;
    if (!(fabs(went) <= STRAIGHT * fabs(H * change))) return 0;
    *wrong = bounded((change - said) / change);
    return before == 0 || fabs(*wrong - before) <= WRONG * fabs(*wrong) ? 1 : -1;
}

/* Look at what was given at both ends of a step: do rates stay 0 while the value goes on, or does the acceleration while
 * the rate does, then it is missing. */
static void look(Prescribed *p, double H, const double from[3], const double to[3]) {
    Past *past = p->past;
    if (p->derived == NULL) return;
    const double before = *p->derived;
    if (from[1] == 0 && to[1] == 0 && from[2] == 0 && to[2] == 0) {
        past->still = to[0] != from[0] ? past->still + 1 : before == RATE_AND_ACCELERATION ? past->still : 0;
        past->turns = past->wrong = 0;
        *p->derived = past->still >= SEVERAL ? RATE_AND_ACCELERATION : before == ACCELERATION ? before : 0;
    } else {
        const int turns = turns_otherwise(H, from, to, &past->wrong);
        past->still = 0;
        past->turns = turns > 0 ? past->turns + 1 : turns < 0;
        const int missing = from[2] == 0 && to[2] == 0;
        *p->derived = missing && (before == ACCELERATION || past->turns >= SEVERAL) ? ACCELERATION : 0;
    }
    p->tells = *p->derived > before && !past->told;
    if (*p->derived > 0) past->found = 0; /* it was no contradiction */
}

int core_tell(Instance *self) {
    int tells = 0;
    FOR_EACH(p) {
        if (p->tells) p->past->told = 1;
        tells |= p->tells;
    }
    return tells;
}

const char *core_told(Instance *self) {
    const size_t first = self->model->parameters;
    FOR_EACH(p) {
        if (!p->tells) continue;
        const int both = *p->derived > ACCELERATION;
        const char *they = both ? "they are" : "it is", *them = both ? "them" : "it";
        char moving[NAME], rate[NAME];
        strcpy(moving, core_name(self, first + (both ? p->value : p->rate)));
        strcpy(rate, core_name(self, first + p->rate));
        const char *acceleration = core_name(self, first + p->acceleration);
        p->tells = 0;
        core_because(self, "%s%s%s stay%s 0 while %s changes, at t = %.9g: ", both ? rate : "", both ? " and " : "",
                     acceleration, both ? "" : "s", moving, self->s->time);
        const size_t length = strlen(self->words.text);
        if (self->options.use == USE_MODEL_EXCHANGE)
            snprintf(self->words.text + length, TEXT - length, "set %s; in model exchange %s taken for 0", them, they);
        else
            snprintf(self->words.text + length, TEXT - length,
                     "from now on %s derived from what %s has at communication points; set %s, or "
                     "input_reconstruction = 0 (hold)", they, moving, them);
        return self->words.text;
    }
    return NULL;
}

/* ---- from one communication point to the next -------------------------------------------------------------- */

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
        remember(self, p);
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
                look(p, past->size, (double[]){past->value, past->given[0], past->given[1]},
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
        remember(self, p);
        p->tells = 0;
        end[0] = set[p->value];
        end[1] = set[p->rate];
        end[2] = set[p->acceleration];
        look(p, H, (double[]){u[p->value], given[0], given[1]}, end);
        memcpy(given, end + 1, 2 * sizeof *given);
        if (derives(p)) derive(p, self->s->time + H, end);
        p->leaps = compare(p, H, (double[]){u[p->value], u[p->rate], u[p->acceleration]}, end, self->s->time + H);
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

/* ---- model exchange ---------------------------------------------------------------------------------------- */

int core_watch(Instance *self) {
    const double *u = self->v.u;
    FOR_EACH(p) {
        Past *past = p->past;
        const double from[] = {past->values[0], past->rates[0], past->given[1]}, H = self->s->time - past->times[0];
        const double to[] = {u[p->value], u[p->rate], u[p->acceleration]};
        p->tells = 0;
        if (past->points > 0 && (H == 0 || memcmp(from, to, sizeof from) == 0)) continue;
        if (past->points > 0) look(p, H, from, to);
        past->points = 1;
        past->times[0] = self->s->time;
        past->values[0] = to[0];
        past->rates[0] = to[1];
        past->given[1] = to[2];
    }
    self->known.current = 0;
    return core_tell(self);
}

/* ---- jumps ------------------------------------------------------------------------------------------------- */

/* Find which coordinates jump, and how far; whether that moves states and has a limit. */
static int find_jumps(Instance *self) {
    const size_t n = self->prescribed.count;
    int moves = 0;
    FOR_EACH(p) {
        const double value = self->v.u[p->value], followed = p->past->followed, jump = value - followed;
        p->target = value;
        p->rest = self->v.u[p->rate];
        p->jump = value == p->past->value || fabs(jump) <= ROUNDING * fabs(value) || fabs(jump) <= ROUNDING * fabs(followed)
                      ? 0 : jump;
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

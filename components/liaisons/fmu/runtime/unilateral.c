/* Unilateral liaisons and dry friction: impacts and modes at an event.
 *
 * Rates v of the contacts jump by G Λ at an impact, and change by a + G x under forces x.  Which of them push, stick or
 * slide is a complementarity problem: of few contacts, so that all combinations are tried. */
#include "unilateral.h"

#include <string.h>

/* Contacts that a problem has at most; impacts at one instant; steps that put a gap to 0. */
enum { AT_ONCE = 8, MOST_IMPACTS = 1000, NEWTON_STEPS = 5 };

/* Parts of the scale of a position, a rate, an acceleration that are rounding errors; of a position, also where Newton's
 * method goes on, what is an overlap, what a jump of a prescribed coordinate may move, and what an importer that looks
 * for events may be late. */
static const double FAR = 1e-9, TOUCHING = 1e-12, STILL = 2e-12, BALANCED = 1e-13, OVERLAP = 1e-9, FOLLOWED = 1e-3, LATE = 0.1;
/* Bounces that are lower than this part of the scale are not followed; after a jump, of what was closed.  Impacts count
 * after a fall from higher than this part of it: bounces that are summed, which are lower for every importer, do not. */
static const double LOWEST = 1e-12, LIFTED = 1e-9, COUNTED = 1e-6;
/* A component does not start with a gap between these parts of its rounding, which would not be followed. */
static const double COARSE[] = {0.1, 100};
/* What an importer may be off, in tolerances; a gap that opens slower is an event only where it overlaps by more. */
static const double ERRORS = 10;
/* What sticks stays so where a prescribed rate is off by this part of its scale. */
static const double STUCK = 1e-9;
/* Pivots below this part of the diagonal say that forces are not unique. */
static const double SINGULAR = 1e-10;

enum { OPEN, CLOSED };                         /* modes of a gap; */
enum { BACKWARD = -1, STICKS = 0, FORWARD = 1 }; /* of dry friction */

typedef signed char Modes[MOST_CONTACTS];

typedef struct { /* which modes make rates, as they would be without forces, what they have to be */
    size_t n, contact[AT_ONCE]; /* whose modes are to be chosen */
    int impulses;               /* forces are impulses: those of thresholds without a gap are 0 */
    const double *stick, *slide;
    double rate[MOST_CONTACTS], tolerance[MOST_CONTACTS];
} Problem;

static const char *name_of(const Model *model, size_t i) {
    return i < model->gaps ? model->gap[i].name : model->friction[i - model->gaps].name;
}

/* ---- what the component says ------------------------------------------------------------------------------------ */

/* Calculate the numbers of all contacts at the present state. */
static void inspect(Instance *self, double time) {
    evaluate(self, self->model->contact, time, self->v.y, self->contacts.numbers);
}

/* Address of a mode in the memory, 1: closed, 0: open; below 0: open, and overlaps by less than this part of its scale
 * are no event. */
static double *closed_of(const Instance *self, size_t i) { return &self->v.m[self->model->gap[i].closed]; }

static int is_closed(const Instance *self, size_t i) { return *closed_of(self, i) > 0; }

/* Read the modes from the memory. */
static void read_modes(const Instance *self, Modes modes) {
    const Model *model = self->model;
    for (size_t i = 0; i < model->gaps; i++) modes[i] = is_closed(self, i) ? CLOSED : OPEN;
    for (size_t i = 0; i < model->frictions; i++)
        modes[model->gaps + i] = (signed char)self->v.m[model->friction[i].direction];
}

/* Whether a mode keeps the rate of a contact at 0. */
static int holds(const Model *model, const Modes modes, size_t i) {
    if (i < model->gaps) return modes[i] == CLOSED;
    const long normal = model->friction[i - model->gaps].normal;
    return modes[i] == STICKS && (normal < 0 || modes[normal] == CLOSED);
}

/* How far a gap may be from 0 by rounding of positions, and of the time at which others move. */
static double rounding(const Contacts *c, size_t i, double time) {
    const double tick = nextafter(fabs(time), INFINITY) - fabs(time);
    return TOUCHING * c->scale[i] + 2 * tick * c->rate_scale[i];
}

/* ---- states that jump --------------------------------------------------------------------------------------------- */

static const double NOTHING[MOST_CONTACTS];

/* Call the function of the component that gives states after impulses, and moved along the gaps. */
static void call_push(Instance *self, double time, const double y[], const double impulses[], const double shifts[],
                      double result[]) {
    self->call.arguments[5] = impulses;
    self->call.arguments[6] = shifts;
    self->call.results[1] = self->contacts.operators;
    evaluate(self, self->model->push, time, y, result);
}

/* Replace the states, and forget what was calculated from them. */
static void replace_states(Instance *self, const double y[]) {
    const size_t size = self->model->states * sizeof *y;
    memcpy(self->v.y, y, size);
    memset(self->v.low, 0, size);
    self->s->known = 0;
    self->known.current = 0;
}

/* Move states along the gaps. */
static void shift(Instance *self, double time, const double shifts[]) {
    call_push(self, time, self->v.y, NOTHING, shifts, self->d.y);
    replace_states(self, self->d.y);
}

/* Apply impulses of the contacts; the work is that of the mean rates. */
static void push(Instance *self, double time, const double impulses[]) {
    call_push(self, time, self->v.y, impulses, NOTHING, self->d.y);
    call_push(self, time, self->d.y, impulses, NOTHING, self->e.y);
    for (size_t i = 0; i < self->model->states; i++) self->d.y[i] = (self->v.y[i] + self->e.y[i]) / 2;
    replace_states(self, self->d.y);
}

/* Apply impulses of the contacts, and add those that operators feel to theirs. */
static void hit(Instance *self, double time, const double impulses[]) {
    push(self, time, impulses);
    for (size_t i = 0; i < self->model->operators; i++)
        self->v.m[self->model->operator[i]] += self->contacts.operators[i];
}

/* Solve G_LL x_L = right_L; 0 if G_LL is singular, as where forces are not unique. */
static int solve(const double *matrix, size_t n, double right[]) {
    double a[AT_ONCE][AT_ONCE];
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++) a[i][j] = matrix[i * AT_ONCE + j];
    for (size_t i = 0; i < n; i++) {
        size_t best = i;
        double largest = 0;
        for (size_t k = 0; k < n; k++) largest = fmax(largest, fabs(matrix[k * AT_ONCE + i]));
        for (size_t k = i + 1; k < n; k++)
            if (fabs(a[k][i]) > fabs(a[best][i])) best = k;
        if (!(fabs(a[best][i]) > SINGULAR * largest)) return 0;
        for (size_t j = 0; j < n; j++) {
            const double other = a[best][j];
            a[best][j] = a[i][j];
            a[i][j] = other;
        }
        const double b = right[best];
        right[best] = right[i];
        right[i] = b;
        for (size_t k = i + 1; k < n; k++) {
            const double factor = a[k][i] / a[i][i];
            for (size_t j = i; j < n; j++) a[k][j] -= factor * a[i][j];
            right[k] -= factor * right[i];
        }
    }
    for (size_t i = n; i-- > 0;) {
        for (size_t j = i + 1; j < n; j++) right[i] -= a[i][j] * right[j];
        right[i] /= a[i][i];
    }
    return 1;
}

/* Bring the rates, or positions, of contacts that are held to 0; whether a position may still be off. */
static int annul(Instance *self, double time, const size_t list[], size_t n, int positions) {
    const size_t all = self->model->indicators;
    const Contacts *c = &self->contacts;
    double matrix[AT_ONCE * AT_ONCE] = {0}, right[AT_ONCE], change[MOST_CONTACTS] = {0};
    int needed = 0, far = 0;
    for (size_t i = 0; i < n; i++) {
        right[i] = positions ? -c->gap[list[i]] : -c->v[list[i]];
        needed |= right[i] != 0;
        far |= positions && fabs(right[i]) > FAR * c->scale[list[i]];
        for (size_t j = 0; j < n; j++) matrix[i * AT_ONCE + j] = c->G[list[i] + all * list[j]];
    }
    if (!needed || !solve(matrix, n, right)) return 0;
    for (size_t i = 0; i < n; i++) change[list[i]] = right[i];
    (positions ? shift : push)(self, time, change);
    inspect(self, time);
    return far;
}

/* Bring gaps to 0 by Newton's method. */
static void touch(Instance *self, double time, const size_t list[], size_t n) {
    for (int step = 0; step < NEWTON_STEPS && annul(self, time, list, n, 1); step++) continue;
}

void core_uphold(Instance *self, double time) {
    Modes modes;
    size_t list[AT_ONCE], n = 0, gaps;
    read_modes(self, modes);
    for (size_t i = 0; i < self->model->gaps && n < AT_ONCE; i++)
        if (modes[i] == CLOSED) list[n++] = i;
    gaps = n;
    for (size_t i = self->model->gaps; i < self->model->indicators && n < AT_ONCE; i++)
        if (holds(self->model, modes, i)) list[n++] = i;
    if (n == 0) return;
    inspect(self, time);
    touch(self, time, list, gaps);
    annul(self, time, list, n, 0);
}

void core_uphold_before(Instance *self) {
    const size_t inputs_size = self->model->inputs * sizeof *self->v.u;
    memcpy(self->e.u, self->v.u, inputs_size);
    for (const Prescribed *p = self->prescribed.list; p < self->prescribed.list + self->prescribed.count; p++) {
        self->v.u[p->value] = p->past->value;
        self->v.u[p->rate] = p->past->rate;
        self->v.u[p->acceleration] = p->past->acceleration;
    }
    core_uphold(self, self->s->time);
    memcpy(self->v.u, self->e.u, inputs_size);
}

/* ---- complementarity ---------------------------------------------------------------------------------------------- */

/* Calculate forces in some modes, and the accelerations with them; 0 if there are none, or more than one. */
static int forces_in(const Instance *self, const Problem *p, const Modes modes, double x[], double rate[]) {
    const Model *model = self->model;
    const size_t n = model->indicators, gaps = model->gaps;
    const double *G = self->contacts.G;
    double matrix[AT_ONCE * AT_ONCE] = {0}, right[AT_ONCE], effect[MOST_CONTACTS];
    size_t list[MOST_CONTACTS], held = 0;
    memset(x, 0, n * sizeof *x);
    for (size_t i = 0; i < n; i++) {
        if (holds(model, modes, i)) list[held++] = i;
        else if (i >= gaps && model->friction[i - gaps].normal < 0 && !p->impulses) x[i] = -modes[i] * p->slide[i - gaps];
    }
    if (held > AT_ONCE) return 0;
    for (size_t b = 0; b < held; b++) { /* a force also makes what slides under it rub */
        memset(effect, 0, n * sizeof *effect);
        effect[list[b]] = 1;
        for (size_t f = 0; f < model->frictions && list[b] < gaps; f++)
            if (model->friction[f].normal == (long)list[b]) effect[gaps + f] = -modes[gaps + f] * p->slide[f];
        for (size_t a = 0; a < held; a++) {
            double sum = 0;
            for (size_t i = 0; i < n; i++) sum += G[list[a] + n * i] * effect[i];
            matrix[a * AT_ONCE + b] = sum;
        }
    }
    for (size_t a = 0; a < held; a++) {
        right[a] = -p->rate[list[a]];
        for (size_t i = 0; i < n; i++) right[a] -= G[list[a] + n * i] * x[i];
    }
    if (!solve(matrix, held, right)) return 0;
    for (size_t b = 0; b < held; b++) {
        x[list[b]] += right[b];
        for (size_t f = 0; f < model->frictions && list[b] < gaps; f++)
            if (model->friction[f].normal == (long)list[b] && modes[gaps + f] != STICKS)
                x[gaps + f] -= modes[gaps + f] * p->slide[f] * right[b];
    }
    for (size_t i = 0; i < n; i++) {
        rate[i] = p->rate[i];
        for (size_t j = 0; j < n; j++) rate[i] += G[i + n * j] * x[j];
    }
    return 1;
}

/* Whether modes are consistent: forces push where rates are 0, and so on. */
static int consistent(const Instance *self, const Problem *p, const Modes modes, const double x[], const double rate[]) {
    const Model *model = self->model;
    const size_t n = model->indicators, gaps = model->gaps;
    for (size_t k = 0; k < p->n; k++) {
        const size_t i = p->contact[k];
        const double tolerance = p->tolerance[i], little = tolerance / self->contacts.G[i + n * i];
        if (i < gaps) {
            if (modes[i] == CLOSED ? x[i] < -little : rate[i] < -tolerance) return 0;
            continue;
        }
        const long normal = model->friction[i - gaps].normal;
        if (normal >= 0 && modes[normal] == OPEN) {
            if (modes[i] != STICKS) return 0; /* all modes are alike: one will do */
        } else if (modes[i] == STICKS) {
            const double bound = normal >= 0 ? p->stick[i - gaps] * x[normal] : p->stick[i - gaps];
            if (fabs(x[i]) > bound + little) return 0;
        } else if (modes[i] * rate[i] < -tolerance) {
            return 0;
        }
    }
    return 1;
}

/* Whether other forces satisfy the same conditions, or contacts are too near to that. */
static int ambiguous(const Instance *self, const Problem *p, const Modes modes, const double rate[]) {
    double x[MOST_CONTACTS], other[MOST_CONTACTS];
    Modes tied;
    int ties = 0;
    memcpy(tied, modes, sizeof tied);
    for (size_t k = 0; k < p->n; k++) {
        const size_t i = p->contact[k];
        if (i < self->model->gaps && modes[i] == OPEN && rate[i] <= p->tolerance[i]) ties = tied[i] = CLOSED;
    }
    return ties && !forces_in(self, p, tied, x, other);
}

/* Give the contacts of a problem, and why they cannot be settled, as reason; 0. */
static int refuse(Instance *self, const Problem *p, double time, const char *why) {
    char names[TEXT / 2] = "";
    for (size_t k = 0; k < p->n; k++) {
        if (k > 0) strncat(names, ", ", sizeof names - strlen(names) - 1);
        strncat(names, name_of(self->model, p->contact[k]), sizeof names - strlen(names) - 1);
    }
    return core_because(self, "%s at t = %.9g: %s", names, time, why);
}

/* Choose modes, the present ones first, then those that hold most; 0 and a reason if there are none. */
static int choose(Instance *self, Problem *p, double time, Modes modes, double x[], double rate[]) {
    const size_t gaps = self->model->gaps;
    Modes first;
    size_t combinations = 1;
    int unique = 1;
    memcpy(first, modes, sizeof first);
    for (size_t k = 0; k < p->n; k++) combinations *= p->contact[k] < gaps ? 2 : 3;
    for (size_t combination = 0; combination <= combinations; combination++) {
        size_t rest = combination - 1;
        if (combination == 0) memcpy(modes, first, sizeof first);
        for (size_t k = 0; k < p->n && combination > 0; k++) {
            static const signed char OF_GAP[] = {CLOSED, OPEN}, OF_FRICTION[] = {STICKS, FORWARD, BACKWARD};
            const size_t i = p->contact[k], choices = i < gaps ? 2 : 3;
            modes[i] = i < gaps ? OF_GAP[rest % choices] : OF_FRICTION[rest % choices];
            rest /= choices;
        }
        if (!forces_in(self, p, modes, x, rate)) unique = 0;
        else if (consistent(self, p, modes, x, rate)) {
            if (!ambiguous(self, p, modes, rate)) return 1;
            return refuse(self, p, time, "their forces are not unique (redundant liaisons): leave one out");
        }
    }
    return refuse(self, p, time,
                  unique ? "no force keeps them apart and in their bounds (Painlevé)"
                         : "they contradict each other, or what pushes leaves no way out");
}

/* ---- impacts -------------------------------------------------------------------------------------------------------- */

/* Apply the impulses of an impact of all gaps in a list: v+ >= max(0, -e v-), with friction. */
static int strike(Instance *self, double time, const int touching[]) {
    const Model *model = self->model;
    const size_t n = model->indicators, gaps = model->gaps;
    const Contacts *c = &self->contacts;
    Problem p = {.impulses = 1, .stick = c->slide, .slide = c->slide};
    double x[MOST_CONTACTS], rate[MOST_CONTACTS], before[MOST_CONTACTS], loss[MOST_CONTACTS], total = 0, size = 0;
    Modes modes = {0};
    for (size_t i = 0; i < n; i++) {
        const int gap = i < gaps;
        const long normal = gap ? -1 : model->friction[i - gaps].normal;
        const int takes = gap ? touching[i] && c->v[i] <= STILL * c->rate_scale[i]
                              : normal >= 0 && touching[normal] && c->v[normal] <= STILL * c->rate_scale[normal];
        before[i] = c->v[i];
        p.rate[i] = c->v[i] - (gap && c->v[i] < 0 ? -c->restitution[i] * c->v[i] : 0);
        p.tolerance[i] = BALANCED * c->rate_scale[i];
        if (!gap) modes[i] = FORWARD; /* without a force it has no effect */
        if (!takes) continue;
        if (p.n == AT_ONCE) return refuse(self, &p, time, "more than eight contacts at once");
        if (gap) modes[i] = CLOSED;
        p.contact[p.n++] = i;
    }
    if (!choose(self, &p, time, modes, x, rate)) return 0;
    hit(self, time, x);
    inspect(self, time);
    for (size_t i = 0; i < n; i++) {
        loss[i] = -x[i] * (before[i] + c->v[i]) / 2;
        total += loss[i];
        size += fabs(x[i]) * (fabs(before[i]) + 1e-2 * c->rate_scale[i]); /* STILL is rounding */
    }
    if (total < -1e-9 * size)
        return refuse(self, &p, time, "Newton's restitution and friction would gain energy (Kane): take less of either");
    for (size_t i = 0; i < n; i++) {
        self->v.m[i < gaps ? model->gap[i].loss : model->friction[i - gaps].loss] += loss[i];
        if (i >= gaps || !(x[i] > 0)) continue;
        self->v.m[model->gap[i].impulse] += x[i];
        self->v.m[model->gap[i].impacts] += before[i] < -STILL * c->rate_scale[i]
                                            && before[i] * before[i] > 2 * fabs(c->a[i]) * COUNTED * c->scale[i];
    }
    return 1;
}

/* ---- events --------------------------------------------------------------------------------------------------------- */

/* Duration of a bounce from a gap at rate v, with all that follow, under an acceleration a < 0. */
static double lasts(double v, double a, double e) { return e < 1 ? 2 * v / (-a * (1 - e)) : 0; }

/* Whether no gap overlaps by more than rounding, or by what an importer may be late, and friction brakes. */
static int check_overlaps(Instance *self, double time, int late) {
    const Model *model = self->model;
    const Contacts *c = &self->contacts;
    for (size_t i = 0; i < model->indicators; i++)
        if (!isfinite(c->v[i]) || !isfinite(c->a[i])) return core_because(self, "%s: its rate is not finite at t = %.9g", name_of(model, i), time);
    for (size_t i = 0; i < model->frictions; i++)
        if (!(c->slide[i] >= 0 && c->stick[i] >= c->slide[i] * (1 - STUCK)))
            return core_because(self, "%s at t = %.9g: its static bound %g must be at least the sliding one, %g, and that >= 0",
                                model->friction[i].name, time, c->stick[i], c->slide[i]);
    for (size_t i = 0; i < model->gaps; i++) {
        const double G = c->G[i * (model->indicators + 1)];
        if (c->gap[i] < -(late ? LATE : OVERLAP) * c->scale[i] - rounding(c, i, time))
            return core_because(self, "%s = %.6g at t = %.9g: bodies overlap; %s", model->gap[i].name, c->gap[i], time,
                                self->s->phase < EVENT ? "start with a gap >= 0"
                                : late ? "an event was stepped over: take shorter steps, or find where indicators cross 0"
                                       : "a prescribed coordinate must not jump through a body");
        if (self->s->phase < EVENT && c->gap[i] > COARSE[0] * rounding(c, i, time) && c->gap[i] < COARSE[1] * rounding(c, i, time))
            return core_because(self, "%s = %.6g at t = %.9g is too small beside positions of %.3g: start with 0 or more than %.3g, or "
                                "measure positions from near the contact", model->gap[i].name, c->gap[i], time, c->scale[i],
                                COARSE[1] * rounding(c, i, time));
        if (c->gap[i] <= rounding(c, i, time) && !(G > 0 && isfinite(G)))
            return core_because(self, "%s at t = %.9g: it moves no mass (effective mass %g)", model->gap[i].name, time, 1 / G);
    }
    return 1;
}

double core_next_rest(const Instance *self, double time) {
    double next = INFINITY;
    for (const Gap *gap = self->model->gap; gap < self->model->gap + self->model->gaps; gap++)
        if (self->v.m[gap->rests_from] > time) next = fmin(next, self->v.m[gap->rests_from]);
    return next;
}

void core_follow_gaps(Instance *self) {
    const Model *model = self->model;
    const double time = self->s->time;
    size_t list[AT_ONCE], n = 0, before;
    int listed[MOST_CONTACTS] = {0};
    if (model->gaps == 0) return;
    inspect(self, time);
    do { /* what gives way to one may come into another */
        before = n;
        for (size_t i = 0; i < model->gaps; i++) {
            const double depth = FOLLOWED * self->contacts.scale[i], gap = self->contacts.gap[i];
            const int follows = gap > -depth && (gap < 0 || (is_closed(self, i) && gap < depth));
            if (n < AT_ONCE && follows && !listed[i]) list[n++] = i;
            listed[i] |= follows;
        }
        touch(self, time, list, n);
    } while (n > before);
}

/* Choose modes at rest: complementarity of the accelerations of what touches and rests, and of what does not slide. */
static int rest(Instance *self, double time, const int touching[], Modes modes, double x[], double rate[]) {
    const Model *model = self->model;
    const size_t n = model->indicators, gaps = model->gaps;
    const Contacts *c = &self->contacts;
    Problem p = {.stick = c->stick, .slide = c->slide};
    read_modes(self, modes);
    for (size_t i = 0; i < n; i++) {
        p.rate[i] = c->a[i];
        p.tolerance[i] = BALANCED * c->acceleration_scale[i];
        const double least = i >= gaps && holds(model, modes, i) ? STUCK : STILL;
        const int still = fabs(c->v[i]) <= least * c->rate_scale[i];
        if (i < gaps && !(touching[i] && still)) {
            modes[i] = OPEN;
            continue;
        }
        const long normal = i < gaps ? -1 : model->friction[i - gaps].normal;
        if (normal >= 0 && !touching[normal]) {
            modes[i] = STICKS; /* it has no force */
            continue;
        }
        if (i >= gaps && !still) {
            modes[i] = c->v[i] > 0 ? FORWARD : BACKWARD;
            continue;
        }
        if (p.n == AT_ONCE) return refuse(self, &p, time, "more than eight contacts at once");
        p.contact[p.n++] = i;
    }
    return choose(self, &p, time, modes, x, rate);
}

/* Whether a gap is at 0; one that is closed may have drifted from it. */
static int touches(Instance *self, size_t i, double time) {
    const Contacts *c = &self->contacts;
    return c->gap[i] <= (is_closed(self, i) ? FOLLOWED * c->scale[i] : rounding(c, i, time));
}

int core_is_unsettled(Instance *self, double time) {
    const Model *model = self->model;
    const Contacts *c = &self->contacts;
    int touching[MOST_CONTACTS];
    double x[MOST_CONTACTS], rate[MOST_CONTACTS];
    Modes present, modes;
    if (model->indicators == 0) return 0;
    inspect(self, time);
    read_modes(self, present);
    for (size_t i = 0; i < model->gaps; i++) {
        touching[i] = touches(self, i, time);
        if (touching[i] && c->v[i] < -STILL * c->rate_scale[i]) return 1;
    }
    return !rest(self, time, touching, modes, x, rate) || memcmp(present, modes, model->indicators) != 0;
}

/* Find a gap whose bounces are so small that the rest of them is summed, and when they end; gaps if there is none. */
static size_t lowest_bounce(Instance *self, double time, const int touching[], const int was_closed[], const Modes modes,
                            const double rate[], const int rises[]) {
    const Model *model = self->model;
    const Contacts *c = &self->contacts;
    for (size_t i = 0; i < model->gaps; i++) {
        const double v = c->v[i], a = rate[i], height = v * v / (-2 * a);
        if (modes[i] == CLOSED || !touching[i] || rises[i] || !(v > STILL * c->rate_scale[i]) || !(a < 0)) continue;
        if (height > (was_closed[i] ? fmax(LIFTED, c->lowest) : c->lowest) * c->scale[i]) {
            const double flight = -2.5 * v / a; /* the next impact lies inside a step */
            if (isfinite(flight) && (self->s->step > flight || self->s->step <= 0)) self->s->step = flight;
            continue;
        }
        self->v.m[model->gap[i].rests_from] = was_closed[i] ? time : time + lasts(v, a, c->restitution[i]);
        return i;
    }
    return model->gaps;
}

/* Bring the rate of a gap that bounces no more to 0, with those that are held: its energy is lost. */
static void stop(Instance *self, double time, size_t gap, const Modes modes) {
    const Model *model = self->model;
    const size_t n = model->indicators;
    const Contacts *c = &self->contacts;
    double matrix[AT_ONCE * AT_ONCE] = {0}, right[AT_ONCE], impulses[MOST_CONTACTS] = {0}, before[MOST_CONTACTS];
    size_t list[MOST_CONTACTS], held = 0;
    for (size_t i = 0; i < model->gaps && held < AT_ONCE; i++)
        if (i == gap || modes[i] == CLOSED) list[held++] = i;
    for (size_t a = 0; a < held; a++) {
        right[a] = -c->v[list[a]];
        for (size_t b = 0; b < held; b++) matrix[a * AT_ONCE + b] = c->G[list[a] + n * list[b]];
    }
    if (!solve(matrix, held, right)) return;
    for (size_t a = 0; a < held; a++) impulses[list[a]] = right[a];
    memcpy(before, c->v, n * sizeof *before);
    hit(self, time, impulses);
    inspect(self, time);
    for (size_t a = 0; a < held; a++) {
        const Gap *row = &model->gap[list[a]];
        self->v.m[row->impulse] += right[a];
        self->v.m[row->loss] -= right[a] * (before[list[a]] + c->v[list[a]]) / 2;
    }
}

/* Treat impacts, and choose modes, until nothing changes; 0 with a reason if that fails. */
static int settle(Instance *self, double time, int late) {
    const Model *model = self->model;
    const size_t gaps = model->gaps, n = model->indicators;
    const Contacts *c = &self->contacts;
    int touching[MOST_CONTACTS], was_closed[MOST_CONTACTS], rises[MOST_CONTACTS], impacts = 0;
    double x[MOST_CONTACTS], rate[MOST_CONTACTS], overlap[MOST_CONTACTS];
    size_t list[MOST_CONTACTS], held = 0;
    Modes modes;
    inspect(self, time);
    if (!check_overlaps(self, time, late)) return 0;
    for (size_t i = 0; i < gaps; i++) {
        was_closed[i] = is_closed(self, i);
        touching[i] = touches(self, i, time);
        rises[i] = late && c->v[i] > 0; /* out of an importer's error: there is no impact to be summed with others */
        overlap[i] = fmax(0, -c->gap[i] / c->scale[i]);
        if (touching[i] && held < AT_ONCE && c->gap[i] != 0) list[held++] = i;
    }
    touch(self, time, list, held);
    for (;;) {
        int approaches = 0;
        for (size_t i = 0; i < gaps; i++) approaches |= touching[i] && c->v[i] < -STILL * c->rate_scale[i];
        if (!approaches) break;
        if (++impacts > MOST_IMPACTS) {
            Problem p = {0};
            for (size_t i = 0; i < gaps && p.n < AT_ONCE; i++)
                if (touching[i]) p.contact[p.n++] = i;
            return refuse(self, &p, time, "more than 1000 impacts at one instant");
        }
        if (!strike(self, time, touching)) return 0;
    }
    for (size_t tries = 0;; tries++) {
        if (!rest(self, time, touching, modes, x, rate)) return 0;
        const size_t low = tries > gaps ? gaps : lowest_bounce(self, time, touching, was_closed, modes, rate, rises);
        if (low == gaps) break;
        stop(self, time, low, modes);
        was_closed[low] = 2; /* it keeps the instant at which it rests */
    }
    held = 0;
    for (size_t i = 0; i < gaps; i++) {
        if (modes[i] == CLOSED && !was_closed[i]) self->v.m[model->gap[i].rests_from] = time;
        /* The importer's errors, of which overlaps tell, would close what begins to open. */
        const double error = fmin(ERRORS * fmax(self->s->tolerance, overlap[i]), FOLLOWED);
        const int slow = late && touching[i] && c->v[i] < ERRORS * error * c->rate_scale[i];
        *closed_of(self, i) = modes[i] == CLOSED ? 1 : slow ? -error : 0;
    }
    for (size_t i = 0; i < model->frictions; i++) self->v.m[model->friction[i].direction] = modes[gaps + i];
    for (size_t i = 0; i < n && held < AT_ONCE; i++)
        if (holds(model, modes, i)) list[held++] = i;
    annul(self, time, list, held, 0);
    return 1;
}

/* Move the states by a time, which may be negative, at the present rates. */
static void drift(Instance *self, double time, double by) {
    double *u = self->v.u;
    evaluate(self, derivatives_of(self->model), time, self->v.y, self->d.y);
    for (size_t i = 0; i < self->model->states; i++) self->v.y[i] += by * self->d.y[i];
    for (const Prescribed *p = self->prescribed.list; p < self->prescribed.list + self->prescribed.count; p++) {
        u[p->value] += by * (u[p->rate] + by / 2 * u[p->acceleration]);
        u[p->rate] += by * u[p->acceleration];
    }
}

int core_settle_contacts(Instance *self, double time) {
    const int exchange = self->s->phase >= EVENT && self->s->use == USE_MODEL_EXCHANGE;
    const Contacts *c = &self->contacts;
    const size_t inputs_size = self->model->inputs * sizeof *self->v.u;
    const size_t gaps = self->model->gaps;
    double late = 0, most = 0; /* an importer finds an event when it is past */
    size_t first = gaps;       /* what came into contact first */
    inspect(self, time);
    /* It knows positions to its tolerance, or worse. */
    self->contacts.lowest = exchange ? fmax(LOWEST, self->s->tolerance) : LOWEST;
    for (size_t i = 0; i < gaps && exchange; i++) {
        self->contacts.lowest = fmax(c->lowest, -c->gap[i] / c->scale[i]);
        if (is_closed(self, i)) continue; /* it drifts */
        if (!(c->gap[i] < *closed_of(self, i) * c->scale[i] / 2 && c->gap[i] > -LATE * c->scale[i])) continue;
        /* What hardly moves is put to 0 where it is. */
        if (!(c->v[i] < -STILL * c->rate_scale[i] && c->v[i] * c->v[i] > fabs(c->a[i] * c->gap[i]))) continue;
        if (c->gap[i] / c->v[i] <= most) continue;
        most = c->gap[i] / c->v[i];
        first = i;
    }
    if (first < gaps) memcpy(self->e.u, self->v.u, inputs_size);
    for (int k = 0; first < gaps && k < NEWTON_STEPS && c->v[first] < 0; k++) {
        const double by = c->gap[first] / c->v[first];
        drift(self, time - late, -by);
        late += by;
        inspect(self, time - late);
        if (fabs(c->gap[first]) <= rounding(c, first, time) / 2) break;
    }
    if (!settle(self, time - late, exchange)) return 0;
    if (first < gaps) {
        drift(self, time - late, late);
        memcpy(self->v.u, self->e.u, inputs_size);
    }
    self->known.current = 0;
    return core_remember(self) || core_because_infinite(self);
}

int core_has_event(Instance *self, double time) {
    double *values = self->contacts.indicators;
    if (self->model->indicators == 0) return 0;
    evaluate(self, self->model->indicate, time, self->v.y, values);
    for (size_t i = 0; i < self->model->indicators; i++)
        if (values[i] < 0) return 1;
    return 0;
}

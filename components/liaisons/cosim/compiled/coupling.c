/* A coupled step: what coupling/ does in Python, operation by operation, so that it is rounded alike.

   Signals are values, their slopes behind them, and a zero.  Buffers are the caller's; so is what fails: see Failure. */
#include <math.h>

#include "calls.h"

enum { MOST_ITERATIONS = 100, SLOW = 3, SECANTS = 3, POWERS = 8, POINTS = 3 };
enum { AS_SET, POLYNOMIAL, ASKED, MEAN }; /* how inputs move */
enum { RAISED = -1, DIVERGED = -2 };      /* what is no status of FMI */

static const double NOISE = 1e4, DEPENDENT = 1e-12, SMALLEST = 1e-3;

typedef struct { /* see elimination.py */
    size_t n;
    double smallest_pivot;
    int ordered;
    const double *values;
    const size_t *row_turns, *column_turns;
    double *pivots, *work;
    const size_t *given_starts, *above_starts, *below_starts, *given_rows, *above_rows, *below_rows;
    const size_t *places;
    double *upper, *lower;
} Elimination;

typedef struct { /* see newton.py */
    int ready;
    const Call *calls;
    size_t count, entries;
    const double *const *derivatives; /* of each entry */
    const size_t *slots, *powers;
    const double *factors;
    double *values;
    size_t numbers;
    Elimination *elimination;
    Python *order;
} Newton;

typedef struct { /* see member.py */
    int way, repeated, sloped;
    const Call *calls; /* if repeated, the first ones save and restore */
    size_t count, inputs, outputs;
    size_t value, slope; /* of its first output */
    const size_t *sources, *rates, *roots;
    double *set_values, *rate_values;
    const double *read, *slopes;
    size_t derivatives, terms, known; /* of the polynomials */
    const size_t *signals, *scaling, *term, *after, *begun, *of;
    const double *factors;
    double *shape; /* derivatives; inputs inside; means */
} Member;

typedef struct { /* see group.py */
    int cyclic;
    Newton *newton; /* NULL: one member after the other */
    Member *members;
    size_t count, n, valued; /* unknowns; values among them */
    const size_t *unknowns, *kinds;
    double *errors;
    double tolerance;
} Group;

typedef unsigned char Flag;

typedef struct { /* see handed.py */
    size_t made;
    const size_t *values;
    double *past, *spans;
    size_t *depth;
    const double *instants, *others;
    Python *ask; /* NULL: there are no others */
} Handed;

typedef struct {
    size_t group, member;
    ptrdiff_t call; /* of the member, or of Newton's method */
    size_t iteration;
    int deriving;
} Failure;

typedef struct { /* see coupled.py and signals.py */
    size_t outputs, kinds, count;
    double *before, *now, *earlier, *since, *sizes, *result;
    const size_t *rates, *kind;
    const Group *groups;
    const Handed *handed; /* one a group, and that of the functions of time */
    const Flag *held;
    Python *drive;        /* NULL: no functions of time */
    const double *inside; /* shape (orders, instants) */
    size_t orders, instants;
    double *room, *scratch; /* for the members, one at a time, and for the groups */
    Failure failure;
} System;

static double larger(double a, double b) { return a >= b || isnan(a) ? a : b; }

static void powers_of(double size, double powers[]) {
    powers[0] = 1;
    for (size_t k = 1; k < POWERS; k++) powers[k] = powers[k - 1] * size;
}

/* ---- elimination --------------------------------------------------------------------------------------------- */

static int too_small(double pivot, double largest, double part) {
    return !(fabs(pivot) > 0 && fabs(pivot) >= part * largest);
}

EXPORT int eliminate(const Elimination *e) {
    double *const work = e->work;
    for (size_t turn = 0; turn < e->n; turn++) {
        const size_t above = e->above_starts[turn], last_above = e->above_starts[turn + 1];
        const size_t below = e->below_starts[turn], last_below = e->below_starts[turn + 1];
        work[turn] = 0;
        for (size_t i = above; i < last_above; i++) work[e->above_rows[i]] = 0;
        for (size_t i = below; i < last_below; i++) work[e->below_rows[i]] = 0;
        for (size_t i = e->given_starts[turn]; i < e->given_starts[turn + 1]; i++)
            work[e->given_rows[i]] = e->values[e->places[i]];
        for (size_t i = above; i < last_above; i++) {
            const size_t row = e->above_rows[i];
            for (size_t k = e->below_starts[row]; k < e->below_starts[row + 1]; k++)
                work[e->below_rows[k]] -= e->lower[k] * work[row];
            e->upper[i] = work[row];
        }
        double largest = 0;
        for (size_t i = below; i < last_below; i++) largest = larger(fabs(work[e->below_rows[i]]), largest);
        const double pivot = e->pivots[turn] = work[turn];
        if (too_small(pivot, largest, e->smallest_pivot)) return 0;
        for (size_t i = below; i < last_below; i++) e->lower[i] = work[e->below_rows[i]] / pivot;
    }
    return 1;
}

EXPORT void solve(const Elimination *e, const double right[], double solution[]) {
    double *const work = e->work;
    for (size_t i = 0; i < e->n; i++) work[e->row_turns[i]] = right[i];
    for (size_t turn = 0; turn < e->n; turn++)
        for (size_t i = e->below_starts[turn]; i < e->below_starts[turn + 1]; i++)
            work[e->below_rows[i]] -= e->lower[i] * work[turn];
    for (size_t turn = e->n; turn-- > 0;) {
        work[turn] /= e->pivots[turn];
        for (size_t i = e->above_starts[turn]; i < e->above_starts[turn + 1]; i++)
            work[e->above_rows[i]] -= e->upper[i] * work[turn];
    }
    for (size_t i = 0; i < e->n; i++) solution[i] = work[e->column_turns[i]];
}

static int prepare(System *system, Newton *newton, const double powers[], double size) {
    Elimination *const elimination = newton->elimination;
    system->failure.deriving = 1;
    for (size_t i = 0; i < newton->count; i++) {
        const int status = perform(&newton->calls[i], 0, size);
        if (fine(status)) continue;
        system->failure.call = (ptrdiff_t)i;
        return status;
    }
    system->failure.deriving = 0;
    for (size_t i = 0; i < newton->numbers; i++) newton->values[i] = i < elimination->n;
    for (size_t i = 0; i < newton->entries; i++)
        newton->values[newton->slots[i]] -= *newton->derivatives[i] * newton->factors[i] * powers[newton->powers[i]];
    if (!(elimination->ordered && eliminate(elimination)))
        if (newton->order() != OK) return RAISED;
    newton->ready = 1;
    return OK;
}

/* ---- one FMU ------------------------------------------------------------------------------------------------- */

static void differentiate(const System *system, const Member *m, const double powers[], double derivatives[]) {
    double *const data = system->room;
    for (size_t i = 0; i < m->known; i++) data[i] = system->before[m->signals[i]] * powers[m->scaling[i]];
    for (size_t i = 0; i < m->derivatives; i++) {
        double total = 0;
        for (size_t k = i * m->terms; k < (i + 1) * m->terms; k++) total += m->factors[k] * data[m->term[k]];
        derivatives[i] = system->held[m->roots[m->of[i]]] ? system->before[m->begun[i]] : total / powers[m->after[i]];
    }
}

/* What inputs are at some instants inside a step. */
static void look_inside(const System *system, const Member *m, const double powers[]) {
    double *const derivatives = system->room + m->known;
    differentiate(system, m, powers, derivatives);
    for (size_t t = 0; t < system->instants; t++)
        for (size_t i = 0; i < m->inputs; i++) {
            double value = system->before[m->sources[i]];
            for (size_t order = 0; order < system->orders; order++)
                value += system->inside[order * system->instants + t]
                         * (derivatives[i * system->orders + order] * powers[order + 1]);
            m->shape[t * m->inputs + i] = value;
        }
}

static int step(System *system, const Member *m, const double powers[], double time, double size, int again) {
    for (size_t i = 0; i < m->inputs; i++) m->set_values[i] = system->now[m->sources[i]];
    if (m->sloped)
        for (size_t i = 0; i < m->inputs; i++) m->rate_values[i] = system->now[m->rates[i]];
    if (m->way == POLYNOMIAL) differentiate(system, m, powers, m->shape);
    if (m->way == ASKED) look_inside(system, m, powers);
    if (m->way == MEAN)
        for (size_t i = 0; i < m->inputs; i++) {
            const double begin = system->before[m->sources[i]], end = system->now[m->sources[i]];
            m->shape[i] = system->held[m->roots[i]] ? begin : (begin + end) / 2;
        }
    for (size_t i = 0; i < m->count; i++) {
        if (m->repeated && i == (again ? 0u : 1u)) continue;
        const int status = perform(&m->calls[i], time, size);
        if (fine(status)) continue;
        system->failure.call = (ptrdiff_t)i;
        return status;
    }
    return OK;
}

static void collect(const Member *m, double target[]) {
    memcpy(target + m->value, m->read, m->outputs * sizeof *target);
    if (m->sloped) memcpy(target + m->slope, m->slopes, m->outputs * sizeof *target);
}

/* ---- a group ------------------------------------------------------------------------------------------------- */

static double product(size_t n, const double a[], const double b[]) {
    double sum = a[0] * b[0];
    for (size_t i = 1; i < n; i++) sum += a[i] * b[i];
    return sum;
}

/* The next point, from the last ones; 2 SECANTS n numbers of room. */
static void accelerate(size_t n, size_t done, const double *points, const double *changes, double *room, double *next) {
    const size_t kept = SECANTS + 1, last = (done - 1) % kept * n;
    const size_t many = done < kept ? done : kept;
    double *const rest = room + 2 * SECANTS * n;
    size_t found = 0;
    for (size_t i = 0; i < n; i++) {
        rest[i] = changes[last + i];
        next[i] = points[last + i] + changes[last + i];
    }
    for (size_t k = 1; k < many && done >= 3; k++) {
        const size_t here = (done - k) % kept * n, there = (done - k - 1) % kept * n;
        double *const direction = room + 2 * found * n, *const way = direction + n;
        for (size_t i = 0; i < n; i++) {
            direction[i] = changes[here + i] - changes[there + i];
            way[i] = (points[here + i] - points[there + i]) + direction[i];
        }
        const double length = sqrt(product(n, direction, direction));
        for (size_t other = 0; other < found; other++) {
            const double *const past = room + 2 * other * n, part = product(n, past, direction);
            for (size_t i = 0; i < n; i++) {
                direction[i] -= part * past[i];
                way[i] -= part * past[n + i];
            }
        }
        const double left = sqrt(product(n, direction, direction));
        if (!(left > DEPENDENT * length)) continue;
        found++;
        for (size_t i = 0; i < n; i++) {
            direction[i] /= left;
            way[i] /= left;
        }
        const double part = product(n, direction, rest);
        for (size_t i = 0; i < n; i++) {
            rest[i] -= part * direction[i];
            next[i] -= part * way[i];
        }
    }
}

/* Errors of the unknowns, relative to the largest value of their unit so far, of slopes that over H; the worst. */
static double judge(const System *system, const Group *g, const double x[], const double change[], double sizes[],
                    double size) {
    memcpy(sizes, system->sizes, system->kinds * sizeof *sizes);
    for (size_t i = 0; i < g->valued; i++) sizes[g->kinds[i]] = larger(sizes[g->kinds[i]], fabs(x[i]));
    double worst = 0;
    for (size_t i = 0; i < g->n; i++) {
        double scale = larger(sizes[g->kinds[i]], SMALLEST);
        if (i >= g->valued) scale /= size;
        g->errors[i] = fabs(change[i]) / (scale * g->tolerance);
        worst = larger(worst, g->errors[i]);
    }
    return worst;
}

static int evaluate(System *system, const Group *g, const double powers[], double time, double size) {
    for (size_t k = 0; k < g->count; k++) {
        system->failure.member = k;
        const int status = step(system, &g->members[k], powers, time, size, system->failure.iteration > 0);
        if (status != OK) return status;
        if (!g->cyclic) {
            collect(&g->members[k], system->now);
            continue;
        }
        collect(&g->members[k], system->result);
        if (g->newton == NULL) collect(&g->members[k], system->now);
    }
    return OK;
}

/* Solve x = F(x). */
static int iterate(System *system, const Group *g, const double powers[], double time, double size) {
    const size_t n = g->n, kept = SECANTS + 1;
    double *const x = system->scratch, *const change = x + n, *const points = change + n,
                  *const changes = points + kept * n, *const room = changes + kept * n,
                  *const sizes = room + (2 * SECANTS + 1) * n;
    double before = INFINITY;
    size_t *const iteration = &system->failure.iteration;
    if (!g->cyclic) return evaluate(system, g, powers, time, size);
    if (g->newton != NULL && !g->newton->ready) {
        const int status = prepare(system, g->newton, powers, size);
        if (status != OK) return status;
    }
    for (*iteration = 0; *iteration < MOST_ITERATIONS; ++*iteration) {
        double *const point = points + *iteration % kept * n, *const turn = changes + *iteration % kept * n;
        for (size_t i = 0; i < n; i++) point[i] = system->now[g->unknowns[i]];
        const int status = evaluate(system, g, powers, time, size);
        if (status != OK) return status;
        for (size_t i = 0; i < n; i++) turn[i] = system->result[g->unknowns[i]] - point[i];
        if (g->newton != NULL) {
            solve(g->newton->elimination, turn, change);
            memcpy(turn, change, n * sizeof *turn);
        }
        const double error = judge(system, g, point, turn, sizes, size);
        if (error <= 1 || (*iteration > 2 && before / 2 < error && error <= NOISE)) break;
        before = error;
        if (g->newton == NULL) continue;
        accelerate(n, *iteration + 1, points, changes, room, x);
        for (size_t i = 0; i < n; i++) system->now[g->unknowns[i]] = x[i];
    }
    if (*iteration == MOST_ITERATIONS) return DIVERGED;
    for (size_t i = 0; i < n; i++) x[i] = system->now[g->unknowns[i]]; /* what no member takes is as it was read */
    for (size_t k = 0; k < g->count; k++) collect(&g->members[k], system->now);
    for (size_t i = 0; i < n; i++) system->now[g->unknowns[i]] = x[i];
    if (g->newton != NULL && *iteration + 1 > SLOW) g->newton->ready = 0;
    return OK;
}

/* ---- the signals --------------------------------------------------------------------------------------------- */

static void predict(const System *system, double size) {
    const size_t n = system->outputs, zero = 2 * n, *const rates = system->rates;
    const double since = *system->since, *const before = system->before, *const earlier = system->earlier;
    double *const now = system->now;
    for (size_t i = 0; since == 0 && i < zero; i++)
        now[i] = before[i] + size * (before[rates[i]] + size / 2 * before[rates[rates[i]]]);
    for (size_t pass = 0; since != 0 && pass < 2; pass++)
        for (size_t i = 0; i < zero; i++) {
            const double s = size / since, x = before[i];
            const double back = earlier[i] - x, fall = earlier[rates[i]] * since, rise = before[rates[i]] * since;
            const double cubic = fall + rise + 2 * back, square = fall + 2 * rise + 3 * back;
            if (pass == 0)
                now[i] = rates[i] == zero ? x - s * back : x + s * (rise + s * (square + s * cubic));
            else if (rates[i] >= n && rates[i] < zero)
                now[rates[i]] = (rise + s * (2 * square + 3 * s * cubic)) / since;
        }
    now[zero] = 0;
}

static void accept(const System *system, double size) {
    const size_t width = 2 * system->outputs + 1;
    memcpy(system->earlier, system->before, width * sizeof *system->now);
    memcpy(system->before, system->now, width * sizeof *system->now);
    *system->since = size;
    for (size_t i = 0; i < system->outputs; i++) {
        double *const largest = &system->sizes[system->kind[i]];
        *largest = larger(*largest, fabs(system->now[i]));
    }
}

/* ---- what a group hands on ----------------------------------------------------------------------------------- */

static int fresh(const Handed *h) {
    for (size_t i = 0; i < h->made; i++)
        if (h->depth[i] < POINTS) return 1;
    return 0;
}

typedef struct {
    double begin, end;
} Slopes;

/* Of the cubic through both ends and two more points; of a parabola or a straight line, as far as there are points. */
static Slopes cubic(double size, double before, double now, double a, double b, double at_a, double at_b,
                    size_t depth) {
    const double first = (now - before) / size;
    const double second = depth > 1 ? (now - at_a) / (size - a) : first;
    const double bend = (second - first) / a;
    const double third = depth > 2 ? (at_a - at_b) / (a - b) : second + bend * (b - size);
    const double twist = ((third - second) / (b - size) - bend) / b;
    return (Slopes){first + size * (a * twist - bend), first + size * ((size - a) * twist + bend)};
}

static void shape(const System *system, const Handed *h, double size, int others) {
    for (size_t i = 0; i < h->made; i++) {
        const size_t value = h->values[i], slope = value + system->outputs;
        const double before = system->before[value], now = system->now[value];
        const double last = -h->spans[0], first = last - h->spans[1];
        Slopes slopes = cubic(size, before, now, last, first, h->past[i], h->past[h->made + i], h->depth[i]);
        if (others && h->depth[i] < POINTS)
            slopes = cubic(size, before, now, h->instants[0], h->instants[1], h->others[i], h->others[h->made + i],
                           POINTS);
        system->before[slope] = system->held[value] ? 0 : slopes.begin;
        system->now[slope] = system->held[value] ? 0 : slopes.end;
    }
}

static void take_over(const System *system, const Handed *h, double size) {
    if (h->made == 0) return;
    for (size_t i = 0; i < h->made; i++) {
        h->past[h->made + i] = h->past[i];
        h->past[i] = system->before[h->values[i]];
        if (h->depth[i] < POINTS) h->depth[i]++;
    }
    h->spans[1] = h->spans[0];
    h->spans[0] = size;
}

/* From t to t + H.  Returns 0, the status of a call that was refused, or what is no status. */
EXPORT int advance_coupled(System *system, double time, double size) {
    double powers[POWERS];
    powers_of(size, powers);
    predict(system, size);
    const int ahead = system->drive == NULL ? 0 : system->drive();
    if (ahead == RAISED) return RAISED;
    shape(system, &system->handed[system->count], size, ahead);
    for (size_t k = 0; k < system->count; k++) {
        const Handed *const handed = &system->handed[k];
        system->failure = (Failure){k, 0, 0, 0, 0};
        const int inside = handed->ask != NULL && fresh(handed) ? handed->ask() : 0;
        if (inside == RAISED) return RAISED;
        if (!inside) {
            const int status = iterate(system, &system->groups[k], powers, time, size);
            if (status != OK) return status;
        }
        shape(system, handed, size, inside);
    }
    for (size_t k = 0; k <= system->count; k++) take_over(system, &system->handed[k], size);
    accept(system, size);
    return OK;
}

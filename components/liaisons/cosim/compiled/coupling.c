/* Coupled communication steps, prepared by the Python modules in coupling/.

   The signals are n values, n slopes (their derivatives by time) and a zero.  The caller owns all buffers, and raises
   the errors: see Failure. */
#include <math.h>

#include "calls.h"

enum { MOST_ITERATIONS = 100, SLOW = 3, SECANTS = 3, POWERS = 8, POINTS = 3 };
enum { AS_SET, POLYNOMIAL, AT_INSTANTS, MEAN }; /* input reconstruction */
enum { RAISED = -1, DIVERGED = -2 };      /* results that are no status of FMI */

static const double NOISE = 1e4, DEPENDENT = 1e-12, SMALLEST = 1e-3;

typedef struct { /* see elimination.py */
    size_t n;
    double smallest_pivot;
    int ordered;
    const double *values;
    const size_t *row_order, *column_order;
    double *pivots, *work;
    const size_t *starts, *above_starts, *below_starts, *rows, *above_rows, *below_rows;
    const size_t *indices;
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

typedef struct { /* see node.py */
    int approximation, repeated, sloped;
    const Call *calls; /* if repeated, the first two save and restore */
    size_t count, inputs, outputs;
    size_t value, slope; /* of its first output */
    const size_t *sources, *rates, *roots;
    double *set_values, *rate_values;
    const double *read, *slopes;
    size_t derivatives, terms, data; /* of the polynomials */
    const size_t *signals, *scaling, *term, *after, *begun, *of;
    const double *factors;
    double *shape; /* derivatives; inputs inside; means */
} Node;

typedef struct { /* see strong_component.py */
    int cyclic;
    Newton *newton; /* NULL: Gauss-Seidel iteration */
    Node *nodes;
    size_t count, n, valued; /* unknowns; values among them */
    const size_t *unknowns, *kinds;
    double *errors;
    double tolerance;
} StrongComponent;

typedef unsigned char Flag;

typedef struct { /* see signals.py */
    size_t made;
    const size_t *values;
    double *past, *spans;
    size_t *depth;
    const double *instants, *others;
    Python *step_in_thirds; /* sets others; NULL: there are none */
} SignalHistory;

typedef struct {
    size_t component, node;
    ptrdiff_t call; /* of the node, or of Newton's method */
    size_t iteration;
    int deriving;
} Failure;

typedef struct { /* see implicit.py and signals.py */
    size_t outputs, kinds, count;
    double *before, *now, *earlier, *since, *sizes, *result;
    const size_t *rates, *kind;
    const StrongComponent *components, *settled; /* in a step; at an instant */
    const SignalHistory *histories; /* one of each component, and one of the functions of time */
    const Flag *held;
    Python *drive;        /* NULL: no functions of time */
    const double *inside; /* shape (orders, instants) */
    size_t orders, instants;
    double *room, *scratch; /* for one node, and for one component */
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

/* Calculate the factors; 0 if a pivot is too small. */
EXPORT int eliminate(const Elimination *e) {
    double *const work = e->work;
    for (size_t turn = 0; turn < e->n; turn++) {
        const size_t above = e->above_starts[turn], last_above = e->above_starts[turn + 1];
        const size_t below = e->below_starts[turn], last_below = e->below_starts[turn + 1];
        work[turn] = 0;
        for (size_t i = above; i < last_above; i++) work[e->above_rows[i]] = 0;
        for (size_t i = below; i < last_below; i++) work[e->below_rows[i]] = 0;
        for (size_t i = e->starts[turn]; i < e->starts[turn + 1]; i++)
            work[e->rows[i]] = e->values[e->indices[i]];
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

/* Solve the equations by the factors. */
EXPORT void solve(const Elimination *e, const double right[], double solution[]) {
    double *const work = e->work;
    for (size_t i = 0; i < e->n; i++) work[e->row_order[i]] = right[i];
    for (size_t turn = 0; turn < e->n; turn++)
        for (size_t i = e->below_starts[turn]; i < e->below_starts[turn + 1]; i++)
            work[e->below_rows[i]] -= e->lower[i] * work[turn];
    for (size_t turn = e->n; turn-- > 0;) {
        work[turn] /= e->pivots[turn];
        for (size_t i = e->above_starts[turn]; i < e->above_starts[turn + 1]; i++)
            work[e->above_rows[i]] -= e->upper[i] * work[turn];
    }
    for (size_t i = 0; i < e->n; i++) solution[i] = work[e->column_order[i]];
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

static void differentiate(const System *system, const Node *node, const double powers[], double derivatives[]) {
    double *const data = system->room;
    for (size_t i = 0; i < node->data; i++) data[i] = system->before[node->signals[i]] * powers[node->scaling[i]];
    for (size_t i = 0; i < node->derivatives; i++) {
        double total = 0;
        for (size_t k = i * node->terms; k < (i + 1) * node->terms; k++)
            total += node->factors[k] * data[node->term[k]];
        const int held = system->held[node->roots[node->of[i]]];
        derivatives[i] = held ? system->before[node->begun[i]] : total / powers[node->after[i]];
    }
}

/* Inputs at the instants of intermediate update. */
static void set_intermediate_inputs(const System *system, const Node *node, const double powers[]) {
    double *const derivatives = system->room + node->data;
    differentiate(system, node, powers, derivatives);
    for (size_t t = 0; t < system->instants; t++)
        for (size_t i = 0; i < node->inputs; i++) {
            double value = system->before[node->sources[i]];
            for (size_t order = 0; order < system->orders; order++)
                value += system->inside[order * system->instants + t]
                         * (derivatives[i * system->orders + order] * powers[order + 1]);
            node->shape[t * node->inputs + i] = value;
        }
}

static int step(System *system, const Node *node, const double powers[], double time, double size, int again) {
    for (size_t i = 0; i < node->inputs; i++) node->set_values[i] = system->now[node->sources[i]];
    if (node->sloped)
        for (size_t i = 0; i < node->inputs; i++) node->rate_values[i] = system->now[node->rates[i]];
    if (node->approximation == POLYNOMIAL) differentiate(system, node, powers, node->shape);
    if (node->approximation == AT_INSTANTS) set_intermediate_inputs(system, node, powers);
    if (node->approximation == MEAN)
        for (size_t i = 0; i < node->inputs; i++) {
            const double begin = system->before[node->sources[i]], end = system->now[node->sources[i]];
            node->shape[i] = system->held[node->roots[i]] ? begin : (begin + end) / 2;
        }
    for (size_t i = 0; i < node->count; i++) {
        if (node->repeated && i == (again ? 0u : 1u)) continue;
        const int status = perform(&node->calls[i], time, size);
        if (fine(status)) continue;
        system->failure.call = (ptrdiff_t)i;
        return status;
    }
    return OK;
}

static void collect(const Node *node, double target[]) {
    memcpy(target + node->value, node->read, node->outputs * sizeof *target);
    if (node->sloped) memcpy(target + node->slope, node->slopes, node->outputs * sizeof *target);
}

/* ---- a strong component -------------------------------------------------------------------------------------- */

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
    size_t secants = 0;
    for (size_t i = 0; i < n; i++) {
        rest[i] = changes[last + i];
        next[i] = points[last + i] + changes[last + i];
    }
    for (size_t k = 1; k < many && done >= 3; k++) {
        const size_t late = (done - k) % kept * n, early = (done - k - 1) % kept * n;
        double *const direction = room + 2 * secants * n, *const advance = direction + n;
        for (size_t i = 0; i < n; i++) {
            direction[i] = changes[late + i] - changes[early + i];
            advance[i] = (points[late + i] - points[early + i]) + direction[i];
        }
        const double length = sqrt(product(n, direction, direction));
        for (size_t other = 0; other < secants; other++) {
            const double *const past = room + 2 * other * n, part = product(n, past, direction);
            for (size_t i = 0; i < n; i++) {
                direction[i] -= part * past[i];
                advance[i] -= part * past[n + i];
            }
        }
        const double left = sqrt(product(n, direction, direction));
        if (!(left > DEPENDENT * length)) continue;
        secants++;
        for (size_t i = 0; i < n; i++) {
            direction[i] /= left;
            advance[i] /= left;
        }
        const double part = product(n, direction, rest);
        for (size_t i = 0; i < n; i++) {
            rest[i] -= part * direction[i];
            next[i] -= part * advance[i];
        }
    }
}

/* Errors of the unknowns, relative to the largest value of their unit so far, of slopes that over H; the worst. */
static double relative_errors(const System *system, const StrongComponent *component, const double x[],
                              const double change[], double sizes[], double size) {
    memcpy(sizes, system->sizes, system->kinds * sizeof *sizes);
    for (size_t i = 0; i < component->valued; i++) {
        double *const largest = &sizes[component->kinds[i]];
        *largest = larger(*largest, fabs(x[i]));
    }
    double worst = 0;
    for (size_t i = 0; i < component->n; i++) {
        double scale = larger(sizes[component->kinds[i]], SMALLEST);
        if (i >= component->valued && size > 0) scale /= size;
        component->errors[i] = fabs(change[i]) / (scale * component->tolerance);
        worst = larger(worst, component->errors[i]);
    }
    return worst;
}

static int evaluate(System *system, const StrongComponent *component, const double powers[], double time, double size) {
    for (size_t k = 0; k < component->count; k++) {
        system->failure.node = k;
        const int status = step(system, &component->nodes[k], powers, time, size, system->failure.iteration > 0);
        if (status != OK) return status;
        if (!component->cyclic) {
            collect(&component->nodes[k], system->now);
            continue;
        }
        collect(&component->nodes[k], system->result);
        if (component->newton == NULL) collect(&component->nodes[k], system->now);
    }
    return OK;
}

/* Solve x = F(x). */
static int iterate(System *system, const StrongComponent *component, const double powers[], double time, double size) {
    const size_t n = component->n, kept = SECANTS + 1;
    double *const x = system->scratch, *const change = x + n, *const points = change + n,
                  *const changes = points + kept * n, *const room = changes + kept * n,
                  *const sizes = room + (2 * SECANTS + 1) * n;
    double before = INFINITY;
    size_t *const iteration = &system->failure.iteration;
    if (!component->cyclic) return evaluate(system, component, powers, time, size);
    if (component->newton != NULL && !component->newton->ready) {
        const int status = prepare(system, component->newton, powers, size);
        if (status != OK) return status;
    }
    for (*iteration = 0; *iteration < MOST_ITERATIONS; ++*iteration) {
        double *const point = points + *iteration % kept * n, *const turn = changes + *iteration % kept * n;
        for (size_t i = 0; i < n; i++) point[i] = system->now[component->unknowns[i]];
        const int status = evaluate(system, component, powers, time, size);
        if (status != OK) return status;
        for (size_t i = 0; i < n; i++) turn[i] = system->result[component->unknowns[i]] - point[i];
        if (component->newton != NULL) {
            solve(component->newton->elimination, turn, change);
            memcpy(turn, change, n * sizeof *turn);
        }
        const double error = relative_errors(system, component, point, turn, sizes, size);
        if (error <= 1 || (*iteration > 2 && before / 2 < error && error <= NOISE)) break;
        before = error;
        if (component->newton == NULL) continue;
        accelerate(n, *iteration + 1, points, changes, room, x);
        for (size_t i = 0; i < n; i++) system->now[component->unknowns[i]] = x[i];
    }
    if (*iteration == MOST_ITERATIONS) return DIVERGED;
    /* signals that are no unknowns are taken as they were read */
    for (size_t i = 0; i < n; i++) x[i] = system->now[component->unknowns[i]];
    for (size_t k = 0; k < component->count; k++) collect(&component->nodes[k], system->now);
    for (size_t i = 0; i < n; i++) system->now[component->unknowns[i]] = x[i];
    if (component->newton != NULL && *iteration + 1 > SLOW) component->newton->ready = 0;
    return OK;
}

/* Update the largest value of each unit. */
static void measure(const System *system) {
    for (size_t i = 0; i < system->outputs; i++) {
        double *const largest = &system->sizes[system->kind[i]];
        *largest = larger(*largest, fabs(system->now[i]));
    }
}

/* Solve x = F(x) of one component; size 0: at one instant. */
EXPORT int solve_component(System *system, const StrongComponent *component, double time, double size) {
    double powers[POWERS];
    powers_of(size, powers);
    system->failure = (Failure){0, 0, 0, 0, 0};
    const int status = iterate(system, component, powers, time, size);
    if (status == OK && size == 0) measure(system);
    return status;
}

/* Solve the equations of all components at one instant, where a smooth piece begins. */
EXPORT int settle_coupled(System *system, double time, double size) {
    (void)size; /* of the step before */
    for (size_t k = 0; k < system->count; k++) {
        const int status = solve_component(system, &system->settled[k], time, 0);
        if (status == OK) continue;
        system->failure.component = k;
        return status;
    }
    memcpy(system->before, system->now, (2 * system->outputs + 1) * sizeof *system->now);
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
    measure(system);
}

/* ---- signal histories ----------------------------------------------------------------------------------- */

static int is_fresh(const SignalHistory *history) {
    for (size_t i = 0; i < history->made; i++)
        if (history->depth[i] < POINTS) return 1;
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

static void shape(const System *system, const SignalHistory *history, double size, int inside) {
    for (size_t i = 0; i < history->made; i++) {
        const size_t value = history->values[i], slope = value + system->outputs;
        const double before = system->before[value], now = system->now[value];
        const double last = -history->spans[0], first = last - history->spans[1];
        const double *const past = history->past + i, *const others = history->others + i;
        Slopes slopes = cubic(size, before, now, last, first, past[0], past[history->made], history->depth[i]);
        if (inside && history->depth[i] < POINTS)
            slopes = cubic(size, before, now, history->instants[0], history->instants[1], others[0],
                           others[history->made], POINTS);
        system->before[slope] = system->held[value] ? 0 : slopes.begin;
        system->now[slope] = system->held[value] ? 0 : slopes.end;
    }
}

static void forget_history(const SignalHistory *history) {
    for (size_t i = 0; i < history->made; i++) {
        history->past[i] = history->past[history->made + i] = 0;
        history->depth[i] = 1;
    }
    history->spans[0] = history->spans[1] = 1;
}

static void advance_history(const System *system, const SignalHistory *history, double size) {
    if (history->made == 0) return;
    for (size_t i = 0; i < history->made; i++) {
        history->past[history->made + i] = history->past[i];
        history->past[i] = system->before[history->values[i]];
        if (history->depth[i] < POINTS) history->depth[i]++;
    }
    history->spans[1] = history->spans[0];
    history->spans[0] = size;
}

static void forget_matrix(const StrongComponent *component) {
    if (component->newton != NULL) component->newton->ready = 0;
}

/* Forget the points before the present one, and the derivatives of outputs by inputs. */
EXPORT void forget(const System *system) {
    *system->since = 0;
    for (size_t k = 0; k < system->count; k++) {
        forget_matrix(&system->components[k]);
        forget_matrix(&system->settled[k]);
    }
    for (size_t k = 0; k <= system->count; k++) forget_history(&system->histories[k]);
}

/* A step from t to t + H.  Returns 0, the status of a call that failed, RAISED or DIVERGED. */
EXPORT int advance_coupled(System *system, double time, double size) {
    double powers[POWERS];
    powers_of(size, powers);
    predict(system, size);
    const int ahead = system->drive == NULL ? 0 : system->drive();
    if (ahead == RAISED) return RAISED;
    shape(system, &system->histories[system->count], size, ahead);
    for (size_t k = 0; k < system->count; k++) {
        const SignalHistory *const history = &system->histories[k];
        system->failure = (Failure){k, 0, 0, 0, 0};
        const int inside = history->step_in_thirds != NULL && is_fresh(history) ? history->step_in_thirds() : 0;
        if (inside == RAISED) return RAISED;
        if (!inside) {
            const int status = iterate(system, &system->components[k], powers, time, size);
            if (status != OK) return status;
        }
        shape(system, history, size, inside);
    }
    for (size_t k = 0; k <= system->count; k++) advance_history(system, &system->histories[k], size);
    accept(system, size);
    return OK;
}

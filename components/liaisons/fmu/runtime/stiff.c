/* Radau IIA, the implicit Runge-Kutta method of order 5 in three stages, L-stable: Hairer, Wanner, Solving Ordinary
 * Differential Equations II, 2nd edition, Springer 1996, IV.5 and IV.8, with their simplified Newton iterations, error
 * estimate and control of the step size. */
#include "stiff.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "events.h"

enum { STAGES = 3, MOST_ITERATIONS = 7 };

static const double NODES[STAGES] = {0.1550510257216822, 0.6449489742783178, 1};
static const double WEIGHTS[STAGES][STAGES] = {
    {0.1968154772236604, -0.06553542585019839, 0.02377097434822015},
    {0.3944243147390873, 0.2920734116652285, -0.04154875212599793},
    {0.37640306270046725, 0.5124858261884216, 0.1111111111111111},
};
/* The inverse of WEIGHTS is TO diag(REAL, ((ALPHA, BETA), (-BETA, ALPHA))) FROM, with FROM the inverse of TO. */
static const double REAL = 3.637834252744496, ALPHA = 2.6810828736277523, BETA = 3.0504301992474105;
static const double TO[STAGES][STAGES] = {
    {0.09443876248897524, -0.1412552950209542, 0.030029194105147424},
    {0.2502131229653333, 0.20412935229379994, -0.3829421127572619},
    {1, 1, 0},
};
static const double FROM[STAGES][STAGES] = {
    {4.178718591551905, 0.32768282076106237, 0.5233764454994495},
    {-4.178718591551905, -0.32768282076106237, 0.47662355450055044},
    {0.5028726349457868, -2.571926949855605, 0.5960392048282249},
};
/* Of the increments at the stages: what the embedded method of order 3 has less, beside the rates at the start. */
static const double ERROR[STAGES] = {-10.048809399827416, 1.382142733160749, -0.3333333333333333};

/* Step sizes change by these factors at most, and not at all between 1 and KEEP: the matrices stay factorized. */
static const double SHRINK = 0.2, GROW = 8, KEEP = 1.2, SAFETY = 0.9;
/* Iterations that contract faster than this leave the Jacobian as it is for the next step. */
static const double FAST = 1e-3;

#define FOR_EACH(i, n) for (size_t i = 0; i < (n); i++)

struct Stiff {
    size_t n, coupled;
    double *J, *real, *pair;         /* the Jacobian, and the factorized matrices of the Newton iteration */
    size_t *real_pivots, *pair_pivots;
    double *start;                   /* rates at the start of the step */
    double *f[STAGES], *z[STAGES];   /* rates and increments at the stages */
    double *w[STAGES];               /* increments in the basis in which the stages come apart */
    double *x, *change;              /* a state; a change of the three w */
    double *column[STAGES];          /* of the polynomial of the last step: see events.c */
    double tolerance, tolerance_of;  /* of the estimated error; for this tolerance of the problem */
    double factorized;               /* step size of the matrices; 0: there are none */
    double contraction;              /* of the last iterations */
    int iterations;
};

Stiff *stiff_new(size_t n, size_t coupled) {
    const size_t square = coupled * coupled;
    Stiff *s = calloc(1, sizeof *s);
    if (s == NULL) return NULL;
    s->n = n;
    s->coupled = coupled;
    s->J = calloc(6 * square + 11 * n + 6 * coupled + 1, sizeof *s->J);
    s->real_pivots = calloc(3 * coupled + 1, sizeof *s->real_pivots);
    if (s->J == NULL || s->real_pivots == NULL) {
        stiff_free(s);
        return NULL;
    }
    s->pair_pivots = s->real_pivots + coupled;
    s->real = s->J + square;
    s->pair = s->real + square;
    double *rest = s->pair + 4 * square;
    s->start = rest;
    s->x = rest + n;
    rest += 2 * n;
    FOR_EACH(k, STAGES) {
        s->f[k] = rest + 3 * k * n;
        s->z[k] = s->f[k] + n;
        s->column[k] = s->z[k] + n;
    }
    rest += 9 * n;
    FOR_EACH(k, STAGES) s->w[k] = rest + k * coupled;
    s->change = rest + STAGES * coupled;
    return s;
}

void stiff_free(Stiff *s) {
    if (s == NULL) return;
    free(s->J);
    free(s->real_pivots);
    free(s);
}

/* ---- linear equations ---------------------------------------------------------------------------------------- */

/* Factorize a matrix, row after row, into triangles, with the greatest pivot of each column; 0: it is singular. */
static int factorize(size_t n, double *a, size_t pivots[]) {
    FOR_EACH(k, n) {
        size_t pivot = k;
        for (size_t i = k + 1; i < n; i++)
            if (fabs(a[i * n + k]) > fabs(a[pivot * n + k])) pivot = i;
        pivots[k] = pivot;
        if (!(fabs(a[pivot * n + k]) > 0)) return 0; /* NaN, too */
        for (size_t j = 0; j < n && pivot != k; j++) {
            const double entry = a[k * n + j];
            a[k * n + j] = a[pivot * n + j];
            a[pivot * n + j] = entry;
        }
        for (size_t i = k + 1; i < n; i++) {
            const double factor = a[i * n + k] /= a[k * n + k];
            for (size_t j = k + 1; j < n && factor != 0; j++) a[i * n + j] -= factor * a[k * n + j];
        }
    }
    return 1;
}

/* Replace the right-hand side by the solution. */
static void substitute(size_t n, const double *a, const size_t pivots[], double b[]) {
    FOR_EACH(k, n) {
        const double entry = b[pivots[k]];
        b[pivots[k]] = b[k];
        b[k] = entry;
    }
    FOR_EACH(i, n) FOR_EACH(j, i) b[i] -= a[i * n + j] * b[j];
    for (size_t i = n; i-- > 0;) {
        for (size_t j = i + 1; j < n; j++) b[i] -= a[i * n + j] * b[j];
        b[i] /= a[i * n + i];
    }
}

/* Factorize the matrices of the Newton iteration for a step size; 0: one is singular. */
static int prepare(Stiff *s, double h) {
    const size_t n = s->coupled;
    FOR_EACH(i, n) FOR_EACH(j, n) {
        const double slope = s->J[i * n + j], identity = i == j;
        s->real[i * n + j] = REAL / h * identity - slope;
        s->pair[i * 2 * n + j] = s->pair[(n + i) * 2 * n + n + j] = ALPHA / h * identity - slope;
        s->pair[i * 2 * n + n + j] = BETA / h * identity;
        s->pair[(n + i) * 2 * n + j] = -BETA / h * identity;
    }
    s->factorized = factorize(n, s->real, s->real_pivots) && factorize(2 * n, s->pair, s->pair_pivots) ? h : 0;
    return s->factorized > 0;
}

/* ---- a step -------------------------------------------------------------------------------------------------- */

typedef struct { /* what a step is of */
    const Problem *problem;
    Stiff *s;
    double t;
    const double *y;
} Origin;

typedef enum { CONVERGED, DIVERGED, REFUSED } Newton;

/* Largest of n numbers, in units of what may be the error of the state; NaN stays. */
static double norm(const Origin *o, const double *v, size_t n) {
    double largest = 0;
    FOR_EACH(i, n) {
        const double size = fabs(v[i]) / (o->s->tolerance * (o->problem->size[i] + fabs(o->y[i])));
        if (size > largest || isnan(size)) largest = size;
    }
    return largest;
}

static void combine(const double matrix[STAGES][STAGES], double *const from[], double *const to[], size_t first,
                    size_t end) {
    FOR_EACH(k, STAGES) for (size_t i = first; i < end; i++)
        to[k][i] = matrix[k][0] * from[0][i] + matrix[k][1] * from[1][i] + matrix[k][2] * from[2][i];
}

/* Rates at the stages, of all states or of the coupled ones. */
static Signal stage_rates(const Origin *o, double h, Rates *rates) {
    const Stiff *s = o->s;
    FOR_EACH(k, STAGES) {
        memcpy(s->x, o->y, s->n * sizeof *s->x);
        FOR_EACH(i, s->coupled) s->x[i] += s->z[k][i];
        if (rates(o->problem->context, o->t + NODES[k] * h, s->x, s->f[k]) == STOP) return STOP;
    }
    return GO_ON;
}

/* Change the increments at the stages by simplified Newton iterations until they satisfy the equations of the method. */
static Newton iterate(const Origin *o, double h) {
    Stiff *s = o->s;
    const size_t n = s->coupled;
    const double enough = fmax(10 * DBL_EPSILON / s->tolerance, fmin(0.03, sqrt(s->tolerance)));
    double before = 0, *const change[] = {s->change, s->change + n, s->change + 2 * n};
    combine(FROM, s->z, s->w, 0, n);
    s->contraction = 0;
    for (s->iterations = 1; s->iterations <= MOST_ITERATIONS; s->iterations++) {
        if (stage_rates(o, h, o->problem->coupled_rates) == STOP) return REFUSED;
        combine(FROM, s->f, change, 0, n);
        FOR_EACH(i, n) {
            change[0][i] -= REAL / h * s->w[0][i];
            change[1][i] -= (ALPHA * s->w[1][i] + BETA * s->w[2][i]) / h;
            change[2][i] -= (ALPHA * s->w[2][i] - BETA * s->w[1][i]) / h;
        }
        substitute(n, s->real, s->real_pivots, change[0]);
        substitute(2 * n, s->pair, s->pair_pivots, change[1]);
        double size = 0;
        FOR_EACH(k, STAGES) {
            const double part = norm(o, change[k], n);
            if (part > size || isnan(part)) size = part;
            FOR_EACH(i, n) s->w[k][i] += change[k][i];
        }
        combine(TO, s->w, s->z, 0, n);
        if (!isfinite(size)) return DIVERGED;
        if (size == 0) return CONVERGED;
        if (s->iterations > 1) {
            s->contraction = size / before;
            const int rounding = s->contraction >= 1 && size < enough; /* it falls no more */
            if (rounding || (s->contraction < 1 && s->contraction / (1 - s->contraction) * size < enough))
                return CONVERGED;
            double left = size / (1 - s->contraction); /* after the iterations that remain */
            for (int i = s->iterations; i < MOST_ITERATIONS; i++) left *= s->contraction;
            if (s->contraction >= 1 || left > enough) return DIVERGED;
        }
        before = size;
    }
    return DIVERGED;
}

/* The increments of the states that are integrals along the motion, from their rates at the stages. */
static Signal integrate(const Origin *o, double h) {
    const Stiff *s = o->s;
    if (s->coupled == s->n) return GO_ON;
    if (stage_rates(o, h, o->problem->rates) == STOP) return STOP;
    combine(WEIGHTS, s->f, s->z, s->coupled, s->n);
    FOR_EACH(k, STAGES) for (size_t i = s->coupled; i < s->n; i++) s->z[k][i] *= h;
    return GO_ON;
}

/* The estimated error of a step in units of what is allowed; `careful`: also of what is stiff (IV.8.20). */
static Signal estimate(const Origin *o, double h, int careful, double *error) {
    const Stiff *s = o->s;
    double *e = s->change, *x = s->x;
    FOR_EACH(i, s->coupled) {
        s->w[0][i] = (ERROR[0] * s->z[0][i] + ERROR[1] * s->z[1][i] + ERROR[2] * s->z[2][i]) / h;
        e[i] = s->start[i] + s->w[0][i];
    }
    substitute(s->coupled, s->real, s->real_pivots, e);
    *error = norm(o, e, s->coupled);
    if (careful && *error > 1) {
        memcpy(x, o->y, s->n * sizeof *x);
        FOR_EACH(i, s->coupled) x[i] += e[i];
        if (o->problem->coupled_rates(o->problem->context, o->t, x, e) == STOP) return STOP;
        FOR_EACH(i, s->coupled) e[i] += s->w[0][i];
        substitute(s->coupled, s->real, s->real_pivots, e);
        *error = norm(o, e, s->coupled);
    }
    for (size_t i = s->coupled; i < s->n; i++) {
        const double add = h * s->start[i] + ERROR[0] * s->z[0][i] + ERROR[1] * s->z[1][i] + ERROR[2] * s->z[2][i];
        const double size = fabs(add) / (REAL * s->tolerance * (o->problem->size[i] + fabs(o->y[i])));
        if (size > *error || isnan(size)) *error = size;
    }
    return GO_ON;
}

/* The polynomial of the step through its increments, in the columns that events.c evaluates. */
static void fit_polynomial(const Stiff *s) {
    FOR_EACH(i, s->n) {
        const double end = s->z[2][i], c1 = NODES[0], c2 = NODES[1];
        const double one = (s->z[0][i] - c1 * end) / (c1 * (1 - c1)), two = (s->z[1][i] - c2 * end) / (c2 * (1 - c2));
        s->column[0][i] = end;
        s->column[2][i] = (two - one) / (c2 - c1);
        s->column[1][i] = one - c1 * s->column[2][i];
    }
}

/* Guess the increments from the polynomial of the last step, which was `ratio` times as short. */
static void guess(const Stiff *s, double ratio) {
    FOR_EACH(k, STAGES) FOR_EACH(i, s->coupled) {
        const double x = 1 + NODES[k] * ratio;
        s->z[k][i] = (x - 1) * s->column[0][i] + x * (1 - x) * (s->column[1][i] + x * s->column[2][i]);
    }
}

/* Repeat the step with another size: the state at its end. */
static Signal repeat(void *method, double h, double end[]) {
    const Origin *o = method;
    Stiff *s = o->s;
    FOR_EACH(k, STAGES) FOR_EACH(i, s->coupled) { /* from the polynomial of the longer step, whose end is column[0] */
        const double x = NODES[k] * h / s->factorized;
        s->z[k][i] = x * (s->column[0][i] + (1 - x) * (s->column[1][i] + x * s->column[2][i]));
    }
    const double whole = s->factorized;
    const int solved = prepare(s, h) && iterate(o, h) == CONVERGED && integrate(o, h) == GO_ON;
    s->factorized = whole; /* of the polynomial; the matrices are made anew afterwards */
    FOR_EACH(i, s->n) end[i] = o->y[i] + s->z[2][i];
    return solved ? GO_ON : STOP;
}

/* Shorten the step to the first event in it. */
static Signal shorten(Origin *o, double *h, double *work, int *crossed) {
    const Stiff *s = o->s;
    double *columns = events_columns(o->problem, work);
    FOR_EACH(k, STAGES) memcpy(columns + k * s->n, s->column[k], s->n * sizeof *columns);
    memset(columns + STAGES * s->n, 0, (EVENT_DEGREE - STAGES) * s->n * sizeof *columns);
    return events_locate(o->problem, o->t, h, o->y, work, repeat, o, crossed);
}

/* ---- many steps ---------------------------------------------------------------------------------------------- */

/* Of errors that the estimate, of order 3, may have where those of the solution, of order 5, are to be within a
 * tolerance: a tenth of its power 2/3, by arithmetic that is alike on every machine. */
static double tolerance_of_estimate(double tolerance) {
    double root = 0.01;
    for (int i = 0; i < 60; i++) root -= (root - tolerance / (root * root)) / 3;
    return 0.1 * root * root;
}

static double first_step(const Origin *o, double span) {
    const double state = norm(o, o->y, o->s->coupled), rate = norm(o, o->s->start, o->s->coupled);
    return rate > 0 && isfinite(rate) ? fmin(span, fmax(1e-2 * state, 1) / rate) : span;
}

Outcome stiff_advance(const Problem *p, Jacobian *jacobian, Stiff *s, double *t, double end, double y[], double low[],
                      double *step, double work[]) {
    const double smallest = SMALLEST * (end - *t);
    double size_before = 0, error_before = 1;
    int exact = 0, rejected = 1, guessed = 0; /* the Jacobian is that of the present state; the last step was rejected */
    Pace pace = {0, 0, *t};

    if (s->tolerance_of != p->tolerance) s->tolerance = tolerance_of_estimate(s->tolerance_of = p->tolerance);
    s->factorized = 0;
    for (int has_jacobian = 0; *t < end;) {
        Origin origin = {p, s, *t, y};
        int crossed = 0;
        if (p->rates(p->context, *t, y, s->start) == STOP) return STOPPED;
        if (*step <= 0) *step = first_step(&origin, end - *t);
        for (;;) { /* until a step is accepted */
            if (solver_is_exhausted(&pace, *t, end)) return EXHAUSTED;
            const double left = end - *t;
            const int last = 1.01 * *step >= left;
            double h = last ? left : fmin(*step, left / 2), error = 0; /* two equal steps rather than a tiny last one */
            if (h < smallest) return STUCK;
            if (!has_jacobian) {
                if (jacobian(p->context, *t, y, s->J) == STOP) return STOPPED;
                has_jacobian = exact = 1;
                s->factorized = 0;
            }
            if (guessed) guess(s, h / size_before);
            else FOR_EACH(k, STAGES) memset(s->z[k], 0, s->n * sizeof *s->z[k]);
            Newton newton = h != s->factorized && !prepare(s, h) ? DIVERGED : iterate(&origin, h);
            if (newton == REFUSED) return STOPPED;
            if (newton == DIVERGED) {
                if (exact) *step = h / 2;
                has_jacobian = exact;
                guessed = 0;
                continue;
            }
            if (integrate(&origin, h) == STOP || estimate(&origin, h, rejected, &error) == STOP) return STOPPED;
            const double safety = SAFETY * (2 * MOST_ITERATIONS + 1) / (2 * MOST_ITERATIONS + s->iterations);
            double factor = isfinite(error) ? safety / sqrt(sqrt(fmax(error, 1e-12))) : SHRINK;
            if (!(error <= 1)) {
                *step = h * fmin(fmax(factor, SHRINK), 0.9);
                rejected = 1;
                continue;
            }
            if (size_before > 0) /* Gustafsson */
                factor *= fmin(1, h / size_before * sqrt(sqrt(error_before / fmax(error, 1e-12))));
            fit_polynomial(s);
            const double whole = h;
            if (p->events != NULL && shorten(&origin, &h, work, &crossed) == STOP) return STOPPED;
            const int slow = s->iterations > 2 && s->contraction > FAST;
            factor = fmin(fmax(factor, SHRINK), rejected ? fmin(GROW, 1) : GROW);
            if (!slow && factor >= 1 && factor < KEEP) factor = 1;
            if (!(last && factor * h < *step)) *step = factor * whole;
            has_jacobian = !slow && !crossed;
            size_before = whole;
            error_before = fmax(error, 1e-2);
            guessed = !crossed;
            rejected = exact = 0;
            *t = last && !crossed ? end : *t + h;
            FOR_EACH(i, s->n) { /* y + low += increment; what y cannot hold goes to low (Moller, Knuth) */
                const double add = s->z[2][i] + low[i], next = y[i] + add, part = next - y[i];
                low[i] = (y[i] - (next - part)) + (add - part);
                y[i] = next;
            }
            break;
        }
        if (p->accept(p->context, *t, y) == STOP) return STOPPED;
        if (crossed) return CROSSED;
    }
    return REACHED;
}

/* Collocation at Gauss's three points, of order 6: Hairer, Lubich, Wanner, Geometric Numerical Integration, Springer
 * 2006, II.1.3; its stages by fixed-point iteration as in Antonana, Makazaga, Murua, Numer. Algorithms 76, 2017, 861. */
#include "symplectic.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* With increments L_i = h b_i f(Y_i) the stages are Y_i = y + sum_j mu_ij L_j, and the method is symplectic if
 * mu_ij + mu_ji = 1 (Antonana, Makazaga, Murua, Numer. Algorithms 76, 2017, 861).  Written as half the sum of all L
 * and an antisymmetric rest, this holds whatever the rounding of these numbers: 3 sqrt(15)/20 and 3 sqrt(15)/25. */
static const double ALPHA = 0.5809475019311126, BETA = 0.46475800154489005;

enum { STAGES = 3, MOST_SWEEPS = 100 };

static const double NODES[STAGES] = {0.1127016653792583, 0.5, 0.8872983346207417};

/* The polynomial through the rates at the stages of the last two steps, at those of the next one. */
static const double EXTRAPOLATION[STAGES][HISTORY] = {
    {13.174733281837, -6.987361796661511, 3.2788486146019302, -0.36953169939211145, 2.6546560354764153,
     -10.751344435861721},
    {113.86995294299518, -51.333333333333336, 14.46338039033815, -3.712035954476428, 25.666666666666668,
     -97.95463071219024},
    {443.5838964834373, -184.38518722294634, 44.158600051496336, -15.915322230804945, 107.14926553315104,
     -393.59125261433337},
};

/* Sweeps end when what the next but one would change in the stages, and the next one in the step, is only this part of
 * a state.  Far below a rounding error, since what is left has the same sign in each step and adds up: with 2^-10 of
 * one, a pendulum of 2.5 rad lost 3e-12 J in 1e6 steps of 10 ms. */
static const double NOTHING = DBL_EPSILON / 1073741824;
/* Above this part of a state changes that do not fall are no rounding errors. */
static const double SMALL = 1e-12;

#define FOR_EACH(i, n) for (size_t i = 0; i < (n); i++)

/* The larger of two numbers; unlike fmax without a call. */
static double larger(double a, double b) { return a > b ? a : b; }

typedef struct {
    double *rates[STAGES], *stages[STAGES], *least; /* change of a sweep so far */
} Work;

/* Distribute work space. */
static Work share(double *work, size_t n) {
    Work w;
    FOR_EACH(s, STAGES) {
        w.rates[s] = work + s * n;
        w.stages[s] = work + (STAGES + s) * n;
    }
    w.least = work + 2 * STAGES * n;
    return w;
}

/* Fill the history with the rates at the present state, as if they had been the same for long. */
static Signal forget(const Problem *p, double t, const double *y, double *history) {
    const size_t size = p->coupled * sizeof *history;
    if (p->coupled_rates(p->context, t, y, history) == STOP) return STOP;
    for (int i = 1; i < HISTORY; i++) memcpy(history + (size_t)i * p->coupled, history, size);
    return GO_ON;
}

/* Extrapolate the rates at the stages from the history. */
static void guess(const Problem *p, const double *history, const Work *w) {
    const size_t n = p->coupled;
    FOR_EACH(s, STAGES) FOR_EACH(i, n) {
        const double *a = EXTRAPOLATION[s], *f = history + i;
        w->rates[s][i] = a[0] * f[0] + a[1] * f[n] + a[2] * f[2 * n] + a[3] * f[3 * n] + a[4] * f[4 * n]
                         + a[5] * f[5 * n];
    }
}

/* Move the rates at the stages of a step into the history. */
static void keep(const Problem *p, const Work *w, double *history) {
    const size_t n = p->coupled;
    FOR_EACH(s, STAGES) FOR_EACH(i, n) {
        double *last = &history[s * n + i];
        last[STAGES * n] = *last;
        *last = w->rates[s][i];
    }
}

/* The stages from their rates.  Returns whether they have converged: each state stays, or changes by rounding errors
 * that have stopped falling, or its changes fall so fast that the next one is nothing. */
static int sweep(const Problem *p, const double h_b[], const double *y, const double *low, const Work *w, int count) {
    double *const x1 = w->stages[0], *const x2 = w->stages[1], *const x3 = w->stages[2];
    int converged = count > 1; /* the first change is one from nothing, the second has none to compare with */
    FOR_EACH(i, p->coupled) {
        const double l1 = h_b[0] * w->rates[0][i], l2 = h_b[1] * w->rates[1][i], l3 = h_b[0] * w->rates[2][i];
        const double middle = low[i] + 0.5 * ((l1 + l3) + l2);
        const double y1 = y[i] + (middle - (ALPHA * l2 + BETA * l3));
        const double y2 = y[i] + (middle + ALPHA * (l1 - l3));
        const double y3 = y[i] + (middle + (ALPHA * l2 + BETA * l1));
        const double change = larger(larger(fabs(y1 - x1[i]), fabs(y2 - x2[i])), fabs(y3 - x3[i]));
        const double least = count > 1 ? w->least[i] : INFINITY, size = fabs(y[i]);
        const int rounding = change >= least && change <= SMALL * (p->size[i] + size);
        converged &= change == 0 || rounding || change * change * change <= NOTHING * size * least * least;
        w->least[i] = rounding ? 0 : change < least ? change : least; /* 0: from now on it is rounding */
        x1[i] = y1;
        x2[i] = y2;
        x3[i] = y3;
    }
    return converged;
}

/* The rates at the stages of a step, from a guess of them. */
static Outcome solve(const Problem *p, double t, double h, const double h_b[], const double *y, const double *low,
                     const Work *w) {
    int converged = 0;
    for (int sweeps = 0; sweeps < MOST_SWEEPS && !converged; sweeps++) {
        converged = sweep(p, h_b, y, low, w, sweeps);
        Rates *const rates = converged ? p->rates : p->coupled_rates;
        FOR_EACH(s, STAGES)
            if (rates(p->context, t + NODES[s] * h, w->stages[s], w->rates[s]) == STOP) return STOPPED;
    }
    return converged ? REACHED : STUCK;
}

/* Gauss's five points and their weights: exact up to degree 9. */
enum { FINE = 5 };
static const double FINE_NODES[FINE] = {0.04691007703066802, 0.23076534494715845, 0.5, 0.7692346550528415,
                                        0.953089922969332};
static const double FINE_WEIGHTS[FINE] = {0.11846344252809454, 0.23931433524968324, 0.28444444444444444,
                                          0.23931433524968324, 0.11846344252809454};

/* Integral from 0 to x of Lagrange's polynomial that is 1 at one of the nodes. */
static double weight(size_t s, double x) {
    const double c = NODES[s], a = NODES[(s + 1) % STAGES], b = NODES[(s + 2) % STAGES];
    return x * (a * b - x * ((a + b) / 2 - x / 3)) / ((c - a) * (c - b));
}

/* Recalculate the rates of the states that do not act on the motion, by five points on the polynomial of the stages: of
 * each the mean, three times. */
static Signal refine(const Problem *p, double t, double h, const double *y, const Work *w) {
    double *x = w->stages[0], *rates = w->stages[1], *mean = w->stages[2];
    for (size_t i = p->coupled; i < p->n; i++) mean[i] = 0;
    FOR_EACH(k, FINE) {
        const double at = FINE_NODES[k], b1 = weight(0, at), b2 = weight(1, at), b3 = weight(2, at);
        FOR_EACH(i, p->coupled) x[i] = y[i] + h * (b1 * w->rates[0][i] + b2 * w->rates[1][i] + b3 * w->rates[2][i]);
        if (p->rates(p->context, t + at * h, x, rates) == STOP) return STOP;
        for (size_t i = p->coupled; i < p->n; i++) mean[i] += FINE_WEIGHTS[k] * rates[i];
    }
    FOR_EACH(s, STAGES) for (size_t i = p->coupled; i < p->n; i++) w->rates[s][i] = mean[i];
    return GO_ON;
}

Outcome symplectic_advance(const Problem *p, Rough *rough, double *t, double end, double step, double y[], double low[],
                           double history[], int32_t *known, double work[]) {
    const size_t n = p->n;
    const double start = *t, count = fmax(ceil((end - start) / step * (1 - 1e-12)), 1), h = (end - start) / count;
    const double outer = h * (5.0 / 18.0), h_b[] = {outer, h - 2 * outer};
    const Work w = share(work, n);

    FOR_EACH(s, STAGES) memcpy(w.stages[s], y, n * sizeof *y); /* of which only the coupled states matter */
    for (double steps = 1; steps <= count; steps++) {
        for (Outcome outcome = STUCK; outcome != REACHED;) {
            const int guessed = *known;
            if (!guessed && forget(p, *t, y, history) == STOP) return STOPPED;
            guess(p, history, &w);
            outcome = solve(p, *t, h, h_b, y, low, &w);
            if (outcome != REACHED && !guessed) return outcome;
            *known = outcome == REACHED; /* if not, once more: the history may have led astray */
        }
        if (rough != NULL && rough(p->context, *t, h) && refine(p, *t, h, y, &w) == STOP) return STOPPED;
        FOR_EACH(i, n) { /* y + low += sum of L; what y cannot hold goes to low (Moller, Knuth) */
            const double add = ((h_b[0] * (w.rates[0][i] + w.rates[2][i])) + h_b[1] * w.rates[1][i]) + low[i];
            const double next = y[i] + add, part = next - y[i];
            low[i] = (y[i] - (next - part)) + (add - part);
            y[i] = next;
        }
        keep(p, &w, history);
        *t = steps == count ? end : start + steps * h;
        if (p->accept(p->context, *t, y) == STOP) return STOPPED;
    }
    return REACHED;
}

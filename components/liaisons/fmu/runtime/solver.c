/* DOP853: the explicit Runge-Kutta method of order 8 of Dormand and Prince in 12 stages, with error estimates of order 5
 * and 3 and the control of the step size by Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, 2nd
 * edition, Springer 1993, II.4, II.5 and II.10; their coefficients, in double precision. */
#include "solver.h"

#include <math.h>
#include <string.h>

/* The coefficients; those that are missing are 0.  c: stages, a: their weights, b: order 8, bhh: order 3,
 * e: difference of b to order 5. */
static const double
    c_2 = 0.05260015195876773, c_3 = 0.0789002279381516, c_4 = 0.1183503419072274, c_5 = 0.2816496580927726,
    c_6 = 0.3333333333333333, c_7 = 0.25, c_8 = 0.3076923076923077, c_9 = 0.6512820512820513, c_10 = 0.6,
    c_11 = 0.8571428571428571, c_12 = 1.0;
static const double
    a_2_1 = 0.05260015195876773;
static const double
    a_3_1 = 0.0197250569845379, a_3_2 = 0.0591751709536137;
static const double
    a_4_1 = 0.02958758547680685, a_4_3 = 0.08876275643042054;
static const double
    a_5_1 = 0.2413651341592667, a_5_3 = -0.8845494793282861, a_5_4 = 0.924834003261792;
static const double
    a_6_1 = 0.037037037037037035, a_6_4 = 0.17082860872947386, a_6_5 = 0.12546768756682242;
static const double
    a_7_1 = 0.037109375, a_7_4 = 0.17025221101954405, a_7_5 = 0.06021653898045596, a_7_6 = -0.017578125;
static const double
    a_8_1 = 0.03709200011850479, a_8_4 = 0.17038392571223998, a_8_5 = 0.10726203044637328,
    a_8_6 = -0.015319437748624402, a_8_7 = 0.008273789163814023;
static const double
    a_9_1 = 0.6241109587160757, a_9_4 = -3.3608926294469414, a_9_5 = -0.868219346841726, a_9_6 = 27.59209969944671,
    a_9_7 = 20.154067550477894, a_9_8 = -43.48988418106996;
static const double
    a_10_1 = 0.47766253643826434, a_10_4 = -2.4881146199716677, a_10_5 = -0.590290826836843,
    a_10_6 = 21.230051448181193, a_10_7 = 15.279233632882423, a_10_8 = -33.28821096898486,
    a_10_9 = -0.020331201708508627;
static const double
    a_11_1 = -0.9371424300859873, a_11_4 = 5.186372428844064, a_11_5 = 1.0914373489967295,
    a_11_6 = -8.149787010746927, a_11_7 = -18.52006565999696, a_11_8 = 22.739487099350505,
    a_11_9 = 2.4936055526796523, a_11_10 = -3.0467644718982196;
static const double
    a_12_1 = 2.273310147516538, a_12_4 = -10.53449546673725, a_12_5 = -2.0008720582248625,
    a_12_6 = -17.9589318631188, a_12_7 = 27.94888452941996, a_12_8 = -2.8589982771350235,
    a_12_9 = -8.87285693353063, a_12_10 = 12.360567175794303, a_12_11 = 0.6433927460157636;
static const double
    b_1 = 0.054293734116568765, b_6 = 4.450312892752409, b_7 = 1.8915178993145003, b_8 = -5.801203960010585,
    b_9 = 0.3111643669578199, b_10 = -0.1521609496625161, b_11 = 0.20136540080403034, b_12 = 0.04471061572777259;
static const double
    bhh_1 = 0.2440944881889764, bhh_9 = 0.7338466882816118, bhh_12 = 0.022058823529411766;
static const double
    e_1 = 0.01312004499419488, e_6 = -1.2251564463762044, e_7 = -0.4957589496572502, e_8 = 1.6643771824549864,
    e_9 = -0.35032884874997366, e_10 = 0.3341791187130175, e_11 = 0.08192320648511571, e_12 = -0.022355307863886294;

/* Step sizes change by these factors at most; SAFETY keeps most steps from being rejected. */
static const double SHRINK = 0.2, GROW = 6.0, SAFETY = 0.85;
/* A step h is at the limit of stability if h times the Lipschitz constant is greater than LIMIT; it is looked at behind
 * MANY steps, and said behind so many IN_SUCCESSION (Hairer, Norsett, Wanner, II.10: DOP853, its test for stiffness). */
static const double LIMIT = 6.1;
enum { MANY = 200, IN_SUCCESSION = 15 };

#define FOR_EACH(i) for (size_t i = 0; i < n; i++)

/* The rates k_s.  What the stage before found comes last in the sum: the next one waits for as little as may be. */
#define STAGE(s, rates, earlier, before)                                                                     \
    for (size_t i = 0; i < p->coupled; i++) x[i] = (y[i] + h * (earlier)) + (h * a_##s##_##before) * k##before[i]; \
    if (p->rates(p->context, t + c_##s * h, x, k##s) == STOP) return STOP

/* Calculate the twelve stages and the weighted sum of a step, and its error in units of what is allowed. */
#ifdef __GNUC__
__attribute__((always_inline)) /* a call costs 3 % of a step */
#endif
static inline Signal stages(const Problem *p, double t, double h, const double *y, double *work, double *error) {
    const size_t n = p->n;
    double *k1 = work, *k2 = k1 + n, *k3 = k2 + n, *k4 = k3 + n, *k5 = k4 + n, *k6 = k5 + n, *k7 = k6 + n,
           *k8 = k7 + n, *k9 = k8 + n, *k10 = k9 + n, *k11 = k10 + n, *k12 = k11 + n, *x = k12 + n, *sum = x + n;

    memcpy(x, y, n * sizeof *x);
    /* The first stages have no weight in the sums at the end. */
    STAGE(2, coupled_rates, 0, 1);
    STAGE(3, coupled_rates, a_3_1 * k1[i], 2);
    STAGE(4, coupled_rates, a_4_1 * k1[i], 3);
    STAGE(5, coupled_rates, a_5_1 * k1[i] + a_5_3 * k3[i], 4);
    STAGE(6, rates, a_6_1 * k1[i] + a_6_4 * k4[i], 5);
    STAGE(7, rates, a_7_1 * k1[i] + a_7_4 * k4[i] + a_7_5 * k5[i], 6);
    STAGE(8, rates, a_8_1 * k1[i] + a_8_4 * k4[i] + a_8_5 * k5[i] + a_8_6 * k6[i], 7);
    STAGE(9, rates, a_9_1 * k1[i] + a_9_4 * k4[i] + a_9_5 * k5[i] + a_9_6 * k6[i] + a_9_7 * k7[i], 8);
    STAGE(10, rates, a_10_1 * k1[i] + a_10_4 * k4[i] + a_10_5 * k5[i] + a_10_6 * k6[i] + a_10_7 * k7[i]
              + a_10_8 * k8[i], 9);
    STAGE(11, rates, a_11_1 * k1[i] + a_11_4 * k4[i] + a_11_5 * k5[i] + a_11_6 * k6[i] + a_11_7 * k7[i] + a_11_8 * k8[i]
              + a_11_9 * k9[i], 10);
    STAGE(12, rates, a_12_1 * k1[i] + a_12_4 * k4[i] + a_12_5 * k5[i] + a_12_6 * k6[i] + a_12_7 * k7[i] + a_12_8 * k8[i]
              + a_12_9 * k9[i] + a_12_10 * k10[i], 11);

    double fifth = 0, third = 0;
    FOR_EACH(i) {
        sum[i] = b_1 * k1[i] + b_6 * k6[i] + b_7 * k7[i] + b_8 * k8[i] + b_9 * k9[i] + b_10 * k10[i] + b_11 * k11[i]
                 + b_12 * k12[i];
        const double e5 = e_1 * k1[i] + e_6 * k6[i] + e_7 * k7[i] + e_8 * k8[i] + e_9 * k9[i] + e_10 * k10[i]
                          + e_11 * k11[i] + e_12 * k12[i];
        const double e3 = sum[i] - bhh_1 * k1[i] - bhh_9 * k9[i] - bhh_12 * k12[i];
        const double before = fabs(y[i]), after = fabs(y[i] + h * sum[i]);
        const double scale = 1 / (p->tolerance * (p->size[i] + (after > before ? after : before)));
        const double ratio5 = fabs(e5) * scale, ratio3 = fabs(e3) * scale;
        if (ratio5 > fifth || isnan(ratio5)) fifth = ratio5; /* NaN stays */
        if (ratio3 > third || isnan(ratio3)) third = ratio3;
    }
    /* Of order 8 in h, although the differences are of order 6 and 4 (Hairer, Norsett, Wanner, II.10):
     * h fifth^2 / sqrt(fifth^2 + 0.01 third^2), whose squares would underflow at a wave front with states of 1e-170. */
    const double ratio = 0.1 * third / fifth;
    *error = fifth == 0 ? 0 : h * fifth / sqrt(1 + ratio * ratio);
    return GO_ON;
}

Signal solver_stages(const Problem *p, double t, double h, const double y[], double work[], double *error) {
    return stages(p, t, h, y, work, error);
}

/* Factor by which the step size may change after an error of order 8. */
static double growth(double error) {
    if (!isfinite(error)) return SHRINK;
    const double factor = SAFETY / sqrt(sqrt(sqrt(error))); /* unlike pow, the same on every machine */
    return factor < SHRINK ? SHRINK : factor > GROW ? GROW : factor;
}

/* Largest of the components in units of what the tolerance allows. */
static double norm(const Problem *p, const double *v, const double *y) {
    double largest = 0;
    for (size_t i = 0; i < p->n; i++)
        largest = fmax(largest, fabs(v[i]) / (p->tolerance * (p->size[i] + fabs(y[i]))));
    return largest;
}

/* First step size, from the sizes of y, f and df/dt (Hairer, Norsett, Wanner, II.4); work begins with f. */
static double first_step(const Problem *p, double t, double span, const double *y, double *work) {
    const size_t n = p->n;
    double *f = work, *f1 = work + n, *x = work + 2 * n;
    const double y_size = norm(p, y, y), f_size = norm(p, f, y);
    double trial = y_size < 1e-5 || f_size < 1e-5 ? 1e-6 : 0.01 * y_size / f_size;
    trial = fmin(trial, span);
    FOR_EACH(i) x[i] = y[i] + trial * f[i];
    if (p->rates(p->context, t + trial, x, f1) == STOP) return trial;
    FOR_EACH(i) f1[i] -= f[i];
    const double largest = fmax(f_size, norm(p, f1, y) / trial);
    const double step = largest <= 1e-15 ? fmax(1e-6, trial * 1e-3) : sqrt(sqrt(sqrt(0.01 / largest)));
    return isfinite(step) && step > 0 ? fmin(fmin(100 * trial, step), span) : trial;
}

/* Whether a step that led to y, where the rates are in the first column of work, was at the limit of stability. */
static int is_at_limit(const Problem *p, double h, const double *y, const double *work) {
    const double *rates = work, *last = work + 11 * p->n, *x = work + 12 * p->n;
    double change = 0, distance = 0;
    for (size_t i = 0; i < p->coupled; i++) {
        change += (rates[i] - last[i]) * (rates[i] - last[i]) / (p->size[i] * p->size[i]);
        distance += (y[i] - x[i]) * (y[i] - x[i]) / (p->size[i] * p->size[i]);
    }
    return h * h * change > LIMIT * LIMIT * distance;
}

int solver_is_exhausted(Pace *pace, double t, double end) {
    const long steps = pace->steps++, since = steps - pace->last;
    if (steps == MOST_STEPS) return 1;
    if (since < FEW_STEPS || since < pace->last) return 0;
    const double reached = (t - pace->passed) / (double)since * (double)(MOST_STEPS - steps);
    pace->last = steps;
    pace->passed = t;
    return reached < end - t;
}

Outcome solver_advance(const Problem *p, double *t, double end, double y[], double low[], double *step,
                       double work[]) {
    const size_t n = p->n;
    const double smallest = SMALLEST * (end - *t);
    const double *sum = work + (SOLVER_COLUMNS - 1) * n;
    double error, largest_growth = GROW, before = 0;
    int limited = 0;
    Pace pace = {0, 0, *t};

    while (*t < end) {
        int crossed = 0;
        if (p->rates(p->context, *t, y, work) == STOP) return STOPPED;
        if (pace.steps > MANY && p->report_stiffness != NULL) {
            limited = is_at_limit(p, before, y, work) ? limited + 1 : 0;
            if (limited == IN_SUCCESSION) p->report_stiffness(p->context, *t);
        }
        if (*step <= 0) *step = first_step(p, *t, end - *t, y, work);
        for (;;) { /* until a step is accepted */
            if (solver_is_exhausted(&pace, *t, end)) return EXHAUSTED;
            const double left = end - *t;
            const int last = 1.01 * *step >= left;
            double h = last ? left : fmin(*step, left / 2); /* two equal steps rather than a tiny last one */
            if (stages(p, *t, h, y, work, &error) == STOP) return STOPPED;
            if (error <= 1) {
                if (p->events != NULL && p->events->shorten(p, *t, &h, y, work, &crossed) == STOP) return STOPPED;
                const double factor = fmin(growth(error), largest_growth);
                if (!crossed) /* a cut step tells little */
                    *step = h < *step && factor == GROW ? fmax(*step, GROW * h) : factor * h;
                *t = last && !crossed ? end : *t + h;
                before = h;
                FOR_EACH(i) { /* y + low += h * sum; what y cannot hold goes to low (Moller, Knuth) */
                    const double add = h * sum[i] + low[i], next = y[i] + add, part = next - y[i];
                    low[i] = (y[i] - (next - part)) + (add - part);
                    y[i] = next;
                }
                largest_growth = GROW;
                break;
            }
            *step = h * fmin(growth(error), 1);
            largest_growth = 1; /* right after a rejection */
            if (*step < smallest) return STUCK;
        }
        if (p->accept(p->context, *t, y) == STOP) return STOPPED;
        if (crossed) return CROSSED;
    }
    return REACHED;
}

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
/* A step below this fraction of the interval gets nowhere. */
static const double SMALLEST = 1e-13;

#define FOR_EACH(i) for (size_t i = 0; i < n; i++)

/* The rates k_s.  What the stage before found comes last in the sum: the next one waits for as little as may be. */
#define STAGE(s, rates, earlier, before)                                                                     \
    for (size_t i = 0; i < p->coupled; i++) x[i] = (y[i] + h * (earlier)) + (h * a_##s##_##before) * k##before[i]; \
    if (p->rates(p->context, t + c_##s * h, x, k##s) == STOP) return STOP

/* All stages but the first, which is in k1 already; then sum = the increment of order 8 divided by h, and
 * *error = the estimated error of the step in units of what is allowed. */
static Signal stages(const Problem *p, double t, double h, const double *y, double *work, double *error) {
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

/* factor by which an error of order 8 says that the step may change */
static double growth(double error) {
    if (!isfinite(error)) return SHRINK;
    const double factor = SAFETY / sqrt(sqrt(sqrt(error))); /* unlike pow, the same on every machine */
    return factor < SHRINK ? SHRINK : factor > GROW ? GROW : factor;
}

static double norm(const Problem *p, const double *v, const double *y) {
    double largest = 0;
    for (size_t i = 0; i < p->n; i++)
        largest = fmax(largest, fabs(v[i]) / (p->tolerance * (p->size[i] + fabs(y[i]))));
    return largest;
}

/* A first step from the sizes of y, f and df/dt (Hairer, Norsett, Wanner, II.4); f is in the first column of work. */
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

int solver_is_exhausted(Pace *pace, double t, double end) {
    const long steps = pace->steps++, since = steps - pace->last;
    if (steps == MOST_STEPS) return 1;
    if (since < FEW_STEPS || since < pace->last) return 0;
    const double reached = (t - pace->passed) / (double)since * (double)(MOST_STEPS - steps);
    pace->last = steps;
    pace->passed = t;
    return reached < end - t;
}

#ifdef UNILATERAL
/* ---- events, on the dense output of order 7 (II.6) ---- */

enum { EXTRA = 3, DENSE = 7, MOST_INDICATORS = 16, DEEPEST = 12, MOST_TRIALS = 60, MOST_CORRECTIONS = 4 };

/* Where an event is an indicator has this value: a gap of 0; what is below is an event, and not by rounding. */
static const double MARGIN = 1e-13;

/* Three more stages, and what the last four polynomials are made of; of k1, ..., k16. */
static const double EXTRA_TIMES[EXTRA] = {0.1, 0.2, 0.7777777777777778};
static const double EXTRA_STAGES[EXTRA][15] = {
    {0.056167502283047954, 0, 0, 0, 0, 0, 0.25350021021662483, -0.2462390374708025, -0.12419142326381637,
       0.15329179827876568, 0.00820105229563469, 0.007567897660545699, -0.008298, 0, 0},
    {0.03183464816350214, 0, 0, 0, 0, 0.028300909672366776, 0.053541988307438566, -0.05492374857139099, 0, 0,
       -0.00010834732869724932, 0.0003825710908356584, -0.00034046500868740456, 0.1413124436746325, 0},
    {-0.42889630158379194, 0, 0, 0, 0, -4.697621415361164, 7.683421196062599, 4.06898981839711, 0.3567271874552811,
       0, 0, 0, -0.0013990241651590145, 2.9475147891527724, -9.15095847217987},
};
static const double SHAPES[4][16] = {
    {-8.428938276109013, 0, 0, 0, 0, 0.5667149535193777, -3.0689499459498917, 2.38466765651207, 2.117034582445028,
       -0.871391583777973, 2.2404374302607883, 0.6315787787694688, -0.08899033645133331, 18.148505520854727,
       -9.194632392478356, -4.436036387594894},
    {10.427508642579134, 0, 0, 0, 0, 242.28349177525817, 165.20045171727028, -374.5467547226902,
       -22.113666853125306, 7.733432668472264, -30.674084731089398, -9.332130526430229, 15.697238121770845,
       -31.139403219565178, -9.35292435884448, 35.81684148639408},
    {19.985053242002433, 0, 0, 0, 0, -387.0373087493518, -189.17813819516758, 527.8081592054236, -11.57390253995963,
       6.8812326946963, -1.0006050966910838, 0.7777137798053443, -2.778205752353508, -60.19669523126412,
       84.32040550667716, 11.99229113618279},
    {-25.69393346270375, 0, 0, 0, 0, -154.18974869023643, -231.5293791760455, 357.6391179106141, 93.40532418362432,
       -37.45832313645163, 104.0996495089623, 29.8402934266605, -43.53345659001114, 96.32455395918828,
       -39.17726167561544, -149.72683625798564},
};

typedef struct { /* a step, and how it is looked at */
    const Problem *p;
    double t, h;
    const double *y, *columns; /* at its start; of the polynomials */
    double *at;                /* states where it is looked at */
} Step;

static double *column(const Problem *p, double *work, size_t i) { return work + i * p->n; }

/* The polynomials of a step of which the stages are there; STOP if the rates say so. */
static Signal polynomials(const Problem *p, double t, double h, const double *y, double *work) {
    enum { K13 = 14, FIRST = K13 + 1 + EXTRA };
    const size_t n = p->n;
    const double *k[16], *sum = work + 13 * n;
    double *x = column(p, work, SOLVER_COLUMNS - 1);
    for (size_t j = 0; j < 16; j++) k[j] = column(p, work, j < 12 ? j : K13 + j - 12);
    FOR_EACH(i) x[i] = y[i] + h * sum[i];
    if (p->rates(p->context, t + h, x, column(p, work, K13)) == STOP) return STOP;
    for (size_t stage = 0; stage < EXTRA; stage++) {
        FOR_EACH(i) {
            double slope = 0;
            for (size_t j = 0; j < 13 + stage; j++) slope += EXTRA_STAGES[stage][j] * k[j][i];
            x[i] = y[i] + h * slope;
        }
        if (p->rates(p->context, t + EXTRA_TIMES[stage] * h, x, column(p, work, K13 + 1 + stage)) == STOP) return STOP;
    }
    FOR_EACH(i) {
        double *f = column(p, work, FIRST) + i;
        f[0] = h * sum[i];
        f[n] = h * k[0][i] - f[0];
        f[2 * n] = 2 * f[0] - h * (k[12][i] + k[0][i]);
        for (size_t shape = 0; shape < 4; shape++) {
            double slope = 0;
            for (size_t j = 0; j < 16; j++) slope += SHAPES[shape][j] * k[j][i];
            f[(3 + shape) * n] = h * slope;
        }
    }
    return GO_ON;
}

/* Indicators at a part of the step; 0 if it cannot be there. */
static int look(const Step *s, double part, double values[]) {
    const size_t n = s->p->n;
    FOR_EACH(i) {
        double sum = 0;
        for (size_t shape = DENSE; shape-- > 0;)
            sum = (sum + s->columns[shape * n + i]) * (shape % 2 == 0 ? part : 1 - part);
        s->at[i] = s->y[i] + sum;
    }
    return s->p->watch(s->p->context, s->t + part * s->h, s->at, values);
}

/* Where an indicator, which only falls between parts a and b, has the value MARGIN (Illinois' rule of false position). */
static double fall(const Step *s, size_t which, double a, double at_a, double b, double at_b) {
    const double target = at_a > MARGIN ? MARGIN : 0;
    double values[MOST_INDICATORS], left = at_a - target, right = at_b - target;
    for (int i = 0; i < MOST_TRIALS && b - a > 1e-15 * b; i++) {
        const double part = fmax(a + (b - a) * left / (left - right), a + 1e-15 * b); /* left may be 0 */
        if (!(part < b) || !look(s, part, values)) break;
        const double value = values[which] - target;
        if (value <= 0) {
            b = part;
            right = value;
            left /= 2;
        } else {
            a = part;
            left = value;
            right /= 2;
        }
    }
    return b;
}

/* The first crossing between two parts; 2 if there is none.  An interval is left where each indicator is far above its
 * distance from a straight line, or so near to it that it only rises or only falls.  The distance is measured off the
 * middle, so that no period hides between. */
static double scan(const Step *s, double a, const double at_a[], double b, const double at_b[], int depth) {
    static const double OFF = 0.4871;
    const double middle = a + OFF * (b - a);
    double values[MOST_INDICATORS], first = 2;
    int clear = 1;
    if (!look(s, middle, values)) return 2;
    for (size_t i = 0; i < s->p->indicators && clear; i++) {
        const double bend = fabs(values[i] - (at_a[i] + OFF * (at_b[i] - at_a[i]))), low = fmin(at_a[i], at_b[i]);
        const int far = fmin(low, values[i]) > 4 * bend, straight = fabs(at_b[i] - at_a[i]) > 8 * bend || bend == 0;
        clear = far || straight || (depth == 0 && low >= 0 && values[i] >= 0);
        if (at_b[i] < 0 && (straight || depth == 0)) first = fmin(first, fall(s, i, a, at_a[i], b, at_b[i]));
    }
    if (clear || depth == 0) return first;
    first = scan(s, a, at_a, middle, values, depth - 1);
    return first < 2 ? first : scan(s, middle, values, b, at_b, depth - 1);
}

/* The part of an accepted step at which an event is; 2 if there is none. */
static double first_event(const Step *s) {
    static const double PARTS[] = {0, 0.23, 0.47, 0.71, 1};
    double before[MOST_INDICATORS], after[MOST_INDICATORS];
    if (!look(s, 0, before)) return 2;
    for (size_t i = 0; i < s->p->indicators; i++) before[i] = fmax(before[i], 0);
    for (size_t k = 1; k < sizeof PARTS / sizeof *PARTS; k++) {
        if (!look(s, PARTS[k], after)) return 2;
        const double part = scan(s, PARTS[k - 1], before, PARTS[k], after, DEEPEST);
        if (part < 2) return part;
        memcpy(before, after, sizeof before);
    }
    return 2;
}

/* Shorten an accepted step to the first event in it: *h; whether there is one.  The stages are those of the shorter step,
 * whose end is moved to where an indicator is 0 for the step itself, not only for its polynomials. */
static Signal shorten(const Problem *p, double t, double *h, const double *y, double *work, int *crossed) {
    const double whole = *h;
    const Step step = {p, t, whole, y, column(p, work, 18), column(p, work, SOLVER_COLUMNS - 1)};
    const double *sum = work + 13 * p->n;
    double error, low[MOST_INDICATORS], high[MOST_INDICATORS], values[MOST_INDICATORS];
    *crossed = 0;
    if (polynomials(p, t, whole, y, work) == STOP) return STOP;
    double part = first_event(&step);
    if (part > 1) return GO_ON;
    *crossed = 1;
    const double away = fmin(1e-3, part / 2);
    if (!look(&step, part - away, high) || !look(&step, part, low)) return STOP;
    size_t which = 0; /* the one that is at 0 first */
    double soonest = INFINITY;
    for (size_t i = 0; i < p->indicators; i++) {
        const double fallen = high[i] - low[i], until = fallen > 0 ? low[i] / fallen : INFINITY;
        if (until < soonest) which = i;
        soonest = fmin(soonest, until);
    }
    const double slope = (low[which] - high[which]) / away;
    const size_t n = p->n;
    double nearest = part, least = INFINITY;
    for (int i = 0, back = 0; !back; i++) {
        back = part == nearest && i > 0; /* the last correction led away: the clock resolves no more */
        *h = fmax(part * whole, fmin(p->least, whole));
        if (stages(p, t, *h, y, work, &error) == STOP) return STOP;
        FOR_EACH(j) step.at[j] = y[j] + *h * sum[j];
        if (!p->watch(p->context, t + *h, step.at, values)) return STOP;
        const double off = MARGIN - values[which], change = off / slope;
        if (!(fabs(off) < least)) {
            part = nearest;
            continue;
        }
        least = fabs(off);
        nearest = part;
        if (i == MOST_CORRECTIONS || !(slope < 0) || !(fabs(change) > 1e-15 * part) || !(fabs(change) < part / 4)
            || part + change > 1)
            break;
        part += change;
    }
    return GO_ON;
}

#endif /* UNILATERAL */
Outcome solver_advance(const Problem *p, double *t, double end, double y[], double low[], double *step,
                       double work[]) {
    const size_t n = p->n;
    const double smallest = SMALLEST * (end - *t);
#ifdef UNILATERAL
    const double *sum = work + 13 * n;
#else
    const double *sum = work + (SOLVER_COLUMNS - 1) * n;
#endif /* UNILATERAL */
    double error, largest_growth = GROW;
#ifdef UNILATERAL
    int event = 0;
#endif /* UNILATERAL */
    Pace pace = {0, 0, *t};

    while (*t < end) {
        if (p->rates(p->context, *t, y, work) == STOP) return STOPPED;
        if (*step <= 0) *step = first_step(p, *t, end - *t, y, work);
        for (;;) { /* until a step is accepted */
            if (solver_is_exhausted(&pace, *t, end)) return EXHAUSTED;
            const double left = end - *t;
            const int last = 1.01 * *step >= left;
#ifdef UNILATERAL
            double h = last ? left : fmin(*step, left / 2);
            int crossed = 0;
#else
            const double h = last ? left : fmin(*step, left / 2); /* two equal steps rather than a tiny last one */
#endif /* UNILATERAL */
            if (stages(p, *t, h, y, work, &error) == STOP) return STOPPED;
#ifdef UNILATERAL
            if (error <= 1 && p->watch != NULL && shorten(p, *t, &h, y, work, &crossed) == STOP) return STOPPED;
#endif /* UNILATERAL */
            if (error <= 1) {
                const double factor = fmin(growth(error), largest_growth);
#ifdef UNILATERAL
                event = crossed;
                if (!crossed)
#endif /* UNILATERAL */
                *step = h < *step && factor == GROW ? fmax(*step, GROW * h) : factor * h; /* a cut step tells little */
#ifdef UNILATERAL
                *t = last && !crossed ? end : *t + h;
#else
                *t = last ? end : *t + h;
#endif /* UNILATERAL */
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
#ifdef UNILATERAL
        if (event) return CROSSED;
#endif /* UNILATERAL */
    }
    return REACHED;
}

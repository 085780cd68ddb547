/* Events inside a step of the solver, located on its dense output of order 7: Hairer, Norsett, Wanner, Solving Ordinary
 * Differential Equations I, 2nd edition, Springer 1993, II.6; their coefficients, in double precision. */
#include "events.h"

#include <math.h>

#include "event_search.h"

#define FOR_EACH(i) for (size_t i = 0; i < n; i++)

enum { EXTRA = 3 };

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

typedef struct { /* an accepted step of a method, and its polynomials */
    const Problem *p;
    double t, whole, h; /* size; of its last repetition */
    const double *y, *columns;
    double *at; /* a state inside the step, or at the end of a repetition */
    Repeat *repeat;
    void *method;
} Step;

/* Column i of the work space. */
static double *column(const Problem *p, double *work, size_t i) { return work + i * p->n; }

/* Calculate the dense output of a step from its stages; STOP if the rates say so. */
static Signal polynomials(const Problem *p, double t, double h, const double *y, double *work) {
    enum { K13 = 14 };
    const size_t n = p->n;
    const double *k[16], *sum = work + 13 * n;
    double *x = column(p, work, EVENT_COLUMNS - 1);
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
        double *f = events_columns(p, work) + i;
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

static int look(void *context, double part, double values[]) {
    const Step *s = context;
    const size_t n = s->p->n;
    FOR_EACH(i) {
        double sum = 0;
        for (size_t shape = EVENT_DEGREE; shape-- > 0;)
            sum = (sum + s->columns[shape * n + i]) * (shape % 2 == 0 ? part : 1 - part);
        s->at[i] = s->y[i] + sum;
    }
    return s->p->events->watch(s->p->context, s->t + part * s->whole, s->at, values);
}

static int repeat_step(void *context, double part, double values[]) {
    Step *s = context;
    s->h = fmax(part * s->whole, fmin(s->p->events->least, s->whole));
    return s->repeat(s->method, s->h, s->at) == GO_ON && s->p->events->watch(s->p->context, s->t + s->h, s->at, values);
}

Signal events_locate(const Problem *p, double t, double *h, const double y[], double work[], Repeat *repeat, void *method,
                     int *crossed) {
    Step step = {p, t, *h, *h, y, events_columns(p, work), column(p, work, EVENT_COLUMNS - 1), repeat, method};
    const EventSearch search = {&step, p->events->indicators, look, repeat_step};
    size_t which;
    double graze = NAN, part = event_search_first(&search, p->events->note != NULL ? &graze : NULL);
    *crossed = part <= 1;
    if (*crossed && !event_search_repeat(&search, &part, &which)) return STOP;
    if (isfinite(graze)) p->events->note(p->context, t + graze * *h, -1);
    if (*crossed && p->events->note != NULL) p->events->note(p->context, t + step.h, (long)which);
    *h = step.h;
    return GO_ON;
}

typedef struct { /* a step of the explicit method */
    const Problem *p;
    double t;
    const double *y;
    double *work;
} Explicit;

static Signal repeat_explicit(void *method, double h, double end[]) {
    const Explicit *step = method;
    const size_t n = step->p->n;
    const double *sum = step->work + 13 * n;
    double error;
    if (solver_stages(step->p, step->t, h, step->y, step->work, &error) == STOP) return STOP;
    FOR_EACH(i) end[i] = step->y[i] + h * sum[i];
    return GO_ON;
}

Signal events_shorten(const Problem *p, double t, double *h, const double y[], double work[], int *crossed) {
    Explicit step = {p, t, y, work};
    if (polynomials(p, t, *h, y, work) == STOP) return STOP;
    return events_locate(p, t, h, y, work, repeat_explicit, &step, crossed);
}

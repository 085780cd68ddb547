/* Solvers to compare with, called on the right-hand side of an FMU: DOP853 as one would write it by hand, and CVODE.
 * Each integrates from 0 to T, leaves the states in y, and returns processor time in seconds, < 0 if it failed. */
#include "solvers.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "stages.h" /* ORDER_8(i), STAGE_2(i) .. STAGE_12(i), ERROR_5(i), ERROR_3(i), NODES: the published coefficients */

/* ---- DOP853 with the step size control of Hairer's code (Hairer, Norsett, Wanner, 1993, appendix) ---------------- */

enum { STATES = 64 };

static REAL norm(size_t n, const REAL *v, const REAL *scale) {
    REAL sum = 0;
    for (size_t i = 0; i < n; i++) sum += (v[i] / scale[i]) * (v[i] / scale[i]);
    return sqrt(sum / n);
}

#define STAGE(s)                                                            \
    do {                                                                    \
        for (size_t i = 0; i < n; i++) x[i] = y[i] + h * (STAGE_##s(i));    \
        rates(context, t + NODES[s - 1] * h, x, k[s]);                      \
    } while (0)

static long steps_of_dop853(size_t n, REAL tolerance, const double *size, REAL T, REAL *y, RightHandSide *rates,
                            void *context) {
    REAL k[13][STATES], x[STATES], scale[STATES], t = 0, h;
    long evaluations = 2, rejected = 0;
    for (size_t i = 0; i < n; i++) scale[i] = tolerance * (size[i] + fabs(y[i]));
    rates(context, t, y, k[1]);
    h = 0.01 * norm(n, y, scale) / norm(n, k[1], scale); /* first guess: II.4 */
    for (size_t i = 0; i < n; i++) x[i] = y[i] + h * k[1][i];
    rates(context, t + h, x, k[2]);
    for (size_t i = 0; i < n; i++) x[i] = (k[2][i] - k[1][i]) / h;
    h = fmin(100 * h, pow(0.01 / fmax(norm(n, k[1], scale), norm(n, x, scale)), 1.0 / 8));
    while (t < T) {
        if (t + 1.01 * h >= T) h = T - t;
        STAGE(2);
        STAGE(3);
        STAGE(4);
        STAGE(5);
        STAGE(6);
        STAGE(7);
        STAGE(8);
        STAGE(9);
        STAGE(10);
        STAGE(11);
        STAGE(12);
        evaluations += 11;
        REAL fifth = 0, third = 0;
        for (size_t i = 0; i < n; i++) {
            x[i] = y[i] + h * (ORDER_8(i));
            const REAL allowed = tolerance * (size[i] + fmax(fabs(y[i]), fabs(x[i])));
            const REAL e5 = (ERROR_5(i)) / allowed, e3 = (ERROR_3(i)) / allowed;
            fifth += e5 * e5;
            third += e3 * e3;
        }
        const REAL both = fifth + 0.01 * third;
        const REAL error = both == 0 ? 0 : fabs(h) * fifth / sqrt(n * both);
        const REAL factor = fmin(6, fmax(0.333, 0.9 * pow(error, -1.0 / 8)));
        if (error < 1) {
            t = t + h >= T ? T : t + h;
            memcpy(y, x, n * sizeof *y);
            rates(context, t, y, k[1]);
            evaluations++;
            h *= rejected ? fmin(factor, 1) : factor;
            rejected = 0;
        } else {
            h *= fmin(factor, 1);
            rejected = 1;
        }
        if (evaluations > 100000000) return -1;
    }
    return evaluations;
}

double dop853(size_t n, double tolerance, const double *size, double T, REAL *y, RightHandSide *rates, void *context,
              long *evaluations) {
    const double start = processor_time();
    *evaluations = steps_of_dop853(n, tolerance, size, T, y, rates, context);
    return *evaluations < 0 ? -1 : processor_time() - start;
}

#ifndef REFERENCE

/* ---- CVODE 7, whose headers its wheels do not carry -------------------------------------------------------------- */

typedef void *Opaque;
int SUNContext_Create(int communicator, Opaque *context);
int SUNContext_Free(Opaque *context);
Opaque N_VMake_Serial(long long n, double *values, Opaque context);
double *N_VGetArrayPointer(Opaque);
void N_VDestroy(Opaque);
Opaque SUNDenseMatrix(long long rows, long long columns, Opaque context);
void SUNMatDestroy(Opaque);
Opaque SUNLinSol_Dense(Opaque vector, Opaque matrix, Opaque context);
int SUNLinSolFree(Opaque);
Opaque SUNNonlinSol_FixedPoint(Opaque vector, int accelerated, Opaque context);
int SUNNonlinSolFree(Opaque);
Opaque CVodeCreate(int method, Opaque context);
int CVodeInit(Opaque, int (*)(double, Opaque, Opaque, void *), double start, Opaque vector);
int CVodeSVtolerances(Opaque, double relative, Opaque absolute);
int CVodeSetUserData(Opaque, void *);
int CVodeSetMaxNumSteps(Opaque, long);
int CVodeSetStopTime(Opaque, double);
int CVodeSetLinearSolver(Opaque, Opaque solver, Opaque matrix);
int CVodeSetNonlinearSolver(Opaque, Opaque solver);
int CVode(Opaque, double stop, Opaque vector, double *reached, int task);
int CVodeGetNumRhsEvals(Opaque, long *);
int CVodeGetNumLinRhsEvals(Opaque, long *);
void CVodeFree(Opaque *);

typedef struct {
    RightHandSide *rates;
    void *context;
} Call;

static int right_hand_side(double t, Opaque y, Opaque f, void *data) {
    const Call *call = data;
    call->rates(call->context, t, N_VGetArrayPointer(y), N_VGetArrayPointer(f));
    return 0;
}

double cvode(size_t n, double tolerance, const double *size, double T, double *y, RightHandSide *rates, void *context,
             long *evaluations, int method) {
    enum { ADAMS = 1, NORMAL = 1 };
    Call call = {rates, context};
    Opaque sun, nonlinear = NULL, matrix = NULL, linear = NULL;
    double *allowed = malloc(n * sizeof *allowed), reached;
    long more = 0;
    for (size_t i = 0; i < n; i++) allowed[i] = tolerance * size[i];
    SUNContext_Create(0, &sun);
    Opaque vector = N_VMake_Serial((long long)n, y, sun), absolute = N_VMake_Serial((long long)n, allowed, sun);
    Opaque solver = CVodeCreate(method, sun);
    CVodeInit(solver, right_hand_side, 0, vector);
    CVodeSVtolerances(solver, tolerance, absolute);
    CVodeSetUserData(solver, &call);
    CVodeSetMaxNumSteps(solver, 100000000);
    CVodeSetStopTime(solver, T);
    if (method == ADAMS) { /* fixed-point iteration: no matrices, as CVODE's guide advises for non-stiff systems */
        nonlinear = SUNNonlinSol_FixedPoint(vector, 0, sun);
        CVodeSetNonlinearSolver(solver, nonlinear);
    } else {
        matrix = SUNDenseMatrix((long long)n, (long long)n, sun);
        linear = SUNLinSol_Dense(vector, matrix, sun);
        CVodeSetLinearSolver(solver, linear, matrix);
    }
    const double start = processor_time();
    const int failed = CVode(solver, T, vector, &reached, NORMAL) < 0;
    const double seconds = processor_time() - start;
    CVodeGetNumRhsEvals(solver, evaluations);
    if (method != ADAMS) CVodeGetNumLinRhsEvals(solver, &more);
    *evaluations += more;
    CVodeFree(&solver);
    if (nonlinear) SUNNonlinSolFree(nonlinear);
    if (linear) SUNLinSolFree(linear);
    if (matrix) SUNMatDestroy(matrix);
    N_VDestroy(vector);
    N_VDestroy(absolute);
    SUNContext_Free(&sun);
    free(allowed);
    return failed ? -1 : seconds;
}

#endif

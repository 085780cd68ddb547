/* The yardstick: a pendulum of variable length on a moving pivot, as one would write it by hand as an FMI 2.0
 * co-simulation FMU.  Same state as the generated one (theta, p, work, dissipated), same inputs, three classical
 * Runge-Kutta steps a communication step: 12 right-hand sides, as many as one step of order 8 takes.
 * No error control, no checks: this is the floor.
 * With SAME_METHOD it is the solver of the generated FMUs, at their default tolerance, and no checks either. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "fmi2Functions.h"

enum { MASS, GRAVITY, FRICTION, LENGTH, LENGTH_DOT, LENGTH_DDOT, X, X_DOT, X_DDOT, Z, Z_DOT, Z_DDOT, FORCE,
       THETA, MOMENTUM, WORK, DISSIPATED, COUNT };

typedef struct { double v[COUNT], low[4], step; } Pendulum;

static void rates(const double *y, const double *v, double *f) {
    const double s = sin(y[0]), c = cos(y[0]), m = v[MASS], g = v[GRAVITY], l = v[LENGTH], ld = v[LENGTH_DOT];
    const double w = (y[1] / (m * l) - v[X_DOT] * c - v[Z_DOT] * s) / l;
    const double vx = v[X_DOT] + ld * s + l * c * w, vz = v[Z_DOT] - ld * c + l * s * w;
    const double eta = v[FRICTION];
    const double fx = -eta * m * vx, fz = -eta * m * vz - m * g;         /* applied force on the bob */
    const double pd = m * (vx * (ld * c - l * s * w) + vz * (ld * s + l * c * w)) + l * (fx * c + fz * s) + v[FORCE];
    /* tangential equation: m l w' = (F - m a_rest).e_theta */
    const double ax0 = v[X_DDOT] + v[LENGTH_DDOT] * s + 2 * ld * c * w - l * s * w * w;
    const double az0 = v[Z_DDOT] - v[LENGTH_DDOT] * c + 2 * ld * s * w + l * c * w * w;
    const double wd = ((fx * c + fz * s + v[FORCE] / l) / m - ax0 * c - az0 * s) / l;
    const double rx = m * (ax0 + l * c * wd) - fx, rz = m * (az0 + l * s * wd) - fz;  /* force of the rod */
    f[0] = w;
    f[1] = pd;
    f[2] = (rx * s - rz * c) * ld + rx * v[X_DOT] + rz * v[Z_DOT] + v[FORCE] * w;
    f[3] = eta * m * (vx * vx + vz * vz);
}

#ifdef SAME_METHOD

#include "solver.h"

static Signal solver_rates(void *v, double t, const double y[], double f[]) { (void)t; rates(y, v, f); return GO_ON; }
static Signal solver_accept(void *v, double t, double y[]) { (void)v; (void)t; (void)y; return GO_ON; }

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real H, fmi2Boolean keep) {
    static const double size[4] = {1, 1, 9.81, 9.81};
    Pendulum *it = c;
    double work[SOLVER_COLUMNS * 4], from = 0;
    const Problem problem = {4, 4, 0.02 * 1e-8, size, solver_rates, solver_rates, solver_accept, it->v};
    (void)t; (void)keep;
    return solver_advance(&problem, &from, H, it->v + THETA, it->low, &it->step, work) == REACHED ? fmi2OK : fmi2Error;
}

#else

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real H, fmi2Boolean keep) {
    double *v = ((Pendulum *)c)->v, *y = v + THETA, h = H / 3, k1[4], k2[4], k3[4], k4[4], x[4];
    (void)t; (void)keep;
    for (int n = 0; n < 3; n++) {
        rates(y, v, k1);
        for (int i = 0; i < 4; i++) x[i] = y[i] + h / 2 * k1[i];
        rates(x, v, k2);
        for (int i = 0; i < 4; i++) x[i] = y[i] + h / 2 * k2[i];
        rates(x, v, k3);
        for (int i = 0; i < 4; i++) x[i] = y[i] + h * k3[i];
        rates(x, v, k4);
        for (int i = 0; i < 4; i++) y[i] += h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]);
    }
    return fmi2OK;
}

#endif

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    static const double start[COUNT] = {[MASS] = 1, [GRAVITY] = 9.81, [LENGTH] = 1, [THETA] = 0.1};
    Pendulum *pendulum = malloc(sizeof *pendulum);
    (void)name; (void)type; (void)guid; (void)resources; (void)functions; (void)visible; (void)logging;
    if (pendulum == NULL) return NULL;
    memset(pendulum, 0, sizeof *pendulum);
    memcpy(pendulum->v, start, sizeof start);
    return pendulum;
}
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    for (size_t i = 0; i < n; i++) value[i] = ((Pendulum *)c)->v[vr[i]];
    return fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    for (size_t i = 0; i < n; i++) ((Pendulum *)c)->v[vr[i]] = value[i];
    return fmi2OK;
}
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real d, fmi2Boolean e, fmi2Real f) {
    (void)c; (void)a; (void)b; (void)d; (void)e; (void)f;
    return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { (void)c; return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { (void)c; return fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) { (void)c; return fmi2OK; }

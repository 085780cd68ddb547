/* Steps of a pendulum of length 1 m, by hand: the classical Runge-Kutta method, and the FMU's symplectic solver on the
 * same right-hand side.  Each makes n steps of size h and returns processor time in seconds. */
#include <math.h>

#include "solvers.h"
#include "symplectic.h"

static const double GRAVITY = 9.81;

/* y: angle and rate */
double runge_kutta_of_two(double *y, double h, long n) {
    const double start = processor_time();
    for (long i = 0; i < n; i++) {
        const double a1 = y[1], b1 = -GRAVITY * sin(y[0]);
        const double a2 = y[1] + h / 2 * b1, b2 = -GRAVITY * sin(y[0] + h / 2 * a1);
        const double a3 = y[1] + h / 2 * b2, b3 = -GRAVITY * sin(y[0] + h / 2 * a2);
        const double a4 = y[1] + h * b3, b4 = -GRAVITY * sin(y[0] + h * a3);
        y[0] += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
        y[1] += h / 6 * (b1 + 2 * b2 + 2 * b3 + b4);
    }
    return processor_time() - start;
}

static Signal rates_of_two(void *context, double t, const double y[], double f[]) {
    (void)context;
    (void)t;
    f[0] = y[1];
    f[1] = -GRAVITY * sin(y[0]);
    return GO_ON;
}

static Signal accept(void *context, double t, double y[]) {
    (void)context;
    (void)t;
    (void)y;
    return GO_ON;
}

double gauss_of_two(double *y, double h, long n) {
    static const double size[] = {1, 1};
    const Problem problem = {
        .n = 2, .coupled = 2, .size = size, .rates = rates_of_two, .coupled_rates = rates_of_two, .accept = accept};
    double low[2] = {0}, history[2 * HISTORY], work[2 * SYMPLECTIC_COLUMNS], t = 0;
    int32_t known = 0;
    const double start = processor_time();
    symplectic_advance(&problem, NULL, &t, (double)n * h, h, y, low, history, &known, work);
    return processor_time() - start;
}

void rates_of_Pendulum(void *context, double t, const double y[], double f[]);

/* The states of the FMU Pendulum: work and loss, too. */
double runge_kutta_of_four(double *y, double h, long n) {
    double k1[4], k2[4], k3[4], k4[4], x[4];
    const double start = processor_time();
    for (long step = 0; step < n; step++) {
        rates_of_Pendulum(NULL, 0, y, k1);
        for (int i = 0; i < 4; i++) x[i] = y[i] + h / 2 * k1[i];
        rates_of_Pendulum(NULL, 0, x, k2);
        for (int i = 0; i < 4; i++) x[i] = y[i] + h / 2 * k2[i];
        rates_of_Pendulum(NULL, 0, x, k3);
        for (int i = 0; i < 4; i++) x[i] = y[i] + h * k3[i];
        rates_of_Pendulum(NULL, 0, x, k4);
        for (int i = 0; i < 4; i++) y[i] += h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]);
    }
    return processor_time() - start;
}

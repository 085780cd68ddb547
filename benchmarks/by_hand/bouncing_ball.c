/* A ball that bounces on a table at rest, as demonstrations have it: explicit Euler at fixed steps, an impact at the next
 * point of the grid, and no more bounces below a least velocity.  Returns processor time in seconds. */
#include "core.h"
#include "solvers.h"

static const double GRAVITY = 9.81, LEAST_VELOCITY = 0.1;

/* y: height and rate; Euler steps of size h */
double ball_by_hand(double *y, double bounce, double h, long steps) {
    const double start = processor_time();
    double gravity = GRAVITY;
    for (long i = 0; i < steps; i++) {
        y[0] += h * y[1];
        y[1] -= h * gravity;
        if (!(y[0] <= 0 && y[1] < 0)) continue;
        y[0] = 0;
        y[1] *= -bounce;
        if (y[1] < LEAST_VELOCITY) gravity = y[1] = 0;
    }
    return processor_time() - start;
}

/* The same time of communication steps of a component, before each of which an input is set: what moves steadily. */
double component_driven(Instance *instance, unsigned input, double rate, double size, long steps) {
    Arrival arrival;
    Status status = SUCCESS;
    const double start = processor_time();
    for (long i = 0; i < steps && status == SUCCESS; i++) {
        const double value = rate * (double)i * size;
        status |= core_set(instance, &input, 1, &value, 1);
        status |= core_step(instance, (double)i * size, size, &arrival);
    }
    return status == SUCCESS ? processor_time() - start : -1;
}

/* Right-hand sides of components as one would write them by hand: same states, work and loss included. */
#include "solvers.h"

#include <math.h>
#include <string.h>

static double k[32], u[32];

/* Values of parameters and inputs, in the order of the component's. */
void begin_by_hand(const double *values, size_t parameters, size_t inputs) {
    memcpy(k, values, parameters * sizeof *k);
    memcpy(u, values + parameters, inputs * sizeof *u);
}

/* Length, pivot and bob may be pulled at. */
void rates_of_Pendulum(void *context, double t, const double y[], double f[]) {
    const double m = k[0], g = k[1], eta = k[2], l = u[0], l_dot = u[1], l_ddot = u[2];
    const double *pivot_x = u + 3, *pivot_z = u + 6, torque = u[9] - u[10], load_x = u[11], load_z = u[12];
    const double s = sin(y[0]), c = cos(y[0]);
    const double w = (y[1] / (m * l) - pivot_x[1] * c - pivot_z[1] * s) / l, lw = l * w;
    const double vx = pivot_x[1] + l_dot * s + lw * c, vz = pivot_z[1] - l_dot * c + lw * s;
    const double force_x = -eta * m * vx - load_x, force_z = -eta * m * vz - m * g - load_z;
    const double across = l * (force_x * c + force_z * s) + torque;
    /* acceleration of the bob but for its part l dw/dt along the circle, which follows from `across` */
    const double ax = pivot_x[2] + l_ddot * s + (2 * l_dot * c - lw * s) * w;
    const double az = pivot_z[2] - l_ddot * c + (2 * l_dot * s + lw * c) * w;
    const double rest = across / (m * l) - (ax * c + az * s);
    const double rod_x = m * (ax + rest * c) - force_x, rod_z = m * (az + rest * s) - force_z;
    (void)context;
    (void)t;
    f[0] = w;
    f[1] = m * (vx * (l_dot * c - lw * s) + vz * (l_dot * s + lw * c)) + across;
    f[2] = (rod_x * s - rod_z * c) * l_dot + rod_x * pivot_x[1] + rod_z * pivot_z[1] + torque * w - load_x * vx
           - load_z * vz;
    f[3] = eta * m * (vx * vx + vz * vz);
}

void rates_of_KeplerOrbit(void *context, double t, const double y[], double f[]) {
    const double m = k[0], mu = k[1], r2 = y[0] * y[0] + y[1] * y[1], pull = -m * mu / (r2 * sqrt(r2));
    const double force_x = u[0] - u[1], force_y = u[2] - u[3];
    (void)context;
    (void)t;
    f[0] = y[2] / m;
    f[1] = y[3] / m;
    f[2] = pull * y[0] + force_x;
    f[3] = pull * y[1] + force_y;
    f[4] = force_x * f[0] + force_y * f[1];
    f[5] = 0;
}

/* A bead at the arc length xi on a hoop of radius R, whose centre is at the distance d from the axis. */
void rates_of_CircularHoop(void *context, double t, const double y[], double f[]) {
    const double m = k[0], inertia = k[1], R = k[2], d = k[3], w = u[1], w_dot = u[2];
    const double psi = y[0] / R, sine = d * sin(psi), cosine = d * cos(psi), arm = R + cosine;
    const double v = y[1] / m, xi_dot = v - w * arm, turn = xi_dot / R;
    const double angle = psi + u[0] + t * (w + t / 2 * w_dot);
    /* The moment of the load about the axis costs the operator what the load gains: it is not in their sum. */
    const double force = u[3] - u[4] + u[5] * sin(angle) - u[6] * cos(angle);
    (void)context;
    f[0] = xi_dot;
    f[1] = m * w * sine * (w * cosine - v) / R + force;
    const double torque = inertia * w_dot + f[1] * arm
                          + m * (-v * sine * turn + 2 * sine * cosine * turn * w + sine * sine * w_dot);
    f[2] = torque * w + force * xi_dot;
    f[3] = 0;
}

/* L of K eq. 24 with A = B x r / 2. */
void rates_of_ChargedParticle(void *context, double t, const double y[], double f[]) {
    const double m = k[0], q = k[1], *B = k + 2, *E = k + 5, half = q / 2;
    const double vx = (y[3] - half * (B[1] * y[2] - B[2] * y[1])) / m;
    const double vy = (y[4] - half * (B[2] * y[0] - B[0] * y[2])) / m;
    const double vz = (y[5] - half * (B[0] * y[1] - B[1] * y[0])) / m;
    const double force_x = u[0] - u[1], force_y = u[2] - u[3], force_z = u[4] - u[5];
    (void)context;
    (void)t;
    f[0] = vx;
    f[1] = vy;
    f[2] = vz;
    f[3] = half * (vy * B[2] - vz * B[1]) + q * E[0] + force_x;
    f[4] = half * (vz * B[0] - vx * B[2]) + q * E[1] + force_y;
    f[5] = half * (vx * B[1] - vy * B[0]) + q * E[2] + force_z;
    f[6] = force_x * vx + force_y * vy + force_z * vz;
    f[7] = 0;
}

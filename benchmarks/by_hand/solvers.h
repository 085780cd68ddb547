#ifndef SOLVERS_H
#define SOLVERS_H

#include <stddef.h>
#include <time.h>

#ifdef REFERENCE /* compiled a second time: the solution to compare with, in extended precision */
#include <tgmath.h>
#define REAL long double
#else
#define REAL double
#endif

typedef void RightHandSide(void *context, REAL t, const REAL y[], REAL f[]); /* f = dy/dt */

static inline double processor_time(void) {
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

double dop853(size_t n, double tolerance, const double *size, double T, REAL *y, RightHandSide *rates, void *context,
              long *evaluations);
double cvode(size_t n, double tolerance, const double *size, double T, double *y, RightHandSide *rates, void *context,
             long *evaluations, int method);

#endif

/* Communication steps in a row: the calls of all FMUs of a system, with no interpreter between them.

   The same calls in the same order as in loop.py, which prepares them and makes them itself where this is not compiled.
   Buffers are the caller's; what a call refuses goes back to him. */
#include "calls.h"

typedef struct { /* see loop.py */
    const Call *step, *instant;
    size_t step_calls, instant_calls;
    double *start, *size, *end; /* of the step under way [s], where the caller sees them */
    const double *bus;
    size_t width;
    double *times, *result_times, *rows;
    ptrdiff_t *refusal; /* which call was refused, and with what status */
} Loop;

static bool perform_all(const Loop *loop, const Call calls[], size_t count, size_t point) {
    for (size_t i = 0; i < count; i++) {
        const int status = perform(&calls[i], *loop->start, *loop->size);
        if (fine(status)) continue;
        loop->refusal[0] = (ptrdiff_t)i;
        loop->refusal[1] = status;
        return false;
    }
    memcpy(loop->rows + point * loop->width, loop->bus, loop->width * sizeof(double));
    return true;
}

/* Steps to times that follow a point, and of each a row of what is on the bus then.  Returns how many were done. */
EXPORT size_t advance(const Loop *loop, size_t point, size_t steps, bool in_result) {
    for (size_t k = point + 1; k <= point + steps; k++) {
        *loop->start = loop->times[k - 1];
        *loop->size = loop->times[k] - loop->times[k - 1];
        *loop->end = loop->times[k];
        loop->result_times[k] = in_result ? loop->times[k] : NAN;
        if (!perform_all(loop, loop->step, loop->step_calls, k)) return k - point - 1;
    }
    return steps;
}

/* The calls at one instant, and the row of its point.  Returns whether they were done. */
EXPORT bool settle(const Loop *loop, size_t point) {
    return perform_all(loop, loop->instant, loop->instant_calls, point);
}

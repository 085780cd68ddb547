/* Communication steps in a row: the calls of all FMUs of a system, with no interpreter between them.

   The same calls in the same order as in loop.py, which prepares them and makes them itself where this is not compiled.
   Buffers are the caller's; what a call refuses goes back to him. */
#include "calls.h"

/* Steps from each time to the next one, and of each a row of what is on the bus then.  Returns how many were done; if
   fewer, which call was refused, and with what status.  The caller sees begin, size and end [s] of the step under way. */
EXPORT size_t advance(const Call calls[], size_t count, double *start, double *size, double *end, const double bus[],
                      size_t width, const double times[], size_t steps, double *rows, ptrdiff_t refusal[2]) {
    for (size_t k = 0; k < steps; k++) {
        *start = times[k];
        *size = times[k + 1] - times[k];
        *end = times[k + 1];
        for (size_t i = 0; i < count; i++) {
            const int status = perform(&calls[i], *start, *size);
            if (fine(status)) continue;
            refusal[0] = (ptrdiff_t)i;
            refusal[1] = status;
            return k;
        }
        memcpy(rows + k * width, bus, width * sizeof(double));
    }
    return steps;
}

/* Communication steps in a row: the calls of all FMUs of a system, with no interpreter between them.

   The same calls in the same order as in loop.py, which prepares them and makes them itself where this is not compiled.
   Buffers are the caller's; what a call refuses goes back to him. */
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { OK, WARNING, DISCARD };
enum { COPY, CONVERT, TRANSFER_2, TRANSFER_3, STEP_2, STEP_3 };

typedef int Transfer2(void *instance, const unsigned references[], size_t n, double values[]);
typedef int Transfer3(void *instance, const unsigned references[], size_t n, double values[], size_t n_values);
typedef int Step2(void *instance, double time, double size, int no_return);
typedef int Step3(void *instance, double time, double size, bool no_return, bool *event, bool *terminate, bool *early,
                  double *last_time);

typedef struct {
    bool terminate, early;
    double last_time;
} Ended;

typedef struct {
    int kind;
    void (*function)(void);
    void *instance;    /* of an FMU; factor and offset, to convert one double */
    const void *given; /* value references; where to copy from; for a step in FMI 3.0, whether there is no return */
    size_t count;      /* of references; of doubles to copy */
    void *values;      /* to get, to set, to copy to; for a step in FMI 3.0, how it Ended */
    size_t size;       /* of values in FMI 3.0 */
} Call;

static int step_3(const Call *call, double time, double size) {
    Ended *ended = call->values;
    bool event;
    const int status = ((Step3 *)call->function)(call->instance, time, size, *(const bool *)call->given, &event,
                                                 &ended->terminate, &ended->early, &ended->last_time);
    return (ended->terminate || ended->early) && status < DISCARD ? DISCARD : status;
}

static int convert(const Call *call) {
    const double *numbers = call->instance, *given = call->given;
    *(double *)call->values = numbers[0] * *given + numbers[1];
    return OK;
}

static int perform(const Call *call, double time, double size) {
    switch (call->kind) {
    case COPY: memmove(call->values, call->given, call->count * sizeof(double)); return OK;
    case CONVERT: return convert(call);
    case TRANSFER_2: return ((Transfer2 *)call->function)(call->instance, call->given, call->count, call->values);
    case TRANSFER_3:
        return ((Transfer3 *)call->function)(call->instance, call->given, call->count, call->values, call->size);
    case STEP_2: return ((Step2 *)call->function)(call->instance, time, size, 1);
    default: return step_3(call, time, size);
    }
}

/* Steps from each time to the next one, and of each a row of what is on the bus then.  Returns how many were done; if
   fewer, which call was refused, and with what status.  The caller sees begin and size [s] of the step under way. */
EXPORT size_t advance(const Call calls[], size_t count, double *start, double *size, const double bus[], size_t width,
                      const double times[], size_t steps, double *rows, ptrdiff_t refusal[2]) {
    for (size_t k = 0; k < steps; k++) {
        *start = times[k];
        *size = times[k + 1] - times[k];
        for (size_t i = 0; i < count; i++) {
            const int status = perform(&calls[i], *start, *size);
            if (status == OK || status == WARNING) continue;
            refusal[0] = (ptrdiff_t)i;
            refusal[1] = status;
            return k;
        }
        memcpy(rows + k * width, bus, width * sizeof(double));
    }
    return steps;
}

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
enum { COPY, TRANSFER_2, TRANSFER_3, STEP_2, STEP_3 };

typedef int Transfer2(void *instance, const unsigned references[], size_t n, double values[]);
typedef int Transfer3(void *instance, const unsigned references[], size_t n, double values[], size_t n_values);
typedef int Step2(void *instance, double time, double size, int no_return);
typedef int Step3(void *instance, double time, double size, bool no_return, bool *event, bool *terminate, bool *early,
                  double *last_time);

typedef struct {
    int kind;
    void (*function)(void);
    void *instance;
    const void *given; /* value references; where to copy from; for a step in FMI 3.0, whether there is no return */
    size_t count;      /* of references; of doubles to copy */
    void *values;      /* to get, to set, to copy to; for a step in FMI 3.0, whether it ended the simulation, or early */
    size_t size;       /* of values in FMI 3.0 */
} Call;

typedef struct {
    const Call *calls;
    size_t count;
    double *start, *size; /* [s], of the step under way */
    const double *bus;    /* what is recorded at its end */
    size_t width;
} Program;

typedef struct {
    size_t call;
    int status;
} Refusal;

static int step_3(const Call *call, double time, double size) {
    bool *ended = call->values, event;
    double last_time;
    const int status = ((Step3 *)call->function)(call->instance, time, size, *(const bool *)call->given, &event,
                                                 &ended[0], &ended[1], &last_time);
    return (ended[0] || ended[1]) && status < DISCARD ? DISCARD : status;
}

static int perform(const Call *call, double time, double size) {
    switch (call->kind) {
    case COPY: memmove(call->values, call->given, call->count * sizeof(double)); return OK;
    case TRANSFER_2: return ((Transfer2 *)call->function)(call->instance, call->given, call->count, call->values);
    case TRANSFER_3:
        return ((Transfer3 *)call->function)(call->instance, call->given, call->count, call->values, call->size);
    case STEP_2: return ((Step2 *)call->function)(call->instance, time, size, 1);
    default: return step_3(call, time, size);
    }
}

/* Steps from each time to the next one, and a row for each.  Returns how many were done; if fewer, who refused. */
EXPORT size_t advance(const Program *program, const double times[], size_t steps, double *rows, Refusal *refusal) {
    for (size_t k = 0; k < steps; k++) {
        *program->start = times[k];
        *program->size = times[k + 1] - times[k];
        for (size_t i = 0; i < program->count; i++) {
            const int status = perform(&program->calls[i], *program->start, *program->size);
            if (status == OK || status == WARNING) continue;
            *refusal = (Refusal){i, status};
            return k;
        }
        memcpy(rows + k * program->width, program->bus, program->width * sizeof(double));
    }
    return steps;
}

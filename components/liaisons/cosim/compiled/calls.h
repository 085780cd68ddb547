/* A call of an FMU, prepared by calls.py, and how it is made. */
#ifndef CALLS_H
#define CALLS_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { OK, WARNING, DISCARD, ERROR, FATAL };
enum { COPY, CONVERT, TRANSFER_2, TRANSFER_3, STEP_2, STEP_3, SAVE, RESTORE, ORDERS_2, DERIVE_2, WATCH, PYTHON, COUPLED };

typedef void Function(void);

typedef struct {
    int kind;
    Function *function;
    void *instance;    /* of an FMU; what is coupled; factor and offset, to convert one double */
    const void *source; /* value references; where to copy from; columns to watch; for a step in FMI 3.0, whether there
                           is no return */
    size_t count;      /* of references; of doubles to copy, or to watch */
    void *values;      /* to get, to set, to copy to; the state; for a step in FMI 3.0, how it Ended */
    size_t size;       /* of values in FMI 3.0; of what is known in derivatives */
    const void *more;  /* orders; what is known, and its direction; what values to watch may be */
} Call;

typedef struct {
    bool terminate, early;
    double last_time;
} Ended;

typedef struct {
    const unsigned *references;
    const double *direction;
} Known;

typedef int Transfer2(void *instance, const unsigned references[], size_t n, double values[]);
typedef int Transfer3(void *instance, const unsigned references[], size_t n, double values[], size_t n_values);
typedef int Step2(void *instance, double time, double size, int no_return);
typedef int Step3(void *instance, double time, double size, bool no_return, bool *event, bool *terminate, bool *early,
                  double *last_time);
typedef int State(void *instance, void *state);
typedef int Orders2(void *instance, const unsigned references[], size_t n, const int orders[], double values[]);
typedef int Derive2(void *instance, const unsigned unknowns[], size_t n, const unsigned knowns[], size_t m,
                    const double direction[], double values[]);
typedef int Python(void);
typedef int Coupled(void *system, double time, double size);

static inline int step_3(const Call *call, double time, double size) {
    Ended *ended = call->values;
    bool event;
    const int status = ((Step3 *)call->function)(call->instance, time, size, *(const bool *)call->source, &event,
                                                 &ended->terminate, &ended->early, &ended->last_time);
    return (ended->terminate || ended->early) && status < DISCARD ? DISCARD : status;
}

static inline int convert(const Call *call) {
    const double *numbers = call->instance, *source = call->source;
    *(double *)call->values = numbers[0] * *source + numbers[1];
    return OK;
}

static inline int derive_2(const Call *call) {
    const Known *known = call->more;
    return ((Derive2 *)call->function)(call->instance, call->source, call->count, known->references, call->size,
                                       known->direction, call->values);
}

/* Discard if one of some values is greater than it may be. */
static inline int watch(const Call *call) {
    const ptrdiff_t *columns = call->source;
    const double *values = call->values, *limits = call->more;
    for (size_t i = 0; i < call->count; i++)
        if (fabs(values[columns[i]]) > limits[i]) return DISCARD;
    return OK;
}

static inline int returned(const Call *call, double time, double size) {
    switch (call->kind) {
    case COPY: memmove(call->values, call->source, call->count * sizeof(double)); return OK;
    case CONVERT: return convert(call);
    case TRANSFER_2: return ((Transfer2 *)call->function)(call->instance, call->source, call->count, call->values);
    case TRANSFER_3:
        return ((Transfer3 *)call->function)(call->instance, call->source, call->count, call->values, call->size);
    case STEP_2: return ((Step2 *)call->function)(call->instance, time, size, 1);
    case STEP_3: return step_3(call, time, size);
    case SAVE: return ((State *)call->function)(call->instance, call->values);
    case RESTORE: return ((State *)call->function)(call->instance, *(void **)call->values);
    case ORDERS_2:
        return ((Orders2 *)call->function)(call->instance, call->source, call->count, call->more, call->values);
    case DERIVE_2: return derive_2(call);
    case WATCH: return watch(call);
    case PYTHON: return ((Python *)call->function)();
    default: return ((Coupled *)call->function)(call->instance, time, size);
    }
}

/* The status; what an FMU returns beside those of FMI is taken for Fatal: negative numbers are ours. */
static inline int perform(const Call *call, double time, double size) {
    const int status = returned(call, time, size);
    return status < OK && call->kind < PYTHON ? FATAL : status;
}

static inline bool fine(int status) { return status == OK || status == WARNING; }

#endif

/* A row of n = 3 integrators of FMI 3.0: s[i]' = gain[i] u[i], y[i] = gain[i] u[i], all exact where u is held.
 *
 * What the importer did can be read: "calls" counts the calls that set the array u. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"

#define N 3

enum { SIZE, GAIN, U, Y, S, SINGLE, LIMIT, COUNT, FLAG, LABEL, S_0, CALLS, BYTES, STEPS, MOVED, DEEP, M, V, W, TINY };

typedef struct {
    double gain[N], u[N], s[N], v[8], limit, calls, t;
    size_t m;
    bool configuring, deep;
    fmi3Int8 tiny;
    fmi3Int16 count;
    bool flag;
    char label[64];
} State;

typedef struct {
    State state;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} Row;

static fmi3Status refuse(Row *m, const char *format, ...) {
    char text[200];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    m->log(m->environment, fmi3Error, "logStatusError", text);
    return fmi3Error;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                         const fmi3ValueReference required[], size_t n,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update) {
    Row *m = calloc(1, sizeof *m);
    (void)name, (void)visible, (void)logging, (void)required, (void)n, (void)update;
    m->environment = environment;
    m->log = log;
    if (events || early || strcmp(token, "{row}") || resources[strlen(resources) - 1] != '/') {
        refuse(m, "called in a wrong way");
        free(m);
        return NULL;
    }
    for (int i = 0; i < N; i++) m->state.gain[i] = i + 1.0;
    m->state.limit = INFINITY;
    m->state.m = 2;
    m->state.deep = true;
    return m;
}

void fmi3FreeInstance(fmi3Instance c) { free(c); }
fmi3Status fmi3Terminate(fmi3Instance c) { return c ? fmi3OK : fmi3Error; }
fmi3Status fmi3EnterConfigurationMode(fmi3Instance c) { ((Row *)c)->state.configuring = true; return fmi3OK; }
fmi3Status fmi3ExitConfigurationMode(fmi3Instance c) { ((Row *)c)->state.configuring = false; return fmi3OK; }
fmi3Status fmi3SetUInt64(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3UInt64 v[], size_t size) {
    State *s = &((Row *)c)->state;
    if (n != 1 || size != 1 || r[0] != M || !s->configuring || v[0] > 8) return refuse(c, "no size");
    s->m = v[0];
    return fmi3OK;
}
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean given, fmi3Float64 tolerance, fmi3Float64 start,
                                       fmi3Boolean limited, fmi3Float64 stop) {
    Row *m = c;
    (void)limited, (void)stop;
    if (given && tolerance <= 0) return refuse(m, "tolerance = %g", tolerance);
    m->state.t = start;
    return fmi3OK;
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
    Row *m = c;
    if (m->state.flag) return refuse(m, "flag is set, count = %d, label = %s", m->state.count, m->state.label);
    return fmi3OK;
}

static double *place(Row *m, fmi3ValueReference reference, size_t *size) {
    State *s = &m->state;
    *size = reference == GAIN || reference == U || reference == S ? N : reference == V ? s->m : 1;
    switch (reference) {
        case GAIN: return s->gain;
        case U: return s->u;
        case V: return s->v;
        case S: return s->s;
        case LIMIT: return &s->limit;
        case CALLS: return &s->calls;
        default: return NULL;
    }
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Float64 v[], size_t size) {
    Row *m = c;
    size_t done = 0;
    for (size_t k = 0; k < n; k++) {
        size_t many;
        const double *from = place(m, r[k], &many);
        if (r[k] == Y) {
            for (int i = 0; i < N; i++) v[done++] = m->state.gain[i] * m->state.u[i];
        } else if (r[k] == W) {
            for (size_t i = 0; i < m->state.m; i++) v[done++] = m->state.deep ? m->state.v[i] * m->state.t : -1;
        } else if (from) {
            memcpy(v + done, from, many * sizeof *v);
            done += many;
        } else {
            return refuse(m, "no Float64 %u", r[k]);
        }
    }
    return done == size ? fmi3OK : refuse(m, "%zu values for %zu", done, size);
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Float64 v[], size_t size) {
    Row *m = c;
    size_t done = 0;
    for (size_t k = 0; k < n; k++) {
        size_t many;
        double *to = place(m, r[k], &many);
        if (!to) return refuse(m, "Float64 %u cannot be set", r[k]);
        if (r[k] == U) m->state.calls++;
        memcpy(to, v + done, many * sizeof *v);
        done += many;
    }
    return done == size ? fmi3OK : refuse(m, "%zu values for %zu", done, size);
}

fmi3Status fmi3GetFloat32(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Float32 v[], size_t size) {
    if (n != 1 || size != 1 || r[0] != SINGLE) return fmi3Error;
    v[0] = (float)((Row *)c)->state.s[0];
    return fmi3OK;
}
fmi3Status fmi3GetInt8(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Int8 v[], size_t size) {
    if (n != 1 || size != 1 || r[0] != TINY) return fmi3Error;
    v[0] = ((Row *)c)->state.tiny;
    return fmi3OK;
}
fmi3Status fmi3SetInt8(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Int8 v[], size_t size) {
    if (n != 1 || size != 1 || r[0] != TINY) return fmi3Error;
    ((Row *)c)->state.tiny = v[0];
    return fmi3OK;
}
fmi3Status fmi3GetInt16(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Int16 v[], size_t size) {
    if (n != 1 || size != 1 || r[0] != STEPS) return fmi3Error;
    v[0] = (fmi3Int16)(-4 * ((Row *)c)->state.t);
    return fmi3OK;
}
fmi3Status fmi3GetBoolean(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Boolean v[], size_t size) {
    if (n != 1 || size != 2 || r[0] != MOVED) return fmi3Error;
    v[0] = false;
    v[1] = ((Row *)c)->state.t > 0;
    return fmi3OK;
}
fmi3Status fmi3SetInt16(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Int16 v[], size_t size) {
    if (n != 1 || size != 1 || r[0] != COUNT) return fmi3Error;
    ((Row *)c)->state.count = v[0];
    return fmi3OK;
}
fmi3Status fmi3SetBoolean(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Boolean v[], size_t size) {
    if (n == 1 && r[0] == DEEP && ((Row *)c)->state.configuring) {
        ((Row *)c)->state.deep = v[0];
        return fmi3OK;
    }
    if (n != 1 || size != 1 || r[0] != FLAG) return fmi3Error;
    ((Row *)c)->state.flag = v[0];
    return fmi3OK;
}
fmi3Status fmi3SetString(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3String v[], size_t size) {
    if (n != 1 || size != 1 || r[0] != LABEL) return fmi3Error;
    snprintf(((Row *)c)->state.label, sizeof ((Row *)c)->state.label, "%s", v[0]);
    return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean no_return, fmi3Boolean *event,
                      fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
    Row *m = c;
    State *s = &m->state;
    (void)no_return;
    if (t + h > 1e3) return refuse(m, "t = %g is too late", t + h);
    for (int i = 0; i < N; i++) s->s[i] += h * s->gain[i] * s->u[i];
    *last = s->t = t + h;
    *event = *early = false;
    *terminate = s->t > s->limit;
    return fmi3OK;
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
    if (!*state) *state = malloc(sizeof(State));
    memcpy(*state, &((Row *)c)->state, sizeof(State));
    return fmi3OK;
}
fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
    memcpy(&((Row *)c)->state, state, sizeof(State));
    return fmi3OK;
}
fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
    (void)c;
    free(*state);
    *state = NULL;
    return fmi3OK;
}

/* of y by u only: diagonal */
fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t rows,
                                        const fmi3ValueReference knowns[], size_t columns, const fmi3Float64 seed[],
                                        size_t seeds, fmi3Float64 sensitivity[], size_t sensitivities) {
    Row *m = c;
    if (rows != 1 || columns != 1 || unknowns[0] != Y || knowns[0] != U || seeds != N || sensitivities != N)
        return refuse(m, "derivatives of y by u only");
    for (int i = 0; i < N; i++) sensitivity[i] = m->state.gain[i] * seed[i];
    return fmi3OK;
}
/* of s only */
fmi3Status fmi3GetOutputDerivatives(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Int32 order[],
                                    fmi3Float64 v[], size_t size) {
    Row *m = c;
    if (n != 1 || r[0] != S || size != N) return refuse(m, "derivatives of s only");
    for (int i = 0; i < N; i++) v[i] = order[0] == 1 ? m->state.gain[i] * m->state.u[i] : 0.0;
    return fmi3OK;
}

/* FMI 3.0: every output is the input of its type, references count inputs from 0 and outputs from 10. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"

typedef struct {
    fmi3Float64 Float64;
    fmi3Int64 Int64;
    fmi3Boolean Boolean;
    char String[32];
    fmi3Byte Binary[8];
    size_t length;
    int steps;
} Values;

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                         const fmi3ValueReference required[], size_t n,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update) {
    return calloc(1, sizeof(Values));
}
void fmi3FreeInstance(fmi3Instance c) { free(c); }
fmi3Status fmi3Terminate(fmi3Instance c) { return fmi3OK; }
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean given, fmi3Float64 tolerance, fmi3Float64 start,
                                       fmi3Boolean limited, fmi3Float64 stop) {
    return fmi3OK;
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return fmi3OK; }

#define TYPE(T)                                                                                                    \
    fmi3Status fmi3Get##T(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3##T v[], size_t size) {      \
        for (size_t k = 0; k < size; k++) v[k] = ((Values *)c)->T;                                                 \
        return fmi3OK;                                                                                             \
    }                                                                                                              \
    fmi3Status fmi3Set##T(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3##T v[], size_t size) { \
        for (size_t k = 0; k < size; k++) ((Values *)c)->T = v[k];                                                 \
        return fmi3OK;                                                                                             \
    }
TYPE(Float64)
TYPE(Int64)
TYPE(Boolean)

fmi3Status fmi3GetString(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3String v[], size_t size) {
    Values *m = c;
    if (COUNTING) snprintf(m->String, sizeof m->String, "step %d", m->steps);
    for (size_t k = 0; k < size; k++) v[k] = m->String;
    return fmi3OK;
}
fmi3Status fmi3SetString(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3String v[], size_t size) {
    for (size_t k = 0; k < size; k++) snprintf(((Values *)c)->String, 32, "%s", v[k]);
    return fmi3OK;
}
fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference r[], size_t n, size_t sizes[], fmi3Binary v[],
                         size_t size) {
    Values *m = c;
    for (size_t k = 0; k < size; k++) {
        v[k] = m->Binary;
        sizes[k] = m->length;
    }
    return fmi3OK;
}
fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference r[], size_t n, const size_t sizes[],
                         const fmi3Binary v[], size_t size) {
    Values *m = c;
    m->length = sizes[0] < 8 ? sizes[0] : 8;
    memcpy(m->Binary, v[0], m->length);
    return fmi3OK;
}
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean last, fmi3Boolean *event,
                      fmi3Boolean *end, fmi3Boolean *early, fmi3Float64 *reached) {
    ((Values *)c)->steps++;
    *event = *end = *early = false;
    *reached = t + h;
    return fmi3OK;
}

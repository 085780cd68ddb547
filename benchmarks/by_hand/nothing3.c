/* An FMI 3.0 co-simulation FMU that does nothing: what is left is the call. */
#include <stdlib.h>
#include "fmi3Functions.h"

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                         const fmi3ValueReference required[], size_t n,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update) {
    (void)name; (void)token; (void)resources; (void)visible; (void)logging; (void)events; (void)early;
    (void)required; (void)n; (void)environment; (void)log; (void)update;
    return malloc(1);
}
void fmi3FreeInstance(fmi3Instance instance) { free(instance); }
fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 t, fmi3Float64 h, fmi3Boolean keep, fmi3Boolean *event,
                      fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
    (void)instance; (void)t; (void)h; (void)keep; (void)event; (void)terminate; (void)early; (void)last;
    return fmi3OK;
}

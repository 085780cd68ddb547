/* An FMU that does nothing: what is left is the call.  Its variables are an array, read and written by memcpy whatever
 * the references are; with BY_REFERENCE one by one, as FMUs written by hand do. */
#include <stdlib.h>
#include <string.h>
#include "fmi2Functions.h"

enum { COUNT = 1000 };

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real H, fmi2Boolean keep) {
    (void)c; (void)t; (void)H; (void)keep;
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    (void)name; (void)type; (void)guid; (void)resources; (void)functions; (void)visible; (void)logging;
    return calloc(COUNT, sizeof(double));
}
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
#ifdef BY_REFERENCE
    for (size_t i = 0; i < n; i++) value[i] = ((double *)c)[vr[i]];
#else
    (void)vr;
    memcpy(value, c, n * sizeof *value);
#endif
    return fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
#ifdef BY_REFERENCE
    for (size_t i = 0; i < n; i++) ((double *)c)[vr[i]] = value[i];
#else
    (void)vr;
    memcpy(c, value, n * sizeof *value);
#endif
    return fmi2OK;
}
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real d, fmi2Boolean e, fmi2Real f) {
    (void)c; (void)a; (void)b; (void)d; (void)e; (void)f;
    return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { (void)c; return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { (void)c; return fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) { (void)c; return fmi2OK; }

/* The functions of FMI 2.0: co-simulation and model exchange of one instance of core.h. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "calls.h"
#include "fmi_common.h"
#include "fmi2Functions.h"

typedef struct {
    FmiInstance common;
    fmi2CallbackLogger logger;
} Fmu;

enum { FMI2_CALLS(ALLOWED) };

/* ---- what it has in common with FMI 3.0, under that one's names -------------------------------------------- */

#define fmi2GetFMUState fmi2GetFMUstate
#define fmi2SetFMUState fmi2SetFMUstate
#define fmi2FreeFMUState fmi2FreeFMUstate
#define fmi2SerializedFMUStateSize fmi2SerializedFMUstateSize
#define fmi2SerializeFMUState fmi2SerializeFMUstate
#define fmi2DeserializeFMUState fmi2DeSerializeFMUstate
#define fmi2GetContinuousStateDerivatives fmi2GetDerivatives

#define FMI(name) fmi2##name
#define STATUS fmi2Status
#define INSTANCE fmi2Component
#define BOOLEAN fmi2Boolean
#define BYTE fmi2Byte
#include "fmi_functions.h"

/* ---- life -------------------------------------------------------------------------------------------------- */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

static void write(const FmiInstance *fmu, Status status, const char *category, const char *text) {
    ((const Fmu *)fmu)->logger(fmu->environment, fmu->name, (fmi2Status)status, category, text);
}

enum { PATH = 4096 };

/* The path that a URI stands for, file:///directory; NULL if it is too long, or none of a file. */
static const char *path_in(const char *uri, char path[PATH]) {
    size_t length = 0;
    if (uri == NULL || strncmp(uri, "file:", 5) != 0) return NULL;
    uri += 5;
    if (strncmp(uri, "//", 2) == 0) uri += 2 + strcspn(uri + 2, "/"); /* and the host */
    if (uri[0] == '/' && uri[1] != '\0' && uri[2] == ':') uri++;     /* /C:/directory */
    for (; *uri && length + 1 < PATH; uri++) {
        unsigned byte = (unsigned char)*uri;
        if (byte == '%' && sscanf(uri, "%%%2x", &byte) == 1) uri += 2;
        path[length++] = (char)byte;
    }
    path[length] = '\0';
    return *uri == '\0' ? path : NULL;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    char path[PATH];
    (void)visible;
    if (functions == NULL) return NULL;
    const Fmu fmu = {
        .common = {.name = (char *)(name ? name : ""),
                 .environment = functions->componentEnvironment,
                 .write = functions->logger ? write : NULL,
                 .marks = "%#", /* some importers print the text with printf, and references #r1# are replaced */
                 .always = REFUSALS,
                 .logged = logging ? EVERYTHING : 0},
        .logger = functions->logger,
    };
    const Options options = {.use = type == fmi2ModelExchange ? USE_MODEL_EXCHANGE : USE_CO_SIMULATION};
    return fmi_instantiate(&fmu.common, sizeof fmu, name, guid, path_in(resources, path), options, __func__);
}

fmi2Status fmi2SetupExperiment(fmi2Component instance, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                               fmi2Real start, fmi2Boolean stop_defined, fmi2Real stop) {
    ENTER(SetupExperiment);
    return (fmi2Status)core_setup(core, start, stop_defined ? &stop : NULL, tolerance_defined ? tolerance : 0);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component instance) {
    ENTER(EnterInitializationMode);
    core_enter_initialization(core);
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component instance) {
    ENTER(Reset);
    return (fmi2Status)fmi_reset(&fmu->common);
}

/* ---- variables --------------------------------------------------------------------------------------------- */

fmi2Status fmi2GetReal(fmi2Component instance, const fmi2ValueReference references[], size_t n, fmi2Real values[]) {
    ENTER(GetFloat64);
    if (n == 0) return fmi2OK;
    NEED(references);
    NEED(values);
    return (fmi2Status)core_get(core, references, n, values, n);
}

fmi2Status fmi2SetReal(fmi2Component instance, const fmi2ValueReference references[], size_t n,
                       const fmi2Real values[]) {
    ENTER(SetFloat64);
    if (n == 0) return fmi2OK;
    NEED(references);
    NEED(values);
    return (fmi2Status)core_set(core, references, n, values, n);
}

fmi2Status fmi2GetInteger(fmi2Component instance, const fmi2ValueReference references[], size_t n,
                          fmi2Integer values[]) {
    ENTER(GetInt32);
    if (n == 0) return fmi2OK;
    NEED(references);
    NEED(values);
    for (size_t i = 0; i < n; i++) {
        const Dimension *dimension = core_dimension(core, references[i]);
        if (dimension != NULL) values[i] = (int)dimension->count;
        if (dimension != NULL) continue;
        double value = 0;
        const Status status = core_get_typed(core, NUMBER_INTEGER, references[i], 0, &value);
        if (status != SUCCESS) return (fmi2Status)status;
        values[i] = (int)fmax(INT32_MIN, fmin(value, INT32_MAX));
    }
    return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component instance, const fmi2ValueReference references[], size_t n,
                          const fmi2Integer values[]) {
    ENTER(SetInt32);
    if (n == 0) return fmi2OK;
    NEED(references);
    NEED(values);
    return (fmi2Status)core_set_settings(core, references, n, values);
}

/* Types of which there are no variables. */
#define NONE_OF(Type)                                                                                                \
    fmi2Status fmi2Get##Type(fmi2Component instance, const fmi2ValueReference references[], size_t n,                \
                             fmi2##Type values[]) {                                                                  \
        (void)references, (void)values;                                                                              \
        ENTER(GetNONE);                                                                                              \
        return (fmi2Status)fmi_check_no_variables(&fmu->common, n, #Type);                                           \
    }                                                                                                                \
    fmi2Status fmi2Set##Type(fmi2Component instance, const fmi2ValueReference references[], size_t n,                \
                             const fmi2##Type values[]) {                                                            \
        (void)references, (void)values;                                                                              \
        ENTER(SetNONE);                                                                                              \
        return (fmi2Status)fmi_check_no_variables(&fmu->common, n, #Type);                                           \
    }

fmi2Status fmi2GetBoolean(fmi2Component instance, const fmi2ValueReference references[], size_t n,
                          fmi2Boolean values[]) {
    ENTER(GetInt32);
    if (n == 0 || model.indicators == 0) return (fmi2Status)fmi_check_no_variables(&fmu->common, n, "Boolean");
    NEED(references);
    NEED(values);
    return get_booleans(core, references, n, values);
}

fmi2Status fmi2SetBoolean(fmi2Component instance, const fmi2ValueReference references[], size_t n,
                          const fmi2Boolean values[]) {
    ENTER(SetInt32);
    if (n == 0 || model.indicators == 0) return (fmi2Status)fmi_check_no_variables(&fmu->common, n, "Boolean");
    NEED(references);
    NEED(values);
    return (fmi2Status)core_refuse_typed(core, NUMBER_BOOLEAN, references[0], values[0]);
}

NONE_OF(String)

fmi2Status fmi2GetDirectionalDerivative(fmi2Component instance, const fmi2ValueReference unknowns[], size_t n_unknown,
                                        const fmi2ValueReference knowns[], size_t n_known, const fmi2Real direction[],
                                        fmi2Real derivatives[]) {
    ENTER(GetDirectionalDerivative);
    if (n_known > 0) NEED(knowns);
    if (n_known > 0) NEED(direction);
    if (n_unknown == 0) return fmi2OK;
    NEED(unknowns);
    NEED(derivatives);
    return (fmi2Status)core_directional_derivative(core, unknowns, n_unknown, knowns, n_known, direction, n_known,
                                                   derivatives, n_unknown);
}

/* ---- co-simulation ----------------------------------------------------------------------------------------- */

fmi2Status fmi2SetRealInputDerivatives(fmi2Component instance, const fmi2ValueReference references[], size_t n,
                                       const fmi2Integer orders[], const fmi2Real values[]) {
    ENTER(SetRealInputDerivatives);
    if (n == 0) return fmi2OK;
    NEED(references);
    NEED(orders);
    NEED(values);
    return (fmi2Status)core_set_input_derivatives(core, references, n, orders, values);
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component instance, const fmi2ValueReference references[], size_t n,
                                        const fmi2Integer orders[], fmi2Real values[]) {
    ENTER(GetOutputDerivatives);
    if (n == 0) return fmi2OK;
    NEED(references);
    NEED(orders);
    NEED(values);
    for (size_t i = 0; i < n; i++)
        if (orders[i] != 1)
            return (fmi2Status)core_report(core, ERROR, "output derivatives of order %d: the order must be 1",
                                           orders[i]);
    return (fmi2Status)core_output_derivatives(core, references, n, values, n);
}

fmi2Status fmi2DoStep(fmi2Component instance, fmi2Real time, fmi2Real size, fmi2Boolean no_way_back) {
    (void)no_way_back;
    ENTER(DoStep);
    Arrival arrival;
    return (fmi2Status)fmi_told(&fmu->common, core_step(core, time, size, &arrival));
}

fmi2Status fmi2CancelStep(fmi2Component instance) {
    ENTER(CancelStep);
    return (fmi2Status)core_report(core, ERROR, "fmi2CancelStep: no step is under way");
}

static fmi2Status no_status(Instance *core, fmi2StatusKind kind) {
    return (fmi2Status)core_report(core, DISCARD, "status of kind %d: there is none, steps are never pending",
                                   (int)kind);
}

fmi2Status fmi2GetStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Status *value) {
    (void)value;
    ENTER(Status);
    return no_status(core, kind);
}

fmi2Status fmi2GetRealStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Real *value) {
    ENTER(Status);
    NEED(value);
    if (kind != fmi2LastSuccessfulTime) return no_status(core, kind);
    *value = core_time(core);
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Integer *value) {
    (void)value;
    ENTER(Status);
    return no_status(core, kind);
}

fmi2Status fmi2GetBooleanStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2Boolean *value) {
    ENTER(Status);
    NEED(value);
    if (kind != fmi2Terminated) return no_status(core, kind);
    *value = fmi2False; /* the component never asks for the end of the simulation */
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component instance, const fmi2StatusKind kind, fmi2String *value) {
    (void)value;
    ENTER(Status);
    return no_status(core, kind);
}

/* ---- model exchange ---------------------------------------------------------------------------------------- */

fmi2Status fmi2NewDiscreteStates(fmi2Component instance, fmi2EventInfo *info) {
    ENTER(UpdateDiscreteStates);
    NEED(info);
    double next = INFINITY;
    int changed = 0;
    const Status status = core_update_discrete_states(core, &changed, &next);
    info->newDiscreteStatesNeeded = fmi2False;
    info->terminateSimulation = fmi2False;
    info->nominalsOfContinuousStatesChanged = fmi2False;
    info->valuesOfContinuousStatesChanged = changed ? fmi2True : fmi2False;
    info->nextEventTimeDefined = next < INFINITY ? fmi2True : fmi2False;
    info->nextEventTime = next;
    return (fmi2Status)status;
}


/* The face that FMI 2.0 shows: co-simulation and model exchange of one instance of core.h. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "face.h"
#include "fmi2Functions.h"

typedef struct {
    Face face;
    fmi2CallbackLogger logger;
} Fmu;

enum {
    BEFORE = INSTANTIATED | INITIALIZATION,
    RUNNING = EVENT | CONTINUOUS | STEP,
    ANY = BEFORE | RUNNING | TERMINATED,
    READABLE = ANY & ~INSTANTIATED
};

#define ENTER(phases)                                   \
    Fmu *fmu = face_enter(component, phases, __func__); \
    if (fmu == NULL) return fmi2Error;                  \
    Instance *core = fmu->face.core;                    \
    (void)core

#define NEED(argument) \
    if ((argument) == NULL && !face_given(&fmu->face, argument, #argument, __func__)) return fmi2Error

/* ---- life -------------------------------------------------------------------------------------------------- */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

static void write(const Face *face, Status status, const char *category, const char *text) {
    ((const Fmu *)face)->logger(face->environment, face->name, (fmi2Status)status, category, text);
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
        .face = {.name = (char *)(name ? name : ""),
                 .environment = functions->componentEnvironment,
                 .write = functions->logger ? write : NULL,
                 .marks = "%#", /* some importers print the text with printf, and references #r1# are replaced */
                 .always = REFUSALS,
                 .logged = logging ? EVERYTHING : 0},
        .logger = functions->logger,
    };
    const Options options = {.use = type == fmi2ModelExchange ? USE_MODEL_EXCHANGE : USE_CO_SIMULATION};
    return face_open(&fmu.face, sizeof fmu, name, guid, path_in(resources, path), options, __func__);
}

void fmi2FreeInstance(fmi2Component component) { face_close(component); }

fmi2Status fmi2SetDebugLogging(fmi2Component component, fmi2Boolean logging, size_t n, const fmi2String categories[]) {
    ENTER(ANY);
    if (n > 0) NEED(categories);
    return (fmi2Status)face_set_logging(&fmu->face, logging, n, categories);
}

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                               fmi2Real start, fmi2Boolean stop_defined, fmi2Real stop) {
    ENTER(INSTANTIATED);
    return (fmi2Status)core_setup(core, start, stop_defined ? &stop : NULL, tolerance_defined ? tolerance : 0);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component) {
    ENTER(INSTANTIATED);
    core_enter_initialization(core);
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component component) {
    ENTER(INITIALIZATION);
    return (fmi2Status)core_exit_initialization(core);
}

fmi2Status fmi2Terminate(fmi2Component component) {
    ENTER(RUNNING);
    core_terminate(core);
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component component) {
    ENTER(ANY);
    return (fmi2Status)face_reset(&fmu->face);
}

/* ---- variables --------------------------------------------------------------------------------------------- */

fmi2Status fmi2GetReal(fmi2Component component, const fmi2ValueReference references[], size_t n, fmi2Real values[]) {
    ENTER(ANY);
    if (n == 0) return fmi2OK;
    NEED(references);
    NEED(values);
    return (fmi2Status)core_get(core, references, n, values, n);
}

fmi2Status fmi2SetReal(fmi2Component component, const fmi2ValueReference references[], size_t n,
                       const fmi2Real values[]) {
    ENTER(BEFORE | RUNNING);
    if (n == 0) return fmi2OK;
    NEED(references);
    NEED(values);
    return (fmi2Status)core_set(core, references, n, values, n);
}

fmi2Status fmi2GetInteger(fmi2Component component, const fmi2ValueReference references[], size_t n,
                          fmi2Integer values[]) {
    ENTER(ANY);
    if (n == 0) return fmi2OK;
    NEED(references);
    NEED(values);
    for (size_t i = 0; i < n; i++) {
        const Dimension *dimension = core_dimension(core, references[i]);
        if (dimension != NULL) values[i] = (int)dimension->count;
        else if (core_get_setting(core, references[i], &values[i]) != SUCCESS) return fmi2Error;
    }
    return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component component, const fmi2ValueReference references[], size_t n,
                          const fmi2Integer values[]) {
    ENTER(BEFORE | RUNNING);
    if (n == 0) return fmi2OK;
    NEED(references);
    NEED(values);
    return (fmi2Status)core_set_settings(core, references, n, values);
}

fmi2Status fmi2GetBoolean(fmi2Component component, const fmi2ValueReference references[], size_t n,
                          fmi2Boolean values[]) {
    (void)references;
    (void)values;
    ENTER(ANY);
    return (fmi2Status)face_has_none(&fmu->face, n, "Boolean");
}

fmi2Status fmi2SetBoolean(fmi2Component component, const fmi2ValueReference references[], size_t n,
                          const fmi2Boolean values[]) {
    (void)references;
    (void)values;
    ENTER(BEFORE | RUNNING);
    return (fmi2Status)face_has_none(&fmu->face, n, "Boolean");
}

fmi2Status fmi2GetString(fmi2Component component, const fmi2ValueReference references[], size_t n,
                         fmi2String values[]) {
    (void)references;
    (void)values;
    ENTER(ANY);
    return (fmi2Status)face_has_none(&fmu->face, n, "String");
}

fmi2Status fmi2SetString(fmi2Component component, const fmi2ValueReference references[], size_t n,
                         const fmi2String values[]) {
    (void)references;
    (void)values;
    ENTER(BEFORE | RUNNING);
    return (fmi2Status)face_has_none(&fmu->face, n, "String");
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component component, const fmi2ValueReference unknowns[], size_t n_unknown,
                                        const fmi2ValueReference knowns[], size_t n_known, const fmi2Real direction[],
                                        fmi2Real derivatives[]) {
    ENTER(READABLE);
    if (n_known > 0) NEED(knowns);
    if (n_known > 0) NEED(direction);
    if (n_unknown == 0) return fmi2OK;
    NEED(unknowns);
    NEED(derivatives);
    return (fmi2Status)core_directional_derivative(core, unknowns, n_unknown, knowns, n_known, direction, n_known,
                                                   derivatives, n_unknown);
}

/* ---- saved states ------------------------------------------------------------------------------------------ */

fmi2Status fmi2GetFMUstate(fmi2Component component, fmi2FMUstate *state) {
    ENTER(ANY);
    NEED(state);
    return (fmi2Status)face_save(&fmu->face, state, __func__);
}

fmi2Status fmi2SetFMUstate(fmi2Component component, fmi2FMUstate state) {
    ENTER(ANY);
    NEED(state);
    return (fmi2Status)face_restore(&fmu->face, state);
}

fmi2Status fmi2FreeFMUstate(fmi2Component component, fmi2FMUstate *state) {
    ENTER(ANY);
    face_drop(state);
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component component, fmi2FMUstate state, size_t *size) {
    ENTER(ANY);
    NEED(state);
    NEED(size);
    *size = face_size(state);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component component, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    ENTER(ANY);
    NEED(state);
    NEED(bytes);
    return (fmi2Status)face_serialize(&fmu->face, state, bytes, size, __func__);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component component, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    ENTER(ANY);
    NEED(bytes);
    NEED(state);
    return (fmi2Status)face_deserialize(&fmu->face, bytes, size, state, __func__);
}

/* ---- co-simulation ----------------------------------------------------------------------------------------- */

fmi2Status fmi2SetRealInputDerivatives(fmi2Component component, const fmi2ValueReference references[], size_t n,
                                       const fmi2Integer orders[], const fmi2Real values[]) {
    ENTER(BEFORE | STEP);
    if (n == 0) return fmi2OK;
    NEED(references);
    NEED(orders);
    NEED(values);
    return (fmi2Status)core_set_input_derivatives(core, references, n, orders, values);
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component component, const fmi2ValueReference references[], size_t n,
                                        const fmi2Integer orders[], fmi2Real values[]) {
    ENTER(STEP | TERMINATED);
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

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real time, fmi2Real size, fmi2Boolean no_way_back) {
    (void)no_way_back;
    ENTER(STEP);
    Arrival arrival;
    return (fmi2Status)core_step(core, time, size, &arrival);
}

fmi2Status fmi2CancelStep(fmi2Component component) {
    ENTER(STEP);
    return (fmi2Status)core_report(core, ERROR, "fmi2CancelStep: no step is under way");
}

static fmi2Status no_status(Instance *core, fmi2StatusKind kind) {
    return (fmi2Status)core_report(core, DISCARD, "status of kind %d: there is none, steps are never pending",
                                   (int)kind);
}

fmi2Status fmi2GetStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Status *value) {
    (void)value;
    ENTER(STEP | TERMINATED);
    return no_status(core, kind);
}

fmi2Status fmi2GetRealStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Real *value) {
    ENTER(STEP | TERMINATED);
    NEED(value);
    if (kind != fmi2LastSuccessfulTime) return no_status(core, kind);
    *value = core_time(core);
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Integer *value) {
    (void)value;
    ENTER(STEP | TERMINATED);
    return no_status(core, kind);
}

fmi2Status fmi2GetBooleanStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Boolean *value) {
    ENTER(STEP | TERMINATED);
    NEED(value);
    if (kind != fmi2Terminated) return no_status(core, kind);
    *value = fmi2False; /* the component never asks for the end of the simulation */
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component component, const fmi2StatusKind kind, fmi2String *value) {
    (void)value;
    ENTER(STEP | TERMINATED);
    return no_status(core, kind);
}

/* ---- model exchange ---------------------------------------------------------------------------------------- */

fmi2Status fmi2EnterEventMode(fmi2Component component) {
    ENTER(EVENT | CONTINUOUS);
    core_enter_event_mode(core);
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component component, fmi2EventInfo *info) {
    ENTER(EVENT);
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

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component component) {
    ENTER(EVENT);
    core_enter_continuous_mode(core);
    return fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component component, fmi2Boolean no_way_back, fmi2Boolean *event,
                                       fmi2Boolean *terminate) {
    (void)no_way_back;
    ENTER(CONTINUOUS);
    NEED(event);
    NEED(terminate);
    *event = fmi2False;
    *terminate = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component component, fmi2Real time) {
    ENTER(EVENT | CONTINUOUS);
    return (fmi2Status)core_set_time(core, time);
}

fmi2Status fmi2SetContinuousStates(fmi2Component component, const fmi2Real states[], size_t n) {
    ENTER(CONTINUOUS);
    if (face_check_count(&fmu->face, n, model.states, "states") != SUCCESS) return fmi2Error;
    if (n == 0) return fmi2OK;
    NEED(states);
    return (fmi2Status)core_set_states(core, states);
}

fmi2Status fmi2GetContinuousStates(fmi2Component component, fmi2Real states[], size_t n) {
    ENTER(READABLE);
    if (face_check_count(&fmu->face, n, model.states, "states") != SUCCESS) return fmi2Error;
    if (n == 0) return fmi2OK;
    NEED(states);
    return (fmi2Status)core_get_states(core, states);
}

fmi2Status fmi2GetDerivatives(fmi2Component component, fmi2Real derivatives[], size_t n) {
    ENTER(READABLE);
    if (face_check_count(&fmu->face, n, model.states, "derivatives of states") != SUCCESS) return fmi2Error;
    if (n == 0) return fmi2OK;
    NEED(derivatives);
    return (fmi2Status)core_get_derivatives(core, derivatives);
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component component, fmi2Real nominals[], size_t n) {
    ENTER(ANY);
    if (face_check_count(&fmu->face, n, model.states, "nominal values of states") != SUCCESS) return fmi2Error;
    if (n == 0) return fmi2OK;
    NEED(nominals);
    core_get_nominals(core, nominals);
    return fmi2OK;
}

fmi2Status fmi2GetEventIndicators(fmi2Component component, fmi2Real indicators[], size_t n) {
    (void)indicators;
    ENTER(READABLE);
    return (fmi2Status)face_check_count(&fmu->face, n, 0, "event indicators");
}

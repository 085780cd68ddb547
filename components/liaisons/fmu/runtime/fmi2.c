/* The face that FMI 2.0 shows: co-simulation and model exchange of one instance of core.h. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core.h"
#include "fmi2Functions.h"

typedef struct {
    Instance *core;
    char *name;
    fmi2CallbackLogger logger;
    void *environment;
    fmi2Boolean logging;
} Fmu;

typedef struct { /* what a fmi2FMUstate points to */
    size_t size;
    unsigned char bytes[];
} Saved;

enum {
    BEFORE = INSTANTIATED | INITIALIZATION,
    RUNNING = EVENT | CONTINUOUS | STEP,
    ANY = BEFORE | RUNNING | TERMINATED,
    READABLE = ANY & ~INSTANTIATED
};

static const char *const CATEGORIES[] = {"", "logStatusWarning", "logStatusDiscard", "logStatusError"};

/* ---- messages ---------------------------------------------------------------------------------------------- */

/* The text is printed with printf by some importers and has references #r1# replaced: both marks are doubled. */
static void log_text(const Fmu *fmu, Status status, const char *text) {
    char message[1024];
    size_t length = 0;
    for (; *text && length + 2 < sizeof message; text++) {
        if (*text == '%' || *text == '#') message[length++] = *text;
        message[length++] = *text;
    }
    message[length] = '\0';
    fmu->logger(fmu->environment, fmu->name, (fmi2Status)status, CATEGORIES[status], message);
}

static void report(void *owner, Status status, const char *text) {
    const Fmu *fmu = owner;
    if (fmu->logger && (status > WARNING || fmu->logging)) log_text(fmu, status, text);
}

static const char *phase_name(Phase phase) {
    switch (phase) {
    case INSTANTIATED: return "before initialization";
    case INITIALIZATION: return "in initialization mode";
    case EVENT: return "in event mode";
    case CONTINUOUS: return "in continuous-time mode";
    case STEP: return "between communication steps";
    default: return "after termination";
    }
}

/* ---- checks that all functions share ----------------------------------------------------------------------- */

/* The instance if the function may be called in its phase, else NULL. */
static Fmu *enter(fmi2Component component, unsigned phases, const char *function) {
    Fmu *fmu = component;
    if (fmu == NULL || ((unsigned)core_phase(fmu->core) & phases)) return fmu;
    core_report(fmu->core, ERROR, "%s must not be called %s", function, phase_name(core_phase(fmu->core)));
    return NULL;
}

static int given(const Fmu *fmu, const void *argument, const char *name, const char *function) {
    if (argument == NULL) core_report(fmu->core, ERROR, "%s: argument %s is NULL", function, name);
    return argument != NULL;
}

#define ENTER(phases)                                \
    Fmu *fmu = enter(component, phases, __func__); \
    if (fmu == NULL) return fmi2Error

#define NEED(argument) \
    if (!given(fmu, argument, #argument, __func__)) return fmi2Error

static fmi2Status has_none(const Fmu *fmu, size_t n, const char *type) {
    if (n == 0) return fmi2OK;
    core_report(fmu->core, ERROR, "there are no variables of type %s", type);
    return fmi2Error;
}

/* ---- life -------------------------------------------------------------------------------------------------- */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    (void)resources;
    (void)visible;
    Fmu early = {.name = (char *)(name ? name : ""), .logging = logging};
    if (functions == NULL) return NULL;
    early.logger = functions->logger;
    early.environment = functions->componentEnvironment;
    if (name == NULL || *name == '\0') {
        report(&early, ERROR, "fmi2Instantiate: the instance name is missing");
        return NULL;
    }
    if (guid == NULL || strcmp(guid, model.guid) != 0) {
        report(&early, ERROR, "fmi2Instantiate: the guid of the model description is not that of the binary");
        return NULL;
    }
    Fmu *fmu = malloc(sizeof *fmu);
    if (fmu != NULL) {
        *fmu = early;
        fmu->name = malloc(strlen(name) + 1);
        fmu->core = core_new(&model, type == fmi2ModelExchange, report, fmu);
    }
    if (fmu == NULL || fmu->name == NULL || fmu->core == NULL) {
        report(&early, ERROR, "fmi2Instantiate: out of memory");
        fmi2FreeInstance(fmu);
        return NULL;
    }
    strcpy(fmu->name, name);
    return fmu;
}

void fmi2FreeInstance(fmi2Component component) {
    Fmu *fmu = component;
    if (fmu == NULL) return;
    core_free(fmu->core);
    free(fmu->name);
    free(fmu);
}

fmi2Status fmi2SetDebugLogging(fmi2Component component, fmi2Boolean logging, size_t n, const fmi2String categories[]) {
    ENTER(ANY);
    if (n > 0) NEED(categories);
    fmi2Boolean warnings = n == 0;
    for (size_t i = 0; i < n; i++) {
        size_t known = ERROR;
        while (known > 0 && (categories[i] == NULL || strcmp(categories[i], CATEGORIES[known]) != 0)) known--;
        if (known == 0) {
            core_report(fmu->core, ERROR, "there is no log category %s", categories[i] ? categories[i] : "NULL");
            return fmi2Error;
        }
        warnings |= known == WARNING;
    }
    if (warnings) fmu->logging = logging; /* what was refused is always said */
    return fmi2OK;
}

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                               fmi2Real start, fmi2Boolean stop_defined, fmi2Real stop) {
    ENTER(INSTANTIATED);
    if (stop_defined && !(stop >= start)) {
        core_report(fmu->core, ERROR, "stop time = %g lies before start time = %g", stop, start);
        return fmi2Error;
    }
    return (fmi2Status)core_setup(fmu->core, start, tolerance_defined ? tolerance : 0);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component) {
    ENTER(INSTANTIATED);
    core_enter_initialization(fmu->core);
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component component) {
    ENTER(INITIALIZATION);
    return (fmi2Status)core_exit_initialization(fmu->core);
}

fmi2Status fmi2Terminate(fmi2Component component) {
    ENTER(RUNNING);
    core_terminate(fmu->core);
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component component) {
    ENTER(ANY);
    core_reset(fmu->core);
    return fmi2OK;
}

/* ---- variables --------------------------------------------------------------------------------------------- */

fmi2Status fmi2GetReal(fmi2Component component, const fmi2ValueReference references[], size_t n, fmi2Real values[]) {
    ENTER(ANY);
    if (n == 0) return fmi2OK;
    NEED(references);
    NEED(values);
    return (fmi2Status)core_get(fmu->core, references, n, values);
}

fmi2Status fmi2SetReal(fmi2Component component, const fmi2ValueReference references[], size_t n,
                       const fmi2Real values[]) {
    ENTER(BEFORE | RUNNING);
    if (n == 0) return fmi2OK;
    NEED(references);
    NEED(values);
    return (fmi2Status)core_set(fmu->core, references, n, values);
}

fmi2Status fmi2GetInteger(fmi2Component component, const fmi2ValueReference references[], size_t n,
                          fmi2Integer values[]) {
    ENTER(ANY);
    if (n == 0) return fmi2OK;
    NEED(references);
    NEED(values);
    for (size_t i = 0; i < n; i++)
        if (core_get_reconstruction(fmu->core, references[i], &values[i]) != SUCCESS) return fmi2Error;
    return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component component, const fmi2ValueReference references[], size_t n,
                          const fmi2Integer values[]) {
    ENTER(BEFORE | RUNNING);
    if (n == 0) return fmi2OK;
    NEED(references);
    NEED(values);
    for (size_t i = 0; i < n; i++)
        if (core_set_reconstruction(fmu->core, references[i], values[i]) != SUCCESS) return fmi2Error;
    return fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component component, const fmi2ValueReference references[], size_t n,
                          fmi2Boolean values[]) {
    (void)references;
    (void)values;
    ENTER(ANY);
    return has_none(fmu, n, "Boolean");
}

fmi2Status fmi2SetBoolean(fmi2Component component, const fmi2ValueReference references[], size_t n,
                          const fmi2Boolean values[]) {
    (void)references;
    (void)values;
    ENTER(BEFORE | RUNNING);
    return has_none(fmu, n, "Boolean");
}

fmi2Status fmi2GetString(fmi2Component component, const fmi2ValueReference references[], size_t n,
                         fmi2String values[]) {
    (void)references;
    (void)values;
    ENTER(ANY);
    return has_none(fmu, n, "String");
}

fmi2Status fmi2SetString(fmi2Component component, const fmi2ValueReference references[], size_t n,
                         const fmi2String values[]) {
    (void)references;
    (void)values;
    ENTER(BEFORE | RUNNING);
    return has_none(fmu, n, "String");
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
    return (fmi2Status)core_directional_derivative(fmu->core, unknowns, n_unknown, knowns, n_known, direction,
                                                   derivatives);
}

/* ---- saved states ------------------------------------------------------------------------------------------ */

static Saved *reserve(fmi2FMUstate *state, size_t size) {
    Saved *saved = *state;
    if (saved != NULL && saved->size == size) return saved;
    saved = realloc(saved, sizeof *saved + size);
    if (saved != NULL) {
        saved->size = size;
        *state = saved;
    }
    return saved;
}

fmi2Status fmi2GetFMUstate(fmi2Component component, fmi2FMUstate *state) {
    ENTER(ANY);
    NEED(state);
    Saved *saved = reserve(state, core_state_size(fmu->core));
    if (saved == NULL) return (fmi2Status)core_report(fmu->core, ERROR, "fmi2GetFMUstate: out of memory");
    core_save(fmu->core, saved->bytes);
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component component, fmi2FMUstate state) {
    ENTER(ANY);
    NEED(state);
    const Saved *saved = state;
    return (fmi2Status)core_restore(fmu->core, saved->bytes, saved->size);
}

fmi2Status fmi2FreeFMUstate(fmi2Component component, fmi2FMUstate *state) {
    ENTER(ANY);
    if (state == NULL) return fmi2OK;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component component, fmi2FMUstate state, size_t *size) {
    ENTER(ANY);
    NEED(state);
    NEED(size);
    *size = ((const Saved *)state)->size;
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component component, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    ENTER(ANY);
    NEED(state);
    NEED(bytes);
    const Saved *saved = state;
    if (size < saved->size)
        return (fmi2Status)core_report(fmu->core, ERROR, "fmi2SerializeFMUstate: %lu bytes are too few, %lu are needed",
                                       (unsigned long)size, (unsigned long)saved->size);
    memcpy(bytes, saved->bytes, saved->size);
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component component, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    ENTER(ANY);
    NEED(bytes);
    NEED(state);
    if (core_check_state(fmu->core, bytes, size) != SUCCESS) return fmi2Error;
    Saved *saved = reserve(state, size);
    if (saved == NULL) return (fmi2Status)core_report(fmu->core, ERROR, "fmi2DeSerializeFMUstate: out of memory");
    memcpy(saved->bytes, bytes, size);
    return fmi2OK;
}

/* ---- co-simulation ----------------------------------------------------------------------------------------- */

fmi2Status fmi2SetRealInputDerivatives(fmi2Component component, const fmi2ValueReference references[], size_t n,
                                       const fmi2Integer order[], const fmi2Real values[]) {
    ENTER(BEFORE | STEP);
    if (n == 0) return fmi2OK;
    NEED(references);
    NEED(order);
    NEED(values);
    return (fmi2Status)core_set_input_derivatives(fmu->core, references, n, order, values);
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component component, const fmi2ValueReference references[], size_t n,
                                        const fmi2Integer order[], fmi2Real values[]) {
    ENTER(STEP | TERMINATED);
    if (n == 0) return fmi2OK;
    NEED(references);
    NEED(order);
    NEED(values);
    for (size_t i = 0; i < n; i++)
        if (order[i] != 1)
            return (fmi2Status)core_report(fmu->core, ERROR, "output derivatives of order %d: the order must be 1",
                                           order[i]);
    return (fmi2Status)core_output_derivatives(fmu->core, references, n, values);
}

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real time, fmi2Real size, fmi2Boolean no_way_back) {
    (void)no_way_back;
    ENTER(STEP);
    return (fmi2Status)core_step(fmu->core, time, size);
}

fmi2Status fmi2CancelStep(fmi2Component component) {
    ENTER(STEP);
    return (fmi2Status)core_report(fmu->core, ERROR, "fmi2CancelStep: no step is under way");
}

static fmi2Status no_status(Fmu *fmu, fmi2StatusKind kind) {
    return (fmi2Status)core_report(fmu->core, DISCARD, "status of kind %d: there is none, steps are never pending",
                                   (int)kind);
}

fmi2Status fmi2GetStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Status *value) {
    (void)value;
    ENTER(STEP | TERMINATED);
    return no_status(fmu, kind);
}

fmi2Status fmi2GetRealStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Real *value) {
    ENTER(STEP | TERMINATED);
    NEED(value);
    if (kind != fmi2LastSuccessfulTime) return no_status(fmu, kind);
    *value = core_time(fmu->core);
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Integer *value) {
    (void)value;
    ENTER(STEP | TERMINATED);
    return no_status(fmu, kind);
}

fmi2Status fmi2GetBooleanStatus(fmi2Component component, const fmi2StatusKind kind, fmi2Boolean *value) {
    ENTER(STEP | TERMINATED);
    NEED(value);
    if (kind != fmi2Terminated) return no_status(fmu, kind);
    *value = fmi2False; /* the component never asks for the end of the simulation */
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component component, const fmi2StatusKind kind, fmi2String *value) {
    (void)value;
    ENTER(STEP | TERMINATED);
    return no_status(fmu, kind);
}

/* ---- model exchange ---------------------------------------------------------------------------------------- */

static fmi2Status check_count(const Fmu *fmu, size_t n, size_t expected, const char *what) {
    if (n == expected) return fmi2OK;
    core_report(fmu->core, ERROR, "%lu %s: there are %lu", (unsigned long)n, what, (unsigned long)expected);
    return fmi2Error;
}

fmi2Status fmi2EnterEventMode(fmi2Component component) {
    ENTER(EVENT | CONTINUOUS);
    core_enter_event_mode(fmu->core);
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component component, fmi2EventInfo *info) {
    ENTER(EVENT);
    NEED(info);
    double next;
    info->newDiscreteStatesNeeded = fmi2False;
    info->terminateSimulation = fmi2False;
    info->nominalsOfContinuousStatesChanged = fmi2False;
    info->valuesOfContinuousStatesChanged = core_update_discrete_states(fmu->core, &next) ? fmi2True : fmi2False;
    info->nextEventTimeDefined = next < INFINITY ? fmi2True : fmi2False;
    info->nextEventTime = next;
    return fmi2OK;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component component) {
    ENTER(EVENT);
    core_enter_continuous_mode(fmu->core);
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
    return (fmi2Status)core_set_time(fmu->core, time);
}

fmi2Status fmi2SetContinuousStates(fmi2Component component, const fmi2Real states[], size_t n) {
    ENTER(CONTINUOUS);
    if (check_count(fmu, n, model.states, "states") != fmi2OK) return fmi2Error;
    if (n == 0) return fmi2OK;
    NEED(states);
    return (fmi2Status)core_set_states(fmu->core, states);
}

fmi2Status fmi2GetContinuousStates(fmi2Component component, fmi2Real states[], size_t n) {
    ENTER(READABLE);
    if (check_count(fmu, n, model.states, "states") != fmi2OK) return fmi2Error;
    if (n == 0) return fmi2OK;
    NEED(states);
    core_get_states(fmu->core, states);
    return fmi2OK;
}

fmi2Status fmi2GetDerivatives(fmi2Component component, fmi2Real derivatives[], size_t n) {
    ENTER(READABLE);
    if (check_count(fmu, n, model.states, "derivatives of states") != fmi2OK) return fmi2Error;
    if (n == 0) return fmi2OK;
    NEED(derivatives);
    return (fmi2Status)core_get_derivatives(fmu->core, derivatives);
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component component, fmi2Real nominals[], size_t n) {
    ENTER(READABLE);
    if (check_count(fmu, n, model.states, "nominal values of states") != fmi2OK) return fmi2Error;
    if (n == 0) return fmi2OK;
    NEED(nominals);
    core_get_nominals(fmu->core, nominals);
    return fmi2OK;
}

fmi2Status fmi2GetEventIndicators(fmi2Component component, fmi2Real indicators[], size_t n) {
    (void)indicators;
    ENTER(READABLE);
    return check_count(fmu, n, 0, "event indicators");
}

#include "fmu.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#include <windows.h>
#else
#include <dlfcn.h>
#endif

/* ---- loading --------------------------------------------------------------------------------------------------- */

void fail(const char *what, const char *name) {
    fprintf(stderr, "%s: %s\n", what, name);
    exit(1);
}

static void load_function(void *library, const char *name, void *function, size_t size) {
#ifdef _WIN32
    const FARPROC address = GetProcAddress(library, name);
#else
    void *const address = dlsym(library, name);
#endif
    if (address == NULL) fail("function is missing", name);
    memcpy(function, &address, size); /* ISO C converts no pointer to data into one to a function */
}

static Group read_group(FILE *file) {
    Group group;
    unsigned long n, count;
    if (fscanf(file, "%*s %lu %lu", &n, &count) != 2) fail("plan", "a group is missing");
    group.n = n;
    group.count = count;
    group.references = calloc(n + 1, sizeof *group.references);
    group.sizes = calloc(n + 1, sizeof *group.sizes);
    group.values = calloc(count + 1, sizeof *group.values);
    if (!group.references || !group.sizes || !group.values) fail("plan", "out of memory");
    for (size_t i = 0; i < n; i++) {
        unsigned long size;
        if (fscanf(file, "%u %lu", &group.references[i], &size) != 2) fail("plan", "a variable is missing");
        group.sizes[i] = size;
    }
    for (size_t i = 0; i < count; i++)
        if (fscanf(file, "%lf", &group.values[i]) != 1) fail("plan", "a value is missing");
    return group;
}

/* Words, in this order: version, token, step size, numbers of states and event indicators; then of parameters, inputs,
 * outputs, other reals, integers, structural sizes, integers and Booleans that are calculated: title, number of
 * variables, number of their elements, references and sizes, values. */
static Plan read_plan(const char *name) {
    Plan plan;
    unsigned long states, indicators;
    FILE *file = fopen(name, "r");
    if (file == NULL) fail("cannot be opened", name);
    if (fscanf(file, "%d %63s %lf %lu %lu", &plan.version, plan.token, &plan.step, &states, &indicators) != 5)
        fail("plan", "head");
    plan.states = states;
    plan.indicators = indicators;
    plan.parameters = read_group(file);
    plan.inputs = read_group(file);
    plan.outputs = read_group(file);
    plan.locals = read_group(file);
    plan.integers = read_group(file);
    plan.sizes = read_group(file);
    plan.counts = read_group(file);
    plan.truths = read_group(file);
    fclose(file);
    return plan;
}

void free_plan(Plan *plan) {
    Group *groups[] = {&plan->parameters, &plan->inputs, &plan->outputs, &plan->locals, &plan->integers,
                       &plan->sizes, &plan->counts, &plan->truths};
    for (size_t i = 0; i < sizeof groups / sizeof *groups; i++) {
        free(groups[i]->references);
        free(groups[i]->sizes);
        free(groups[i]->values);
    }
}

Library open_library(const char *name, const char *plan) {
    Library library;
    memset(&library, 0, sizeof library);
    library.plan = read_plan(plan);
#ifdef _WIN32
    void *handle = LoadLibraryA(name);
    if (handle == NULL) fail("cannot be loaded", name);
#else
    void *handle = dlopen(name, RTLD_NOW | RTLD_LOCAL);
    if (handle == NULL) fail("cannot be loaded", dlerror());
#endif
#define LOAD2(f) load_function(handle, "fmi2" #f, &library.fmi2.f, sizeof library.fmi2.f);
#define LOAD3(f) load_function(handle, "fmi3" #f, &library.fmi3.f, sizeof library.fmi3.f);
    if (library.plan.version == 2) {
        FMI2_FUNCTIONS(LOAD2)
    } else {
        FMI3_FUNCTIONS(LOAD3)
    }
    return library;
}

/* ---- one instance ---------------------------------------------------------------------------------------------- */

static void log_message(const Library *library, void *environment, int status, const char *message) {
    if (library->logger) library->logger(environment, status, message);
    else fprintf(stderr, "[%d] %s\n", status, message);
}

static void log2_message(void *environment, fmi2String name, fmi2Status status, fmi2String category, fmi2String text,
                         ...) {
    (void)name, (void)category;
    log_message(((Fmu *)environment)->library, environment, status, text);
}

static void log3_message(void *environment, fmi3Status status, fmi3String category, fmi3String text) {
    (void)category;
    log_message(((Fmu *)environment)->library, environment, status, text);
}

/* An instance that tells of its steps and asks for its inputs inside them, if the importer listens. */
static void *with_events(Fmu *it, const Library *library) {
    const Group *inputs = &library->plan.inputs, *outputs = &library->plan.outputs;
    const size_t n = inputs->n + outputs->n;
    unsigned *wanted = calloc(n + 1, sizeof *wanted);
    for (size_t i = 0; i < n; i++)
        wanted[i] = i < inputs->n ? inputs->references[i] : outputs->references[i - inputs->n];
    void *made = library->fmi3.InstantiateCoSimulation("it", library->plan.token, NULL, false, true, true, true, wanted, n,
                                                       it, log3_message, library->intermediate_update);
    free(wanted);
    return made;
}

void *fmu_instantiate(Fmu *it, const Library *library, Interface kind) {
    const char *token = library->plan.token;
    memset(it, 0, sizeof *it);
    it->library = library;
    it->kind = kind;
    it->callbacks.logger = log2_message;
    it->callbacks.allocateMemory = calloc;
    it->callbacks.freeMemory = free;
    it->callbacks.componentEnvironment = it;
    if (library->plan.version == 2)
        it->component = library->fmi2.Instantiate("it", kind == MODEL_EXCHANGE ? fmi2ModelExchange : fmi2CoSimulation,
                                                  token, NULL, &it->callbacks, fmi2False, fmi2True);
    else if (kind == MODEL_EXCHANGE)
        it->component = library->fmi3.InstantiateModelExchange("it", token, NULL, false, true, it, log3_message);
    else if (kind == CO_SIMULATION_WITH_EVENTS)
        it->component = with_events(it, library);
    else
        it->component = library->fmi3.InstantiateCoSimulation("it", token, NULL, false, true, false, false, NULL, 0, it,
                                                              log3_message, NULL);
    return it->component;
}

#define CALL(f2, arguments2, f3, arguments3) \
    (it->library->plan.version == 2 ? (int)it->library->fmi2.f2 arguments2 : (int)it->library->fmi3.f3 arguments3)

void fmu_free(Fmu *it) {
    if (it->library->plan.version == 2) {
        it->library->fmi2.FreeFMUstate(it->component, &it->state);
        it->library->fmi2.FreeInstance(it->component);
    } else {
        it->library->fmi3.FreeFMUState(it->component, &it->state);
        it->library->fmi3.FreeInstance(it->component);
    }
}

int fmu_get(Fmu *it, const Group *group, double values[]) {
    return CALL(GetReal, (it->component, group->references, group->n, values), GetFloat64,
                (it->component, group->references, group->n, values, group->count));
}

int fmu_set(Fmu *it, const Group *group, const double values[]) {
    return CALL(SetReal, (it->component, group->references, group->n, values), SetFloat64,
                (it->component, group->references, group->n, values, group->count));
}

int fmu_enter_initialization(Fmu *it, double tolerance) {
    if (it->library->plan.version == 3)
        return (int)it->library->fmi3.EnterInitializationMode(it->component, true, tolerance, 0, false, 0);
    const int status = (int)it->library->fmi2.SetupExperiment(it->component, fmi2True, tolerance, 0, fmi2False, 0);
    return status != fmi2OK ? status : (int)it->library->fmi2.EnterInitializationMode(it->component);
}

int fmu_exit_initialization(Fmu *it) {
    return CALL(ExitInitializationMode, (it->component), ExitInitializationMode, (it->component));
}

int fmu_step(Fmu *it, double time, double size) {
    bool event, terminate, early;
    double last;
    return CALL(DoStep, (it->component, time, size, fmi2True), DoStep,
                (it->component, time, size, true, &event, &terminate, &early, &last));
}

int fmu_save(Fmu *it) {
    return CALL(GetFMUstate, (it->component, &it->state), GetFMUState, (it->component, &it->state));
}

int fmu_restore(Fmu *it) {
    return CALL(SetFMUstate, (it->component, it->state), SetFMUState, (it->component, it->state));
}

int fmu_serialize(Fmu *it, char **bytes, size_t *size) {
    const int status = CALL(SerializedFMUstateSize, (it->component, it->state, size), SerializedFMUStateSize,
                            (it->component, it->state, size));
    if (status != fmi2OK) return status;
    *bytes = malloc(*size);
    if (*bytes == NULL) fail("serialize", "out of memory");
    return CALL(SerializeFMUstate, (it->component, it->state, *bytes, *size), SerializeFMUState,
                (it->component, it->state, (fmi3Byte *)*bytes, *size));
}

int fmu_deserialize(Fmu *it, const char *bytes, size_t size) {
    return CALL(DeSerializeFMUstate, (it->component, bytes, size, &it->state), DeserializeFMUState,
                (it->component, (const fmi3Byte *)bytes, size, &it->state));
}

int fmu_terminate(Fmu *it) { return CALL(Terminate, (it->component), Terminate, (it->component)); }

/* ---- model exchange -------------------------------------------------------------------------------------------- */

int fmu_enter_event_mode(Fmu *it) {
    return CALL(EnterEventMode, (it->component), EnterEventMode, (it->component));
}

int fmu_enter_continuous_mode(Fmu *it) {
    return CALL(EnterContinuousTimeMode, (it->component), EnterContinuousTimeMode, (it->component));
}

int fmu_update_discrete_states(Fmu *it, double *next) {
    int status;
    if (it->library->plan.version == 2) {
        fmi2EventInfo info;
        status = (int)it->library->fmi2.NewDiscreteStates(it->component, &info);
        *next = status == fmi2OK && info.nextEventTimeDefined ? info.nextEventTime : INFINITY;
    } else {
        bool again, terminate, nominals, values, defined;
        double time;
        status = (int)it->library->fmi3.UpdateDiscreteStates(it->component, &again, &terminate, &nominals, &values,
                                                             &defined, &time);
        *next = status == fmi3OK && defined ? time : INFINITY;
    }
    return status;
}

int fmu_get_states(Fmu *it, double y[]) {
    const size_t n = it->library->plan.states;
    return CALL(GetContinuousStates, (it->component, y, n), GetContinuousStates, (it->component, y, n));
}

int fmu_set_time_and_states(Fmu *it, double t, const double y[]) {
    const size_t n = it->library->plan.states;
    const int status = CALL(SetTime, (it->component, t), SetTime, (it->component, t));
    if (status != fmi2OK || n == 0) return status;
    return CALL(SetContinuousStates, (it->component, y, n), SetContinuousStates, (it->component, y, n));
}

int fmu_get_derivatives(Fmu *it, double f[]) {
    const size_t n = it->library->plan.states;
    if (n == 0) return fmi2OK;
    return CALL(GetDerivatives, (it->component, f, n), GetContinuousStateDerivatives, (it->component, f, n));
}

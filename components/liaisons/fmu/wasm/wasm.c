/* What WebAssembly components export: the interfaces of fmi-ls-wasm (wit/) upon the functions of FMI 3.0.
 *
 * Values come and go as the component model's canonical ABI lays them out, which is how C does it for wasm32: a list or
 * a string is a pointer and a length; what is more than one number is returned by a pointer to it.  Lists of a host lie
 * in blocks that it takes from cabi_realloc before the call; they are ours until the call returns.  What is returned
 * stays until the next call. */
#pragma clang diagnostic ignored "-Wunused-parameter" /* functions have what the interfaces say */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "core.h"
#include "fmi3Functions.h"

#define INTERFACE(kind) "fmi:fmi3/" kind "@3.0.0"
#define IMPORT(module, name) __attribute__((import_module(module), import_name(name)))
#define EXPORT(name) __attribute__((export_name(name)))

IMPORT(INTERFACE("callbacks"), "log-message")
void log_message(const char *name, size_t name_length, fmi3Status, const char *category, size_t category_length,
                 const char *text, size_t text_length);
IMPORT("[export]" INTERFACE("co-simulation"), "[resource-new]co-simulation-instance") uint32_t new_simulation(void *);
IMPORT("[export]" INTERFACE("model-exchange"), "[resource-new]model-exchange-instance") uint32_t new_exchange(void *);

typedef struct { /* what a host's handle stands for */
    fmi3Instance fmu;
    char name[];
} Self;

/* ---- memory ------------------------------------------------------------------------------------------------ */

typedef struct Block {
    struct Block *next;
    double bytes[];
} Block;

static Block *blocks; /* of the present call */

EXPORT("cabi_realloc") void *cabi_realloc(void *old, size_t old_size, size_t alignment, size_t size) {
    Block *block = malloc(sizeof *block + size);
    (void)alignment; /* none is more than that of double */
    if (block == NULL) __builtin_trap();
    *block = (Block){blocks};
    blocks = block;
    return old == NULL ? block->bytes : memcpy(block->bytes, old, old_size < size ? old_size : size);
}

static void *take(size_t size) { return cabi_realloc(NULL, 0, 0, size); }

static void free_blocks(void) {
    while (blocks != NULL) {
        Block *block = blocks;
        blocks = block->next;
        free(block);
    }
}

/* Room for what is returned. */
static void *room(size_t size) {
    static void *bytes;
    static size_t capacity;
    if (size > capacity) {
        free(bytes);
        bytes = malloc(capacity = size);
        if (bytes == NULL) __builtin_trap();
    }
    return bytes;
}

/* ---- values ------------------------------------------------------------------------------------------------ */

typedef struct {
    const void *items;
    size_t n;
} List;

typedef struct {
    uint32_t some, handle;
} Option;

typedef struct {
    double last_time;
    bool event_needed, terminate, early_return;
} Step;

typedef struct {
    bool enter_event_mode, terminate;
} Completed;

typedef struct {
    bool needed, terminate, nominals_changed, states_changed, time_defined;
    double next_time;
} Discrete;

typedef struct {
    uint32_t reference, order;
} Derivative;

#define RESULT(Type, Value) \
    typedef struct {        \
        bool failed;        \
        union {             \
            uint8_t status; \
            Value value;    \
        } as;               \
    } Type

RESULT(Items, List);
RESULT(Number, uint64_t);
RESULT(Stepped, Step);
RESULT(CompletedStep, Completed);
RESULT(DiscreteStates, Discrete);

/* A result by its status and, unless that is a failure, its value. */
#define RETURN(Type, status_now, ...)                      \
    static Type result;                                    \
    const fmi3Status status = status_now;                  \
    result.failed = status > fmi3Warning;                  \
    if (result.failed) result.as.status = (uint8_t)status; \
    else result.as.value = __VA_ARGS__;                    \
    return &result

static const Items *items(fmi3Status found, const void *values, size_t n) { RETURN(Items, found, (List){values, n}); }

static const Number *number(fmi3Status found, const size_t *n) { RETURN(Number, found, *n); }

static const char *text(const char *letters, size_t n) {
    char *copy = take(n + 1);
    memcpy(copy, letters, n);
    copy[n] = '\0';
    return copy;
}

/* How many numbers the variables of type Float64 with these references have. */
static size_t count_numbers(const uint32_t references[], size_t n) {
    uint64_t count = 0;
    for (size_t i = 0; i < n; i++) {
        const size_t row = references[i] - first_reference(&model);
        count += row < model.variable_rows ? model.variables[row].count : 1;
    }
    if (count > SIZE_MAX / sizeof(double)) __builtin_trap(); /* nobody has as much memory */
    return (size_t)count;
}

/* ---- life -------------------------------------------------------------------------------------------------- */

EXPORT(INTERFACE("common") "#get-version") const List *get_version(void) {
    static List version;
    version = (List){fmi3GetVersion(), strlen(fmi3GetVersion())};
    return &version;
}

static void say(fmi3InstanceEnvironment self, fmi3Status status, fmi3String category, fmi3String message) {
    const char *name = ((const Self *)self)->name;
    log_message(name, strlen(name), status, category, strlen(category), message, strlen(message));
}

/* An instance without its FMU. */
static Self *named(const char *name, size_t n) {
    Self *self = malloc(sizeof *self + n + 1);
    if (self == NULL) __builtin_trap();
    memcpy(self->name, name, n);
    self->name[n] = '\0';
    return self;
}

/* Whether this is the token of a copy of the FMU, which has its start values in a file. */
static int is_copy(Self *self, const char *token, size_t n) {
    const size_t length = strlen(model.guid);
    if (n <= length || memcmp(token, model.guid, length) != 0) return 0;
    say(self, fmi3Error, "logStatusError", "this FMU has its start values in a file: take one of its native binaries");
    return 1;
}

static const Option *opened(Self *self, fmi3Instance fmu, uint32_t (*new_handle)(void *)) {
    static Option option;
    option = (Option){fmu != NULL, 0};
    self->fmu = fmu;
    if (fmu == NULL) free(self);
    else option.handle = new_handle(self);
    free_blocks();
    return &option;
}

EXPORT(INTERFACE("co-simulation") "#[static]co-simulation-instance.instantiate-co-simulation")
const Option *instantiate_simulation(const char *name, size_t name_n, const char *token, size_t token_n,
                                     const char *resources, size_t resources_n, int visible, int logging, int events,
                                     int early_return, const uint32_t *required, size_t required_n) {
    Self *self = named(name, name_n);
    fmi3Instance fmu = NULL;
    if (!is_copy(self, token, token_n))
        fmu = fmi3InstantiateCoSimulation(self->name, text(token, token_n), NULL, visible, logging, events,
                                          early_return, required, required_n, self, say, NULL);
    return opened(self, fmu, new_simulation);
}

EXPORT(INTERFACE("model-exchange") "#[static]model-exchange-instance.instantiate-model-exchange")
const Option *instantiate_exchange(const char *name, size_t name_n, const char *token, size_t token_n,
                                   const char *resources, size_t resources_n, int visible, int logging) {
    Self *self = named(name, name_n);
    fmi3Instance fmu = NULL;
    if (!is_copy(self, token, token_n))
        fmu = fmi3InstantiateModelExchange(self->name, text(token, token_n), NULL, visible, logging, self, say);
    return opened(self, fmu, new_exchange);
}

EXPORT(INTERFACE("co-simulation") "#[dtor]co-simulation-instance") void drop_simulation(Self *self) {
    fmi3FreeInstance(self->fmu);
    free(self);
}

EXPORT(INTERFACE("model-exchange") "#[dtor]model-exchange-instance") void drop_exchange(Self *self) {
    drop_simulation(self);
}

static size_t size; /* to be returned */

/* ---- what methods do --------------------------------------------------------------------------------------- */

/* How C sees functions that are alike in WebAssembly. */
typedef fmi3Status Get(fmi3Instance, const uint32_t references[], size_t n, void *values, size_t count);
typedef fmi3Status Set(fmi3Instance, const uint32_t references[], size_t n, const void *values, size_t count);
typedef fmi3Status GetVector(fmi3Instance, double values[], size_t n);
typedef fmi3GetDirectionalDerivativeTYPE Derive;

static fmi3Status set_logging(Self *self, int on, const List categories[], size_t n) {
    const char **names = take(n * sizeof *names);
    for (size_t i = 0; i < n; i++) names[i] = text(categories[i].items, categories[i].n);
    return fmi3SetDebugLogging(self->fmu, on, n, names);
}

static const DiscreteStates *update(Self *self) {
    Discrete d;
    RETURN(DiscreteStates,
           fmi3UpdateDiscreteStates(self->fmu, &d.needed, &d.terminate, &d.nominals_changed, &d.states_changed,
                                    &d.time_defined, &d.next_time), d);
}

static const Items *get(Get *function, Self *self, const uint32_t references[], size_t n) {
    const int sized = function == (Get *)fmi3GetFloat64 || function == (Get *)fmi3GetInt32 || function == (Get *)fmi3GetBoolean;
    const size_t count = sized ? count_numbers(references, n) : n;
    void *values = room(count * sizeof(double));
    return items(function(self->fmu, references, n, values, count), values, count);
}

static const Items *save(Self *self) {
    fmi3FMUState state = NULL;
    void *bytes = NULL;
    size_t n = 0;
    fmi3Status status = fmi3GetFMUState(self->fmu, &state);
    if (status == fmi3OK) status = fmi3SerializedFMUStateSize(self->fmu, state, &n);
    if (status == fmi3OK) status = fmi3SerializeFMUState(self->fmu, state, bytes = room(n), n);
    if (state != NULL) fmi3FreeFMUState(self->fmu, &state);
    return items(status, bytes, n);
}

static fmi3Status restore(Self *self, const uint8_t bytes[], size_t n) {
    fmi3FMUState state = NULL;
    fmi3Status status = fmi3DeserializeFMUState(self->fmu, bytes, n, &state);
    if (status == fmi3OK) status = fmi3SetFMUState(self->fmu, state);
    if (state != NULL) fmi3FreeFMUState(self->fmu, &state);
    return status;
}

static const Items *derive(Derive *function, size_t count, Self *self, const uint32_t unknowns[], size_t n_unknown,
                           const uint32_t knowns[], size_t n_known, const double seed[], size_t n_seed) {
    double *values = room(count * sizeof *values);
    return items(function(self->fmu, unknowns, n_unknown, knowns, n_known, seed, n_seed, values, count), values, count);
}

static const Items *output_derivatives(Self *self, const Derivative asked[], size_t n) {
    uint32_t *references = take(n * sizeof *references);
    int32_t *orders = take(n * sizeof *orders);
    for (size_t i = 0; i < n; i++) references[i] = asked[i].reference, orders[i] = (int32_t)asked[i].order;
    const size_t count = count_numbers(references, n);
    double *values = room(count * sizeof *values);
    return items(fmi3GetOutputDerivatives(self->fmu, references, n, orders, values, count), values, count);
}

/* FMI 3.0 has no such function. */
static fmi3Status set_input_derivatives(Self *self) {
    say(self, fmi3Error, "logStatusError", "set-input-derivatives: there are none in FMI 3.0; set the inputs' rates");
    return fmi3Error;
}

static const Stepped *do_step(Self *self, double time, double size, int no_way_back) {
    Step s;
    RETURN(Stepped,
           fmi3DoStep(self->fmu, time, size, no_way_back, &s.event_needed, &s.terminate, &s.early_return, &s.last_time),
           s);
}

static const CompletedStep *complete_step(Self *self, int no_way_back) {
    Completed c;
    RETURN(CompletedStep, fmi3CompletedIntegratorStep(self->fmu, no_way_back, &c.enter_event_mode, &c.terminate), c);
}

/* A vector as long as there are states, or event indicators. */
static const Items *get_vector(GetVector *function, Self *self, size_t n) {
    if (function == fmi3GetEventIndicators) n = model.indicators;
    double *values = room(n * sizeof *values);
    return items(function(self->fmu, values, n), values, n);
}

/* ---- methods: what they return, function, name, parameters, what they do ------------------------------------ */

#define NOTHING (Self *self)
#define LISTED (Self *self, const uint32_t r[], size_t n)
#define LISTS (Self *self, const uint32_t r[], size_t n, const void *v, size_t count)
#define DERIVATIVE \
    (Self *self, const uint32_t u[], size_t n_u, const uint32_t k[], size_t n_k, const double s[], size_t n_s)

#define ACT(M, Name, label) M(fmi3Status, Name, label, NOTHING, fmi3##Name(self->fmu))
#define TYPE(M, Name, label)                                                                 \
    M(const Items *, Get##Name, "get-" label, LISTED, get((Get *)fmi3Get##Name, self, r, n)) \
    M(fmi3Status, Set##Name, "set-" label, LISTS, ((Set *)fmi3Set##Name)(self->fmu, r, n, v, count))

#define METHODS(M)                                                                                                   \
    M(fmi3Status, SetDebugLogging, "set-debug-logging", (Self *self, int on, const List c[], size_t n),              \
      set_logging(self, on, c, n))                                                                                   \
    M(fmi3Status, EnterInitializationMode, "enter-initialization-mode",                                              \
      (Self *self, int has_tolerance, double tolerance, double start, int has_stop, double stop),                    \
      fmi3EnterInitializationMode(self->fmu, has_tolerance, tolerance, start, has_stop, stop))                       \
    ACT(M, ExitInitializationMode, "exit-initialization-mode")                                                       \
    ACT(M, EnterEventMode, "enter-event-mode")                                                                       \
    M(const DiscreteStates *, UpdateDiscreteStates, "update-discrete-states", NOTHING, update(self))                 \
    ACT(M, Terminate, "terminate")                                                                                   \
    ACT(M, Reset, "reset")                                                                                           \
    ACT(M, EnterConfigurationMode, "enter-configuration-mode")                                                       \
    ACT(M, ExitConfigurationMode, "exit-configuration-mode")                                                         \
    TYPE(M, Float32, "float32")                                                                                      \
    TYPE(M, Float64, "float64")                                                                                      \
    TYPE(M, Int8, "int8")                                                                                            \
    TYPE(M, Int16, "int16")                                                                                          \
    TYPE(M, Int32, "int32")                                                                                          \
    TYPE(M, Int64, "int64")                                                                                          \
    TYPE(M, UInt8, "uint8")                                                                                          \
    TYPE(M, UInt16, "uint16")                                                                                        \
    TYPE(M, UInt32, "uint32")                                                                                        \
    TYPE(M, UInt64, "uint64")                                                                                        \
    TYPE(M, Boolean, "boolean")                                                                                      \
    TYPE(M, String, "string")                                                                                        \
    M(const Items *, GetBinary, "get-binary", LISTED, NONE(fmi3GetBinary(self->fmu, r, n, NULL, NULL, n)))           \
    M(fmi3Status, SetBinary, "set-binary", LISTS, fmi3SetBinary(self->fmu, r, n, NULL, v, count))                    \
    M(const Items *, GetClock, "get-clock", LISTED, NONE(fmi3GetClock(self->fmu, r, n, NULL)))                       \
    M(fmi3Status, SetClock, "set-clock", LISTS, fmi3SetClock(self->fmu, r, n, v))                                    \
    M(const Number *, GetNumberOfVariableDependencies, "get-number-of-variable-dependencies",                        \
      (Self *self, uint32_t r), number(fmi3GetNumberOfVariableDependencies(self->fmu, r, &size), &size))             \
    M(const Items *, GetVariableDependencies, "get-variable-dependencies", (Self *self, uint32_t r),                 \
      NONE(fmi3GetVariableDependencies(self->fmu, r, NULL, NULL, NULL, NULL, 0)))                                    \
    M(const Items *, GetFMUState, "get-fmu-state", NOTHING, save(self))                                              \
    M(fmi3Status, SetFMUState, "set-fmu-state", (Self *self, const uint8_t b[], size_t n), restore(self, b, n))      \
    M(const Items *, GetDirectionalDerivative, "get-directional-derivative", DERIVATIVE,                             \
      derive(fmi3GetDirectionalDerivative, count_numbers(u, n_u), self, u, n_u, k, n_k, s, n_s))                     \
    M(const Items *, GetAdjointDerivative, "get-adjoint-derivative", DERIVATIVE,                                     \
      derive(fmi3GetAdjointDerivative, count_numbers(k, n_k), self, u, n_u, k, n_k, s, n_s))                         \
    M(const Items *, GetIntervalDecimal, "get-interval-decimal", LISTED,                                             \
      NONE(fmi3GetIntervalDecimal(self->fmu, r, n, NULL, NULL)))                                                     \
    M(const Items *, GetIntervalFraction, "get-interval-fraction", LISTED,                                           \
      NONE(fmi3GetIntervalFraction(self->fmu, r, n, NULL, NULL, NULL)))                                              \
    M(const Items *, GetShiftDecimal, "get-shift-decimal", LISTED, NONE(fmi3GetShiftDecimal(self->fmu, r, n, NULL))) \
    M(const Items *, GetShiftFraction, "get-shift-fraction", LISTED,                                                 \
      NONE(fmi3GetShiftFraction(self->fmu, r, n, NULL, NULL)))                                                       \
    M(fmi3Status, SetIntervalDecimal, "set-interval-decimal", LISTS, fmi3SetIntervalDecimal(self->fmu, r, n, v))     \
    M(fmi3Status, SetIntervalFraction, "set-interval-fraction", LISTS,                                               \
      fmi3SetIntervalFraction(self->fmu, r, n, NULL, NULL))                                                          \
    M(fmi3Status, SetShiftDecimal, "set-shift-decimal", LISTS, fmi3SetShiftDecimal(self->fmu, r, n, v))              \
    M(fmi3Status, SetShiftFraction, "set-shift-fraction", LISTS, fmi3SetShiftFraction(self->fmu, r, n, NULL, NULL))  \
    ACT(M, EvaluateDiscreteStates, "evaluate-discrete-states")                                                       \
    ACT(M, EnterStepMode, "enter-step-mode")                                                                         \
    M(const Items *, GetOutputDerivatives, "get-output-derivatives", (Self *self, const Derivative d[], size_t n),   \
      output_derivatives(self, d, n))

#define METHODS_OF_SIMULATION(M)                                                                    \
    M(fmi3Status, SetInputDerivatives, "set-input-derivatives", LISTS, set_input_derivatives(self)) \
    M(const Stepped *, DoStep, "do-step", (Self *self, double time, double size, int no_way_back),  \
      do_step(self, time, size, no_way_back))

#define METHODS_OF_EXCHANGE(M)                                                                                         \
    ACT(M, EnterContinuousTimeMode, "enter-continuous-time-mode")                                                      \
    M(fmi3Status, SetTime, "set-time", (Self *self, double time), fmi3SetTime(self->fmu, time))                        \
    M(fmi3Status, SetContinuousStates, "set-continuous-states", (Self *self, const double y[], size_t n),              \
      fmi3SetContinuousStates(self->fmu, y, n))                                                                        \
    M(const Items *, GetContinuousStateDerivatives, "get-continuous-state-derivatives", NOTHING,                       \
      get_vector(fmi3GetContinuousStateDerivatives, self, model.states))                                               \
    M(const Items *, GetEventIndicators, "get-event-indicators", NOTHING, get_vector(fmi3GetEventIndicators, self, 0)) \
    M(const Items *, GetContinuousStates, "get-continuous-states", NOTHING,                                            \
      get_vector(fmi3GetContinuousStates, self, model.states))                                                         \
    M(const Items *, GetNominalsOfContinuousStates, "get-nominals-of-continuous-states", NOTHING,                      \
      get_vector(fmi3GetNominalsOfContinuousStates, self, model.states))                                               \
    M(const Number *, GetNumberOfEventIndicators, "get-number-of-event-indicators", NOTHING,                           \
      number(fmi3GetNumberOfEventIndicators(self->fmu, &size), &size))                                                 \
    M(const Number *, GetNumberOfContinuousStates, "get-number-of-continuous-states", NOTHING,                         \
      number(fmi3GetNumberOfContinuousStates(self->fmu, &size), &size))                                                \
    M(const CompletedStep *, CompletedIntegratorStep, "completed-integrator-step", (Self *self, int no_way_back),      \
      complete_step(self, no_way_back))

/* Of types and clocks that no variable has: there is nothing to give back. */
#define NONE(status) items(status, NULL, 0)

#define METHOD(returns, function, kind, label, parameters, ...)                               \
    EXPORT(INTERFACE(kind) "#[method]" kind "-instance." label) returns function parameters { \
        returns result = __VA_ARGS__;                                                         \
        free_blocks();                                                                        \
        return result;                                                                        \
    }
#define OF_SIMULATION(returns, Name, label, parameters, ...) \
    METHOD(returns, simulation##Name, "co-simulation", label, parameters, __VA_ARGS__)
#define OF_EXCHANGE(returns, Name, label, parameters, ...) \
    METHOD(returns, exchange##Name, "model-exchange", label, parameters, __VA_ARGS__)

METHODS(OF_SIMULATION)
METHODS_OF_SIMULATION(OF_SIMULATION)
METHODS(OF_EXCHANGE)
METHODS_OF_EXCHANGE(OF_EXCHANGE)

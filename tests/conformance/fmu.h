/* FMUs of both versions behind one interface: all their functions, and under names of our own what a simulation calls.
 *
 * A plan, written by whoever can read a model description, says what the FMU has; see read_plan. */
#ifndef CONFORMANCE_FMU_H
#define CONFORMANCE_FMU_H

#include <stddef.h>

#ifdef __clang__ /* the standard's header has two declarations without prototypes */
#pragma clang diagnostic ignored "-Wstrict-prototypes"
#endif
#include "fmi2Functions.h"
#include "fmi3Functions.h"

#define FMI2_FUNCTIONS(X)                                                                                              \
    X(GetTypesPlatform) X(GetVersion) X(SetDebugLogging) X(Instantiate) X(FreeInstance) X(SetupExperiment)             \
    X(EnterInitializationMode) X(ExitInitializationMode) X(Terminate) X(Reset) X(GetReal) X(GetInteger) X(GetBoolean)  \
    X(GetString) X(SetReal) X(SetInteger) X(SetBoolean) X(SetString) X(GetFMUstate) X(SetFMUstate) X(FreeFMUstate)     \
    X(SerializedFMUstateSize) X(SerializeFMUstate) X(DeSerializeFMUstate) X(GetDirectionalDerivative)                  \
    X(EnterEventMode) X(NewDiscreteStates) X(EnterContinuousTimeMode) X(CompletedIntegratorStep) X(SetTime)            \
    X(SetContinuousStates) X(GetDerivatives) X(GetEventIndicators) X(GetContinuousStates)                              \
    X(GetNominalsOfContinuousStates) X(SetRealInputDerivatives) X(GetRealOutputDerivatives) X(DoStep) X(CancelStep)    \
    X(GetStatus) X(GetRealStatus) X(GetIntegerStatus) X(GetBooleanStatus) X(GetStringStatus)

#define FMI3_FUNCTIONS(X)                                                                                              \
    X(GetVersion) X(SetDebugLogging) X(InstantiateModelExchange) X(InstantiateCoSimulation)                            \
    X(InstantiateScheduledExecution) X(FreeInstance) X(EnterInitializationMode) X(ExitInitializationMode)              \
    X(EnterEventMode) X(Terminate) X(Reset) X(GetFloat32) X(GetFloat64) X(GetInt8) X(GetUInt8) X(GetInt16)             \
    X(GetUInt16) X(GetInt32) X(GetUInt32) X(GetInt64) X(GetUInt64) X(GetBoolean) X(GetString) X(GetBinary) X(GetClock) \
    X(SetFloat32) X(SetFloat64) X(SetInt8) X(SetUInt8) X(SetInt16) X(SetUInt16) X(SetInt32) X(SetUInt32) X(SetInt64)   \
    X(SetUInt64) X(SetBoolean) X(SetString) X(SetBinary) X(SetClock) X(GetNumberOfVariableDependencies)                \
    X(GetVariableDependencies) X(GetFMUState) X(SetFMUState) X(FreeFMUState) X(SerializedFMUStateSize)                 \
    X(SerializeFMUState) X(DeserializeFMUState) X(GetDirectionalDerivative) X(GetAdjointDerivative)                    \
    X(EnterConfigurationMode) X(ExitConfigurationMode) X(GetIntervalDecimal) X(GetIntervalFraction) X(GetShiftDecimal) \
    X(GetShiftFraction) X(SetIntervalDecimal) X(SetIntervalFraction) X(SetShiftDecimal) X(SetShiftFraction)            \
    X(EvaluateDiscreteStates) X(UpdateDiscreteStates) X(EnterContinuousTimeMode) X(CompletedIntegratorStep) X(SetTime) \
    X(SetContinuousStates) X(GetContinuousStateDerivatives) X(GetEventIndicators) X(GetContinuousStates)               \
    X(GetNominalsOfContinuousStates) X(GetNumberOfEventIndicators) X(GetNumberOfContinuousStates) X(EnterStepMode)     \
    X(GetOutputDerivatives) X(DoStep) X(ActivateModelPartition)

typedef struct {
#define MEMBER(name) fmi2##name##TYPE *name;
    FMI2_FUNCTIONS(MEMBER)
#undef MEMBER
} Fmi2;

typedef struct {
#define MEMBER(name) fmi3##name##TYPE *name;
    FMI3_FUNCTIONS(MEMBER)
#undef MEMBER
} Fmi3;

typedef struct { /* variables, arrays among them, and a value for each of their elements */
    size_t n, count;
    unsigned *references;
    size_t *sizes;
    double *values;
} Group;

typedef struct {
    int version; /* 2 or 3 */
    char token[64];
    double step;
    size_t states, indicators;
    Group parameters, inputs, outputs, locals, integers, sizes, counts, truths;
} Plan;

/* The last one, with early return and intermediate update, is of FMI 3.0. */
typedef enum { MODEL_EXCHANGE, CO_SIMULATION, CO_SIMULATION_WITH_EVENTS } Interface;

typedef void Logger(void *environment, int status, const char *message);

typedef struct {
    Plan plan;
    Fmi2 fmi2;
    Fmi3 fmi3;
    Logger *logger; /* NULL: messages go to standard error */
    fmi3IntermediateUpdateCallback intermediate_update;
} Library;

typedef struct {
    const Library *library;
    Interface kind;
    void *component, *state;
    fmi2CallbackFunctions callbacks; /* an FMI 2 instance may keep the pointer to them */
} Fmu;

/* Leave with a message: what has to work does not. */
void fail(const char *what, const char *name);

Library open_library(const char *name, const char *plan);
void free_plan(Plan *plan);

/* The instance stays where it is: its callbacks have its address.  All others return the status of the call. */
void *fmu_instantiate(Fmu *it, const Library *library, Interface kind);
void fmu_free(Fmu *it);
int fmu_get(Fmu *it, const Group *group, double values[]);
int fmu_set(Fmu *it, const Group *group, const double values[]);
int fmu_enter_initialization(Fmu *it, double tolerance);
int fmu_exit_initialization(Fmu *it);
int fmu_step(Fmu *it, double time, double size);
int fmu_terminate(Fmu *it);

int fmu_save(Fmu *it); /* into it->state */
int fmu_restore(Fmu *it);
int fmu_serialize(Fmu *it, char **bytes, size_t *size); /* the bytes are the caller's, to free */
int fmu_deserialize(Fmu *it, const char *bytes, size_t size);

/* model exchange */
int fmu_enter_event_mode(Fmu *it);
int fmu_enter_continuous_mode(Fmu *it);
int fmu_update_discrete_states(Fmu *it, double *next); /* *next: time of the next event, or INFINITY */
int fmu_get_states(Fmu *it, double y[]);
int fmu_set_time_and_states(Fmu *it, double t, const double y[]);
int fmu_get_derivatives(Fmu *it, double f[]);

#endif

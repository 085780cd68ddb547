/* Which call is allowed in which phase, for FMI 2.0 and FMI 3.0.
 *
 *   x  as the standard has it: FMI 2.0.4, tables of 3.2.3 and 4.2.4; FMI 3.0.2, "Allowed Function Calls" of each state
 *   t  not asked for there, and taken all the same
 *   o  refused
 *
 * and in which kinds of instances.  Functions go by their names in FMI 3.0 where it has them; NONE stands for those of
 * types without variables.  tests/conformance/calls.txt has the standard's side. */
#ifndef LIAISONS_CALLS_H
#define LIAISONS_CALLS_H

#include "core.h"

enum { EXCHANGE = 1 << USE_MODEL_EXCHANGE, EVENTS = 1 << USE_CO_SIMULATION_WITH_EVENTS };
enum { SIMULATION = 1 << USE_CO_SIMULATION | EVENTS, WITH_EVENTS = EXCHANGE | EVENTS, ALL = EXCHANGE | SIMULATION };

/*                                   instantiated
 *                                   |  initialization
 *                                   |  |  event
 *                                   |  |  |  continuous time
 *                                   |  |  |  |  step
 *                                   |  |  |  |  |  inside a step: outputs are read
 *                                   |  |  |  |  |  |  inside a step: inputs are requested
 *                                   |  |  |  |  |  |  |  configuration
 *                                   |  |  |  |  |  |  |  |  terminated   */
#define FMI2_CALLS(CALL)                                                               \
    CALL(SetDebugLogging,             x, x, x, x, x, o, o, o, x, ALL)                  \
    CALL(SetupExperiment,             x, o, o, o, o, o, o, o, o, ALL)                  \
    CALL(EnterInitializationMode,     x, o, o, o, o, o, o, o, o, ALL)                  \
    CALL(ExitInitializationMode,      o, x, o, o, o, o, o, o, o, ALL)                  \
    CALL(Terminate,                   o, o, x, x, x, o, o, o, o, ALL)                  \
    CALL(Reset,                       x, x, x, x, x, o, o, o, x, ALL)                  \
    CALL(GetFloat64,                  t, x, x, x, x, o, o, o, x, ALL)                  \
    CALL(GetInt32,                    t, x, x, x, x, o, o, o, x, ALL)                  \
    CALL(GetNONE,                     t, x, x, x, x, o, o, o, x, ALL)                  \
    CALL(SetFloat64,                  x, x, x, x, x, o, o, o, o, ALL)                  \
    CALL(SetInt32,                    x, x, x, t, x, o, o, o, o, ALL)                  \
    CALL(SetNONE,                     x, x, x, t, x, o, o, o, o, ALL)                  \
    CALL(FMUState,                    x, x, x, x, x, o, o, o, x, ALL)                  \
    CALL(GetDirectionalDerivative,    o, x, x, x, x, o, o, o, x, ALL)                  \
    CALL(EnterEventMode,              o, o, x, x, o, o, o, o, o, ALL)                  \
    CALL(UpdateDiscreteStates,        o, o, x, o, o, o, o, o, o, ALL)                  \
    CALL(EnterContinuousTimeMode,     o, o, x, o, o, o, o, o, o, ALL)                  \
    CALL(CompletedIntegratorStep,     o, o, o, x, o, o, o, o, o, ALL)                  \
    CALL(SetTime,                     o, o, x, x, o, o, o, o, o, ALL)                  \
    CALL(SetContinuousStates,         o, o, o, x, o, o, o, o, o, ALL)                  \
    CALL(GetContinuousStates,         o, x, x, x, t, o, o, o, x, ALL)                  \
    CALL(GetContinuousStateDerivatives, o, x, x, x, t, o, o, o, x, ALL)                \
    CALL(GetNominalsOfContinuousStates, x, x, x, x, t, o, o, o, x, ALL)                \
    CALL(GetEventIndicators,          o, x, x, x, t, o, o, o, x, ALL)                  \
    CALL(SetRealInputDerivatives,     x, x, o, o, x, o, o, o, o, ALL)                  \
    CALL(GetOutputDerivatives,        o, o, o, o, x, o, o, o, x, ALL)                  \
    CALL(DoStep,                      o, o, o, o, x, o, o, o, o, ALL)                  \
    CALL(CancelStep,                  o, o, o, o, t, o, o, o, o, ALL)                  \
    CALL(Status,                      o, o, o, o, x, o, o, o, x, ALL)

#define FMI3_CALLS(CALL)                                                               \
    CALL(SetDebugLogging,             x, x, x, x, x, o, o, x, x, ALL)                  \
    CALL(EnterConfigurationMode,      x, o, o, o, o, o, o, o, o, ALL)                  \
    CALL(ExitConfigurationMode,       o, o, o, o, o, o, o, x, o, ALL)                  \
    CALL(EnterInitializationMode,     x, o, o, o, o, o, o, o, o, ALL)                  \
    CALL(ExitInitializationMode,      o, x, o, o, o, o, o, o, o, ALL)                  \
    CALL(Terminate,                   o, o, x, x, x, o, o, o, o, ALL)                  \
    CALL(Reset,                       x, x, x, x, x, o, o, x, x, ALL)                  \
    CALL(GetFloat64,                  t, x, x, x, x, x, o, o, x, ALL)                  \
    CALL(GetInt32,                    t, x, x, x, x, x, o, o, x, ALL)                  \
    CALL(GetUInt64,                   t, x, x, x, x, x, o, t, x, ALL)                  \
    CALL(GetNONE,                     t, x, x, x, x, x, o, o, x, ALL)                  \
    CALL(SetFloat64,                  x, x, x, x, x, o, x, o, o, ALL)                  \
    CALL(SetInt32,                    x, x, x, t, x, o, o, o, o, ALL)                  \
    CALL(SetUInt64,                   o, o, o, o, o, o, o, x, o, ALL)                  \
    CALL(SetNONE,                     x, x, x, t, x, o, o, o, o, ALL)                  \
    CALL(Clocks,                      o, x, x, o, o, o, o, o, o, ALL)                  \
    CALL(FMUState,                    x, x, x, x, x, o, o, x, x, ALL)                  \
    CALL(VariableDependencies,        x, x, x, x, x, t, o, t, x, ALL)                  \
    CALL(GetDirectionalDerivative,    o, x, x, x, x, o, o, o, x, ALL)                  \
    CALL(GetAdjointDerivative,        o, x, x, x, x, o, o, o, x, ALL)                  \
    CALL(EnterEventMode,              o, o, t, x, x, o, o, o, o, WITH_EVENTS)          \
    CALL(UpdateDiscreteStates,        o, o, x, o, o, o, o, o, o, WITH_EVENTS)          \
    CALL(EvaluateDiscreteStates,      o, o, x, o, o, o, o, o, o, WITH_EVENTS)          \
    CALL(EnterContinuousTimeMode,     o, o, x, o, o, o, o, o, o, EXCHANGE)             \
    CALL(CompletedIntegratorStep,     o, o, o, x, o, o, o, o, o, EXCHANGE)             \
    CALL(SetTime,                     o, o, t, x, o, o, o, o, o, EXCHANGE)             \
    CALL(SetContinuousStates,         o, o, o, x, o, o, o, o, o, EXCHANGE)             \
    CALL(GetContinuousStates,         o, x, x, x, o, o, o, o, x, EXCHANGE)             \
    CALL(GetContinuousStateDerivatives, o, x, x, x, o, o, o, o, x, EXCHANGE)           \
    CALL(GetNominalsOfContinuousStates, o, x, x, x, o, o, o, o, x, EXCHANGE)           \
    CALL(GetEventIndicators,          o, x, x, x, o, o, o, o, x, EXCHANGE)             \
    CALL(GetNumberOf,                 x, t, x, t, o, o, o, o, t, EXCHANGE)             \
    CALL(EnterStepMode,               o, o, x, o, o, o, o, o, o, SIMULATION)           \
    CALL(GetOutputDerivatives,        o, o, o, o, x, x, o, o, x, SIMULATION)           \
    CALL(DoStep,                      o, o, o, o, x, o, o, o, o, SIMULATION)           \
    CALL(ActivateModelPartition,      t, t, t, t, t, t, o, t, t, ALL)

/* For the enumerators of either version: PHASES_SetTime, USES_SetTime, ... */
#define IN_x 1
#define IN_t 1
#define IN_o 0
#define ALLOWED(name, i, z, e, c, s, g, a, f, t, uses)                                                                \
    PHASES_##name = IN_##i * INSTANTIATED | IN_##z * INITIALIZATION | IN_##e * EVENT | IN_##c * CONTINUOUS            \
                    | IN_##s * STEP | IN_##g * INTERMEDIATE | IN_##a * INPUT_REQUEST | IN_##f * CONFIGURATION         \
                    | IN_##t * TERMINATED,                                                                            \
    USES_##name = uses,

#endif

/* The functions of FMI 3.0: co-simulation and model exchange of one instance of core.h. */
#include <math.h>

#include "calls.h"
#include "fmi_common.h"

#ifdef __clang__ /* the standard's header declares functions without saying that they have no arguments */
#pragma clang diagnostic push
#pragma clang diagnostic ignored "-Wstrict-prototypes"
#endif
#include "fmi3Functions.h"
#ifdef __clang__
#pragma clang diagnostic pop
#endif

typedef struct {
    FmiInstance common;
    fmi3LogMessageCallback logger;
    fmi3IntermediateUpdateCallback intermediate_update;
    fmi3Boolean early_return;
    double stop; /* time that must not be stepped over */
} Fmu;

enum { FMI3_CALLS(ALLOWED) };

#define FMI(name) fmi3##name
#define STATUS fmi3Status
#define INSTANCE fmi3Instance
#define BOOLEAN fmi3Boolean
#define BYTE fmi3Byte
#include "fmi_functions.h"

/* ---- life -------------------------------------------------------------------------------------------------- */

const char *fmi3GetVersion(void) { return fmi3Version; }

static void write(const FmiInstance *fmu, Status status, const char *category, const char *text) {
    ((const Fmu *)fmu)->logger(fmu->environment, (fmi3Status)status, category, text);
}

static FmiInstance listening(fmi3InstanceEnvironment environment, fmi3Boolean logging, fmi3LogMessageCallback logger) {
    return (FmiInstance){.environment = environment,
                  .write = logger ? write : NULL,
                  .marks = "#", /* references #1# are replaced by names */
                  .always = REFUSALS,
                  .logged = logging ? EVERYTHING : 0};
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback logger) {
    (void)visible;
    const Fmu fmu = {.common = listening(environment, logging, logger), .logger = logger, .stop = INFINITY};
    const Options options = {.use = USE_MODEL_EXCHANGE, .whole = 1};
    return fmi_instantiate(&fmu.common, sizeof fmu, name, token, resources, options, __func__);
}

/* Tell the importer of a step of the solver. */
static int step_finished(void *owner, double time, double *until) {
    const Fmu *fmu = owner;
    fmi3Boolean stop = fmi3False;
    double stop_time = time;
    fmu->intermediate_update(fmu->common.environment, time, fmi3False, fmi3True, fmi3True, fmu->early_return, &stop,
                             &stop_time);
    *until = stop_time;
    return stop;
}

/* Request inputs at a time. */
static void request_inputs(void *owner, double time) {
    const Fmu *fmu = owner;
    fmi3Boolean stop = fmi3False;
    double stop_time = time;
    fmu->intermediate_update(fmu->common.environment, time, fmi3True, fmi3False, fmi3False, fmi3False, &stop,
                             &stop_time);
}

/* How many of these references belong to inputs. */
static size_t count_inputs(const fmi3ValueReference references[], size_t n) {
    size_t count = 0;
    for (size_t i = 0; i < n; i++) {
        const size_t row = references[i] - first_reference(&model);
        count += row < model.variable_rows && model.variables[row].kind == INPUT;
    }
    return count;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early_return,
                                         const fmi3ValueReference intermediate_variables[], size_t n,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger,
                                         fmi3IntermediateUpdateCallback intermediate_update) {
    const size_t inputs = intermediate_variables ? count_inputs(intermediate_variables, n) : 0;
    (void)visible;
    const Fmu fmu = {.common = listening(environment, logging, logger),
                     .logger = logger,
                     .intermediate_update = intermediate_update,
                     .early_return = early_return,
                     .stop = INFINITY};
    const Options options = {.use = events ? USE_CO_SIMULATION_WITH_EVENTS : USE_CO_SIMULATION,
                             .whole = 1,
                             .early = early_return,
                             /* all outputs can be had, unless only inputs are of interest */
                             .step_finished = intermediate_update && (n == 0 || inputs < n) ? step_finished : NULL,
                             .request_inputs = intermediate_update && inputs > 0 ? request_inputs : NULL};
    return fmi_instantiate(&fmu.common, sizeof fmu, name, token, resources, options, __func__);
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger,
                                               fmi3ClockUpdateCallback clock_update,
                                               fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock) {
    (void)name;
    (void)token;
    (void)resources;
    (void)visible;
    (void)logging;
    (void)clock_update;
    (void)lock;
    (void)unlock;
    if (logger)
        logger(environment, fmi3Error, "logStatusError",
               "fmi3InstantiateScheduledExecution: this FMU is for co-simulation and model exchange");
    return NULL;
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance) {
    ENTER(EnterConfigurationMode);
    if (model.dimension_rows == 0 || model.by_number)
        return (fmi3Status)core_report(core, ERROR, "%s: there are no structural parameters", __func__);
    core_enter_configuration(core);
    return fmi3OK;
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance) {
    ENTER(ExitConfigurationMode);
    core_exit_configuration(core);
    return fmi3OK;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean stop_defined, fmi3Float64 stop) {
    ENTER(EnterInitializationMode);
    if (core_setup(core, start, stop_defined ? &stop : NULL, tolerance_defined ? tolerance : 0) != SUCCESS)
        return fmi3Error;
    fmu->stop = stop_defined ? stop : INFINITY;
    core_enter_initialization(core);
    return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *need_update, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals_changed, fmi3Boolean *states_changed, fmi3Boolean *time_defined,
                                    fmi3Float64 *next_time) {
    ENTER(UpdateDiscreteStates);
    NEED(need_update);
    NEED(terminate);
    NEED(nominals_changed);
    NEED(states_changed);
    NEED(time_defined);
    NEED(next_time);
    *need_update = fmi3False;
    *terminate = fmi3False;
    *nominals_changed = fmi3False;
    int changed = 0;
    *next_time = INFINITY;
    const Status status = core_update_discrete_states(core, &changed, next_time);
    *states_changed = changed != 0;
    *time_defined = *next_time < INFINITY;
    return (fmi3Status)status;
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance) {
    ENTER(EvaluateDiscreteStates);
    return (fmi3Status)core_report(core, ERROR, "%s: providesEvaluateDiscreteStates is false", __func__);
}

fmi3Status fmi3Reset(fmi3Instance instance) {
    ENTER(Reset);
    fmu->stop = INFINITY;
    return (fmi3Status)fmi_reset(&fmu->common);
}

/* ---- variables --------------------------------------------------------------------------------------------- */

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t n, fmi3Float64 values[],
                          size_t count) {
    ENTER(GetFloat64);
    if (n == 0 && count == 0) return fmi3OK;
    NEED(references);
    NEED(values);
    return (fmi3Status)core_get(core, references, n, values, count);
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                          const fmi3Float64 values[], size_t count) {
    ENTER(SetFloat64);
    if (n == 0 && count == 0) return fmi3OK;
    NEED(references);
    NEED(values);
    if (core_phase(core) == INPUT_REQUEST)
        return (fmi3Status)core_set_requested_inputs(core, references, n, values, count);
    return (fmi3Status)core_set(core, references, n, values, count);
}

fmi3Status fmi3GetInt32(fmi3Instance instance, const fmi3ValueReference references[], size_t n, fmi3Int32 values[],
                        size_t count) {
    ENTER(GetInt32);
    if (n == 0 && count == 0) return fmi3OK;
    NEED(references);
    if (fmi_check_count(&fmu->common, count, core_count(core, references, n), "values of type Int32") != SUCCESS)
        return fmi3Error;
    NEED(values);
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < core_count(core, &references[i], 1); j++) {
            double value = 0;
            const Status status = core_get_typed(core, NUMBER_INTEGER, references[i], j, &value);
            if (status != SUCCESS) return (fmi3Status)status;
            *values++ = (int)fmax(INT32_MIN, fmin(value, INT32_MAX));
        }
    }
    return fmi3OK;
}

fmi3Status fmi3SetInt32(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                        const fmi3Int32 values[], size_t count) {
    ENTER(SetInt32);
    if (fmi_check_count(&fmu->common, count, n, "values for scalars of type Int32") != SUCCESS) return fmi3Error;
    if (n == 0) return fmi3OK;
    NEED(references);
    NEED(values);
    return (fmi3Status)core_set_settings(core, references, n, values);
}

/* The structural parameter of a reference; NULL, and a report, if there is none. */
static const Dimension *structural(const Instance *core, fmi3ValueReference reference) {
    const Dimension *dimension = core_dimension(core, reference);
    if (dimension == NULL) core_report(core, ERROR, "value reference %u belongs to no variable of type UInt64", reference);
    return dimension;
}

fmi3Status fmi3GetUInt64(fmi3Instance instance, const fmi3ValueReference references[], size_t n, fmi3UInt64 values[],
                         size_t count) {
    ENTER(GetUInt64);
    if (fmi_check_count(&fmu->common, count, n, "values for scalars of type UInt64") != SUCCESS) return fmi3Error;
    if (n == 0) return fmi3OK;
    NEED(references);
    NEED(values);
    for (size_t i = 0; i < n; i++) {
        const Dimension *dimension = structural(core, references[i]);
        if (dimension == NULL) return fmi3Error;
        values[i] = dimension->count;
    }
    return fmi3OK;
}

fmi3Status fmi3SetUInt64(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                         const fmi3UInt64 values[], size_t count) {
    ENTER(SetUInt64);
    if (fmi_check_count(&fmu->common, count, n, "values for scalars of type UInt64") != SUCCESS) return fmi3Error;
    if (n == 0) return fmi3OK;
    NEED(references);
    NEED(values);
    for (size_t i = 0; i < n; i++) {
        const Dimension *dimension = structural(core, references[i]);
        if (dimension == NULL) return fmi3Error;
        if (values[i] != dimension->count)
            return (fmi3Status)core_report(core, ERROR, "%s = %lu: this FMU is built for %lu; build another one",
                                           dimension->name, (unsigned long)values[i], (unsigned long)dimension->count);
    }
    return fmi3OK;
}

/* Types of which there are no variables. */
#define NONE_OF(Type)                                                                                                \
    fmi3Status fmi3Get##Type(fmi3Instance instance, const fmi3ValueReference references[], size_t n,                  \
                             fmi3##Type values[], size_t count) {                                                     \
        (void)references;                                                                                             \
        (void)values;                                                                                                 \
        ENTER(GetNONE);                                                                                               \
        return (fmi3Status)fmi_check_no_variables(&fmu->common, n + count, #Type);                                   \
    }                                                                                                                 \
    fmi3Status fmi3Set##Type(fmi3Instance instance, const fmi3ValueReference references[], size_t n,                  \
                             const fmi3##Type values[], size_t count) {                                               \
        (void)references;                                                                                             \
        (void)values;                                                                                                 \
        ENTER(SetNONE);                                                                                               \
        return (fmi3Status)fmi_check_no_variables(&fmu->common, n + count, #Type);                                   \
    }

NONE_OF(Float32)
NONE_OF(Int8)
NONE_OF(UInt8)
NONE_OF(Int16)
NONE_OF(UInt16)
NONE_OF(UInt32)
NONE_OF(Int64)
fmi3Status fmi3GetBoolean(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                          fmi3Boolean values[], size_t count) {
    ENTER(GetInt32);
    if (n + count == 0 || model.indicators == 0)
        return (fmi3Status)fmi_check_no_variables(&fmu->common, n + count, "Boolean");
    NEED(references);
    if (fmi_check_count(&fmu->common, count, core_count(core, references, n), "values of type Boolean") != SUCCESS)
        return fmi3Error;
    NEED(values);
    return get_booleans(core, references, n, values);
}

fmi3Status fmi3SetBoolean(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                          const fmi3Boolean values[], size_t count) {
    ENTER(SetInt32);
    if (n + count == 0 || model.indicators == 0)
        return (fmi3Status)fmi_check_no_variables(&fmu->common, n + count, "Boolean");
    NEED(references);
    if (fmi_check_count(&fmu->common, count, core_count(core, references, n), "values of type Boolean") != SUCCESS)
        return fmi3Error;
    NEED(values);
    return (fmi3Status)core_refuse_typed(core, NUMBER_BOOLEAN, references[0], values[0]);
}

NONE_OF(String)

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference references[], size_t n, size_t sizes[],
                         fmi3Binary values[], size_t count) {
    (void)references;
    (void)sizes;
    (void)values;
    ENTER(GetNONE);
    return (fmi3Status)fmi_check_no_variables(&fmu->common, n + count, "Binary");
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference references[], size_t n, const size_t sizes[],
                         const fmi3Binary values[], size_t count) {
    (void)references;
    (void)sizes;
    (void)values;
    ENTER(SetNONE);
    return (fmi3Status)fmi_check_no_variables(&fmu->common, n + count, "Binary");
}

/* ---- clocks: there are none -------------------------------------------------------------------------------- */

#define NO_CLOCKS(function, arguments, ...)                     \
    fmi3Status function arguments {                             \
        (void)references;                                       \
        const void *const unused[] = {__VA_ARGS__};             \
        (void)unused;                                           \
        ENTER(Clocks);                                          \
        return (fmi3Status)fmi_check_no_variables(&fmu->common, n, "Clock");                                         \
    }
#define CLOCKS fmi3Instance instance, const fmi3ValueReference references[], size_t n

NO_CLOCKS(fmi3GetClock, (CLOCKS, fmi3Clock values[]), values)
NO_CLOCKS(fmi3SetClock, (CLOCKS, const fmi3Clock values[]), values)
NO_CLOCKS(fmi3GetIntervalDecimal, (CLOCKS, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]), intervals,
          qualifiers)
NO_CLOCKS(fmi3GetIntervalFraction,
          (CLOCKS, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]), counters,
          resolutions, qualifiers)
NO_CLOCKS(fmi3GetShiftDecimal, (CLOCKS, fmi3Float64 shifts[]), shifts)
NO_CLOCKS(fmi3GetShiftFraction, (CLOCKS, fmi3UInt64 counters[], fmi3UInt64 resolutions[]), counters, resolutions)
NO_CLOCKS(fmi3SetIntervalDecimal, (CLOCKS, const fmi3Float64 intervals[]), intervals)
NO_CLOCKS(fmi3SetIntervalFraction, (CLOCKS, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]), counters,
          resolutions)
NO_CLOCKS(fmi3SetShiftDecimal, (CLOCKS, const fmi3Float64 shifts[]), shifts)
NO_CLOCKS(fmi3SetShiftFraction, (CLOCKS, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]), counters,
          resolutions)

fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clock, fmi3Float64 time) {
    (void)clock;
    (void)time;
    ENTER(ActivateModelPartition);
    return (fmi3Status)core_report(core, ERROR, "%s: there are no model partitions", __func__);
}

/* ---- dependencies and derivatives -------------------------------------------------------------------------- */

static fmi3Status no_dependencies(const Instance *core, const char *function) {
    return (fmi3Status)core_report(core, ERROR, "%s: see the model description; providesPerElementDependencies is false",
                                   function);
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference reference, size_t *n) {
    (void)reference;
    (void)n;
    ENTER(VariableDependencies);
    return no_dependencies(core, __func__);
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent, size_t elements[],
                                       fmi3ValueReference independents[], size_t elements_of_independents[],
                                       fmi3DependencyKind kinds[], size_t n) {
    (void)dependent;
    (void)elements;
    (void)independents;
    (void)elements_of_independents;
    (void)kinds;
    (void)n;
    ENTER(VariableDependencies);
    return no_dependencies(core, __func__);
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t n_unknown,
                                        const fmi3ValueReference knowns[], size_t n_known, const fmi3Float64 seed[],
                                        size_t n_seed, fmi3Float64 sensitivity[], size_t n_sensitivity) {
    ENTER(GetDirectionalDerivative);
    if (n_known > 0) NEED(knowns);
    if (n_seed > 0) NEED(seed);
    if (n_unknown > 0) NEED(unknowns);
    if (n_sensitivity > 0) NEED(sensitivity);
    return (fmi3Status)core_directional_derivative(core, unknowns, n_unknown, knowns, n_known, seed, n_seed,
                                                   sensitivity, n_sensitivity);
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t n_unknown,
                                    const fmi3ValueReference knowns[], size_t n_known, const fmi3Float64 seed[],
                                    size_t n_seed, fmi3Float64 sensitivity[], size_t n_sensitivity) {
    ENTER(GetAdjointDerivative);
    if (n_known > 0) NEED(knowns);
    if (n_seed > 0) NEED(seed);
    if (n_unknown > 0) NEED(unknowns);
    if (n_sensitivity > 0) NEED(sensitivity);
    return (fmi3Status)core_adjoint_derivative(core, unknowns, n_unknown, knowns, n_known, seed, n_seed, sensitivity,
                                               n_sensitivity);
}

/* ---- co-simulation ----------------------------------------------------------------------------------------- */

fmi3Status fmi3EnterStepMode(fmi3Instance instance) {
    ENTER(EnterStepMode);
    core_enter_step_mode(core);
    return fmi3OK;
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference references[], size_t n,
                                    const fmi3Int32 orders[], fmi3Float64 values[], size_t count) {
    ENTER(GetOutputDerivatives);
    if (n == 0 && count == 0) return fmi3OK;
    NEED(references);
    NEED(orders);
    NEED(values);
    for (size_t i = 0; i < n; i++)
        if (orders[i] != 1)
            return (fmi3Status)core_report(core, ERROR, "output derivatives of order %d: the order must be 1",
                                           (int)orders[i]);
    return (fmi3Status)core_output_derivatives(core, references, n, values, count);
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 time, fmi3Float64 size, fmi3Boolean no_way_back,
                      fmi3Boolean *event_needed, fmi3Boolean *terminate, fmi3Boolean *early_return,
                      fmi3Float64 *last_time) {
    (void)no_way_back;
    ENTER(DoStep);
    NEED(event_needed);
    NEED(terminate);
    NEED(early_return);
    NEED(last_time);
    if (time + size > fmu->stop + 1e-6 * size) /* rounding of the importer's clock */
        return (fmi3Status)core_report(core, ERROR, "step from t = %.15g to %.15g: the stop time is %.15g", time,
                                       time + size, fmu->stop);
    Arrival arrival;
    const Status status = fmi_told(&fmu->common, core_step(core, time, size, &arrival));
    if (status > WARNING) {
        *event_needed = *terminate = *early_return = fmi3False;
        *last_time = core_time(core);
        return (fmi3Status)status;
    }
    *event_needed = arrival.event != 0;
    *terminate = fmi3False;
    *early_return = arrival.early != 0;
    *last_time = arrival.time;
    return (fmi3Status)status;
}

/* ---- model exchange ---------------------------------------------------------------------------------------- */

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *n) {
    ENTER(GetNumberOf);
    NEED(n);
    *n = model.states;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *n) {
    ENTER(GetNumberOf);
    NEED(n);
    *n = model.indicators;
    return fmi3OK;
}

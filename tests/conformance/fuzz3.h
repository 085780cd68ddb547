/* The functions of FMI 3.0 with random arguments, and what is to become of each call. */
#include "forge.h"

#define F (it.library->fmi3)

enum { ANY3 = ANY | CONFIGURATION };

static int get_version3(void) { return strcmp(F.GetVersion(), "3.0") != 0; }

static int set_debug_logging3(void) {
    const size_t n = below(4);
    const char **names = categories(n);
    const int on = one_in(2);
    return F.SetDebugLogging(component(), on, n, given(names, n));
}

/* ---- life ------------------------------------------------------------------------------------------------------ */

static int enter_configuration3(void) {
    if (it.library->plan.sizes.n == 0) expect(FAILS);
    now.phase = CONFIGURATION;
    return F.EnterConfigurationMode(component());
}

static int exit_configuration3(void) {
    now.phase = INSTANTIATED;
    return F.ExitConfigurationMode(component());
}

static int enter_initialization3(void) {
    const Experiment experiment = some_experiment();
    now.phase = INITIALIZATION;
    now.time = experiment.start;
    return F.EnterInitializationMode(component(), experiment.tolerance_given, experiment.tolerance, experiment.start,
                                     experiment.stop_given, experiment.stop);
}

static int exit_initialization3(void) {
    static const unsigned NEXT[] = {EVENT, STEP, STEP_EVENT};
    now.phase = NEXT[it.fmu.kind];
    if (it.wild) expect(MAY_FAIL);
    return F.ExitInitializationMode(component());
}

static int enter_event_mode3(void) {
    now.phase = it.fmu.kind == MODEL_EXCHANGE ? EVENT : STEP_EVENT;
    if (it.fmu.kind == CO_SIMULATION) expect(FAILS);
    return F.EnterEventMode(component());
}

static int update_discrete_states3(void) {
    if (it.wild) expect(MAY_FAIL);
    bool *flags = take(5 * sizeof *flags);
    double *next = take(sizeof *next);
    return F.UpdateDiscreteStates(component(), given(flags, 1), given(flags + 1, 1), given(flags + 2, 1),
                                  given(flags + 3, 1), given(flags + 4, 1), given(next, 1));
}

static int evaluate_discrete_states3(void) {
    expect(FAILS);
    return F.EvaluateDiscreteStates(component());
}

static int terminate3(void) {
    now.phase = TERMINATED;
    return F.Terminate(component());
}

static int reset3(void) {
    begin_anew();
    return F.Reset(component());
}

/* Instances that must not come to be. */
static int instantiate_model_exchange3(void) {
    const size_t fault = below(3);
    now.nobody = 1;
    return F.InstantiateModelExchange(instance_name(fault), fault == 2 ? "{other}" : it.library->plan.token, NULL, false,
                                      false, NULL, NULL)
               ? fmi3OK
               : fmi3Error;
}

static int instantiate_co_simulation3(void) {
    const size_t fault = below(3);
    now.nobody = 1;
    return F.InstantiateCoSimulation(instance_name(fault), fault == 2 ? NULL : it.library->plan.token, NULL, false, false,
                                     one_in(2), one_in(2), NULL, 0, NULL, NULL, NULL)
               ? fmi3OK
               : fmi3Error;
}

static int instantiate_scheduled_execution3(void) {
    now.nobody = 1;
    return F.InstantiateScheduledExecution("it", it.library->plan.token, NULL, false, false, NULL, NULL, NULL, NULL, NULL)
               ? fmi3OK
               : fmi3Error;
}

static void free_saved3(void) {
    for (size_t i = 0; i < POOL; i++) F.FreeFMUState(it.fmu.component, &it.pool[i].state);
}

static int free_instance3(void) {
    if (one_in(10)) F.FreeInstance(NULL);
    free_saved3();
    replace_instance();
    return fmi3OK;
}

/* ---- variables ------------------------------------------------------------------------------------------------- */

static int get_float64_3(void) {
    size_t n = some(&it.all), count;
    unsigned *references = references_of(&it.all, n, &count);
    count = length_of(count);
    double *values = take(count * sizeof *values);
    if (it.wild) expect(MAY_FAIL);
    return finite(F.GetFloat64(component(), given(references, n), n, given(values, count), count), values, count);
}

static int set_float64_3(void) {
    const Setting setting = some_setting();
    const size_t count = length_of(setting.count);
    double *values = take(count * sizeof *values);
    memcpy(values, setting.values, (count < setting.count ? count : setting.count) * sizeof *values);
    return F.SetFloat64(component(), given(setting.references, setting.n), setting.n, given(values, count), count);
}

static int get_int32_3(void) {
    size_t n = below(3), count;
    unsigned *references = references_of(&it.library->plan.integers, n, &count);
    count = length_of(n);
    int *values = take(count * sizeof *values);
    return F.GetInt32(component(), given(references, n), n, given(values, count), count);
}

static int set_int32_3(void) {
    size_t n = below(3), count;
    unsigned *references = references_of(&it.library->plan.integers, n, &count);
    int *values = integer_settings(n);
    count = length_of(n);
    if (count > n) values = take(count * sizeof *values);
    if (n > 0 && it.phase > INITIALIZATION) expect(FAILS);
    return F.SetInt32(component(), given(references, n), n, given(values, count), count);
}

static int get_uint64_3(void) {
    size_t n = below(3), count;
    unsigned *references = references_of(&it.library->plan.sizes, n, &count);
    count = length_of(n);
    uint64_t *values = take(count * sizeof *values);
    return F.GetUInt64(component(), given(references, n), n, given(values, count), count);
}

static int set_uint64_3(void) {
    const Group *sizes = &it.library->plan.sizes;
    size_t n = below(3), count;
    unsigned *references = references_of(sizes, n, &count);
    count = length_of(n);
    uint64_t *values = take(count * sizeof *values);
    for (size_t i = 0; i < count; i++) values[i] = sizes->n > 0 && !one_in(4) ? (uint64_t)sizes->values[0] : below(100);
    if (n > 0) expect(MAY_FAIL); /* another size than that for which the FMU is built */
    return F.SetUInt64(component(), given(references, n), n, given(values, count), count);
}

/* Types of which there are no variables. */
#define NONE_OF(Type)                                                                                                  \
    static int get_##Type##_3(void) {                                                                                  \
        const size_t n = below(3), count = length_of(n);                                                               \
        if (n > 0) expect(FAILS);                                                                                      \
        return F.Get##Type(component(), take(n * sizeof(unsigned)), n, take(count * sizeof(fmi3##Type)), count);       \
    }                                                                                                                  \
    static int set_##Type##_3(void) {                                                                                  \
        const size_t n = below(3), count = length_of(n);                                                               \
        if (n > 0) expect(FAILS);                                                                                      \
        return F.Set##Type(component(), take(n * sizeof(unsigned)), n, take(count * sizeof(fmi3##Type)), count);       \
    }

NONE_OF(Float32)
NONE_OF(Int8)
NONE_OF(UInt8)
NONE_OF(Int16)
NONE_OF(UInt16)
NONE_OF(UInt32)
NONE_OF(Int64)
NONE_OF(Boolean)
NONE_OF(String)

static int get_binary3(void) {
    const size_t n = below(3), count = length_of(n);
    if (n > 0) expect(FAILS);
    return F.GetBinary(component(), take(n * sizeof(unsigned)), n, take(count * sizeof(size_t)),
                       take(count * sizeof(fmi3Binary)), count);
}

static int set_binary3(void) {
    const size_t n = below(3), count = length_of(n);
    if (n > 0) expect(FAILS);
    return F.SetBinary(component(), take(n * sizeof(unsigned)), n, take(count * sizeof(size_t)),
                       take(count * sizeof(fmi3Binary)), count);
}

/* Nor are there clocks. */
#define CLOCKS(function, name, ...)                                         \
    static int function(void) {                                             \
        const size_t n = below(3);                                          \
        expect(n > 0 ? FAILS : MAY_FAIL);                                   \
        void *a = take(n * sizeof(double)), *b = take(n * sizeof(double));  \
        void *c = take(n * sizeof(double));                                 \
        (void)a, (void)b, (void)c;                                          \
        return F.name(component(), take(n * sizeof(unsigned)), n, __VA_ARGS__); \
    }

CLOCKS(get_clock3, GetClock, a)
CLOCKS(set_clock3, SetClock, a)
CLOCKS(get_interval_decimal3, GetIntervalDecimal, a, b)
CLOCKS(get_interval_fraction3, GetIntervalFraction, a, b, c)
CLOCKS(get_shift_decimal3, GetShiftDecimal, a)
CLOCKS(get_shift_fraction3, GetShiftFraction, a, b)
CLOCKS(set_interval_decimal3, SetIntervalDecimal, a)
CLOCKS(set_interval_fraction3, SetIntervalFraction, a, b)
CLOCKS(set_shift_decimal3, SetShiftDecimal, a)
CLOCKS(set_shift_fraction3, SetShiftFraction, a, b)

static int activate_model_partition3(void) {
    expect(FAILS);
    return F.ActivateModelPartition(component(), 0, it.time);
}

static int get_number_of_dependencies3(void) {
    expect(FAILS);
    return F.GetNumberOfVariableDependencies(component(), 0, given(take(sizeof(size_t)), 1));
}

static int get_dependencies3(void) {
    expect(FAILS);
    return F.GetVariableDependencies(component(), 0, take(sizeof(size_t)), take(sizeof(unsigned)), take(sizeof(size_t)),
                                     take(sizeof(fmi3DependencyKind)), 1);
}

/* ---- saved states ---------------------------------------------------------------------------------------------- */

static int get_state3(void) {
    Saved *chosen = saved();
    const int wanted = !one_in(30);
    if (!wanted) expect(FAILS);
    const int status = F.GetFMUState(component(), wanted ? &chosen->state : NULL);
    if (status == fmi3OK) *chosen = (Saved){chosen->state, it.phase, it.time, it.wild, 0};
    return status;
}

static int set_state3(void) { return F.SetFMUState(component(), some_state()); }

static int free_state3(void) {
    Saved *chosen = saved();
    return F.FreeFMUState(component(), one_in(30) ? NULL : &chosen->state);
}

static int state_size3(void) {
    const Saved *chosen = saved();
    if (chosen->state == NULL) expect(FAILS);
    return F.SerializedFMUStateSize(component(), chosen->state, given(take(sizeof(size_t)), 1));
}

static int serialize3(void) {
    const Saved *chosen = saved();
    size_t size;
    char *space = space_for(chosen, &size);
    return F.SerializeFMUState(component(), chosen->state, given(space, 1), size);
}

static int deserialize3(void) {
    Saved *target = saved();
    const Offer offer = some_bytes();
    const int status = F.DeserializeFMUState(component(), given((fmi3Byte *)offer.bytes, 1), offer.size, &target->state);
    return offered(offer, status, target);
}

/* ---- derivatives ----------------------------------------------------------------------------------------------- */

static int derivative3(fmi3GetDirectionalDerivativeTYPE *function, int adjoint) {
    const Plan *plan = &it.library->plan;
    size_t unknown_n = some(&plan->outputs), known_n = some(&plan->inputs), unknown_count, known_count;
    unsigned *unknowns = references_of(&plan->outputs, unknown_n, &unknown_count);
    unsigned *knowns = references_of(&plan->inputs, known_n, &known_count);
    const size_t seed_count = length_of(adjoint ? unknown_count : known_count);
    const size_t result_count = length_of(adjoint ? known_count : unknown_count);
    double *seeds = numbers_at(seed_count, 1), *result = take(result_count * sizeof *result);
    expect(it.wild || now.wild || result_count == 0 ? MAY_FAIL : WORKS);
    if (result_count == 0 && now.expected == FAILS) now.expected = MAY_FAIL;
    return finite(function(component(), given(unknowns, unknown_n), unknown_n, given(knowns, known_n), known_n,
                           given(seeds, seed_count), seed_count, given(result, result_count), result_count),
                  result, result_count);
}

static int directional_derivative3(void) { return derivative3(F.GetDirectionalDerivative, 0); }

static int adjoint_derivative3(void) { return derivative3(F.GetAdjointDerivative, 1); }

static int get_output_derivatives3(void) {
    const Group *outputs = &it.library->plan.outputs;
    size_t n = some(outputs), count;
    unsigned *references = references_of(outputs, n, &count);
    int *orders = first_orders(n);
    count = length_of(count);
    double *values = take(count * sizeof *values);
    if (it.wild) expect(MAY_FAIL);
    return finite(F.GetOutputDerivatives(component(), given(references, n), n, given(orders, n), given(values, count),
                                         count),
                  values, count);
}

/* ---- co-simulation --------------------------------------------------------------------------------------------- */

/* Inside a step only reading is allowed. */
static void update3(fmi3InstanceEnvironment environment, fmi3Float64 time, fmi3Boolean settable, fmi3Boolean readable,
                    fmi3Boolean finished, fmi3Boolean may_return, fmi3Boolean *early, fmi3Float64 *early_time) {
    Fmu *fmu = environment;
    bool flags[3];
    double last;
    (void)finished;
    if (fmu != &it.fmu) return;
    const int worst = messages.worst;
    *early = may_return && one_in(8);
    if (*early) *early_time = one_in(10) ? NAN : time + (one_in(2) ? it.library->plan.step * fraction() : 0);
    if (settable && it.library->plan.inputs.n > 0) {
        const Group *inputs = &it.library->plan.inputs;
        double *values = take(inputs->count * sizeof *values);
        for (size_t i = 0; i < inputs->count; i++)
            values[i] = inputs->values[i] * (it.wild ? 1 + 0.01 * fraction() : 1);
        if (one_in(2) && F.SetFloat64(fmu->component, inputs->references, inputs->n, values, inputs->count) != 0 && !it.wild)
            now.fault = "inputs cannot be given inside a step";
    }
    if (readable && it.all.n > 0) {
        double *values = calloc(it.all.count, sizeof *values);
        if (values && F.GetFloat64(fmu->component, it.all.references, it.all.n, values, it.all.count) != 0 && !it.wild)
            now.fault = "values cannot be read inside a step";
        free(values);
    }
    if (one_in(20)
        && (F.Reset(fmu->component) != fmi3Error || F.Terminate(fmu->component) != fmi3Error
            || F.EnterEventMode(fmu->component) != fmi3Error
            || F.DoStep(fmu->component, time, 1, true, &flags[0], &flags[1], &flags[2], &last) != fmi3Error))
        now.fault = "what is forbidden inside a step is not refused";
    messages.worst = worst;
}

static int enter_step_mode3(void) {
    now.phase = STEP;
    return F.EnterStepMode(component());
}

static int do_step3(void) {
    const double time = step_time(), size = step_size();
    bool *flags = take(3 * sizeof *flags);
    double *last = take(sizeof *last), *given_last;
    bool *event = given(flags, 1), *terminate = given(flags + 1, 1), *early = given(flags + 2, 1);
    given_last = given(last, 1);
    expect(MAY_FAIL); /* inputs that jump at random lead anywhere, and stop times are not kept in mind here */
    const int status =
        stepped(F.DoStep(component(), time, size, one_in(2), event, terminate, early, given_last), size);
    if (status == fmi3OK) {
        now.time = *last;
        if (*terminate) now.fault = "the simulation never ends by itself";
        if (*early && it.fmu.kind != CO_SIMULATION_WITH_EVENTS) now.fault = "the step must not return early";
        if (*early ? !(*last <= time + size) : fabs(*last - (time + size)) > 1e-9 * (1 + fabs(*last)))
            now.fault = "the last successful time is wrong";
    } else if (status == fmi3Discard && given_last && *last != it.time) {
        now.fault = "a step that is taken back does not end where it began";
    }
    return status;
}

/* ---- model exchange -------------------------------------------------------------------------------------------- */

static int enter_continuous_mode3(void) {
    now.phase = CONTINUOUS;
    return F.EnterContinuousTimeMode(component());
}

static int completed_integrator_step3(void) {
    bool *flags = take(2 * sizeof *flags);
    return F.CompletedIntegratorStep(component(), one_in(2), given(flags, 1), given(flags + 1, 1));
}

static int set_time3(void) {
    now.time = next_time();
    return F.SetTime(component(), now.time);
}

static int set_states3(void) {
    const size_t n = length_of(it.library->plan.states);
    double *states = numbers_at(n, 0.5);
    now.wild = 1; /* states at random need not keep constraints */
    return F.SetContinuousStates(component(), given(states, n), n);
}

static int get_states3(void) {
    const size_t n = length_of(it.library->plan.states);
    double *states = take(n * sizeof *states);
    if (it.wild) expect(MAY_FAIL);
    return finite(F.GetContinuousStates(component(), given(states, n), n), states, n);
}

static int get_derivatives3(void) {
    const size_t n = length_of(it.library->plan.states);
    double *derivatives = take(n * sizeof *derivatives);
    if (it.wild) expect(MAY_FAIL);
    return finite(F.GetContinuousStateDerivatives(component(), given(derivatives, n), n), derivatives, n);
}

static int get_nominals3(void) {
    const size_t n = length_of(it.library->plan.states);
    return F.GetNominalsOfContinuousStates(component(), given(take(n * sizeof(double)), n), n);
}

static int get_event_indicators3(void) {
    const size_t n = length_of(0);
    return F.GetEventIndicators(component(), given(take(n * sizeof(double)), n), n);
}

static int get_number_of_states3(void) {
    size_t *n = take(sizeof *n);
    const int status = F.GetNumberOfContinuousStates(component(), given(n, 1));
    if (status == fmi3OK && *n != it.library->plan.states) now.fault = "there is another number of states";
    return status;
}

static int get_number_of_indicators3(void) {
    return F.GetNumberOfEventIndicators(component(), given(take(sizeof(size_t)), 1));
}

/* ---- all of them ----------------------------------------------------------------------------------------------- */

/* Everything that can be read of an instance. */
static size_t look3(Fmu *fmu, unsigned phase, double *seen) {
    const Plan *plan = &it.library->plan;
    double *start = seen;
    if (F.GetFloat64(fmu->component, it.all.references, it.all.n, seen, it.all.count) == fmi3OK) seen += it.all.count;
    else /* some may not be finite */
        for (size_t i = 0; i < it.all.n; seen += it.all.sizes[i++])
            if (F.GetFloat64(fmu->component, &it.all.references[i], 1, seen, it.all.sizes[i]) != fmi3OK)
                memset(seen, 0, it.all.sizes[i] * sizeof *seen);
    for (size_t i = 0; i < plan->integers.n; i++) {
        int value = -1;
        F.GetInt32(fmu->component, &plan->integers.references[i], 1, &value, 1);
        *seen++ = value;
    }
    if (phase & (EVENT | CONTINUOUS) && plan->states > 0) {
        if (F.GetContinuousStates(fmu->component, seen, plan->states) != fmi3OK)
            memset(seen, 0, plan->states * sizeof *seen);
        seen += plan->states;
        F.GetNominalsOfContinuousStates(fmu->component, seen, plan->states);
        seen += plan->states;
    }
    return (size_t)(seen - start);
}

#define NO_VARIABLES(Type)                                                                \
    {"Get" #Type, ANY & ~INSTANTIATED, INSTANTIATED | CONFIGURATION, get_##Type##_3, 0, 0}, \
    {"Set" #Type, BEFORE | STEP | EVENT, CONTINUOUS | STEP_EVENT, set_##Type##_3, 0, 0}

static Operation OPERATIONS3[] = {
    {"GetVersion", ANY3, 0, get_version3, 0, 0},
    {"SetDebugLogging", ANY3, 0, set_debug_logging3, 0, 0},
    {"InstantiateModelExchange", 0, 0, instantiate_model_exchange3, 0, 0},
    {"InstantiateCoSimulation", 0, 0, instantiate_co_simulation3, 0, 0},
    {"InstantiateScheduledExecution", 0, 0, instantiate_scheduled_execution3, 0, 0},
    {"FreeInstance", ANY3, 0, free_instance3, 0, 0},
    {"EnterConfigurationMode", INSTANTIATED, 0, enter_configuration3, 0, 0},
    {"ExitConfigurationMode", CONFIGURATION, 0, exit_configuration3, 0, 0},
    {"EnterInitializationMode", INSTANTIATED, 0, enter_initialization3, 0, 0},
    {"ExitInitializationMode", INITIALIZATION, 0, exit_initialization3, 0, 0},
    {"EnterEventMode", CONTINUOUS | STEP, EVENT | STEP_EVENT, enter_event_mode3, 0, 0},
    {"UpdateDiscreteStates", EVENT | STEP_EVENT, 0, update_discrete_states3, 0, 0},
    {"EvaluateDiscreteStates", EVENT | STEP_EVENT, INITIALIZATION, evaluate_discrete_states3, 0, 0},
    {"EnterContinuousTimeMode", EVENT, 0, enter_continuous_mode3, 0, 0},
    {"EnterStepMode", STEP_EVENT, 0, enter_step_mode3, 0, 0},
    {"Terminate", RUNNING, 0, terminate3, 0, 0},
    {"Reset", ANY3, 0, reset3, 0, 0},
    {"GetFloat64", ANY & ~INSTANTIATED, INSTANTIATED, get_float64_3, 0, 0},
    {"SetFloat64", ANY & ~TERMINATED, 0, set_float64_3, 0, 0},
    {"GetInt32", ANY & ~INSTANTIATED, INSTANTIATED, get_int32_3, 0, 0},
    {"SetInt32", BEFORE | STEP | EVENT, CONTINUOUS | STEP_EVENT, set_int32_3, 0, 0},
    {"GetUInt64", ANY & ~INSTANTIATED, INSTANTIATED | CONFIGURATION, get_uint64_3, 0, 0},
    {"SetUInt64", CONFIGURATION, ANY, set_uint64_3, 0, 0},
    NO_VARIABLES(Float32),
    NO_VARIABLES(Int8),
    NO_VARIABLES(UInt8),
    NO_VARIABLES(Int16),
    NO_VARIABLES(UInt16),
    NO_VARIABLES(UInt32),
    NO_VARIABLES(Int64),
    NO_VARIABLES(Boolean),
    NO_VARIABLES(String),
    {"GetBinary", ANY & ~INSTANTIATED, INSTANTIATED | CONFIGURATION, get_binary3, 0, 0},
    {"SetBinary", BEFORE | STEP | EVENT, CONTINUOUS | STEP_EVENT, set_binary3, 0, 0},
    {"GetClock", 0, ANY3, get_clock3, 0, 0},
    {"SetClock", 0, ANY3, set_clock3, 0, 0},
    {"GetIntervalDecimal", 0, ANY3, get_interval_decimal3, 0, 0},
    {"GetIntervalFraction", 0, ANY3, get_interval_fraction3, 0, 0},
    {"GetShiftDecimal", 0, ANY3, get_shift_decimal3, 0, 0},
    {"GetShiftFraction", 0, ANY3, get_shift_fraction3, 0, 0},
    {"SetIntervalDecimal", 0, ANY3, set_interval_decimal3, 0, 0},
    {"SetIntervalFraction", 0, ANY3, set_interval_fraction3, 0, 0},
    {"SetShiftDecimal", 0, ANY3, set_shift_decimal3, 0, 0},
    {"SetShiftFraction", 0, ANY3, set_shift_fraction3, 0, 0},
    {"ActivateModelPartition", 0, ANY3, activate_model_partition3, 0, 0},
    {"GetNumberOfVariableDependencies", 0, ANY3, get_number_of_dependencies3, 0, 0},
    {"GetVariableDependencies", 0, ANY3, get_dependencies3, 0, 0},
    {"GetFMUState", ANY, CONFIGURATION, get_state3, 0, 0},
    {"SetFMUState", ANY, CONFIGURATION, set_state3, 0, 0},
    {"FreeFMUState", ANY, CONFIGURATION, free_state3, 0, 0},
    {"SerializedFMUStateSize", ANY, CONFIGURATION, state_size3, 0, 0},
    {"SerializeFMUState", ANY, CONFIGURATION, serialize3, 0, 0},
    {"DeserializeFMUState", ANY, CONFIGURATION, deserialize3, 0, 0},
    {"GetDirectionalDerivative", INITIALIZATION | RUNNING, TERMINATED, directional_derivative3, 0, 0},
    {"GetAdjointDerivative", INITIALIZATION | RUNNING, TERMINATED, adjoint_derivative3, 0, 0},
    {"GetOutputDerivatives", STEP, TERMINATED, get_output_derivatives3, 0, 0},
    {"DoStep", STEP, 0, do_step3, 0, 0},
    {"CompletedIntegratorStep", CONTINUOUS, 0, completed_integrator_step3, 0, 0},
    {"SetTime", CONTINUOUS, EVENT, set_time3, 0, 0},
    {"SetContinuousStates", CONTINUOUS, 0, set_states3, 0, 0},
    {"GetContinuousStates", EVENT | CONTINUOUS, ANY, get_states3, 0, 0},
    {"GetContinuousStateDerivatives", EVENT | CONTINUOUS, ANY, get_derivatives3, 0, 0},
    {"GetNominalsOfContinuousStates", EVENT | CONTINUOUS, ANY, get_nominals3, 0, 0},
    {"GetEventIndicators", EVENT | CONTINUOUS, ANY, get_event_indicators3, 0, 0},
    {"GetNumberOfContinuousStates", EVENT | CONTINUOUS, ANY, get_number_of_states3, 0, 0},
    {"GetNumberOfEventIndicators", EVENT | CONTINUOUS, ANY, get_number_of_indicators3, 0, 0},
};

#undef F

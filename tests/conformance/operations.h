/* The functions of both versions with random arguments, and what is to become of each call. */
#include "forge.h"

#define TWO (it.library->plan.version == 2)
#define F2 (it.library->fmi2)
#define F3 (it.library->fmi3)
/* One call for both versions, under their names and with their arguments. */
#define CALL(name2, arguments2, name3, arguments3) (TWO ? (int)F2.name2 arguments2 : (int)F3.name3 arguments3)
#define BOTH(name, arguments) CALL(name, arguments, name, arguments)

static int get_types_platform(void) { return strcmp(F2.GetTypesPlatform(), fmi2TypesPlatform) != 0; }

static int get_version(void) {
    return TWO ? strcmp(F2.GetVersion(), "2.0") != 0 : strcmp(F3.GetVersion(), "3.0") != 0;
}

static int set_debug_logging(void) {
    const size_t n = below(4);
    const char **names = categories(n);
    return BOTH(SetDebugLogging, (component(), one_in(2), n, given(names, n)));
}

/* ---- life ------------------------------------------------------------------------------------------------------ */

/* Instances that must not come to be. */
static int instantiate2(void) {
    fmi2CallbackFunctions callbacks = it.fmu.callbacks;
    const size_t fault = below(4);
    void *instance = F2.Instantiate(instance_name(fault), fmi2CoSimulation,
                                    fault == 2 ? "{other}" : it.library->plan.token, NULL,
                                    fault == 3 ? NULL : &callbacks, fmi2False, fmi2False);
    now.nobody = 1;
    return instance == NULL ? fmi2Error : fmi2OK;
}

static int instantiate_model_exchange3(void) {
    const size_t fault = below(3);
    const char *token = fault == 2 ? "{other}" : it.library->plan.token;
    now.nobody = 1;
    return F3.InstantiateModelExchange(instance_name(fault), token, NULL, 0, 0, NULL, NULL) ? fmi3OK : fmi3Error;
}

static int instantiate_co_simulation3(void) {
    const size_t fault = below(3);
    const char *token = fault == 2 ? NULL : it.library->plan.token;
    now.nobody = 1;
    return F3.InstantiateCoSimulation(instance_name(fault), token, NULL, false, false, one_in(2), one_in(2), NULL, 0, NULL,
                                      NULL, NULL)
               ? fmi3OK
               : fmi3Error;
}

static int instantiate_scheduled_execution3(void) {
    const char *token = it.library->plan.token;
    now.nobody = 1;
    return F3.InstantiateScheduledExecution("it", token, NULL, 0, 0, NULL, NULL, NULL, NULL, NULL) ? fmi3OK : fmi3Error;
}

static void free_saved(void) {
    for (size_t i = 0; i < POOL; i++)
        CALL(FreeFMUstate, (it.fmu.component, &it.pool[i].state), FreeFMUState, (it.fmu.component, &it.pool[i].state));
}

static int free_instance(void) {
    if (one_in(10)) TWO ? F2.FreeInstance(NULL) : F3.FreeInstance(NULL);
    free_saved();
    replace_instance();
    return 0;
}

static int enter_configuration3(void) {
    if (it.library->plan.sizes.n == 0) expect(FAILS);
    now.phase = CONFIGURATION;
    return F3.EnterConfigurationMode(component());
}

static int exit_configuration3(void) {
    now.phase = INSTANTIATED;
    return F3.ExitConfigurationMode(component());
}

static int setup_experiment2(void) {
    const Experiment e = some_experiment();
    now.time = e.start;
    return F2.SetupExperiment(component(), e.tolerance_given, e.tolerance, e.start, e.stop_given, e.stop);
}

static int enter_initialization(void) {
    now.phase = INITIALIZATION;
    if (TWO) return F2.EnterInitializationMode(component());
    const Experiment e = some_experiment();
    now.time = e.start;
    return F3.EnterInitializationMode(component(), e.tolerance_given, e.tolerance, e.start, e.stop_given, e.stop);
}

static int exit_initialization(void) {
    static const unsigned NEXT[] = {EVENT, STEP, STEP_EVENT};
    now.phase = NEXT[it.fmu.kind];
    if (it.wild) expect(MAY_FAIL);
    return BOTH(ExitInitializationMode, (component()));
}

static int terminate_instance(void) {
    now.phase = TERMINATED;
    return BOTH(Terminate, (component()));
}

static int reset(void) {
    begin_anew();
    return BOTH(Reset, (component()));
}

/* ---- variables ------------------------------------------------------------------------------------------------- */

/* How many values are said to be there: FMI 2.0 does not ask. */
static size_t values_of(size_t count) { return TWO ? count : length_of(count); }

static int get_reals(void) {
    size_t n = some(&it.all), count;
    unsigned *references = references_of(&it.all, n, &count);
    count = values_of(count);
    double *values = take(count * sizeof *values);
    if (it.wild) expect(MAY_FAIL);
    return finite(CALL(GetReal, (component(), given(references, n), n, given(values, n)), GetFloat64,
                       (component(), given(references, n), n, given(values, count), count)),
                  values, count);
}

static int set_reals(void) {
    const Setting setting = some_setting();
    const size_t n = setting.n, count = values_of(setting.count);
    double *values = take(count * sizeof *values);
    memcpy(values, setting.values, (count < setting.count ? count : setting.count) * sizeof *values);
    return CALL(SetReal, (component(), given(setting.references, n), n, given(values, n)), SetFloat64,
                (component(), given(setting.references, n), n, given(values, count), count));
}

static int get_integers(void) {
    size_t n = below(3), count;
    const Plan *plan = &it.library->plan;
    unsigned *references = references_of(plan->counts.n > 0 && one_in(2) ? &plan->counts : &plan->integers, n, &count);
    count = values_of(count);
    int *values = take(count * sizeof *values);
    if (it.wild) expect(MAY_FAIL);
    return CALL(GetInteger, (component(), given(references, n), n, given(values, n)), GetInt32,
                (component(), given(references, n), n, given(values, count), count));
}

static int set_counts(void) {
    size_t n = below(3), count;
    unsigned *references = references_of(&it.library->plan.counts, n, &count);
    count = values_of(count);
    int *values = take(count * sizeof *values);
    if (n > 0) expect(FAILS);
    return CALL(SetInteger, (component(), given(references, n), n, given(values, n)), SetInt32,
                (component(), given(references, n), n, given(values, count), count));
}

static int set_integers(void) {
    if (it.library->plan.counts.n > 0 && one_in(2)) return set_counts();
    size_t n = below(3), count;
    unsigned *references = references_of(&it.library->plan.integers, n, &count);
    int *values = integer_settings(n);
    count = values_of(n);
    if (count > n) values = take(count * sizeof *values);
    if (n > 0) expect(MAY_FAIL); /* constants; symplectic_steps of contacts; stiff_solver = 2 */
    if (n > 0 && it.phase > INITIALIZATION) expect(FAILS);
    return CALL(SetInteger, (component(), given(references, n), n, given(values, n)), SetInt32,
                (component(), given(references, n), n, given(values, count), count));
}

/* Booleans that are calculated; they are int in FMI 2.0, bool in FMI 3.0. */
static int get_booleans(void) {
    size_t n = below(3), count;
    unsigned *references = references_of(&it.library->plan.truths, n, &count);
    count = values_of(count);
    void *values = take(count * sizeof(int));
    if (it.wild) expect(MAY_FAIL);
    return CALL(GetBoolean, (component(), given(references, n), n, given(values, n)), GetBoolean,
                (component(), given(references, n), n, given(values, count), count));
}

static int set_booleans(void) {
    size_t n = below(3), count;
    unsigned *references = references_of(&it.library->plan.truths, n, &count);
    count = values_of(count);
    void *values = memset(take(count * sizeof(int)), 0, count * sizeof(int));
    if (n > 0) expect(FAILS);
    return CALL(SetBoolean, (component(), given(references, n), n, given(values, n)), SetBoolean,
                (component(), given(references, n), n, given(values, count), count));
}

static int get_uint64_3(void) {
    size_t n = below(3), count;
    unsigned *references = references_of(&it.library->plan.sizes, n, &count);
    count = length_of(n);
    uint64_t *values = take(count * sizeof *values);
    return F3.GetUInt64(component(), given(references, n), n, given(values, count), count);
}

static int set_uint64_3(void) {
    const Group *sizes = &it.library->plan.sizes;
    size_t n = below(3), count;
    unsigned *references = references_of(sizes, n, &count);
    count = length_of(n);
    uint64_t *values = take(count * sizeof *values);
    for (size_t i = 0; i < count; i++) values[i] = sizes->n > 0 && !one_in(4) ? (uint64_t)sizes->values[0] : below(100);
    if (n > 0) expect(MAY_FAIL); /* another size than that for which the FMU is built */
    return F3.SetUInt64(component(), given(references, n), n, given(values, count), count);
}

/* What there is none of: with n > 0 references it is refused. */
static size_t nothing(void) {
    const size_t n = below(3);
    if (n > 0) expect(FAILS);
    return n;
}

#define NONE_OF(function, values, call)                                             \
    static int function(void) {                                                     \
        const size_t n = nothing(), count = values;                                 \
        void *references = take(n * sizeof(unsigned)), *a = take((count + 1) * 16); \
        void *b = take((count + 1) * 16), *c = take((count + 1) * 16);              \
        (void)count, (void)a, (void)b, (void)c;                                     \
        return (int)call;                                                           \
    }
#define NO_TYPE(Type)                                                                       \
    NONE_OF(get_##Type, values_of(n), F3.Get##Type(component(), references, n, a, count))   \
    NONE_OF(set_##Type, values_of(n), F3.Set##Type(component(), references, n, a, count))
#define NO_TYPE_OF_BOTH(Type)                                                                              \
    NONE_OF(get_##Type, values_of(n),                                                                      \
            CALL(Get##Type, (component(), references, n, a), Get##Type, (component(), references, n, a, count))) \
    NONE_OF(set_##Type, values_of(n),                                                                      \
            CALL(Set##Type, (component(), references, n, a), Set##Type, (component(), references, n, a, count)))

NO_TYPE_OF_BOTH(String)
NO_TYPE(Float32)
NO_TYPE(Int8)
NO_TYPE(UInt8)
NO_TYPE(Int16)
NO_TYPE(UInt16)
NO_TYPE(UInt32)
NO_TYPE(Int64)
NONE_OF(get_binary3, values_of(n), F3.GetBinary(component(), references, n, a, b, count))
NONE_OF(set_binary3, values_of(n), F3.SetBinary(component(), references, n, a, b, count))
NONE_OF(get_clock3, n, F3.GetClock(component(), references, n, a))
NONE_OF(set_clock3, n, F3.SetClock(component(), references, n, a))
NONE_OF(get_interval_decimal3, n, F3.GetIntervalDecimal(component(), references, n, a, b))
NONE_OF(get_interval_fraction3, n, F3.GetIntervalFraction(component(), references, n, a, b, c))
NONE_OF(get_shift_decimal3, n, F3.GetShiftDecimal(component(), references, n, a))
NONE_OF(get_shift_fraction3, n, F3.GetShiftFraction(component(), references, n, a, b))
NONE_OF(set_interval_decimal3, n, F3.SetIntervalDecimal(component(), references, n, a))
NONE_OF(set_interval_fraction3, n, F3.SetIntervalFraction(component(), references, n, a, b))
NONE_OF(set_shift_decimal3, n, F3.SetShiftDecimal(component(), references, n, a))
NONE_OF(set_shift_fraction3, n, F3.SetShiftFraction(component(), references, n, a, b))

static int activate_model_partition3(void) {
    expect(FAILS);
    return F3.ActivateModelPartition(component(), 0, it.time);
}

static int get_number_of_dependencies3(void) {
    expect(FAILS);
    return F3.GetNumberOfVariableDependencies(component(), 0, given(take(sizeof(size_t)), 1));
}

static int get_dependencies3(void) {
    expect(FAILS);
    return F3.GetVariableDependencies(component(), 0, take(sizeof(size_t)), take(sizeof(unsigned)), take(sizeof(size_t)),
                                      take(sizeof(fmi3DependencyKind)), 1);
}

/* ---- saved states ---------------------------------------------------------------------------------------------- */

static int get_state(void) {
    Saved *chosen = saved();
    const int wanted = !one_in(30);
    if (!wanted) expect(FAILS);
    void **state = wanted ? &chosen->state : NULL;
    const int status = CALL(GetFMUstate, (component(), state), GetFMUState, (component(), state));
    if (status == 0) *chosen = (Saved){chosen->state, it.phase, it.time, it.wild, 0};
    return status;
}

static int set_state(void) {
    void *state = some_state();
    return CALL(SetFMUstate, (component(), state), SetFMUState, (component(), state));
}

static int free_state(void) {
    Saved *chosen = saved();
    void **state = one_in(30) ? NULL : &chosen->state;
    return CALL(FreeFMUstate, (component(), state), FreeFMUState, (component(), state));
}

static int state_size(void) {
    const Saved *chosen = saved();
    size_t *size = take(sizeof *size);
    if (chosen->state == NULL) expect(FAILS);
    return CALL(SerializedFMUstateSize, (component(), chosen->state, given(size, 1)), SerializedFMUStateSize, (component(), chosen->state, given(size, 1)));
}

static int serialize(void) {
    const Saved *chosen = saved();
    size_t size;
    void *space = space_for(chosen, &size);
    return CALL(SerializeFMUstate, (component(), chosen->state, given(space, 1), size), SerializeFMUState, (component(), chosen->state, given(space, 1), size));
}

static int deserialize(void) {
    Saved *target = saved();
    const Offer offer = some_bytes();
    const int status = CALL(DeSerializeFMUstate, (component(), given(offer.bytes, 1), offer.size, &target->state), DeserializeFMUState, (component(), given(offer.bytes, 1), offer.size, &target->state));
    return offered(offer, status, target);
}

/* ---- derivatives ----------------------------------------------------------------------------------------------- */

static int derivative(fmi3GetDirectionalDerivativeTYPE *function, int adjoint) {
    const Plan *plan = &it.library->plan;
    size_t unknown_n = some(&plan->outputs), known_n = some(&plan->inputs), unknown_count, known_count;
    unsigned *unknowns = references_of(&plan->outputs, unknown_n, &unknown_count);
    unsigned *knowns = references_of(&plan->inputs, known_n, &known_count);
    const size_t seeds_count = values_of(adjoint ? unknown_count : known_count);
    const size_t count = values_of(adjoint ? known_count : unknown_count);
    double *seeds = numbers_at(seeds_count, 1), *result = take(count * sizeof *result);
    expect(it.wild || now.wild || count == 0 ? MAY_FAIL : WORKS);
    if (count == 0 && now.expected == FAILS) now.expected = MAY_FAIL;
    void *instance = component();
    unknowns = given(unknowns, unknown_n);
    knowns = given(knowns, known_n);
    seeds = given(seeds, seeds_count);
    result = given(result, count);
    if (TWO && unknown_n == 0 && now.expected == FAILS) now.expected = MAY_FAIL; /* nothing is asked for */
    return finite(TWO ? (int)F2.GetDirectionalDerivative(instance, unknowns, unknown_n, knowns, known_n, seeds, result)
                      : (int)function(instance, unknowns, unknown_n, knowns, known_n, seeds, seeds_count, result, count),
                  result, count);
}

static int directional_derivative(void) { return derivative(F3.GetDirectionalDerivative, 0); }

static int adjoint_derivative3(void) { return derivative(F3.GetAdjointDerivative, 1); }

static int set_input_derivatives2(void) {
    const Group *inputs = &it.library->plan.inputs;
    size_t n = some(inputs), count;
    unsigned *references = references_of(inputs, n, &count);
    double *values = numbers_at(n, 0);
    int *orders = take(n * sizeof *orders);
    for (size_t i = 0; i < n; i++) {
        orders[i] = one_in(30) ? (one_in(2) ? 0 : 6) : 1 + (int)below(5);
        if (orders[i] < 1 || orders[i] > 5) expect(FAILS);
    }
    return F2.SetRealInputDerivatives(component(), given(references, n), n, given(orders, n), given(values, n));
}

static int get_output_derivatives(void) {
    const Group *outputs = &it.library->plan.outputs;
    size_t n = some(outputs), count;
    unsigned *references = references_of(outputs, n, &count);
    int *orders = first_orders(n);
    count = values_of(count);
    double *values = take(count * sizeof *values);
    if (it.wild) expect(MAY_FAIL);
    return finite(CALL(GetRealOutputDerivatives,
                       (component(), given(references, n), n, given(orders, n), given(values, n)), GetOutputDerivatives,
                       (component(), given(references, n), n, given(orders, n), given(values, count), count)),
                  values, count);
}

/* ---- co-simulation --------------------------------------------------------------------------------------------- */

/* Inside a step only reading is allowed. */
static void update(fmi3InstanceEnvironment environment, fmi3Float64 time, fmi3Boolean settable, fmi3Boolean readable,
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
        if (one_in(2) && F3.SetFloat64(fmu->component, inputs->references, inputs->n, values, inputs->count) != 0 && !it.wild)
            now.fault = "inputs cannot be given inside a step";
    }
    if (readable && it.all.n > 0) {
        double *values = calloc(it.all.count, sizeof *values);
        if (values && F3.GetFloat64(fmu->component, it.all.references, it.all.n, values, it.all.count) != 0 && !it.wild)
            now.fault = "values cannot be read inside a step";
        free(values);
    }
    if (one_in(20)
        && (F3.Reset(fmu->component) != fmi3Error || F3.Terminate(fmu->component) != fmi3Error
            || F3.EnterEventMode(fmu->component) != fmi3Error
            || F3.DoStep(fmu->component, time, 1, true, &flags[0], &flags[1], &flags[2], &last) != fmi3Error))
        now.fault = "what is forbidden inside a step is not refused";
    messages.worst = worst;
}

static int enter_step_mode3(void) {
    now.phase = STEP;
    return F3.EnterStepMode(component());
}

static int do_step(void) {
    const double time = step_time(), size = step_size();
    expect(MAY_FAIL); /* inputs that jump at random lead anywhere, and stop times are not kept in mind here */
    if (TWO) {
        now.time = time + size;
        return stepped(F2.DoStep(component(), time, size, (int)below(2)), size);
    }
    bool *flags = take(3 * sizeof *flags);
    double *last = take(sizeof *last), *given_last;
    bool *event = given(flags, 1), *terminate = given(flags + 1, 1), *early = given(flags + 2, 1);
    given_last = given(last, 1);
    const int status =
        stepped(F3.DoStep(component(), time, size, one_in(2), event, terminate, early, given_last), size);
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

static int cancel_step2(void) {
    expect(FAILS);
    return F2.CancelStep(component());
}

static int get_status2(void) {
    fmi2Status *value = take(sizeof *value);
    expect(FAILS);
    return F2.GetStatus(component(), (fmi2StatusKind)below(5), given(value, 1));
}

static int get_real_status2(void) {
    double *value = take(sizeof *value);
    const int kind = (int)below(5);
    if (kind != fmi2LastSuccessfulTime) expect(FAILS);
    return F2.GetRealStatus(component(), (fmi2StatusKind)kind, given(value, 1));
}

static int get_integer_status2(void) {
    int *value = take(sizeof *value);
    expect(FAILS);
    return F2.GetIntegerStatus(component(), (fmi2StatusKind)below(5), given(value, 1));
}

static int get_boolean_status2(void) {
    int *value = take(sizeof *value);
    const int kind = (int)below(5);
    if (kind != fmi2Terminated) expect(FAILS);
    return F2.GetBooleanStatus(component(), (fmi2StatusKind)kind, given(value, 1));
}

static int get_string_status2(void) {
    const char **value = take(sizeof *value);
    expect(FAILS);
    return F2.GetStringStatus(component(), (fmi2StatusKind)below(5), given(value, 1));
}

/* ---- model exchange, events ------------------------------------------------------------------------------------ */

static int enter_event_mode(void) {
    now.phase = it.fmu.kind == MODEL_EXCHANGE ? EVENT : STEP_EVENT;
    if (it.fmu.kind == CO_SIMULATION) expect(FAILS);
    return BOTH(EnterEventMode, (component()));
}

static int update_discrete_states(void) {
    if (it.wild || it.library->plan.indicators > 0) expect(MAY_FAIL); /* inputs at random push bodies into each other */
    if (TWO) return F2.NewDiscreteStates(component(), given(take(sizeof(fmi2EventInfo)), 1));
    bool *flags = take(5 * sizeof *flags);
    double *next = take(sizeof *next);
    return F3.UpdateDiscreteStates(component(), given(flags, 1), given(flags + 1, 1), given(flags + 2, 1),
                                   given(flags + 3, 1), given(flags + 4, 1), given(next, 1));
}

static int evaluate_discrete_states3(void) {
    expect(FAILS);
    return F3.EvaluateDiscreteStates(component());
}

static int enter_continuous_mode(void) {
    now.phase = CONTINUOUS;
    return BOTH(EnterContinuousTimeMode, (component()));
}

static int completed_integrator_step(void) {
    int *flags = take(2 * sizeof *flags); /* of int or bool */
    void *event = given(flags, 1), *terminate = given(flags + 1, 1);
    return BOTH(CompletedIntegratorStep, (component(), one_in(2), event, terminate));
}

static int set_time(void) {
    now.time = next_time();
    return BOTH(SetTime, (component(), now.time));
}

static int set_states(void) {
    const size_t n = length_of(it.library->plan.states);
    double *states = numbers_at(n, 0.5);
    now.wild = 1; /* states at random need not keep constraints */
    return BOTH(SetContinuousStates, (component(), given(states, n), n));
}

static int get_states(void) {
    const size_t n = length_of(it.library->plan.states);
    double *states = take(n * sizeof *states);
    if (it.wild) expect(MAY_FAIL);
    return finite(BOTH(GetContinuousStates, (component(), given(states, n), n)), states, n);
}

static int get_derivatives(void) {
    const size_t n = length_of(it.library->plan.states);
    double *derivatives = take(n * sizeof *derivatives);
    if (it.wild) expect(MAY_FAIL);
    return finite(CALL(GetDerivatives, (component(), given(derivatives, n), n), GetContinuousStateDerivatives, (component(), given(derivatives, n), n)), derivatives, n);
}

static int get_nominals(void) {
    const size_t n = length_of(it.library->plan.states);
    return BOTH(GetNominalsOfContinuousStates, (component(), given(take(n * sizeof(double)), n), n));
}

static int get_event_indicators(void) {
    const size_t n = length_of(it.library->plan.indicators);
    double *indicators = take(n * sizeof *indicators);
    if (it.wild) expect(MAY_FAIL);
    return finite(BOTH(GetEventIndicators, (component(), given(indicators, n), n)), indicators, n);
}

static int get_number_of_states3(void) {
    size_t *n = take(sizeof *n);
    const int status = F3.GetNumberOfContinuousStates(component(), given(n, 1));
    if (status == fmi3OK && *n != it.library->plan.states) now.fault = "there is another number of states";
    return status;
}

static int get_number_of_indicators3(void) {
    size_t *n = take(sizeof *n);
    const int status = F3.GetNumberOfEventIndicators(component(), given(n, 1));
    if (status == fmi3OK && *n != it.library->plan.indicators) now.fault = "there is another number of indicators";
    return status;
}

/* ---- all of them ----------------------------------------------------------------------------------------------- */

/* The reals of a group; 0 where they are not finite. */
static int read_reals(Fmu *fmu, unsigned *references, size_t n, size_t count, double *seen) {
    const int status = CALL(GetReal, (fmu->component, references, n, seen), GetFloat64,
                            (fmu->component, references, n, seen, count));
    if (status != 0) memset(seen, 0, count * sizeof *seen);
    return status;
}

enum { MOST_ELEMENTS = 64 }; /* of an array of integers or Booleans */

/* Everything that can be read of an instance. */
static size_t look(Fmu *fmu, unsigned phase, double *seen) {
    const Plan *plan = &it.library->plan;
    double *start = seen;
    if (read_reals(fmu, it.all.references, it.all.n, it.all.count, seen) != 0)
        for (size_t i = 0, at = 0; i < it.all.n; at += it.all.sizes[i++])
            read_reals(fmu, &it.all.references[i], 1, it.all.sizes[i], seen + at);
    seen += it.all.count;
    const Group *integers[] = {&plan->integers, &plan->counts};
    for (size_t g = 0; g < 2; g++)
        for (size_t i = 0; i < integers[g]->n; i++) {
            int values[MOST_ELEMENTS] = {-1};
            unsigned *reference = &integers[g]->references[i];
            const size_t count = integers[g]->sizes[i];
            CALL(GetInteger, (fmu->component, reference, 1, values), GetInt32, (fmu->component, reference, 1, values, count));
            for (size_t j = 0; j < count; j++) *seen++ = values[j];
        }
    for (size_t i = 0; i < plan->truths.n; i++) {
        int values[MOST_ELEMENTS] = {0};
        fmi3Boolean *truths = (fmi3Boolean *)values; /* one byte each */
        unsigned *reference = &plan->truths.references[i];
        const size_t count = plan->truths.sizes[i];
        CALL(GetBoolean, (fmu->component, reference, 1, values), GetBoolean,
             (fmu->component, reference, 1, truths, count));
        for (size_t j = 0; j < count; j++) *seen++ = TWO ? values[j] : truths[j];
    }
    if (phase & (EVENT | CONTINUOUS) && plan->indicators > 0) {
        if (BOTH(GetEventIndicators, (fmu->component, seen, plan->indicators)) != 0)
            memset(seen, 0, plan->indicators * sizeof *seen);
        seen += plan->indicators;
    }
    if (TWO && phase & (STEP | TERMINATED)) F2.GetRealStatus(fmu->component, fmi2LastSuccessfulTime, seen++);
    if (phase & (EVENT | CONTINUOUS) && plan->states > 0) {
        if (fmu_get_states(fmu, seen) != 0) memset(seen, 0, plan->states * sizeof *seen);
        seen += plan->states;
        BOTH(GetNominalsOfContinuousStates, (fmu->component, seen, plan->states));
        seen += plan->states;
    }
    return (size_t)(seen - start);
}

#define OPERATION(name2, name3, function) {.names = {name2, name3}, .call = function}
#define ALIKE(name, function) OPERATION(#name, #name, function)
#define TYPE(Type) OPERATION(NULL, "Get" #Type, get_##Type), OPERATION(NULL, "Set" #Type, set_##Type)

static Operation OPERATIONS[] = { /* names in FMI 2.0 and in FMI 3.0 */
    OPERATION("GetTypesPlatform", NULL, get_types_platform),
    ALIKE(GetVersion, get_version),
    ALIKE(SetDebugLogging, set_debug_logging),
    OPERATION("Instantiate", NULL, instantiate2),
    OPERATION(NULL, "InstantiateModelExchange", instantiate_model_exchange3),
    OPERATION(NULL, "InstantiateCoSimulation", instantiate_co_simulation3),
    OPERATION(NULL, "InstantiateScheduledExecution", instantiate_scheduled_execution3),
    ALIKE(FreeInstance, free_instance),
    OPERATION(NULL, "EnterConfigurationMode", enter_configuration3),
    OPERATION(NULL, "ExitConfigurationMode", exit_configuration3),
    OPERATION("SetupExperiment", NULL, setup_experiment2),
    ALIKE(EnterInitializationMode, enter_initialization),
    ALIKE(ExitInitializationMode, exit_initialization),
    ALIKE(Terminate, terminate_instance),
    ALIKE(Reset, reset),
    OPERATION("GetReal", "GetFloat64", get_reals),
    OPERATION("SetReal", "SetFloat64", set_reals),
    OPERATION("GetInteger", "GetInt32", get_integers),
    OPERATION("SetInteger", "SetInt32", set_integers),
    ALIKE(GetBoolean, get_booleans),
    ALIKE(SetBoolean, set_booleans),
    ALIKE(GetString, get_String),
    ALIKE(SetString, set_String),
    OPERATION(NULL, "GetUInt64", get_uint64_3),
    OPERATION(NULL, "SetUInt64", set_uint64_3),
    TYPE(Float32),
    TYPE(Int8),
    TYPE(UInt8),
    TYPE(Int16),
    TYPE(UInt16),
    TYPE(UInt32),
    TYPE(Int64),
    OPERATION(NULL, "GetBinary", get_binary3),
    OPERATION(NULL, "SetBinary", set_binary3),
    OPERATION(NULL, "GetClock", get_clock3),
    OPERATION(NULL, "SetClock", set_clock3),
    OPERATION(NULL, "GetIntervalDecimal", get_interval_decimal3),
    OPERATION(NULL, "GetIntervalFraction", get_interval_fraction3),
    OPERATION(NULL, "GetShiftDecimal", get_shift_decimal3),
    OPERATION(NULL, "GetShiftFraction", get_shift_fraction3),
    OPERATION(NULL, "SetIntervalDecimal", set_interval_decimal3),
    OPERATION(NULL, "SetIntervalFraction", set_interval_fraction3),
    OPERATION(NULL, "SetShiftDecimal", set_shift_decimal3),
    OPERATION(NULL, "SetShiftFraction", set_shift_fraction3),
    OPERATION(NULL, "ActivateModelPartition", activate_model_partition3),
    OPERATION(NULL, "GetNumberOfVariableDependencies", get_number_of_dependencies3),
    OPERATION(NULL, "GetVariableDependencies", get_dependencies3),
    OPERATION("GetFMUstate", "GetFMUState", get_state),
    OPERATION("SetFMUstate", "SetFMUState", set_state),
    OPERATION("FreeFMUstate", "FreeFMUState", free_state),
    OPERATION("SerializedFMUstateSize", "SerializedFMUStateSize", state_size),
    OPERATION("SerializeFMUstate", "SerializeFMUState", serialize),
    OPERATION("DeSerializeFMUstate", "DeserializeFMUState", deserialize),
    ALIKE(GetDirectionalDerivative, directional_derivative),
    OPERATION(NULL, "GetAdjointDerivative", adjoint_derivative3),
    OPERATION("SetRealInputDerivatives", NULL, set_input_derivatives2),
    OPERATION("GetRealOutputDerivatives", "GetOutputDerivatives", get_output_derivatives),
    OPERATION(NULL, "EnterStepMode", enter_step_mode3),
    ALIKE(DoStep, do_step),
    OPERATION("CancelStep", NULL, cancel_step2),
    OPERATION("GetStatus", NULL, get_status2),
    OPERATION("GetRealStatus", NULL, get_real_status2),
    OPERATION("GetIntegerStatus", NULL, get_integer_status2),
    OPERATION("GetBooleanStatus", NULL, get_boolean_status2),
    OPERATION("GetStringStatus", NULL, get_string_status2),
    ALIKE(EnterEventMode, enter_event_mode),
    OPERATION("NewDiscreteStates", "UpdateDiscreteStates", update_discrete_states),
    OPERATION(NULL, "EvaluateDiscreteStates", evaluate_discrete_states3),
    ALIKE(EnterContinuousTimeMode, enter_continuous_mode),
    ALIKE(CompletedIntegratorStep, completed_integrator_step),
    ALIKE(SetTime, set_time),
    ALIKE(SetContinuousStates, set_states),
    ALIKE(GetContinuousStates, get_states),
    OPERATION("GetDerivatives", "GetContinuousStateDerivatives", get_derivatives),
    ALIKE(GetNominalsOfContinuousStates, get_nominals),
    ALIKE(GetEventIndicators, get_event_indicators),
    OPERATION(NULL, "GetNumberOfContinuousStates", get_number_of_states3),
    OPERATION(NULL, "GetNumberOfEventIndicators", get_number_of_indicators3),
};

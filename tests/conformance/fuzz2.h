/* The functions of FMI 2.0 with random arguments, and what is to become of each call. */
#include "forge.h"

#define F (it.library->fmi2)

static int get_types_platform2(void) { return strcmp(F.GetTypesPlatform(), fmi2TypesPlatform) != 0; }

static int get_version2(void) { return strcmp(F.GetVersion(), "2.0") != 0; }

static int set_debug_logging2(void) {
    const size_t n = below(4);
    const char **names = categories(n);
    return F.SetDebugLogging(component(), one_in(2), n, given(names, n));
}

static int setup_experiment2(void) {
    const Experiment experiment = some_experiment();
    now.time = experiment.start;
    return F.SetupExperiment(component(), experiment.tolerance_given, experiment.tolerance, experiment.start,
                             experiment.stop_given, experiment.stop);
}

static int enter_initialization2(void) {
    now.phase = INITIALIZATION;
    return F.EnterInitializationMode(component());
}

static int exit_initialization2(void) {
    now.phase = it.fmu.kind == MODEL_EXCHANGE ? EVENT : STEP;
    if (it.wild) expect(MAY_FAIL);
    return F.ExitInitializationMode(component());
}

static int terminate2(void) {
    now.phase = TERMINATED;
    return F.Terminate(component());
}

static int reset2(void) {
    begin_anew();
    return F.Reset(component());
}

static int get_real2(void) {
    size_t n = some(&it.all), count;
    unsigned *references = references_of(&it.all, n, &count);
    double *values = take(n * sizeof *values);
    if (it.wild) expect(MAY_FAIL);
    return finite(F.GetReal(component(), given(references, n), n, given(values, n)), values, n);
}

static int set_real2(void) {
    const Setting setting = some_setting();
    return F.SetReal(component(), given(setting.references, setting.n), setting.n, given(setting.values, setting.n));
}

static int get_integer2(void) {
    size_t n = below(3), count;
    unsigned *references = references_of(&it.library->plan.integers, n, &count);
    int *values = take(n * sizeof *values);
    return F.GetInteger(component(), given(references, n), n, given(values, n));
}

static int set_integer2(void) {
    size_t n = below(3), count;
    unsigned *references = references_of(&it.library->plan.integers, n, &count);
    int *values = integer_settings(n);
    if (n > 0) expect(it.phase > INITIALIZATION ? FAILS : MAY_FAIL); /* constants are among them */
    return F.SetInteger(component(), given(references, n), n, given(values, n));
}

/* Types of which there are no variables. */
#define NONE_OF(Type)                                                                              \
    static int get_##Type##_2(void) {                                                              \
        const size_t n = below(3);                                                                 \
        if (n > 0) expect(FAILS);                                                                  \
        return F.Get##Type(component(), take(n * sizeof(unsigned)), n, take(n * sizeof(fmi2##Type))); \
    }                                                                                              \
    static int set_##Type##_2(void) {                                                              \
        const size_t n = below(3);                                                                 \
        if (n > 0) expect(FAILS);                                                                  \
        return F.Set##Type(component(), take(n * sizeof(unsigned)), n, take(n * sizeof(fmi2##Type))); \
    }

NONE_OF(Boolean)
NONE_OF(String)
#undef NONE_OF

/* ---- saved states ---------------------------------------------------------------------------------------------- */

static int get_state2(void) {
    Saved *chosen = saved();
    const int wanted = !one_in(30);
    if (!wanted) expect(FAILS);
    const int status = F.GetFMUstate(component(), wanted ? &chosen->state : NULL);
    if (status == fmi2OK) *chosen = (Saved){chosen->state, it.phase, it.time, it.wild, 0};
    return status;
}

static int set_state2(void) { return F.SetFMUstate(component(), some_state()); }

static int free_state2(void) {
    Saved *chosen = saved();
    return F.FreeFMUstate(component(), one_in(30) ? NULL : &chosen->state);
}

static int state_size2(void) {
    const Saved *chosen = saved();
    size_t *size = take(sizeof *size);
    if (chosen->state == NULL) expect(FAILS);
    return F.SerializedFMUstateSize(component(), chosen->state, given(size, 1));
}

static int serialize2(void) {
    const Saved *chosen = saved();
    size_t size;
    char *space = space_for(chosen, &size);
    return F.SerializeFMUstate(component(), chosen->state, given(space, 1), size);
}

static int deserialize2(void) {
    Saved *target = saved();
    const Offer offer = some_bytes();
    const int status = F.DeSerializeFMUstate(component(), given(offer.bytes, 1), offer.size, &target->state);
    return offered(offer, status, target);
}

/* ---- derivatives ----------------------------------------------------------------------------------------------- */

static int directional_derivative2(void) {
    const Plan *plan = &it.library->plan;
    size_t unknown_count = 1 + some(&plan->outputs), known_count = some(&plan->inputs), count;
    unsigned *unknowns = references_of(&plan->outputs, unknown_count, &count);
    unsigned *knowns = references_of(&plan->inputs, known_count, &count);
    double *seed_values = numbers_at(known_count, 1), *result = take(unknown_count * sizeof *result);
    if (it.wild || now.wild) expect(MAY_FAIL);
    return finite(F.GetDirectionalDerivative(component(), given(unknowns, unknown_count), unknown_count,
                                             given(knowns, known_count), known_count, given(seed_values, known_count),
                                             given(result, unknown_count)),
                  result, unknown_count);
}

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
    return F.SetRealInputDerivatives(component(), given(references, n), n, given(orders, n), given(values, n));
}

static int get_output_derivatives2(void) {
    const Group *outputs = &it.library->plan.outputs;
    size_t n = some(outputs), count;
    unsigned *references = references_of(outputs, n, &count);
    int *orders = first_orders(n);
    double *values = take(n * sizeof *values);
    if (it.wild) expect(MAY_FAIL);
    return finite(F.GetRealOutputDerivatives(component(), given(references, n), n, given(orders, n), given(values, n)),
                  values, n);
}

/* ---- co-simulation --------------------------------------------------------------------------------------------- */

static int do_step2(void) {
    const double time = step_time(), size = step_size();
    now.time = time + size;
    expect(MAY_FAIL); /* inputs that jump at random lead anywhere */
    return stepped(F.DoStep(component(), time, size, (int)below(2)), size);
}

static int cancel_step2(void) {
    expect(FAILS);
    return F.CancelStep(component());
}

static int get_status2(void) {
    fmi2Status *value = take(sizeof *value);
    expect(FAILS);
    return F.GetStatus(component(), (fmi2StatusKind)below(5), given(value, 1));
}

static int get_real_status2(void) {
    double *value = take(sizeof *value);
    const int kind = (int)below(5);
    if (kind != fmi2LastSuccessfulTime) expect(FAILS);
    return F.GetRealStatus(component(), (fmi2StatusKind)kind, given(value, 1));
}

static int get_integer_status2(void) {
    int *value = take(sizeof *value);
    expect(FAILS);
    return F.GetIntegerStatus(component(), (fmi2StatusKind)below(5), given(value, 1));
}

static int get_boolean_status2(void) {
    int *value = take(sizeof *value);
    const int kind = (int)below(5);
    if (kind != fmi2Terminated) expect(FAILS);
    return F.GetBooleanStatus(component(), (fmi2StatusKind)kind, given(value, 1));
}

static int get_string_status2(void) {
    const char **value = take(sizeof *value);
    expect(FAILS);
    return F.GetStringStatus(component(), (fmi2StatusKind)below(5), given(value, 1));
}

/* ---- model exchange -------------------------------------------------------------------------------------------- */

static int enter_event_mode2(void) {
    now.phase = EVENT;
    return F.EnterEventMode(component());
}

static int new_discrete_states2(void) {
    if (it.wild) expect(MAY_FAIL);
    return F.NewDiscreteStates(component(), given(take(sizeof(fmi2EventInfo)), 1));
}

static int enter_continuous_mode2(void) {
    now.phase = CONTINUOUS;
    return F.EnterContinuousTimeMode(component());
}

static int completed_integrator_step2(void) {
    int *enter = take(sizeof *enter), *terminate = take(sizeof *terminate);
    return F.CompletedIntegratorStep(component(), (int)below(2), given(enter, 1), given(terminate, 1));
}

static int set_time2(void) {
    const double time = next_time();
    now.time = time;
    return F.SetTime(component(), time);
}

static int set_states2(void) {
    const size_t n = length_of(it.library->plan.states);
    double *states = numbers_at(n, 0.5);
    now.wild = 1; /* states at random need not keep constraints */
    return F.SetContinuousStates(component(), given(states, n), n);
}

static int get_states2(void) {
    const size_t n = length_of(it.library->plan.states);
    double *states = take(n * sizeof *states);
    if (it.wild) expect(MAY_FAIL);
    return finite(F.GetContinuousStates(component(), given(states, n), n), states, n);
}

static int get_derivatives2(void) {
    const size_t n = length_of(it.library->plan.states);
    double *derivatives = take(n * sizeof *derivatives);
    if (it.wild) expect(MAY_FAIL);
    return finite(F.GetDerivatives(component(), given(derivatives, n), n), derivatives, n);
}

static int get_nominals2(void) {
    const size_t n = length_of(it.library->plan.states);
    return F.GetNominalsOfContinuousStates(component(), given(take(n * sizeof(double)), n), n);
}

static int get_event_indicators2(void) {
    const size_t n = length_of(0);
    return F.GetEventIndicators(component(), given(take(n * sizeof(double)), n), n);
}

/* ---- life ------------------------------------------------------------------------------------------------------ */

/* Instances that must not come to be. */
static int instantiate2(void) {
    fmi2CallbackFunctions callbacks = it.fmu.callbacks;
    const size_t fault = below(4);
    void *instance = F.Instantiate(instance_name(fault), fmi2CoSimulation,
                                   fault == 2 ? "{other}" : it.library->plan.token, NULL,
                                   fault == 3 ? NULL : &callbacks, fmi2False, fmi2False);
    now.nobody = 1;
    return instance == NULL ? fmi2Error : fmi2OK;
}

static void free_saved2(void) {
    for (size_t i = 0; i < POOL; i++) F.FreeFMUstate(it.fmu.component, &it.pool[i].state);
}

static int free_instance2(void) {
    if (one_in(10)) F.FreeInstance(NULL);
    free_saved2();
    replace_instance();
    return fmi2OK;
}

/* Everything that can be read of an instance. */
static size_t look2(Fmu *fmu, unsigned phase, double *seen) {
    const Plan *plan = &it.library->plan;
    size_t n = it.all.n;
    double *start = seen;
    if (F.GetReal(fmu->component, it.all.references, n, seen) != fmi2OK) /* some may not be finite */
        for (size_t i = 0; i < n; i++)
            if (F.GetReal(fmu->component, &it.all.references[i], 1, seen + i) != fmi2OK) seen[i] = 0;
    seen += n;
    for (size_t i = 0; i < plan->integers.n; i++) {
        int value = -1;
        F.GetInteger(fmu->component, &plan->integers.references[i], 1, &value);
        *seen++ = value;
    }
    if (phase & (STEP | TERMINATED)) F.GetRealStatus(fmu->component, fmi2LastSuccessfulTime, seen++);
    if (phase & (EVENT | CONTINUOUS) && plan->states > 0) {
        if (F.GetContinuousStates(fmu->component, seen, plan->states) != fmi2OK)
            memset(seen, 0, plan->states * sizeof *seen);
        seen += plan->states;
        F.GetNominalsOfContinuousStates(fmu->component, seen, plan->states);
        seen += plan->states;
    }
    return (size_t)(seen - start);
}

static Operation OPERATIONS2[] = {
    {"GetTypesPlatform", ANY, 0, get_types_platform2, 0, 0},
    {"GetVersion", ANY, 0, get_version2, 0, 0},
    {"SetDebugLogging", ANY, 0, set_debug_logging2, 0, 0},
    {"Instantiate", 0, 0, instantiate2, 0, 0},
    {"FreeInstance", ANY, 0, free_instance2, 0, 0},
    {"SetupExperiment", INSTANTIATED, 0, setup_experiment2, 0, 0},
    {"EnterInitializationMode", INSTANTIATED, 0, enter_initialization2, 0, 0},
    {"ExitInitializationMode", INITIALIZATION, 0, exit_initialization2, 0, 0},
    {"Terminate", RUNNING, 0, terminate2, 0, 0},
    {"Reset", ANY, 0, reset2, 0, 0},
    {"GetReal", ANY & ~INSTANTIATED, INSTANTIATED, get_real2, 0, 0},
    {"GetInteger", ANY & ~INSTANTIATED, INSTANTIATED, get_integer2, 0, 0},
    {"GetBoolean", ANY & ~INSTANTIATED, INSTANTIATED, get_Boolean_2, 0, 0},
    {"GetString", ANY & ~INSTANTIATED, INSTANTIATED, get_String_2, 0, 0},
    {"SetReal", ANY & ~TERMINATED, 0, set_real2, 0, 0},
    {"SetInteger", ANY & ~TERMINATED & ~CONTINUOUS, CONTINUOUS, set_integer2, 0, 0},
    {"SetBoolean", ANY & ~TERMINATED & ~CONTINUOUS, CONTINUOUS, set_Boolean_2, 0, 0},
    {"SetString", ANY & ~TERMINATED & ~CONTINUOUS, CONTINUOUS, set_String_2, 0, 0},
    {"GetFMUstate", ANY, 0, get_state2, 0, 0},
    {"SetFMUstate", ANY, 0, set_state2, 0, 0},
    {"FreeFMUstate", ANY, 0, free_state2, 0, 0},
    {"SerializedFMUstateSize", ANY, 0, state_size2, 0, 0},
    {"SerializeFMUstate", ANY, 0, serialize2, 0, 0},
    {"DeSerializeFMUstate", ANY, 0, deserialize2, 0, 0},
    {"GetDirectionalDerivative", ANY & ~INSTANTIATED, 0, directional_derivative2, 0, 0},
    {"EnterEventMode", CONTINUOUS, EVENT, enter_event_mode2, 0, 0},
    {"NewDiscreteStates", EVENT, 0, new_discrete_states2, 0, 0},
    {"EnterContinuousTimeMode", EVENT, 0, enter_continuous_mode2, 0, 0},
    {"CompletedIntegratorStep", CONTINUOUS, 0, completed_integrator_step2, 0, 0},
    {"SetTime", CONTINUOUS, EVENT, set_time2, 0, 0},
    {"SetContinuousStates", CONTINUOUS, 0, set_states2, 0, 0},
    {"GetDerivatives", EVENT | CONTINUOUS, ANY & ~INSTANTIATED, get_derivatives2, 0, 0},
    {"GetEventIndicators", EVENT | CONTINUOUS, ANY & ~INSTANTIATED, get_event_indicators2, 0, 0},
    {"GetContinuousStates", EVENT | CONTINUOUS, ANY & ~INSTANTIATED, get_states2, 0, 0},
    {"GetNominalsOfContinuousStates", EVENT | CONTINUOUS, ANY, get_nominals2, 0, 0},
    {"SetRealInputDerivatives", STEP, BEFORE, set_input_derivatives2, 0, 0},
    {"GetRealOutputDerivatives", STEP, TERMINATED, get_output_derivatives2, 0, 0},
    {"DoStep", STEP, 0, do_step2, 0, 0},
    {"CancelStep", STEP, 0, cancel_step2, 0, 0},
    {"GetStatus", STEP, TERMINATED, get_status2, 0, 0},
    {"GetRealStatus", STEP, TERMINATED, get_real_status2, 0, 0},
    {"GetIntegerStatus", STEP, TERMINATED, get_integer_status2, 0, 0},
    {"GetBooleanStatus", STEP, TERMINATED, get_boolean_status2, 0, 0},
    {"GetStringStatus", STEP, TERMINATED, get_string_status2, 0, 0},
};

#undef F

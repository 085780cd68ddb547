/* The functions that FMI 2.0 and FMI 3.0 have alike, for the file of either, which defines FMI(name), STATUS, ... */

/* An instance where this function may be called in its phase. */
#define ENTER(name)                                                                              \
    Fmu *fmu = fmi_enter(instance, (unsigned)PHASES_##name, (unsigned)USES_##name, __func__); \
    if (fmu == NULL) return (STATUS)ERROR;                                                       \
    Instance *core = fmu->common.core;                                                             \
    (void)core

#define NEED(argument) \
    if ((argument) == NULL && !fmi_check_not_null(&fmu->common, argument, #argument, __func__)) return (STATUS)ERROR

/* ---- life -------------------------------------------------------------------------------------------------- */

STATUS FMI(SetDebugLogging)(INSTANCE instance, BOOLEAN logging, size_t n, const char *const categories[]) {
    ENTER(SetDebugLogging);
    if (n > 0) NEED(categories);
    return (STATUS)fmi_set_logging(&fmu->common, logging, n, categories);
}

STATUS FMI(ExitInitializationMode)(INSTANCE instance) {
    ENTER(ExitInitializationMode);
    return (STATUS)core_exit_initialization(core);
}

STATUS FMI(EnterEventMode)(INSTANCE instance) {
    ENTER(EnterEventMode);
    core_enter_event_mode(core);
    return (STATUS)SUCCESS;
}

STATUS FMI(Terminate)(INSTANCE instance) {
    ENTER(Terminate);
    core_terminate(core);
    return (STATUS)SUCCESS;
}

void FMI(FreeInstance)(INSTANCE instance) { fmi_free_instance(instance); }

/* ---- Booleans ---------------------------------------------------------------------------------------------- */

static STATUS get_booleans(Instance *core, const unsigned references[], size_t n, BOOLEAN values[]) {
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < core_count(core, &references[i], 1); j++) {
            double value = 0;
            const Status status = core_get_typed(core, NUMBER_BOOLEAN, references[i], j, &value);
            if (status != SUCCESS) return (STATUS)status;
            *values++ = value != 0;
        }
    }
    return (STATUS)SUCCESS;
}

/* ---- saved states ------------------------------------------------------------------------------------------ */

STATUS FMI(GetFMUState)(INSTANCE instance, void **state) {
    ENTER(FMUState);
    NEED(state);
    return (STATUS)fmi_get_state(&fmu->common, state, __func__);
}

STATUS FMI(SetFMUState)(INSTANCE instance, void *state) {
    ENTER(FMUState);
    NEED(state);
    return (STATUS)fmi_set_state(&fmu->common, state);
}

STATUS FMI(FreeFMUState)(INSTANCE instance, void **state) {
    ENTER(FMUState);
    fmi_free_state(state);
    return (STATUS)SUCCESS;
}

STATUS FMI(SerializedFMUStateSize)(INSTANCE instance, void *state, size_t *size) {
    ENTER(FMUState);
    NEED(state);
    NEED(size);
    *size = fmi_state_size(state);
    return (STATUS)SUCCESS;
}

STATUS FMI(SerializeFMUState)(INSTANCE instance, void *state, BYTE bytes[], size_t size) {
    ENTER(FMUState);
    NEED(state);
    NEED(bytes);
    return (STATUS)fmi_serialize_state(&fmu->common, state, bytes, size, __func__);
}

STATUS FMI(DeserializeFMUState)(INSTANCE instance, const BYTE bytes[], size_t size, void **state) {
    ENTER(FMUState);
    NEED(bytes);
    NEED(state);
    return (STATUS)fmi_deserialize_state(&fmu->common, bytes, size, state, __func__);
}

/* ---- model exchange ---------------------------------------------------------------------------------------- */

STATUS FMI(EnterContinuousTimeMode)(INSTANCE instance) {
    ENTER(EnterContinuousTimeMode);
    core_enter_continuous_mode(core);
    return (STATUS)SUCCESS;
}

STATUS FMI(CompletedIntegratorStep)(INSTANCE instance, BOOLEAN no_way_back, BOOLEAN *event, BOOLEAN *terminate) {
    (void)no_way_back;
    ENTER(CompletedIntegratorStep);
    NEED(event);
    NEED(terminate);
    *event = core_has_event(core, core_time(core));
    *terminate = 0;
    return (STATUS)SUCCESS;
}

STATUS FMI(SetTime)(INSTANCE instance, double time) {
    ENTER(SetTime);
    return (STATUS)fmi_told(&fmu->common, core_set_time(core, time));
}

/* A vector of as many numbers as there are states. */
#define STATES(numbers, what)                                                                         \
    if (fmi_check_count(&fmu->common, n, model.states, what) != SUCCESS) return (STATUS)ERROR;         \
    if (n == 0) return (STATUS)SUCCESS;                                                               \
    NEED(numbers)

STATUS FMI(SetContinuousStates)(INSTANCE instance, const double states[], size_t n) {
    ENTER(SetContinuousStates);
    STATES(states, "states");
    return (STATUS)core_set_states(core, states);
}

STATUS FMI(GetContinuousStates)(INSTANCE instance, double states[], size_t n) {
    ENTER(GetContinuousStates);
    STATES(states, "states");
    return (STATUS)core_get_states(core, states);
}

STATUS FMI(GetContinuousStateDerivatives)(INSTANCE instance, double derivatives[], size_t n) {
    ENTER(GetContinuousStateDerivatives);
    STATES(derivatives, "derivatives of states");
    return (STATUS)core_get_derivatives(core, derivatives);
}

STATUS FMI(GetNominalsOfContinuousStates)(INSTANCE instance, double nominals[], size_t n) {
    ENTER(GetNominalsOfContinuousStates);
    STATES(nominals, "nominal values of states");
    core_get_nominals(core, nominals);
    return (STATUS)SUCCESS;
}

STATUS FMI(GetEventIndicators)(INSTANCE instance, double indicators[], size_t n) {
    ENTER(GetEventIndicators);
    if (fmi_check_count(&fmu->common, n, model.indicators, "event indicators") != SUCCESS) return (STATUS)ERROR;
    if (n == 0) return (STATUS)SUCCESS;
    NEED(indicators);
    return (STATUS)core_get_indicators(core, indicators);
}

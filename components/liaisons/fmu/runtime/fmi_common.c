/* What FMI 2.0 and FMI 3.0 share: a name and a log, checks of calls, saved states as an importer holds them. */
#include "fmi_common.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct { /* a saved state */
    size_t size;
    unsigned char bytes[];
} Saved;

static const char *const CATEGORIES[] = {"", "logStatusWarning", "logStatusDiscard", "logStatusError"};

/* ---- messages ---------------------------------------------------------------------------------------------- */

/* Pass a message to the importer's logger. */
static void log_text(const FmiInstance *fmu, Status status, const char *text) {
    char message[1024];
    size_t length = 0;
    if (fmu->write == NULL) return;
    for (; *text && length + 2 < sizeof message; text++) {
        if (strchr(fmu->marks, *text)) message[length++] = *text;
        message[length++] = *text;
    }
    message[length] = '\0';
    fmu->write(fmu, status, CATEGORIES[status], message);
}

/* The same, unless its category is off. */
static void report(void *owner, Status status, const char *text) {
    const FmiInstance *fmu = owner;
    if ((fmu->always | fmu->logged) & 1u << status) log_text(fmu, status, text);
}

Status fmi_told(const FmiInstance *fmu, Status status) {
    const char *text;
    while (status == WARNING && (text = core_told(fmu->core)) != NULL) log_text(fmu, status, text);
    return status;
}

Status fmi_set_logging(FmiInstance *fmu, int on, size_t n, const char *const categories[]) {
    unsigned chosen = n == 0 ? EVERYTHING : 0;
    for (size_t i = 0; i < n; i++) {
        unsigned known = ERROR;
        while (known > 0 && (categories[i] == NULL || strcmp(categories[i], CATEGORIES[known]) != 0)) known--;
        if (known == 0)
            return core_report(fmu->core, ERROR, "there is no log category %s", categories[i] ? categories[i] : "NULL");
        chosen |= 1u << known;
    }
    fmu->logged = on ? fmu->logged | chosen : fmu->logged & ~chosen;
    return SUCCESS;
}

/* ---- checks ------------------------------------------------------------------------------------------------ */

static const char *phase_name(Phase phase) {
    switch (phase) {
    case CONFIGURATION: return "in configuration mode";
    case INSTANTIATED: return "before initialization";
    case INITIALIZATION: return "in initialization mode";
    case EVENT: return "in event mode";
    case CONTINUOUS: return "in continuous-time mode";
    case STEP: return "between communication steps";
    case INTERMEDIATE: return "inside a communication step";
    case INPUT_REQUEST: return "while inputs are asked for";
    default: return "after termination";
    }
}

void *fmi_refuse(const FmiInstance *fmu, int in_phase, const char *function) {
    static const char *const USES[] = {"model exchange", "co-simulation without event mode",
                                       "co-simulation with events"};
    if (!in_phase)
        core_report(fmu->core, ERROR, "%s must not be called %s", function, phase_name(core_phase(fmu->core)));
    else
        core_report(fmu->core, ERROR, "%s must not be called: this instance is one for %s", function,
                    USES[core_use(fmu->core)]);
    return NULL;
}

int fmi_check_not_null(const FmiInstance *fmu, const void *argument, const char *name, const char *function) {
    if (argument == NULL) core_report(fmu->core, ERROR, "%s: argument %s is NULL", function, name);
    return argument != NULL;
}

Status fmi_check_no_variables(const FmiInstance *fmu, size_t n, const char *type) {
    return n == 0 ? SUCCESS : core_report(fmu->core, ERROR, "there are no variables of type %s", type);
}

Status fmi_check_count(const FmiInstance *fmu, size_t n, size_t expected, const char *what) {
    if (n == expected) return SUCCESS;
    return core_report(fmu->core, ERROR, "%lu %s: there are %lu", (unsigned long)n, what, (unsigned long)expected);
}

/* ---- life -------------------------------------------------------------------------------------------------- */

/* Log an error of a function; NULL. */
static void *fail(const FmiInstance *fmu, const char *function, const char *why) {
    char text[256] = "";
    strncat(text, function, 64);
    strncat(text, why, 128);
    report((void *)fmu, ERROR, text);
    return NULL;
}

/* Whether a guid is that of the binary, or of a copy with other start values: - and more follow then. */
static int fits(const char *guid) {
    const size_t length = strlen(model.guid);
    return guid != NULL && strncmp(guid, model.guid, length) == 0 && (guid[length] == '\0' || guid[length] == '-');
}

/* Path of the file of start values; NULL without memory for it. */
static char *path_of_starts(const char *resources) {
    static const char FORMAT[] = "%s/starts.txt";
    const size_t size = strlen(resources) + sizeof FORMAT;
    char *path = malloc(size);
    if (path != NULL) snprintf(path, size, FORMAT, resources);
    return path;
}

void *fmi_instantiate(const FmiInstance *fmu, size_t size, const char *name, const char *guid, const char *resources,
                      Options options, const char *function) {
    if (name == NULL || name[strspn(name, " \t\r\n")] == '\0')
        return fail(fmu, function, ": the instance name is missing");
    if (!fits(guid))
        return fail(fmu, function, ": the guid of the model description is not that of the binary");
    const int has_starts = guid[strlen(model.guid)] != '\0';
    if (has_starts && resources == NULL)
        return fail(fmu, function, ": start values of this FMU are in its resources: give the path of that folder");
    FmiInstance *opened = malloc(size);
    if (opened != NULL) {
        memcpy(opened, fmu, size);
        options.report = report;
        options.owner = opened;
        opened->name = malloc(strlen(name) + 1);
        opened->core = core_new(&model, &options);
        opened->has_starts = has_starts;
        opened->starts = resources == NULL ? NULL : path_of_starts(resources);
    }
    if (opened == NULL || opened->name == NULL || opened->core == NULL
        || (resources != NULL && opened->starts == NULL)) {
        fmi_free_instance(opened);
        return fail(fmu, function, ": out of memory");
    }
    strcpy(opened->name, name);
    if (fmi_read_starts(opened) == SUCCESS) return opened;
    fmi_free_instance(opened);
    return NULL;
}

Status fmi_reset(const FmiInstance *fmu) {
    core_reset(fmu->core);
    return fmi_read_starts(fmu);
}

void fmi_free_instance(FmiInstance *fmu) {
    if (fmu == NULL) return;
    core_free(fmu->core);
    free(fmu->name);
    free(fmu->starts);
    free(fmu);
}

/* ---- saved states ------------------------------------------------------------------------------------------ */

/* Memory for a saved state: that of the old one if it has this size. */
static Saved *reserve(void **state, size_t size) {
    Saved *saved = *state;
    if (saved != NULL && saved->size == size) return saved;
    saved = realloc(saved, sizeof *saved + size);
    if (saved != NULL) {
        saved->size = size;
        *state = saved;
    }
    return saved;
}

Status fmi_get_state(const FmiInstance *fmu, void **state, const char *function) {
    Saved *saved = reserve(state, core_state_size(fmu->core));
    if (saved == NULL) return core_report(fmu->core, ERROR, "%s: out of memory", function);
    core_save(fmu->core, saved->bytes);
    return SUCCESS;
}

Status fmi_set_state(const FmiInstance *fmu, const void *state) {
    const Saved *saved = state;
    return core_restore(fmu->core, saved->bytes, saved->size);
}

void fmi_free_state(void **state) {
    if (state == NULL) return;
    free(*state);
    *state = NULL;
}

size_t fmi_state_size(const void *state) { return ((const Saved *)state)->size; }

Status fmi_serialize_state(const FmiInstance *fmu, const void *state, void *bytes, size_t size, const char *function) {
    const Saved *saved = state;
    if (size < saved->size)
        return core_report(fmu->core, ERROR, "%s: %lu bytes are too few, %lu are needed", function,
                           (unsigned long)size, (unsigned long)saved->size);
    memcpy(bytes, saved->bytes, saved->size);
    core_seal(bytes);
    return SUCCESS;
}

Status fmi_deserialize_state(const FmiInstance *fmu, const void *bytes, size_t size, void **state,
                             const char *function) {
    if (core_check_state(fmu->core, bytes, size) != SUCCESS) return ERROR;
    Saved *saved = reserve(state, size);
    if (saved == NULL) return core_report(fmu->core, ERROR, "%s: out of memory", function);
    memcpy(saved->bytes, bytes, size);
    return SUCCESS;
}

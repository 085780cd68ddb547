/* What the faces share: a name and a log, checks of calls, saved states as an importer holds them. */
#include "face.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct { /* a saved state */
    size_t size;
    unsigned char bytes[];
} Saved;

static const char *const CATEGORIES[] = {"", "logStatusWarning", "logStatusDiscard", "logStatusError"};

/* ---- messages ---------------------------------------------------------------------------------------------- */

static void report(void *owner, Status status, const char *text) {
    const Face *face = owner;
    char message[1024];
    size_t length = 0;
    if (face->write == NULL || !((face->always | face->logged) & 1u << status)) return;
    for (; *text && length + 2 < sizeof message; text++) {
        if (strchr(face->marks, *text)) message[length++] = *text;
        message[length++] = *text;
    }
    message[length] = '\0';
    face->write(face, status, CATEGORIES[status], message);
}

Status face_set_logging(Face *face, int on, size_t n, const char *const categories[]) {
    unsigned chosen = n == 0 ? EVERYTHING : 0;
    for (size_t i = 0; i < n; i++) {
        unsigned known = ERROR;
        while (known > 0 && (categories[i] == NULL || strcmp(categories[i], CATEGORIES[known]) != 0)) known--;
        if (known == 0)
            return core_report(face->core, ERROR, "there is no log category %s", categories[i] ? categories[i] : "NULL");
        chosen |= 1u << known;
    }
    face->logged = on ? face->logged | chosen : face->logged & ~chosen;
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
    case ASKING: return "while inputs are asked for";
    default: return "after termination";
    }
}

void *face_refuse(const Face *face, int in_phase, const char *function) {
    static const char *const USES[] = {"model exchange", "co-simulation without event mode",
                                       "co-simulation with events"};
    if (!in_phase)
        core_report(face->core, ERROR, "%s must not be called %s", function, phase_name(core_phase(face->core)));
    else
        core_report(face->core, ERROR, "%s must not be called: this instance is one for %s", function,
                    USES[core_use(face->core)]);
    return NULL;
}

int face_given(const Face *face, const void *argument, const char *name, const char *function) {
    if (argument == NULL) core_report(face->core, ERROR, "%s: argument %s is NULL", function, name);
    return argument != NULL;
}

Status face_has_none(const Face *face, size_t n, const char *type) {
    return n == 0 ? SUCCESS : core_report(face->core, ERROR, "there are no variables of type %s", type);
}

Status face_check_count(const Face *face, size_t n, size_t expected, const char *what) {
    if (n == expected) return SUCCESS;
    return core_report(face->core, ERROR, "%lu %s: there are %lu", (unsigned long)n, what, (unsigned long)expected);
}

/* ---- life -------------------------------------------------------------------------------------------------- */

static void *fail(const Face *face, const char *function, const char *why) {
    char text[256] = "";
    strncat(text, function, 64);
    strncat(text, why, 128);
    report((void *)face, ERROR, text);
    return NULL;
}

/* Whether a guid is that of the binary, or of a copy of the FMU with other start values: then - and more follow. */
static int fits(const char *guid) {
    const size_t length = strlen(model.guid);
    return guid != NULL && strncmp(guid, model.guid, length) == 0 && (guid[length] == '\0' || guid[length] == '-');
}

static char *path_of_starts(const char *resources) {
    static const char FORMAT[] = "%s/starts.txt";
    const size_t size = strlen(resources) + sizeof FORMAT;
    char *path = malloc(size);
    if (path != NULL) snprintf(path, size, FORMAT, resources);
    return path;
}

void *face_open(const Face *face, size_t size, const char *name, const char *guid, const char *resources,
                Options options, const char *function) {
    if (name == NULL || name[strspn(name, " \t\r\n")] == '\0')
        return fail(face, function, ": the instance name is missing");
    if (!fits(guid))
        return fail(face, function, ": the guid of the model description is not that of the binary");
    const int has_starts = guid[strlen(model.guid)] != '\0';
    if (has_starts && resources == NULL)
        return fail(face, function, ": start values of this FMU are in its resources: give the path of that folder");
    Face *opened = malloc(size);
    if (opened != NULL) {
        memcpy(opened, face, size);
        options.report = report;
        options.owner = opened;
        opened->name = malloc(strlen(name) + 1);
        opened->core = core_new(&model, &options);
        opened->has_starts = has_starts;
        opened->starts = resources == NULL ? NULL : path_of_starts(resources);
    }
    if (opened == NULL || opened->name == NULL || opened->core == NULL
        || (resources != NULL && opened->starts == NULL)) {
        face_close(opened);
        return fail(face, function, ": out of memory");
    }
    strcpy(opened->name, name);
    if (face_take_starts(opened) == SUCCESS) return opened;
    face_close(opened);
    return NULL;
}

Status face_reset(const Face *face) {
    core_reset(face->core);
    return face_take_starts(face);
}

void face_close(Face *face) {
    if (face == NULL) return;
    core_free(face->core);
    free(face->name);
    free(face->starts);
    free(face);
}

/* ---- saved states ------------------------------------------------------------------------------------------ */

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

Status face_save(const Face *face, void **state, const char *function) {
    Saved *saved = reserve(state, core_state_size(face->core));
    if (saved == NULL) return core_report(face->core, ERROR, "%s: out of memory", function);
    core_save(face->core, saved->bytes);
    return SUCCESS;
}

Status face_restore(const Face *face, const void *state) {
    const Saved *saved = state;
    return core_restore(face->core, saved->bytes, saved->size);
}

void face_drop(void **state) {
    if (state == NULL) return;
    free(*state);
    *state = NULL;
}

size_t face_size(const void *state) { return ((const Saved *)state)->size; }

Status face_serialize(const Face *face, const void *state, void *bytes, size_t size, const char *function) {
    const Saved *saved = state;
    if (size < saved->size)
        return core_report(face->core, ERROR, "%s: %lu bytes are too few, %lu are needed", function,
                           (unsigned long)size, (unsigned long)saved->size);
    memcpy(bytes, saved->bytes, saved->size);
    core_seal(bytes);
    return SUCCESS;
}

Status face_deserialize(const Face *face, const void *bytes, size_t size, void **state, const char *function) {
    if (core_check_state(face->core, bytes, size) != SUCCESS) return ERROR;
    Saved *saved = reserve(state, size);
    if (saved == NULL) return core_report(face->core, ERROR, "%s: out of memory", function);
    memcpy(saved->bytes, bytes, size);
    return SUCCESS;
}

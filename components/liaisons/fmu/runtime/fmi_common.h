/* What FMI 2.0 and FMI 3.0 share: an instance with a name and a log, checks of calls, saved states. */
#ifndef LIAISONS_FMI_COMMON_H
#define LIAISONS_FMI_COMMON_H

#include "core.h"

typedef struct FmiInstance FmiInstance;
typedef void Write(const FmiInstance *, Status status, const char *category, const char *text);

struct FmiInstance { /* the first member of what an importer's handle points to */
    Instance *core;
    char *name;
    void *environment; /* of the importer */
    Write *write;      /* to its log; NULL: it has none */
    const char *marks; /* are doubled in texts */
    unsigned always, logged; /* one bit for each status: reported in any case, and now */
    char *starts;            /* path of a file with start values */
    int has_starts;          /* the file must be there: this is a copy of the FMU that is known by them */
};

/* What was refused is always said: the status alone tells nobody what to change. */
enum { REFUSALS = 1 << DISCARD | 1 << ERROR, EVERYTHING = 1 << WARNING | 1 << DISCARD | 1 << ERROR };

/* A copy of a handle, which is `size` bytes from `fmu` on, with a new instance.  NULL if that cannot be had, which is
 * reported.  `resources` is the path of the directory with the FMU's resources, or NULL. */
void *fmi_instantiate(const FmiInstance *fmu, size_t size, const char *name, const char *guid, const char *resources,
                      Options options, const char *function);
void fmi_free_instance(FmiInstance *);
Status fmi_reset(const FmiInstance *);
/* The status of a call; what it has to tell with a warning is logged, whatever else is. */
Status fmi_told(const FmiInstance *, Status);
Status fmi_set_logging(FmiInstance *, int on, size_t n, const char *const categories[]);

/* Report that a function must not be called in its phase, or in an instance of its kind; returns NULL. */
void *fmi_refuse(const FmiInstance *, int in_phase, const char *function);
Status fmi_check_no_variables(const FmiInstance *, size_t n, const char *type);
Status fmi_check_count(const FmiInstance *, size_t n, size_t expected, const char *what);
int fmi_check_not_null(const FmiInstance *, const void *argument, const char *name, const char *function);

/* The instance if the function may be called in its phase and use, one bit for each, else NULL. */
static inline void *fmi_enter(void *instance, unsigned phases, unsigned uses, const char *function) {
    const FmiInstance *fmu = instance;
    if (fmu == NULL) return NULL;
    const int in_phase = ((unsigned)core_phase(fmu->core) & phases) != 0;
    return in_phase && (1u << core_use(fmu->core) & uses) ? instance : fmi_refuse(fmu, in_phase, function);
}

/* Set the start values in the file of an instance, which replace those of its component: a line
 *     KIND REFERENCE COUNT BITS ... NAME
 * for each variable; KIND is r for reals, i for integers and t for a table (see core_set_table); BITS are those of the
 * numbers in hexadecimal digits, since a locale reads decimal points its own way.  A line of KIND z stands for
 * core_ignore_zeros.  Without the file, which only some FMUs have, nothing is set. */
Status fmi_read_starts(const FmiInstance *);

/* Saved states as the importer holds them. */
Status fmi_get_state(const FmiInstance *, void **state, const char *function);
Status fmi_set_state(const FmiInstance *, const void *state);
void fmi_free_state(void **state);
size_t fmi_state_size(const void *state);
Status fmi_serialize_state(const FmiInstance *, const void *state, void *bytes, size_t size, const char *function);
Status fmi_deserialize_state(const FmiInstance *, const void *bytes, size_t size, void **state, const char *function);

#endif

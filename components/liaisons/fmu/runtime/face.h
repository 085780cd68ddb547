/* What the faces of FMI 2.0 and FMI 3.0 share: an instance with a name and a log, checks of calls, saved states. */
#ifndef LIAISONS_FACE_H
#define LIAISONS_FACE_H

#include "core.h"

typedef struct Face Face;
typedef void Write(const Face *, Status status, const char *category, const char *text);

struct Face { /* the first member of what an importer's handle points to */
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

/* A copy of a handle, which is `size` bytes from `face` on, with a new instance.  NULL if that cannot be had, which is
 * reported.  `resources` is the path of the directory with the FMU's resources, or NULL. */
void *face_open(const Face *face, size_t size, const char *name, const char *guid, const char *resources,
                Options options, const char *function);
void face_close(Face *);
Status face_reset(const Face *);
Status face_set_logging(Face *, int on, size_t n, const char *const categories[]);

/* Report that a function must not be called in its phase, or in an instance of its kind; returns NULL. */
void *face_refuse(const Face *, int in_phase, const char *function);
Status face_has_none(const Face *, size_t n, const char *type);
Status face_check_count(const Face *, size_t n, size_t expected, const char *what);
int face_given(const Face *, const void *argument, const char *name, const char *function);

/* The instance if the function may be called in its phase and use, one bit for each, else NULL. */
static inline void *face_enter(void *instance, unsigned phases, unsigned uses, const char *function) {
    const Face *face = instance;
    if (face == NULL) return NULL;
    const int in_phase = ((unsigned)core_phase(face->core) & phases) != 0;
    return in_phase && (1u << core_use(face->core) & uses) ? instance : face_refuse(face, in_phase, function);
}

/* Set the start values in the file of an instance, which replace those of its component: a line
 *     KIND REFERENCE COUNT BITS ... NAME
 * for each variable; KIND is r for reals, i for integers and t for a table (see core_set_table); BITS are those of the
 * numbers in hexadecimal digits, since a locale reads decimal points its own way.  A line of KIND z stands for
 * core_ignore_zeros.  Without the file, which only some FMUs have, nothing is set. */
Status face_take_starts(const Face *);

/* Saved states as the importer holds them. */
Status face_save(const Face *, void **state, const char *function);
Status face_restore(const Face *, const void *state);
void face_drop(void **state);
size_t face_size(const void *state);
Status face_serialize(const Face *, const void *state, void *bytes, size_t size, const char *function);
Status face_deserialize(const Face *, const void *bytes, size_t size, void **state, const char *function);

#endif

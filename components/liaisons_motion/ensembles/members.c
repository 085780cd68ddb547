/* Members of an ensemble: instances of one component, each with its own events.  What fails stays where it is. */
#include <stdio.h>

#include "instance.h"

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { REASON = 512 };

typedef struct {
    Instance *instance;
    char reason[REASON]; /* why it has failed; empty: it has not */
} Member;

static void note(void *owner, Status status, const char *text) {
    if (status != WARNING) snprintf(((Member *)owner)->reason, REASON, "%s", text);
}

/* Allocate the instances; 0 when memory runs out. */
EXPORT long create_members(long count, Member members[]) {
    for (Member *member = members; member < members + count; member++) {
        const Options options = {.use = USE_CO_SIMULATION, .report = note, .owner = member};
        member->instance = core_new(&model, &options);
        if (member->instance == NULL) return 0;
    }
    return 1;
}

EXPORT void free_members(long count, Member members[]) {
    for (long i = 0; i < count; i++) core_free(members[i].instance);
}

/* Start members anew, each with n values of its own. */
EXPORT void start_members(long count, Member members[], double time, double tolerance, long n, const unsigned references[],
                  const double values[]) {
    for (long i = 0; i < count; i++) {
        Instance *self = members[i].instance;
        const size_t numbers = (size_t)n;
        members[i].reason[0] = '\0';
        core_reset(self);
        if (core_setup(self, time, NULL, tolerance) == ERROR) continue;
        if (core_set(self, references, numbers, values + i * n, numbers) == ERROR) continue;
        core_enter_initialization(self);
        core_exit_initialization(self);
    }
}

/* Step members from each time to the next one, after a time of their own, with n inputs of each kept at values. */
EXPORT void step_members(long count, Member members[], const double begin[], long steps, const double times[], long n,
                         const unsigned references[], const double values[]) {
    Arrival arrival;
    for (long i = 0; i < count; i++) {
        Member *member = &members[i];
        const size_t numbers = (size_t)n;
        if (member->reason[0] == '\0')
            core_set(member->instance, references, numbers, values + i * n, numbers);
        for (long k = 0; k < steps && member->reason[0] == '\0'; k++)
            core_step(member->instance, begin[i] + times[k], times[k + 1] - times[k], &arrival);
    }
}

/* Start a member with n values at a time, and record what its contacts do in steps to later ones, at whose start m inputs and
 * their ORDER derivatives are set, input after input.  Beyond `most` records are only counted; numbers[k]: of those before
 * step k.  An end that is no later than the one before takes no step. */
EXPORT void record_member(Member *member, double time, double tolerance, long n, const unsigned references[],
                          const double values[], long steps, const double ends[], long m, const unsigned inputs[],
                          const double polynomials[], long most, ContactEvent events[], ContactAct acts[], long numbers[]) {
    ContactRecord record = {events, acts, 0, (size_t)most};
    Instance *self = member->instance;
    Arrival arrival;
    core_record_contacts(self, &record);
    start_members(1, member, time, tolerance, n, references, values);
    for (long k = 0; k < steps && member->reason[0] == '\0'; time = ends[k++]) {
        numbers[k] = (long)record.count;
        if (!(ends[k] > time)) continue;
        for (long i = 0; i < m; i++) {
            const double *c = polynomials + (k * m + i) * COEFFICIENTS;
            core_set(self, &inputs[i], 1, c, 1);
            for (int order = 1; order <= ORDER; order++)
                core_set_input_derivatives(self, &inputs[i], 1, &order, &c[order]);
        }
        core_step(self, time, ends[k] - time, &arrival);
    }
    numbers[steps] = (long)record.count;
    core_record_contacts(self, NULL);
}

/* Read n numbers of each member that has not failed. */
EXPORT void read_values(long count, Member members[], long n, const unsigned references[], double values[]) {
    for (Member *member = members; member < members + count; member++, values += n)
        for (long i = 0; i < n && member->reason[0] == '\0'; i++) {
            const size_t index = references[i] - first_reference(&model);
            core_get_typed(member->instance, core_variable_at(&model, index)->type, references[i], 0, &values[i]);
        }
}

/* Calls at random, in any order and with any arguments, of all functions of an FMU.
 *
 *     fuzz LIBRARY PLAN SEED CALLS
 *
 * Of each call is known what the standard says of its place in the life of an instance, and mostly what its arguments
 * must lead to.  After a call that was refused the instance is compared, bit by bit, with another one that has the
 * state from before; after some that were not, with one that has the state from after, so that states are complete.
 * The first contradiction ends the run with a description, and the same seed repeats it.  Printed at the end: how often
 * each function was taken and refused; then how often saved states that were damaged, or forged with a right checksum;
 * and the longest call. */
#define _XOPEN_SOURCE 700
#include <sys/time.h>
#include <time.h>

#include "operations.h"

/* [s] of processor time that a call may take: then a signal ends the run */
#ifdef __SANITIZE_ADDRESS__ /* several times as slow */
enum { LONGEST = 20 };
#else
enum { LONGEST = 5 };
#endif

static char complaint[1024]; /* of another instance than the subject */

static void note(void *environment, int status, const char *text) {
    if (environment != &it.fmu) snprintf(complaint, sizeof complaint, "%s", text);
    if (environment != &it.fmu) return;
    if (status >= messages.worst) snprintf(messages.text, sizeof messages.text, "%s", text);
    messages.worst = status > messages.worst ? status : messages.worst;
}

/* Take the state of the subject from the bytes; if its numbers are not all finite, which bytes must be, from memory. */
static void take_state(Fmu *other, const char *bytes, size_t size) {
    complaint[0] = '\0';
    if (fmu_deserialize(other, bytes, size) == 0) {
        if (fmu_restore(other) != 0) fail("fuzz: state of before", complaint);
        return;
    }
    if (!it.wild || (!strstr(complaint, "a state is") && !strstr(complaint, "the memory")))
        fail("fuzz: bytes of a state that was saved", complaint);
    Fmu borrowed = *other;
    borrowed.state = it.fmu.state;
    if (fmu_restore(&borrowed) != 0) fail("fuzz: state of before", complaint);
}

/* Whether the subject reads, to the last bit, as an instance with this state does. */
static int reads_like(const char *bytes, size_t size, unsigned phase) {
    static double expected[10000], seen[10000];
    Fmu other;
    if (fmu_instantiate(&other, it.library, it.fmu.kind) == NULL) fail("fuzz", "no instance");
    take_state(&other, bytes, size);
    const size_t n = look(&other, phase, expected);
    fmu_free(&other);
    return look(&it.fmu, phase, seen) == n && memcmp(expected, seen, n * sizeof *seen) == 0;
}

static const char *judge(const Operation *operation, int status) {
    const int kind = it.fmu.kind != MODEL_EXCHANGE;
    const int here = (operation->allowed[kind] & it.phase) != 0, perhaps = (operation->tolerated[kind] & it.phase) != 0;
    if (now.fault) return now.fault;
    if (status < 0 || status > 3) return "the status does not exist here";
    if (now.nobody) return status == 3 ? NULL : "a call without an instance must be an error";
    if (status == 1) return "there is nothing to warn of";
    if (!here && !perhaps && status != 3) return "a call in the wrong phase must be an error";
    if (here && now.expected == WORKS && status != 0) return "the call must work";
    if ((here || perhaps) && now.expected == FAILS && status == 0) return "the call must be refused";
    if (status == 0 && messages.worst > 1) return "the call works and complains";
    if (status > 1 && messages.worst != status) return "the call is refused without a message of that status";
    return NULL;
}

static double seconds(void) {
    struct timespec time;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

static void limit(int most) {
    const struct itimerval timer = {{0, 0}, {most, 0}};
    setitimer(ITIMER_PROF, &timer, NULL);
}

static int contradiction(const Operation *operation, unsigned long call, int status, const char *what) {
    printf("call %lu, %s in phase %u, expectation %d, status %d: %s; last message: %s\n", call, operation->names[it.library->plan.version - 2], it.phase,
           (int)now.expected, status, what, messages.text);
    return 1;
}

static int make_call(Operation *operation, unsigned long call, double *longest) {
    char *bytes;
    size_t size;
    memset(&messages, 0, sizeof messages);
    if (fmu_save(&it.fmu) != 0 || fmu_serialize(&it.fmu, &bytes, &size) != 0) fail("fuzz", "state");
    now.expected = WORKS;
    now.fault = NULL;
    now.nobody = 0;
    now.phase = it.phase;
    now.time = it.time;
    now.wild = it.wild;
    limit(LONGEST);
    const double begin = seconds();
    const int status = operation->call();
    *longest = fmax(*longest, seconds() - begin);
    limit(0);
    give_back();
    const char *fault = judge(operation, status);
    if (fault) return contradiction(operation, call, status, fault);
    if (status == 0) {
        operation->accepted++;
        it.phase = now.phase;
        it.time = now.time;
        it.wild = now.wild;
        if (one_in(20)) {
            free(bytes);
            if (fmu_save(&it.fmu) != 0 || fmu_serialize(&it.fmu, &bytes, &size) != 0) fail("fuzz", "state");
            if (!reads_like(bytes, size, it.phase))
                return contradiction(operation, call, status, "the saved state is incomplete");
        }
    } else {
        operation->refused++;
        if (!reads_like(bytes, size, it.phase))
            return contradiction(operation, call, status, "the refused call has left a trace");
    }
    free(bytes);
    return 0;
}

/* The operations of this version, in front of the others, with what the end of the plan says of them: where the standard
 * allows each; returns how many there are. */
static size_t read_calls(const char *plan) {
    size_t n = 0;
    char name[64] = "";
    FILE *file = fopen(plan, "r");
    for (size_t i = 0; i < sizeof OPERATIONS / sizeof *OPERATIONS; i++)
        if (OPERATIONS[i].names[it.library->plan.version - 2] != NULL) OPERATIONS[n++] = OPERATIONS[i];
    while (file && strcmp(name, "calls") != 0)
        if (fscanf(file, "%63s", name) != 1) fail("plan", "the calls are missing");
    for (unsigned a[2], t[2]; file && fscanf(file, "%63s %u %u %u %u", name, &a[0], &t[0], &a[1], &t[1]) == 5;)
        for (Operation *operation = OPERATIONS; operation < OPERATIONS + n; operation++)
            if (strcmp(operation->names[it.library->plan.version - 2], name) == 0) {
                memcpy(operation->allowed, a, sizeof a);
                memcpy(operation->tolerated, t, sizeof t);
            }
    if (file) fclose(file);
    return n;
}

int main(int count, char **words) {
    if (count != 5) fail("usage", "fuzz LIBRARY PLAN SEED CALLS");
    Library library = open_library(words[1], words[2]);
    const Plan *plan = &library.plan;
    const Group *reals[] = {&plan->parameters, &plan->inputs, &plan->outputs, &plan->locals};
    library.logger = note;
    library.intermediate_update = update;
    seed = strtoull(words[3], NULL, 10) * 2654435769u + 1;
    it.library = &library;
    it.all = together(reals, 4);
    it.phase = INSTANTIATED;
    new_instance();

    const size_t n = read_calls(words[2]), version = (size_t)plan->version - 2;
    double longest = 0;
    const unsigned long calls = strtoul(words[4], NULL, 10);
    for (unsigned long call = 0; call < calls; call++) {
        Operation *operation = &OPERATIONS[below(n)];
        /* Calls that would be refused wherever they come, and those that end a life, are rarer than the others. */
        const int ends = operation->call == terminate_instance || operation->call == reset || operation->call == free_instance;
        if ((ends || !(operation->allowed[it.fmu.kind != MODEL_EXCHANGE] & it.phase)) && !one_in(8)) continue;
        if (make_call(operation, call, &longest)) return 1;
    }
    for (const Operation *operation = OPERATIONS; operation < OPERATIONS + n; operation++)
        printf("%s %lu %lu\n", operation->names[version], operation->accepted, operation->refused);
    printf("damaged %lu %lu\nforged %lu %lu\n", damaged.taken, damaged.refused, sealed.taken, sealed.refused);
    printf("longest %g\n", longest);
    free_saved();
    fmu_free(&it.fmu);
    free(it.all.references);
    free(it.all.sizes);
    free(it.all.values);
    free_plan(&library.plan);
    return 0;
}

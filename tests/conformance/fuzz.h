/* What the operations of both versions share: random arguments, and what they make of a call's result. */
#ifndef CONFORMANCE_FUZZ_H
#define CONFORMANCE_FUZZ_H

#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmu.h"

/* Where an instance is, as the standards have it. */
enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    EVENT = 4, /* of model exchange */
    CONTINUOUS = 8,
    STEP = 16,
    STEP_EVENT = 32, /* event mode of co-simulation */
    TERMINATED = 64,
    CONFIGURATION = 128,
    BEFORE = INSTANTIATED | INITIALIZATION,
    RUNNING = EVENT | CONTINUOUS | STEP | STEP_EVENT,
    ANY = BEFORE | RUNNING | TERMINATED
};

typedef enum { WORKS, MAY_FAIL, FAILS } Expectation;

typedef struct {
    const char *names[2]; /* in FMI 2.0 and 3.0, or NULL */
    int (*call)(void);
    unsigned allowed[2];   /* in model exchange and in co-simulation: the standard allows the call there, its result
                              depends on the arguments alone; see calls.txt */
    unsigned tolerated[2]; /* more than the standard asks for: may be taken or refused */
    unsigned long accepted, refused;
} Operation;

typedef struct {
    void *state;
    unsigned phase;
    double time;
    int wild;
    int forged; /* nobody has saved it, see forge.h */
} Saved;

enum { POOL = 4 };

static struct {
    const Library *library;
    Fmu fmu;
    unsigned phase;
    double time;
    int wild;  /* values were set with which calculations may well fail */
    double discarded, discarded_size; /* the last step that was, since anything else was done; NAN: none */
    Saved pool[POOL];
    Group all; /* reals */
} it;

/* The call under way. */
static struct {
    Expectation expected;
    const char *fault; /* what its results contradict */
    int nobody;     /* it is made without an instance */
    unsigned phase; /* where the instance is afterwards, if the call is accepted */
    double time;
    int wild;
} now;

/* What was logged during it. */
static struct {
    int worst;
    char text[1024];
} messages;

/* ---- chance ---------------------------------------------------------------------------------------------------- */

static uint64_t seed = 1;

static uint64_t draw(void) { /* xorshift64* */
    seed ^= seed >> 12;
    seed ^= seed << 25;
    seed ^= seed >> 27;
    return seed * 2685821657736338717u;
}

static size_t below(size_t n) { return (size_t)((draw() >> 11) % n); }

static int one_in(size_t n) { return below(n) == 0; }

static double fraction(void) { return (double)(draw() >> 11) / 9007199254740992.0; }

static void expect(Expectation expected) {
    if (expected > now.expected) now.expected = expected;
}

/* ---- arguments: blocks of their exact size, so that a sanitizer sees what is read or written beside them --------- */

enum { MOST_BLOCKS = 16 };

static void *blocks[MOST_BLOCKS];
static size_t block_count;

static void *take(size_t size) {
    void *block = malloc(size);
    if ((block == NULL && size > 0) || block_count == MOST_BLOCKS) fail("fuzz", "out of memory");
    memset(block, 0x5a, size);
    blocks[block_count++] = block;
    return block;
}

static void give_back(void) {
    while (block_count > 0) free(blocks[--block_count]);
}

static void *component(void) {
    now.nobody = one_in(100);
    return now.nobody ? NULL : it.fmu.component;
}

/* The argument, or NULL, which is refused where n > 0 elements are asked for. */
static void *given(void *argument, size_t n) {
    if (!one_in(40)) return argument;
    if (n > 0) expect(FAILS);
    return NULL;
}

/* 0: none; all of a group now and then. */
static size_t some(const Group *group) { return one_in(8) ? group->n : below(6); }

static unsigned *references_of(const Group *group, size_t n, size_t *count) {
    unsigned *references = take(n * sizeof *references);
    *count = 0;
    for (size_t i = 0; i < n; i++) {
        const size_t place = group->n ? (n == group->n ? i : below(group->n)) : 0;
        const int junk = group->n == 0 || one_in(60);
        static const unsigned JUNK[] = {100000, 0xffffffff, 0x80000000, 0x7fffffff};
        references[i] = junk ? JUNK[below(4)] : group->references[place];
        *count += junk ? 1 : group->sizes[place];
        if (junk) expect(FAILS);
    }
    return references;
}

static double strange_number(void) {
    static const double LARGE[] = {0, -1, 1e-300, DBL_MIN / 4, 1e30, -1e100, DBL_MAX, 1 / 3.0};
    static const double INFINITE[] = {NAN, INFINITY, -INFINITY};
    if (one_in(2)) {
        now.wild = 1;
        return LARGE[below(8)];
    }
    expect(FAILS);
    return INFINITE[below(3)];
}

/* Near the start value, mostly, and of its sign: what is 0 may have to be positive. */
static double number(double start, double spread) {
    if (one_in(150)) return strange_number();
    return start == 0 ? spread * fraction() : start * (1 + spread * (2 * fraction() - 1));
}

/* Values for variables of a group, in the order of their references. */
static double *values_for(const Group *group, const unsigned *references, size_t n, size_t count,
                          double spread) {
    double *values = take(count * sizeof *values);
    size_t filled = 0;
    for (size_t i = 0; i < n; i++) {
        size_t first = 0;
        for (size_t j = 0; j < group->n; first += group->sizes[j++])
            if (group->references[j] == references[i]) {
                for (size_t e = 0; e < group->sizes[j]; e++) values[filled++] = number(group->values[first + e], spread);
                break;
            }
    }
    while (filled < count) values[filled++] = number(0, spread);
    return values;
}

static double *numbers_at(size_t n, double at) {
    double *values = take(n * sizeof *values);
    for (size_t i = 0; i < n; i++) values[i] = number(at, 0.01);
    return values;
}

/* The right length of a vector, or another one, which is refused. */
static size_t length_of(size_t n) {
    if (!one_in(20)) return n;
    expect(FAILS);
    return one_in(2) ? n + 1 + below(3) : n > 0 ? below(n) : 1;
}

static double next_time(void) { /* of model exchange */
    if (one_in(150)) return strange_number();
    return (fabs(it.time) < 1e3 ? it.time : 0) + it.library->plan.step * fraction();
}

static double step_time(void) {
    static const double REFUSED[] = {NAN, INFINITY, -INFINITY, 1e300, -DBL_MAX};
    if (!one_in(60)) return it.time;
    expect(FAILS);
    return one_in(2) ? REFUSED[below(5)] : it.time + (one_in(2) ? 1 : -1) * it.library->plan.step * 3;
}

static double step_size(void) {
    static const double REFUSED[] = {0, -0.1, NAN, INFINITY, -INFINITY};
    const double step = it.library->plan.step;
    if (one_in(40)) {
        expect(FAILS);
        return REFUSED[below(5)];
    }
    if (one_in(100)) { /* that leads nowhere, unless from 0 or nearly so */
        if (it.time + step * 1e-200 == it.time) expect(FAILS);
        return step * 1e-200;
    }
    if (one_in(2000)) return one_in(2) ? 1e300 : DBL_MAX;
    return one_in(300) ? 100 * step : step * (0.1 + fraction());
}

static const char *instance_name(size_t fault) { return fault == 0 ? NULL : fault == 1 ? "" : "another"; }

static const char **categories(size_t n) {
    static const char *const NAMES[] = {"logStatusWarning", "logStatusDiscard", "logStatusError", "logEvents", "", NULL};
    const char **names = take(n * sizeof *names);
    for (size_t i = 0; i < n; i++) {
        const size_t chosen = one_in(10) ? 3 + below(3) : below(3);
        names[i] = NAMES[chosen];
        if (chosen >= 3) expect(FAILS);
    }
    return names;
}

typedef struct {
    int tolerance_given, stop_given;
    double tolerance, start, stop;
} Experiment;

static Experiment some_experiment(void) {
    static const double TOLERANCES[] = {1e-8, 1e-4, 1e-12, 1e-3};
    Experiment it_is = {one_in(2), one_in(8), TOLERANCES[below(4)], one_in(3) ? 2.5 : 0, 0};
    it_is.stop = it_is.start + 10;
    if (one_in(20)) {
        it_is.tolerance = one_in(2) ? -1 : NAN;
        if (it_is.tolerance_given) expect(FAILS);
    }
    if (one_in(20)) {
        static const double STARTS[] = {NAN, INFINITY, -INFINITY};
        it_is.start = STARTS[below(3)];
        expect(FAILS);
    } else if (one_in(20)) {
        const double stops[] = {it_is.start - 1, NAN, INFINITY, -INFINITY};
        it_is.stop = stops[below(4)];
        if (it_is.stop_given) expect(FAILS);
    } else if (one_in(30)) { /* from where no step leads on */
        it_is.start = it_is.stop = one_in(2) ? 1e300 : -DBL_MAX;
        now.wild = 1; /* functions of time overflow there */
    }
    return it_is;
}

typedef struct {
    unsigned *references;
    double *values;
    size_t n, count;
} Setting;

/* Inputs always; parameters, which may be fixed, before the end of initialization; states, which are among the outputs,
 * perhaps in model exchange; else never. */
static Setting some_setting(void) {
    const Plan *plan = &it.library->plan;
    const Group *groups[] = {&plan->inputs, &plan->inputs, &plan->parameters, &plan->outputs};
    const size_t chosen = one_in(20) ? 3 : below(3);
    const double spread = it.phase <= INITIALIZATION && one_in(2) ? 0 : 0.01;
    Setting setting = {NULL, NULL, some(groups[chosen]), 0};
    setting.references = references_of(groups[chosen], setting.n, &setting.count);
    setting.values = values_for(groups[chosen], setting.references, setting.n, setting.count, spread);
    if (it.phase <= INITIALIZATION && spread > 0) now.wild = 1; /* start values may contradict each other */
    if (chosen == 3 && setting.n > 0) {
        expect(it.phase & (EVENT | CONTINUOUS) ? MAY_FAIL : FAILS);
        now.wild = 1;
    }
    if (chosen == 2 && setting.n > 0 && it.phase > INITIALIZATION) expect(MAY_FAIL);
    return setting;
}

/* Of integers: how inputs are reconstructed, and how many symplectic steps are made. */
static int *integer_settings(size_t n) {
    int *values = take(n * sizeof *values);
    for (size_t i = 0; i < n; i++) {
        values[i] = one_in(10) ? (one_in(2) ? -1 : 100001) : (int)below(3);
        if (values[i] < 0 || values[i] > 2) expect(FAILS);
    }
    return values;
}

/* Orders of derivatives of outputs. */
static int *first_orders(size_t n) {
    int *orders = take(n * sizeof *orders);
    for (size_t i = 0; i < n; i++) {
        orders[i] = one_in(60) ? 2 * (int)below(2) : 1;
        if (orders[i] != 1) expect(FAILS);
    }
    return orders;
}

/* ---- results ----------------------------------------------------------------------------------------------------- */

/* The status of a call that has read numbers, which must be finite. */
static int finite(int status, const double *values, size_t n) {
    for (size_t i = 0; status == 0 && i < n; i++)
        if (!isfinite(values[i])) now.fault = "a number that is not finite is read with status OK";
    return status;
}

/* The status of a step: Discard at most once from the same time, unless the next one is shorter. */
static int stepped(int status, double size) {
    if (status == 0) it.discarded = NAN;
    if (status != 2) return status;
    if (it.discarded == it.time && size >= it.discarded_size) now.fault = "the same step is discarded again";
    it.discarded = it.time;
    it.discarded_size = size;
    return status;
}

/* ---- lives and saved states ------------------------------------------------------------------------------------ */

static void begin_anew(void) {
    it.discarded = NAN;
    now.phase = INSTANTIATED;
    now.time = 0;
    now.wild = 0;
}

static void new_instance(void) {
    const size_t kinds = it.library->plan.version == 2 ? 2 : 3;
    if (fmu_instantiate(&it.fmu, it.library, (Interface)below(kinds)) == NULL) fail("fuzz", "no instance");
}

static void replace_instance(void) {
    fmu_free(&it.fmu);
    it.discarded = NAN;
    new_instance();
    begin_anew();
}

static Saved *saved(void) { return &it.pool[below(POOL)]; }

/* A saved state to restore. */
static void *some_state(void) {
    const Saved *chosen = saved();
    if (chosen->state == NULL) expect(FAILS);
    if (chosen->forged) expect(MAY_FAIL); /* it may be one of another kind of instance */
    it.discarded = NAN;
    now.phase = chosen->phase;
    now.time = chosen->time;
    now.wild = chosen->wild;
    return chosen->state;
}

/* A saved state as bytes; none if it is empty. */
static char *bytes_of(const Saved *chosen, size_t *size) {
    Fmu borrowed = it.fmu;
    char *bytes, *copy;
    *size = 0;
    if (chosen->state == NULL) return NULL;
    borrowed.state = chosen->state;
    if (fmu_serialize(&borrowed, &bytes, size) != 0) fail("fuzz", "bytes of a state");
    copy = memcpy(take(*size), bytes, *size);
    free(bytes);
    return copy;
}

/* Space for a saved state, which is too small now and then. */
static char *space_for(const Saved *chosen, size_t *size) {
    if (bytes_of(chosen, size) == NULL) expect(FAILS);
    if (one_in(4)) {
        if (*size > 0) *size -= 1 + below(*size);
        expect(FAILS);
    }
    return take(*size);
}

static Group together(const Group *groups[], size_t n) {
    Group all = {0, 0, NULL, NULL, NULL};
    for (size_t i = 0; i < n; i++) {
        all.n += groups[i]->n;
        all.count += groups[i]->count;
    }
    all.references = calloc(all.n + 1, sizeof *all.references);
    all.sizes = calloc(all.n + 1, sizeof *all.sizes);
    all.values = calloc(all.count + 1, sizeof *all.values);
    if (!all.references || !all.sizes || !all.values) fail("fuzz", "out of memory");
    size_t variable = 0, value = 0;
    for (size_t i = 0; i < n; i++) {
        memcpy(all.references + variable, groups[i]->references, groups[i]->n * sizeof *all.references);
        memcpy(all.sizes + variable, groups[i]->sizes, groups[i]->n * sizeof *all.sizes);
        memcpy(all.values + value, groups[i]->values, groups[i]->count * sizeof *all.values);
        variable += groups[i]->n;
        value += groups[i]->count;
    }
    return all;
}

#endif

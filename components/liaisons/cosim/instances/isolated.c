/* Calls of an FMU that runs in a process of its own, by memory that both share; isolated.py prepares them.

   The parent posts the numbers of prepared calls, with what they are given in slots of that memory, and goes on; it waits
   where it wants to read, so that to set, to step and to get is one message.  The child makes the calls in this order,
   until one is refused.  Whoever waits looks for a moment whether it is over already, and sleeps then.  The functions of
   the parent have the shapes of FMI 2.0's, so that loop.c can call them. */
#define _GNU_SOURCE
#include <limits.h>
#include <linux/futex.h>
#include <sched.h>
#include <stdint.h>
#include <string.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#define EXPORT __attribute__((visibility("default")))

enum { OK, WARNING };
enum { ENDED = 101, LATE, INTERRUPTED }; /* what becomes of the parent's wait, beside the statuses of FMI */
enum { ROOM = 256, LISTEN = 0, FORGET = -1, BEGIN = -2 };
#define SPIN 50e-6  /* [s] before one sleeps */
#define SLICE 10e-3 /* [s] between two looks whether the child is alive */
#define PATIENCE 1.0 /* [s] */

typedef struct {
    uint32_t posted, parent_sleeps; /* calls posted and made, ever growing: sleepers wait for a change of them */
    char apart[56];                 /* what the parent writes and what the child writes lie in cache lines of their own */
    uint32_t made, child_sleeps;
    uint32_t refused; /* which one was, and its status; OK if none was */
    int32_t status;
    char far_apart[48];
    int32_t numbers[ROOM];
} Channel;

typedef struct {
    Channel *channel;
    int child;
    int reads;    /* something is read after each step */
    double limit; /* [s] for a call */
    int lost;     /* the child is, for this reason */
    int (*hold)(void);
    void (*release)(int);
    int (*signals)(void);
    void (*fetch)(void **, void **, void **);
    void *exception[3]; /* that a signal has raised */
} Far;

typedef struct {
    Far *far;
    double *arguments, *results; /* of the call */
    int32_t number;
    uint32_t posted; /* once it is made, what is made is at least this */
} Command;

static uint32_t look(const uint32_t *word) { return __atomic_load_n(word, __ATOMIC_SEQ_CST); }
static void put_up(uint32_t *word, uint32_t value) { __atomic_store_n(word, value, __ATOMIC_SEQ_CST); }

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void sleep_on(uint32_t *word, uint32_t value, double seconds) {
    const struct timespec t = {(time_t)seconds, (long)(1e9 * (seconds - (double)(time_t)seconds))};
    syscall(SYS_futex, word, FUTEX_WAIT, value, &t, NULL, 0);
}

static void wake(uint32_t *word) { syscall(SYS_futex, word, FUTEX_WAKE, 1, NULL, NULL, 0); }

static int all_made(const Channel *c) { return look(&c->made) == look(&c->posted); }

/* Whether that comes to be, or ceases to be, within a moment. */
static int soon(const Channel *c, int made) {
    const double end = now() + SPIN;
    do {
        for (int k = 0; k < 100; k++)
            if (all_made(c) == made) return 1;
        sched_yield(); /* the other one may need this core */
    } while (now() < end);
    return 0;
}

static int ended(const Far *far) {
    siginfo_t found = {0};
    return waitid(P_PID, (id_t)far->child, &found, WEXITED | WNOHANG | WNOWAIT) != 0 || found.si_pid != 0;
}

/* Whether a signal has raised an exception; Python sees it as soon as we return. */
static int interrupted(Far *far) {
    const int state = far->hold(), raised = far->signals();
    if (raised) far->fetch(&far->exception[0], &far->exception[1], &far->exception[2]);
    far->release(state);
    return raised;
}

static int lost(Far *far) {
    Channel *c = far->channel;
    uint32_t made = look(&c->made), before = made;
    for (double begin = now(); made != c->posted; made = look(&c->made)) {
        if (made != before) before = made, begin = now();
        sleep_on(&c->made, made, SLICE);
        if (interrupted(far)) return INTERRUPTED;
        if (ended(far) && !all_made(c)) return ENDED;
        if (now() - begin > far->limit && look(&c->made) == made) return LATE;
    }
    return OK;
}

/* Wait for all that was posted; returns the status of what was refused, if anything was. */
EXPORT int finish(Far *far) {
    Channel *c = far->channel;
    if (far->lost) return far->lost;
    if (!soon(c, 1)) {
        put_up(&c->parent_sleeps, 1);
        far->lost = lost(far);
        put_up(&c->parent_sleeps, 0);
        if (far->lost) return far->lost;
    }
    return c->status;
}

/* The slot is free for the arguments of the next call. */
static int freed(Command *command) {
    const Far *far = command->far;
    return (int32_t)(look(&far->channel->made) - command->posted) < 0 ? finish(command->far) : far->lost;
}

EXPORT int post(Command *command) {
    Far *far = command->far;
    Channel *c = far->channel;
    if (c->posted - look(&c->made) >= ROOM) finish(far);
    if (far->lost) return far->lost;
    c->numbers[c->posted % ROOM] = command->number;
    command->posted = c->posted + 1;
    put_up(&c->posted, command->posted);
    if (look(&c->child_sleeps)) wake(&c->posted);
    return OK;
}

EXPORT int set(Command *command, const unsigned *references, size_t count, const double values[]) {
    (void)references;
    const int status = freed(command);
    if (status > WARNING) return status;
    memcpy(command->arguments, values, count * sizeof(double));
    return post(command);
}

EXPORT int collect(Command *command, const unsigned *references, size_t count, double values[]) {
    (void)references;
    const int status = finish(command->far);
    if (status <= WARNING) memcpy(values, command->results, count * sizeof(double));
    return status;
}

EXPORT int get(Command *command, const unsigned *references, size_t count, double values[]) {
    const int status = post(command);
    return status > WARNING ? status : collect(command, references, count, values);
}

EXPORT int derive(Command *command, size_t known, const double seed[], size_t unknown, double values[]) {
    const int status = set(command, NULL, known, seed);
    return status > WARNING ? status : collect(command, NULL, unknown, values);
}

EXPORT int step(Command *command, double time, double size, int no_return) {
    (void)no_return;
    const double span[] = {time, size};
    const int status = set(command, NULL, 2, span);
    return status > WARNING || command->far->reads ? status : finish(command->far);
}

static void report(Channel *c, int status) {
    if (status == FORGET) c->status = OK;
    if (status > WARNING && c->status == OK) c->refused = c->made, c->status = status;
    put_up(&c->made, c->made + 1);
    if (all_made(c) && look(&c->parent_sleeps)) wake(&c->made);
}

/* Of the child: how its last call went, or FORGET what was refused before; returns the number of the next one. */
EXPORT int next(Channel *c, int status) {
    if (status != BEGIN) report(c, status);
    for (;; report(c, OK)) {
        while (!soon(c, 0)) {
            put_up(&c->child_sleeps, 1);
            if (all_made(c)) sleep_on(&c->posted, c->made, PATIENCE);
            put_up(&c->child_sleeps, 0);
        }
        const int number = c->numbers[c->made % ROOM];
        if (number == LISTEN || c->status == OK) return number; /* after a refusal, nothing is made */
    }
}

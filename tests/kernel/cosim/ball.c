/* A ball that bounces, for Model Exchange only, of FMI 2.0 or, where FMI3 is defined, of FMI 3.0.
 *
 * State events: h falls to 0 (v := -0.7 v), or rises above it.  Time events: a tick every half second.  Step events:
 * after every hundredth step of the solver, if "eager".  It refuses what Model Exchange does not allow in its present mode. */
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#ifdef FMI3
#include "fmi3Functions.h"
typedef fmi3Float64 Real;
typedef fmi3Int32 Whole;
typedef fmi3Boolean Flag;
typedef fmi3Status Status;
typedef fmi3ValueReference Reference;
typedef fmi3Instance Component;
#define F(name) fmi3##name
#define COUNTED , size_t count
#else
#include "fmi2Functions.h"
typedef fmi2Real Real;
typedef fmi2Integer Whole;
typedef fmi2Boolean Flag;
typedef fmi2Status Status;
typedef fmi2ValueReference Reference;
typedef fmi2Component Component;
#define F(name) fmi2##name
#define COUNTED
#endif

enum { H, V, H_DOT, V_DOT, PUSH, LAST, LIMIT, REALS };
enum { BOUNCES = 10, TICKS, STEPS };
enum { PULLED = 20, ABOVE, EAGER, ENDLESS };
enum { INITIALIZING = 1, EVENT = 2, CONTINUOUS = 4 };

typedef struct {
    Real real[REALS], t;
    Whole bounces, ticks, steps;
    bool pulled, above, eager, endless;
    int mode;
#ifdef FMI3
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
#else
    const fmi2CallbackFunctions *callbacks;
#endif
} Ball;

static Status refuse(const Ball *b, Status status, const char *words) {
#ifdef FMI3
    b->log(b->environment, status, "logStatusError", words);
#else
    b->callbacks->logger(b->callbacks->componentEnvironment, "ball", status, "logStatusError", "%s", words);
#endif
    return status;
}
#define ONLY(modes) do { if (!(b->mode & (modes))) return refuse(b, 3, __func__); } while (0)

static Ball *begin(void) {
    Ball *b = calloc(1, sizeof *b);
    b->real[H] = 1, b->real[LAST] = b->real[LIMIT] = 1e9;
    b->pulled = true, b->mode = INITIALIZING;
    return b;
}
static void update(Ball *b, bool *ends, bool *known, Real *next) {
    if (b->real[H] <= 0 && b->real[V] < 0) b->real[V] *= -0.7, b->bounces++;
    b->above = b->real[H] > 0;
    b->ticks += b->t >= 0.5 * (b->ticks + 1);
    *ends = b->t >= b->real[LAST];
    *known = true;
    *next = fmin(0.5 * (b->ticks + 1), b->real[LAST]);
}
static Real rate(const Ball *b) { return b->real[PUSH] - (b->pulled ? 9.81 : 0); }

Status F(EnterEventMode)(Component c) { Ball *b = c; ONLY(CONTINUOUS); b->mode = EVENT; return 0; }
Status F(EnterContinuousTimeMode)(Component c) { Ball *b = c; ONLY(EVENT); b->mode = CONTINUOUS; return 0; }
Status F(ExitInitializationMode)(Component c) { Ball *b = c; ONLY(INITIALIZING); b->mode = EVENT; return 0; }
Status F(Terminate)(Component c) { (void)c; return 0; }
void F(FreeInstance)(Component c) { free(c); }
Status F(SetTime)(Component c, Real t) { Ball *b = c; ONLY(CONTINUOUS); b->t = t; return 0; }
Status F(SetContinuousStates)(Component c, const Real x[], size_t n) {
    Ball *b = c;
    ONLY(CONTINUOUS);
    memcpy(b->real, x, n * sizeof *x);
    return 0;
}
Status F(GetContinuousStates)(Component c, Real x[], size_t n) { memcpy(x, c, n * sizeof *x); return 0; }
Status F(GetNominalsOfContinuousStates)(Component c, Real x[], size_t n) {
    (void)c;
    while (n--) x[n] = 0; /* as some tools say that they know none */
    return 0;
}
Status F(GetEventIndicators)(Component c, Real z[], size_t n) { (void)n; z[0] = ((Ball *)c)->real[H]; return 0; }
static Status derivatives(Component c, Real x[]) {
    Ball *b = c;
    ONLY(CONTINUOUS);
    if (b->t > b->real[LIMIT]) return refuse(b, 2, "t is beyond the limit");
    x[0] = b->real[V], x[1] = rate(b);
    return 0;
}
Status F(CompletedIntegratorStep)(Component c, Flag final, Flag *event, Flag *ends) {
    Ball *b = c;
    (void)final;
    ONLY(CONTINUOUS);
    b->steps++, *event = b->eager && b->steps % 100 == 0, *ends = false;
    return 0;
}

static Status get_real(Component c, const Reference r[], size_t n, Real value[]) {
    Ball *b = c;
    b->real[H_DOT] = b->real[V], b->real[V_DOT] = rate(b);
    for (size_t i = 0; i < n; i++) value[i] = b->real[r[i]];
    return 0;
}
static Status set_real(Component c, const Reference r[], size_t n, const Real value[]) {
    for (size_t i = 0; i < n; i++) ((Ball *)c)->real[r[i]] = value[i];
    return 0;
}
static Status get_whole(Component c, const Reference r[], size_t n, Whole value[]) {
    const Ball *b = c;
    const Whole known[] = {b->bounces, b->ticks, b->steps};
    for (size_t i = 0; i < n; i++) value[i] = known[r[i] - BOUNCES];
    return 0;
}
static Status get_flag(Component c, const Reference r[], size_t n, Flag value[]) {
    const Ball *b = c;
    for (size_t i = 0; i < n; i++) value[i] = r[i] == ABOVE ? b->above : b->pulled;
    return 0;
}
static Status set_flag(Component c, const Reference r[], size_t n, const Flag value[]) {
    Ball *b = c;
    ONLY(INITIALIZING | EVENT);
    for (size_t i = 0; i < n; i++) *(r[i] == EAGER ? &b->eager : r[i] == ENDLESS ? &b->endless : &b->pulled) = value[i];
    return 0;
}
#define PASSING(name, function, Type) \
    Status F(name)(Component c, const Reference r[], size_t n, Type value[] COUNTED) { return function(c, r, n, value); }

#ifdef FMI3
PASSING(GetFloat64, get_real, Real)
PASSING(SetFloat64, set_real, const Real)
PASSING(GetInt32, get_whole, Whole)
PASSING(GetBoolean, get_flag, Flag)
PASSING(SetBoolean, set_flag, const Flag)
fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment e, fmi3LogMessageCallback log) {
    Ball *b = begin();
    (void)name; (void)token; (void)path; (void)visible; (void)logging;
    b->environment = e, b->log = log;
    return b;
}
Status fmi3EnterInitializationMode(Component c, Flag has, Real tolerance, Real t, Flag ends, Real end) {
    (void)has; (void)tolerance; (void)ends; (void)end;
    ((Ball *)c)->t = t;
    return 0;
}
Status fmi3GetNumberOfContinuousStates(Component c, size_t *n) { (void)c; *n = 2; return 0; }
Status fmi3GetNumberOfEventIndicators(Component c, size_t *n) { (void)c; *n = 1; return 0; }
Status fmi3GetContinuousStateDerivatives(Component c, Real x[], size_t n) { (void)n; return derivatives(c, x); }
Status fmi3UpdateDiscreteStates(Component c, Flag *again, Flag *ends, Flag *nominals, Flag *states, Flag *known,
                                Real *next) {
    Ball *b = c;
    ONLY(EVENT);
    update(b, ends, known, next);
    *again = b->endless, *nominals = *states = true;
    return 0;
}
Status fmi3GetFMUState(Component c, fmi3FMUState *state) {
    if (!*state) *state = malloc(sizeof(Ball));
    memcpy(*state, c, sizeof(Ball));
    return 0;
}
Status fmi3SetFMUState(Component c, fmi3FMUState state) { memcpy(c, state, sizeof(Ball)); return 0; }
Status fmi3FreeFMUState(Component c, fmi3FMUState *state) { (void)c; free(*state); *state = NULL; return 0; }
#else
PASSING(GetReal, get_real, Real)
PASSING(SetReal, set_real, const Real)
PASSING(GetInteger, get_whole, Whole)
PASSING(GetBoolean, get_flag, Flag)
PASSING(SetBoolean, set_flag, const Flag)
Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String path,
                          const fmi2CallbackFunctions *callbacks, Flag visible, Flag logging) {
    Ball *b = type == fmi2ModelExchange ? begin() : NULL;
    (void)name; (void)guid; (void)path; (void)visible; (void)logging;
    if (b) b->callbacks = callbacks;
    return b;
}
Status fmi2SetupExperiment(Component c, Flag has, Real tolerance, Real t, Flag ends, Real end) {
    (void)has; (void)tolerance; (void)ends; (void)end;
    ((Ball *)c)->t = t;
    return 0;
}
Status fmi2EnterInitializationMode(Component c) { (void)c; return 0; }
Status fmi2GetDerivatives(Component c, Real x[], size_t n) { (void)n; return derivatives(c, x); }
Status fmi2NewDiscreteStates(Component c, fmi2EventInfo *info) {
    Ball *b = c;
    bool ends, known;
    ONLY(EVENT);
    update(b, &ends, &known, &info->nextEventTime);
    info->newDiscreteStatesNeeded = b->endless, info->terminateSimulation = ends, info->nextEventTimeDefined = known;
    info->nominalsOfContinuousStatesChanged = info->valuesOfContinuousStatesChanged = true;
    return 0;
}
Status fmi2GetFMUstate(Component c, fmi2FMUstate *state) {
    if (!*state) *state = malloc(sizeof(Ball));
    memcpy(*state, c, sizeof(Ball));
    return 0;
}
Status fmi2SetFMUstate(Component c, fmi2FMUstate state) { memcpy(c, state, sizeof(Ball)); return 0; }
Status fmi2FreeFMUstate(Component c, fmi2FMUstate *state) { (void)c; free(*state); *state = NULL; return 0; }
#endif

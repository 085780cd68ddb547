/* An FMU of Model Exchange, of FMI 2.0 or, where FMI3 is defined, of FMI 3.0.  Before it stand the numbers of variables:
 * x states, f their rates behind them, COUNT in all; and `calculate`, `partial` and `change`. */
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#ifdef FMI3
#include "fmi3Functions.h"
#define F(name) fmi3##name
#define SIZE , size_t size
#define SEEDS , size_t seeds
typedef fmi3Boolean Flag;
typedef fmi3Status Status;
typedef fmi3ValueReference Reference;
#else
#include "fmi2Functions.h"
#define F(name) fmi2##name
#define SIZE
#define SEEDS
typedef fmi2Boolean Flag;
typedef fmi2Status Status;
typedef fmi2ValueReference Reference;
#endif

typedef struct {
    double z[COUNT + 1], t;
} M;

static void calculate(double *z, double t);
static int partial(const double *z, double t, unsigned unknown, unsigned known, double *d);
static int change(double *z, double t);
static double indicator(const double *z, double t);

static M *begin(void) {
    static const double starts[] = {STARTS, 0};
    M *m = calloc(1, sizeof *m);
    memcpy(m->z, starts, COUNT * sizeof *starts);
    return m;
}
Status F(SetTime)(void *c, double t) { ((M *)c)->t = t; return 0; }
Status F(SetContinuousStates)(void *c, const double x[], size_t n) { memcpy(((M *)c)->z, x, n * sizeof *x); return 0; }
Status F(GetContinuousStates)(void *c, double x[], size_t n) { memcpy(x, ((M *)c)->z, n * sizeof *x); return 0; }
Status F(GetNominalsOfContinuousStates)(void *c, double x[], size_t n) { (void)c; while (n--) x[n] = 1; return 0; }
Status F(GetEventIndicators)(void *c, double z[], size_t n) {
    M *m = c;
    if (n) z[0] = indicator(m->z, m->t);
    return 0;
}
static Status rates(void *c, double f[], size_t n) {
    M *m = c;
    calculate(m->z, m->t);
    memcpy(f, m->z + STATES, n * sizeof *f);
    return 0;
}
static Status get(void *c, const Reference r[], size_t n, double value[]) {
    M *m = c;
    calculate(m->z, m->t);
    for (size_t i = 0; i < n; i++) value[i] = m->z[r[i]];
    return 0;
}
static Status set(void *c, const Reference r[], size_t n, const double value[]) {
    for (size_t i = 0; i < n; i++) ((M *)c)->z[r[i]] = value[i];
    return 0;
}
Status F(GetDirectionalDerivative)(void *c, const Reference unknown[], size_t rows, const Reference known[], size_t columns,
                                const double seed[] SEEDS, double value[] SIZE) {
    M *m = c;
    calculate(m->z, m->t);
    for (size_t i = 0; i < rows; i++) {
        value[i] = 0;
        for (size_t k = 0; k < columns; k++) {
            double d = 0;
            if (partial(m->z, m->t, unknown[i], known[k], &d)) return 3;
            value[i] += d * seed[k];
        }
    }
    return 0;
}
Status F(EnterEventMode)(void *c) { (void)c; return 0; }
Status F(EnterContinuousTimeMode)(void *c) { (void)c; return 0; }
Status F(ExitInitializationMode)(void *c) { (void)c; return 0; }
Status F(Terminate)(void *c) { (void)c; return 0; }
void F(FreeInstance)(void *c) { free(c); }
Status F(CompletedIntegratorStep)(void *c, Flag final, Flag *event, Flag *ends) {
    (void)c; (void)final;
    *event = *ends = false;
    return 0;
}
static Status save(void *c, void **state) {
    if (!*state) *state = malloc(sizeof(M));
    memcpy(*state, c, sizeof(M));
    return 0;
}
static Status restore(void *c, void *state) { memcpy(c, state, sizeof(M)); return 0; }
static Status release(void **state) { free(*state); *state = NULL; return 0; }

#ifdef FMI3
Status fmi3GetFMUState(void *c, fmi3FMUState *state) { return save(c, state); }
Status fmi3SetFMUState(void *c, fmi3FMUState state) { return restore(c, state); }
Status fmi3FreeFMUState(void *c, fmi3FMUState *state) { (void)c; return release(state); }
void *fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible,
                                   fmi3Boolean logging, void *environment, fmi3LogMessageCallback log) {
    (void)name; (void)token; (void)path; (void)visible; (void)logging; (void)environment; (void)log;
    return begin();
}
Status fmi3EnterInitializationMode(void *c, Flag has, double tolerance, double t, Flag ends, double end) {
    (void)has; (void)tolerance; (void)ends; (void)end;
    ((M *)c)->t = t;
    return 0;
}
Status fmi3GetFloat64(void *c, const Reference r[], size_t n, double value[], size_t size) { (void)size; return get(c, r, n, value); }
Status fmi3SetFloat64(void *c, const Reference r[], size_t n, const double value[], size_t size) { (void)size; return set(c, r, n, value); }
Status fmi3GetNumberOfContinuousStates(void *c, size_t *n) { (void)c; *n = STATES; return 0; }
Status fmi3GetNumberOfEventIndicators(void *c, size_t *n) { (void)c; *n = INDICATORS; return 0; }
Status fmi3GetContinuousStateDerivatives(void *c, double f[], size_t n) { return rates(c, f, n); }
Status fmi3UpdateDiscreteStates(void *c, Flag *again, Flag *ends, Flag *nominals, Flag *states, Flag *has, double *next) {
    M *m = c;
    *again = *nominals = *has = false;
    *ends = change(m->z, m->t);
    *states = true, *next = 0;
    return 0;
}
#else
Status fmi2GetFMUstate(void *c, fmi2FMUstate *state) { return save(c, state); }
Status fmi2SetFMUstate(void *c, fmi2FMUstate state) { return restore(c, state); }
Status fmi2FreeFMUstate(void *c, fmi2FMUstate *state) { (void)c; return release(state); }
void *fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String path,
                      const fmi2CallbackFunctions *callbacks, Flag visible, Flag logging) {
    (void)name; (void)type; (void)guid; (void)path; (void)callbacks; (void)visible; (void)logging;
    return begin();
}
Status fmi2SetupExperiment(void *c, Flag has, double tolerance, double t, Flag ends, double end) {
    (void)has; (void)tolerance; (void)ends; (void)end;
    ((M *)c)->t = t;
    return 0;
}
Status fmi2EnterInitializationMode(void *c) { (void)c; return 0; }
Status fmi2GetReal(void *c, const Reference r[], size_t n, double value[]) { return get(c, r, n, value); }
Status fmi2SetReal(void *c, const Reference r[], size_t n, const double value[]) { return set(c, r, n, value); }
Status fmi2GetDerivatives(void *c, double f[], size_t n) { return rates(c, f, n); }
Status fmi2NewDiscreteStates(void *c, fmi2EventInfo *info) {
    M *m = c;
    memset(info, 0, sizeof *info);
    info->terminateSimulation = change(m->z, m->t);
    info->valuesOfContinuousStatesChanged = true;
    return 0;
}
#endif

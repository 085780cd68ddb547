#include "core.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "solver.h"

/* Tolerances are kept between these: below, rounding errors take over. */
static const double TIGHTEST = 1e-14, LOOSEST = 1e-2;
/* A step may have this part of the tolerance as its error: those of many steps add up. */
static const double SHARE = 0.02;

enum { TEXT = 512 };
enum { ORDER = 5, COEFFICIENTS = ORDER + 1 }; /* of the polynomials that the inputs follow inside a step */

typedef struct { /* an input that moves inside a step */
    size_t place;
    double c[COEFFICIENTS]; /* of powers of the fraction of the step that has passed */
} Mover;

/* The scalars of a saved state; numbers of fixed size and without gaps. */
typedef struct {
    double time;
    double tolerance;
    double step;  /* that the solver goes on with; 0: unknown */
    double limit; /* the next time event: until then functions of time are taken from its left */
    int32_t phase;
    int32_t model_exchange;
    int32_t reconstruction;
    int32_t unstarted; /* y and m are still to be calculated from u and k */
    int32_t jumped;    /* inputs or parameters were set since m was remembered */
    int32_t expanded;  /* derivatives of inputs are given for the next step */
} Scalars;

typedef struct { /* in front of the numbers of a saved state */
    char magic[8];
    uint32_t byte_order, version;
    uint64_t size;
    char guid[40];
} Header;

static const Header HEADER = {"liaison", 0x01020304, 1, 0, ""};

struct Instance {
    const Model *model;
    Report *report;
    void *owner;

    /* What a saved state holds: the scalars, and behind them in the same block the vectors. */
    Scalars *s;
    size_t state_size; /* in bytes */
    double *u;         /* inputs at the present time */
    double *taylor;    /* given derivatives of the inputs, COEFFICIENTS each; the 0th says whether there are any */
    double *y, *low;   /* states, and the part of their sum that is too small for them */
    double *m;
    double *size;      /* of the states: scales the tolerance */
    double *k, *set;   /* parameters, inputs as they were set last */
    double *z;         /* follows k and set, but is no part of the state */
    int current;       /* z belongs to the state */

    Scalars *backup;
    double step_start, step_size;
    Mover *movers;
    size_t moving, *mover_of; /* number of movers; place of an input among them */
    char text[TEXT]; /* why the present call fails */

    double *work, *condition, *instant, *dy, *du, *dk, *dm, *dz;
    const double **arguments;
    double **results;
    long long *integers;
    double *reals;
};

/* ---- messages ---------------------------------------------------------------------------------------------- */

Status core_report(const Instance *self, Status status, const char *format, ...) {
    char text[TEXT];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    self->report(self->owner, status, text);
    return status;
}

/* Note why the present call fails; returns 0. */
static int because(Instance *self, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(self->text, sizeof self->text, format, arguments);
    va_end(arguments);
    return 0;
}

static const char *spelled(double value) { /* a number that is not finite, alike on all platforms */
    return isnan(value) ? "nan" : value > 0 ? "inf" : "-inf";
}

/* ---- generated functions ----------------------------------------------------------------------------------- */

/* At an event a function of time may jump; it is not there yet. */
static double before_limit(const Instance *self, double t) {
    return t >= self->s->limit ? nextafter(self->s->limit, -INFINITY) : t;
}

/* Call a function of (t, y, u, k) or (t, y, u, k, m) with one result, which must be none of the arguments. */
static void evaluate(Instance *self, Function *function, double t, const double *y, double *result) {
    t = before_limit(self, t);
    self->arguments[0] = &t;
    self->arguments[1] = y;
    self->arguments[2] = self->u;
    self->arguments[3] = self->k;
    self->arguments[4] = self->m;
    self->results[0] = result;
    function(self->arguments, self->results, self->integers, self->reals, 0);
}

/* y and m at initialization. */
static void start(Instance *self) {
    if (!self->s->unstarted) return;
    self->arguments[0] = &self->s->time;
    self->arguments[1] = self->u;
    self->arguments[2] = self->k;
    self->results[0] = self->y;
    self->results[1] = self->m;
    self->model->start(self->arguments, self->results, self->integers, self->reals, 0);
    self->s->unstarted = 0;
}

static void remember(Instance *self) {
    evaluate(self, self->model->remember, self->s->time, self->y, self->dm);
    memcpy(self->m, self->dm, self->model->memory * sizeof *self->m);
    self->s->jumped = 0;
}

/* The inputs have jumped: states that an impulse changes, say the work done. */
static void jump(Instance *self) {
    evaluate(self, self->model->jump, self->s->time, self->y, self->dy);
    memcpy(self->y, self->dy, self->model->states * sizeof *self->y);
    self->s->jumped = 0;
}

/* z at the present time. */
static void update(Instance *self) {
    if (self->current) return;
    start(self);
    if (self->s->phase == CONTINUOUS) remember(self); /* nothing jumps between events */
    evaluate(self, self->model->calculate, self->s->time, self->y, self->z);
    self->current = 1;
}

/* The first instant after t at which the component is not smooth. */
static double next_instant(Instance *self, double t) {
    double next = INFINITY;
    if (self->model->events == 0) return next;
    self->arguments[0] = self->k;
    self->results[0] = self->instant;
    self->model->instants(self->arguments, self->results, self->integers, self->reals, 0);
    for (size_t i = 0; i < self->model->events; i++)
        if (self->instant[i] > t && self->instant[i] < next) next = self->instant[i];
    return next;
}

/* The end of a step, moved onto an instant that it means and misses by rounding: 3 * 0.3 is not 0.9. */
static double at_instant(Instance *self, double start, double end) {
    const double instant = next_instant(self, start);
    return fabs(instant - end) <= 1e-12 * (1 + fabs(end)) ? instant : end;
}

/* ---- what is allowed --------------------------------------------------------------------------------------- */

static int allows(const Variable *variable, double value) {
    if (variable->strict) return value > variable->minimum && value < variable->maximum;
    return value >= variable->minimum && value <= variable->maximum;
}

static int check_domain(Instance *self, size_t reference, double value, double t) {
    const Variable *variable = &self->model->variables[reference];
    return allows(variable, value)
           || because(self, "%s = %.9g at t = %.9g: it must be %s", variable->name, value, t, variable->domain);
}

/* Parameters and inputs as they were set. */
static int check_domains(Instance *self, double t) {
    for (size_t i = 0; i < self->model->parameters + self->model->inputs; i++)
        if (!check_domain(self, i, self->k[i], t)) return 0;
    return 1;
}

static int check_conditions(Instance *self, double t, const double *y, size_t count) {
    if (count == 0) return 1;
    evaluate(self, self->model->distances, t, y, self->condition);
    for (size_t i = 0; i < count; i++)
        if (!(self->condition[i] > 0))
            return because(self, "%s; at t = %.9g it does not (%.3g)", self->model->condition_texts[i], t,
                           self->condition[i]);
    return 1;
}

static int check_finite(Instance *self, const double *values, const size_t *references, double t) {
    for (size_t i = 0; i < self->model->states; i++)
        if (!isfinite(values[i]))
            return because(self, "%s = %s at t = %.9g: the motion ends there",
                           self->model->variables[references[i]].name, spelled(values[i]), t);
    return 1;
}

static int settable(const Instance *self, const Variable *variable) {
    switch (variable->kind) {
    case INPUT: return 1;
    case FIXED_PARAMETER: return self->s->phase < EVENT;
    case TUNABLE_PARAMETER: return self->s->phase != CONTINUOUS;
    default: return 0;
    }
}

static Status check_reference(const Instance *self, unsigned reference) {
    const Model *model = self->model;
    const size_t count = model->parameters + model->inputs + model->outputs;
    if (reference < count) return SUCCESS;
    return core_report(self, ERROR, "value reference %u belongs to no Real variable; they are 0 to %lu", reference,
                       (unsigned long)(count - 1));
}

/* ---- life -------------------------------------------------------------------------------------------------- */

Instance *core_new(const Model *model, int model_exchange, Report *report, void *owner) {
    const size_t n = model->states, vectors = model->inputs * (2 + COEFFICIENTS) + 3 * n + model->memory
                                              + model->parameters;
    const size_t scratch = SOLVER_COLUMNS * n + model->start_conditions + model->events + n + model->inputs
                           + model->parameters + model->memory + model->outputs + model->reals;
    const size_t state_size = sizeof(Scalars) + vectors * sizeof(double);
    Instance *self = calloc(1, sizeof *self);
    if (self == NULL) return NULL;
    self->model = model;
    self->report = report;
    self->owner = owner;
    self->state_size = state_size;
    self->s = calloc(1, state_size + model->outputs * sizeof(double));
    self->backup = malloc(state_size);
    self->movers = calloc(model->inputs + 1, sizeof *self->movers);
    self->mover_of = calloc(model->inputs + 1, sizeof *self->mover_of);
    self->work = calloc(scratch + 1, sizeof *self->work);
    self->arguments = calloc(model->most_arguments, sizeof *self->arguments);
    self->results = calloc(model->most_results, sizeof *self->results);
    self->integers = calloc(model->integers + 1, sizeof *self->integers);
    if (!self->s || !self->backup || !self->movers || !self->mover_of || !self->work || !self->arguments
        || !self->results || !self->integers) {
        core_free(self);
        return NULL;
    }
    double *place = (double *)(self->s + 1);
    self->u = place;
    self->taylor = self->u + model->inputs;
    self->y = self->taylor + COEFFICIENTS * model->inputs;
    self->low = self->y + n;
    self->m = self->low + n;
    self->size = self->m + model->memory;
    self->k = self->size + n;
    self->set = self->k + model->parameters;
    self->z = self->set + model->inputs;
    self->condition = self->work + SOLVER_COLUMNS * n;
    self->instant = self->condition + model->start_conditions;
    self->dy = self->instant + model->events;
    self->du = self->dy + n;
    self->dk = self->du + model->inputs;
    self->dm = self->dk + model->parameters;
    self->dz = self->dm + model->memory;
    self->reals = self->dz + model->outputs;
    self->s->model_exchange = model_exchange;
    core_reset(self);
    return self;
}

void core_free(Instance *self) {
    if (self == NULL) return;
    free(self->s);
    free(self->backup);
    free(self->movers);
    free(self->mover_of);
    free(self->work);
    free(self->arguments);
    free(self->results);
    free(self->integers);
    free(self);
}

void core_reset(Instance *self) {
    const Model *model = self->model;
    const int32_t model_exchange = self->s->model_exchange;
    memset(self->s, 0, self->state_size);
    self->s->model_exchange = model_exchange;
    self->s->phase = INSTANTIATED;
    self->s->reconstruction = EXTRAPOLATE;
    self->s->limit = INFINITY;
    self->s->tolerance = model->tolerance;
    self->s->unstarted = 1;
    for (size_t i = 0; i < model->parameters + model->inputs; i++) self->k[i] = model->variables[i].start;
    memcpy(self->u, self->set, model->inputs * sizeof *self->u);
    self->current = 0;
}

Phase core_phase(const Instance *self) { return (Phase)self->s->phase; }

double core_time(const Instance *self) { return self->s->time; }

Status core_setup(Instance *self, double start_time, double tolerance) {
    if (!isfinite(start_time))
        return core_report(self, ERROR, "start time = %s: it must be finite", spelled(start_time));
    if (!(tolerance >= 0 && isfinite(tolerance)))
        return core_report(self, ERROR, "tolerance = %g: it must be > 0 and finite", tolerance);
    self->s->time = start_time;
    self->s->unstarted = 1;
    self->current = 0;
    if (tolerance == 0) return SUCCESS;
    self->s->tolerance = fmin(fmax(tolerance, TIGHTEST), LOOSEST);
    if (self->s->tolerance == tolerance) return SUCCESS;
    core_report(self, WARNING, "tolerance = %g is out of range, %g is used", tolerance, self->s->tolerance);
    return SUCCESS;
}

void core_enter_initialization(Instance *self) { self->s->phase = INITIALIZATION; }

static void measure(Instance *self) {
    evaluate(self, self->model->nominals, self->s->time, self->y, self->size);
    for (size_t i = 0; i < self->model->states; i++)
        if (!(self->size[i] > 0 && isfinite(self->size[i]))) self->size[i] = 1;
}

Status core_exit_initialization(Instance *self) {
    start(self);
    const double t = self->s->time;
    if (!check_domains(self, t) || !check_finite(self, self->y, self->model->state_references, t)
        || !check_conditions(self, t, self->y, self->model->start_conditions))
        return core_report(self, ERROR, "%s; set another value and initialize again", self->text);
    measure(self);
    self->s->phase = self->s->model_exchange ? EVENT : STEP;
    self->s->jumped = 0;
    return SUCCESS;
}

void core_terminate(Instance *self) { self->s->phase = TERMINATED; }

/* ---- variables --------------------------------------------------------------------------------------------- */

Status core_get(Instance *self, const unsigned references[], size_t n, double values[]) {
    const size_t calculated = self->model->parameters + self->model->inputs;
    for (size_t i = 0; i < n; i++)
        if (check_reference(self, references[i]) != SUCCESS) return ERROR;
    for (size_t i = 0; i < n; i++) {
        if (references[i] >= calculated) update(self);
        values[i] = self->k[references[i]];
    }
    return SUCCESS;
}

static const char FIXED[] = "it is a fixed parameter; set it before initialization ends";

static Status check_setting(const Instance *self, unsigned reference, double value) {
    if (check_reference(self, reference) != SUCCESS) return ERROR;
    const Variable *variable = &self->model->variables[reference];
    if (!isfinite(value))
        return core_report(self, DISCARD, "%s = %s: set a finite number; it stays %.9g", variable->name,
                           spelled(value), self->k[reference]);
    if (settable(self, variable)) return SUCCESS;
    return core_report(self, ERROR, "%s = %.9g: %s", variable->name, value,
                       variable->kind == CALCULATED        ? "it is calculated; set parameters and inputs"
                       : variable->kind == FIXED_PARAMETER ? FIXED
                                                           : "it is a parameter; set it in event mode");
}

Status core_set(Instance *self, const unsigned references[], size_t n, const double values[]) {
    const size_t inputs_size = self->model->inputs * sizeof *self->u;
    int tuned = 0;
    for (size_t i = 0; i < n; i++) {
        const Status status = check_setting(self, references[i], values[i]);
        if (status != SUCCESS) return status;
    }
    for (size_t i = 0; i < n; i++) {
        tuned |= references[i] < self->model->parameters && self->k[references[i]] != values[i];
        self->k[references[i]] = values[i];
    }
    if (self->s->phase < EVENT) self->s->unstarted = 1;
    /* The values belong to the present time, but in interpolation: there to the end of the step to come. */
    const int present = !(self->s->phase == STEP && self->s->reconstruction == INTERPOLATE);
    if (tuned || (present && memcmp(self->u, self->set, inputs_size) != 0)) {
        self->s->jumped = 1;
        self->current = 0;
    }
    if (present) memcpy(self->u, self->set, inputs_size);
    return SUCCESS;
}

static Status check_reconstruction(const Instance *self, unsigned reference) {
    const size_t count = self->model->parameters + self->model->inputs + self->model->outputs;
    if (self->model->inputs > 0 && reference == count) return SUCCESS;
    return core_report(self, ERROR, "value reference %u belongs to no Integer variable", reference);
}

Status core_get_reconstruction(Instance *self, unsigned reference, int *value) {
    if (check_reconstruction(self, reference) != SUCCESS) return ERROR;
    *value = self->s->reconstruction;
    return SUCCESS;
}

Status core_set_reconstruction(Instance *self, unsigned reference, int value) {
    if (check_reconstruction(self, reference) != SUCCESS) return ERROR;
    if (value < HOLD || value > INTERPOLATE)
        return core_report(self, ERROR, "input_reconstruction = %d: set 0 (hold), 1 (extrapolate) or 2 (interpolate)",
                           value);
    if (self->s->phase >= EVENT)
        return core_report(self, ERROR, "input_reconstruction = %d: %s", value, FIXED);
    self->s->reconstruction = value;
    return SUCCESS;
}

/* ---- directional derivatives ------------------------------------------------------------------------------- */

/* dz from dt, dy, du, dk.  At initialization y and m follow from u and k; with `remembering`, m follows the motion. */
static void forward(Instance *self, double dt, int remembering) {
    const Model *model = self->model;
    update(self);
    const double t = before_limit(self, self->s->time);
    if (self->s->phase < EVENT) {
        const double *arguments[] = {&t, self->u, self->k, self->y, self->m, &dt, self->du, self->dk};
        memcpy(self->arguments, arguments, sizeof arguments);
        self->results[0] = self->dy;
        self->results[1] = self->dm;
        model->start_forward(self->arguments, self->results, self->integers, self->reals, 0);
    } else if (remembering) {
        const double *arguments[] = {&t,  self->y,  self->u,  self->k,  self->m, self->m,
                                     &dt, self->dy, self->du, self->dk, NULL};
        memcpy(self->arguments, arguments, sizeof arguments);
        self->results[0] = self->dm;
        model->remember_forward(self->arguments, self->results, self->integers, self->reals, 0);
    } else {
        memset(self->dm, 0, model->memory * sizeof *self->dm);
    }
    const double *arguments[] = {&t,  self->y,  self->u,  self->k,  self->m, self->z,
                                 &dt, self->dy, self->du, self->dk, self->dm};
    memcpy(self->arguments, arguments, sizeof arguments);
    self->results[0] = self->dz;
    model->calculate_forward(self->arguments, self->results, self->integers, self->reals, 0);
}

static void clear_direction(Instance *self) {
    memset(self->dy, 0, (size_t)(self->dm - self->dy) * sizeof *self->dy);
}

/* Where the direction of a known variable is kept; NULL if it is not known in this phase. */
static double *known(Instance *self, unsigned reference) {
    const Model *model = self->model;
    if (reference < model->parameters)
        return settable(self, &model->variables[reference]) ? &self->dk[reference] : NULL;
    if (reference < model->parameters + model->inputs) return &self->du[reference - model->parameters];
    if (self->s->phase >= EVENT)
        for (size_t i = 0; i < model->states; i++)
            if (model->state_references[i] == reference) return &self->dy[i];
    return NULL;
}

Status core_directional_derivative(Instance *self, const unsigned unknowns[], size_t unknown_count,
                                   const unsigned knowns[], size_t known_count, const double direction[],
                                   double result[]) {
    const size_t calculated = self->model->parameters + self->model->inputs;
    clear_direction(self);
    for (size_t i = 0; i < known_count; i++) {
        if (check_reference(self, knowns[i]) != SUCCESS) return ERROR;
        double *place = known(self, knowns[i]);
        if (place == NULL)
            return core_report(self, ERROR, "%s is not among the known variables now; they are %s",
                               self->model->variables[knowns[i]].name,
                               self->s->phase < EVENT ? "parameters and inputs" : "inputs, states, tunable parameters");
        *place += direction[i];
    }
    for (size_t i = 0; i < unknown_count; i++) {
        if (check_reference(self, unknowns[i]) != SUCCESS) return ERROR;
        if (unknowns[i] < calculated)
            return core_report(self, ERROR, "%s is not an unknown variable: it is set, not calculated",
                               self->model->variables[unknowns[i]].name);
    }
    forward(self, 0, self->s->phase == CONTINUOUS);
    for (size_t i = 0; i < unknown_count; i++) result[i] = self->dz[unknowns[i] - calculated];
    return SUCCESS;
}

Status core_output_derivatives(Instance *self, const unsigned references[], size_t n, double values[]) {
    const Model *model = self->model;
    const size_t calculated = model->parameters + model->inputs;
    for (size_t i = 0; i < n; i++) {
        if (check_reference(self, references[i]) != SUCCESS) return ERROR;
        if (references[i] < calculated)
            return core_report(self, ERROR, "%s is no output", model->variables[references[i]].name);
    }
    clear_direction(self);
    evaluate(self, model->derivatives, self->s->time, self->y, self->dy);
    for (size_t i = 0; i < model->actives && self->s->reconstruction != HOLD; i++) {
        self->du[model->active[i].value] = self->u[model->active[i].rate];
        self->du[model->active[i].rate] = self->u[model->active[i].acceleration];
    }
    for (size_t i = 0; i < model->inputs; i++)
        if (self->taylor[i * COEFFICIENTS] != 0) self->du[i] = self->taylor[i * COEFFICIENTS + 1];
    forward(self, 1, 1);
    for (size_t i = 0; i < n; i++) values[i] = self->dz[references[i] - calculated];
    return SUCCESS;
}

/* ---- motion of the inputs inside a step -------------------------------------------------------------------- */

static Status check_input_derivative(const Instance *self, unsigned reference, int order, double value) {
    if (check_reference(self, reference) != SUCCESS) return ERROR;
    const Variable *variable = &self->model->variables[reference];
    if (variable->kind != INPUT) return core_report(self, ERROR, "%s is no input", variable->name);
    if (order < 1 || order > ORDER)
        return core_report(self, ERROR, "derivative of order %d of %s: the order must be 1 to %d", order,
                           variable->name, ORDER);
    if (isfinite(value)) return SUCCESS;
    return core_report(self, DISCARD, "derivative of order %d of %s = %s: set a finite number", order, variable->name,
                       spelled(value));
}

Status core_set_input_derivatives(Instance *self, const unsigned references[], size_t n, const int orders[],
                                  const double values[]) {
    for (size_t i = 0; i < n; i++) {
        const Status status = check_input_derivative(self, references[i], orders[i], values[i]);
        if (status != SUCCESS) return status;
    }
    for (size_t i = 0; i < n; i++) {
        double *taylor = &self->taylor[(references[i] - self->model->parameters) * COEFFICIENTS];
        taylor[0] = 1;
        taylor[orders[i]] = values[i];
    }
    self->s->expanded = 1;
    return SUCCESS;
}

/* Derivative with respect to time of a polynomial in the fraction of a step of size H. */
static void differentiate(const double *c, double H, double *derivative) {
    for (int j = 0; j < ORDER; j++) derivative[j] = (j + 1) * c[j + 1] / H;
    derivative[ORDER] = 0;
}

/* Quintic Hermite polynomial: value, rate and acceleration at both ends of the step. */
static void interpolate(const double *u, const double *set, const Active *active, double H, double *c) {
    c[0] = u[active->value];
    c[1] = H * u[active->rate];
    c[2] = H * H * u[active->acceleration] / 2;
    /* what this parabola misses at the end */
    const double value = set[active->value] - (c[0] + c[1] + c[2]);
    const double rate = H * set[active->rate] - (c[1] + 2 * c[2]);
    const double acceleration = H * H * set[active->acceleration] - 2 * c[2];
    c[3] = 10 * value - 4 * rate + acceleration / 2;
    c[4] = -15 * value + 7 * rate - acceleration;
    c[5] = 6 * value - 3 * rate + acceleration / 2;
}

static int rests(const Instance *self, const Active *active) {
    const double *u = self->u, *set = self->set;
    if (u[active->rate] != 0 || u[active->acceleration] != 0) return 0;
    return self->s->reconstruction == EXTRAPOLATE
           || (set[active->value] == u[active->value] && set[active->rate] == 0 && set[active->acceleration] == 0);
}

/* The polynomial of an input, which is constant so far. */
static double *polynomial(Instance *self, size_t place) {
    const size_t found = self->mover_of[place];
    if (found < self->moving && self->movers[found].place == place) return self->movers[found].c;
    self->mover_of[place] = self->moving;
    self->movers[self->moving] = (Mover){.place = place, .c = {self->u[place]}};
    return self->movers[self->moving++].c;
}

/* The polynomials of all inputs that move in a step of size H, from u and what was set. */
static void reconstruct(Instance *self, double H) {
    const Model *model = self->model;
    const int mode = self->s->reconstruction;
    const double *u = self->u, *set = self->set;
    self->moving = 0;
    for (size_t i = 0; i < model->inputs && mode == INTERPOLATE; i++)
        if (set[i] != u[i]) polynomial(self, i)[1] = set[i] - u[i];
    for (size_t i = 0; i < model->actives && mode != HOLD; i++) {
        const Active *active = &model->active[i];
        if (rests(self, active)) continue;
        double *value = polynomial(self, active->value), *rate = polynomial(self, active->rate);
        if (mode == INTERPOLATE) {
            interpolate(u, set, active, H, value);
        } else {
            value[1] = H * u[active->rate];
            value[2] = H * H * u[active->acceleration] / 2;
        }
        differentiate(value, H, rate);
        differentiate(rate, H, polynomial(self, active->acceleration));
    }
    for (size_t i = 0; i < model->inputs && mode != INTERPOLATE && self->s->expanded; i++) {
        const double *taylor = &self->taylor[i * COEFFICIENTS];
        if (taylor[0] == 0) continue;
        double *c = polynomial(self, i), factor = 1;
        for (int j = 1; j <= ORDER; j++) c[j] = taylor[j] * (factor *= H / j);
        c[0] = u[i];
    }
}

/* u at a time inside the step; 0 if one leaves its domain. */
static int move_inputs(Instance *self, double t) {
    const double x = t / self->step_size;
    for (const Mover *mover = self->movers; mover < self->movers + self->moving; mover++) {
        const double *c = mover->c;
        const double value = c[0] + x * (c[1] + x * (c[2] + x * (c[3] + x * (c[4] + x * c[5]))));
        self->u[mover->place] = value;
        if (!check_domain(self, self->model->parameters + mover->place, value, self->step_start + t)) return 0;
    }
    return 1;
}

/* ---- a communication step ---------------------------------------------------------------------------------- */

static Signal rates(void *context, double t, const double y[], double f[]) {
    Instance *self = context;
    if (!move_inputs(self, t)) return STOP;
    evaluate(self, self->model->derivatives, self->step_start + t, y, f);
    return GO_ON;
}

static Signal accept(void *context, double t, double y[]) {
    Instance *self = context;
    const Model *model = self->model;
    if (model->conditions == 0 && model->project == NULL) return GO_ON;
    if (!move_inputs(self, t)) return STOP;
    if (model->project != NULL) { /* back onto constraints and unit quaternions */
        evaluate(self, model->project, self->step_start + t, y, self->dy);
        memcpy(y, self->dy, model->states * sizeof *y);
        memset(self->low, 0, model->states * sizeof *self->low);
    }
    return check_conditions(self, self->step_start + t, y, model->conditions) ? GO_ON : STOP;
}

/* Why no step from a time inside the communication step is small enough. */
static int explain_stuck(Instance *self, double t) {
    const Model *model = self->model;
    const double time = self->step_start + t;
    if (!move_inputs(self, t)) return 0;
    evaluate(self, model->derivatives, time, self->y, self->dy);
    if (!check_finite(self, self->dy, model->derivative_references, time)) return 0;
    if (model->conditions > 0) evaluate(self, model->distances, time, self->y, self->condition);
    for (size_t i = 0; i < model->conditions; i++)
        if (self->condition[i] < 1e-3) /* distances from a singularity, of order 1 elsewhere */
            return because(self, "%s; at t = %.9g it hardly does (%.3g)", model->condition_texts[i], time,
                           self->condition[i]);
    /* An input that is about to leave its domain, where a singularity lies as a rule. */
    for (double ahead = 1e-12; ahead < 1e-2; ahead *= 10)
        if (!move_inputs(self, t + ahead * self->step_size)) return 0;
    return because(self, "no step from t = %.9g is small enough for the tolerance %g", time, self->s->tolerance);
}

/* The states from the start of the step to its end, event by event. */
static int move_states(Instance *self) {
    const double start = self->step_start, size = self->step_size;
    const Problem problem = {self->model->states, SHARE * self->s->tolerance, self->size, rates, accept, self};
    double t = 0, event = start;
    do {
        event = next_instant(self, event);
        self->s->limit = event;
        const double end = event < start + size ? event - start : size;
        switch (solver_advance(&problem, &t, end, self->y, self->low, &self->s->step, self->work)) {
        case STOPPED: return 0;
        case STUCK: return explain_stuck(self, t);
        case EXHAUSTED:
            return because(self, "%d solver steps lead no further than t = %.9g: something moves very fast", MOST_STEPS,
                           start + t);
        case REACHED: break;
        }
    } while (t < size);
    self->s->limit = INFINITY;
    return 1;
}

static int advance(Instance *self, double time, double size) {
    const size_t inputs_size = self->model->inputs * sizeof *self->u;
    const int interpolating = self->s->reconstruction == INTERPOLATE;
    self->step_start = time;
    self->step_size = size;
    self->s->time = time;
    if (!check_domains(self, interpolating ? time + size : time)) return 0;
    if (!interpolating && memcmp(self->u, self->set, inputs_size) != 0) {
        memcpy(self->u, self->set, inputs_size);
        self->s->jumped = 1;
    }
    if (self->s->jumped) jump(self);
    reconstruct(self, size);
    if (!check_conditions(self, time, self->y, self->model->conditions)) return 0;
    if (self->model->states > 0 && !move_states(self)) return 0;
    if (interpolating)
        memcpy(self->u, self->set, inputs_size);
    else if (!move_inputs(self, size))
        return 0;
    if (self->s->expanded) memset(self->taylor, 0, COEFFICIENTS * inputs_size);
    self->s->expanded = 0;
    self->s->time = at_instant(self, time, time + size);
    remember(self);
    return 1;
}

Status core_step(Instance *self, double time, double size) {
    if (!(size > 0 && isfinite(size)))
        return core_report(self, ERROR, "step size = %g: it must be > 0 and finite", size);
    if (!(fabs(time - self->s->time) <= 1e-6 * size + 1e-12 * fabs(time))) /* rounding of the importer's clock */
        return core_report(self, ERROR, "step from t = %.15g: the instance is at t = %.15g", time, self->s->time);
    memcpy(self->backup, self->s, self->state_size);
    if (advance(self, time, size)) {
        self->current = 0;
        return SUCCESS;
    }
    memcpy(self->s, self->backup, self->state_size);
    return core_report(self, DISCARD, "%s; the step from t = %.9g is taken back", self->text, time);
}

/* ---- model exchange ---------------------------------------------------------------------------------------- */

Status core_set_time(Instance *self, double time) {
    if (!isfinite(time)) return core_report(self, DISCARD, "time = %s: set a finite number", spelled(time));
    self->s->time = time;
    self->current = 0;
    return SUCCESS;
}

Status core_set_states(Instance *self, const double y[]) {
    for (size_t i = 0; i < self->model->states; i++)
        if (!isfinite(y[i]))
            return core_report(self, DISCARD, "%s = %s: set a finite number",
                               self->model->variables[self->model->state_references[i]].name, spelled(y[i]));
    memcpy(self->y, y, self->model->states * sizeof *y);
    self->current = 0;
    return SUCCESS;
}

void core_get_states(Instance *self, double y[]) {
    start(self);
    memcpy(y, self->y, self->model->states * sizeof *y);
}

Status core_get_derivatives(Instance *self, double f[]) {
    const double t = self->s->time;
    start(self);
    evaluate(self, self->model->derivatives, t, self->y, self->dy);
    if (!check_domains(self, t) || !check_conditions(self, t, self->y, self->model->conditions)
        || !check_finite(self, self->dy, self->model->derivative_references, t))
        return core_report(self, DISCARD, "%s", self->text);
    memcpy(f, self->dy, self->model->states * sizeof *f);
    return SUCCESS;
}

void core_get_nominals(Instance *self, double sizes[]) {
    if (self->s->phase < EVENT) {
        start(self);
        measure(self);
    }
    memcpy(sizes, self->size, self->model->states * sizeof *sizes);
}

void core_enter_event_mode(Instance *self) {
    if (self->s->phase == CONTINUOUS) remember(self);
    self->s->phase = EVENT;
    self->s->limit = INFINITY;
    self->current = 0;
}

int core_update_discrete_states(Instance *self, double *next) {
    const size_t size = self->model->states * sizeof *self->y;
    int changed = 0;
    if (self->s->jumped) {
        memcpy(self->work, self->y, size);
        jump(self);
        remember(self);
        changed = memcmp(self->work, self->y, size) != 0;
        self->current = 0;
    }
    *next = next_instant(self, self->s->time);
    return changed;
}

void core_enter_continuous_mode(Instance *self) {
    self->s->phase = CONTINUOUS;
    self->s->limit = next_instant(self, self->s->time);
    self->current = 0;
}

/* ---- saved states ------------------------------------------------------------------------------------------ */

size_t core_state_size(const Instance *self) { return sizeof(Header) + self->state_size; }

void core_save(const Instance *self, void *bytes) {
    Header header = HEADER;
    header.size = core_state_size(self);
    strncpy(header.guid, self->model->guid, sizeof header.guid - 1);
    memcpy(bytes, &header, sizeof header);
    memcpy((char *)bytes + sizeof header, self->s, self->state_size);
}

Status core_check_state(const Instance *self, const void *bytes, size_t size) {
    Header header;
    if (size < sizeof header)
        return core_report(self, ERROR, "the saved state has %lu bytes: it is cut off", (unsigned long)size);
    memcpy(&header, bytes, sizeof header);
    if (memcmp(header.magic, HEADER.magic, sizeof header.magic) != 0)
        return core_report(self, ERROR, "these bytes are no saved state of such an FMU");
    if (header.byte_order != HEADER.byte_order)
        return core_report(self, ERROR, "the saved state comes from a machine with another byte order");
    if (header.version != HEADER.version)
        return core_report(self, ERROR, "the saved state has version %u, this FMU reads version %u", header.version,
                           HEADER.version);
    if (strncmp(header.guid, self->model->guid, sizeof header.guid) != 0)
        return core_report(self, ERROR, "the saved state belongs to another FMU, with guid %.39s", header.guid);
    if (header.size != core_state_size(self) || size != header.size)
        return core_report(self, ERROR, "the saved state has %lu bytes instead of %lu: it is cut off or damaged",
                           (unsigned long)size, (unsigned long)core_state_size(self));
    return SUCCESS;
}

Status core_restore(Instance *self, const void *bytes, size_t size) {
    Scalars scalars;
    if (core_check_state(self, bytes, size) != SUCCESS) return ERROR;
    const char *state = (const char *)bytes + sizeof(Header);
    memcpy(&scalars, state, sizeof scalars);
    if (scalars.model_exchange != self->s->model_exchange)
        return core_report(self, ERROR, "the saved state belongs to an instance for %s",
                           scalars.model_exchange ? "model exchange" : "co-simulation");
    memcpy(self->s, state, self->state_size);
    self->current = 0;
    return SUCCESS;
}

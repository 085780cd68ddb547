#include "core.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "instance.h"
#include "solver.h"
#include "symplectic.h"


/* ---- messages ---------------------------------------------------------------------------------------------- */

Status core_report(const Instance *self, Status status, const char *format, ...) {
    char text[TEXT];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    self->options.report(self->options.owner, status, text);
    return status;
}

int core_because(Instance *self, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(self->text, sizeof self->text, format, arguments);
    va_end(arguments);
    return 0;
}

const char *core_spelled(double value) { return isnan(value) ? "nan" : value > 0 ? "inf" : "-inf"; }

const Variable *core_variable_at(const Model *model, size_t place) {
    const size_t calculated = model->parameters + model->inputs;
    if (model->variable_rows == calculated + model->outputs) return &model->variables[place]; /* numbers only */
    size_t low = 0, high = model->variable_rows;
    while (high > low) {
        const size_t middle = low + (high - low + 1) / 2;
        if (model->variables[middle].first <= place) low = middle;
        else high = middle - 1;
    }
    return &model->variables[low];
}

const char *core_name(const Instance *self, size_t place) {
    const Variable *variable = core_variable_at(self->model, place);
    if (!variable->array) return variable->name;
    snprintf(self->name, NAME, "%s[%lu]", variable->name, (unsigned long)(place - variable->first + 1));
    return self->name;
}

/* ---- generated functions ----------------------------------------------------------------------------------- */

int core_evaluate_at_limit(Instance *self, Function *function, const double *y, double *result) {
    self->now = before_limit(self, self->s->limit);
    return evaluate_now(self, function, y, result);
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

int core_remember(Instance *self) {
    evaluate(self, self->model->remember, self->s->time, self->y, self->dm);
    if (!all_finite(self->dm, self->model->memory)) return 0;
    memcpy(self->m, self->dm, self->model->memory * sizeof *self->m);
    self->s->jumped = 0;
    return 1;
}

int core_because_infinite(Instance *self) {
    const size_t first = self->model->parameters + self->model->inputs;
    self->current = 0;
    evaluate(self, self->model->calculate, self->s->time, self->y, self->z);
    for (size_t i = 0; i < self->model->outputs; i++)
        if (!isfinite(self->z[i]))
            return core_because(self, "%s = %s at t = %.9g: it must be finite", core_name(self, first + i),
                                core_spelled(self->z[i]), self->s->time);
    return core_because(self, "an energy at t = %.9g is not finite", self->s->time);
}

void core_jump(Instance *self) {
    core_leap(self);
    evaluate(self, self->model->jump, self->s->time, self->y, self->dy);
    memcpy(self->y, self->dy, self->model->states * sizeof *self->y);
    self->s->jumped = 0;
}

void core_update(Instance *self) {
    if (self->current) return;
    start(self);
    if (self->s->phase == CONTINUOUS || self->s->phase == INTERMEDIATE) core_remember(self); /* nothing jumps there */
    evaluate(self, self->model->calculate, self->s->time, self->y, self->z);
    self->current = 1;
}

double core_next_instant(Instance *self, double t) {
    double next = INFINITY;
    if (self->model->events == 0) return next;
    self->arguments[0] = self->k;
    self->results[0] = self->instant;
    self->model->instants(self->arguments, self->results, self->integers, self->reals, 0);
    for (size_t i = 0; i < self->model->events; i++)
        if (self->instant[i] > t && self->instant[i] < next) next = self->instant[i];
    return next;
}

/* ---- what is allowed --------------------------------------------------------------------------------------- */

int core_outside(Instance *self, size_t place, double value, double t) {
    return core_because(self, "%s = %.9g at t = %.9g: it must be %s", core_name(self, place), value, t,
                        core_variable_at(self->model, place)->domain);
}

int core_check_domains(Instance *self, double t) {
    const size_t end = self->model->parameters + self->model->inputs;
    if (self->allowed) return 1;
    for (const Variable *variable = self->model->variables; variable->first < end; variable++) {
        if (*variable->domain == '\0') continue;
        for (size_t i = variable->first; i < variable->first + variable->count; i++)
            if (!allows(variable, self->k[i])) return core_outside(self, i, self->k[i], t);
    }
    self->allowed = 1;
    return 1;
}

int core_check_conditions(Instance *self, double t, const double *y, size_t count) {
    if (count == 0) return 1;
    evaluate(self, self->model->distances, t, y, self->condition);
    for (size_t i = 0; i < count; i++)
        if (!(self->condition[i] > 0))
            return core_because(self, "%s; at t = %.9g it does not (%.3g)", self->model->condition_texts[i], t,
                                self->condition[i]);
    return 1;
}

/* The place of the variable that shows a state, or its derivative. */
static size_t place_of_state(const Model *model, size_t i, int derivative) {
    const State *state = model->state;
    while (i >= model->variables[state->variable].count) i -= model->variables[state++->variable].count;
    return model->variables[derivative ? state->derivative : state->variable].first + i;
}

int core_check_finite(Instance *self, const double *values, int derivatives, double t) {
    if (all_finite(values, self->model->states)) return 1;
    for (size_t i = 0; i < self->model->states; i++)
        if (!isfinite(values[i]))
            return core_because(self, "%s = %s at t = %.9g: the motion ends there",
                                core_name(self, place_of_state(self->model, i, derivatives)), core_spelled(values[i]),
                                t);
    return 1;
}

/* ---- life -------------------------------------------------------------------------------------------------- */

static size_t count_prescribed(const Model *model) {
    size_t count = 0;
    for (size_t i = 0; i < model->active_rows; i++) count += model->active[i].count;
    return count;
}

Instance *core_new(const Model *model, const Options *options) {
    const size_t n = model->states, settable = model->parameters + model->inputs;
    const size_t prescribed = count_prescribed(model), past = prescribed * (sizeof(Past) / sizeof(double));
    const size_t moving = model->inputs + 2 * n + model->memory + past + HISTORY * model->coupled;
    const size_t resting = model->inputs * COEFFICIENTS + n + settable;
    const size_t scratch = 2 * (n + settable + model->memory) + model->outputs + SOLVER_COLUMNS * n
                           + model->start_conditions + model->events + model->reals + ORDER * model->inputs;
    Instance *self = calloc(1, sizeof *self);
    if (self == NULL) return NULL;
    self->model = model;
    self->options = *options;
    self->places = settable + model->outputs;
    self->by_variable = options->whole && model->variable_rows < self->places;
    self->references = options->whole ? model->variable_rows + 1 : self->places;
    self->first = first_reference(model);
    self->moving_size = sizeof(Scalars) + moving * sizeof(double);
    self->state_size = self->moving_size + resting * sizeof(double);
    self->s = calloc(1, self->state_size + (model->outputs + 1) * sizeof(double));
    self->backup = malloc(self->moving_size);
    self->movers = calloc(model->inputs + 1, sizeof *self->movers);
    self->mover_of = calloc(model->inputs + 1, sizeof *self->mover_of);
    self->prescribed = calloc(prescribed + 1, sizeof *self->prescribed);
    self->warned = calloc(model->active_rows + 1, sizeof *self->warned);
    self->dy = calloc(scratch + 1, sizeof *self->dy);
    self->arguments = calloc(model->most_arguments, sizeof *self->arguments);
    self->results = calloc(model->most_results, sizeof *self->results);
    self->integers = calloc(model->integers + 1, sizeof *self->integers);
    self->name = calloc(NAME, sizeof *self->name);
    if (!self->s || !self->backup || !self->movers || !self->mover_of || !self->prescribed || !self->warned || !self->dy
        || !self->arguments || !self->results || !self->integers || !self->name) {
        core_free(self);
        return NULL;
    }
    self->u = (double *)(self->s + 1);
    self->y = self->u + model->inputs;
    self->low = self->y + n;
    self->m = self->low + n;
    self->past = (Past *)(self->m + model->memory);
    self->history = (double *)(self->past + prescribed);
    self->taylor = self->history + HISTORY * model->coupled;
    self->size = self->taylor + COEFFICIENTS * model->inputs;
    self->k = self->size + n;
    self->set = self->k + model->parameters;
    self->z = self->set + model->inputs;
    self->t = self->z + model->outputs;
    self->du = self->dy + n;
    self->dk = self->du + model->inputs;
    self->dm = self->dk + model->parameters;
    self->dz = self->dm + model->memory;
    self->ey = self->dz + model->outputs;
    self->eu = self->ey + n;
    self->ek = self->eu + model->inputs;
    self->em = self->ek + model->parameters;
    self->work = self->em + model->memory;
    self->condition = self->work + SOLVER_COLUMNS * n;
    self->instant = self->condition + model->start_conditions;
    self->reals = self->instant + model->events;
    self->given = self->reals + model->reals;
    self->prescribed_count = prescribed;
    core_find_prescribed(self);
    core_reset(self);
    return self;
}

void core_free(Instance *self) {
    if (self == NULL) return;
    free(self->s);
    free(self->backup);
    free(self->movers);
    free(self->mover_of);
    free(self->prescribed);
    free(self->warned);
    free(self->dy);
    free(self->arguments);
    free(self->results);
    free(self->integers);
    free(self->name);
    free(self);
}

void core_reset(Instance *self) {
    const Model *model = self->model;
    const Variable *variable = model->variables;
    memset(self->s, 0, self->state_size);
    self->s->use = self->options.use;
    self->s->phase = INSTANTIATED;
    self->s->reconstruction = EXTRAPOLATE;
    self->s->limit = INFINITY;
    self->s->tolerance = model->tolerance;
    self->s->unstarted = 1;
    for (; variable->first < model->parameters + model->inputs; variable++)
        for (size_t i = 0; i < variable->count; i++) self->k[variable->first + i] = variable->start;
    for (size_t i = 0; i < model->start_rows; i++) self->k[model->starts[i].place] = model->starts[i].value;
    memcpy(self->u, self->set, model->inputs * sizeof *self->u);
    memset(self->warned, 0, model->active_rows);
    self->current = self->apart = self->allowed = 0;
    self->discarded_from = NAN;
}

Phase core_phase(const Instance *self) { return (Phase)self->s->phase; }

Use core_use(const Instance *self) { return self->options.use; }

double core_time(const Instance *self) { return self->s->time; }

Status core_setup(Instance *self, double start_time, const double *stop_time, double tolerance) {
    if (!isfinite(start_time))
        return core_report(self, ERROR, "start time = %s: it must be finite", core_spelled(start_time));
    if (stop_time != NULL && !isfinite(*stop_time))
        return core_report(self, ERROR, "stop time = %s: it must be finite", core_spelled(*stop_time));
    if (stop_time != NULL && *stop_time < start_time)
        return core_report(self, ERROR, "stop time = %g lies before start time = %g", *stop_time, start_time);
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

void core_enter_configuration(Instance *self) { self->s->phase = CONFIGURATION; }

void core_exit_configuration(Instance *self) { self->s->phase = INSTANTIATED; }

void core_enter_initialization(Instance *self) { self->s->phase = INITIALIZATION; }

static void measure(Instance *self) {
    evaluate(self, self->model->nominals, self->s->time, self->y, self->size);
    for (size_t i = 0; i < self->model->states; i++)
        if (!(self->size[i] > 0 && isfinite(self->size[i]))) self->size[i] = 1;
}

Status core_exit_initialization(Instance *self) {
    start(self);
    const double t = self->s->time;
    if (!core_check_domains(self, t) || !core_check_finite(self, self->y, 0, t)
        || !core_check_conditions(self, t, self->y, self->model->start_conditions)
        || (!all_finite(self->m, self->model->memory) && !core_because_infinite(self)))
        return core_report(self, ERROR, "%s; set another value and initialize again", self->text);
    measure(self);
    core_follow(self);
    self->s->phase = self->options.use == USE_CO_SIMULATION ? STEP : EVENT;
    self->s->jumped = 0;
    return SUCCESS;
}

void core_terminate(Instance *self) {
    core_warn(self);
    self->s->phase = TERMINATED;
}

/* ---- variables --------------------------------------------------------------------------------------------- */

Status core_check_references(const Instance *self, const unsigned references[], size_t n, size_t count) {
    size_t numbers = n;
    for (size_t i = 0; i < n; i++) {
        if (references[i] - self->first >= self->references)
            return core_report(self, ERROR, "value reference %u belongs to no floating-point variable; they are %u to %lu",
                               references[i], self->first, (unsigned long)(self->first + self->references - 1));
        numbers += span_of(self, references[i]).count - 1;
    }
    if (numbers == count) return SUCCESS;
    return core_report(self, ERROR, "%lu values for variables that hold %lu", (unsigned long)count,
                       (unsigned long)numbers);
}

typedef struct { /* what is left of references and of values for them */
    const unsigned *references;
    size_t n, count;
} Rest;

/* The places of the next reference and of those that follow it one by one; 0 if there are none or too few values. */
static int next_run(const Instance *self, Rest *rest, Span *run) {
    const unsigned reference = *rest->references;
    size_t n = 1;
    while (n < rest->n && rest->references[n] == reference + n) n++;
    const size_t index = reference - self->first;
    if (index >= self->references || n > self->references - index) return 0;
    const Span first = span_of(self, reference), last = span_of(self, reference + (unsigned)(n - 1));
    *run = (Span){first.first, last.first + last.count - first.first};
    if (run->count > rest->count) return 0;
    rest->references += n;
    rest->n -= n;
    rest->count -= run->count;
    return 1;
}

Status core_refuse_infinite(Instance *self, const unsigned references[], const double *values, size_t count,
                            const char *what) {
    const double t = self->s->time;
    size_t i = 0;
    while (i + 1 < count && isfinite(values[i])) i++;
    const double value = values[i];
    for (; i >= span_of(self, *references).count; references++) i -= span_of(self, *references).count;
    /* Solvers of importers are told what the standard has for them: they may try a shorter step. */
    const Status status = self->options.use == USE_MODEL_EXCHANGE ? DISCARD : ERROR;
    const int unusable = self->s->phase < EVENT
                         && !(core_check_domains(self, t)
                              && core_check_conditions(self, t, self->y, self->model->start_conditions));
    const char *name = core_name(self, span_of(self, *references).first + i);
    if (unusable) return core_report(self, status, "%s; %s%s = %s", self->text, what, name, core_spelled(value));
    return core_report(self, status, "%s%s = %s at t = %.9g: it must be finite; choose other start values or inputs",
                       what, name, core_spelled(value), t);
}

static void copy(double *to, const double *from, size_t n) {
    if (n == 1) *to = *from; /* less than a call */
    else memcpy(to, from, n * sizeof *to);
}

Status core_get(Instance *self, const unsigned references[], size_t n, double values[], size_t count) {
    const size_t calculated = self->model->parameters + self->model->inputs;
    Rest rest = {references, n, count};
    Span run;
    *self->t = self->s->time;
    if (self->current && !self->by_variable) { /* numbers that are known: nothing is as fast as to take one by one */
        for (size_t i = 0; i < n; i++) {
            const size_t place = references[i] - self->first;
            if (place >= self->references) return core_check_references(self, references, n, count);
            if (i < count) values[i] = self->k[place];
        }
        if (n != count) return core_check_references(self, references, n, count);
        return all_finite(values, n) ? SUCCESS : core_refuse_infinite(self, references, values, n, "");
    }
    for (double *value = values; rest.n > 0; value += run.count) {
        if (!next_run(self, &rest, &run)) return core_check_references(self, references, n, count);
        if (run.first + run.count > calculated) core_update(self);
        copy(value, &self->k[run.first], run.count);
    }
    if (rest.count > 0) return core_check_references(self, references, n, count);
    return all_finite(values, count) ? SUCCESS : core_refuse_infinite(self, references, values, count, "");
}

static const char FIXED[] = "it is a fixed parameter; set it before initialization ends";

static int settable(const Instance *self, const Variable *variable) {
    switch (variable->kind) {
    case INPUT: return 1;
    case FIXED_PARAMETER: return self->s->phase < EVENT;
    case TUNABLE_PARAMETER: return self->s->phase != CONTINUOUS;
    default:
        return variable->state != NO_STATE && self->options.use == USE_MODEL_EXCHANGE && self->s->phase >= EVENT;
    }
}

static Status refuse(const Instance *self, size_t place, Kind kind, double value) {
    return core_report(self, ERROR, "%s = %.9g: %s", core_name(self, place), value,
                       kind == FIXED_PARAMETER     ? FIXED
                       : kind == TUNABLE_PARAMETER ? "it is a parameter; set it in event mode"
                       : kind == INDEPENDENT       ? "the time is not a variable that can be set"
                                                   : "it is calculated; set parameters and inputs");
}

static size_t larger(size_t a, size_t b) { return a > b ? a : b; }

static size_t smaller(size_t a, size_t b) { return a < b ? a : b; }

static Status check_setting(Instance *self, Span run, const double values[]) {
    const size_t inputs = self->model->parameters, calculated = inputs + self->model->inputs;
    const size_t end = run.first + run.count;
    if (end > calculated || (run.first < inputs && self->s->phase >= EVENT)) { /* else all can be set */
        const Variable *variable = core_variable_at(self->model, run.first);
        for (; variable->kind != INDEPENDENT && variable->first < end; variable++) {
            const size_t place = larger(variable->first, run.first);
            if (!settable(self, variable)) return refuse(self, place, variable->kind, values[place - run.first]);
        }
        if (end > self->places) return refuse(self, self->places, INDEPENDENT, values[self->places - run.first]);
    }
    if (all_finite(values, run.count)) return SUCCESS;
    for (size_t i = 0; i < run.count; i++)
        if (!isfinite(values[i])) {
            if (run.first + i >= calculated) core_update(self);
            return core_report(self, DISCARD, "%s = %s: set a finite number; it stays %.9g",
                               core_name(self, run.first + i), core_spelled(values[i]), self->k[run.first + i]);
        }
    return SUCCESS;
}

/* Put numbers somewhere; returns whether they are new there. */
static int replace(double *to, const double *from, size_t n) {
    if (n == 1) { /* less than two calls */
        const int differs = memcmp(to, from, sizeof *to) != 0;
        *to = *from;
        return differs;
    }
    if (n == 0 || memcmp(to, from, n * sizeof *to) == 0) return 0;
    memcpy(to, from, n * sizeof *to);
    return 1;
}

/* Take parameters, inputs, states; returns whether parameters or the present inputs are new. */
static int take(Instance *self, Span run, const double values[], int present) {
    const size_t inputs = self->model->parameters, calculated = inputs + self->model->inputs;
    const size_t end = run.first + run.count;
    int fresh = 0;
    if (run.first < inputs) fresh |= replace(&self->k[run.first], values, smaller(end, inputs) - run.first);
    const size_t first = larger(run.first, inputs), last = smaller(end, calculated);
    if (first < last) {
        copy(&self->k[first], values + (first - run.first), last - first);
        if (present) fresh |= replace(&self->u[first - inputs], values + (first - run.first), last - first);
    }
    for (size_t place = larger(run.first, calculated); place < end;) {
        const Variable *variable = core_variable_at(self->model, place);
        const size_t next = smaller(end, variable->first + variable->count);
        copy(&self->y[(size_t)variable->state + place - variable->first], values + (place - run.first), next - place);
        self->current = 0;
        place = next;
    }
    return fresh;
}

/* Set inputs to finite numbers, one by one; returns 0 if that is not all that is asked for, and sets nothing. */
static int set_inputs(Instance *self, const unsigned references[], size_t n, const double values[], int present,
                      int *fresh) {
    const size_t first = self->first + self->model->parameters, inputs = self->model->inputs;
    uint64_t differences = 0, before, after;
    for (size_t i = 0; i < n; i++)
        if (references[i] - first >= inputs || values[i] - values[i] != 0) return 0;
    for (size_t i = 0; i < n; i++) {
        const size_t place = references[i] - first;
        self->set[place] = values[i];
        if (!present) continue;
        memcpy(&before, &self->u[place], sizeof before);
        memcpy(&after, &values[i], sizeof after);
        differences |= before ^ after;
        self->u[place] = values[i];
    }
    *fresh = differences != 0;
    return 1;
}

/* Set anything, run by run. */
static Status set_runs(Instance *self, const unsigned references[], size_t n, const double values[], size_t count,
                       int present, int *fresh) {
    Rest rest = {references, n, count};
    Span run;
    for (const double *value = values; rest.n > 0; value += run.count) {
        if (!next_run(self, &rest, &run)) return core_check_references(self, references, n, count);
        const Status status = check_setting(self, run, value);
        if (status != SUCCESS) return status;
    }
    if (rest.count != 0) return core_check_references(self, references, n, count);
    rest = (Rest){references, n, count};
    for (const double *value = values; rest.n > 0; value += run.count) {
        next_run(self, &rest, &run);
        *fresh |= take(self, run, value, present);
    }
    return SUCCESS;
}

Status core_set(Instance *self, const unsigned references[], size_t n, const double values[], size_t count) {
    /* The values belong to the present time, but in interpolation: there to the end of the step to come. */
    const int interpolating = self->s->reconstruction == INTERPOLATE;
    const int present = !(self->s->phase == STEP && interpolating);
    int fresh = 0;
    if (self->by_variable || n != count || !set_inputs(self, references, n, values, present, &fresh)) {
        const Status status = set_runs(self, references, n, values, count, present, &fresh);
        if (status != SUCCESS) return status;
    }
    if (present && !interpolating && self->apart) { /* so do those that were set before */
        fresh |= replace(self->u, self->set, self->model->inputs);
        self->apart = 0;
    }
    self->allowed = 0;
    if (self->s->phase < EVENT) self->s->unstarted = 1;
    if (fresh) {
        self->s->jumped = 1;
        self->current = 0;
    }
    return SUCCESS;
}

enum { RECONSTRUCTION, SYMPLECTIC_STEPS, SETTINGS };

static const struct {
    const char *name, *values;
    int most;
} SETTING[SETTINGS] = {
    {"input_reconstruction", "0 (hold), 1 (extrapolate) or 2 (interpolate)", INTERPOLATE},
    {"symplectic_steps", "0 (the error is controlled) to 100000 in a communication step", MOST_SYMPLECTIC_STEPS},
};

/* Which setting a reference stands for; SETTINGS, and a report, if there is none. */
static size_t setting(const Instance *self, unsigned reference) {
    size_t next = self->first + self->references;
    if (self->model->inputs > 0 && reference == next++) return RECONSTRUCTION;
    if (self->model->states > 0 && reference == next) return SYMPLECTIC_STEPS;
    core_report(self, ERROR, "value reference %u belongs to no integer variable", reference);
    return SETTINGS;
}

static int32_t *value_of(const Instance *self, size_t which) {
    return which == RECONSTRUCTION ? &self->s->reconstruction : &self->s->symplectic_steps;
}

Status core_get_setting(const Instance *self, unsigned reference, int *value) {
    const size_t which = setting(self, reference);
    if (which == SETTINGS) return ERROR;
    *value = *value_of(self, which);
    return SUCCESS;
}

Status core_set_settings(Instance *self, const unsigned references[], size_t n, const int values[]) {
    for (size_t i = 0; i < n; i++) {
        const size_t which = setting(self, references[i]);
        if (which == SETTINGS) return ERROR;
        if (values[i] < 0 || values[i] > SETTING[which].most)
            return core_report(self, ERROR, "%s = %d: set %s", SETTING[which].name, values[i], SETTING[which].values);
        if (self->s->phase >= EVENT)
            return core_report(self, ERROR, "%s = %d: %s", SETTING[which].name, values[i], FIXED);
    }
    for (size_t i = 0; i < n; i++) *value_of(self, setting(self, references[i])) = values[i];
    return SUCCESS;
}

const Dimension *core_dimension(const Instance *self, unsigned reference) {
    return reference - 1 < self->model->dimension_rows ? &self->model->dimensions[reference - 1] : NULL;
}

/* ---- model exchange, and events ---------------------------------------------------------------------------- */

Status core_set_time(Instance *self, double time) {
    if (!isfinite(time)) return core_report(self, DISCARD, "time = %s: set a finite number", core_spelled(time));
    self->s->time = time;
    self->current = 0;
    return SUCCESS;
}

Status core_set_states(Instance *self, const double y[]) {
    for (size_t i = 0; i < self->model->states; i++)
        if (!isfinite(y[i]))
            return core_report(self, DISCARD, "%s = %s: set a finite number",
                               core_name(self, place_of_state(self->model, i, 0)), core_spelled(y[i]));
    memcpy(self->y, y, self->model->states * sizeof *y);
    self->current = 0;
    return SUCCESS;
}

Status core_get_states(Instance *self, double y[]) {
    start(self);
    if (!core_check_finite(self, self->y, 0, self->s->time)) return core_report(self, DISCARD, "%s", self->text);
    memcpy(y, self->y, self->model->states * sizeof *y);
    return SUCCESS;
}

Status core_get_derivatives(Instance *self, double f[]) {
    const double t = self->s->time;
    start(self);
    evaluate(self, derivatives_of(self->model), t, self->y, self->dy);
    if (!core_check_domains(self, t) || !core_check_conditions(self, t, self->y, self->model->conditions)
        || !core_check_finite(self, self->dy, 1, t))
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
    if (self->s->phase == CONTINUOUS) {
        core_remember(self);
        core_follow(self);
    }
    self->s->jumped |= self->s->time >= self->s->limit; /* functions of time inside the component may */
    self->s->phase = EVENT;
    self->s->limit = INFINITY;
    self->current = 0;
}

Status core_update_discrete_states(Instance *self, int *changed, double *next) {
    const char *before = (const char *)self->backup + ((const char *)self->y - (const char *)self->s);
    *changed = 0;
    if (self->s->jumped) {
        memcpy(self->backup, self->s, self->moving_size);
        core_compare(self);
        core_jump(self);
        if (!core_check_finite(self, self->y, 0, self->s->time)
            || (!core_remember(self) && !core_because_infinite(self))) {
            memcpy(self->s, self->backup, self->moving_size);
            self->current = 0;
            return core_report(self, DISCARD, "%s; set other inputs or states", self->text);
        }
        core_follow(self);
        *changed = memcmp(before, self->y, self->model->states * sizeof *self->y) != 0;
        self->current = 0;
    }
    *next = core_next_instant(self, self->s->time);
    return SUCCESS;
}

void core_enter_continuous_mode(Instance *self) {
    self->s->phase = CONTINUOUS;
    self->s->limit = core_next_instant(self, self->s->time);
    self->current = 0;
}

void core_enter_step_mode(Instance *self) {
    self->s->phase = STEP;
    self->current = 0;
}

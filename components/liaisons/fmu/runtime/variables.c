/* Variables by their references: getting and setting them, settings, structural sizes. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "instance.h"

/* ---- names and references ---------------------------------------------------------------------------------- */

const Variable *core_variable_at(const Model *model, size_t index) {
    const size_t calculated = model->parameters + model->inputs;
    if (model->variable_rows == calculated + model->outputs) return &model->variables[index]; /* numbers only */
    size_t low = 0, high = model->variable_rows;
    while (high > low) {
        const size_t middle = low + (high - low + 1) / 2;
        if (model->variables[middle].first <= index) low = middle;
        else high = middle - 1;
    }
    return &model->variables[low];
}

const char *core_name(const Instance *self, size_t index) {
    const Variable *variable = core_variable_at(self->model, index);
    if (!variable->array) return variable->name;
    snprintf(self->words.name, NAME, "%s[%lu]", variable->name, (unsigned long)(index - variable->first + 1));
    return self->words.name;
}

size_t core_index_of_state(const Model *model, size_t i, int derivative) {
    const State *state = model->state;
    while (i >= model->variables[state->variable].count) i -= model->variables[state++->variable].count;
    return model->variables[derivative ? state->derivative : state->variable].first + i;
}

/* Report a variable of another type. */
static Status check_type(const Instance *self, NumberType type, unsigned reference) {
    static const char *const NAMES[] = {"floating-point", "integer", "Boolean"};
    if (reference - self->layout.first >= self->layout.references)
        return core_report(self, ERROR, "value reference %u belongs to no %s variable", reference, NAMES[type]);
    const Variable *variable = core_variable_at(self->model, span_of(self, reference).first);
    if (variable->type == type) return SUCCESS;
    return core_report(self, ERROR, "value reference %u belongs to no %s variable: %s is %s", reference, NAMES[type],
                       variable->name, NAMES[variable->type]);
}

Status core_check_references(const Instance *self, const unsigned references[], size_t n, size_t count) {
    size_t numbers = n;
    for (size_t i = 0; i < n; i++) {
        if (references[i] - self->layout.first >= self->layout.references)
            return core_report(self, ERROR,
                               "value reference %u belongs to no floating-point variable; they are %u to %lu",
                               references[i], self->layout.first,
                               (unsigned long)(self->layout.first + self->layout.references - 1));
        if (self->model->indicators > 0 && check_type(self, NUMBER_REAL, references[i]) != SUCCESS) return ERROR;
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

/* Find the numbers of the next reference and of consecutive ones behind it; 0 if there are none or too few values. */
static int next_run(const Instance *self, Rest *rest, Span *run) {
    const unsigned reference = *rest->references;
    size_t n = 1;
    while (n < rest->n && rest->references[n] == reference + n) n++;
    const size_t index = reference - self->layout.first;
    if (index >= self->layout.references || n > self->layout.references - index) return 0;
    const Span first = span_of(self, reference), last = span_of(self, reference + (unsigned)(n - 1));
    *run = (Span){first.first, last.first + last.count - first.first};
    if (run->count > rest->count) return 0;
    rest->references += n;
    rest->n -= n;
    rest->count -= run->count;
    return 1;
}

static void copy(double *to, const double *from, size_t n) {
    if (n == 1) *to = *from; /* less than a call */
    else memcpy(to, from, n * sizeof *to);
}

/* Index of the first number that only a picture needs. */
static size_t first_drawn(const Model *model) {
    return model->parameters + model->inputs + model->outputs - model->drawn;
}

/* Index of the first number that is still to be calculated. */
static size_t first_missing(const Instance *self) {
    if (!self->known.current) return self->model->parameters + self->model->inputs;
    return self->known.drawn ? SIZE_MAX : first_drawn(self->model);
}

/* Calculate the numbers that are about to be read. */
static void update(Instance *self, Span run) {
    const size_t drawn = first_drawn(self->model), end = run.first + run.count;
    if (end > self->model->parameters + self->model->inputs) core_update(self);
    if (self->model->drawn == 0 || end <= drawn || self->known.drawn) return;
    evaluate(self, self->model->draw, self->s->time, self->v.y, &self->v.k[drawn]);
    self->known.drawn = 1;
}

Status core_get(Instance *self, const unsigned references[], size_t n, double values[], size_t count) {
    Rest rest = {references, n, count};
    Span run;
    *self->v.t = self->s->time;
    if (self->model->indicators > 0 && core_check_references(self, references, n, count) != SUCCESS) return ERROR;
    if (!self->layout.by_variable) { /* nothing is as fast as to take them one by one */
        size_t missing = first_missing(self);
        if (n != count) return core_check_references(self, references, n, count);
        for (size_t i = 0; i < n; i++) {
            const size_t index = references[i] - self->layout.first;
            if (index >= self->layout.references) return core_check_references(self, references, n, count);
            if (index >= missing) {
                update(self, (Span){index, 1});
                missing = first_missing(self);
            }
            values[i] = self->v.k[index];
        }
        return all_finite(values, n) ? SUCCESS : core_refuse_infinite(self, references, values, n, "");
    }
    for (double *value = values; rest.n > 0; value += run.count) {
        if (!next_run(self, &rest, &run)) return core_check_references(self, references, n, count);
        update(self, run);
        copy(value, &self->v.k[run.first], run.count);
    }
    if (rest.count > 0) return core_check_references(self, references, n, count);
    return all_finite(values, count) ? SUCCESS : core_refuse_infinite(self, references, values, count, "");
}

static const char FIXED[] = "it is a fixed parameter; set it before initialization ends";

/* Whether a variable can be set in this phase. */
static int settable(const Instance *self, const Variable *variable) {
    switch (variable->kind) {
    case INPUT: return 1;
    case FIXED_PARAMETER: return self->s->phase < EVENT;
    case TUNABLE_PARAMETER: return self->s->phase != CONTINUOUS;
    default:
        return variable->state != NO_STATE && self->options.use == USE_MODEL_EXCHANGE && self->s->phase >= EVENT;
    }
}

/* Report a number that cannot be set, and why. */
static Status refuse(const Instance *self, size_t index, Kind kind, double value) {
    return core_report(self, ERROR, "%s = %.9g: %s", core_name(self, index), value,
                       kind == FIXED_PARAMETER     ? FIXED
                       : kind == TUNABLE_PARAMETER ? "it is a parameter; set it in event mode"
                       : kind == INDEPENDENT       ? "the time is not a variable that can be set"
                                                   : "it is calculated; set parameters and inputs");
}

static size_t larger(size_t a, size_t b) { return a > b ? a : b; }

static size_t smaller(size_t a, size_t b) { return a < b ? a : b; }

/* Report the first number that cannot be set, or is not finite. */
static Status check_setting(Instance *self, Span run, const double values[]) {
    const size_t inputs = self->model->parameters, calculated = inputs + self->model->inputs;
    const size_t end = run.first + run.count;
    if (end > calculated || (run.first < inputs && self->s->phase >= EVENT)) { /* else all can be set */
        const Variable *variable = core_variable_at(self->model, run.first);
        for (; variable->kind != INDEPENDENT && variable->first < end; variable++) {
            const size_t index = larger(variable->first, run.first);
            if (!settable(self, variable)) return refuse(self, index, variable->kind, values[index - run.first]);
        }
        const size_t time = self->layout.numbers;
        if (end > time) return refuse(self, time, INDEPENDENT, values[time - run.first]);
    }
    if (all_finite(values, run.count)) return SUCCESS;
    for (size_t i = 0; i < run.count; i++)
        if (!isfinite(values[i])) {
            update(self, (Span){run.first + i, 1});
            return core_report(self, DISCARD, "%s = %s: set a finite number; it stays %.9g",
                               core_name(self, run.first + i), core_spelled(values[i]), self->v.k[run.first + i]);
        }
    return SUCCESS;
}

/* Copy numbers; whether they differ from those before. */
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

/* Store parameters, inputs, states; whether parameters or the present inputs have changed. */
static int store(Instance *self, Span run, const double values[], int present) {
    const size_t inputs = self->model->parameters, calculated = inputs + self->model->inputs;
    const size_t end = run.first + run.count;
    int fresh = 0;
    if (run.first < inputs) fresh |= replace(&self->v.k[run.first], values, smaller(end, inputs) - run.first);
    const size_t first = larger(run.first, inputs), last = smaller(end, calculated);
    if (first < last) {
        copy(&self->v.k[first], values + (first - run.first), last - first);
        if (present) fresh |= replace(&self->v.u[first - inputs], values + (first - run.first), last - first);
    }
    for (size_t index = larger(run.first, calculated); index < end;) {
        const Variable *variable = core_variable_at(self->model, index);
        const size_t next = smaller(end, variable->first + variable->count);
        copy(&self->v.y[(size_t)variable->state + index - variable->first], values + (index - run.first), next - index);
        self->known.current = 0;
        index = next;
    }
    return fresh;
}

/* Set inputs to finite numbers, one by one; 0, with nothing set, if other variables or values are among them. */
static int set_inputs(Instance *self, const unsigned references[], size_t n, const double values[], int present,
                      int *fresh) {
    const size_t first = self->layout.first + self->model->parameters, inputs = self->model->inputs;
    double *const set = self->v.set, *const now = present ? self->v.u : set;
    uint64_t differences = 0, before, after;
    for (size_t i = 0; i < n; i++)
        if (references[i] - first >= inputs) return 0;
    if (!all_finite(values, n)) return 0;
    for (size_t i = 0; i < n; i++) {
        const size_t index = references[i] - first;
        memcpy(&before, &now[index], sizeof before);
        memcpy(&after, &values[i], sizeof after);
        differences |= before ^ after;
        set[index] = now[index] = values[i];
    }
    *fresh = present && differences != 0;
    return 1;
}

/* Set variables of any kind, run by run. */
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
        *fresh |= store(self, run, value, present);
    }
    return SUCCESS;
}

Status core_ignore_zeros(Instance *self) {
    free(self->starts);
    self->starts = malloc((1 + self->model->inputs) * sizeof *self->starts);
    if (self->starts == NULL) return core_report(self, ERROR, "out of memory for start values");
    memcpy(self->starts, self->v.set, self->model->inputs * sizeof *self->starts);
    return SUCCESS;
}

/* Restore start values where 0 was set, and is not allowed. */
static void ignore_zeros(Instance *self, int present) {
    for (const Prescribed *p = self->prescribed.list; p < self->prescribed.list + self->prescribed.count; p++) {
        const size_t index = self->model->parameters + p->value;
        if (self->v.set[p->value] != 0 || allows(core_variable_at(self->model, index), 0)) continue;
        self->v.set[p->value] = self->starts[p->value];
        if (present) self->v.u[p->value] = self->starts[p->value];
        core_report(self, WARNING, "%s = 0 before the first step: it stays %.9g", core_name(self, index),
                    self->starts[p->value]);
    }
}

Status core_set(Instance *self, const unsigned references[], size_t n, const double values[], size_t count) {
    /* The values belong to the present time, but in interpolation: there to the end of the step to come. */
    const int interpolating = self->s->reconstruction == INTERPOLATE;
    const int present = !(self->s->phase == STEP && interpolating);
    int fresh = 0;
    self->known.rests = 0;
    if (self->layout.by_variable || n != count || !set_inputs(self, references, n, values, present, &fresh)) {
        const Status status = set_runs(self, references, n, values, count, present, &fresh);
        if (status != SUCCESS) return status;
    }
    if (self->starts != NULL) ignore_zeros(self, present);
    if (present && !interpolating && self->known.apart) { /* so do those that were set before */
        fresh |= replace(self->v.u, self->v.set, self->model->inputs);
        self->known.apart = 0;
    }
    if (self->known.derives && self->s->phase == STEP && self->s->reconstruction == EXTRAPOLATE) core_derive(self);
    self->known.allowed = 0;
    if (self->s->phase < EVENT) self->s->unstarted = 1;
    if (fresh || self->model->sample != NULL) { /* a sample may wait for them */
        self->s->jumped = 1;
        self->known.current = 0;
    }
    return SUCCESS;
}

enum { RECONSTRUCTION, SYMPLECTIC_STEPS, STIFF_SOLVER, SETTINGS };

static const struct {
    const char *name, *values;
    int most;
} SETTING[SETTINGS] = {
    {"input_reconstruction", "0 (hold), 1 (extrapolate) or 2 (interpolate)", INTERPOLATE},
    {"symplectic_steps", "0 (the error is controlled) to 100000 in a communication step", MOST_SYMPLECTIC_STEPS},
    {"stiff_solver", "0 (explicit) or 1 (implicit)", 1},
};

/* Setting of a reference; SETTINGS, and a report, if there is none. */
static size_t setting(const Instance *self, unsigned reference) {
    size_t next = self->layout.first + self->layout.references;
    if (self->model->inputs > 0 && reference == next++) return RECONSTRUCTION;
    if (self->model->states > 0 && reference == next++) return SYMPLECTIC_STEPS;
    if (self->model->states > 0 && reference == next) return STIFF_SOLVER;
    core_report(self, ERROR, "value reference %u belongs to no integer variable", reference);
    return SETTINGS;
}

/* Address of the value of a setting. */
static int32_t *value_of(const Instance *self, size_t which) {
    int32_t *const values[SETTINGS] = {&self->s->reconstruction, &self->s->symplectic_steps, &self->s->stiff_solver};
    return values[which];
}

Status core_get_setting(const Instance *self, unsigned reference, int *value) {
    const size_t which = setting(self, reference);
    if (which == SETTINGS) return ERROR;
    *value = *value_of(self, which);
    return SUCCESS;
}

Status core_set_settings(Instance *self, const unsigned references[], size_t n, const int values[]) {
    for (size_t i = 0; i < n; i++) {
        if (references[i] - self->layout.first < self->layout.references)
            return core_refuse_typed(self, NUMBER_INTEGER, references[i], values[i]);
        const size_t which = setting(self, references[i]);
        if (which == SETTINGS) return ERROR;
        if (values[i] < 0 || values[i] > SETTING[which].most)
            return core_report(self, ERROR, "%s = %d: set %s", SETTING[which].name, values[i], SETTING[which].values);
        if (which == SYMPLECTIC_STEPS && values[i] > 0 && self->model->indicators > 0)
            return core_report(self, ERROR, "symplectic_steps = %d: steps of fixed size do not end at events of %s; set 0",
                               values[i], self->model->gaps > 0 ? self->model->gap->name : self->model->friction->name);
        if (which == STIFF_SOLVER && values[i] > 0 && self->model->coupled > MOST_STIFF_STATES)
            return core_report(self, ERROR, "stiff_solver = 1: %s has %lu states, the stiff solver takes %d; set 0",
                               self->model->name, (unsigned long)self->model->coupled, MOST_STIFF_STATES);
        if (self->s->phase >= EVENT)
            return core_report(self, ERROR, "%s = %d: %s", SETTING[which].name, values[i], FIXED);
    }
    int solvers[SETTINGS] = {0, self->s->symplectic_steps, self->s->stiff_solver};
    for (size_t i = 0; i < n; i++) solvers[setting(self, references[i])] = values[i];
    if (solvers[SYMPLECTIC_STEPS] > 0 && solvers[STIFF_SOLVER] > 0)
        return core_report(self, ERROR, "symplectic_steps = %d and stiff_solver = 1: set one of them to 0 before the other",
                           solvers[SYMPLECTIC_STEPS]);
    for (size_t i = 0; i < n; i++) *value_of(self, setting(self, references[i])) = values[i];
    return SUCCESS;
}

const Dimension *core_dimension(const Instance *self, unsigned reference) {
    return reference - 1 < self->model->dimension_rows ? &self->model->dimensions[reference - 1] : NULL;
}

/* ---- integers, Booleans, event indicators ------------------------------------------------------------------ */

size_t core_count(const Instance *self, const unsigned references[], size_t n) {
    size_t count = 0;
    for (size_t i = 0; i < n; i++)
        count += references[i] - self->layout.first < self->layout.references ? span_of(self, references[i]).count : 1;
    return count;
}

Status core_get_typed(Instance *self, NumberType type, unsigned reference, size_t element, double *value) {
    if (type == NUMBER_INTEGER && reference - self->layout.first >= self->layout.references) {
        int setting_value = 0;
        const Status status = core_get_setting(self, reference, &setting_value);
        *value = setting_value;
        return status;
    }
    if (check_type(self, type, reference) != SUCCESS) return ERROR;
    const Span number = span_of(self, reference);
    update(self, number);
    *value = self->v.k[number.first + element];
    return isfinite(*value) ? SUCCESS : core_refuse_infinite(self, &reference, value, 1, "");
}

Status core_refuse_typed(Instance *self, NumberType type, unsigned reference, double value) {
    if (check_type(self, type, reference) != SUCCESS) return ERROR;
    return refuse(self, span_of(self, reference).first, CALCULATED, value);
}

Status core_get_indicators(Instance *self, double indicators[]) {
    const double *values = self->contacts.indicators;
    core_start(self);
    evaluate(self, self->model->indicate, self->s->time, self->v.y, self->contacts.indicators);
    for (size_t i = 0; i < self->model->indicators; i++)
        if (!isfinite(values[i]))
            return core_report(self, DISCARD, "%s = %s", core_name(self, self->model->indicator[i]),
                               core_spelled(values[i]));
    memcpy(indicators, values, self->model->indicators * sizeof *values);
    return SUCCESS;
}

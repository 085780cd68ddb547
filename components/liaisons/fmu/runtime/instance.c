/* An instance from its memory to its end, and calls of the component's functions. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "events.h"
#include "impulses.h"
#include "instance.h"
#include "stiff.h"
#include "symplectic.h"
#include "unilateral.h"

/* ---- life -------------------------------------------------------------------------------------------------- */

static size_t count_prescribed(const Model *model) {
    size_t count = 0;
    for (size_t i = 0; i < model->active_rows; i++) count += model->active[i].count;
    return count;
}

/* Memory that is distributed: without a block, its size is counted. */
typedef struct {
    char *block;
    size_t used;
} Memory;

/* Take room for n things, such that doubles and pointers may follow. */
static void *take(Memory *memory, size_t n, size_t size) {
    void *room = memory->block == NULL ? NULL : memory->block + memory->used;
    memory->used += (n * size + sizeof(double) - 1) / sizeof(double) * sizeof(double);
    return room;
}

static double *take_numbers(Memory *memory, size_t n) { return take(memory, n, sizeof(double)); }

static void lay_out_directions(Directions *d, Memory *memory, const Model *model, size_t outputs) {
    d->y = take_numbers(memory, model->states);
    d->u = take_numbers(memory, model->inputs);
    d->k = take_numbers(memory, model->parameters);
    d->m = take_numbers(memory, model->memory);
    d->z = take_numbers(memory, outputs);
}

/* What a saved state holds, first what a communication step changes; then what follows from it. */
static void lay_out_state(Instance *self, Memory *memory) {
    const Model *model = self->model;
    self->s = take(memory, 1, sizeof *self->s);
    self->v.u = take_numbers(memory, model->inputs);
    self->v.y = take_numbers(memory, model->states);
    self->v.low = take_numbers(memory, model->states);
    self->v.m = take_numbers(memory, model->memory);
    self->v.past = take(memory, self->prescribed.count, sizeof *self->v.past);
    self->v.history = take_numbers(memory, HISTORY * model->coupled);
    self->v.applied = take_numbers(memory, model->impulses);
    self->layout.moving_size = memory->used;
    self->v.taylor = take_numbers(memory, COEFFICIENTS * model->inputs);
    self->v.size = take_numbers(memory, model->states);
    self->v.k = take_numbers(memory, model->parameters);
    self->v.set = take_numbers(memory, model->inputs);
    self->layout.state_size = memory->used;
    self->v.z = take_numbers(memory, model->outputs);
    self->v.t = take_numbers(memory, 1);
    self->step.backup = take(memory, 1, self->layout.moving_size);
}

static void lay_out_scratch(Instance *self, Memory *memory) {
    const Model *model = self->model;
    /* Numbers that limits need where constraints lose rank. */
    const size_t aside = model->inputs + (3 + 2 * ASIDE) * model->states + 2 * ASIDE * model->outputs;
    lay_out_directions(&self->d, memory, model, model->outputs);
    lay_out_directions(&self->e, memory, model, 0);
    self->scratch.work = take_numbers(memory, (model->indicators > 0 ? EVENT_COLUMNS : SOLVER_COLUMNS) * model->states);
    self->scratch.kept = take_numbers(memory, model->redundant > 0 ? MOST_PROJECTIONS * model->states : 0);
    self->scratch.aside = take_numbers(memory, model->guarded ? aside : 0);
    self->scratch.condition = take_numbers(memory, model->start_conditions);
    self->scratch.instant = take_numbers(memory, model->events);
    self->scratch.residual = take_numbers(memory, model->residuals);
    self->scratch.projected = take_numbers(memory, states_of_constraints(model));
    self->scratch.anchor = take_numbers(memory, states_of_constraints(model));
}

static void lay_out_contacts(Contacts *c, Memory *memory, const Model *model) {
    const ContactRows *rows = &model->rows;
    c->all = take_numbers(memory, rows->count);
    c->operators = take_numbers(memory, model->operators);
    c->indicators = take_numbers(memory, model->indicators);
    if (c->all == NULL) return;
#define COLUMN(name) c->numbers.name = c->all + rows->name;
    CONTACT_NUMBERS(COLUMN)
#undef COLUMN
}

/* Lists of inputs and parameters, and memory of the generated functions. */
static void lay_out_lists(Instance *self, Memory *memory) {
    const Model *model = self->model;
    const size_t inputs = model->inputs;
    self->movers.list = take(memory, inputs, sizeof *self->movers.list);
    self->movers.of_input = take(memory, inputs, sizeof *self->movers.of_input);
    self->movers.variable_of = take(memory, inputs, sizeof *self->movers.variable_of);
    self->movers.given = take_numbers(memory, ORDER * inputs);
    self->bounded = take(memory, model->parameters + inputs + 1, sizeof *self->bounded);
    self->prescribed.list = take(memory, self->prescribed.count, sizeof *self->prescribed.list);
    self->prescribed.warned = take(memory, model->active_rows, sizeof *self->prescribed.warned);
    self->call.arguments = take(memory, 2 * model->most_arguments, sizeof *self->call.arguments);
    self->call.results = take(memory, 2 * model->most_results, sizeof *self->call.results);
    self->call.integers = take(memory, model->integers, sizeof *self->call.integers);
    self->call.reals = take_numbers(memory, model->reals);
    self->words.name = take(memory, NAME, sizeof *self->words.name);
}

/* Distribute a block of memory; returns its size. */
static size_t lay_out(Instance *self, char *block) {
    Memory memory = {block, 0};
    lay_out_state(self, &memory);
    lay_out_scratch(self, &memory);
    lay_out_contacts(&self->contacts, &memory, self->model);
    lay_out_lists(self, &memory);
    return memory.used;
}

static void lay_out_call(Instance *self) {
    const double *const standing[] = {&self->call.now, NULL, self->v.u, self->v.k, self->v.m};
    memcpy(self->call.arguments, standing, sizeof standing);
    self->call.results[1] = &self->call.margin;
    self->call.margin = INFINITY;
    self->call.other_arguments = self->call.arguments + self->model->most_arguments;
    self->call.other_results = self->call.results + self->model->most_results;
}

/* Find the variable of each input, and the numbers that must be in a domain. */
static void find_settable(Instance *self) {
    const size_t first = self->model->parameters, end = first + self->model->inputs;
    Bounded *bounded = self->bounded;
    for (const Variable *variable = self->model->variables; variable->first < end; variable++)
        for (size_t i = variable->first; i < variable->first + variable->count; i++) {
            if (i >= first) self->movers.variable_of[i - first] = variable;
            if (*variable->domain != '\0') *bounded++ = (Bounded){i, variable};
        }
}

static void set_starts(Instance *self) {
    const Model *model = self->model;
    const Variable *variable = model->variables;
    self->s->use = self->options.use;
    self->s->phase = INSTANTIATED;
    self->s->reconstruction = EXTRAPOLATE;
    self->s->limit = INFINITY;
    self->s->tolerance = model->tolerance;
    self->s->unstarted = 1;
    for (; variable->first < model->parameters + model->inputs; variable++)
        for (size_t i = 0; i < variable->count; i++) self->v.k[variable->first + i] = variable->start;
    for (size_t i = 0; i < model->start_rows; i++) self->v.k[model->starts[i].index] = model->starts[i].value;
    memcpy(self->v.u, self->v.set, model->inputs * sizeof *self->v.u);
    self->step.discarded_from = self->known.infinite = NAN;
}

Instance *core_new(const Model *model, const Options *options) {
    Instance *self = calloc(1, sizeof *self);
    if (self == NULL) return NULL;
    self->model = model;
    self->options = *options;
    self->layout.numbers = model->parameters + model->inputs + model->outputs;
    const size_t rows = model->by_number ? self->layout.numbers : model->variable_rows;
    self->layout.by_variable = options->whole && rows < self->layout.numbers;
    self->layout.references = options->whole ? rows + 1 : self->layout.numbers;
    self->layout.first = first_reference(model);
    self->prescribed.count = count_prescribed(model);
    char *block = calloc(1, lay_out(self, NULL));
    if (block == NULL) {
        free(self);
        return NULL;
    }
    lay_out(self, block);
    lay_out_call(self);
    find_settable(self);
    core_find_prescribed(self);
    set_starts(self);
    return self;
}

void core_free(Instance *self) {
    if (self == NULL) return;
    free(self->s); /* the block of memory */
    free(self->table);
    free(self->starts);
    stiff_free(self->stiff);
    free(self);
}

void core_reset(Instance *self) {
    memset(self->s, 0, self->layout.state_size);
    memset(self->prescribed.warned, 0, self->model->active_rows);
    self->known.current = self->known.apart = self->known.allowed = self->known.rests = 0;
    free(self->starts);
    self->starts = NULL;
    set_starts(self);
}

void core_record_contacts(Instance *self, ContactRecord *record) { self->contacts.record = record; }

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
    self->known.current = 0;
    if (tolerance == 0) return SUCCESS;
    self->s->tolerance = fmin(fmax(tolerance, TIGHTEST), LOOSEST);
    if (self->s->tolerance == tolerance) return SUCCESS;
    core_report(self, WARNING, "tolerance = %g is out of range, %g is used", tolerance, self->s->tolerance);
    return SUCCESS;
}

void core_enter_configuration(Instance *self) { self->s->phase = CONFIGURATION; }

void core_exit_configuration(Instance *self) { self->s->phase = INSTANTIATED; }

void core_enter_initialization(Instance *self) { self->s->phase = INITIALIZATION; }

/* A rate that is further from its start value, of 1, is another. */
static const double CHANGED = 1e-6;

/* Whether outputs are finite, unless it is not the start time that they owe it to: functions of time overflow at 1e300. */
static int starts_in_time(Instance *self) {
    const Model *model = self->model;
    const size_t outputs = model->outputs - model->drawn;
    if (self->s->time == 0) return 1;
    core_update(self);
    if (all_finite(self->v.z, outputs)) return 1;
    self->known.current = 0;
    evaluate(self, model->calculate, 0, self->v.y, self->v.z);
    return !all_finite(self->v.z, outputs) || core_because_infinite(self);
}

/* Say which rates are others than their start values, for constraints. */
static void report_start_rates(Instance *self) {
    const Model *model = self->model;
    const size_t first = model->parameters + model->inputs;
    char text[TEXT];
    size_t length = 0;
    if (model->start_rate_rows > 0) core_update(self);
    for (const StartRate *row = model->start_rates; row < model->start_rates + model->start_rate_rows; row++) {
        const double start = self->v.k[row->start], rate = self->v.z[row->rate - first];
        if (fabs(rate - start) <= CHANGED * (1 + fabs(start)) || length >= sizeof text) continue;
        length += (size_t)snprintf(text + length, sizeof text - length, "%s%s = %.6g", length > 0 ? ", " : "",
                                   core_name(self, row->rate), rate);
        if (length < sizeof text)
            length += (size_t)snprintf(text + length, sizeof text - length, " for %s = %.6g",
                                       core_name(self, row->start), start);
    }
    if (length > 0) core_report(self, WARNING, "rates at the start follow from the constraints: %s", text);
}

/* Add the rates that are not at their defaults to a refusal of rates that cannot all hold. */
static void add_given_rates(Instance *self) {
    const Model *model = self->model;
    const char *separator = "; given are ";
    if (strstr(self->words.text, "the rate of ") == NULL) return;
    for (size_t row = 0; row < model->start_rate_rows; row++) {
        const size_t index = model->start_rates[row].start, length = strlen(self->words.text);
        double value = core_variable_at(model, index)->start;
        for (size_t i = 0; i < model->start_rows; i++)
            if (model->starts[i].index == index) value = model->starts[i].value;
        if (self->v.k[index] == value) continue;
        snprintf(self->words.text + length, TEXT - length, "%s%s = %.9g", separator, core_name(self, index), self->v.k[index]);
        separator = ", ";
    }
}

/* Add what is prescribed for a constraint that is not kept at the start. */
static void add_prescribed(Instance *self) {
    const Model *model = self->model;
    const Reach *reach = model->reaches, *const end = reach + model->reach_rows;
    while (reach < end && strncmp(self->words.text, reach->text, strlen(reach->text)) != 0) reach++;
    if (reach == end || reach->count == 0) return;
    evaluate(self, model->reach, self->s->time, self->v.y, self->scratch.residual);
    for (size_t i = 0; i < reach->count; i++) {
        const size_t length = strlen(self->words.text);
        snprintf(self->words.text + length, TEXT - length, "%s%s = %.9g", i > 0 ? ", " : "; prescribed: ",
                 reach->prescribed[i], self->scratch.residual[reach->first + i]);
    }
}

Status core_exit_initialization(Instance *self) {
    core_start(self);
    if (self->refused && core_check_domains(self, self->s->time))
        return core_report(self, ERROR, "%s; set another value and initialize again", self->words.text);
    const double t = self->s->time;
    if (!core_check_domains(self, t) || !core_check_finite(self, self->v.y, 0, t)
        || !core_check_conditions(self, t, self->v.y, self->model->start_conditions)
        || (!all_finite(self->v.m, self->model->memory) && !core_because_infinite(self)) || !starts_in_time(self)) {
        add_given_rates(self);
        add_prescribed(self);
        return core_report(self, ERROR, "%s; set another value and initialize again", self->words.text);
    }
    core_measure(self);
    report_start_rates(self);
    core_follow(self);
    core_note_impulses(self);
    self->s->phase = self->options.use == USE_CO_SIMULATION ? STEP : EVENT;
    if (self->model->redundant > 0) self->known.current = 0; /* from now on all is calculated on the constraints */
    self->s->jumped = self->model->columns > 0; /* a table's knots may ask for what was read */
    return SUCCESS;
}

void core_terminate(Instance *self) {
    core_warn(self, 1);
    self->s->phase = TERMINATED;
}

/* ---- generated functions ----------------------------------------------------------------------------------- */

int core_evaluate_at_limit(Instance *self, Function *function, const double *y, double *result) {
    self->call.now = before_limit(self, self->s->limit);
    return evaluate_now(self, function, y, result);
}

void core_start(Instance *self) {
    if (!self->s->unstarted) return;
    const double **arguments = self->call.other_arguments;
    double **results = self->call.other_results;
    arguments[0] = &self->s->time;
    arguments[1] = self->v.u;
    arguments[2] = self->v.k;
    results[0] = self->v.y;
    results[1] = self->v.m;
    self->model->start(arguments, results, self->call.integers, self->call.reals, 0);
    self->s->unstarted = 0;
    self->refused = !core_sample(self) || !core_settle(self, self->s->time);
}

/* Distance from the constraints, in sizes of the states, from which a projection leads onto them. */
static const double NEAR = 1e-4;

const double *core_follow_constraints(Instance *self) {
    const size_t n = self->model->states;
    const double *y = self->v.y;
    self->scratch.projections = 0;
    if (self->options.use != USE_MODEL_EXCHANGE || self->s->phase < EVENT) return y;
    for (int far = 1; far && self->scratch.projections < MOST_PROJECTIONS; self->scratch.projections++) {
        double *next = self->scratch.kept + self->scratch.projections * n;
        evaluate(self, self->model->project, self->s->time, y, next);
        far = 0;
        for (size_t i = 0; i < n; i++) far |= fabs(next[i] - y[i]) > NEAR * self->v.size[i];
        y = next;
    }
    return y;
}

int core_remember(Instance *self) {
    const double *kept = core_kept_states(self);
    evaluate(self, self->model->remember, self->s->time, kept, self->d.m);
    if (core_is_singular(self))
        core_take_limits(self, self->model->remember, self->s->time, kept, self->d.m, self->model->memory);
    if (!all_finite(self->d.m, self->model->memory)) return 0;
    memcpy(self->v.m, self->d.m, self->model->memory * sizeof *self->v.m);
    self->s->jumped = 0;
    return 1;
}

int core_sample(Instance *self) {
    if (self->model->sample == NULL) return 1;
    evaluate(self, self->model->sample, self->s->time, self->v.y, self->d.m);
    if (!all_finite(self->d.m, self->model->memory))
        return core_because(self, "%s: the sample at t = %.9g gives a number that is not finite", self->model->name,
                            self->s->time);
    memcpy(self->v.m, self->d.m, self->model->memory * sizeof *self->v.m);
    self->known.current = 0;
    return 1;
}

void core_jump(Instance *self) {
    core_leap(self);
    if (has_contacts()) core_follow_gaps(self);
    evaluate(self, self->model->jump, self->s->time, self->v.y, self->d.y);
    if (core_is_singular(self))
        core_take_limits(self, self->model->jump, self->s->time, self->v.y, self->d.y, self->model->states);
    memcpy(self->v.y, self->d.y, self->model->states * sizeof *self->v.y);
    self->s->jumped = 0;
}

void core_correct_states(Instance *self, double z[], const double y[], const double kept[]) {
    const Model *model = self->model;
    const size_t first = model->parameters + model->inputs;
    for (size_t i = 0; i < model->states; i++) {
        z[core_index_of_state(model, i, 0) - first] = y[i];
        z[core_index_of_state(model, i, 1) - first] += RETURN * (kept[i] - y[i]);
    }
}

void core_update(Instance *self) {
    if (self->known.current) return;
    core_start(self);
    if (self->s->phase == STEP) core_try_impulses(self);
    if (self->s->phase == STEP && self->s->jumped) core_sample(self); /* a sample uses inputs of its instant */
    if (self->s->phase == CONTINUOUS || self->s->phase == INTERMEDIATE) core_remember(self); /* nothing jumps there */
    const double *kept = core_kept_states(self);
    evaluate(self, self->model->calculate, self->s->time, kept, self->v.z);
    if (core_is_singular(self))
        core_take_limits(self, self->model->calculate, self->s->time, kept, self->v.z,
                         self->model->outputs - self->model->drawn);
    if (kept != self->v.y) core_correct_states(self, self->v.z, self->v.y, kept);
    self->known.current = 1;
    self->known.drawn = 0;
}

void core_measure(Instance *self) {
    evaluate(self, self->model->nominals, self->s->time, self->v.y, self->v.size);
    for (size_t i = 0; i < self->model->states; i++)
        if (!(self->v.size[i] > 0 && isfinite(self->v.size[i]))) self->v.size[i] = 1;
}

double core_next_instant(Instance *self, const double *k, double t) {
    double next = INFINITY;
    if (self->model->events == 0) return next;
    const double **arguments = self->call.other_arguments;
    arguments[0] = k;
    arguments[1] = &t;
    self->call.other_results[0] = self->scratch.instant;
    self->model->instants(arguments, self->call.other_results, self->call.integers, self->call.reals, 0);
    for (size_t i = 0; i < self->model->events; i++)
        if (self->scratch.instant[i] > t && self->scratch.instant[i] < next) next = self->scratch.instant[i];
    return next;
}

/* ---- a table ----------------------------------------------------------------------------------------------- */

Status core_set_table(Instance *self, const double numbers[], size_t count) {
    const size_t columns = self->model->columns, rows = columns == 0 ? 0 : count / columns;
    if (rows < 2 || rows * columns != count)
        return core_report(self, ERROR, "a table of %lu numbers: %s takes %lu columns of 2 rows at least",
                           (unsigned long)count, self->model->name, (unsigned long)columns);
    for (size_t i = 0; i < count; i++)
        if (!isfinite(numbers[i]))
            return core_report(self, ERROR, "row %lu of the table: %s: finite numbers only",
                               (unsigned long)(i % rows + 1), core_spelled(numbers[i]));
    for (size_t i = 1; i < rows; i++)
        if (numbers[i] < numbers[i - 1])
            return core_report(self, ERROR, "row %lu of the table: %.9g after %.9g: its first column has to ascend",
                               (unsigned long)(i + 1), numbers[i], numbers[i - 1]);
    double *table = malloc((1 + count) * sizeof *table);
    if (table == NULL) return core_report(self, ERROR, "out of memory for a table of %lu numbers", (unsigned long)count);
    table[0] = (double)rows;
    memcpy(table + 1, numbers, count * sizeof *table);
    free(self->table);
    self->call.arguments[TABLE] = self->call.other_arguments[TABLE] = self->table = table;
    self->known.current = 0;
    return SUCCESS;
}

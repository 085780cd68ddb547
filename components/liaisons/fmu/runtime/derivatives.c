/* Directional and adjoint derivatives, and derivatives of the outputs with respect to time. */
#include <string.h>

#include "inputs.h"

/* ---- d.z from d.t, d.y, d.u, d.k, and back -------------------------------------------------------------------- */

/* Call a generated function with these columns. */
#define CALL(function, arguments, results)                                                                     \
    (memcpy(self->call.other_arguments, arguments, sizeof arguments),                                          \
     memcpy(self->call.other_results, results, sizeof results),                                                \
     function(self->call.other_arguments, self->call.other_results, self->call.integers, self->call.reals, 0))

/* The states that a projection began with, or the last one ended with. */
static const double *projected_from(const Instance *self, size_t i) {
    return i == 0 ? self->v.y : self->scratch.kept + (i - 1) * self->model->states;
}

/* Directional derivatives of y, m and z; at initialization y and m follow from u and k. With `remembering`, m follows
 * the motion. */
static void forward(Instance *self, int remembering) {
    const Model *model = self->model;
    const Vectors *v = &self->v;
    Directions *d = &self->d;
    core_update(self);
    const double t = before_limit(self, self->s->time), *y = core_kept_states(self), *dy = d->y;
    for (size_t i = 0; i < self->scratch.projections; i++) {
        const double *from = projected_from(self, i), *to = projected_from(self, i + 1);
        const double *arguments[] = {&t, from, v->u, v->k, to, &d->t, dy, d->u, d->k};
        double *results[] = {self->scratch.work + i * model->states};
        CALL(model->project_forward, arguments, results);
        dy = results[0];
    }
    if (self->s->phase < EVENT) {
        const double *arguments[] = {&t, v->u, v->k, v->y, v->m, &d->t, d->u, d->k};
        double *results[] = {d->y, d->m};
        CALL(model->start_forward, arguments, results);
    } else if (remembering) {
        const double *arguments[] = {&t, y, v->u, v->k, v->m, v->m, &d->t, dy, d->u, d->k, self->e.m};
        double *results[] = {d->m};
        memset(self->e.m, 0, model->memory * sizeof *self->e.m); /* what is remembered is forgotten */
        CALL(model->remember_forward, arguments, results);
    } else {
        memset(d->m, 0, model->memory * sizeof *d->m);
    }
    const double *arguments[] = {&t, y, v->u, v->k, v->m, v->z, &d->t, dy, d->u, d->k, d->m};
    double *results[] = {d->z};
    CALL(model->calculate_forward, arguments, results);
    if (y != v->y) core_correct_states(self, d->z, d->y, dy);
}

static void add(double *sum, const double *more, size_t n) {
    for (size_t i = 0; i < n; i++) sum[i] += more[i];
}

/* Take the weights of states and of their returns out of those of z: of the states, and of the kept ones. */
static void divide_weights(const Model *model, double z[], double y[], double kept[]) {
    const size_t first = model->parameters + model->inputs;
    for (size_t i = 0; i < model->states; i++) {
        double *own = &z[core_index_of_state(model, i, 0) - first];
        kept[i] = RETURN * z[core_index_of_state(model, i, 1) - first];
        y[i] = *own - kept[i];
        *own = 0;
    }
}

/* Add weights e of t, u, k to d. */
static void add_weights(Instance *self) {
    self->d.t += self->e.t;
    add(self->d.u, self->e.u, self->model->inputs);
    add(self->d.k, self->e.k, self->model->parameters);
}

/* Adjoint derivatives: weights of z become those of t, y, u, k. */
static void backward(Instance *self, int remembering) {
    const Model *model = self->model;
    const Vectors *v = &self->v;
    Directions *d = &self->d, *e = &self->e;
    core_update(self);
    const double t = before_limit(self, self->s->time), *y = core_kept_states(self);
    double *own = self->scratch.work, *kept = own + model->states;
    if (y != v->y) divide_weights(model, d->z, own, kept);
    {
        const double *arguments[] = {&t, y, v->u, v->k, v->m, v->z, d->z};
        double *results[] = {&d->t, d->y, d->u, d->k, d->m};
        CALL(model->calculate_reverse, arguments, results);
    }
    if (self->s->phase < EVENT) {
        const double *arguments[] = {&t, v->u, v->k, v->y, v->m, d->y, d->m};
        double *results[] = {&e->t, e->u, e->k};
        CALL(model->start_reverse, arguments, results);
    } else if (remembering) {
        const double *arguments[] = {&t, y, v->u, v->k, v->m, v->m, d->m};
        double *results[] = {&e->t, e->y, e->u, e->k, e->m};
        CALL(model->remember_reverse, arguments, results);
        add(d->y, e->y, model->states);
    }
    if (self->s->phase < EVENT || remembering) add_weights(self);
    if (y == v->y) return;
    add(d->y, kept, model->states);
    for (size_t i = self->scratch.projections; i-- > 0;) {
        const double *arguments[] = {&t, projected_from(self, i), v->u, v->k, projected_from(self, i + 1), d->y};
        double *results[] = {&e->t, e->y, e->u, e->k};
        CALL(model->project_reverse, arguments, results);
        add_weights(self);
        memcpy(d->y, e->y, model->states * sizeof *d->y);
    }
    add(d->y, own, model->states);
}

/* ---- known and unknown variables --------------------------------------------------------------------------- */

/* Set all directions to 0. */
static void clear(Instance *self) {
    self->d.t = 0;
    memset(self->d.y, 0, (size_t)(self->d.z + self->model->outputs - self->d.y) * sizeof *self->d.y);
}

void core_jacobian(Instance *self, double time, const double y[], double J[]) {
    const Model *model = self->model;
    const Vectors *v = &self->v;
    Directions *d = &self->d;
    const size_t n = model->coupled, first = model->parameters + model->inputs;
    const double t = before_limit(self, time);
    clear(self);
    evaluate(self, model->calculate, time, y, v->z);
    self->known.current = 0;
    for (size_t j = 0; j < n; j++) {
        const double *arguments[] = {&t, y, v->u, v->k, v->m, v->z, &d->t, d->y, d->u, d->k, d->m};
        double *results[] = {d->z};
        d->y[j] = 1;
        CALL(model->calculate_forward, arguments, results);
        d->y[j] = 0;
        for (size_t i = 0; i < n; i++) J[i * n + j] = d->z[core_index_of_state(model, i, 1) - first];
    }
}

/* dE/dt is power - dissipation + ∂E/∂σ (dσ/dt - σ̇) + ∂E/∂σ̇ (dσ̇/dt - σ̈).  Where states are projected they are off their
 * constraints in between, where this does not hold: there the work is what the energy gains, and what is dissipated. */
void core_correct_work(Instance *self, double t, const double y[], double f[]) {
    const Model *model = self->model;
    const Vectors *v = &self->v;
    Directions *d = &self->d;
    const int projected = model->project != NULL;
    const double time = self->step.start + t, now = before_limit(self, time), H = self->step.size;
    clear(self);
    for (const Prescribed *p = self->prescribed.list; p < self->prescribed.list + self->prescribed.count; p++) {
        const Mover *value = mover_of(self, p->value), *rate = mover_of(self, p->rate);
        d->u[p->value] = (value == NULL ? 0 : input_slope(value, t / H) / H) - (projected ? 0 : v->u[p->rate]);
        d->u[p->rate] = (rate == NULL ? 0 : input_slope(rate, t / H) / H) - (projected ? 0 : v->u[p->acceleration]);
    }
    if (projected) {
        d->t = 1;
        memcpy(d->y, f, model->states * sizeof *f);
    }
    evaluate(self, model->calculate, time, y, v->z);
    self->known.current = 0;
    const double *arguments[] = {&now, y, v->u, v->k, v->m, v->z, &d->t, d->y, d->u, d->k, d->m};
    double *results[] = {d->z};
    CALL(model->calculate_forward, arguments, results);
    for (const Account *account = model->account; account < model->account + model->account_rows; account++)
        f[account->work] = d->z[account->energy] + f[projected ? account->dissipated : account->work];
}

/* Address of the direction of a known variable; NULL if it is not known in this phase. */
static double *known(Instance *self, unsigned reference) {
    const Model *model = self->model;
    const size_t index = span_of(self, reference).first;
    if (index < model->parameters) return &self->d.k[index];
    if (index < model->parameters + model->inputs) return &self->d.u[index - model->parameters];
    const Variable *variable = core_variable_at(model, index);
    if (variable->kind == INDEPENDENT) return &self->d.t;
    if (variable->state == NO_STATE || self->s->phase < EVENT) return NULL;
    return &self->d.y[(size_t)variable->state + index - variable->first];
}

/* Whether a number is an output or the derivative of a state. */
static int calculated(const Instance *self, size_t index) {
    return index >= self->model->parameters + self->model->inputs && index < self->layout.numbers - self->model->drawn;
}

static Status check(Instance *self, const unsigned unknowns[], size_t unknown_count, size_t unknown_numbers,
                    const unsigned knowns[], size_t known_count, size_t known_numbers) {
    if (core_check_references(self, knowns, known_count, known_numbers) != SUCCESS
        || core_check_references(self, unknowns, unknown_count, unknown_numbers) != SUCCESS)
        return ERROR;
    for (size_t i = 0; i < known_count; i++)
        if (known(self, knowns[i]) == NULL)
            return core_report(self, ERROR, "%s is not among the known variables now; they are parameters, inputs%s",
                               core_name(self, span_of(self, knowns[i]).first),
                               self->s->phase < EVENT ? "" : ", states");
    for (size_t i = 0; i < unknown_count; i++) {
        const size_t index = span_of(self, unknowns[i]).first;
        if (!calculated(self, index))
            return core_report(self, ERROR, "%s is not an unknown variable: it is set, not calculated",
                               core_name(self, index));
    }
    return SUCCESS;
}

/* Address of an unknown variable's numbers in d.z. */
static double *unknown(const Instance *self, size_t index) {
    return &self->d.z[index - self->model->parameters - self->model->inputs];
}

/* Copy the derivatives of unknown variables. */
static void collect(const Instance *self, const unsigned unknowns[], size_t n, double *next) {
    for (size_t i = 0; i < n; i++) {
        const Span span = span_of(self, unknowns[i]);
        memcpy(next, unknown(self, span.first), span.count * sizeof *next);
        next += span.count;
    }
}

Status core_directional_derivative(Instance *self, const unsigned unknowns[], size_t unknown_count,
                                   const unsigned knowns[], size_t known_count, const double direction[],
                                   size_t direction_count, double result[], size_t result_count) {
    if (check(self, unknowns, unknown_count, result_count, knowns, known_count, direction_count) != SUCCESS)
        return ERROR;
    if (!all_finite(direction, direction_count))
        return core_report(self, DISCARD, "the direction has numbers that are not finite");
    clear(self);
    for (size_t i = 0; i < known_count; i++) {
        const Span span = span_of(self, knowns[i]);
        add(known(self, knowns[i]), direction, span.count);
        direction += span.count;
    }
    forward(self, self->s->phase == CONTINUOUS);
    collect(self, unknowns, unknown_count, result);
    if (all_finite(result, result_count)) return SUCCESS;
    return core_refuse_infinite(self, unknowns, result, result_count, "derivative of ");
}

Status core_adjoint_derivative(Instance *self, const unsigned unknowns[], size_t unknown_count, const unsigned knowns[],
                               size_t known_count, const double weights[], size_t weight_count, double result[],
                               size_t result_count) {
    if (check(self, unknowns, unknown_count, weight_count, knowns, known_count, result_count) != SUCCESS) return ERROR;
    if (!all_finite(weights, weight_count))
        return core_report(self, DISCARD, "the weights have numbers that are not finite");
    clear(self);
    for (size_t i = 0; i < unknown_count; i++) {
        const Span span = span_of(self, unknowns[i]);
        add(unknown(self, span.first), weights, span.count);
        weights += span.count;
    }
    backward(self, self->s->phase == CONTINUOUS);
    double *next = result;
    for (size_t i = 0; i < known_count; i++) {
        const Span span = span_of(self, knowns[i]);
        memcpy(next, known(self, knowns[i]), span.count * sizeof *next);
        next += span.count;
    }
    if (all_finite(result, result_count)) return SUCCESS;
    return core_refuse_infinite(self, knowns, result, result_count, "derivative by ");
}

/* ---- rates of the outputs ---------------------------------------------------------------------------------- */

Status core_output_derivatives(Instance *self, const unsigned references[], size_t n, double values[], size_t count) {
    const Model *model = self->model;
    if (core_check_references(self, references, n, count) != SUCCESS) return ERROR;
    for (size_t i = 0; i < n; i++) {
        const size_t index = span_of(self, references[i]).first;
        if (!calculated(self, index)) return core_report(self, ERROR, "%s is no output", core_name(self, index));
    }
    clear(self);
    self->d.t = 1;
    evaluate(self, derivatives_of(model), self->s->time, self->v.y, self->d.y);
    for (size_t i = 0; i < model->active_rows && self->s->reconstruction != HOLD; i++) {
        const Active *active = &model->active[i];
        memcpy(&self->d.u[active->value], &self->v.u[active->rate], active->count * sizeof *self->d.u);
        memcpy(&self->d.u[active->rate], &self->v.u[active->acceleration], active->count * sizeof *self->d.u);
    }
    for (size_t i = 0; i < model->inputs && self->s->expanded; i++)
        if (self->v.taylor[i * COEFFICIENTS] != 0) self->d.u[i] = self->v.taylor[i * COEFFICIENTS + 1];
    forward(self, 1);
    collect(self, references, n, values);
    if (all_finite(values, count)) return SUCCESS;
    return core_refuse_infinite(self, references, values, count, "derivative by time of ");
}

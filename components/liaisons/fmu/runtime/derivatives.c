/* Directional and adjoint derivatives, and derivatives of the outputs with respect to time. */
#include <string.h>

#include "instance.h"

/* ---- dz from (dt, dy, du, dk), and back -------------------------------------------------------------------- */

/* At initialization y and m follow from u and k; with `remembering`, m follows the motion. */
static void forward(Instance *self, int remembering) {
    const Model *model = self->model;
    core_update(self);
    const double t = before_limit(self, self->s->time);
    if (self->s->phase < EVENT) {
        const double *arguments[] = {&t, self->u, self->k, self->y, self->m, &self->dt, self->du, self->dk};
        memcpy(self->arguments, arguments, sizeof arguments);
        self->results[0] = self->dy;
        self->results[1] = self->dm;
        model->start_forward(self->arguments, self->results, self->integers, self->reals, 0);
    } else if (remembering) {
        const double *arguments[] = {&t,        self->y,  self->u,  self->k,  self->m, self->m,
                                     &self->dt, self->dy, self->du, self->dk, self->em};
        memset(self->em, 0, model->memory * sizeof *self->em); /* what is remembered is forgotten */
        memcpy(self->arguments, arguments, sizeof arguments);
        self->results[0] = self->dm;
        model->remember_forward(self->arguments, self->results, self->integers, self->reals, 0);
    } else {
        memset(self->dm, 0, model->memory * sizeof *self->dm);
    }
    const double *arguments[] = {&t,        self->y,  self->u,  self->k,  self->m, self->z,
                                 &self->dt, self->dy, self->du, self->dk, self->dm};
    memcpy(self->arguments, arguments, sizeof arguments);
    self->results[0] = self->dz;
    model->calculate_forward(self->arguments, self->results, self->integers, self->reals, 0);
}

static void add(double *sum, const double *more, size_t n) {
    for (size_t i = 0; i < n; i++) sum[i] += more[i];
}

/* The same way back: weights of z become those of t, y, u, k. */
static void backward(Instance *self, int remembering) {
    const Model *model = self->model;
    core_update(self);
    const double t = before_limit(self, self->s->time);
    double et = 0;
    {
        const double *arguments[] = {&t, self->y, self->u, self->k, self->m, self->z, self->dz};
        double *results[] = {&self->dt, self->dy, self->du, self->dk, self->dm};
        memcpy(self->arguments, arguments, sizeof arguments);
        memcpy(self->results, results, sizeof results);
        model->calculate_reverse(self->arguments, self->results, self->integers, self->reals, 0);
    }
    if (self->s->phase < EVENT) {
        const double *arguments[] = {&t, self->u, self->k, self->y, self->m, self->dy, self->dm};
        double *results[] = {&et, self->eu, self->ek};
        memcpy(self->arguments, arguments, sizeof arguments);
        memcpy(self->results, results, sizeof results);
        model->start_reverse(self->arguments, self->results, self->integers, self->reals, 0);
    } else if (remembering) {
        const double *arguments[] = {&t, self->y, self->u, self->k, self->m, self->m, self->dm};
        double *results[] = {&et, self->ey, self->eu, self->ek, self->em};
        memcpy(self->arguments, arguments, sizeof arguments);
        memcpy(self->results, results, sizeof results);
        model->remember_reverse(self->arguments, self->results, self->integers, self->reals, 0);
        add(self->dy, self->ey, model->states);
    } else {
        return;
    }
    self->dt += et;
    add(self->du, self->eu, model->inputs);
    add(self->dk, self->ek, model->parameters);
}

/* ---- known and unknown variables --------------------------------------------------------------------------- */

static void clear(Instance *self) {
    self->dt = 0;
    memset(self->dy, 0, (size_t)(self->dz + self->model->outputs - self->dy) * sizeof *self->dy);
}

/* Where the direction of a known variable is kept; NULL if it is not known in this phase. */
static double *known(Instance *self, unsigned reference) {
    const Model *model = self->model;
    const size_t place = span_of(self, reference).first;
    if (place < model->parameters) return &self->dk[place];
    if (place < model->parameters + model->inputs) return &self->du[place - model->parameters];
    const Variable *variable = core_variable_at(model, place);
    if (variable->kind == INDEPENDENT) return &self->dt;
    if (variable->state == NO_STATE || self->s->phase < EVENT) return NULL;
    return &self->dy[(size_t)variable->state + place - variable->first];
}

static int calculated(const Instance *self, size_t place) {
    return place >= self->model->parameters + self->model->inputs && place < self->places;
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
        const size_t place = span_of(self, unknowns[i]).first;
        if (!calculated(self, place))
            return core_report(self, ERROR, "%s is not an unknown variable: it is set, not calculated",
                               core_name(self, place));
    }
    return SUCCESS;
}

/* Where the numbers of an unknown variable are, in dz. */
static double *unknown(const Instance *self, size_t place) {
    return &self->dz[place - self->model->parameters - self->model->inputs];
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
    double *next = result;
    for (size_t i = 0; i < unknown_count; i++) {
        const Span span = span_of(self, unknowns[i]);
        memcpy(next, unknown(self, span.first), span.count * sizeof *next);
        next += span.count;
    }
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
        const size_t place = span_of(self, references[i]).first;
        if (!calculated(self, place)) return core_report(self, ERROR, "%s is no output", core_name(self, place));
    }
    clear(self);
    self->dt = 1;
    evaluate(self, derivatives_of(model), self->s->time, self->y, self->dy);
    for (size_t i = 0; i < model->active_rows && self->s->reconstruction != HOLD; i++) {
        const Active *active = &model->active[i];
        memcpy(&self->du[active->value], &self->u[active->rate], active->count * sizeof *self->du);
        memcpy(&self->du[active->rate], &self->u[active->acceleration], active->count * sizeof *self->du);
    }
    for (size_t i = 0; i < model->inputs && self->s->expanded; i++)
        if (self->taylor[i * COEFFICIENTS] != 0) self->du[i] = self->taylor[i * COEFFICIENTS + 1];
    forward(self, 1);
    double *next = values;
    for (size_t i = 0; i < n; i++) {
        const Span span = span_of(self, references[i]);
        memcpy(next, unknown(self, span.first), span.count * sizeof *next);
        next += span.count;
    }
    if (all_finite(values, count)) return SUCCESS;
    return core_refuse_infinite(self, references, values, count, "derivative by time of ");
}

#include "inputs.h"

#include <string.h>

/* ---- derivatives of inputs, given for one step ------------------------------------------------------------- */

/* Whether a reference, which exists, stands for inputs. */
static int is_input(const Instance *self, unsigned reference) {
    return span_of(self, reference).first - self->model->parameters < self->model->inputs;
}

/* Report a derivative of what is no input, of an order that is not supported, or that is not finite. */
static Status check_input_derivative(const Instance *self, unsigned reference, int order, double value) {
    if (reference - self->layout.first < self->layout.references && is_input(self, reference) && order >= 1
        && order <= ORDER && isfinite(value))
        return SUCCESS;
    if (core_check_references(self, &reference, 1, 1) != SUCCESS) return ERROR;
    const char *name = core_name(self, span_of(self, reference).first);
    if (!is_input(self, reference)) return core_report(self, ERROR, "%s is no input", name);
    if (order < 1 || order > ORDER)
        return core_report(self, ERROR, "derivative of order %d of %s: the order must be 1 to %d", order, name, ORDER);
    return core_report(self, DISCARD, "derivative of order %d of %s = %s: set a finite number", order, name,
                       core_spelled(value));
}

Status core_set_input_derivatives(Instance *self, const unsigned references[], size_t n, const int orders[],
                                  const double values[]) {
    for (size_t i = 0; i < n; i++) {
        const Status status = check_input_derivative(self, references[i], orders[i], values[i]);
        if (status != SUCCESS) return status;
    }
    for (size_t i = 0; i < n; i++) {
        double *taylor = &self->v.taylor[(span_of(self, references[i]).first - self->model->parameters) * COEFFICIENTS];
        taylor[0] = 1;
        taylor[orders[i]] = values[i];
    }
    self->s->expanded = 1;
    self->known.rests = 0;
    return SUCCESS;
}

/* ---- polynomials ------------------------------------------------------------------------------------------- */

/* Differentiate a polynomial in the fraction of a step of size H with respect to time. */
static void differentiate(const double *c, double H, double *derivative) {
    for (int j = 0; j < ORDER; j++) derivative[j] = (j + 1) * c[j + 1] / H;
    derivative[ORDER] = 0;
}

/* Coefficients of the quintic Hermite polynomial: value, rate and acceleration at both ends of the step. */
static void interpolate(const double *u, const Prescribed *at, double H, double *c) {
    c[0] = u[at->value];
    c[1] = H * u[at->rate];
    c[2] = H * H * u[at->acceleration] / 2;
    /* what this parabola misses at the end */
    const double value = at->end[0] - (c[0] + c[1] + c[2]);
    const double rate = H * at->end[1] - (c[1] + 2 * c[2]);
    const double acceleration = H * H * at->end[2] - 2 * c[2];
    c[3] = 10 * value - 4 * rate + acceleration / 2;
    c[4] = -15 * value + 7 * rate - acceleration;
    c[5] = 6 * value - 3 * rate + acceleration / 2;
}

/* Whether a prescribed coordinate rests during the step. */
static int rests(const Instance *self, const Prescribed *at) {
    const double *u = self->v.u, *end = at->end;
    if (u[at->rate] != 0 || u[at->acceleration] != 0) return 0;
    return self->s->reconstruction == EXTRAPOLATE || (end[0] == u[at->value] && end[1] == 0 && end[2] == 0);
}

/* The polynomial of an input, which is added to those that move, and constant, if it is none of them. */
static double *polynomial(Instance *self, size_t index) {
    Mover *mover = mover_of(self, index);
    if (mover != NULL) return mover->c;
    self->movers.of_input[index] = self->movers.count;
    self->movers.list[self->movers.count] =
        (Mover){.index = index, .variable = self->movers.variable_of[index], .c = {self->v.u[index]}};
    return self->movers.list[self->movers.count++].c;
}

/* Give a prescribed coordinate, its rate and its acceleration their polynomials. */
static void reconstruct_active(Instance *self, const Prescribed *at, double H) {
    if (rests(self, at)) return;
    double *value = polynomial(self, at->value), *rate = polynomial(self, at->rate);
    if (self->s->reconstruction == INTERPOLATE && !at->leaps) {
        interpolate(self->v.u, at, H, value);
    } else {
        value[1] = H * self->v.u[at->rate];
        value[2] = H * H * self->v.u[at->acceleration] / 2;
    }
    differentiate(value, H, rate);
    differentiate(rate, H, polynomial(self, at->acceleration));
}

void core_reconstruct(Instance *self, double H) {
    const Model *model = self->model;
    const int mode = self->s->reconstruction;
    const double *u = self->v.u, *set = self->v.set;
    self->movers.count = 0;
    for (size_t i = 0; i < model->inputs && mode == INTERPOLATE; i++)
        if (set[i] != u[i]) polynomial(self, i)[1] = set[i] - u[i];
    for (size_t i = 0; i < self->prescribed.count && mode != HOLD; i++)
        reconstruct_active(self, &self->prescribed.list[i], H);
    for (size_t i = 0; i < model->inputs && mode != INTERPOLATE && self->s->expanded; i++) {
        const double *taylor = &self->v.taylor[i * COEFFICIENTS];
        if (taylor[0] == 0) continue;
        double *c = polynomial(self, i), factor = 1;
        for (int j = 1; j <= ORDER; j++) c[j] = taylor[j] * (factor *= H / j);
        c[0] = u[i];
    }
}

void core_settle_movers(Instance *self) {
    size_t kept = 0;
    for (size_t i = 0; i < self->movers.count; i++) {
        Mover *mover = &self->movers.list[i];
        int degree = ORDER;
        while (degree > 0 && mover->c[degree] == 0) degree--;
        if (degree == 0) continue;
        mover->degree = degree;
        self->movers.of_input[mover->index] = kept;
        if (kept < i) self->movers.list[kept] = *mover;
        kept++;
    }
    self->movers.count = kept;
}

/* Rounding errors of an importer's polynomials stay below this part of their coefficients. */
static const double ROUNDING = 1e-12;

/* Whether the derivative of what an input does in a step of size H is something else than what another one does. */
static int differ(Instance *self, size_t index, size_t rate, double H) {
    const Mover *mover = mover_of(self, index), *other = mover_of(self, rate);
    double differences = 0, sizes = 0;
    for (int j = 0; j < ORDER; j++) {
        const double slope = mover == NULL ? 0 : (j + 1) * mover->c[j + 1];
        const double said = H * (other != NULL ? other->c[j] : j == 0 ? self->v.u[rate] : 0);
        differences += fabs(slope - said);
        sizes += fabs(slope) + fabs(said);
    }
    return differences > ROUNDING * sizes;
}

int core_moves_apart(Instance *self) {
    if (self->model->account_rows == 0) return 0;
    if (self->s->reconstruction != HOLD && !self->s->expanded && self->options.request_inputs == NULL) return 0;
    for (const Prescribed *p = self->prescribed.list; p < self->prescribed.list + self->prescribed.count; p++)
        if (differ(self, p->value, p->rate, self->step.size) || differ(self, p->rate, p->acceleration, self->step.size))
            return 1;
    return 0;
}

int core_activity(const Instance *self) {
    const Model *model = self->model;
    const double *u = self->v.u;
    int found = model->motions[0].all == derivatives_of(model) ? ACTIVITIES - 1 : 0; /* where nothing would be saved */
    for (size_t i = 0; i < self->movers.count; i++) found |= self->movers.list[i].variable->activity;
    for (size_t i = 0; i < model->inputs; i++)
        if (u[i] != 0) found |= self->movers.variable_of[i]->activity;
    return found;
}

/* ---- requested inputs --------------------------------------------------------------------------------------- */

/* The powers 1 to 5 of a polynomial that is 0 at 0, from its values at 1/5, 2/5 ... 1. */
static const double POWERS[ORDER][ORDER] = {
    {25, -25, 50 / 3.0, -25 / 4.0, 1},
    {-1925 / 12.0, 2675 / 12.0, -325 / 2.0, 1525 / 24.0, -125 / 12.0},
    {8875 / 24.0, -7375 / 12.0, 6125 / 12.0, -5125 / 24.0, 875 / 24.0},
    {-4375 / 12.0, 8125 / 12.0, -625, 6875 / 24.0, -625 / 12.0},
    {3125 / 24.0, -3125 / 12.0, 3125 / 12.0, -3125 / 24.0, 625 / 24.0},
};

Status core_set_requested_inputs(Instance *self, const unsigned references[], size_t n, const double values[],
                                 size_t count) {
    const size_t first = self->model->parameters;
    if (core_check_references(self, references, n, count) != SUCCESS) return ERROR;
    for (size_t i = 0; i < n; i++) {
        const Span span = span_of(self, references[i]);
        if (!is_input(self, references[i]))
            return core_report(self, ERROR, "%s is no input", core_name(self, span.first));
        for (size_t k = 0; k < span.count; k++)
            self->movers.given[(span.first - first + k) * ORDER + self->movers.requested] = *values++;
    }
    return SUCCESS;
}

void core_request_inputs(Instance *self, double time, double H) {
    for (size_t i = 0; i < self->model->inputs * ORDER; i++) self->movers.given[i] = NAN;
    self->s->phase = INPUT_REQUEST;
    for (self->movers.requested = 0; self->movers.requested < ORDER; self->movers.requested++)
        self->options.request_inputs(self->options.owner, time + H * (double)(self->movers.requested + 1) / ORDER);
    self->s->phase = STEP;
    for (size_t i = 0; i < self->model->inputs; i++) {
        const double *given = &self->movers.given[i * ORDER];
        double sum = 0;
        for (int k = 0; k < ORDER; k++) sum += given[k];
        if (!isfinite(sum)) continue;
        double *c = polynomial(self, i);
        for (int j = 0; j < ORDER; j++) {
            c[j + 1] = 0;
            for (int k = 0; k < ORDER; k++) c[j + 1] += POWERS[j][k] * (given[k] - self->v.u[i]);
        }
        c[0] = self->v.u[i];
    }
}

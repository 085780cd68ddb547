/* Where constraints lose rank: a motion that passes such a configuration has limits there, from both sides. */
#include <string.h>

#include "instance.h"

/* First time aside and the last one, in which a state moves by these parts of its size. */
static const double FIRST = 1e-3, LAST = 0.3;
/* Margin on both sides that limits take at least, where no time aside has more than WIDE. */
static const double LEAST = 1e-8;
/* Parts of a number by which both sides differ if it is no limit, and by which a limit is another number than it; what is
 * rounding of numbers that are 0. */
static const double APART = 1e-3, OTHER = 1e-9, TINY = 1e-9;

/* Results of a function at a time aside, from where the inputs are u, if all goes on at its rate; the margin there. */
static double aside(Instance *self, Function *function, double t, const double y[], const double f[], double h,
                    double result[]) {
    const Model *model = self->model;
    double *moved = self->scratch.aside + model->inputs, *kept = moved + model->states;
    const double *u = self->scratch.aside;
    memcpy(self->v.u, u, model->inputs * sizeof *u);
    for (const Active *a = model->active; a < model->active + model->active_rows; a++)
        for (size_t i = 0; i < a->count; i++) self->v.u[a->value + i] += h * u[a->rate + i];
    for (size_t i = 0; i < model->states; i++) moved[i] = y[i] + h * f[i];
    evaluate(self, model->project, t + h, moved, kept);
    evaluate(self, function, t + h, kept, result);
    return self->call.margin;
}

/* Limit of number i at a time, from those on both sides; of sixth order. */
static double limit_of(double *const r[], size_t i) {
    return (15 * (r[0][i] + r[1][i]) - 6 * (r[2][i] + r[3][i]) + r[4][i] + r[5][i]) / 20;
}

/* Parts of the rates of coordinates by which those on both sides, and their limit and the present ones f, may differ. */
static const double TURNED = 0.5, OFF = 1e-4;

/* Whether rates r on both sides are those of a motion that passes; f: NULL where the present ones say nothing.  Near a
 * dead point, where two positions become one, a coordinate turns, or the times aside lead to the other position. */
static int passes(const Instance *self, const double f[], double *const r[]) {
    const Model *model = self->model;
    double fastest = 0, turned = 0, off = 0;
    for (size_t i = 0; i < model->coupled; i++) {
        if (!model->configuration[i]) continue;
        fastest = fmax(fastest, fmax(fabs(r[0][i]), fabs(r[1][i])) / self->v.size[i]);
        turned = fmax(turned, fabs(r[0][i] - r[1][i]) / self->v.size[i]);
        if (f != NULL) off = fmax(off, fabs(limit_of(r, i) - f[i]) / self->v.size[i]);
    }
    return turned <= TURNED * fastest && off <= OFF * fastest;
}

/* Whether an output is a multiplier: forces inside of a mechanism may be infinite where all others are not. */
static int is_multiplier(const Instance *self, size_t output) {
    return strstr(core_name(self, self->model->parameters + self->model->inputs + output), "lambda_") != NULL;
}

long core_take_limits(Instance *self, Function *function, double t, const double y[], double result[], size_t n) {
    const Model *model = self->model;
    const int moves = function != model->calculate && function != model->remember && function != model->jump;
    Function *rates = moves ? function : derivatives_of(model);
    double *f = self->scratch.aside + model->inputs + 2 * model->states, *r[2 * ASIDE], fastest = 0, h = 0, best = LEAST;
    long without = -1;
    memcpy(self->scratch.aside, self->v.u, model->inputs * sizeof *self->v.u);
    for (size_t k = 0; k < 2 * ASIDE; k++) r[k] = f + model->states + k * (model->states + model->outputs);
    evaluate(self, derivatives_of(model), t, y, f);
    const double margin = self->call.margin;
    for (size_t i = 0; i < model->coupled; i++) fastest = fmax(fastest, fabs(f[i]) / self->v.size[i]);
    for (double next = FIRST / fastest; best < WIDE && next * fastest < LAST; next *= 2) {
        const double nearer = fmin(aside(self, rates, t, y, f, next, r[0]), aside(self, rates, t, y, f, -next, r[1]));
        if (!(nearer > best) || !passes(self, NULL, r)) continue;
        best = nearer;
        h = next;
    }
    for (size_t k = 0; h > 0 && k < 2 * ASIDE; k++)
        aside(self, rates, t, y, f, (k % 2 ? -h : h) * (double)(k / 2 + 1), r[k]);
    if (h > 0 && passes(self, margin < POLE ? NULL : f, r)) {
        for (size_t k = 0; !moves && k < 2 * ASIDE; k++)
            aside(self, function, t, y, f, (k % 2 ? -h : h) * (double)(k / 2 + 1), r[k]);
        for (size_t i = 0; i < n; i++) {
            const double near = r[0][i] + r[1][i], limit = limit_of(r, i);
            const double change = fabs(r[0][i] - r[1][i]), before = fabs(r[2][i] - r[3][i]);
            if (change > 0.9 * before && change > APART * fabs(near) + TINY) { /* a pole, or a jump */
                if (without < 0 || (function == model->calculate && is_multiplier(self, (size_t)without))) without = (long)i;
            } else if (fabs(limit - result[i]) > OTHER * (fabs(limit) + before)) result[i] = limit;
        }
    }
    memcpy(self->v.u, self->scratch.aside, model->inputs * sizeof *self->v.u);
    self->call.margin = margin;
    return without;
}

int core_has_limits(Instance *self) {
    const Model *model = self->model;
    const size_t outputs = model->outputs - model->drawn, first = model->parameters + model->inputs;
    self->known.current = 0;
    evaluate(self, model->calculate, self->s->time, self->v.y, self->v.z);
    if (!core_is_singular(self)) return 1;
    const long without = core_take_limits(self, model->calculate, self->s->time, self->v.y, self->v.z, outputs);
    if (without < 0 || self->call.margin > POLE) return 1;
    const char *name = core_name(self, first + (size_t)without);
    if (!is_multiplier(self, (size_t)without))
        return core_because(self, "%s has no limit at t = %.9g, where the constraints lose rank: end the step elsewhere",
                            core_name(self, first + (size_t)without), self->s->time);
    if (self->known.infinite != self->s->time)
        core_report(self, WARNING, "%s is infinite near t = %.9g, where the constraints lose rank: its number there is none",
                    name, self->s->time);
    self->known.infinite = self->s->time;
    return 1;
}

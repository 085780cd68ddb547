/* What is said of calls that fail, and checks of numbers with a reason. */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "instance.h"

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
    vsnprintf(self->words.text, sizeof self->words.text, format, arguments);
    va_end(arguments);
    return 0;
}

const char *core_spelled(double value) { return isnan(value) ? "nan" : value > 0 ? "inf" : "-inf"; }

/* ---- what is allowed --------------------------------------------------------------------------------------- */

int core_outside(Instance *self, size_t index, double value, double t) {
    return core_because(self, "%s = %.9g at t = %.9g: it must be %s", core_name(self, index), value, t,
                        core_variable_at(self->model, index)->domain);
}

int core_check_domains(Instance *self, double t) {
    if (self->known.allowed) return 1;
    for (const Bounded *bounded = self->bounded; bounded->variable != NULL; bounded++)
        if (!allows(bounded->variable, self->v.k[bounded->index]))
            return core_outside(self, bounded->index, self->v.k[bounded->index], t);
    self->known.allowed = 1;
    return 1;
}

int core_check_conditions(Instance *self, double t, const double *y, size_t count) {
    if (count == 0) return 1;
    evaluate(self, self->model->distances, t, y, self->scratch.condition);
    for (size_t i = 0; i < count; i++)
        if (!(self->scratch.condition[i] > 0))
            return core_because(self, "%s; at t = %.9g it does not (%.3g)", self->model->condition_texts[i], t,
                                self->scratch.condition[i]);
    return 1;
}

int core_keeps(Instance *self, double t, const double *y, double multiple) {
    evaluate(self, self->model->reach, t, y, self->scratch.residual);
    for (size_t i = 0; i < self->model->reach_rows; i++)
        if (!(fabs(self->scratch.residual[i]) <= multiple)) return 0;
    return 1;
}

/* The constraint of which most is left, and what is prescribed for it. */
static int because_out_of_reach(Instance *self, double t) {
    const double *left = self->scratch.residual;
    size_t worst = 0;
    for (size_t i = 1; i < self->model->reach_rows; i++)
        if (!(fabs(left[i]) <= fabs(left[worst]))) worst = i;
    const Reach *reach = &self->model->reaches[worst];
    char list[TEXT / 2] = "";
    for (size_t i = 0, length = 0; i < reach->count && length < sizeof list; i++)
        length += (size_t)snprintf(list + length, sizeof list - length, "%s%s = %.9g", i > 0 ? ", " : "",
                                   reach->prescribed[i], left[reach->first + i]);
    if (reach->count == 0)
        return core_because(self, "%s cannot be kept at t = %.9g: no motion leads on from there", reach->text, t);
    return core_because(self, "%s cannot be kept: %s at t = %.9g is out of reach; stay within it", reach->text, list, t);
}

/* Newton's method loses half of what is left in each step near a dead point, where two positions become one. */
static const double GAIN = 0.9;
enum { MOST_ROUNDS = 100 };

int core_approach_constraints(Instance *self, double t, double *y) {
    const Model *model = self->model;
    double before = INFINITY;
    for (int i = 0; i == 0 || !core_keeps(self, t, y, 1); i++) {
        double left = 0;
        for (size_t j = 0; j < model->reach_rows; j++) left += fabs(self->scratch.residual[j]);
        if (i == MOST_ROUNDS || !(left < GAIN * before)) return because_out_of_reach(self, t);
        before = left;
        evaluate(self, model->project, t, y, self->d.y);
        memcpy(y, self->d.y, model->states * sizeof *y);
    }
    return 1;
}

int core_check_finite(Instance *self, const double *values, int derivatives, double t) {
    if (all_finite(values, self->model->states)) return 1;
    for (size_t i = 0; i < self->model->states; i++)
        if (!isfinite(values[i]))
            return core_because(self, "%s = %s at t = %.9g: the motion ends there",
                                core_name(self, core_index_of_state(self->model, i, derivatives)), core_spelled(values[i]),
                                t);
    return 1;
}

int core_because_infinite(Instance *self) {
    const size_t first = self->model->parameters + self->model->inputs;
    self->known.current = 0;
    evaluate(self, self->model->calculate, self->s->time, self->v.y, self->v.z);
    for (size_t i = 0; i < self->model->outputs - self->model->drawn; i++)
        if (!isfinite(self->v.z[i]))
            return core_because(self, "%s = %s at t = %.9g: it must be finite", core_name(self, first + i),
                                core_spelled(self->v.z[i]), self->s->time);
    return core_because(self, "an energy at t = %.9g is not finite", self->s->time);
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
                              && core_check_conditions(self, t, self->v.y, self->model->start_conditions));
    const char *name = core_name(self, span_of(self, *references).first + i);
    if (unusable) return core_report(self, status, "%s; %s%s = %s", self->words.text, what, name, core_spelled(value));
    return core_report(self, status, "%s%s = %s at t = %.9g: it must be finite; choose other start values or inputs",
                       what, name, core_spelled(value), t);
}

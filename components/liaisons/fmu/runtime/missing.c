/* Rates of prescribed coordinates that nobody gives.
 *
 * Where σ̇ and σ̈, or σ̈ alone, stay 0 while σ, or σ̇, goes on, they are derived from what was given at the last
 * communication points: by the polynomial through the present one and up to EARLIER before it. */
#include <stdio.h>
#include <string.h>

#include "prescribed.h"

/* Part of the change of a rate by which the mean of both rates may miss the one on the way: else the rate jumps. */
static const double STRAIGHT = 0.1;
/* Points that are nearer to each other than this part of their mean distance count once. */
static const double NEAR = 0.05;

/* First and second derivative at t of the polynomial through a value then and those of a series before; 0 where the value
 * is far from where the series leads: it has jumped.  Returns whether it has. */
static int differentiate(const Past *past, const double *series, double t, double value, double d[2]) {
    double x[EARLIER + 1] = {0}, c[EARLIER + 1] = {value}, led[EARLIER + 1];
    size_t n = 1;
    const size_t points = (size_t)past->points;
    const double near = points == 0 ? 0 : NEAR * (t - past->times[points - 1]) / (double)points;
    d[0] = d[1] = 0;
    for (size_t i = 0; i < points; i++) {
        if (!(x[n - 1] - (past->times[i] - t) > near)) continue;
        x[n] = past->times[i] - t;
        led[n] = c[n] = series[i];
        n++;
    }
    if (n > 2) {
        double low = INFINITY, high = -INFINITY;
        for (size_t i = 1; i < n; i++) {
            low = fmin(low, c[i]);
            high = fmax(high, c[i]);
        }
        for (size_t k = 1; k + 1 < n; k++) /* Neville's scheme, at t */
            for (size_t i = 1; i + k < n; i++) led[i] = (x[i] * led[i + 1] - x[i + k] * led[i]) / (x[i] - x[i + k]);
        if (fabs(value - led[1]) > FAR * (fmax(high, led[1]) - fmin(low, led[1]))) return 1;
    }
    for (size_t k = 1; k < n; k++) /* Newton's divided differences */
        for (size_t i = n - 1; i >= k; i--) c[i] = (c[i] - c[i - 1]) / (x[i] - x[i - k]);
    double product = 1, sum = 0; /* of Newton's polynomials: first derivative, half of the second */
    for (size_t k = 1; k < n; k++) {
        d[0] += c[k] * product;
        d[1] += 2 * c[k] * sum;
        sum = product - sum * x[k];
        product *= -x[k];
    }
    d[0] = bounded(d[0]);
    d[1] = bounded(d[1]);
    return 0;
}

int prescribed_derive(const Prescribed *p, double t, double numbers[3]) {
    double d[2];
    const int rates_too = *p->derived > ACCELERATION;
    const int jumps = differentiate(p->past, rates_too ? p->past->values : p->past->rates, t, numbers[!rates_too], d);
    if (rates_too) numbers[1] = d[0];
    numbers[2] = d[rates_too];
    return jumps;
}

void core_derive(Instance *self) {
    double *u = self->v.u;
    FOR_EACH(p) {
        if (!derives(p)) continue;
        double numbers[] = {u[p->value], u[p->rate], u[p->acceleration]};
        prescribed_derive(p, self->s->time, numbers);
        u[p->rate] = numbers[1];
        u[p->acceleration] = numbers[2];
    }
}

void prescribed_remember(Instance *self, Prescribed *p) {
    Past *past = p->past;
    if (p->rests && past->points > 0) {
        past->points = 1;
        past->times[0] = self->s->time;
        return;
    }
    double numbers[] = {self->v.u[p->value], self->v.u[p->rate], self->v.u[p->acceleration]};
    if (derives(p) && prescribed_derive(p, self->s->time, numbers)) past->points = 0;
    if (past->points > 0 && !(self->s->time > past->times[0])) past->points = 0; /* of another clock */
    const size_t kept = past->points < EARLIER ? (size_t)past->points : EARLIER - 1;
    for (size_t i = kept; i > 0; i--) { /* less than three calls */
        past->times[i] = past->times[i - 1];
        past->values[i] = past->values[i - 1];
        past->rates[i] = past->rates[i - 1];
    }
    past->times[0] = self->s->time;
    past->values[0] = self->v.u[p->value];
    past->rates[0] = self->v.u[p->rate];
    past->points = (double)kept + 1;
}

/* Whether a rate changes as if it had no jump, and not as its acceleration says; whether *wrong is that of the steps before. */
static int turns_otherwise(double H, const double from[3], const double to[3], double *wrong) {
    const double change = to[1] - from[1], said = H * (from[2] + to[2]) / 2, before = *wrong;
    const double went = to[0] - from[0] - H * (from[1] + to[1]) / 2;
    const double size = fabs(change) + fabs(H) * fmax(fabs(from[2]), fabs(to[2]));
    *wrong = 0;
    if (!(fabs(change - said) > WRONG * size) || !(fabs(change - said) > fabs(H * (to[2] - from[2])) / 2)) return 0;
    if (!(fabs(went) <= STRAIGHT * fabs(H * change))) return 0;
    *wrong = bounded((change - said) / change);
    return before == 0 || fabs(*wrong - before) <= WRONG * fabs(*wrong) ? 1 : -1;
}

void prescribed_look(Prescribed *p, double H, const double from[3], const double to[3]) {
    Past *past = p->past;
    if (p->derived == NULL) return;
    const double before = *p->derived;
    if (from[1] == 0 && to[1] == 0 && from[2] == 0 && to[2] == 0) {
        past->still = to[0] != from[0] ? past->still + 1 : before == RATE_AND_ACCELERATION ? past->still : 0;
        past->turns = past->wrong = 0;
        *p->derived = past->still >= SEVERAL ? RATE_AND_ACCELERATION : before == ACCELERATION ? before : 0;
    } else {
        const int turns = turns_otherwise(H, from, to, &past->wrong);
        past->still = 0;
        past->turns = turns > 0 ? past->turns + 1 : turns < 0;
        const int missing = from[2] == 0 && to[2] == 0;
        *p->derived = missing && (before == ACCELERATION || past->turns >= SEVERAL) ? ACCELERATION : 0;
    }
    p->tells = *p->derived > before && !past->told;
    if (*p->derived > 0) past->found = 0; /* it was no contradiction */
}

int core_tell(Instance *self) {
    int tells = 0;
    FOR_EACH(p) {
        if (p->tells) p->past->told = 1;
        tells |= p->tells;
    }
    return tells;
}

const char *core_told(Instance *self) {
    const size_t first = self->model->parameters;
    FOR_EACH(p) {
        if (!p->tells) continue;
        const int both = *p->derived > ACCELERATION;
        const char *they = both ? "they are" : "it is", *them = both ? "them" : "it";
        char moving[NAME], rate[NAME];
        strcpy(moving, core_name(self, first + (both ? p->value : p->rate)));
        strcpy(rate, core_name(self, first + p->rate));
        const char *acceleration = core_name(self, first + p->acceleration);
        p->tells = 0;
        core_because(self, "%s%s%s stay%s 0 while %s changes, at t = %.9g: ", both ? rate : "", both ? " and " : "",
                     acceleration, both ? "" : "s", moving, self->s->time);
        const size_t length = strlen(self->words.text);
        if (self->options.use == USE_MODEL_EXCHANGE)
            snprintf(self->words.text + length, TEXT - length, "set %s; in model exchange %s taken for 0", them, they);
        else
            snprintf(self->words.text + length, TEXT - length,
                     "from now on %s derived from what %s has at communication points; set %s, or "
                     "input_reconstruction = 0 (hold)", they, moving, them);
        return self->words.text;
    }
    return NULL;
}

int core_watch(Instance *self) {
    const double *u = self->v.u;
    FOR_EACH(p) {
        Past *past = p->past;
        const double from[] = {past->values[0], past->rates[0], past->given[1]}, H = self->s->time - past->times[0];
        const double to[] = {u[p->value], u[p->rate], u[p->acceleration]};
        p->tells = 0;
        if (past->points > 0 && (H == 0 || memcmp(from, to, sizeof from) == 0)) continue;
        if (past->points > 0) prescribed_look(p, H, from, to);
        past->points = 1;
        past->times[0] = self->s->time;
        past->values[0] = to[0];
        past->rates[0] = to[1];
        past->given[1] = to[2];
    }
    self->known.current = 0;
    return core_tell(self);
}

/* Model exchange, where the importer solves the equations, and events. */
#include <string.h>

#include "impulses.h"
#include "instance.h"
#include "unilateral.h"

Status core_set_time(Instance *self, double time) {
    if (!isfinite(time)) return core_report(self, DISCARD, "time = %s: set a finite number", core_spelled(time));
    const int tells = time != self->s->time && self->s->phase == CONTINUOUS && self->prescribed.count > 0
                      && core_watch(self); /* the inputs of the time before are complete now */
    self->s->time = time;
    self->known.current = 0;
    return tells ? WARNING : SUCCESS;
}

Status core_set_states(Instance *self, const double y[]) {
    for (size_t i = 0; i < self->model->states; i++)
        if (!isfinite(y[i]))
            return core_report(self, DISCARD, "%s = %s: set a finite number",
                               core_name(self, core_index_of_state(self->model, i, 0)), core_spelled(y[i]));
    memcpy(self->v.y, y, self->model->states * sizeof *y);
    self->known.current = 0;
    return SUCCESS;
}

Status core_get_states(Instance *self, double y[]) {
    core_start(self);
    if (!core_check_finite(self, self->v.y, 0, self->s->time)) return core_report(self, DISCARD, "%s", self->words.text);
    memcpy(y, self->v.y, self->model->states * sizeof *y);
    return SUCCESS;
}

/* Multiple of what a projection leaves by which solvers of importers may leave the constraints unasked. */
static const double UNASKED_DRIFT = 1e3;
enum { SELDOM = 32, A_WHILE = 1000 };

/* Whether constraints can be kept near the present states, which a solver lets drift away from them.  A closer look costs
 * as much as derivatives, and is taken at some of these, and for a while after one that found them out of reach. */
static int is_within_reach(Instance *self, double t) {
    const size_t count = states_of_constraints(self->model);
    const int close = count > 0 && (self->known.suspect > 0 || ++self->known.asked % SELDOM == 0);
    self->known.suspect -= self->known.suspect > 0;
    if (count == 0 || core_keeps(self, t, self->v.y, close ? 1 : UNASKED_DRIFT)) return 1;
    memcpy(self->scratch.projected, self->v.y, count * sizeof *self->v.y);
    if (core_put_onto_constraints(self, t, self->scratch.projected)) return 1;
    self->known.suspect = A_WHILE;
    return 0;
}

Status core_get_derivatives(Instance *self, double f[]) {
    const double t = self->s->time;
    core_start(self);
    const int reached = is_within_reach(self, t);
    const double *kept = core_kept_states(self);
    evaluate(self, derivatives_of(self->model), t, kept, self->d.y);
    if (core_is_singular(self)) core_take_limits(self, derivatives_of(self->model), t, kept, self->d.y, self->model->states);
    for (size_t i = 0; i < self->model->states && kept != self->v.y; i++) self->d.y[i] += RETURN * (kept[i] - self->v.y[i]);
    if (!reached || !core_check_domains(self, t) || !core_check_conditions(self, t, self->v.y, self->model->conditions)
        || !core_check_finite(self, self->d.y, 1, t))
        return core_report(self, DISCARD, "%s", self->words.text);
    memcpy(f, self->d.y, self->model->states * sizeof *f);
    return SUCCESS;
}

void core_get_nominals(Instance *self, double sizes[]) {
    if (self->s->phase < EVENT) {
        core_start(self);
        core_measure(self);
    }
    memcpy(sizes, self->v.size, self->model->states * sizeof *sizes);
}

void core_enter_event_mode(Instance *self) {
    if (self->s->phase == CONTINUOUS) {
        core_remember(self);
        core_follow(self);
    }
    self->s->jumped |= self->s->time >= self->s->limit; /* functions of time inside the component may */
    self->s->phase = EVENT;
    self->s->limit = INFINITY;
    self->known.current = 0;
}

Status core_update_discrete_states(Instance *self, int *changed, double *next) {
    const char *before = (const char *)self->step.backup + ((const char *)self->v.y - (const char *)self->s);
    const int jumps = self->s->jumped, touches = has_contacts(); /* in an event of a contact, perhaps */
    const int samples = self->model->sample != NULL;
    *changed = jumps; /* derivatives have, perhaps: the importer is to start its solver again */
    if (jumps || touches || samples) {
        memcpy(self->step.backup, self->s, self->layout.moving_size);
        self->s->jumped = 1;
        if (touches && self->options.use == USE_MODEL_EXCHANGE) core_uphold_before(self);
        core_compare(self);
        const int taken = core_take_impulses(self);
        if (taken && self->s->jumped && jumps) core_jump(self);
        if (!taken || !core_sample(self) || !core_settle(self, self->s->time) || !core_check_finite(self, self->v.y, 0, self->s->time)
            || (!core_remember(self) && !core_because_infinite(self))) {
            memcpy(self->s, self->step.backup, self->layout.moving_size);
            self->known.current = 0;
            return core_report(self, DISCARD, "%s; set other inputs or states", self->words.text);
        }
        core_follow(self);
        /* Behind the states lies the memory, where the modes of contacts are. */
        *changed |= memcmp(before, self->v.y, (2 * self->model->states + self->model->memory) * sizeof *self->v.y) != 0;
        self->known.current = 0;
    }
    *next = fmin(core_next_instant(self, self->v.k, self->s->time), core_next_rest(self, self->s->time));
    return SUCCESS;
}

void core_enter_continuous_mode(Instance *self) {
    self->s->phase = CONTINUOUS;
    self->s->limit = core_next_instant(self, self->v.k, self->s->time);
    self->known.current = 0;
}

void core_enter_step_mode(Instance *self) {
    self->s->phase = STEP;
    self->known.current = 0;
}

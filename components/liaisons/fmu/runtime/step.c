/* A communication step of co-simulation: the motion of the inputs inside it, and that of the states. */
#include <string.h>

#include "instance.h"
#include "solver.h"
#include "symplectic.h"

/* ---- motion of the inputs ---------------------------------------------------------------------------------- */

static Status check_input_derivative(const Instance *self, unsigned reference, int order, double value) {
    if (core_check_references(self, &reference, 1, 1) != SUCCESS) return ERROR;
    const size_t place = span_of(self, reference).first;
    const char *name = core_name(self, place);
    if (core_variable_at(self->model, place)->kind != INPUT)
        return core_report(self, ERROR, "%s is no input", name);
    if (order < 1 || order > ORDER)
        return core_report(self, ERROR, "derivative of order %d of %s: the order must be 1 to %d", order, name, ORDER);
    if (isfinite(value)) return SUCCESS;
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
        double *taylor = &self->taylor[(span_of(self, references[i]).first - self->model->parameters) * COEFFICIENTS];
        taylor[0] = 1;
        taylor[orders[i]] = values[i];
    }
    self->s->expanded = 1;
    return SUCCESS;
}

/* Derivative with respect to time of a polynomial in the fraction of a step of size H. */
static void differentiate(const double *c, double H, double *derivative) {
    for (int j = 0; j < ORDER; j++) derivative[j] = (j + 1) * c[j + 1] / H;
    derivative[ORDER] = 0;
}

/* Quintic Hermite polynomial: value, rate and acceleration at both ends of the step. */
static void interpolate(const double *u, const double *set, Active at, double H, double *c) {
    c[0] = u[at.value];
    c[1] = H * u[at.rate];
    c[2] = H * H * u[at.acceleration] / 2;
    /* what this parabola misses at the end */
    const double value = set[at.value] - (c[0] + c[1] + c[2]);
    const double rate = H * set[at.rate] - (c[1] + 2 * c[2]);
    const double acceleration = H * H * set[at.acceleration] - 2 * c[2];
    c[3] = 10 * value - 4 * rate + acceleration / 2;
    c[4] = -15 * value + 7 * rate - acceleration;
    c[5] = 6 * value - 3 * rate + acceleration / 2;
}

static int rests(const Instance *self, Active at) {
    const double *u = self->u, *set = self->set;
    if (u[at.rate] != 0 || u[at.acceleration] != 0) return 0;
    return self->s->reconstruction == EXTRAPOLATE
           || (set[at.value] == u[at.value] && set[at.rate] == 0 && set[at.acceleration] == 0);
}

/* The polynomial of an input, which is constant so far. */
static double *polynomial(Instance *self, size_t place) {
    const size_t found = self->mover_of[place];
    if (found < self->moving && self->movers[found].place == place) return self->movers[found].c;
    const Variable *variable = core_variable_at(self->model, self->model->parameters + place);
    self->mover_of[place] = self->moving;
    self->movers[self->moving] = (Mover){.place = place, .variable = variable, .c = {self->u[place]}};
    return self->movers[self->moving++].c;
}

/* A coordinate that an operator prescribes, with its rate and its acceleration. */
static void reconstruct_active(Instance *self, Active at, double H) {
    if (rests(self, at)) return;
    double *value = polynomial(self, at.value), *rate = polynomial(self, at.rate);
    if (self->s->reconstruction == INTERPOLATE) {
        interpolate(self->u, self->set, at, H, value);
    } else {
        value[1] = H * self->u[at.rate];
        value[2] = H * H * self->u[at.acceleration] / 2;
    }
    differentiate(value, H, rate);
    differentiate(rate, H, polynomial(self, at.acceleration));
}

/* The polynomials of all inputs that move in a step of size H, from u and what was set. */
static void reconstruct(Instance *self, double H) {
    const Model *model = self->model;
    const int mode = self->s->reconstruction;
    const double *u = self->u, *set = self->set;
    self->moving = 0;
    for (size_t i = 0; i < model->inputs && mode == INTERPOLATE; i++)
        if (set[i] != u[i]) polynomial(self, i)[1] = set[i] - u[i];
    for (const Active *at = model->active; at < model->active + model->active_rows && mode != HOLD; at++)
        for (size_t i = 0; i < at->count; i++)
            reconstruct_active(self, (Active){at->value + i, at->rate + i, at->acceleration + i, 1, NO_MISMATCH},
                               H);
    for (size_t i = 0; i < model->inputs && mode != INTERPOLATE && self->s->expanded; i++) {
        const double *taylor = &self->taylor[i * COEFFICIENTS];
        if (taylor[0] == 0) continue;
        double *c = polynomial(self, i), factor = 1;
        for (int j = 1; j <= ORDER; j++) c[j] = taylor[j] * (factor *= H / j);
        c[0] = u[i];
    }
}

/* Find the degrees of the polynomials, and leave out those of inputs that do not move after all. */
static void settle_movers(Instance *self) {
    size_t kept = 0;
    for (size_t i = 0; i < self->moving; i++) {
        Mover mover = self->movers[i];
        mover.degree = ORDER;
        while (mover.degree > 0 && mover.c[mover.degree] == 0) mover.degree--;
        if (mover.degree == 0) continue;
        self->mover_of[mover.place] = kept;
        self->movers[kept++] = mover;
    }
    self->moving = kept;
}

/* What the inputs do in this step. */
static int activity(const Instance *self) {
    const Model *model = self->model;
    const size_t first = model->parameters, end = first + model->inputs;
    int found = model->motions[0].all == derivatives_of(model) ? ACTIVITIES - 1 : 0; /* where nothing would be saved */
    for (size_t i = 0; i < self->moving; i++) found |= self->movers[i].variable->activity;
    for (const Variable *input = core_variable_at(model, first); found < ACTIVITIES - 1 && input->first < end; input++)
        for (size_t i = 0; i < input->count; i++)
            if (self->u[input->first - first + i] != 0) found |= input->activity;
    return found;
}

/* The powers 1 to 5 of a polynomial that is 0 at 0, from its values at 1/5, 2/5 ... 1. */
static const double POWERS[ORDER][ORDER] = {
    {25, -25, 50 / 3.0, -25 / 4.0, 1},
    {-1925 / 12.0, 2675 / 12.0, -325 / 2.0, 1525 / 24.0, -125 / 12.0},
    {8875 / 24.0, -7375 / 12.0, 6125 / 12.0, -5125 / 24.0, 875 / 24.0},
    {-4375 / 12.0, 8125 / 12.0, -625, 6875 / 24.0, -625 / 12.0},
    {3125 / 24.0, -3125 / 12.0, 3125 / 12.0, -3125 / 24.0, 625 / 24.0},
};

Status core_give(Instance *self, const unsigned references[], size_t n, const double values[], size_t count) {
    const size_t first = self->model->parameters, end = first + self->model->inputs;
    if (core_check_references(self, references, n, count) != SUCCESS) return ERROR;
    for (size_t i = 0; i < n; i++) {
        const Span span = span_of(self, references[i]);
        if (span.first < first || span.first >= end)
            return core_report(self, ERROR, "%s is no input", core_name(self, span.first));
        for (size_t k = 0; k < span.count; k++)
            self->given[(span.first - first + k) * ORDER + self->asked] = *values++;
    }
    return SUCCESS;
}

/* Ask the importer how inputs move in a step of size H. */
static void ask(Instance *self, double time, double H) {
    for (size_t i = 0; i < self->model->inputs * ORDER; i++) self->given[i] = NAN;
    self->s->phase = ASKING;
    for (self->asked = 0; self->asked < ORDER; self->asked++)
        self->options.ask(self->options.owner, time + H * (double)(self->asked + 1) / ORDER);
    self->s->phase = STEP;
    for (size_t i = 0; i < self->model->inputs; i++) {
        const double *given = &self->given[i * ORDER];
        double sum = 0;
        for (int k = 0; k < ORDER; k++) sum += given[k];
        if (!isfinite(sum)) continue;
        double *c = polynomial(self, i);
        for (int j = 0; j < ORDER; j++) {
            c[j + 1] = 0;
            for (int k = 0; k < ORDER; k++) c[j + 1] += POWERS[j][k] * (given[k] - self->u[i]);
        }
        c[0] = self->u[i];
    }
}

/* What an input is when the part x of the step has passed. */
static inline double input_at(const Mover *mover, double x) {
    double value = mover->c[mover->degree];
    for (int j = mover->degree - 1; j >= 0; j--) value = mover->c[j] + x * value;
    return value;
}

/* u at a time inside the step; 0 if one leaves its domain. */
static int move_inputs(Instance *self, double t) {
    const double x = t / self->step_size;
    for (const Mover *mover = self->movers; mover < self->movers + self->moving; mover++) {
        const double value = input_at(mover, x);
        self->u[mover->place] = value;
        if (!allows(mover->variable, value))
            return core_outside(self, self->model->parameters + mover->place, value, self->step_start + t);
    }
    return 1;
}

/* ---- motion of the states ---------------------------------------------------------------------------------- */

static Signal rates(void *context, double t, const double y[], double f[]) {
    Instance *self = context;
    return (Signal)evaluate(self, self->motion->all, self->step_start + t, y, f);
}

static Signal coupled_rates(void *context, double t, const double y[], double f[]) {
    Instance *self = context;
    return (Signal)evaluate(self, self->motion->coupled, self->step_start + t, y, f);
}

/* The same where inputs move. */
static Signal moved_rates(void *context, double t, const double y[], double f[]) {
    return move_inputs(context, t) ? rates(context, t, y, f) : STOP;
}

static Signal moved_coupled_rates(void *context, double t, const double y[], double f[]) {
    return move_inputs(context, t) ? coupled_rates(context, t, y, f) : STOP;
}

/* Tell the importer of a step of the solver, which may want to end the communication step. */
static Signal observed(Instance *self, double t) {
    double until = INFINITY;
    self->s->time = self->step_start + t;
    self->s->phase = INTERMEDIATE;
    self->current = 0;
    self->returning = self->options.observe(self->options.owner, self->s->time, &until) && self->options.early;
    self->s->time = self->step_start;
    self->s->phase = STEP;
    if (!self->returning) return GO_ON;
    self->reach = fmin(self->reach, fmax(until - self->step_start, t));
    return STOP;
}

static Signal accept(void *context, double t, double y[]) {
    Instance *self = context;
    const Model *model = self->model;
    if (model->conditions == 0 && model->project == NULL && self->options.observe == NULL) return GO_ON;
    if (!move_inputs(self, t)) return STOP;
    if (model->project != NULL) { /* back onto constraints and unit quaternions */
        evaluate(self, model->project, self->step_start + t, y, self->dy);
        memcpy(y, self->dy, model->states * sizeof *y);
        memset(self->low, 0, model->states * sizeof *self->low);
    }
    if (!core_check_conditions(self, self->step_start + t, y, model->conditions)) return STOP;
    return self->options.observe == NULL ? GO_ON : observed(self, t);
}

/* Why no step from a time inside the communication step is small enough. */
static int explain_stuck(Instance *self, double t) {
    const Model *model = self->model;
    const double time = self->step_start + t;
    if (!move_inputs(self, t)) return 0;
    evaluate(self, derivatives_of(model), time, self->y, self->dy);
    if (!core_check_finite(self, self->dy, 1, time)) return 0;
    if (model->conditions > 0) evaluate(self, model->distances, time, self->y, self->condition);
    for (size_t i = 0; i < model->conditions; i++)
        if (self->condition[i] < 1e-3) /* distances from a singularity, of order 1 elsewhere */
            return core_because(self, "%s; at t = %.9g it hardly does (%.3g)", model->condition_texts[i], time,
                                self->condition[i]);
    /* A number that overflows as soon as the states move. */
    for (size_t i = 0; i < model->states; i++) self->work[i] = self->y[i] + 1e-9 * self->step_size * self->dy[i];
    evaluate(self, derivatives_of(model), time, self->work, self->ey);
    if (!core_check_finite(self, self->ey, 1, time)) return 0;
    /* An input that is about to leave its domain, where a singularity lies as a rule. */
    for (double ahead = 1e-12; ahead < 1e-2; ahead *= 10)
        if (!move_inputs(self, t + ahead * self->step_size)) return 0;
    if (self->s->symplectic_steps > 0)
        return core_because(self, "the symplectic step from t = %.9g does not converge: symplectic_steps = %d is not enough",
                            time, (int)self->s->symplectic_steps);
    return core_because(self, "no step from t = %.9g is small enough for the tolerance %g", time, self->s->tolerance);
}

/* What a function of time inside the component changes at an instant, say σ̇, is booked like a jump of the inputs. */
static void pass_instant(Instance *self, double time) {
    const Model *model = self->model;
    self->s->limit = time;
    evaluate(self, model->remember, time, self->y, self->dm);
    memcpy(self->m, self->dm, model->memory * sizeof *self->m);
    self->s->limit = INFINITY;
    evaluate(self, model->jump, time, self->y, self->dy);
    memcpy(self->y, self->dy, model->states * sizeof *self->y);
}

/* From t to the end, in a communication step of a size. */
static Outcome solve(Instance *self, const Problem *problem, double *t, double end, double size) {
    if (self->s->symplectic_steps == 0)
        return solver_advance(problem, t, end, self->y, self->low, &self->s->step, self->work);
    return symplectic_advance(problem, t, end, size / self->s->symplectic_steps, self->y, self->low, self->history,
                              &self->s->known, self->work);
}

static Signal accept_all(void *context, double t, double y[]) {
    (void)context;
    (void)t;
    (void)y;
    return GO_ON;
}

/* Whether a step that is much shorter leads anywhere, where this one has led nowhere; spoils the states. */
static int shorter_leads_on(Instance *self, const Problem *problem) {
    Problem trial = *problem;
    char reason[TEXT];
    double t = 0;
    memcpy(reason, self->text, sizeof reason);
    trial.accept = accept_all; /* the importer is not told */
    for (double size = 1e-3 * self->step_size; t == 0 && size > 1e-13 * self->step_size; size *= 1e-3) {
        self->s->step = 0;
        self->s->known = 0;
        solve(self, &trial, &t, size, size);
    }
    memcpy(self->text, reason, sizeof reason);
    return t > 0;
}

/* The states from the start of the step to where it leads, event by event. */
static int move_states(Instance *self) {
    const double start = self->step_start;
    const int moves = self->moving > 0;
    const Problem problem = {self->model->states, self->model->coupled, SHARE * self->s->tolerance, self->size,
                             moves ? moved_rates : rates, moves ? moved_coupled_rates : coupled_rates, accept, self};
    double t = 0, event = start, end = 0;
    while (t < self->reach) {
        if (t == end) event = core_next_instant(self, event);
        self->s->limit = event;
        end = event < start + self->reach ? event - start : self->reach;
        switch (solve(self, &problem, &t, end, self->step_size)) {
        case STOPPED:
            if (!self->returning) {
                self->curable = t > 0 || shorter_leads_on(self, &problem);
                return 0;
            }
            self->returning = 0;
            break;
        case STUCK:
            explain_stuck(self, t);
            self->curable = t > 0 || shorter_leads_on(self, &problem);
            return 0;
        case EXHAUSTED:
            self->curable = t > 0;
            return core_because(self, "%d solver steps lead no further than t = %.9g: something moves very fast",
                                MOST_STEPS, start + t);
        case REACHED:
            if (t == self->reach) break;
            self->curable = 1;
            if (!move_inputs(self, t)) return 0;
            pass_instant(self, event);
            break;
        }
    }
    return 1;
}

/* ---- the step ---------------------------------------------------------------------------------------------- */

/* A time, moved onto an instant that it means and misses by rounding: 3 * 0.3 is not 0.9. */
static double snapped(double instant, double t) { return fabs(instant - t) <= 1e-12 * (1 + fabs(t)) ? instant : t; }

/* Whether inputs that move stay in their domains for a while. */
static int movers_begin_well(const Instance *self) {
    for (const Mover *mover = self->movers; mover < self->movers + self->moving; mover++)
        if (!allows(mover->variable, input_at(mover, 1e-9))) return 0;
    return 1;
}

/* Whether parameters, and inputs as they are now, are in their domains. */
static int begins_well(const Instance *self) {
    const Model *model = self->model;
    const size_t first = model->parameters, end = first + model->inputs;
    for (const Variable *variable = model->variables; variable->first < end; variable++)
        for (size_t i = variable->first; i < variable->first + variable->count && *variable->domain != '\0'; i++)
            if (!allows(variable, i < first ? self->k[i] : self->u[i - first])) return 0;
    return 1;
}

static int advance(Instance *self, double time, double size) {
    const size_t inputs_size = self->model->inputs * sizeof *self->u;
    const int interpolating = self->s->reconstruction == INTERPOLATE;
    const int with_events = self->options.use == USE_CO_SIMULATION_WITH_EVENTS;
    const double end = time + size, instant = core_next_instant(self, time);
    self->step_start = time;
    self->step_size = size;
    self->reach = with_events && self->options.early && snapped(instant, end) > instant ? instant - time : size;
    self->returning = 0;
    self->s->time = time;
    self->s->limit = INFINITY;
    self->curable = 0;
    if (!core_check_domains(self, interpolating ? end : time)) {
        self->curable = interpolating && begins_well(self); /* values nearer to the present ones may do */
        return 0;
    }
    if (!interpolating && self->apart && memcmp(self->u, self->set, inputs_size) != 0) {
        memcpy(self->u, self->set, inputs_size);
        self->s->jumped = 1;
    }
    if (interpolating) core_compare_ends(self);
    else core_compare(self);
    if (self->s->jumped) {
        core_jump(self);
        if (!core_check_finite(self, self->y, 0, time)) return 0;
    }
    core_depart(self);
    reconstruct(self, size);
    if (self->options.ask != NULL) ask(self, time, size);
    settle_movers(self);
    self->motion = &self->model->motions[activity(self)];
    if (!core_check_conditions(self, time, self->y, self->model->conditions)) return 0;
    if (self->model->states > 0 && !move_states(self)) return 0;
    if (interpolating && self->reach == size)
        memcpy(self->u, self->set, inputs_size);
    else if (!move_inputs(self, self->reach)) {
        self->curable = movers_begin_well(self);
        return 0;
    }
    self->s->time = snapped(instant, self->reach == size ? end : time + self->reach);
    /* At an event that the importer handles, all is taken from its left until it does. */
    self->s->limit = with_events && self->s->time == instant ? instant : INFINITY;
    if (self->model->events > 0 && !with_events
        && core_next_instant(self, nextafter(self->s->time, -INFINITY)) == self->s->time)
        pass_instant(self, self->s->time);
    core_arrive(self);
    self->curable = self->model->states > 0;
    if (!core_check_finite(self, self->y, 0, self->s->time)) return 0;
    if (!core_remember(self)) return core_because_infinite(self);
    if (self->s->expanded) memset(self->taylor, 0, COEFFICIENTS * inputs_size);
    self->s->expanded = 0;
    self->apart = self->moving > 0;
    return 1;
}

Status core_step(Instance *self, double time, double size, Arrival *arrival) {
    if (!(size > 0 && isfinite(size)))
        return core_report(self, ERROR, "step size = %g: it must be > 0 and finite", size);
    if (!isfinite(time)) return core_report(self, ERROR, "step from t = %s: it must be finite", core_spelled(time));
    if (!isfinite(time + size))
        return core_report(self, ERROR, "step from t = %.15g of size %g: it must end at a finite time", time, size);
    if (!(fabs(time - self->s->time) <= 1e-6 * size + 1e-12 * fabs(time))) /* rounding of the importer's clock */
        return core_report(self, ERROR, "step from t = %.15g: the instance is at t = %.15g", time, self->s->time);
    if (!(time + size > time))
        return core_report(self, ERROR, "step size = %g: it is too small to lead on from t = %.15g", size, time);
    core_warn(self);
    memcpy(self->backup, self->s, self->moving_size);
    if (advance(self, time, size)) {
        self->current = 0;
        self->discarded_from = NAN;
        *arrival = (Arrival){self->s->time, self->reach < size, self->s->time == self->s->limit};
        return SUCCESS;
    }
    memcpy(self->s, self->backup, self->moving_size);
    self->current = 0;
    const int again = self->s->time == self->discarded_from && size > self->discarded_size * (1 - 1e-9);
    const Status status = self->curable && !again ? DISCARD : ERROR;
    if (status == DISCARD) {
        self->discarded_from = self->s->time;
        self->discarded_size = size;
    }
    return core_report(self, status, "%s; the step from t = %.9g is taken back", self->text, time);
}

/* A communication step of co-simulation. */
#include <stdlib.h>
#include <string.h>

#include "events.h"
#include "impulses.h"
#include "inputs.h"
#include "stiff.h"
#include "symplectic.h"
#include "unilateral.h"

/* ---- motion of the states ---------------------------------------------------------------------------------- */

/* Rates of all states. */
static Signal rates(void *context, double t, const double y[], double f[]) {
    Instance *self = context;
    return (Signal)evaluate(self, self->step.motion->all, self->step.start + t, y, f);
}

/* Rates of the states that act on the motion. */
static Signal coupled_rates(void *context, double t, const double y[], double f[]) {
    Instance *self = context;
    return (Signal)evaluate(self, self->step.motion->coupled, self->step.start + t, y, f);
}

/* Rates of all states, where inputs move. */
static Signal moved_rates(void *context, double t, const double y[], double f[]) {
    return move_inputs(context, t) ? rates(context, t, y, f) : STOP;
}

/* Rates of the states that act on the motion, where inputs move. */
static Signal moved_coupled_rates(void *context, double t, const double y[], double f[]) {
    return move_inputs(context, t) ? coupled_rates(context, t, y, f) : STOP;
}

/* Rates of all states, where inputs move otherwise than their rates say, and constraints may lose rank. */
static Signal corrected_rates(void *context, double t, const double y[], double f[]) {
    Instance *self = context;
    if (!move_inputs(self, t)) return STOP;
    rates(self, t, y, f);
    if (core_is_singular(self))
        core_take_limits(self, self->step.motion->all, self->step.start + t, y, f, self->model->states);
    core_correct_work(self, t, y, f);
    return GO_ON;
}

/* Replace n rates that were calculated last, where constraints lose rank, by their limits. */
static Signal limited(Instance *self, Function *function, size_t n) {
    core_take_limits(self, function, self->call.now, self->call.arguments[1], self->call.results[0], n);
    return GO_ON;
}

/* Rates of all states, where constraints may lose rank. */
static Signal guarded_rates(void *context, double t, const double y[], double f[]) {
    Instance *self = context;
    rates(self, t, y, f);
    return self->call.margin < NARROW ? limited(self, self->step.motion->all, self->model->states) : GO_ON;
}

/* Rates of the states that act on the motion, where constraints may lose rank. */
static Signal guarded_coupled_rates(void *context, double t, const double y[], double f[]) {
    Instance *self = context;
    coupled_rates(self, t, y, f);
    return self->call.margin < NARROW ? limited(self, self->step.motion->coupled, self->model->coupled) : GO_ON;
}

/* These two, where inputs move. */
static Signal moved_guarded_rates(void *context, double t, const double y[], double f[]) {
    Instance *self = context;
    if (moved_rates(self, t, y, f) == STOP) return STOP;
    return self->call.margin < NARROW ? limited(self, self->step.motion->all, self->model->states) : GO_ON;
}

static Signal moved_guarded_coupled_rates(void *context, double t, const double y[], double f[]) {
    Instance *self = context;
    if (moved_coupled_rates(self, t, y, f) == STOP) return STOP;
    return self->call.margin < NARROW ? limited(self, self->step.motion->coupled, self->model->coupled) : GO_ON;
}

/* Tell the importer of a step of the solver, which may want to end the communication step. */
static Signal intermediate_update(Instance *self, double t) {
    double until = INFINITY;
    self->s->time = self->step.start + t;
    self->s->phase = INTERMEDIATE;
    self->known.current = 0;
    self->step.returning = self->options.step_finished(self->options.owner, self->s->time, &until) && self->options.early;
    self->s->time = self->step.start;
    self->s->phase = STEP;
    if (!self->step.returning) return GO_ON;
    self->step.reach = fmin(self->step.reach, fmax(until - self->step.start, t));
    return STOP;
}

/* Book the work of a projection from y to d.y: where σ is held, it takes back what σ̇ has moved. */
static void book_projection(Instance *self, double time, const double y[]) {
    const Model *model = self->model;
    double *projected = self->d.y;
    const Account *const end = model->account + model->account_rows;
    evaluate(self, model->calculate, time, y, self->v.z);
    for (const Account *account = model->account; account < end; account++)
        projected[account->work] -= self->v.z[account->energy];
    evaluate(self, model->calculate, time, projected, self->v.z);
    for (const Account *account = model->account; account < end; account++)
        projected[account->work] += self->v.z[account->energy];
    self->known.current = 0;
}

/* After a step of the solver: project the states, check conditions, tell the importer. */
static Signal accept(void *context, double t, double y[]) {
    Instance *self = context;
    const Model *model = self->model;
    if (model->indicators + model->conditions == 0 && model->project == NULL && self->options.step_finished == NULL)
        return GO_ON;
    if (!move_inputs(self, t)) return STOP;
    if (model->project != NULL) { /* back onto constraints and unit quaternions */
        evaluate(self, model->project, self->step.start + t, y, self->d.y);
        if (self->step.apart) book_projection(self, self->step.start + t, y);
        memcpy(y, self->d.y, model->states * sizeof *y);
        memset(self->v.low, 0, model->states * sizeof *self->v.low);
        if (!core_put_onto_constraints(self, self->step.start + t, y)) {
            self->step.torn = 1;
            return STOP;
        }
        memcpy(self->scratch.anchor, y, states_of_constraints(model) * sizeof *y);
        self->step.kept_until = t;
    }
    if (has_contacts()) core_uphold(self, self->step.start + t);
    if (!core_check_conditions(self, self->step.start + t, y, model->conditions)) return STOP;
    return self->options.step_finished == NULL ? GO_ON : intermediate_update(self, t);
}

/* Event indicators at a time and state inside the step; 0 if inputs leave their domain there. */
static int watch(void *context, double t, const double y[], double values[]) {
    Instance *self = context;
    if (!move_inputs(self, t)) return 0;
    evaluate(self, self->model->indicate, self->step.start + t, y, values);
    return 1;
}

/* Find the first instant, a part of the step ahead of t at most, at which what is prescribed leads out of reach; 1 if
 * there is none. */
static int stays_in_reach(Instance *self, double t, double part) {
    const size_t size = states_of_constraints(self->model) * sizeof *self->v.y;
    double good = t, bad = INFINITY;
    if (size == 0) return 1;
    memcpy(self->scratch.anchor, self->v.y, size);
    for (double ahead = 1e-12 * part; bad == INFINITY || bad - good > 1e-12 * self->step.size; ahead *= 10) {
        const double next = bad < INFINITY ? (good + bad) / 2 : t + fmin(ahead, part) * self->step.size;
        if (!move_inputs(self, next)) return 0;
        memcpy(self->scratch.projected, self->scratch.anchor, size);
        if (core_put_onto_constraints(self, self->step.start + next, self->scratch.projected)) {
            if (bad == INFINITY && ahead >= part) return 1;
            memcpy(self->scratch.anchor, self->scratch.projected, size);
            good = next;
        } else
            bad = next;
    }
    return 0;
}

/* How far ahead of a solver that gets nowhere a reason is looked for, in parts of the communication step. */
static const double AHEAD = 1e-2;

/* Report why no step from a time inside the communication step is small enough; 1 if that is all that is known. */
static int explain_stuck(Instance *self, double t) {
    const Model *model = self->model;
    const double time = self->step.start + t;
    if (!move_inputs(self, t)) return 0;
    evaluate(self, derivatives_of(model), time, self->v.y, self->d.y);
    if (!core_check_finite(self, self->d.y, 1, time)) return 0;
    if (model->conditions > 0) evaluate(self, model->distances, time, self->v.y, self->scratch.condition);
    for (size_t i = 0; i < model->conditions; i++)
        if (self->scratch.condition[i] < 1e-3) /* distances from a singularity, of order 1 elsewhere */
            return core_because(self, "%s; at t = %.9g it hardly does (%.3g)", model->condition_texts[i], time,
                                self->scratch.condition[i]);
    if (!stays_in_reach(self, t, self->s->symplectic_steps > 0 ? 1. / self->s->symplectic_steps : AHEAD)) return 0;
    if (!move_inputs(self, t)) return 0;
    /* A number that overflows as soon as the states move. */
    for (size_t i = 0; i < model->states; i++)
        self->scratch.work[i] = self->v.y[i] + 1e-9 * self->step.size * self->d.y[i];
    evaluate(self, derivatives_of(model), time, self->scratch.work, self->e.y);
    if (!core_check_finite(self, self->e.y, 1, time)) return 0;
    /* An input that is about to leave its domain, where a singularity lies as a rule. */
    for (double ahead = 1e-12; ahead < 1e-2; ahead *= 10)
        if (!move_inputs(self, t + ahead * self->step.size)) return 0;
    if (self->s->symplectic_steps > 0)
        return core_because(self,
                            "the symplectic step from t = %.9g does not converge: symplectic_steps = %d is not enough",
                            time, (int)self->s->symplectic_steps);
    core_because(self, "no step from t = %.9g is small enough for the tolerance %g", time, self->s->tolerance);
    return 1;
}

/* Report that too many steps are needed. */
static int explain_exhausted(Instance *self, double t, const char *what) {
    self->step.curable = t > 0;
    if (!stays_in_reach(self, t, 1)) return 0;
    return core_because(self, "more than %d %s are needed beyond t = %.9g: something moves very fast", MOST_STEPS, what,
                        self->step.start + t);
}

/* Book what a function of time inside the component changes at an instant, say σ̇, like a jump of the inputs. */
static void pass_instant(Instance *self, double time) {
    const Model *model = self->model;
    self->s->limit = time;
    evaluate(self, model->remember, time, self->v.y, self->d.m);
    memcpy(self->v.m, self->d.m, model->memory * sizeof *self->v.m);
    self->s->limit = INFINITY;
    evaluate(self, model->jump, time, self->v.y, self->d.y);
    memcpy(self->v.y, self->d.y, model->states * sizeof *self->v.y);
}

/* Part of the square of a rate. */
static const double ROUGH = 1e-6;

/* Whether the integral of a rate times its acceleration, half of the change of its square, is missed by three points:
 * it is the greatest part of an operator's work where the rate hardly moves but for a jump that is interpolated. */
static int moves_roughly(void *context, double t, double h) {
    static const double NODES[] = {0.1127016653792583, 0.5, 0.8872983346207417}, WEIGHTS[] = {5 / 18., 8 / 18., 5 / 18.};
    Instance *self = context;
    for (const Prescribed *p = self->prescribed.list; p < self->prescribed.list + self->prescribed.count; p++) {
        const Mover *mover = mover_of(self, p->rate);
        if (mover == NULL) continue;
        const double x = t / self->step.size, part = h / self->step.size;
        const double begin = input_at(mover, x), end = input_at(mover, x + part);
        double sum = 0, greatest = fmax(begin * begin, end * end);
        for (int i = 0; i < 3; i++) {
            const double at = x + part * NODES[i];
            sum += WEIGHTS[i] * part * input_slope(mover, at) * input_at(mover, at);
        }
        if (fabs(sum - (end * end - begin * begin) / 2) > ROUGH * greatest) return 1;
    }
    return 0;
}

/* Set the inputs that jump at the end of an interpolated step, from where their rates have led. */
static void leap_to_inputs(Instance *self) {
    const Model *model = self->model;
    evaluate(self, model->remember, self->s->time, self->v.y, self->d.m);
    memcpy(self->v.m, self->d.m, model->memory * sizeof *self->v.m);
    core_reach(self);
    core_jump(self);
}

/* Jacobian of the rates of all states, where inputs move. */
static Signal jacobian(void *context, double t, const double y[], double J[]) {
    Instance *self = context;
    if (!move_inputs(self, t)) return STOP;
    core_jacobian(self, self->step.start + t, y, J);
    return GO_ON;
}

/* Warn, once, that the motion is stiff. */
static void report_stiffness(void *context, double t) {
    Instance *self = context;
    if (self->s->stiffness_reported) return;
    self->s->stiffness_reported = 1;
    core_report(self, WARNING, "the motion is stiff at t = %.9g: with stiff_solver = 1 it may take far fewer steps",
                self->step.start + t);
}

/* Multiple of a time in which constraints may lose rank, if coordinates go on at their rates, for what these leave out. */
static const double EARLY = 2;

/* Whether constraints may lose rank within a time, which steps of one size would pass over: their gradients change by 1
 * where coordinates do by their sizes. */
static int may_lose_rank(Instance *self, const Problem *problem, double t, double within) {
    double *f = self->d.y, fastest = 0;
    if (!self->model->guarded || problem->coupled_rates(self, t, self->v.y, f) == STOP) return 0;
    for (size_t i = 0; i < self->model->coupled; i++)
        if (self->model->configuration[i]) fastest = fmax(fastest, fabs(f[i]) / self->v.size[i]);
    return sqrt(self->call.margin) < EARLY * within * fastest;
}

/* Integrate from t to the end, in a communication step of a size. */
static Outcome solve(Instance *self, const Problem *problem, double *t, double end, double size) {
    if (self->s->stiff_solver)
        return stiff_advance(problem, jacobian, self->stiff, t, end, self->v.y, self->v.low, &self->s->step,
                             self->scratch.work);
    if (self->s->symplectic_steps == 0 || may_lose_rank(self, problem, *t, end - *t)) {
        self->s->known = 0;
        return solver_advance(problem, t, end, self->v.y, self->v.low, &self->s->step, self->scratch.work);
    }
    Rough *rough = self->s->reconstruction == INTERPOLATE && self->movers.count > 0 ? moves_roughly : NULL;
    return symplectic_advance(problem, rough, t, end, size / self->s->symplectic_steps, self->v.y, self->v.low,
                              self->v.history, &self->s->known, self->scratch.work);
}

/* Stop after one step, without telling the importer. */
static Signal accept_one(void *context, double t, double y[]) {
    (void)context;
    (void)t;
    (void)y;
    return STOP;
}

/* Whether a much shorter step succeeds, where this one has failed; spoils the states. */
static int shorter_leads_on(Instance *self, const Problem *problem) {
    Problem trial = *problem;
    char reason[TEXT];
    double t = 0;
    memcpy(reason, self->words.text, sizeof reason);
    trial.accept = accept_one;
    for (double size = 1e-3 * self->step.size; t == 0 && size > 1e-13 * self->step.size; size *= 1e-3) {
        self->s->step = 0;
        self->s->known = 0;
        solve(self, &trial, &t, size, size);
    }
    memcpy(self->words.text, reason, sizeof reason);
    return t > 0;
}

/* A step of the solver, relative to the communication step, that is as good as none. */
static const double SHORTEST = 1e-10;

/* Go back to where the constraints were kept last, for a shorter step of the solver; 0 if that is what cannot be kept. */
static int try_shorter(Instance *self, double *t) {
    const double size = *t - self->step.kept_until;
    *t = self->step.kept_until;
    memcpy(self->v.y, self->scratch.anchor, self->model->states * sizeof *self->v.y);
    memset(self->v.low, 0, self->model->states * sizeof *self->v.low);
    self->s->step = size / 4;
    self->s->known = 0;
    if (self->s->symplectic_steps == 0) return size > SHORTEST * self->step.size;
    stays_in_reach(self, *t, size / self->step.size);
    return 0;
}

/* Distance of neighbouring times inside the step. */
static double clock_resolution(const Step *step) {
    const double latest = fmax(fabs(step->start), fabs(step->start + step->size));
    return nextafter(latest, INFINITY) - latest;
}

static void note_event(void *context, double t, long which) {
    Instance *self = context;
    if (which < 0) core_note_graze(self, self->step.start + t);
    else self->contacts.crossed = which + 1;
}

/* Integrate the states from the start of the step to its end, event by event. */
static int move_states(Instance *self) {
    const double start = self->step.start;
    const int moves = self->movers.count > 0;
    const size_t indicators = self->model->indicators;
    Events events;
    if (has_contacts())
        events = (Events){events_shorten, indicators, watch, clock_resolution(&self->step),
                          self->contacts.record != NULL ? note_event : NULL};
    Problem problem = {self->model->states, self->model->coupled, SHARE * self->s->tolerance, self->v.size,
                       moves ? moved_rates : rates, moves ? moved_coupled_rates : coupled_rates, accept, self,
                       has_contacts() ? &events : NULL, report_stiffness};
    if (self->model->guarded) {
        problem.rates = moves ? moved_guarded_rates : guarded_rates;
        problem.coupled_rates = moves ? moved_guarded_coupled_rates : guarded_coupled_rates;
    }
    if (self->step.apart) problem.rates = corrected_rates;
    double t = 0, event = start, end = 0;
    Pace pace = {0, 0, 0};
    if (self->s->stiff_solver && self->stiff == NULL) {
        self->stiff = stiff_new(self->model->states, self->model->coupled);
        if (self->stiff == NULL) return core_because(self, "out of memory for the stiff solver");
    }
    while (t < self->step.reach) {
        memcpy(self->scratch.anchor, self->v.y, states_of_constraints(self->model) * sizeof *self->v.y);
        self->step.kept_until = t;
        self->step.torn = 0;
        if (solver_is_exhausted(&pace, t, self->step.reach)) return explain_exhausted(self, t, "events");
        if (t == end) event = core_next_instant(self, self->v.k, event);
        self->s->limit = event;
        end = event < start + self->step.reach ? event - start : self->step.reach;
        switch (solve(self, &problem, &t, end, self->step.size)) {
        case STOPPED:
            if (self->step.torn && try_shorter(self, &t)) break;
            if (!self->step.returning) {
                self->step.curable = t > 0 || shorter_leads_on(self, &problem);
                return 0;
            }
            self->step.returning = 0;
            break;
        case STUCK: {
            const int unexplained = explain_stuck(self, t);
            self->step.curable = t > 0 || shorter_leads_on(self, &problem);
            if (unexplained && t == 0 && self->step.curable)
                core_because(self,
                             "the communication step of %.6g s is too long: from t = %.9g the tolerance %g asks for solver "
                             "steps of less than %.0e of it; choose a shorter one",
                             self->step.size, start, self->s->tolerance, SMALLEST);
            return 0;
        }
        case EXHAUSTED:
            return explain_exhausted(self, t, "solver steps");
        case CROSSED:
            if (self->options.use == USE_CO_SIMULATION_WITH_EVENTS && self->options.early) {
                self->step.reach = t;
                self->step.event = 1;
                return 1;
            }
            if (!move_inputs(self, t) || !core_settle(self, start + t)) {
                self->step.curable = t > 0;
                return 0;
            }
            break;
        case REACHED:
            if (t == self->step.reach) break;
            self->step.curable = 1;
            if (!move_inputs(self, t)) return 0;
            pass_instant(self, event);
            if (!core_settle(self, event)) return 0;
            break;
        }
    }
    return 1;
}

/* ---- the step ---------------------------------------------------------------------------------------------- */

/* A time, moved onto an instant that it misses by rounding: 3 * 0.3 is not 0.9. */
static double snapped(double instant, double t) { return fabs(instant - t) <= 1e-12 * (1 + fabs(t)) ? instant : t; }

/* Whether inputs that move stay in their domains at first. */
static int movers_begin_well(const Instance *self) {
    for (const Mover *mover = self->movers.list; mover < self->movers.list + self->movers.count; mover++)
        if (!allows(mover->variable, input_at(mover, 1e-9))) return 0;
    return 1;
}

/* Whether parameters, and inputs as they are now, are in their domains. */
static int begins_well(const Instance *self) {
    const Model *model = self->model;
    const size_t first = model->parameters, end = first + model->inputs;
    for (const Variable *variable = model->variables; variable->first < end; variable++)
        for (size_t i = variable->first; i < variable->first + variable->count && *variable->domain != '\0'; i++)
            if (!allows(variable, i < first ? self->v.k[i] : self->v.u[i - first])) return 0;
    return 1;
}

/* Whether the outputs of a component without states are finite; its functions of time may overflow. */
static int outputs_are_finite(Instance *self) {
    const Model *model = self->model;
    const size_t outputs = model->outputs - model->drawn;
    core_update(self);
    if (all_finite(self->v.z, outputs)) return 1;
    core_because_infinite(self);
    evaluate(self, model->calculate, self->step.start, self->v.y, self->v.z);
    self->step.curable = all_finite(self->v.z, outputs);
    return 0;
}

/* Say, where several samples were passed, that the step is long: what divides their period would be very short. */
static void explain_passed_samples(Instance *self) {
    const Model *model = self->model;
    const double first = core_next_instant(self, self->v.k, self->step.start);
    const double second = core_next_instant(self, self->v.k, first);
    size_t i = 0;
    while (i + 1 < model->conditions && self->scratch.condition[i] > 0) i++;
    if (second < self->s->time && strstr(model->condition_texts[i], "each sample") != NULL)
        core_because(self, "%s, or a longer period: before t = %.9g there are samples at t = %.9g, %.9g and so on",
                     model->condition_texts[i], self->s->time, first, second);
}

/* At the end of a step: whether it has passed no sample; that of its end if the inputs of this instant are known. */
static int take_last_sample(Instance *self, int inputs_known) {
    self->step.curable = 1;
    if (!core_check_conditions(self, self->s->time, self->v.y, self->model->conditions)) {
        explain_passed_samples(self);
        return 0;
    }
    if (self->options.use == USE_CO_SIMULATION_WITH_EVENTS || (self->model->inputs > 0 && !inputs_known)) return 1;
    return core_sample(self);
}

/* Take a communication step; 0 with a reason if it is refused, and then the instance has to be restored. */
static int advance(Instance *self, double time, double size) {
    const size_t inputs_size = self->model->inputs * sizeof *self->v.u;
    const int interpolating = self->s->reconstruction == INTERPOLATE;
    const int with_events = self->options.use == USE_CO_SIMULATION_WITH_EVENTS;
    const double end = time + size, next = core_next_instant(self, self->v.k, time);
    const double instant = with_events ? fmin(next, core_next_rest(self, time)) : next;
    self->step.start = time;
    self->step.size = size;
    self->step.reach = with_events && self->options.early && snapped(instant, end) > instant ? instant - time : size;
    self->step.returning = 0;
    self->s->time = time;
    self->s->limit = INFINITY;
    self->step.curable = 0;
    if (!core_check_domains(self, interpolating ? end : time)) {
        self->step.curable = interpolating && begins_well(self); /* values nearer to the present ones may do */
        return 0;
    }
    if (!interpolating && self->known.apart && memcmp(self->v.u, self->v.set, inputs_size) != 0) {
        memcpy(self->v.u, self->v.set, inputs_size);
        self->s->jumped = 1;
    }
    const int stays = self->known.rests; /* then nothing is to be done for inputs */
    const int rests = stays || (!interpolating && core_look(self));
    const int leaps = interpolating && core_compare_ends(self);
    if (!interpolating && !stays) core_compare(self);
    if (!stays && !core_take_impulses(self)) return 0;
    if (self->s->jumped) {
        core_jump(self);
        if (!core_check_finite(self, self->v.y, 0, time) || !core_put_onto_constraints(self, time, self->v.y)) return 0;
    }
    self->step.event = 0;
    if (!core_sample(self) || !core_settle(self, time)) return 0;
    if (!stays) {
        core_depart(self);
        core_reconstruct(self, size);
        if (self->options.request_inputs != NULL) core_request_inputs(self, time, size);
        core_settle_movers(self);
        self->step.apart = core_moves_apart(self);
        self->step.motion = &self->model->motions[core_activity(self)];
    }
    if (!core_check_conditions(self, time, self->v.y, self->model->conditions)) return 0;
    if (self->model->states > 0 && !move_states(self)) return 0;
    const int arrives = interpolating && self->step.reach == size;
    if (arrives && !leaps)
        core_reach(self);
    else if (!move_inputs(self, self->step.reach)) {
        self->step.curable = movers_begin_well(self);
        return 0;
    }
    self->s->time = snapped(instant, self->step.reach == size ? end : time + self->step.reach);
    /* At an event that the importer handles, all is taken from its left until it does. */
    self->s->limit = with_events && self->s->time == instant ? instant : INFINITY;
    if (self->model->events > 0 && !with_events
        && core_next_instant(self, self->v.k, nextafter(self->s->time, -INFINITY)) == self->s->time)
        pass_instant(self, self->s->time);
    if (stays) core_stay(self);
    else core_arrive(self);
    if (self->model->sample != NULL && !take_last_sample(self, arrives)) return 0;
    if (self->step.event || (with_events && core_is_unsettled(self, self->s->time))) self->s->limit = self->s->time;
    if (arrives && leaps) leap_to_inputs(self);
    if (arrives && leaps && !core_put_onto_constraints(self, self->s->time, self->v.y)) return 0;
    if (arrives && leaps && !core_settle(self, self->s->time)) return 0;
    self->step.curable = self->model->states > 0;
    if (!core_check_finite(self, self->v.y, 0, self->s->time)) return 0;
    if (!core_remember(self)) return core_because_infinite(self);
    if (self->s->expanded) memset(self->v.taylor, 0, COEFFICIENTS * inputs_size);
    self->s->expanded = 0;
    self->known.apart = self->movers.count > 0;
    self->known.rests = rests && !self->known.apart && self->options.request_inputs == NULL;
    self->known.current = 0;
    if (self->model->states == 0) return outputs_are_finite(self);
    return !(self->call.margin < WIDE) || core_has_limits(self); /* it is that of the last stage of the solver */
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
    if (!self->known.rests) core_warn(self, 0);
    memcpy(self->step.backup, self->s, self->layout.moving_size);
    if (advance(self, time, size)) {
        self->step.discarded_from = NAN;
        if (self->starts != NULL) {
            free(self->starts);
            self->starts = NULL;
        }
        *arrival = (Arrival){self->s->time, self->step.reach < size, self->s->time == self->s->limit};
        return !self->known.rests && core_tell(self) ? WARNING : SUCCESS;
    }
    memcpy(self->s, self->step.backup, self->layout.moving_size);
    self->known.current = self->known.rests = 0;
    self->known.derives = 1;
    const int again = self->s->time == self->step.discarded_from && size > self->step.discarded_size * (1 - 1e-9);
    const Status status = self->step.curable && !again ? DISCARD : ERROR;
    if (status == DISCARD) {
        self->step.discarded_from = self->s->time;
        self->step.discarded_size = size;
    }
    return core_report(self, status, "%s; the step from t = %.9g is taken back", self->words.text, time);
}

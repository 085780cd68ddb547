/* Unilateral liaisons and dry friction: impacts and modes at an event.
 *
 * Rates v of the contacts jump by G Λ at an impact, and change by a + G x under forces x.  Which of them push, stick or
 * slide is a complementarity problem. */
#include "unilateral.h"

#include <string.h>

#include "complementarity.h"

enum { NEWTON_STEPS = 5 }; /* that put a gap to 0 */

/* Parts of the scale of a position: where Newton's method goes on, and what an importer that looks for events may be late. */
static const double FAR = 1e-9, LATE = 0.1;
/* A component does not start with a gap between these parts of its rounding, which would not be followed. */
static const double COARSE[] = {0.1, 100};
/* What an importer may be off, in tolerances; a gap that opens slower is an event only where it overlaps by more. */
static const double ERRORS = 10;
/* What an importer may be off that hands over impulses: a gap below this part of its scale touches. */
static const double NEAR = 1e-11;
/* What modes are chosen by is 0 in a record below this part of its scale. */
static const double DEGENERATE = 1e-9;

static const char *name_of(const Model *model, size_t i) {
    return i < model->gaps ? model->gap[i].name : model->friction[i - model->gaps].name;
}

/* ---- what the component says ------------------------------------------------------------------------------------ */

/* Calculate the numbers of all contacts at the present state. */
static void inspect(Instance *self, double time) {
    const Model *model = self->model;
    const ContactNumbers *c = &self->contacts.numbers;
    const size_t n = model->indicators, momenta = model->momenta;
    double *G = self->contacts.all + model->rows.G;
    evaluate(self, model->contact, time, self->v.y, self->contacts.all);
    if (momenta > 0) memset(G, 0, n * n * sizeof *G);
    for (size_t j = 0; j < n; j++)
        for (size_t k = 0; k < momenta; k++)
            for (size_t i = 0; i < n; i++) G[i + n * j] += c->rates_by_momenta[i + n * k] * c->momenta_by_forces[k + momenta * j];
}

/* Address of a mode in the memory, 1: closed, 0: open; below 0: open, and overlaps by less than this part of its scale
 * are no event. */
static double *closed_of(const Instance *self, size_t i) { return &self->v.m[self->model->gap[i].closed]; }

static int is_closed(const Instance *self, size_t i) { return *closed_of(self, i) > 0; }

/* Read the modes from the memory. */
static void read_modes(const Instance *self, Modes modes) {
    const Model *model = self->model;
    for (size_t i = 0; i < model->gaps; i++) modes[i] = is_closed(self, i) ? CLOSED : OPEN;
    for (size_t i = 0; i < model->frictions; i++)
        modes[model->gaps + i] = (signed char)self->v.m[model->friction[i].direction];
}

/* Begin the problem of all contacts, of which none is to be chosen yet; what has no value yet is not cleared, for that
 * would take as long as an impact. */
static void begin_problem(const Instance *self, int impulses, Complementarity *p) {
    const Model *model = self->model;
    const ContactNumbers *c = &self->contacts.numbers;
    p->gaps = model->gaps;
    p->contacts = model->indicators;
    p->G = c->G;
    p->stick = impulses ? c->slide : c->stick;
    p->slide = c->slide;
    p->impulses = impulses;
    for (size_t i = 0; i < model->frictions; i++) p->normal[i] = model->friction[i].normal;
    p->n = 0;
}

/* ---- the record ----------------------------------------------------------------------------------------------------- */

/* Add a record of contacts in some modes; what they do in it, or NULL: there is no room. */
static ContactAct *note(Instance *self, double time, long kind, long which, double scale, const Modes modes) {
    const Model *model = self->model;
    ContactRecord *record = self->contacts.record;
    const size_t k = record->count++;
    if (k >= record->most) return NULL;
    ContactAct *acts = record->acts + k * model->indicators;
    record->events[k] = (ContactEvent){time, scale, kind, which};
    for (size_t i = 0; i < model->indicators; i++)
        acts[i] = (ContactAct){.mode = modes[i], .rests_from = i < model->gaps ? self->v.m[model->gap[i].rests_from] : 0};
    return acts;
}

void core_note_graze(Instance *self, double time) {
    static const Modes NONE;
    note(self, time, GRAZED, -1, 0, NONE);
}

/* Add the rates before an impact, and what it does, to a record. */
static void note_impact(Instance *self, ContactAct acts[], const double before[], const double x[]) {
    const ContactNumbers *c = &self->contacts.numbers;
    for (size_t i = 0; i < self->model->indicators && acts != NULL; i++) {
        const int gap = i < self->model->gaps;
        acts[i].impulse = x[i];
        acts[i].approaches = gap && before[i] < 0;
        acts[i].counts = gap && x[i] > 0 && contact_counts(c, i, before[i]);
    }
}

/* Whether a contact can have a force, by the gaps that touch, or are closed. */
static int presses(const Model *model, const int touching[], size_t i) {
    const long normal = i < model->gaps ? (long)i : model->friction[i - model->gaps].normal;
    return normal < 0 || touching[normal];
}

/* Add records of those contacts whose modes are chosen by numbers that are 0: forces of what is closed, rates of what is
 * not, in units of rates.  before: an impact; or NULL. */
static void note_choice(Instance *self, double time, const Complementarity *p, const Modes modes, const double x[],
                        const double rate[], const double before[]) {
    const ContactNumbers *c = &self->contacts.numbers;
    int closed[MOST_CONTACTS];
    for (size_t i = 0; i < p->gaps; i++) closed[i] = modes[i] == CLOSED;
    for (size_t k = 0; k < p->n; k++) {
        const size_t i = p->contact[k];
        const int gap = i < p->gaps;
        const long normal = gap ? -1 : p->normal[i - p->gaps];
        const double least = gap ? 0 : p->stick[i - p->gaps] * (normal >= 0 ? x[normal] : 1);
        const double spare = gap ? x[i] : least - fabs(x[i]), scale = (before != NULL ? c->rate_scale : c->acceleration_scale)[i];
        const double slack = complementarity_holds(p, modes, i) ? spare * c->G[i * (p->contacts + 1)] : (gap ? 1 : modes[i]) * rate[i];
        if (slack > DEGENERATE * scale || !(gap || presses(self->model, closed, i))) continue;
        ContactAct *acts = note(self, time, before != NULL ? WEAK_IMPACT : WEAK_REST, (long)i, scale, modes);
        if (before != NULL) note_impact(self, acts, before, x);
    }
}

/* Add records of gaps that touch beside the one that has ended the step. */
static void note_touching(Instance *self, double time, const int touching[], const int was_closed[]) {
    const Modes none = {0};
    for (size_t i = 0; i < self->model->gaps; i++)
        if (touching[i] && !was_closed[i] && (long)i + 1 != self->contacts.crossed)
            note(self, time, WEAK_GAP, (long)i, self->contacts.numbers.scale[i], none);
}

/* Add records of the modes at the end of an event, and of rates that are 0 beside the one that has ended the step. */
static void note_settled(Instance *self, double time, const int touching[], const Modes before, const Modes modes) {
    const ContactNumbers *c = &self->contacts.numbers;
    const int started = self->s->phase >= EVENT;
    Complementarity p;
    begin_problem(self, 0, &p);
    for (size_t i = 0; i < p.contacts; i++) {
        const int holds = started && complementarity_holds(&p, before, i);
        if (fabs(c->v[i]) <= STILL * c->rate_scale[i] && !holds && (long)i + 1 != self->contacts.crossed
            && presses(self->model, touching, i))
            note(self, time, WEAK_RATE, (long)i, c->rate_scale[i], modes);
    }
    note(self, time, SETTLED, self->contacts.crossed - 1, 0, modes);
}

/* ---- states that jump --------------------------------------------------------------------------------------------- */

static const double NOTHING[MOST_CONTACTS];

/* Call the function of the component that gives states after impulses, and moved along the gaps. */
static void call_push(Instance *self, double time, const double y[], const double impulses[], const double shifts[],
                      double result[]) {
    self->call.arguments[5] = impulses;
    self->call.arguments[6] = shifts;
    self->call.results[1] = self->contacts.operators;
    evaluate(self, self->model->push, time, y, result);
    self->call.results[1] = &self->call.margin;
}

/* Replace the states, and forget what was calculated from them. */
static void replace_states(Instance *self, const double y[]) {
    const size_t size = self->model->states * sizeof *y;
    memcpy(self->v.y, y, size);
    memset(self->v.low, 0, size);
    self->s->known = 0;
    self->known.current = 0;
}

/* Move states along the gaps. */
static void shift(Instance *self, double time, const double shifts[]) {
    call_push(self, time, self->v.y, NOTHING, shifts, self->d.y);
    replace_states(self, self->d.y);
}

/* Apply impulses of the contacts; the work is that of the mean rates. */
static void push(Instance *self, double time, const double impulses[]) {
    call_push(self, time, self->v.y, impulses, NOTHING, self->d.y);
    call_push(self, time, self->d.y, impulses, NOTHING, self->e.y);
    for (size_t i = 0; i < self->model->states; i++) self->d.y[i] = (self->v.y[i] + self->e.y[i]) / 2;
    replace_states(self, self->d.y);
}

/* Apply impulses of the contacts, and add those that operators feel to theirs. */
static void hit(Instance *self, double time, const double impulses[]) {
    push(self, time, impulses);
    for (size_t i = 0; i < self->model->operators; i++)
        self->v.m[self->model->operator[i]] += self->contacts.operators[i];
}

/* Solve G x = right for some contacts, in place. */
static void annulling(const Instance *self, const size_t list[], size_t n, double right[]) {
    double matrix[MOST_CONTACTS * MOST_CONTACTS];
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++)
            matrix[i * MOST_CONTACTS + j] = self->contacts.numbers.G[list[i] + self->model->indicators * list[j]];
    complementarity_solve(matrix, n, right);
}

/* Bring the rates, or positions, of contacts that are held to 0; whether a position may still be off. */
static int annul(Instance *self, double time, const size_t list[], size_t n, int positions) {
    const ContactNumbers *c = &self->contacts.numbers;
    double change[MOST_CONTACTS] = {0}, right[MOST_CONTACTS];
    int needed = 0, far = 0;
    for (size_t i = 0; i < n; i++) {
        right[i] = positions ? -c->gap[list[i]] : -c->v[list[i]];
        needed |= right[i] != 0;
        far |= positions && fabs(right[i]) > FAR * c->scale[list[i]];
    }
    if (!needed) return 0;
    annulling(self, list, n, right);
    for (size_t i = 0; i < n; i++) change[list[i]] = right[i];
    (positions ? shift : push)(self, time, change);
    inspect(self, time);
    return far;
}

/* Bring gaps to 0 by Newton's method. */
static void touch(Instance *self, double time, const size_t list[], size_t n) {
    for (int step = 0; step < NEWTON_STEPS && annul(self, time, list, n, 1); step++) continue;
}

void core_uphold(Instance *self, double time) {
    Complementarity p;
    Modes modes;
    size_t list[MOST_CONTACTS], n = 0, gaps = 0;
    begin_problem(self, 0, &p);
    read_modes(self, modes);
    for (size_t i = 0; i < p.contacts; i++) {
        if (complementarity_holds(&p, modes, i)) list[n++] = i;
        if (i < p.gaps) gaps = n;
    }
    if (n == 0) return;
    inspect(self, time);
    touch(self, time, list, gaps);
    annul(self, time, list, n, 0);
}

void core_uphold_before(Instance *self) {
    const size_t inputs_size = self->model->inputs * sizeof *self->v.u;
    memcpy(self->e.u, self->v.u, inputs_size);
    for (const Prescribed *p = self->prescribed.list; p < self->prescribed.list + self->prescribed.count; p++) {
        self->v.u[p->value] = p->past->value;
        self->v.u[p->rate] = p->past->rate;
        self->v.u[p->acceleration] = p->past->acceleration;
    }
    core_uphold(self, self->s->time);
    memcpy(self->v.u, self->e.u, inputs_size);
}

/* ---- complementarity ---------------------------------------------------------------------------------------------- */

/* Give the contacts of a problem, and why they cannot be settled, as reason; 0. */
static int refuse(Instance *self, const Complementarity *p, double time, const char *why) {
    char names[TEXT / 2] = "";
    for (size_t k = 0; k < p->n; k++) {
        if (k > 0) strncat(names, ", ", sizeof names - strlen(names) - 1);
        strncat(names, name_of(self->model, p->contact[k]), sizeof names - strlen(names) - 1);
    }
    return core_because(self, "%s at t = %.9g: %s", names, time, why);
}

/* Choose modes; 0 and a reason if there are none. */
static int choose(Instance *self, const Complementarity *p, double time, Modes modes, double x[], double rate[]) {
    const Choice choice = complementarity_choose(p, modes, x, rate);
    if (choice == CHOSEN) return 1;
    return refuse(self, p, time,
                  choice == PARADOX ? "no force keeps them apart and in their bounds (Painlevé)"
                                    : "they contradict each other, or what pushes leaves no way out");
}

/* ---- impacts -------------------------------------------------------------------------------------------------------- */

/* Apply the impulses of an impact of all gaps in a list: v+ >= max(0, -e v-), with friction. */
static int strike(Instance *self, double time, const int touching[]) {
    const Model *model = self->model;
    const size_t n = model->indicators, gaps = model->gaps;
    const ContactNumbers *c = &self->contacts.numbers;
    const int together = self->contacts.before != NULL; /* with others, which lose their part of the energy */
    double x[MOST_CONTACTS], rate[MOST_CONTACTS], before[MOST_CONTACTS];
    Complementarity p;
    Modes modes = {0};
    begin_problem(self, 1, &p);
    memcpy(before, together ? self->contacts.before : c->v, n * sizeof *before);
    contact_add_impact(c, touching, before, &p, modes);
    if (!choose(self, &p, time, modes, x, rate)) return 0;
    if (self->contacts.record != NULL) note_choice(self, time, &p, modes, x, rate, before);
    for (size_t i = 0; i < n; i++) /* of ports whose rates jump the mean rates work */
        self->v.y[model->states - 2] += x[i] * (c->v[i] - before[i]) / 2;
    self->contacts.before = NULL;
    hit(self, time, x);
    inspect(self, time);
    if (self->contacts.record != NULL) note_impact(self, note(self, time, STRUCK, -1, 0, modes), before, x);
    if (!together && contact_gains_energy(c, n, before, x))
        return refuse(self, &p, time, "Newton's restitution and friction would gain energy (Kane): take less of either");
    for (size_t i = 0; i < n; i++) {
        self->v.m[i < gaps ? model->gap[i].loss : model->friction[i - gaps].loss] -= x[i] * (before[i] + c->v[i]) / 2;
        if (i >= gaps || !(x[i] > 0)) continue;
        self->v.m[model->gap[i].impulse] += x[i];
        self->v.m[model->gap[i].impacts] += contact_counts(c, i, before[i]);
    }
    return 1;
}

/* ---- events --------------------------------------------------------------------------------------------------------- */

/* Whether no gap overlaps by more than rounding, or by what an importer may be late, and friction brakes. */
static int check_overlaps(Instance *self, double time, int late) {
    const Model *model = self->model;
    const ContactNumbers *c = &self->contacts.numbers;
    for (size_t i = 0; i < model->indicators; i++)
        if (!isfinite(c->v[i]) || !isfinite(c->a[i])) return core_because(self, "%s: its rate is not finite at t = %.9g", name_of(model, i), time);
    for (size_t i = 0; i < model->frictions; i++)
        if (!(c->slide[i] >= 0 && c->stick[i] >= c->slide[i] * (1 - STICKING)))
            return core_because(self, "%s at t = %.9g: its static bound %g must be at least the sliding one, %g, and that >= 0",
                                model->friction[i].name, time, c->stick[i], c->slide[i]);
    for (size_t i = 0; i < model->gaps; i++) {
        const double G = c->G[i * (model->indicators + 1)];
        if (c->gap[i] < -(late ? LATE : OVERLAP) * c->scale[i] - contact_rounding(c, i, time))
            return core_because(self, "%s = %.6g at t = %.9g: bodies overlap; %s", model->gap[i].name, c->gap[i], time,
                                self->s->phase < EVENT ? "start with a gap >= 0"
                                : late ? "an event was stepped over: take shorter steps, or find where indicators cross 0"
                                       : "a prescribed coordinate must not jump through a body");
        if (self->s->phase < EVENT && c->gap[i] > COARSE[0] * contact_rounding(c, i, time) && c->gap[i] < COARSE[1] * contact_rounding(c, i, time))
            return core_because(self, "%s = %.6g at t = %.9g is too small beside positions of %.3g: start with 0 or more than %.3g, or "
                                "measure positions from near the contact", model->gap[i].name, c->gap[i], time, c->scale[i],
                                COARSE[1] * contact_rounding(c, i, time));
        if (c->gap[i] <= contact_rounding(c, i, time) && !(G > 0 && isfinite(G)))
            return core_because(self, "%s at t = %.9g: it moves no mass (effective mass %g)", model->gap[i].name, time, 1 / G);
    }
    return 1;
}

double core_next_rest(const Instance *self, double time) {
    double next = INFINITY;
    for (const Gap *gap = self->model->gap; gap < self->model->gap + self->model->gaps; gap++)
        if (self->v.m[gap->rests_from] > time) next = fmin(next, self->v.m[gap->rests_from]);
    return next;
}

void core_follow_gaps(Instance *self) {
    const Model *model = self->model;
    const double time = self->s->time;
    size_t list[MOST_CONTACTS], n = 0, before;
    int listed[MOST_CONTACTS] = {0};
    if (!has_contacts() || model->gaps == 0) return;
    inspect(self, time);
    do { /* what gives way to one may come into another */
        before = n;
        for (size_t i = 0; i < model->gaps; i++) {
            const double depth = DRIFT * self->contacts.numbers.scale[i], gap = self->contacts.numbers.gap[i];
            const int follows = gap > -depth && (gap < 0 || (is_closed(self, i) && gap < depth));
            if (follows && !listed[i]) list[n++] = i;
            listed[i] |= follows;
        }
        touch(self, time, list, n);
    } while (n > before);
}

/* Choose modes at rest: complementarity of the accelerations of what touches and rests, and of what does not slide. */
static int rest(Instance *self, double time, const int touching[], Complementarity *p, Modes modes, double x[], double rate[]) {
    begin_problem(self, 0, p);
    read_modes(self, modes);
    contact_add_rest(&self->contacts.numbers, touching, self->contacts.before != NULL, p, modes);
    return choose(self, p, time, modes, x, rate);
}

/* Whether a gap is at 0; one that is closed may have drifted from it. */
static int touches(Instance *self, size_t i, double time) {
    const ContactNumbers *c = &self->contacts.numbers;
    if (is_closed(self, i)) return c->gap[i] <= DRIFT * c->scale[i];
    const double *before = self->contacts.before;
    const int closes = before != NULL && before[i] < 0; /* what opens comes into contact after the jumps */
    return c->gap[i] <= (closes ? NEAR * c->scale[i] : 0) + contact_rounding(c, i, time);
}

void core_contact_rates(Instance *self, double time, double rate[]) {
    inspect(self, time);
    memcpy(rate, self->contacts.numbers.v, self->model->indicators * sizeof *rate);
}

int core_is_unsettled(Instance *self, double time) {
    const Model *model = self->model;
    const ContactNumbers *c = &self->contacts.numbers;
    int touching[MOST_CONTACTS];
    double x[MOST_CONTACTS], rate[MOST_CONTACTS];
    Complementarity p;
    Modes present, modes;
    if (!has_contacts()) return 0;
    inspect(self, time);
    read_modes(self, present);
    for (size_t i = 0; i < model->gaps; i++) {
        touching[i] = touches(self, i, time);
        if (touching[i] && contact_approaches(c, i, c->v[i])) return 1;
    }
    return !rest(self, time, touching, &p, modes, x, rate) || memcmp(present, modes, model->indicators) != 0;
}

/* Find a gap whose bounces are so small that the rest of them is summed, and when they end; gaps if there is none.  With
 * others they are summed by the rates from before the jumps, which are to be solved for, and not where there was an impact. */
static size_t lowest_bounce(Instance *self, double time, const int touching[], const int was_closed[], const Modes modes,
                            const double rate[], const int rises[], const double before[], int struck) {
    const Model *model = self->model;
    const ContactNumbers *c = &self->contacts.numbers;
    for (size_t i = 0; i < model->gaps; i++) {
        const double v = before != NULL && !was_closed[i] ? before[i] : c->v[i], a = rate[i];
        const double lowest = was_closed[i] ? fmax(LIFTED, self->contacts.lowest) : self->contacts.lowest;
        if (modes[i] == CLOSED || !touching[i] || rises[i] || !contact_bounces(c, i, v, a)) continue;
        if (struck || contact_bounce_height(v, a) > lowest * c->scale[i]) {
            const double flight = contact_bounce_step(v, a);
            if (isfinite(flight) && (self->s->step > flight || self->s->step <= 0)) self->s->step = flight;
            continue;
        }
        self->v.m[model->gap[i].rests_from] =
            time + (was_closed[i] ? 0 : contact_bounces_duration(v, a, c->restitution[i]));
        return i;
    }
    return model->gaps;
}

/* Bring the rate of a gap that bounces no more to 0, with those that are held: its energy is lost, and where rates have
 * jumped mean rates work. */
static void stop(Instance *self, double time, size_t gap, const Modes modes, const double jumps[]) {
    const Model *model = self->model;
    const ContactNumbers *c = &self->contacts.numbers;
    double right[MOST_CONTACTS], impulses[MOST_CONTACTS] = {0}, before[MOST_CONTACTS];
    size_t list[MOST_CONTACTS], held = 0;
    for (size_t i = 0; i < model->gaps; i++)
        if (i == gap || modes[i] == CLOSED) list[held++] = i;
    if (self->contacts.record != NULL) {
        Modes brought = {0};
        for (size_t a = 0; a < held; a++) brought[list[a]] = CLOSED;
        note(self, time, CAME_TO_REST, (long)gap, 0, brought);
    }
    for (size_t a = 0; a < held; a++) right[a] = -c->v[list[a]];
    annulling(self, list, held, right);
    for (size_t a = 0; a < held; a++) impulses[list[a]] = right[a];
    memcpy(before, c->v, model->indicators * sizeof *before);
    hit(self, time, impulses);
    inspect(self, time);
    for (size_t a = 0; a < held; a++) {
        const Gap *row = &model->gap[list[a]];
        self->v.m[row->impulse] += right[a];
        self->v.m[row->loss] -= right[a] * (before[list[a]] - jumps[list[a]] + c->v[list[a]]) / 2;
        self->v.y[model->states - 2] += right[a] * jumps[list[a]] / 2;
    }
}

/* Treat impacts, and choose modes, until nothing changes; 0 with a reason if that fails. */
static int settle(Instance *self, double time, int late) {
    const Model *model = self->model;
    const size_t gaps = model->gaps, n = model->indicators;
    const ContactNumbers *c = &self->contacts.numbers;
    int touching[MOST_CONTACTS], was_closed[MOST_CONTACTS], rises[MOST_CONTACTS], impacts = 0, struck = 0;
    double x[MOST_CONTACTS], rate[MOST_CONTACTS], overlap[MOST_CONTACTS], jumps[MOST_CONTACTS] = {0};
    size_t list[MOST_CONTACTS], held = 0;
    const double *before = self->contacts.before;
    const int records = self->contacts.record != NULL;
    Complementarity resting;
    Modes modes, present = {0};
    if (records) read_modes(self, present);
    inspect(self, time);
    if (!check_overlaps(self, time, late)) return 0;
    for (size_t i = 0; i < gaps; i++) {
        was_closed[i] = is_closed(self, i);
        if (before != NULL) jumps[i] = c->v[i] - before[i];
        touching[i] = touches(self, i, time);
        rises[i] = late && c->v[i] > 0; /* out of an importer's error: there is no impact to be summed with others */
        overlap[i] = fmax(0, -c->gap[i] / c->scale[i]);
        if (touching[i] && c->gap[i] != 0) list[held++] = i;
    }
    if (records) note_touching(self, time, touching, was_closed);
    touch(self, time, list, held);
    for (;;) {
        const int together = self->contacts.before != NULL; /* with others, which react before there is another impact */
        int approaches = 0;
        for (size_t i = 0; i < gaps; i++) {
            const int jumped_in = together && touching[i] && contact_approaches(c, i, self->contacts.before[i]);
            approaches |= jumped_in || (touching[i] && contact_approaches(c, i, c->v[i]));
            struck |= jumped_in;
        }
        if (!approaches) break;
        if (++impacts > MOST_IMPACTS) {
            Complementarity p = {0};
            for (size_t i = 0; i < gaps; i++)
                if (touching[i]) p.contact[p.n++] = i;
            return refuse(self, &p, time, "more than 1000 impacts at one instant");
        }
        if (!strike(self, time, touching)) return 0;
        if (together) break;
    }
    for (size_t tries = 0;; tries++) {
        if (!rest(self, time, touching, &resting, modes, x, rate)) return 0;
        const size_t low = tries > gaps ? gaps : lowest_bounce(self, time, touching, was_closed, modes, rate, rises, before, struck);
        if (low == gaps) break;
        stop(self, time, low, modes, jumps);
        was_closed[low] = 2; /* it keeps the instant at which it rests */
    }
    held = 0;
    for (size_t i = 0; i < gaps; i++) {
        if (modes[i] == CLOSED && !was_closed[i]) self->v.m[model->gap[i].rests_from] = time;
        /* The importer's errors, of which overlaps tell, would close what begins to open. */
        const double error = fmin(ERRORS * fmax(self->s->tolerance, overlap[i]), DRIFT);
        const int slow = late && touching[i] && c->v[i] < ERRORS * error * c->rate_scale[i];
        *closed_of(self, i) = modes[i] == CLOSED ? 1 : slow ? -error : 0;
    }
    for (size_t i = 0; i < model->frictions; i++) self->v.m[model->friction[i].direction] = modes[gaps + i];
    if (records) {
        note_choice(self, time, &resting, modes, x, rate, NULL);
        note_settled(self, time, touching, present, modes);
        self->contacts.crossed = 0;
    }
    for (size_t i = 0; i < n; i++) {
        const int begins = i >= gaps && modes[i] * c->v[i] < 0; /* to slide against the rounding of its rate, an event again */
        if (begins || complementarity_holds(&resting, modes, i)) list[held++] = i;
    }
    annul(self, time, list, held, 0);
    return 1;
}

/* Move the states by a time, which may be negative, at the present rates. */
static void drift(Instance *self, double time, double by) {
    double *u = self->v.u;
    evaluate(self, derivatives_of(self->model), time, self->v.y, self->d.y);
    for (size_t i = 0; i < self->model->states; i++) self->v.y[i] += by * self->d.y[i];
    for (const Prescribed *p = self->prescribed.list; p < self->prescribed.list + self->prescribed.count; p++) {
        u[p->value] += by * (u[p->rate] + by / 2 * u[p->acceleration]);
        u[p->rate] += by * u[p->acceleration];
    }
}

int core_settle_contacts(Instance *self, double time) {
    const int exchange = self->s->phase >= EVENT && self->s->use == USE_MODEL_EXCHANGE;
    const ContactNumbers *c = &self->contacts.numbers;
    const size_t inputs_size = self->model->inputs * sizeof *self->v.u;
    const size_t gaps = self->model->gaps;
    double late = 0, most = 0; /* an importer finds an event when it is past */
    size_t first = gaps;       /* what came into contact first */
    inspect(self, time);
    /* It knows positions to its tolerance, or worse. */
    self->contacts.lowest = exchange ? fmax(LOWEST, self->s->tolerance) : LOWEST;
    for (size_t i = 0; i < gaps && exchange; i++) {
        self->contacts.lowest = fmax(self->contacts.lowest, -c->gap[i] / c->scale[i]);
        if (is_closed(self, i)) continue; /* it drifts */
        if (!(c->gap[i] < *closed_of(self, i) * c->scale[i] / 2 && c->gap[i] > -LATE * c->scale[i])) continue;
        /* What hardly moves is put to 0 where it is. */
        if (!(c->v[i] < -STILL * c->rate_scale[i] && c->v[i] * c->v[i] > fabs(c->a[i] * c->gap[i]))) continue;
        if (c->gap[i] / c->v[i] <= most) continue;
        most = c->gap[i] / c->v[i];
        first = i;
    }
    if (first < gaps) memcpy(self->e.u, self->v.u, inputs_size);
    for (int k = 0; first < gaps && k < NEWTON_STEPS && c->v[first] < 0; k++) {
        const double by = c->gap[first] / c->v[first];
        drift(self, time - late, -by);
        late += by;
        inspect(self, time - late);
        if (fabs(c->gap[first]) <= contact_rounding(c, first, time) / 2) break;
    }
    if (!settle(self, time - late, exchange)) return 0;
    if (first < gaps) {
        drift(self, time - late, late);
        memcpy(self->v.u, self->e.u, inputs_size);
    }
    self->known.current = 0;
    return core_remember(self) || core_because_infinite(self);
}

int core_has_event(Instance *self, double time) {
    double *values = self->contacts.indicators;
    if (!has_contacts()) return 0;
    evaluate(self, self->model->indicate, time, self->v.y, values);
    for (size_t i = 0; i < self->model->indicators; i++)
        if (values[i] < 0) return 1;
    return 0;
}

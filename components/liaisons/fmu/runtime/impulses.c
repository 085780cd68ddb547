/* Impulses through ports, which inputs sum: states jump by what a sum has grown by.
 *
 * Rates of states are linear in loads, so that an impulse changes states as a load would change their rates; the work is
 * that of the mean rates.  Where the rate of a prescribed coordinate jumps in reaction to impulses of its operator, the
 * contacts reflect the rates from before all jumps, and the operator's impulse has a term of the effective mass.
 *
 * A sum that grows by its last digit lets contacts choose their modes with the present inputs: so importers choose those of
 * several FMUs together. */
#include "impulses.h"

#include <string.h>

#include "complementarity.h"
#include "unilateral.h"

#define FOR_EACH_IMPULSE(row) \
    for (const ImpulseInput *row = self->model->impulse, *const end = row + self->model->impulse_rows; row < end; row++)
#define FOR_EACH_REACTION(row) \
    for (const Reaction *row = self->model->reaction, *const end = row + self->model->reaction_rows; row < end; row++)

void core_note_impulses(Instance *self) {
    double *applied = self->v.applied;
    FOR_EACH_IMPULSE(row)
        for (size_t i = 0; i < row->count; i++) *applied++ = self->v.set[row->sum + i];
    FOR_EACH_REACTION(row) *applied++ = self->v.set[row->sum];
}

/* Whether a sum has grown. */
static int has_impulses(const Instance *self) {
    const double *applied = self->v.applied, *set = self->v.set;
    FOR_EACH_IMPULSE(row)
        for (size_t i = 0; i < row->count; i++)
            if (set[row->sum + i] != *applied++) return 1;
    FOR_EACH_REACTION(row)
        if (set[row->sum] != *applied++) return 1;
    return 0;
}

/* How much a prescribed rate has jumped. */
static double jump_of(const Instance *self, const Reaction *row) {
    const size_t first = self->model->impulses - self->model->reaction_rows;
    return self->v.set[row->sum] - self->v.applied[first + (size_t)(row - self->model->reaction)];
}

/* Rates of the contacts before prescribed rates have jumped, of what is closed 0; these jump if that is not done yet. */
static void look_back(Instance *self, double before[]) {
    const int interpolating = self->s->reconstruction == INTERPOLATE; /* inputs that are set are of a later time */
    FOR_EACH_REACTION(row) self->e.u[row->rate] = self->v.u[row->rate] + (interpolating ? jump_of(self, row) : 0);
    if (!interpolating)
        FOR_EACH_REACTION(row) self->v.u[row->rate] -= jump_of(self, row);
    if (has_contacts()) core_contact_rates(self, self->s->time, before);
    for (size_t i = 0; i < self->model->gaps; i++)
        if (self->v.m[self->model->gap[i].closed] > 0) before[i] = 0; /* an importer's errors would open it */
    FOR_EACH_REACTION(row) self->v.u[row->rate] = self->e.u[row->rate];
}

/* Put impulses in the place of loads, and jumps of rates in that of accelerations, or 0. */
static void load(Instance *self, int loaded, int accelerated) {
    const double *applied = self->v.applied;
    FOR_EACH_IMPULSE(row)
        for (size_t i = 0; i < row->count; i++, applied++)
            self->v.u[row->load + i] = loaded ? self->v.set[row->sum + i] - *applied : 0;
    FOR_EACH_REACTION(row) self->v.u[row->acceleration] = accelerated ? jump_of(self, row) : 0;
}

/* What impulses add to states, beginning from some. */
static void add_impulses(Instance *self, const double y[], double result[]) {
    Function *rates = derivatives_of(self->model);
    double *without = self->scratch.work;
    load(self, 0, 0);
    evaluate(self, rates, self->s->time, y, without);
    load(self, 1, 0);
    evaluate(self, rates, self->s->time, y, result);
    for (size_t i = 0; i < self->model->states; i++) result[i] = y[i] + (result[i] - without[i]);
}

/* Let no contact hold: none resists an impulse by a finite force. */
static void release_contacts(Instance *self) {
    for (const Gap *gap = self->model->gap; gap < self->model->gap + self->model->gaps; gap++) self->v.m[gap->closed] = 0;
    for (const DryFriction *row = self->model->friction; row < self->model->friction + self->model->frictions; row++)
        self->v.m[row->direction] = 1;
}

/* Apply impulses to the states, and add those that operators feel to theirs. */
static void apply(Instance *self) {
    const Model *model = self->model;
    const size_t n = model->states;
    double *memory = self->e.m, *u = self->e.u;
    memcpy(memory, self->v.m, model->memory * sizeof *memory);
    memcpy(u, self->v.u, model->inputs * sizeof *u);
    release_contacts(self);
    if (model->reaction_rows > 0) {
        load(self, 0, 0);
        evaluate(self, model->calculate, self->s->time, self->v.y, self->d.z);
        load(self, 1, 1);
        evaluate(self, model->calculate, self->s->time, self->v.y, self->v.z);
        FOR_EACH_REACTION(row) memory[row->impulse] += self->v.z[row->force] - self->d.z[row->force];
    }
    add_impulses(self, self->v.y, self->d.y);
    add_impulses(self, self->d.y, self->e.y);
    for (size_t i = 0; i < n; i++) self->v.y[i] = (self->v.y[i] + self->e.y[i]) / 2;
    memset(self->v.low, 0, n * sizeof *self->v.low);
    memcpy(self->v.m, memory, model->memory * sizeof *memory);
    memcpy(self->v.u, u, model->inputs * sizeof *u);
    self->s->known = 0;
    self->known.current = 0;
}

int core_take_impulses(Instance *self) {
    double before[MOST_CONTACTS];
    if (self->model->impulses == 0 || !has_impulses(self)) return 1;
    look_back(self, before);
    core_jump(self);
    if (!core_remember(self)) return core_because_infinite(self);
    apply(self);
    core_note_impulses(self);
    self->contacts.before = before;
    const int settled = core_settle(self, self->s->time);
    self->contacts.before = NULL;
    if (!settled) return 0;
    core_follow(self);
    return core_remember(self) || core_because_infinite(self);
}

void core_try_impulses(Instance *self) {
    if (self->model->impulses == 0 || self->s->reconstruction == INTERPOLATE || !has_impulses(self)) return;
    memcpy(self->step.backup, self->s, self->layout.moving_size);
    if (!core_take_impulses(self)) memcpy(self->s, self->step.backup, self->layout.moving_size);
}

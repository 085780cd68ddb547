/* Jumps of σ, which move the states along: as the limit of an ever faster straight motion, where that has one. */
#include <string.h>

#include "prescribed.h"
#include "solver.h"

/* Jumps below this part of σ are rounding errors. */
static const double ROUNDING = 1e-14;

/* Find which coordinates jump, and how far; whether that moves states and has a limit. */
static int find_jumps(Instance *self) {
    const size_t n = self->prescribed.count;
    int moves = 0;
    FOR_EACH(p) {
        const double value = self->v.u[p->value], followed = p->past->followed, jump = value - followed;
        p->target = value;
        p->rest = self->v.u[p->rate];
        p->jump = value == p->past->value || fabs(jump) <= ROUNDING * fabs(value) || fabs(jump) <= ROUNDING * fabs(followed)
                      ? 0 : jump;
    }
    for (size_t i = 0; i < n; i++) {
        if (self->prescribed.list[i].jump == 0) continue;
        const unsigned char *row = &self->model->jumps[i * n];
        moves |= row[i] & JUMPS;
        for (size_t j = 0; j < n; j++) {
            if (!(row[j] & MIXES)) continue;
            if (self->prescribed.list[j].jump != 0) return 0;
            moves |= self->prescribed.list[j].rest != 0;
        }
    }
    return moves;
}

/* Set σ to a fraction of its jump, and its rate with the jump added to it or without. */
static void set_prescribed(Instance *self, double part, int jumping) {
    FOR_EACH(p) {
        if (p->jump == 0) continue;
        self->v.u[p->value] = p->past->followed + part * p->jump;
        self->v.u[p->rate] = jumping ? p->rest + p->jump : p->rest;
    }
}

/* What a jump adds to the rates of the states. */
static Signal leaping(void *context, double part, const double y[], double f[]) {
    Instance *self = context;
    const Model *model = self->model;
    Function *function = model->motions[ACTIVITIES - 1].coupled;
    set_prescribed(self, part, 0);
    evaluate(self, function, self->s->time, y, self->e.y);
    set_prescribed(self, part, 1);
    evaluate(self, function, self->s->time, y, f);
    for (size_t i = 0; i < model->coupled; i++) f[i] -= self->e.y[i];
    return GO_ON;
}

static Signal go_on(void *context, double t, double y[]) {
    (void)context, (void)t, (void)y;
    return GO_ON;
}

/* Take a tiny jump by the midpoint rule; 0 if that is not accurate enough. */
static int leap_at_once(const Problem *problem, double *y, double *work) {
    const size_t n = problem->n;
    double *begin = work, *middle = work + n, *x = work + 2 * n;
    leaping(problem->context, 0, y, begin);
    for (size_t i = 0; i < n; i++) x[i] = y[i] + begin[i] / 2;
    leaping(problem->context, 0.5, x, middle);
    for (size_t i = 0; i < n; i++)
        if (!(fabs(middle[i] - begin[i]) <= problem->tolerance * (problem->size[i] + fabs(y[i])))) return 0;
    for (size_t i = 0; i < n; i++) y[i] += middle[i];
    return 1;
}

void core_leap(Instance *self) {
    const size_t n = self->model->coupled;
    if (self->model->jumps == NULL || !find_jumps(self)) return;
    const Problem problem = {n, n, SHARE * self->s->tolerance, self->v.size, leaping, leaping, go_on, self, NULL, NULL};
    double *y = self->d.y, *low = self->d.z;
    double t = 0, step = 0;
    memcpy(y, self->v.y, n * sizeof *y);
    memcpy(low, self->v.low, n * sizeof *low);
    if (leap_at_once(&problem, y, self->scratch.work)
        || solver_advance(&problem, &t, 1, y, low, &step, self->scratch.work) == REACHED) {
        memcpy(self->v.y, y, n * sizeof *y);
        memcpy(self->v.low, low, n * sizeof *low);
    } /* else the way leads through a singularity, and there is no limit */
    FOR_EACH(p) {
        self->v.u[p->value] = p->target;
        self->v.u[p->rate] = p->rest;
    }
}

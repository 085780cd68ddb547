/* How inputs move inside a communication step: as polynomials in the fraction of it that has passed. */
#ifndef LIAISONS_INPUTS_H
#define LIAISONS_INPUTS_H

#include "instance.h"

/* The polynomials of all inputs that move in a step of size H, from u and what was set. */
void core_reconstruct(Instance *, double H);
/* Request the inputs inside a step of size H. */
void core_request_inputs(Instance *, double time, double H);
/* Find the degrees of the polynomials, and leave out those of inputs that do not move after all. */
void core_settle_movers(Instance *);
/* Whether a prescribed value or rate does not move in this step as its rate or acceleration says. */
int core_moves_apart(Instance *);
/* What the inputs do in this step: LOADS, MOVES. */
int core_activity(const Instance *);

/* The polynomial of an input; NULL if it does not move. */
static inline Mover *mover_of(Instance *self, size_t index) {
    const size_t i = self->movers.of_input[index];
    return i < self->movers.count && self->movers.list[i].index == index ? &self->movers.list[i] : NULL;
}

/* What an input is when the part x of the step has passed. */
static inline double input_at(const Mover *mover, double x) {
    double value = mover->c[mover->degree];
    for (int j = mover->degree - 1; j >= 0; j--) value = mover->c[j] + x * value;
    return value;
}

/* Its slope there. */
static inline double input_slope(const Mover *mover, double x) {
    double slope = 0;
    for (int j = mover->degree; j > 0; j--) slope = slope * x + j * mover->c[j];
    return slope;
}

/* Its integral from 0 to x. */
static inline double input_integral(const Mover *mover, double x) {
    double sum = 0;
    for (int j = mover->degree; j >= 0; j--) sum = x * (sum + mover->c[j] / (j + 1));
    return sum;
}

/* u at a time inside the step; 0 if one leaves its domain. */
static inline int move_inputs(Instance *self, double t) {
    const double x = t / self->step.size;
    for (const Mover *mover = self->movers.list, *const end = mover + self->movers.count; mover < end; mover++) {
        const double value = input_at(mover, x);
        self->v.u[mover->index] = value;
        if (!allows(mover->variable, value))
            return core_outside(self, self->model->parameters + mover->index, value, self->step.start + t);
    }
    return 1;
}

#endif

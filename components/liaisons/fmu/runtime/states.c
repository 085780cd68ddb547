/* Saved states: in memory, where they are trusted, and as bytes from anywhere, where they are not. */
#include <string.h>

#include "instance.h"
#include "symplectic.h"

typedef struct { /* in front of the numbers */
    char magic[8];
    uint32_t byte_order, version;
    uint64_t size;
    uint64_t checksum; /* of what follows it; 0 in memory */
    char guid[40];
} Header;

static const Header HEADER = {"liaison", 0x01020304, 2, 0, 0, ""};

size_t core_state_size(const Instance *self) { return sizeof(Header) + self->layout.state_size; }

void core_save(const Instance *self, void *bytes) {
    Header header = HEADER;
    header.size = core_state_size(self);
    strncpy(header.guid, self->model->guid, sizeof header.guid - 1);
    memcpy(bytes, &header, sizeof header);
    memcpy((char *)bytes + sizeof header, self->s, self->layout.state_size);
}

/* Checksum of bytes: FNV-1a, in words of 8 bytes; never 0. */
static uint64_t checksum(const void *bytes, size_t size) {
    const size_t first = offsetof(Header, guid); /* a multiple of 8, as the sizes of all parts are */
    uint64_t sum = 14695981039346656037u, word;
    for (size_t i = first; i + sizeof word <= size; i += sizeof word) {
        memcpy(&word, (const char *)bytes + i, sizeof word);
        sum = (sum ^ word) * 1099511628211u;
        sum ^= sum >> 32;
    }
    return sum | 1;
}

void core_seal(void *bytes) {
    Header header;
    memcpy(&header, bytes, sizeof header);
    header.checksum = checksum(bytes, header.size);
    memcpy(bytes, &header, sizeof header);
}

/* ---- checks: no message shows what the bytes hold ---------------------------------------------------------- */

/* Report bytes that do not begin with the header of a state of this FMU and version. */
static Status check_header(const Instance *self, const void *bytes, size_t size) {
    Header header;
    if (size < sizeof header)
        return core_report(self, ERROR, "the saved state has %lu bytes: it is cut off", (unsigned long)size);
    memcpy(&header, bytes, sizeof header);
    if (memcmp(header.magic, HEADER.magic, sizeof header.magic) != 0)
        return core_report(self, ERROR, "these bytes are no saved state of such an FMU");
    if (header.byte_order != HEADER.byte_order)
        return core_report(self, ERROR, "the saved state comes from a machine with another byte order");
    if (header.version != HEADER.version)
        return core_report(self, ERROR, "the saved state has another version than %u", HEADER.version);
    if (strncmp(header.guid, self->model->guid, sizeof header.guid) != 0)
        return core_report(self, ERROR, "the saved state belongs to another FMU");
    if (header.size != core_state_size(self) || size != header.size)
        return core_report(self, ERROR, "the saved state has %lu bytes instead of %lu: it is cut off or damaged",
                           (unsigned long)size, (unsigned long)core_state_size(self));
    return SUCCESS;
}

/* Whether a number is 0 or 1. */
static int flag(int32_t value) { return value == 0 || value == 1; }

/* Whether an instance can be saved in the phase of a state. */
static int phase_exists(const Instance *self, const Scalars *s) {
    switch (s->phase) {
    case CONFIGURATION: return self->options.whole && self->model->dimension_rows > 0 && !self->model->by_number;
    case INSTANTIATED:
    case INITIALIZATION:
    case TERMINATED: return 1;
    case EVENT: return s->use != USE_CO_SIMULATION;
    case CONTINUOUS: return s->use == USE_MODEL_EXCHANGE;
    case STEP: return s->use != USE_MODEL_EXCHANGE;
    default: return 0;
    }
}

/* The first of the scalars that cannot be so, or NULL. */
static const char *wrong_scalar(const Instance *self, const Scalars *s) {
    const Model *model = self->model;
    const int kept = s->tolerance >= TIGHTEST && s->tolerance <= LOOSEST;
    if (!isfinite(s->time)) return "the time";
    if (!kept && s->tolerance != model->tolerance) return "the tolerance";
    if (!(s->step >= 0 && isfinite(s->step))) return "the step of the solver";
    if (s->use < USE_MODEL_EXCHANGE || s->use > USE_CO_SIMULATION_WITH_EVENTS) return "the use";
    if (!phase_exists(self, s)) return "the phase";
    if (s->reconstruction < HOLD || s->reconstruction > INTERPOLATE) return "input_reconstruction";
    const int most = self->model->indicators > 0 ? 0 : MOST_SYMPLECTIC_STEPS;
    if (s->symplectic_steps < 0 || s->symplectic_steps > most) return "symplectic_steps";
    if (!flag(s->stiff_solver) || (s->stiff_solver && model->coupled > MOST_STIFF_STATES)
        || (s->stiff_solver && s->symplectic_steps > 0))
        return "stiff_solver";
    if (!flag(s->unstarted) || !flag(s->jumped) || !flag(s->expanded) || !flag(s->known)
        || !flag(s->stiffness_reported))
        return "a flag";
    if (s->unstarted && s->phase >= EVENT) return "a flag";
    return NULL;
}

/* Number i of an array that need not be aligned. */
static double number_at(const void *numbers, size_t i) {
    double number;
    memcpy(&number, (const char *)numbers + i * sizeof number, sizeof number);
    return number;
}

static int finite_numbers(const void *numbers, size_t n) {
    for (size_t i = 0; i < n; i++)
        if (!isfinite(number_at(numbers, i))) return 0;
    return 1;
}

/* The first contact whose mode or account in a memory cannot be so, or NULL. */
static const char *wrong_contact(const Model *model, const void *memory) {
    for (const Gap *gap = model->gap; gap < model->gap + model->gaps; gap++) {
        const double closed = number_at(memory, gap->closed), impacts = number_at(memory, gap->impacts);
        if ((closed != 1 && !(closed <= 0 && closed > -1)) || impacts < 0 || floor(impacts) != impacts) return gap->name;
    }
    for (const DryFriction *row = model->friction; row < model->friction + model->frictions; row++) {
        const double direction = number_at(memory, row->direction);
        if (direction != -1 && direction != 0 && direction != 1) return row->name;
    }
    return NULL;
}

/* Whether a prescribed number can have this past. */
static int past_exists(const Past *past) {
    if (past->size < 0 || past->still < 0 || past->turns < 0 || (past->told != 0 && past->told != 1)) return 0;
    if (!(past->points >= 0 && past->points <= EARLIER) || floor(past->points) != past->points) return 0;
    for (size_t i = 1; i < (size_t)past->points; i++)
        if (!(past->times[i] < past->times[i - 1])) return 0;
    return 1;
}

/* What cannot be so among the vectors, or NULL. */
static const char *wrong_vector(const Instance *self, const Scalars *s, const char *state) {
    const Model *model = self->model;
#define SAVED(vector) (state + ((const char *)self->v.vector - (const char *)self->s)) /* where it is in the state */
    const int running = s->phase >= EVENT; /* before, states and memory are calculated from the others */
    if (!finite_numbers(SAVED(u), model->inputs) || !finite_numbers(SAVED(set), model->inputs)) return "an input";
    if (running && !finite_numbers(SAVED(y), model->states)) return "a state";
    if (!finite_numbers(SAVED(low), model->states)) return "the rounding error of a state";
    if (running && !finite_numbers(SAVED(m), model->memory)) return "the memory of the component";
    if (running && wrong_contact(model, SAVED(m)) != NULL) return wrong_contact(model, SAVED(m));
    if (!finite_numbers(SAVED(past), self->prescribed.count * PAST))
        return "the past of an input";
    for (size_t i = 0; i < self->prescribed.count; i++) {
        const double *derived = self->prescribed.list[i].derived;
        Past past;
        memcpy(&past, SAVED(past) + i * sizeof past, sizeof past);
        if (!past_exists(&past)) return "the past of an input";
        if (derived == NULL || !running) continue;
        const double what = number_at(SAVED(m), (size_t)(derived - self->v.m));
        if (what != 0 && what != ACCELERATION && what != RATE_AND_ACCELERATION) return "the past of an input";
    }
    if (!finite_numbers(SAVED(history), HISTORY * model->coupled)) return "the past of a state";
    if (!finite_numbers(SAVED(applied), model->impulses)) return "the sum of the impulses of an input";
    if (!finite_numbers(SAVED(taylor), COEFFICIENTS * model->inputs)) return "the derivative of an input";
    for (size_t i = 0; i < model->inputs; i++) {
        const double given = number_at(SAVED(taylor), i * COEFFICIENTS);
        if (given != 0 && given != 1) return "the derivative of an input";
    }
    for (size_t i = 0; running && i < model->states; i++) {
        const double size = number_at(SAVED(size), i);
        if (!(size > 0 && isfinite(size))) return "the size of a state";
    }
    for (size_t i = 0; i < model->parameters; i++) {
        const Variable *variable = core_variable_at(model, i);
        const double value = number_at(SAVED(k), i);
        if (!isfinite(value) || (running && variable->kind == FIXED_PARAMETER && !allows(variable, value)))
            return variable->name;
    }
    return NULL;
#undef SAVED
}

/* Whether the time event of a state is one of the component; there is none in some phases. */
static int event_exists(Instance *self, const Scalars *s, const char *state) {
    if (s->limit == INFINITY) return 1;
    if (s->use == USE_CO_SIMULATION_WITH_EVENTS)
        return s->limit == s->time && (s->phase == STEP || s->phase == TERMINATED);
    if (s->use != USE_MODEL_EXCHANGE || (s->phase != CONTINUOUS && s->phase != TERMINATED)) return 0;
    if (self->model->sample != NULL) return isfinite(s->limit); /* a clock that misses it is at its instant, too */
    const char *k = state + ((const char *)self->v.k - (const char *)self->s);
    memcpy(self->d.k, k, self->model->parameters * sizeof *self->d.k);
    return core_next_instant(self, self->d.k, nextafter(s->limit, -INFINITY)) == s->limit;
}

Status core_check_state(Instance *self, const void *bytes, size_t size) {
    Header header;
    Scalars scalars;
    const char *const state = (const char *)bytes + sizeof header;
    if (check_header(self, bytes, size) != SUCCESS) return ERROR;
    memcpy(&header, bytes, sizeof header);
    if (header.checksum != checksum(bytes, size))
        return core_report(self, ERROR, "the saved state is damaged: its checksum is wrong");
    memcpy(&scalars, state, sizeof scalars);
    const char *wrong = wrong_scalar(self, &scalars);
    if (wrong == NULL) wrong = wrong_vector(self, &scalars, state);
    if (wrong == NULL && !event_exists(self, &scalars, state)) wrong = "the next event";
    if (wrong == NULL) return SUCCESS;
    return core_report(self, ERROR, "the saved state is damaged: %s is out of range", wrong);
}

Status core_restore(Instance *self, const void *bytes, size_t size) {
    static const char *const USES[] = {"model exchange", "co-simulation", "co-simulation with events"};
    Scalars scalars;
    if (check_header(self, bytes, size) != SUCCESS) return ERROR;
    const char *state = (const char *)bytes + sizeof(Header);
    memcpy(&scalars, state, sizeof scalars);
    if (scalars.use != (int32_t)self->options.use)
        return core_report(self, ERROR, "the saved state belongs to an instance for %s", USES[scalars.use]);
    memcpy(self->s, state, self->layout.state_size);
    if (self->s->phase < EVENT) self->s->unstarted = 1; /* states and memory that were not checked are not used */
    self->known.current = self->known.allowed = self->known.rests = 0;
    self->known.apart = self->known.derives = 1;
    self->step.discarded_from = NAN;
    return SUCCESS;
}

/* Saved states that nobody has saved: damaged ones, and ones whose checksum was computed anew.
 *
 * What is known here of the bytes: a header of HEADER bytes with a checksum of all that follows the sizes in it, then
 * reals and integers of which two say where the instance is, then vectors of reals. */
#ifndef CONFORMANCE_FORGE_H
#define CONFORMANCE_FORGE_H

#include "fuzz.h"

enum { CHECKSUM = 24, GUID = 32, HEADER = 72, INTEGERS = HEADER + 4 * 8, VECTORS = INTEGERS + 8 * 4, WORD = 8 };

typedef struct {
    unsigned long taken, refused;
} Tally;

/* Without a right checksum none is taken; with one some are, and the instance has to behave. */
static Tally damaged, sealed;

static void seal(char *bytes, size_t size) { /* FNV-1a in words */
    uint64_t sum = 14695981039346656037u, word;
    for (size_t i = GUID; i + WORD <= size; i += WORD) {
        memcpy(&word, bytes + i, WORD);
        sum = (sum ^ word) * 1099511628211u;
        sum ^= sum >> 32;
    }
    sum |= 1;
    memcpy(bytes + CHECKSUM, &sum, WORD);
}

static void swap_words(char *a, char *b) {
    char kept[WORD];
    memcpy(kept, a, WORD);
    memcpy(a, b, WORD);
    memcpy(b, kept, WORD);
}

/* Something else in one place behind the header; half of the time among the scalars. */
static void alter(char *bytes, size_t size) {
    static const double REALS[] = {NAN,    INFINITY, -INFINITY, 0,      -1,      1,         1e300,
                                   -1e300, DBL_MAX,  1e-300,    -1e-12, DBL_MIN / 4, 1e9, 0.25};
    static const int32_t NUMBERS[] = {-1, 0, 1, 2, 3, 4, 8, 16, 32, 64, 128, 256, 300, 100001, INT32_MAX, INT32_MIN};
    const size_t end = one_in(2) ? VECTORS : size, words = (end - HEADER) / WORD;
    char *word = bytes + HEADER + WORD * below(words);
    const uint64_t drawn = draw();
    switch (below(5)) {
    case 0: swap_words(word, bytes + HEADER + WORD * below((size - HEADER) / WORD)); break;
    case 1: memcpy(word, &drawn, WORD); break;
    case 2: word[below(WORD)] ^= (char)(1 << below(8)); break;
    case 3: memcpy(word, &REALS[below(sizeof REALS / sizeof *REALS)], WORD); break;
    default:
        memcpy(bytes + INTEGERS + 4 * below(8), &NUMBERS[below(sizeof NUMBERS / sizeof *NUMBERS)], 4);
    }
}

/* The bytes otherwise, so that they must be refused: cut off, with a wrong checksum, or with none. */
static void damage(char *bytes, size_t *size) {
    const size_t kind = below(6);
    expect(FAILS);
    if (kind == 0) *size = below(*size);
    else if (kind == 1) bytes[below(*size)] ^= (char)(1 << below(8));
    else if (kind == 2) memset(bytes + CHECKSUM, 0, WORD);
    else {
        char *before = memcpy(take(*size), bytes, *size);
        for (size_t changes = 1 + below(4); changes > 0 || memcmp(before, bytes, *size) == 0; changes -= changes > 0)
            if (kind == 3) swap_words(bytes + HEADER + WORD * below((*size - HEADER) / WORD),
                                      bytes + HEADER + WORD * below((*size - HEADER) / WORD));
            else alter(bytes, *size);
        if (kind == 5) memset(bytes + CHECKSUM, 0, WORD);
    }
}

/* Where an instance says it is that would have these bytes. */
static unsigned phase_in(const char *bytes) {
    int32_t phase;
    memcpy(&phase, bytes + INTEGERS, sizeof phase);
    switch (phase) {
    case 1: return CONFIGURATION;
    case 2: return INSTANTIATED;
    case 4: return INITIALIZATION;
    case 8: return it.fmu.kind == MODEL_EXCHANGE ? EVENT : STEP_EVENT;
    case 16: return CONTINUOUS;
    case 32: return STEP;
    default: return TERMINATED;
    }
}

static double time_in(const char *bytes) {
    double time;
    memcpy(&time, bytes + HEADER, sizeof time);
    return time;
}

typedef struct {
    char *bytes;
    size_t size;
    Tally *tally; /* NULL: they are as they were saved */
    Saved as;     /* what an instance would be */
} Offer;

/* The bytes of a saved state, or what somebody makes of them. */
static Offer some_bytes(void) {
    const Saved *source = saved();
    Offer offer = {NULL, 0, NULL, *source};
    offer.bytes = bytes_of(source, &offer.size);
    if (offer.bytes == NULL) {
        offer.size = 16;
        offer.bytes = take(offer.size);
        expect(FAILS);
    } else if (one_in(3)) {
        offer.tally = &damaged;
        damage(offer.bytes, &offer.size);
    } else if (one_in(2)) {
        offer.tally = &sealed;
        for (size_t changes = 1 + below(3); changes > 0; changes--) alter(offer.bytes, offer.size);
        seal(offer.bytes, offer.size);
        expect(MAY_FAIL);
        offer.as = (Saved){NULL, phase_in(offer.bytes), time_in(offer.bytes), 1, 1};
    } else if (source->wild) {
        expect(MAY_FAIL); /* some of its numbers may not be finite */
    }
    return offer;
}

/* Whether there are but finite numbers among the vectors, and the time is one. */
static int finite_in(const char *bytes, size_t size) {
    int finite = isfinite(time_in(bytes));
    for (size_t i = VECTORS; i + WORD <= size; i += WORD) {
        double number;
        memcpy(&number, bytes + i, WORD);
        finite &= isfinite(number) != 0;
    }
    return finite;
}

/* Note what became of them; `target` has got the state if they were taken. */
static int offered(Offer offer, int status, Saved *target) {
    /* Before it runs, states of an instance follow from its parameters, whatever the bytes say. */
    if (status == 0 && offer.as.phase & (RUNNING | TERMINATED) && !finite_in(offer.bytes, offer.size))
        now.fault = "a state with a number that is not finite is taken";
    if (offer.tally) {
        offer.tally->taken += status == 0;
        offer.tally->refused += status != 0;
    }
    if (status == 0) *target = (Saved){target->state, offer.as.phase, offer.as.time, offer.as.wild, offer.as.forged};
    return status;
}

#endif

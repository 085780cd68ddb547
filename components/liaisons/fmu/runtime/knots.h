/* A table, whose rows are knots: of all of them the generated functions see those two that a time lies between, for each
 * time at which they look rows up.  The sizes and `times`, (t, y, u, parameters behind the table) -> these, stand in
 * front of this file. */
#ifndef LIAISONS_KNOTS_H
#define LIAISONS_KNOTS_H

#include <float.h>
#include <math.h>
#include <string.h>

#include "instance.h"

typedef struct {
    const double *columns; /* one after the other, */
    size_t room, rows;     /* so far apart, and so long */
} Knots;

/* Those of the file, else those of the parameters as far as their instants ascend. */
static inline Knots knots_of(const double *table, const double *k) {
    size_t rows = 2; /* an interval needs two, whatever their instants are */
    if (table != NULL) return (Knots){table + 1, (size_t)table[0], (size_t)table[0]};
    while (rows < ROOM && k[rows] >= k[rows - 1] && k[1] >= k[0]) rows++;
    return (Knots){k, ROOM, rows};
}

/* How many instants do not lie after t. */
static inline size_t passed(const Knots *knots, double t) {
    size_t low = 0, high = knots->rows;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (knots->columns[middle] <= t) low = middle + 1;
        else high = middle;
    }
    return low;
}

/* The interval, by its first row, that has begun last; the first one before all; those without length are none. */
static inline size_t interval(const Knots *knots, double t) {
    const double *instant = knots->columns;
    size_t i = passed(knots, t), last = knots->rows - 2;
    i = i == 0 ? 0 : i - 1 > last ? last : i - 1;
    while (i > 0 && instant[i + 1] <= instant[i]) i--;
    while (i < last && instant[i + 1] <= instant[i]) i++;
    return i;
}

/* Which rows functions see, and the parameters as they see them: of each look-up both rows, then those behind. */
typedef struct {
    size_t of[LOOKUPS][2];
    double k[SEEN + BEHIND + 1];
} Rows;

/* Both rows of each look-up out of columns. */
static inline void copy_rows(const double *columns, size_t room, size_t of[LOOKUPS][2], double *seen) {
    const size_t *column = seen_columns;
    for (size_t i = 0; i < LOOKUPS; column += of_lookup[i++])
        for (size_t end = 0; end < 2; end++)
            for (size_t j = 0; j < of_lookup[i]; j++) *seen++ = columns[column[j] * room + of[i][end]];
}

static inline void look_up(const double **arguments, Rows *rows) {
    const double *behind = arguments[3] + COLUMNS * ROOM;
    const Knots knots = knots_of(arguments[TABLE], arguments[3]);
    double t[LOOKUPS];
    times((const double *[]){arguments[0], arguments[1], arguments[2], behind}, (double *[]){t}, NULL, NULL, 0);
    for (size_t i = 0; i < LOOKUPS; i++) {
        const size_t begun = passed(&knots, t[i]), last = knots.rows - 1;
        const size_t row = rests[i] ? begun - (begun > 0) : interval(&knots, t[i]);
        rows->of[i][0] = row;
        rows->of[i][1] = row < last ? row + 1 : last;
    }
    copy_rows(knots.columns, knots.room, rows->of, rows->k);
    memcpy(rows->k + SEEN, behind, BEHIND * sizeof *behind);
}

/* Call a function of (t, y, u, k, ...). */
static inline int with_rows(Function *function, const double **arguments, double **results, long long *integers,
                            double *reals, int memory) {
    Rows rows;
    look_up(arguments, &rows);
    const double *seen[] = {arguments[0], arguments[1], arguments[2], rows.k, arguments[4]};
    return function(seen, results, integers, reals, memory);
}

/* Call a function of (t, y, u, k, m, z, dt, dy, du, dk, dm). */
static inline int with_rows_forward(Function *function, const double **arguments, double **results, long long *integers,
                                    double *reals, int memory) {
    Rows rows;
    double directions[SEEN + BEHIND + 1] = {0};
    const double *seen[11];
    look_up(arguments, &rows);
    if (arguments[TABLE] == NULL) copy_rows(arguments[9], ROOM, rows.of, directions);
    memcpy(directions + SEEN, arguments[9] + COLUMNS * ROOM, BEHIND * sizeof *directions);
    memcpy(seen, arguments, sizeof seen);
    seen[3] = rows.k;
    seen[9] = directions;
    return function(seen, results, integers, reals, memory);
}

/* Call a function of (t, y, u, k, m, z, weights) -> those of (t, y, u, k, m). */
static inline int with_rows_reverse(Function *function, const double **arguments, double **results, long long *integers,
                                    double *reals, int memory) {
    Rows rows;
    double weights[SEEN + BEHIND + 1];
    look_up(arguments, &rows);
    function((const double *[]){arguments[0], arguments[1], arguments[2], rows.k, arguments[4], arguments[5], arguments[6]},
             (double *[]){results[0], results[1], results[2], weights, results[4]}, integers, reals, memory);
    memset(results[3], 0, COLUMNS * ROOM * sizeof *results[3]);
    memcpy(results[3] + COLUMNS * ROOM, weights + SEEN, BEHIND * sizeof *weights);
    if (arguments[TABLE] != NULL) return 0;
    const double *weight = weights;
    const size_t *column = seen_columns;
    for (size_t i = 0; i < LOOKUPS; column += of_lookup[i++])
        for (size_t end = 0; end < 2; end++)
            for (size_t j = 0; j < of_lookup[i]; j++) results[3][column[j] * ROOM + rows.of[i][end]] += *weight++;
    return 0;
}

/* (k, t) -> the first instant after t. */
static inline int next_instant(const double **arguments, double **results) {
    const Knots knots = knots_of(arguments[TABLE], arguments[0]);
    const size_t next = passed(&knots, arguments[1][0]);
    results[0][0] = next < knots.rows ? knots.columns[next] : INFINITY;
    return 0;
}

/* (t, y, u, k) -> the same, but the greatest number if there is none. */
static inline int next_break(const double **arguments, double **results) {
    const Knots knots = knots_of(arguments[TABLE], arguments[3]);
    const size_t next = passed(&knots, arguments[0][0]);
    results[0][0] = next < knots.rows ? knots.columns[next] : DBL_MAX;
    return 0;
}

#endif

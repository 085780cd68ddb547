/* A motion through knots (t, y, y', y''), the rows of a table: of all of them the generated functions see those two that
 * the time lies between. */
#ifndef LIAISONS_KNOTS_H
#define LIAISONS_KNOTS_H

#include <math.h>
#include <string.h>

#include "instance.h"

enum { COLUMNS = 4, ENDS = 2 * COLUMNS };

typedef struct {
    const double *columns; /* one after the other, */
    size_t room, rows;     /* so far apart, and so long */
} Knots;

/* Those of the file, else those of the parameters as far as their instants ascend. */
static inline Knots knots_of(const double *table, const double *k, size_t room) {
    size_t rows = 1;
    if (table != NULL) return (Knots){table + 1, (size_t)table[0], (size_t)table[0]};
    while (rows < room && k[rows] >= k[rows - 1]) rows++;
    return (Knots){k, room, rows};
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

/* Both ends of an interval, row by row. */
static inline void take_ends(const double *columns, size_t room, size_t i, double ends[ENDS]) {
    for (size_t row = 0; row < 2; row++)
        for (size_t column = 0; column < COLUMNS; column++)
            ends[row * COLUMNS + column] = columns[column * room + i + row];
}

/* (t, y, u, k, m) -> z by a piece's (t, ends) -> z. */
static inline int calculate_piece(Function *piece, size_t room, const double **arguments, double **results) {
    const Knots knots = knots_of(arguments[TABLE], arguments[3], room);
    double ends[ENDS];
    take_ends(knots.columns, knots.room, interval(&knots, arguments[0][0]), ends);
    return piece((const double *[]){arguments[0], ends}, results, NULL, NULL, 0);
}

/* (t, y, u, k, m, z, dt, dy, du, dk, dm) -> dz by a piece's (t, ends, z, dt, dends) -> dz. */
static inline int calculate_piece_forward(Function *piece, size_t room, const double **arguments, double **results) {
    const Knots knots = knots_of(arguments[TABLE], arguments[3], room);
    const size_t i = interval(&knots, arguments[0][0]);
    double ends[ENDS], directions[ENDS] = {0};
    take_ends(knots.columns, knots.room, i, ends);
    if (arguments[TABLE] == NULL) take_ends(arguments[9], room, i, directions);
    return piece((const double *[]){arguments[0], ends, arguments[5], arguments[6], directions}, results, NULL, NULL, 0);
}

/* (t, y, u, k, m, z, weights) -> those of (t, y, u, k, m) by a piece's (t, ends, z, weights) -> those of (t, ends). */
static inline int calculate_piece_reverse(Function *piece, size_t room, const double **arguments, double **results) {
    const Knots knots = knots_of(arguments[TABLE], arguments[3], room);
    const size_t i = interval(&knots, arguments[0][0]);
    double ends[ENDS], weights[ENDS];
    take_ends(knots.columns, knots.room, i, ends);
    piece((const double *[]){arguments[0], ends, arguments[5], arguments[6]}, (double *[]){results[0], weights}, NULL,
          NULL, 0);
    memset(results[3], 0, COLUMNS * room * sizeof *results[3]);
    for (size_t end = 0; end < ENDS && arguments[TABLE] == NULL; end++)
        results[3][end % COLUMNS * room + i + end / COLUMNS] = weights[end];
    return 0;
}

/* (k, t) -> the first instant after t. */
static inline int next_instant(size_t room, const double **arguments, double **results) {
    const Knots knots = knots_of(arguments[TABLE], arguments[0], room);
    const size_t next = passed(&knots, arguments[1][0]);
    results[0][0] = next < knots.rows ? knots.columns[next] : INFINITY;
    return 0;
}

#endif

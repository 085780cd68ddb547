/* Which contacts push, stick or slide: rates v become v + G x, where each x or its rate is 0, and both have their signs.
 * Of few contacts all combinations are tried; of many, principal pivots lead to the modes of a problem that has one
 * solution: with a little more compliance, G + softness, in which redundant contacts share their force (Cottle, Pang,
 * Stone, The Linear Complementarity Problem, 2009, 4.2; Judice and Pires 1994).  What is chosen satisfies the conditions
 * without it. */
#include "complementarity.h"

#include <math.h>
#include <string.h>

/* Contacts of which all combinations are tried; pivots that change all modes at once without progress, and in all. */
enum { FEW = 8, BLOCKS = 10, MOST_PIVOTS = 4 * MOST_CONTACTS };

/* Pivots below this part of the diagonal belong to contacts that depend on others, and what those do to these is the
 * same up to so many tolerances; additional compliance, in parts of the largest. */
static const double SINGULAR = 1e-10, SAME = 100, SOFT = 1e-9;

/* ---- linear equations ----------------------------------------------------------------------------------------------- */

static void swap(double *a, double *b) {
    const double other = *a;
    *a = *b;
    *b = other;
}

/* Eliminate the entries below the pivot in row and column r, after the row with the pivot was put there. */
static void eliminate(double a[][MOST_CONTACTS], size_t n, size_t r, size_t best, double right[]) {
    for (size_t j = 0; j < n; j++) swap(&a[best][j], &a[r][j]);
    swap(&right[best], &right[r]);
    for (size_t k = r + 1; k < n; k++) {
        const double factor = a[k][r] / a[r][r];
        for (size_t j = r; j < n; j++) a[k][j] -= factor * a[r][j];
        right[k] -= factor * right[r];
    }
}

/* Solve for the first unknowns; the others, behind them, are in place already. */
static void substitute(double a[][MOST_CONTACTS], size_t rank, size_t n, double right[]) {
    for (size_t i = rank; i-- > 0;) {
        for (size_t j = i + 1; j < n; j++) right[i] -= a[i][j] * right[j];
        right[i] /= a[i][i];
    }
}

/* Largest number in a column: what is small beside it is 0. */
static double size_of(const double K[], size_t n, int transposed, size_t column) {
    double largest = 0;
    for (size_t k = 0; k < n; k++)
        largest = fmax(largest, fabs(K[transposed ? column * MOST_CONTACTS + k : k * MOST_CONTACTS + column]));
    return largest;
}

/* Solve K x = right, or with the transposed matrix, by complete pivoting; unknowns that could be anything are 0.  Vectors
 * that it makes 0, row after row.  Its rank. */
static size_t solve_singular(const double K[], size_t n, int transposed, double x[], double vanishing[][MOST_CONTACTS]) {
    double a[MOST_CONTACTS][MOST_CONTACTS], right[MOST_CONTACTS], scale[MOST_CONTACTS];
    size_t order[MOST_CONTACTS], rank = 0;
    for (size_t i = 0; i < n; i++) {
        order[i] = i;
        scale[i] = size_of(K, n, transposed, i);
        right[i] = x[i];
        for (size_t j = 0; j < n; j++) a[i][j] = K[transposed ? j * MOST_CONTACTS + i : i * MOST_CONTACTS + j];
    }
    for (; rank < n; rank++) {
        size_t row = rank, column = rank;
        double largest = 0;
        for (size_t i = rank; i < n; i++)
            for (size_t j = rank; j < n; j++) {
                const double size = fabs(a[i][j]) / scale[order[j]];
                if (!(size > largest)) continue;
                largest = size;
                row = i;
                column = j;
            }
        if (!(largest > SINGULAR)) break;
        const size_t other = order[column];
        order[column] = order[rank];
        order[rank] = other;
        for (size_t i = 0; i < n; i++) swap(&a[i][column], &a[i][rank]);
        eliminate(a, n, rank, row, right);
    }
    for (size_t k = rank; k <= n; k++) { /* the last one is x */
        double solved[MOST_CONTACTS] = {0};
        if (k == n) memcpy(solved, right, rank * sizeof *right);
        else solved[k] = 1;
        substitute(a, rank, n, solved);
        for (size_t i = 0; i < n; i++) *(k == n ? &x[order[i]] : &vanishing[k - rank][order[i]]) = solved[i];
    }
    return rank;
}

/* Solve K x = right with a singular matrix: x is moved by vectors that it makes 0 until it is in its range, which those are
 * orthogonal to that the transposed matrix makes 0. */
static size_t share(const double K[], size_t n, double x[]) {
    double right[MOST_CONTACTS][MOST_CONTACTS], left[MOST_CONTACTS][MOST_CONTACTS];
    double products[MOST_CONTACTS * MOST_CONTACTS], parts[MOST_CONTACTS] = {0};
    const size_t rank = solve_singular(K, n, 0, x, right), count = n - rank;
    if (solve_singular(K, n, 1, parts, left) != rank || rank == 0) return count;
    for (size_t i = 0; i < count; i++) {
        parts[i] = 0;
        for (size_t k = 0; k < n; k++) parts[i] += left[i][k] * x[k];
        for (size_t j = 0; j < count; j++) {
            double sum = 0;
            for (size_t k = 0; k < n; k++) sum += left[i][k] * right[j][k];
            products[i * MOST_CONTACTS + j] = sum;
        }
    }
    complementarity_solve(products, count, parts);
    for (size_t j = 0; j < count; j++)
        for (size_t k = 0; k < n; k++) x[k] -= parts[j] * right[j][k];
    return count;
}

size_t complementarity_solve(double K[], size_t n, double right[]) {
    double a[MOST_CONTACTS][MOST_CONTACTS], x[MOST_CONTACTS];
    for (size_t i = 0; i < n; i++) {
        x[i] = right[i];
        for (size_t j = 0; j < n; j++) a[i][j] = K[i * MOST_CONTACTS + j];
    }
    for (size_t i = 0; i < n; i++) {
        size_t best = i;
        for (size_t k = i + 1; k < n; k++)
            if (fabs(a[k][i]) > fabs(a[best][i])) best = k;
        if (!(fabs(a[best][i]) > SINGULAR * size_of(K, n, 0, i))) return share(K, n, right);
        eliminate(a, n, i, best, x);
    }
    substitute(a, n, n, x);
    memcpy(right, x, n * sizeof *x);
    return 0;
}

/* ---- modes ---------------------------------------------------------------------------------------------------------- */

typedef enum { NONE, UNIQUE, SHARED } Solutions;

/* What a force that is too small to tell its sign is. */
static double little(const Complementarity *p, size_t i) { return p->tolerance[i] / p->G[i + p->contacts * i]; }

/* Calculate forces in some modes, and the rates with them. */
static Solutions forces_in(const Complementarity *p, const Modes modes, double softness, double x[], double rate[]) {
    const size_t n = p->contacts, gaps = p->gaps, frictions = n - gaps;
    const double *G = p->G;
    double matrix[MOST_CONTACTS * MOST_CONTACTS], right[MOST_CONTACTS], effect[MOST_CONTACTS];
    size_t list[MOST_CONTACTS], held = 0;
    memset(x, 0, n * sizeof *x);
    for (size_t i = 0; i < n; i++) {
        if (complementarity_holds(p, modes, i)) list[held++] = i;
        else if (i >= gaps && p->normal[i - gaps] < 0 && !p->impulses) x[i] = -modes[i] * p->slide[i - gaps];
    }
    for (size_t b = 0; b < held; b++) { /* a force also makes what slides under it rub */
        memset(effect, 0, n * sizeof *effect);
        effect[list[b]] = 1;
        for (size_t f = 0; f < frictions && list[b] < gaps; f++)
            if (p->normal[f] == (long)list[b]) effect[gaps + f] = -modes[gaps + f] * p->slide[f];
        for (size_t a = 0; a < held; a++) {
            double sum = 0;
            for (size_t i = 0; i < n; i++) sum += G[list[a] + n * i] * effect[i];
            matrix[a * MOST_CONTACTS + b] = sum + (a == b ? softness : 0);
        }
    }
    for (size_t a = 0; a < held; a++) {
        right[a] = -p->rate[list[a]];
        for (size_t i = 0; i < n; i++) right[a] -= G[list[a] + n * i] * x[i];
    }
    const size_t dependent = complementarity_solve(matrix, held, right);
    for (size_t b = 0; b < held; b++) {
        x[list[b]] += right[b];
        for (size_t f = 0; f < frictions && list[b] < gaps; f++)
            if (p->normal[f] == (long)list[b] && modes[gaps + f] != STICKS)
                x[gaps + f] -= modes[gaps + f] * p->slide[f] * right[b];
    }
    for (size_t i = 0; i < n; i++) {
        rate[i] = p->rate[i];
        for (size_t j = 0; j < n; j++) rate[i] += G[i + n * j] * x[j];
    }
    for (size_t a = 0; a < held && dependent > 0; a++)
        if (!(fabs(rate[list[a]]) <= SAME * p->tolerance[list[a]])) return NONE;
    return dependent > 0 ? SHARED : UNIQUE;
}

/* The mode that a contact should have by its force and its rate: another one if these contradict the present one.  Rates
 * that are 0 because others are have their rounding errors, too. */
static signed char better_mode(const Complementarity *p, const Modes modes, Solutions solutions, const double x[],
                               const double rate[], size_t i) {
    const double still = p->tolerance[i] * (solutions == UNIQUE ? 1 : SAME);
    if (i < p->gaps) {
        if (modes[i] == CLOSED) return x[i] < -little(p, i) ? OPEN : CLOSED;
        return rate[i] < -still ? CLOSED : OPEN;
    }
    const long normal = p->normal[i - p->gaps];
    if (normal >= 0 && modes[normal] == OPEN) return STICKS; /* all modes are alike: one will do */
    if (modes[i] != STICKS) return modes[i] * rate[i] < -still ? STICKS : modes[i];
    const double bound = p->stick[i - p->gaps] * (normal >= 0 ? x[normal] : 1);
    return fabs(x[i]) <= bound + little(p, i) ? STICKS : x[i] > 0 ? BACKWARD : FORWARD;
}

/* Whether no open contact would push if it was closed: redundant ones share the force. */
static int all_share(const Complementarity *p, const Modes modes, const double rate[]) {
    double x[MOST_CONTACTS], unused[MOST_CONTACTS];
    for (size_t k = 0; k < p->n; k++) {
        const size_t i = p->contact[k];
        Modes tied;
        if (i >= p->gaps || modes[i] != OPEN || rate[i] > SAME * p->tolerance[i]) continue;
        memcpy(tied, modes, sizeof tied);
        tied[i] = CLOSED;
        if (forces_in(p, tied, 0, x, unused) == SHARED && x[i] > little(p, i)) return 0;
    }
    return 1;
}

/* Modes that contacts should have instead: how many others, and the last of them. */
static size_t better_modes(const Complementarity *p, const Modes modes, Solutions solutions, const double x[],
                           const double rate[], Modes better, size_t *last) {
    size_t count = 0;
    memcpy(better, modes, sizeof(Modes));
    for (size_t k = 0; k < p->n; k++) {
        const size_t i = p->contact[k];
        better[i] = better_mode(p, modes, solutions, x, rate, i);
        if (better[i] == modes[i]) continue;
        *last = i;
        count++;
    }
    return count;
}

typedef struct { /* modes that were tried */
    Modes modes;     /* the first ones that are consistent, though more could share their force */
    int usable;      /* there are such */
    int impossible;  /* some have no forces */
} Trials;

/* Calculate forces in some modes; whether these are to be chosen. */
static int try_modes(const Complementarity *p, const Modes modes, double x[], double rate[], Trials *trials) {
    const Solutions solutions = forces_in(p, modes, 0, x, rate);
    Modes better;
    size_t last;
    if (solutions == NONE) trials->impossible = 1;
    else if (better_modes(p, modes, solutions, x, rate, better, &last) == 0) {
        if (all_share(p, modes, rate)) return 1;
        if (!trials->usable) memcpy(trials->modes, modes, sizeof trials->modes);
        trials->usable = 1;
    }
    return 0;
}

/* Try all combinations. */
static int try_all(const Complementarity *p, Modes modes, double x[], double rate[], Trials *trials) {
    static const signed char OF_GAP[] = {CLOSED, OPEN}, OF_FRICTION[] = {STICKS, FORWARD, BACKWARD};
    size_t combinations = 1;
    for (size_t k = 0; k < p->n; k++) combinations *= p->contact[k] < p->gaps ? 2 : 3;
    for (size_t combination = 0; combination < combinations; combination++) {
        size_t rest = combination;
        for (size_t k = 0; k < p->n; k++) {
            const size_t i = p->contact[k], choices = i < p->gaps ? 2 : 3;
            modes[i] = i < p->gaps ? OF_GAP[rest % choices] : OF_FRICTION[rest % choices];
            rest /= choices;
        }
        if (try_modes(p, modes, x, rate, trials)) return 1;
    }
    return 0;
}

/* Change modes that contradict their forces: all at once, and one at a time where that leads nowhere. */
static void pivot(const Complementarity *p, Modes modes, double softness, double x[], double rate[]) {
    size_t fewest = MOST_CONTACTS + 1, patience = BLOCKS;
    for (size_t pivots = 0; pivots < MOST_PIVOTS; pivots++) {
        Modes better;
        size_t last;
        const Solutions solutions = forces_in(p, modes, softness, x, rate);
        const size_t wrong = better_modes(p, modes, solutions, x, rate, better, &last);
        if (wrong == 0) return;
        if (wrong < fewest) {
            fewest = wrong;
            patience = BLOCKS;
        } else if (patience > 0) patience--;
        if (patience > 0) memcpy(modes, better, sizeof better);
        else modes[last] = better[last];
    }
}

/* Try what pivots lead to from where most is held, with more compliance, and from there without. */
static int try_pivots(const Complementarity *p, Modes modes, double x[], double rate[], Trials *trials) {
    double largest = 0;
    for (size_t k = 0; k < p->n; k++) {
        const size_t i = p->contact[k];
        modes[i] = i < p->gaps ? CLOSED : STICKS;
        largest = fmax(largest, p->G[i + p->contacts * i]);
    }
    pivot(p, modes, SOFT * largest, x, rate);
    if (try_modes(p, modes, x, rate, trials)) return 1;
    pivot(p, modes, 0, x, rate);
    return try_modes(p, modes, x, rate, trials);
}

Choice complementarity_choose(const Complementarity *p, Modes modes, double x[], double rate[]) {
    Trials trials = {.usable = 0};
    if (try_modes(p, modes, x, rate, &trials)) return CHOSEN;
    if ((p->n > FEW ? try_pivots : try_all)(p, modes, x, rate, &trials)) return CHOSEN;
    if (!trials.usable) return trials.impossible ? CONTRADICTION : PARADOX;
    memcpy(modes, trials.modes, sizeof trials.modes);
    forces_in(p, modes, 0, x, rate);
    return CHOSEN;
}

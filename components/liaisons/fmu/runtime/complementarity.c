/* Which contacts push, stick or slide: rates v become v + G x, where each x or its rate is 0, and both have their signs.
 * Of few contacts all combinations are tried; of many, principal pivots lead to the modes of a problem that has one
 * solution: with a little more compliance, G + softness, in which redundant contacts share their force (Cottle, Pang,
 * Stone, The Linear Complementarity Problem, 2009, 4.2; Judice and Pires 1994).  What is chosen satisfies the conditions
 * without it. */
#include "complementarity.h"

#include <math.h>
#include <string.h>

/* Contacts of which all combinations are tried; pivots that change all modes at once without progress, and in all;
 * sweeps of Gauss and Seidel. */
enum { FEW = 8, BLOCKS = 10, MOST_PIVOTS = 4 * MOST_CONTACTS, SWEEPS = 200 };

/* Pivots below this part of the diagonal belong to contacts that depend on others, and what those do to these is the
 * same up to so many tolerances; additional compliance, in parts of the largest. */
static const double SINGULAR = 1e-10, SAME = 100, SOFT = 1e-9;

/* ---- linear equations ----------------------------------------------------------------------------------------------- */

typedef struct { /* row-echelon form of a matrix */
    size_t n, rank, column[MOST_CONTACTS], dependent[MOST_CONTACTS]; /* columns with a pivot, and those without */
    double a[MOST_CONTACTS][MOST_CONTACTS];
} Echelon;

static void swap(double *a, double *b) {
    const double other = *a;
    *a = *b;
    *b = other;
}

/* Eliminate with partial pivoting, also in a column if it is not NULL. */
static void reduce(Echelon *e, const double K[], size_t n, int transposed, double right[]) {
    e->n = n;
    e->rank = 0;
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++) e->a[i][j] = K[transposed ? j * MOST_CONTACTS + i : i * MOST_CONTACTS + j];
    for (size_t i = 0; i < n; i++) {
        const size_t r = e->rank;
        size_t best = r;
        double largest = 0;
        for (size_t k = 0; k < n; k++)
            largest = fmax(largest, fabs(K[transposed ? i * MOST_CONTACTS + k : k * MOST_CONTACTS + i]));
        for (size_t k = r + 1; k < n; k++)
            if (fabs(e->a[k][i]) > fabs(e->a[best][i])) best = k;
        if (r == n || !(fabs(e->a[best][i]) > SINGULAR * largest)) {
            e->dependent[i - r] = i;
            continue;
        }
        for (size_t j = 0; j < n; j++) swap(&e->a[best][j], &e->a[r][j]);
        if (right) swap(&right[best], &right[r]);
        for (size_t k = r + 1; k < n; k++) {
            const double factor = e->a[k][i] / e->a[r][i];
            for (size_t j = i; j < n; j++) e->a[k][j] -= factor * e->a[r][j];
            if (right) right[k] -= factor * right[r];
        }
        e->column[e->rank++] = i;
    }
}

/* Solve for the unknowns that have pivots; the others are in x already. */
static void substitute(const Echelon *e, const double right[], double x[]) {
    for (size_t p = e->rank; p-- > 0;) {
        const size_t i = e->column[p];
        double sum = right[p];
        for (size_t j = i + 1; j < e->n; j++) sum -= e->a[p][j] * x[j];
        x[i] = sum / e->a[p][i];
    }
}

/* Vectors that the matrix makes 0, row after row. */
static void null_vectors(const Echelon *e, double rows[][MOST_CONTACTS]) {
    static const double NOTHING[MOST_CONTACTS];
    for (size_t k = 0; k < e->n - e->rank; k++) {
        memset(rows[k], 0, e->n * sizeof *rows[k]);
        rows[k][e->dependent[k]] = 1;
        substitute(e, NOTHING, rows[k]);
    }
}

static double dot(const double a[], const double b[], size_t n) {
    double sum = 0;
    for (size_t i = 0; i < n; i++) sum += a[i] * b[i];
    return sum;
}

/* Move one of several solutions into the range of K: by null vectors, until it is orthogonal to those of K transposed. */
static void share(Echelon *e, const double K[], double x[]) {
    const size_t n = e->n, count = n - e->rank;
    double right[MOST_CONTACTS][MOST_CONTACTS], left[MOST_CONTACTS][MOST_CONTACTS];
    double products[MOST_CONTACTS * MOST_CONTACTS], parts[MOST_CONTACTS];
    null_vectors(e, right);
    reduce(e, K, n, 1, NULL);
    if (n - e->rank != count) return;
    null_vectors(e, left);
    for (size_t i = 0; i < count; i++) {
        parts[i] = dot(left[i], x, n);
        for (size_t j = 0; j < count; j++) products[i * MOST_CONTACTS + j] = dot(left[i], right[j], n);
    }
    complementarity_solve(products, count, parts);
    for (size_t k = 0; k < count; k++)
        for (size_t i = 0; i < n; i++) x[i] -= parts[k] * right[k][i];
}

size_t complementarity_solve(double K[], size_t n, double right[]) {
    Echelon e;
    double x[MOST_CONTACTS] = {0};
    reduce(&e, K, n, 0, right);
    substitute(&e, right, x);
    const size_t dependent = n - e.rank;
    if (dependent > 0 && dependent < n) share(&e, K, x);
    memcpy(right, x, n * sizeof *x);
    return dependent;
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

/* Modes that forces come near to which are corrected one after the other, by Gauss and Seidel. */
static void relax(const Complementarity *p, Modes modes, double x[], double rate[]) {
    const size_t n = p->contacts;
    memset(x, 0, n * sizeof *x);
    memcpy(rate, p->rate, n * sizeof *rate);
    for (size_t turn = 0; turn < SWEEPS * p->n; turn++) {
        const size_t i = p->contact[turn % p->n];
        const long normal = i < p->gaps ? -1 : p->normal[i - p->gaps];
        const double G = p->G[i + n * i], before = x[i], tried = before - rate[i] / G;
        const double bound = i < p->gaps ? INFINITY : p->slide[i - p->gaps] * (normal < 0 ? !p->impulses : x[normal]);
        x[i] = fmin(fmax(tried, i < p->gaps ? 0 : -bound), bound);
        if (i < p->gaps) modes[i] = x[i] > 0 ? CLOSED : OPEN;
        else modes[i] = x[i] == tried || !(bound > 0) ? STICKS : x[i] > 0 ? BACKWARD : FORWARD;
        for (size_t j = 0; j < n; j++) rate[j] += p->G[j + n * i] * (x[i] - before);
    }
}

/* Try what pivots lead to, with more compliance, and from there without: from where most is held, or nearer. */
static int try_pivots(const Complementarity *p, Modes modes, double x[], double rate[], Trials *trials) {
    double largest = 0;
    for (size_t k = 0; k < p->n; k++) {
        const size_t i = p->contact[k];
        modes[i] = i < p->gaps ? CLOSED : STICKS;
        largest = fmax(largest, p->G[i + p->contacts * i]);
    }
    for (int near = 0; near <= 1; near++) {
        if (near) relax(p, modes, x, rate);
        pivot(p, modes, SOFT * largest, x, rate);
        if (try_modes(p, modes, x, rate, trials)) return 1;
        pivot(p, modes, 0, x, rate);
        if (try_modes(p, modes, x, rate, trials)) return 1;
    }
    return 0;
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

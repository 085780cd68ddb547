/* A motion through the events of its contacts, written down as entries: steps, and maps of the state.  Impacts and modes
 * follow contact_rules.h, as in an FMU. */

enum { RESTORATIONS = 2, MOST_EVENTS = 1000 };

/* Of a number by which modes are chosen, a part of its scale that is 0. */
static const double DEGENERATE = 1e-9;

typedef Choice Choose(const Complementarity *, Modes, double x[], double rate[]);

typedef struct {
    const double *k, *limits;
    double *y, *memory; /* of contacts, as it stands at the end of a row: modes; of gaps impacts, and instants of rest */
    Entry *entries;
    long count, most, rows;
    double *table, *s; /* rows of shared values, and the last of these */
    double *failure;   /* which, instant, value; contacts */
    Choose *choose;
    Contacts now;
    ContactNumbers c; /* columns of these */
} Motion;

static void inspect(Motion *m, double t) { contact_numbers(&t, m->k, m->s, m->y, (double *)&m->now); }

/* Begin a row of shared values, with the present memory of the contacts. */
static void begin_row(Motion *m, const double *shared) {
    m->s = m->table + (m->rows <= m->most ? m->rows : m->most) * R;
    m->rows++;
    memcpy(m->s, shared, (R - MEMORY) * sizeof *shared);
    memcpy(m->s + R - MEMORY, m->memory, MEMORY * sizeof *shared);
}

/* Add an entry; beyond the last one that there is memory for, they replace each other. */
static Entry *append(Motion *m, int kind, double t) {
    Entry *entry = m->entries + (m->count < m->most ? m->count : m->most);
    m->count++;
    *entry = (Entry){.kind = kind, .row = m->rows - 1, .which = -1, .record = -1, .t = t};
    return entry;
}

/* Map the state, and add the entry. */
static void apply(Motion *m, int kind, double t, const double flags[]) {
    double after[N];
    memcpy(append(m, kind, t)->flags, flags, FLAGS * sizeof *flags);
    (kind == RESTORED ? restored : struck)(&t, m->k, m->s, m->y, flags, after);
    memcpy(m->y, after, sizeof after);
    inspect(m, t);
}

/* Add a number that must stay 0. */
static void condition(Motion *m, int kind, double t, long which, double scale, const double flags[]) {
    Entry *entry = append(m, kind, t);
    entry->which = which;
    entry->h = scale;
    if (flags) memcpy(entry->flags, flags, sizeof entry->flags);
}

static int refuse(Motion *m, int why, double t, double value, const Complementarity *p) {
    m->failure[0] = why;
    m->failure[1] = t;
    m->failure[2] = value;
    for (size_t k = 0; k < p->n; ++k) m->failure[3 + p->contact[k]] = 1;
    return 0;
}

/* ---- modes */

static Complementarity problem(const Motion *m, int impulses) {
    Complementarity p = {.gaps = GAPS, .contacts = CONTACTS, .G = m->c.G, .slide = m->c.slide, .impulses = impulses};
    p.stick = impulses ? m->c.slide : m->c.stick;
    for (int i = GAPS; i < CONTACTS; ++i) p.normal[i - GAPS] = NORMALS[i];
    return p;
}

/* Whether a contact can have a force, by the gaps that are closed, or touch. */
static int presses(const int gaps[], int i) {
    const long normal = i < GAPS ? i : NORMALS[i];
    return normal < 0 || gaps[normal];
}

/* What is held in modes, and directions of what slides and presses. */
static void describe(const signed char modes[], double flags[]) {
    int closed[CONTACTS];
    for (int i = 0; i < GAPS; ++i) closed[i] = modes[i] == CLOSED;
    memset(flags, 0, FLAGS * sizeof *flags);
    for (int i = 0; i < CONTACTS; ++i) {
        flags[i] = presses(closed, i) && modes[i] == (i < GAPS ? CLOSED : STICKS);
        flags[CONTACTS + i] = i >= GAPS && presses(closed, i) ? modes[i] : 0;
    }
}

static void read_modes(const Motion *m, Modes modes) {
    for (int i = 0; i < CONTACTS; ++i) modes[i] = (signed char)m->memory[i];
}

/* Choose modes, the present ones first; forces x, rates with them, and of contacts what is >= 0 in consistent modes:
 * forces of what is closed, rates of what is not, in units of rates. */
static int choose_modes(Motion *m, double t, const Complementarity *p, Modes modes, double x[], double rate[],
                        double flags[], double slack[]) {
    const Choice choice = m->choose(p, modes, x, rate);
    if (choice != CHOSEN) return refuse(m, choice, t, 0, p);
    describe(modes, flags);
    for (int i = 0; i < CONTACTS; ++i) {
        const double least = i < GAPS ? 0 : p->stick[i - GAPS] * (NORMALS[i] >= 0 ? x[NORMALS[i]] : 1);
        const double force = i < GAPS ? x[i] : least - fabs(x[i]);
        slack[i] = flags[i] * force * m->c.G[i * (CONTACTS + 1)] + (i < GAPS ? 1 - flags[i] : flags[CONTACTS + i]) * rate[i];
    }
    return 1;
}

/* ---- an event */

/* Put the drift of what is closed or sticks to 0. */
static void restore(Motion *m, double t) {
    Modes modes;
    double flags[FLAGS];
    int any = 0;
    read_modes(m, modes);
    describe(modes, flags);
    for (int i = 0; i < CONTACTS; ++i) any |= flags[i] != 0;
    for (int i = 0; any && i < RESTORATIONS; ++i) apply(m, RESTORED, t, flags);
}

/* An impact of all gaps that touch. */
static int strike(Motion *m, double t, const int touching[]) {
    const ContactNumbers *c = &m->c;
    Complementarity p = problem(m, 1);
    double x[CONTACTS], rate[CONTACTS], slack[CONTACTS], flags[FLAGS], before[CONTACTS];
    Modes modes = {0};
    memcpy(before, c->v, sizeof before);
    contact_add_impact(c, touching, before, &p, modes);
    if (!choose_modes(m, t, &p, modes, x, rate, flags, slack)) return 0;
    for (int i = 0; i < GAPS; ++i) flags[2 * CONTACTS + i] = before[i] < 0;
    for (size_t k = 0; k < p.n; ++k) {
        const size_t i = p.contact[k];
        if (slack[i] <= DEGENERATE * c->rate_scale[i]) condition(m, WEAK_IMPACT, t, i, c->rate_scale[i], flags);
    }
    apply(m, STRUCK, t, flags);
    for (int i = 0; i < GAPS; ++i) m->memory[CONTACTS + i] += x[i] > 0 && contact_counts(c, i, before[i]);
    return contact_gains_energy(c, CONTACTS, before, x) ? refuse(m, GAINS, t, 0, &p) : 1;
}

/* Choose modes of what touches and rests. */
static int rest(Motion *m, double t, const int touching[], Complementarity *p, Modes modes, double rate[], double flags[],
                double slack[]) {
    double x[CONTACTS];
    *p = problem(m, 0);
    read_modes(m, modes);
    contact_add_rest(&m->c, touching, p, modes);
    return choose_modes(m, t, p, modes, x, rate, flags, slack);
}

/* A gap whose bounces are summed from here on, or GAPS; *size: a step in which the next impact of all others lies. */
static int lowest_bounce(const Motion *m, const int bounces[], const double present[], const double rate[], double *size) {
    const ContactNumbers *c = &m->c;
    *size = INFINITY;
    for (int i = 0; i < GAPS; ++i) {
        const double v = c->v[i], a = rate[i];
        if (!bounces[i] || !contact_bounces(c, i, v, a)) continue;
        if (contact_bounce_height(v, a) <= (present[i] ? LIFTED : LOWEST) * c->scale[i]) return i;
        *size = fmin(*size, contact_bounce_step(v, a));
    }
    return GAPS;
}

/* Impacts and modes of an instant, at which a contact has its event, or -1; 0 where that fails. */
static int settle(Motion *m, double t, long which, int started, double *size) {
    const ContactNumbers *c = &m->c;
    int touching[CONTACTS], bounces[CONTACTS], closed[CONTACTS], stopped[CONTACTS] = {0}, impacts = 0;
    double flags[FLAGS], present[FLAGS], rate[CONTACTS], slack[CONTACTS], flight, *rests_from = m->memory + CONTACTS + GAPS;
    Complementarity p = {0};
    Modes modes;
    read_modes(m, modes);
    describe(modes, present);
    inspect(m, t);
    for (int i = 0; i < GAPS; ++i) {
        const double rounding = contact_rounding(c, i, t);
        touching[i] = c->gap[i] <= (present[i] ? DRIFT * c->scale[i] : rounding);
        if (touching[i]) p.contact[p.n++] = i;
        if (c->gap[i] < -OVERLAP * c->scale[i] - rounding) {
            p = (Complementarity){.n = 1, .contact = {i}};
            return refuse(m, OVERLAPS, t, c->gap[i], &p);
        }
        if (touching[i] && !present[i] && i != which) condition(m, WEAK_GAP, t, i, c->scale[i], NULL);
    }
    for (;;) {
        int approaches = 0;
        for (int i = 0; i < GAPS; ++i) approaches |= touching[i] && contact_approaches(c, i, c->v[i]);
        if (!approaches) break;
        if (++impacts > MOST_IMPACTS) return refuse(m, REPEATS, t, 0, &p);
        if (!strike(m, t, touching)) return 0;
    }
    for (;;) {
        double held[FLAGS] = {0};
        if (!rest(m, t, touching, &p, modes, rate, flags, slack)) return 0;
        for (int i = 0; i < GAPS; ++i) {
            held[i] = closed[i] = modes[i] == CLOSED;
            bounces[i] = touching[i] && !closed[i] && !stopped[i];
        }
        const int low = lowest_bounce(m, bounces, present, rate, &flight);
        if (low == GAPS) break;
        rests_from[low] = t + (present[low] ? 0 : contact_bounces_duration(c->v[low], rate[low], c->restitution[low]));
        held[low] = stopped[low] = 1;
        apply(m, STRUCK, t, held);
    }
    *size = fmin(*size, flight);
    for (int i = 0; i < GAPS; ++i)
        if (closed[i] && !present[i] && !stopped[i]) rests_from[i] = t;
    for (size_t k = 0; k < p.n; ++k) {
        const size_t i = p.contact[k];
        if (slack[i] <= DEGENERATE * c->acceleration_scale[i] && presses(closed, i))
            condition(m, WEAK_REST, t, i, c->acceleration_scale[i], flags);
    }
    for (int i = 0; i < CONTACTS; ++i) {
        const int holds = started && present[i];
        if (fabs(c->v[i]) <= STILL * c->rate_scale[i] && !holds && i != which && presses(touching, i))
            condition(m, WEAK_RATE, t, i, c->rate_scale[i], NULL);
        m->memory[i] = modes[i];
    }
    return 1;
}

/* ---- steps, and the first event in one */

typedef struct { /* an accepted step */
    const Motion *m;
    double t, whole, h;      /* size; of its last repetition */
    double y[3 * N], f[3 * N]; /* states and rates at start, middle and end */
    double end[N], *kept;    /* of the last repetition; of its stages */
} Accepted;

/* Evaluate the indicators at a fraction of a step, by its quintic Hermite polynomial through start, middle and end. */
static int look(void *context, double part, double values[]) {
    const Accepted *step = context;
    const double x = part, p = x * x, q = (1 - x) * (1 - x), m = 2 * x - 1, *y = step->y, *f = step->f;
    const double at_0 = q * m * m * (1 + 6 * x), at_1 = 16 * p * q, at_2 = p * m * m * (7 - 6 * x);
    const double by_0 = x * q * m * m, by_1 = 8 * p * q * m, by_2 = p * m * m * (x - 1);
    double at[N], time = clipped(step->t + part * step->whole, step->m->limits);
    for (int j = 0; j < N; ++j)
        at[j] = at_0 * y[j] + at_1 * y[N + j] + at_2 * y[2 * N + j]
                + step->whole * (by_0 * f[j] + by_1 * f[N + j] + by_2 * f[2 * N + j]);
    watch(&time, step->m->k, step->m->s, at, values);
    return 1;
}

static int repeat_step(void *context, double part, double values[]) {
    Accepted *s = context;
    const Motion *m = s->m;
    s->h = fmin(s->t + part * s->whole - s->t, s->whole);
    const double time = clipped(s->t + s->h, m->limits);
    memcpy(s->end, s->y, sizeof s->end);
    step(s->t, s->h, m->limits, m->k, m->s, s->end, s->kept);
    watch(&time, m->k, m->s, s->end, values);
    return 1;
}

/* Steps through the intervals of a segment, and what contacts do between them.  How many entries there are, more than
 * `most` if the memory is too small; failure[0] is not 0 if the motion ends before. */
long follow(long intervals, const double *cuts, const long *rows, const double *limits, const double *k,
            const double *shared, double tolerance, const double *sizes, double *size, double *y, double *kept, long most,
            Entry *entries, double *table, const long *records, double *memory, long started, double *failure,
            Choose *const *choose) {
    Motion m = {k, limits, y, memory, entries, .most = most, .table = table, .failure = failure,
                .choose = *choose};
    m.c = columns(&m.now);
    double t = cuts[0], begin = t;
    long phase = 0, first = 0, stuck = 0;
    size_t which = -1;
    int settled = 0;
    begin_row(&m, shared + rows[0] * R);
    for (long interval = 0; interval < intervals && m.count <= most;) {
        const double end = cuts[interval + 1], *own = shared + rows[interval] * R;
        if (!settled) {
            const double instant = fmax(t, limits[0]);
            if (!settle(&m, instant, which, started, size)) return m.count;
            begin_row(&m, own);
            append(&m, SETTLED, instant)->record = m.rows == 2 ? records[0] : -1;
            settled = started = 1;
            phase = interval;
            begin = t;
            first = m.count;
        }
        const int last = *size >= 0.999999 * (end - t);
        double h = last ? end - t : t + fmin(*size, 0.5 * (end - t)) - t, whole[N], factor, graze = NAN;
        Accepted step = {&m, t, h, h, .kept = kept};
        if (!try_step(t, h, limits, k, m.s, y, tolerance, sizes, size, whole, step.y, kept, &factor)) {
            if (t + 1e-3 * *size == t) {
                failure[0] = SHORT;
                failure[1] = t;
                return m.count;
            }
            continue;
        }
        for (int n = 0; n < 3; ++n) {
            const double time = clipped(t + 0.5 * n * h, limits);
            rates(&time, k, m.s, step.y + n * N, step.f + n * N);
        }
        const EventSearch search = {&step, I, look, repeat_step};
        double part = event_search_first(&search, &graze);
        const int stops = part <= 1.0;
        if (isfinite(graze)) append(&m, GRAZED, t + graze * h);
        if (stops) event_search_repeat(&search, &part, &which);
        h = step.h;
        memcpy(y, stops ? step.end : whole, sizeof whole);
        const double cut = interval > phase ? cuts[interval] : begin, span = end - cut;
        const double before = span > 0 ? (t - cut) / span : 0.0, share = span > 0 ? h / span : 1.0;
        Entry *entry = append(&m, STEP, t);
        entry->h = h;
        if (interval == phase) {
            entry->moved[0] = 1 - before;
            entry->moved[1] = -share;
        }
        if (interval == intervals - 1) {
            entry->moved[2] = before;
            entry->moved[3] = share;
        }
        if (!stops) {
            *size = fmax(last ? *size : 0.0, h * fmin(factor, 4.0));
            t = last ? end : t + h;
            if (t < end) continue;
            entry->record = records[interval + 1];
            first = m.count;
            if (++interval < intervals && rows[interval] != rows[interval - 1])
                begin_row(&m, shared + rows[interval] * R);
            continue;
        }
        entry->which = which;
        for (long n = first; n < m.count && n < most; ++n) { /* sizes of steps up to an event do not change with others */
            const double moves = interval == phase;
            memcpy(entries[n].moved, (double[]){moves, 0.0, 0.0, 0.0}, sizeof entries[n].moved);
        }
        t = fmin(t + h, end);
        stuck = t - begin <= 8 * (nextafter(fabs(begin), INFINITY) - fabs(begin)) ? stuck + 1 : 0;
        if (stuck > MOST_EVENTS) {
            refuse(&m, STALLED, begin, 0, &(Complementarity){.n = 1, .contact = {which}});
            return m.count;
        }
        restore(&m, t);
        settled = 0;
    }
    if (isfinite(limits[1])) {
        append(&m, LAST, limits[1]);
        restore(&m, limits[1]);
    }
    return m.count;
}

/* States after entries, and before each; of steps those of the stages, and before the projection. */
void retrace(long count, const Entry *entries, const double *limits, const double *k, const double *table, double *y,
             double *states, double *kept, long stride) {
    for (long n = 0; n < count; ++n) {
        const Entry *entry = entries + n;
        const double *s = table + entry->row * R;
        double *own = kept + n * stride;
        if (entry->kind == STEP) step(entry->t, entry->h, limits, k, s, y, own);
        else memcpy(own, y, N * sizeof *y);
        if (entry->kind == RESTORED) restored(&entry->t, k, s, own, entry->flags, y);
        else if (entry->kind == STRUCK) struck(&entry->t, k, s, own, entry->flags, y);
        memcpy(states + n * N, y, N * sizeof *y);
    }
}

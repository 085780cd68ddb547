/* A motion through the events of its contacts, as its FMU has written these down, as entries: steps, and maps of the state. */

enum { RESTORATIONS = 2 };

typedef struct {
    const double *k;
    double *y, *memory; /* of contacts, as it stands at the end of a row: modes; of gaps impacts, and instants of rest */
    Entry *entries;
    long count, most, rows;
    double *table, *s; /* rows of shared values, and the last of these */
} Motion;

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
    double before[N];
    memcpy(append(m, kind, t)->flags, flags, FLAGS * sizeof *flags);
    memcpy(before, m->y, sizeof before);
    (kind == RESTORED ? restored : struck)(&t, m->k, m->s, before, flags, m->y);
}

/* What is held in modes, and directions of what slides and presses. */
static void describe(const double modes[], double flags[]) {
    memset(flags, 0, FLAGS * sizeof *flags);
    for (int i = 0; i < CONTACTS; ++i) {
        const int presses = i < GAPS || NORMALS[i] < 0 || modes[NORMALS[i]] == CLOSED;
        flags[i] = presses && modes[i] == (i < GAPS ? CLOSED : STICKS);
        flags[CONTACTS + i] = i >= GAPS && presses ? modes[i] : 0;
    }
}

/* Put the drift of what is closed or sticks to 0. */
static void restore(Motion *m, double t) {
    double flags[FLAGS];
    int any = 0;
    describe(m->memory, flags);
    for (int i = 0; i < CONTACTS; ++i) any |= flags[i] != 0;
    for (int i = 0; any && i < RESTORATIONS; ++i) apply(m, RESTORED, t, flags);
}

/* Add the entries of a record at an instant. */
static void replay(Motion *m, double t, const ContactEvent *event, const ContactAct acts[]) {
    double flags[FLAGS], modes[CONTACTS];
    for (int i = 0; i < CONTACTS; ++i) modes[i] = (double)acts[i].mode;
    describe(modes, flags);
    for (int i = 0; i < CONTACTS; ++i) flags[2 * CONTACTS + i] = (double)acts[i].approaches;
    if (event->kind == CAME_TO_REST) memset(flags + GAPS, 0, (FLAGS - GAPS) * sizeof *flags);
    if (event->kind == STRUCK || event->kind == CAME_TO_REST) {
        apply(m, STRUCK, t, flags);
        for (int i = 0; i < GAPS; ++i) m->memory[CONTACTS + i] += (double)acts[i].counts;
    } else if (event->kind == SETTLED) {
        memcpy(m->memory, modes, sizeof modes);
        for (int i = 0; i < GAPS; ++i) m->memory[CONTACTS + GAPS + i] = acts[i].rests_from;
    } else if (event->kind != GRAZED) {
        Entry *entry = append(m, (int)event->kind, t);
        entry->which = event->which;
        entry->h = event->scale;
        memcpy(entry->flags, flags, sizeof flags);
    }
}

/* Steps through the intervals of a segment, and what contacts do between them.  How many entries there are, more than
 * `most` if the memory is too small; *short_at is a number if no step is small enough there. */
long follow(long intervals, const double *cuts, const long *rows, const double *limits, const double *k,
            const double *shared, double tolerance, const double *sizes, double *size, double *y, double *kept, long most,
            Entry *entries, double *table, const long *records, double *memory, long events, const ContactEvent *event,
            const ContactAct *acts, double *short_at) {
    Motion m = {k, y, memory, entries, .most = most, .table = table};
    double t = cuts[0], begin = t;
    long phase = 0, first = 0, next = 0, seen = 0; /* interval and entry behind the last event; the next records */
    int settled = 0;
    begin_row(&m, shared + rows[0] * R);
    for (long interval = 0; interval < intervals && m.count <= most;) {
        const double end = cuts[interval + 1], *own = shared + rows[interval] * R;
        if (!settled) {
            const double instant = fmax(t, limits[0]);
            for (; next < events && event[next].time <= instant; ++next)
                replay(&m, instant, event + next, acts + next * CONTACTS);
            begin_row(&m, own);
            append(&m, SETTLED, instant)->record = m.rows == 2 ? records[0] : -1;
            settled = 1;
            phase = interval;
            begin = t;
            first = m.count;
            seen = next;
        }
        long coming = next; /* the end of the next event */
        while (coming < events && event[coming].kind != SETTLED) ++coming;
        const double stop = coming < events ? fmin(event[coming].time, end) : end;
        const int last = *size >= 0.999999 * (stop - t), stops = last && coming < events && event[coming].time <= end;
        double h = last ? stop - t : t + fmin(*size, 0.5 * (stop - t)) - t, whole[N], path[3 * N], factor;
        if (!try_step(t, h, limits, k, m.s, y, tolerance, sizes, size, whole, path, kept, &factor)) {
            if (t + 1e-3 * *size == t) {
                *short_at = t;
                return m.count;
            }
            continue;
        }
        for (; seen < coming && (event[seen].kind != GRAZED || event[seen].time <= t + h); ++seen)
            if (event[seen].kind == GRAZED) append(&m, GRAZED, event[seen].time);
        memcpy(y, whole, sizeof whole);
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
        entry->which = event[coming].which;
        for (long n = first; n < m.count && n < most; ++n) { /* sizes of steps up to an event do not change with others */
            const double moves = interval == phase;
            memcpy(entries[n].moved, (double[]){moves, 0.0, 0.0, 0.0}, sizeof entries[n].moved);
        }
        t = stop;
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

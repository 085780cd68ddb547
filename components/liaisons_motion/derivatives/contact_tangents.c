
/* Derivatives along directions of the entries of a motion with contacts, saved behind some of them.  The last block of
 * directions belongs to the size of a step that ends at an event; `slope` are those of the last instant of an event, `last`
 * those of the end of the segment. */
void sweep_tangents(long count, const Entry *entries, const double *limits, const double *k, const double *table,
                    const double *kept, long blocks, const double *dk, const double *last, double *slope, double *dt,
                    double *dh, double *dy, double *df, const long *saved, double *records, double *slopes) {
    const long lanes = blocks * D;
    for (long n = 0; n < count; ++n) {
        const Entry *entry = entries + n;
        const double *s = table + entry->row * R, *y = kept + n * (S + 1) * N;
        if (entry->kind == STEP) {
            const int free = entry->which >= 0;
            for (long i = 0; i < lanes; ++i) {
                dt[i] = entry->moved[0] * slope[i] + entry->moved[2] * last[i];
                dh[i] = entry->moved[1] * slope[i] + entry->moved[3] * last[i];
            }
            if (free) memset(dy + N * lanes, 0, N * D * sizeof *dy);
            step_tangents(entry->t, entry->h, limits, k, s, y, blocks + free, dk, dt, dh, dy, df);
            if (free) {
                double end[N], f[N], w[W], of_y[N], of_k[K + 1], of_t, unit[I] = {0};
                const double time = entry->t + entry->h, clip = clipped(time, limits), *by_size = dy + N * lanes;
                unit[entry->which] = 1;
                project_early(&clip, k, s, y + S * N, end, w);
                watch_adjoint(&time, k, s, end, unit, f, of_y, of_k, &of_t);
                double by = of_t;
                for (int j = 0; j < N; ++j) by += of_y[j] * by_size[j * D];
                for (long b = 0; b < blocks; ++b)
                    for (int i = 0; i < D; ++i) {
                        double *dy_i = dy + b * N * D + i, change = of_t * dt[b * D + i];
                        for (int j = 0; j < N; ++j) change += of_y[j] * dy_i[j * D];
                        for (int j = 0; j < K; ++j) change += of_k[j] * dk[(b * K + j) * D + i];
                        change /= -by;
                        for (int j = 0; j < N; ++j) dy_i[j * D] += by_size[j * D] * change;
                        slope[b * D + i] = dt[b * D + i] + change;
                    }
            }
        } else if (entry->kind == LAST) {
            memcpy(slope, last, lanes * sizeof *slope);
        } else if (entry->kind == RESTORED || entry->kind == STRUCK) {
            const int is_struck = entry->kind == STRUCK;
            double at[N], w[W], along[N * D];
            (is_struck ? struck_early : restored_early)(&entry->t, k, s, y, entry->flags, at, w);
            for (long b = 0; b < blocks; ++b) {
                memcpy(along, dy + b * N * D, sizeof along);
                (is_struck ? struck_late : restored_late)(&entry->t, k, s, y, entry->flags, w, slope + b * D,
                                                          dk + b * K * D, along, dy + b * N * D);
            }
        }
        if (saved[n] >= 0) {
            memcpy(records + saved[n] * N * lanes, dy, N * lanes * sizeof *dy);
            memcpy(slopes + saved[n] * lanes, slope, lanes * sizeof *slope);
        }
    }
}

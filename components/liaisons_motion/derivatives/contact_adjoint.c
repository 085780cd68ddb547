
/* Derivatives of a sum backwards through the entries of a motion with contacts: lambda by the last state, then by the
 * first one; of_slope by the last instant of an event, then by the first one; of_last by the end of the segment. */
void sweep_adjoint(long count, const Entry *entries, const double *limits, const double *k, const double *table,
                   const double *kept, const double *weights, double *lambda, double *of_k, double *of_slope,
                   double *of_last) {
    for (long n = count - 1; n >= 0; --n) {
        const Entry *entry = entries + n;
        const double *s = table + entry->row * R, *y = kept + n * (S + 1) * N;
        double f[N], of_t, of_h;
        if (entry->record >= 0)
            for (int j = 0; j < N; ++j) lambda[j] += weights[entry->record * N + j];
        if (entry->kind == LAST) {
            *of_last += *of_slope;
            *of_slope = 0.0;
        } else if (entry->kind == RESTORED || entry->kind == STRUCK) {
            double of_y[N], part_k[K + 1];
            (entry->kind == STRUCK ? struck_adjoint : restored_adjoint)(&entry->t, k, s, y, entry->flags, lambda, f, of_y,
                                                                        part_k, &of_t);
            for (int i = 0; i < K; ++i) of_k[i] += part_k[i];
            *of_slope += of_t;
            memcpy(lambda, of_y, sizeof of_y);
        } else if (entry->kind == STEP) {
            step_adjoint(entry->t, entry->h, limits, k, s, y, lambda, of_k, &of_t, &of_h);
            *of_last += entry->moved[2] * of_t + entry->moved[3] * of_h;
            if (entry->which < 0) {
                *of_slope += entry->moved[0] * of_t + entry->moved[1] * of_h;
                continue;
            }
            /* Its size is such that an indicator g is 0. */
            const double time = entry->t + entry->h, clip = clipped(time, limits);
            double end[N], g_y[N], g_k[K + 1], g_t, by_t, by_h, unit[I] = {0}, none[N] = {0};
            unit[entry->which] = 1;
            project_adjoint(&clip, k, s, y + S * N, none, end, g_y, g_k, &g_t);
            watch_adjoint(&time, k, s, end, unit, f, g_y, g_k, &g_t);
            step_adjoint(entry->t, entry->h, limits, k, s, y, g_y, g_k, &by_t, &by_h);
            const double ratio = (of_h + *of_slope) / (by_h + g_t);
            for (int j = 0; j < N; ++j) lambda[j] -= ratio * g_y[j];
            for (int i = 0; i < K; ++i) of_k[i] -= ratio * g_k[i];
            *of_slope = (of_t + *of_slope - ratio * (by_t + g_t)) * entry->moved[0];
        }
    }
}

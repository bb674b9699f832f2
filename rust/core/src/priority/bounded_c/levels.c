/* Clamped and damped directions. */

static void @_start_units(@_work *w)
{
    int j, all = 1;
    for (j = 0; j < @_N; j++)
        all &= w->scale[j] == 1.0;
    for (j = 0; j < @_N && !all; j++) {
        memset(@_col(w, @_MOST + @_N + j), 0, @_N * sizeof(double));
        @_col(w, @_MOST + @_N + j)[j] = 1.0;
        w->live[w->lives++] = @_MOST + @_N + j;
    }
}

static int @_add_penalties(@_work *w, int level)
{
    const int from = w->used;
    const double eps = w->eps[level];
    double damping = 1.0;
    int k, c, at, regular = 1;
    w->penalties = w->goal = 0;
    @_refresh(w);
    w->ties = 0;
    @_pull(w);
    @_start_units(w);
    for (k = 0; k < w->pulls; k++)
        for (c = 0; c < @_N && @_is_task(w, w->pulled[k]); c++)
            @_col(w, w->pulled[k])[c] *= w->scale[c];
    if (!@_decompose_rows(w, w->pulled, w->pulls, from))
        return 0;
    for (k = 0; k < w->svd.p; k++) {
        regular &= w->svd.s[k] >= eps;
        damping *= fmin(w->svd.s[k] / eps, 1.0);
    }
    if (regular || w->frobenius[level] == 0.0)
        return 1;
    @_turn_frame(w, &w->svd, from, 0);
    damping = eps * (1.0 - damping);
    for (at = from; at < @_N; at++) {
        const double s = at - from < w->svd.p ? w->svd.s[at - from] : eps;
        const double root = @_METHOD == 2 ? damping : sqrt(fmax(eps - s, 0.0) * (eps + s));
        const int i = @_ROWS + w->penalties;
        if (root > 0.0) {
            memset(@_col(w, i), 0, @_N * sizeof(double));
            @_col(w, i)[at] = root;
            w->live[w->lives++] = i;
            w->size[i] = root;
            w->norm = hypot(w->norm, root);
            w->penalties++;
        }
    }
    return 1;
}

static int @_attenuate(@_work *w, int level)
{
    const int from = w->used, k = @_N - from;
    const double eps = w->eps[level];
    int j, at, all = 1, count = 0;
    if (!@_decompose_rows(w, w->pulled, w->pulls, from))
        return 0;
    for (j = 0; j < @_N; j++)
        all &= w->scale[j] == 1.0;
    if (all) {
        @_turn_frame(w, &w->svd, from, 0);
        for (j = 0; j < k; j++)
            w->scale[from + j] = @_remainder(&w->svd, j, eps);
    } else {
        memset(w->square, 0, sizeof w->square);
        for (j = 0; j < k; j++)
            for (at = 0; at < @_N; at++) {
                const double *unit = @_col(w, @_MOST + @_N + at) + from;
                const double part = @_remainder(&w->svd, j, eps) * w->scale[at] * @_dot(w->svd.vt + j * k, unit, k);
                @_add(part, unit, w->square + j * k, k);
            }
        if (!@_decompose(&w->other, w->square, k, k))
            return 0;
        @_turn_frame(w, &w->other, from, 1);
        for (j = 0; j < k; j++)
            w->scale[from + j] = fmin(w->other.s[k - 1 - j], 1.0);
    }
    for (j = from; j < @_N; j++)
        w->used += w->scale[j] == 0.0;
    for (j = 0; j < w->used; j++)
        w->scale[j] = 1.0;
    for (j = 0; j < w->svd.p; j++)
        count += w->svd.s[j] >= eps && w->svd.s[j] > 0.0;
    w->ranks[level] = count;
    return 1;
}

/* The solution of the tasks without bounds, level by level. */
static int @_prefer_tasks(@_work *w, int levels)
{
    double y[@_N], rest[@_MOST];
    int level, i, j, c, k, used = 0;
    w->prefers = levels - 1;
    if (w->known)
        return 1;
    w->known = 1;
    memset(y, 0, sizeof y);
    memset(w->directions, 0, sizeof w->directions);
    for (j = 0; j < @_N; j++) {
        w->directions[j * @_N + j] = 1.0;
        w->remains[j] = 1.0;
    }
    for (level = 1; level < @_LEVELS; level++) {
        const int first = @_first[level], m = @_first[level + 1] - first;
        double *x = w->directions + used * @_N;
        double lambda = 1.0, longest = 0.0, eps;
        int complete = 0, all = 1;
        k = @_N - used;
        for (i = 0; i < m; i++) {
            const int task = @_is_task(w, first + i);
            const double *row = w->a + (first + i) * @_N;
            for (j = 0; j < k; j++)
                w->matrix[i * k + j] = task ? @_dot(row, x + j * @_N, @_N) * w->remains[used + j] : 0.0;
            rest[i] = task ? w->lower[first + i] - @_dot(row, y, @_N) : 0.0;
            longest = task ? fmax(longest, w->size[first + i]) : longest;
        }
        eps = @_HAS_EPS ? w->eps[level] : @_EPS * longest;
        if (!@_decompose(&w->svd, w->matrix, m, k))
            return 0;
        for (j = 0; j < w->svd.p; j++) {
            lambda *= w->svd.s[j] >= eps ? 1.0 : w->svd.s[j] / eps;
            complete += @_remainder(&w->svd, j, eps) == 0.0;
        }
        lambda = eps * (1.0 - lambda);
        for (j = 0; j < w->svd.p; j++) {
            const double s = w->svd.s[j], most = fmax(s, eps);
            const double gain = s <= 0.0 ? 0.0 : @_METHOD == 2 ? 1.0 / (s + lambda * (lambda / s)) : s / most / most;
            const double along = gain * @_dot(w->svd.ut + j * m, rest, m);
            for (c = 0; c < k && along != 0.0; c++)
                @_add(along * w->svd.vt[j * k + c], x + c * @_N, y, @_N);
        }
        memcpy(w->preferred + (level - 1) * @_N, y, sizeof y);
        for (j = used; j < @_N; j++)
            all &= w->remains[j] == 1.0;
        if (!all) {
            for (j = 0; j < k - complete; j++)
                for (c = 0; c < k; c++)
                    w->square[j * k + c] = @_remainder(&w->svd, complete + j, eps) * w->svd.vt[(complete + j) * k + c] * w->remains[used + c];
            if (!@_decompose(&w->other, w->square, k - complete, k))
                return 0;
        }
        memset(w->turned, 0, sizeof w->turned);
        for (j = 0; j < k; j++)
            for (c = 0; c < k; c++)
                @_add((all ? w->svd.vt : w->other.vt)[j * k + c], x + c * @_N, w->turned + j * @_N, @_N);
        if (all) {
            memcpy(x, w->turned, (size_t)(k * @_N) * sizeof *x);
            for (j = complete; j < k; j++)
                w->remains[used + j] = @_remainder(&w->svd, j, eps);
            used += complete;
        } else {
            const int remaining = @_above(&w->other, 0.0);
            for (j = 0; j < k; j++)
                memcpy(x + ((j + k - remaining) % k) * @_N, w->turned + j * @_N, @_N * sizeof *x);
            used = @_N - remaining;
            for (j = 0; j < remaining; j++)
                w->remains[used + j] = fmin(w->other.s[j], 1.0);
        }
    }
    return 1;
}

/* The levels. */

static int @_prefer(@_work *w, int level)
{
    int found;
    w->prefers = -1;
    if (@_METHOD != 0) {
        if (!w->touched)
            return 1;
        if (!@_prefer_tasks(w, level - 1))
            return -1;
    }
    @_watch(w);
    @_start_units(w);
    found = @_minimise(w, 1);
    if (level < @_LEVELS) {
        w->pulls = 0;
        @_clear_working(w);
        if (!@_attenuate(w, level))
            return -1;
    }
    return found;
}

static int @_solve_level(@_work *w, int level)
{
    const int damps = level > @_UNDAMPED && @_METHOD != 0;
    int i, j, found = 1;
    if (@_first[level] == @_first[level + 1])
        return 1;
    if (damps && w->touched)
        found = @_prefer(w, level);
    if (found != 1)
        return found;
    @_clear_working(w);
    for (i = @_first[level]; i < @_first[level + 1]; i++)
        w->part[i] = @_OWN;
    w->norm = w->frobenius[level];
    w->level = level;
    @_watch(w);
    if (damps && !@_add_penalties(w, level))
        return -1;
    found = @_minimise(w, 0);
    if (found != 1)
        return found;
    for (j = w->works - 1; j >= 0; j--)
        if (w->multiplier[w->working[j]] == 0.0)
            @_release(w, j);
    w->penalties = w->ties = 0;
    @_pull(w);
    if (w->works > 0)
        w->product /= fmin(@_triangle_bound(w, w->working, w->works, w->used), 1.0);
    w->used += w->works;
    for (j = 0; j < w->works; j++)
        w->part[w->working[j]] = @_FIXED;
    w->works = 0;
    for (i = @_first[level]; i < @_first[level + 1]; i++)
        w->part[i] = @_KEPT;
    for (j = 0; j < w->pulls; j++) {
        w->part[w->pulled[j]] = @_FIXED;
        w->violated[w->pulled[j]] = !@_is_task(w, w->pulled[j]);
    }
    if (damps)
        return @_attenuate(w, level) ? 1 : -1;
    if (!@_factor(w, w->used))
        return -1;
    w->used += w->taken;
    if (w->rank > 0)
        w->product *= fmax(w->condition, 1.0);
    w->ranks[level] = w->rank;
    return 1;
}

/* Read a stack. Return 0 for numbers that are not finite and for bounds out of order. */
static int @_load(@_work *w, const double *jacobian, const double *lower, const double *upper, const double *eps2)
{
    int level, i, c;
    for (level = 0; level < @_LEVELS; level++) {
        double biggest = 0.0, longest = 0.0, sum = 0.0;
        const int from = @_first[level], end = @_first[level + 1];
        w->exponent[level] = 0;
        for (i = from; i < end; i++) {
            double *row = w->a + i * @_N;
            for (c = 0; c < @_N; c++)
                row[c] = level > 0 ? jacobian[(i - @_LIMITS) * @_N + c] : i == c ? 1.0 : 0.0;
            for (c = 0; c < @_N; c++) {
                if (!(fabs(row[c]) <= 1.7976931348623157e308))
                    return 0;
                biggest = fmax(biggest, fabs(row[c]));
            }
            w->lower[i] = lower[i];
            w->upper[i] = upper[i];
            if (!(lower[i] <= upper[i]) || !(lower[i] < INFINITY) || !(upper[i] > -INFINITY))
                return 0;
        }
        if (level > 0 && biggest > 0.0)
            w->exponent[level] = -(int)floor(log2(biggest));
        for (i = from; i < end; i++) {
            double *row = w->a + i * @_N, square;
            for (c = 0; c < @_N; c++)
                row[c] = ldexp(row[c], w->exponent[level]);
            w->lower[i] = ldexp(w->lower[i], w->exponent[level]);
            w->upper[i] = ldexp(w->upper[i], w->exponent[level]);
            square = @_dot(row, row, @_N);
            w->size[i] = sqrt(square);
            longest = fmax(longest, w->size[i]);
            sum += square;
        }
        w->frobenius[level] = sqrt(sum);
        w->eps[level] = eps2 && level > 0 ? ldexp(sqrt(eps2[level - 1]), w->exponent[level]) : @_EPS * longest;
    }
    return 1;
}

/* Solve a stack. The arguments are a number that is not read, the relative error of the rows, the rows, their commands or lower bounds, upper
   bounds, squares of thresholds, and bounds of the joint velocities. The results are the velocities, residuals, ranks and the certificate, which
   is infinite at the limit of changes. */
static void @(const double *arguments, double *results)
{
    const double *jacobian = arguments + 2, *command = jacobian + @_TASKS * @_N, *above = command + @_TASKS;
    const double *eps2 = above + (@_INTERVALS ? @_TASKS : 0), *limits = eps2 + (@_HAS_EPS ? @_LEVELS - 1 : 0);
    double lower[@_ROWS], upper[@_ROWS], *v = results;
    const int count = @_N + @_TASKS + @_LEVELS;
    int i, j, level, found = 1;
    @_work work, *w = &work;
    memset(w, 0, sizeof *w);
    for (i = 0; i < count; i++)
        results[i] = NAN;
    results[count - 1] = 0.0;
    for (level = 0; level < @_LEVELS; level++)
        for (i = @_first[level]; i < @_first[level + 1]; i++) {
            const int k = i - @_LIMITS;
            lower[i] = level > 0 ? command[k] : limits[i];
            upper[i] = level == 0 ? limits[@_N + i] : @_interval[level] ? above[k] : command[k];
        }
    if (!@_load(w, jacobian, lower, upper, @_HAS_EPS ? eps2 : 0))
        return;
    memcpy(w->column, w->a, sizeof w->a);
    for (j = 0; j < @_N; j++) {
        @_col(w, @_MOST + j)[j] = 1.0;
        w->scale[j] = 1.0;
        if (@_LIMITS > 0)
            w->x[j] = fmin(fmax(0.0, lower[j]), upper[j]);
    }
    w->reach = sqrt(@_dot(w->x, w->x, @_N));
    w->rounding = arguments[1];
    w->product = 1.0;
    w->prefers = -1;
    for (j = 0; j < @_N; j++)
        w->touched |= w->x[j] != 0.0;
    for (level = 0; level < @_LEVELS && found == 1; level++)
        found = @_solve_level(w, level);
    if (found == 1)
        found = @_prefer(w, @_LEVELS);
    if (found < 0)
        return;
    for (i = 0; i < @_ROWS; i++) {
        const double value = @_dot(w->a + i * @_N, w->x, @_N), excess = fmax(value - w->upper[i], w->lower[i] - value);
        w->value[i] = value;
        if (w->part[i] != @_LATER && !w->violated[i] && !@_is_task(w, i) && excess > 0.0)
            w->certificate = fmax(w->certificate, excess / (w->size[i] * w->reach));
    }
    memcpy(v, w->x, sizeof w->x);
    for (i = 0; i < @_LIMITS; i++) {
        v[i] = fmin(fmax(v[i], lower[i]), upper[i]);
        if (w->side[i] != 0 && (w->part[i] == @_WORKING || w->part[i] == @_FIXED))
            v[i] = w->side[i] > 0 ? upper[i] : lower[i];
    }
    for (level = 1; level < @_LEVELS; level++) {
        for (i = @_first[level]; i < @_first[level + 1]; i++) {
            const int k = i - @_LIMITS;
            results[@_N + k] = @_interval[level] ? -ldexp(@_violation(w, i), -w->exponent[level]) : command[k] - @_dot(jacobian + k * @_N, v, @_N);
        }
        results[@_N + @_TASKS + level - 1] = w->ranks[level];
    }
    results[count - 1] = found == 1 ? w->certificate : INFINITY;
}


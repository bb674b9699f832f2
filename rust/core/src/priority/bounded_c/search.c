/* The search of a level: goal 0 are the violations, goal 1 is the distance from the preferred velocities. */

static int @_is_task(const @_work *w, int i)
{
    return w->lower[i] == w->upper[i];
}

static double @_tolerance(const @_work *w, int i)
{
    return 1e-13 * w->size[i] * w->reach;
}

static double @_length(const @_work *w)
{
    return sqrt(@_dot(w->step, w->step, @_N));
}

static int @_moves(const @_work *w, int i, double length)
{
    return fabs(w->rate[i]) > 1e-13 * w->size[i] * length;
}

static double @_excess(const @_work *w, int i, double value)
{
    return value - fmin(fmax(value, w->lower[i]), w->upper[i]);
}

static double @_violation(const @_work *w, int i)
{
    const double excess = @_excess(w, i, w->value[i]);
    return !@_is_task(w, i) && fabs(excess) <= @_tolerance(w, i) ? 0.0 : excess;
}

static double @_bound(const @_work *w, int i)
{
    return w->side[i] > 0 ? w->upper[i] : w->lower[i];
}

static double @_distance(const @_work *w, int i)
{
    return i < @_ROWS ? w->value[i] - @_bound(w, i) : w->value[i];
}

static void @_clear_working(@_work *w)
{
    int j;
    for (j = 0; j < w->works; j++) {
        w->part[w->working[j]] = @_KEPT;
        w->multiplier[w->working[j]] = 0.0;
    }
    w->works = 0;
}

static void @_refresh(@_work *w)
{
    double *norm = @_col(w, @_COLUMNS - 1);
    int i, j, c;
    for (j = 0; j < w->watches; j++)
        w->value[w->watched[j]] = @_dot(w->a + w->watched[j] * @_N, w->x, @_N);
    for (i = @_ROWS; i < @_MOST; i++)
        w->value[i] = 0.0;
    memset(norm, 0, @_N * sizeof *norm);
    if (w->goal == 1)
        for (j = 0; j < @_N; j++) {
            const double away = w->x[j] - (w->prefers >= 0 ? w->preferred[w->prefers * @_N + j] : 0.0);
            for (c = 0; c < @_N; c++)
                norm[c] += away * @_col(w, @_MOST + j)[c] * w->scale[c];
        }
}

static void @_watch(@_work *w)
{
    int i;
    w->watches = w->lives = 0;
    for (i = 0; i < @_ROWS; i++)
        if (w->part[i] != @_FIXED && w->part[i] != @_LATER)
            w->watched[w->watches++] = i;
    for (i = 0; i < @_ROWS; i++)
        if (w->part[i] != @_FIXED)
            w->live[w->lives++] = i;
    for (i = 0; i < @_N; i++)
        w->live[w->lives++] = @_MOST + i;
    w->live[w->lives++] = @_COLUMNS - 1;
}

static void @_pull(@_work *w)
{
    int at, k;
    w->pulls = 0;
    if (w->goal != 0)
        return;
    for (at = 0; at < w->watches; at++) {
        const int i = w->watched[at];
        double violation;
        int side = 0;
        if (w->part[i] != @_OWN)
            continue;
        violation = @_violation(w, i);
        for (k = 0; k < w->ties && side == 0; k++)
            side = w->tied[k] == i ? w->tied_side[k] : 0;
        if (!@_is_task(w, i) && violation != 0.0)
            side = violation > 0.0 ? 1 : -1;
        w->side[i] = side;
        if (side != 0 || @_is_task(w, i)) {
            w->pulled[w->pulls++] = i;
            w->touched |= side != 0;
        }
    }
    for (k = 0; k < w->penalties; k++)
        w->pulled[w->pulls++] = @_ROWS + k;
}

static void @_rates(@_work *w, int from)
{
    int k;
    for (k = 0; k < w->watches + w->penalties; k++) {
        const int i = k < w->watches ? w->watched[k] : @_ROWS + k - w->watches;
        w->rate[i] = @_dot(@_col(w, i) + from, w->step + from, @_N - from);
    }
}

static int @_step_on_face(@_work *w)
{
    const int from = w->used + w->works;
    int i;
    if (w->goal != 0) {
        for (i = 0; i < @_N; i++)
            w->step[i] = i < from ? 0.0 : -@_col(w, @_COLUMNS - 1)[i];
    } else {
        for (i = 0; i < w->pulls; i++)
            w->right[i] = -@_distance(w, w->pulled[i]);
        if (!@_factor(w, from))
            return 0;
        @_solve_face(w);
    }
    @_rates(w, from);
    return 1;
}

static int @_is_feasible(const @_work *w)
{
    const double length = @_length(w);
    int k;
    for (k = 0; k < w->watches; k++) {
        const int i = w->watched[k];
        const double slack = @_tolerance(w, i), value = w->value[i] + w->rate[i];
        const int own = w->part[i] == @_OWN, above = value > w->upper[i] + slack, below = value < w->lower[i] - slack;
        if (!@_moves(w, i, length) || (!own && w->part[i] != @_KEPT) || (own && @_is_task(w, i)))
            continue;
        if (own && w->side[i] > 0 ? !(value >= w->upper[i] - slack) : own && w->side[i] < 0 ? !(value <= w->lower[i] + slack) : above || below)
            return 0;
    }
    return 1;
}

static void @_advance(@_work *w, int from, double t)
{
    int k;
    for (k = 0; k < w->watches + w->penalties; k++) {
        const int i = k < w->watches ? w->watched[k] : @_ROWS + k - w->watches;
        w->value[i] += t * w->rate[i];
    }
    for (k = 0; k < @_N; k++)
        w->x[k] += t * @_dot(@_col(w, @_MOST + k) + from, w->step + from, @_N - from);
    if (w->goal == 1)
        @_add(t, w->step + from, @_col(w, @_COLUMNS - 1) + from, @_N - from);
    w->reach = fmax(w->reach, sqrt(@_dot(w->x, w->x, @_N)));
}

static double @_slope(@_work *w, int from, double t)
{
    double sum = 0.0;
    int k;
    if (w->goal == 1)
        return @_dot(w->step + from, @_col(w, @_COLUMNS - 1) + from, @_N - from) + t * @_dot(w->step + from, w->step + from, @_N - from);
    for (k = 0; k < w->watches; k++) {
        const int i = w->watched[k];
        if (w->part[i] == @_OWN)
            sum += @_excess(w, i, w->value[i] + t * w->rate[i]) * w->rate[i];
    }
    for (k = @_ROWS; k < @_ROWS + w->penalties; k++)
        sum += (w->value[k] + t * w->rate[k]) * w->rate[k];
    return sum;
}

static double @_line_search(@_work *w, int from, int leaving, int *row, int *row_side)
{
    const double length = @_length(w);
    double most = 1.0, low = 0.0, high, low_slope, high_slope, t;
    int k, b;
    *row = -1;
    for (k = 0; k < w->watches; k++) {
        const int i = w->watched[k], side = w->rate[i] > 0.0 ? 1 : -1;
        const double slack = @_tolerance(w, i), distance = ((side > 0 ? w->upper[i] : w->lower[i]) - w->value[i]) * side;
        if (w->part[i] == @_KEPT && @_moves(w, i, length) && distance + slack < fabs(w->rate[i]) && !(leaving && distance <= slack)) {
            t = fmax(distance, 0.0) / fabs(w->rate[i]);
            if (t < most) {
                most = t;
                *row = i;
                *row_side = side;
            }
        }
    }
    high = most;
    high_slope = @_slope(w, from, most);
    if (high_slope <= 0.0)
        return most;
    low_slope = @_slope(w, from, 0.0);
    for (k = 0; k < w->watches; k++) {
        const int i = w->watched[k];
        if (w->part[i] != @_OWN || @_is_task(w, i))
            continue;
        for (b = 0; b < 2; b++) {
            t = ((b ? w->upper[i] : w->lower[i]) - w->value[i]) / w->rate[i];
            if (t > low && t < high) {
                const double slope = @_slope(w, from, t);
                if (slope <= 0.0) {
                    low = t;
                    low_slope = slope;
                } else {
                    high = t;
                    high_slope = slope;
                }
            }
        }
    }
    *row = -1;
    t = high_slope > low_slope ? low - low_slope * (high - low) / (high_slope - low_slope) : low;
    return fmin(fmax(t, low), high);
}

static void @_hold(@_work *w, int i, int side)
{
    @_hold_column(w, i, w->used + w->works);
    w->working[w->works++] = i;
    w->touched = 1;
    w->part[i] = @_WORKING;
    w->side[i] = side;
    w->value[i] = @_bound(w, i);
}

static void @_release(@_work *w, int j)
{
    const int i = w->working[j];
    int at;
    w->works--;
    for (at = j; at < w->works; at++)
        w->working[at] = w->working[at + 1];
    w->part[i] = @_KEPT;
    w->multiplier[i] = 0.0;
    for (at = j; at < w->works; at++)
        @_rotate(w, w->working[at], w->used + at);
}

static double @_gradient(@_work *w, int at)
{
    double sum = 0.0;
    int k;
    for (k = 0; k < w->pulls; k++)
        sum += @_distance(w, w->pulled[k]) * @_col(w, w->pulled[k])[at];
    return sum + @_col(w, @_COLUMNS - 1)[at];
}

static void @_multipliers(@_work *w)
{
    int j, k;
    for (j = w->works - 1; j >= 0; j--) {
        double force = 0.0;
        for (k = j + 1; k < w->works; k++)
            force += w->multiplier[w->working[k]] * @_col(w, w->working[k])[w->used + j];
        w->multiplier[w->working[j]] = -(@_gradient(w, w->used + j) + force) / @_col(w, w->working[j])[w->used + j];
    }
}

static double @_zero_force(const @_work *w)
{
    double most = 0.0;
    int k;
    if (w->goal == 1)
        return 1e-11 * w->reach;
    for (k = 0; k < w->pulls; k++) {
        const int i = w->pulled[k];
        if (i < @_ROWS)
            most = fmax(most, w->size[i] * (1e-11 * fabs(@_distance(w, i)) + 10.0 * @_tolerance(w, i)));
    }
    return most;
}

static void @_find_multipliers(@_work *w)
{
    const double zero = @_zero_force(w);
    int j;
    @_multipliers(w);
    for (j = 0; j < w->works; j++)
        if (fabs(w->multiplier[w->working[j]]) * w->size[w->working[j]] <= zero)
            w->multiplier[w->working[j]] = 0.0;
}

static double @_stationarity(@_work *w)
{
    double term = 0.0, largest, most = 0.0;
    int k, at, own = 0;
    for (k = 0; k < w->pulls; k++)
        if (w->pulled[k] < @_ROWS) {
            term = fmax(term, fabs(@_distance(w, w->pulled[k])));
            own++;
        }
    largest = w->goal == 1 ? w->reach : fmax(w->frobenius[w->level] * term, w->norm * w->norm * w->reach);
    for (k = 0; k < w->works; k++)
        largest = fmax(largest, fabs(w->multiplier[w->working[k]]) * w->size[w->working[k]]);
    for (at = w->used; at < @_N; at++) {
        double rest = @_gradient(w, at);
        for (k = 0; k < w->works; k++)
            rest += w->multiplier[w->working[k]] * @_col(w, w->working[k])[at];
        most = fmax(most, fabs(rest));
    }
    most -= w->rounding * w->norm * w->product * term * sqrt((double)own);
    return most <= 0.0 ? 0.0 : most / fmax(largest, most);
}


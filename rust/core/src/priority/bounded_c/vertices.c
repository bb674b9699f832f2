/* A vertex with more active rows than working rows: non-negative least squares of the forces. */

static void @_nonnegative(@_work *w)
{
    int at;
    while (w->works > 0) {
        double most = INFINITY;
        int first = -1;
        for (at = 0; at < w->works; at++)
            w->right[at] = w->multiplier[w->working[at]] * w->side[w->working[at]];
        @_multipliers(w);
        for (at = 0; at < w->works; at++) {
            const double old = w->right[at], next = w->multiplier[w->working[at]] * w->side[w->working[at]];
            if (next <= 0.0 && old / (old - next) < most) {
                most = old > 0.0 ? old / (old - next) : 0.0;
                first = at;
            }
        }
        if (first < 0)
            return;
        for (at = 0; at < w->works; at++) {
            const int i = w->working[at];
            const double old = w->right[at];
            w->multiplier[i] = w->side[i] * fmax(old + most * (w->multiplier[i] * w->side[i] - old), 0.0);
        }
        @_release(w, first);
    }
}

static int @_leave_vertex(@_work *w)
{
    double largest = 0.0, t;
    int at, pass, k, from, row, side, decreases;
    @_clear_working(w);
    for (at = w->used; at < @_N; at++)
        largest += @_gradient(w, at) * @_gradient(w, at);
    largest = sqrt(largest);
    for (pass = 0; pass < 10 * @_ROWS; pass++) {
        double residual, steepest = 1e-11;
        row = -1;
        side = 0;
        from = w->used + w->works;
        for (at = 0; at < @_N; at++)
            w->step[at] = at < from ? 0.0 : @_gradient(w, at);
        residual = @_length(w);
        if (residual <= 1e-11 * largest)
            break;
        for (k = 0; k < w->watches; k++) {
            const int i = w->watched[k];
            int s;
            if (w->part[i] != @_KEPT)
                continue;
            for (s = 1; s >= -1; s -= 2) {
                const double distance = s > 0 ? w->upper[i] - w->value[i] : w->value[i] - w->lower[i];
                const double cosine = -@_dot(@_col(w, i) + from, w->step + from, @_N - from) * s / (residual * w->size[i]);
                if (distance <= @_tolerance(w, i) && cosine > steepest) {
                    steepest = cosine;
                    row = i;
                    side = s;
                }
            }
        }
        if (row < 0)
            break;
        @_hold(w, row, side);
        @_nonnegative(w);
    }
    decreases = @_length(w) > 1e-11 * largest;
    for (at = 0; at < @_N; at++)
        w->step[at] = -w->step[at];
    from = w->used + w->works;
    @_rates(w, from);
    t = @_line_search(w, from, 1, &row, &side);
    if (!decreases || !(t * @_length(w) > 1e-12 * w->reach)) {
        @_find_multipliers(w);
        return 0;
    }
    @_advance(w, from, t);
    if (row >= 0)
        @_hold(w, row, side);
    return 1;
}

static int @_tie(@_work *w)
{
    const double length = @_length(w);
    const int known = w->ties;
    int k;
    for (k = 0; k < w->watches; k++) {
        const int i = w->watched[k], side = w->rate[i] > 0.0 ? 1 : -1;
        const double bound = side > 0 ? w->upper[i] : w->lower[i];
        if (w->part[i] == @_OWN && !@_is_task(w, i) && w->side[i] == 0 && w->ties < @_ROWS &&
            fabs(w->value[i] - bound) <= @_tolerance(w, i) && @_moves(w, i, length)) {
            w->tied[w->ties] = i;
            w->tied_side[w->ties++] = side;
        }
    }
    return w->ties > known;
}

static int @_worst(const @_work *w)
{
    double most = @_zero_force(w);
    int j, found = -1;
    for (j = 0; j < w->works; j++) {
        const int i = w->working[j];
        const double force = -w->multiplier[i] * w->side[i] * w->size[i];
        if (force > most || (force == most && found >= 0 && i < w->working[found])) {
            most = force;
            found = j;
        }
    }
    return found;
}

/* Return 1 at the minimiser, 0 at the limit of changes, -1 if a decomposition does not converge. */
static int @_search(@_work *w)
{
    int pass, moved = 1, refinements = 0;
    w->ties = 0;
    for (pass = 0; pass < 100 + 10 * @_ROWS; pass++) {
        @_pull(w);
        if (!@_step_on_face(w))
            return -1;
        if (@_is_feasible(w)) {
            int worst;
            moved |= @_length(w) > 1e-12 * w->reach;
            @_advance(w, w->used + w->works, 1.0);
            @_find_multipliers(w);
            if (refinements < 3 && @_stationarity(w) > 1e-12) {
                refinements++;
                continue;
            }
            refinements = 0;
            worst = @_worst(w);
            if (worst < 0)
                return 1;
            if (moved) {
                moved = 0;
                @_release(w, worst);
            } else if (!@_leave_vertex(w)) {
                return 1;
            }
        } else {
            int row, side = 0;
            const double t = @_line_search(w, w->used + w->works, 0, &row, &side);
            const int moves = t * @_length(w) > 1e-12 * w->reach;
            moved |= moves;
            @_advance(w, w->used + w->works, t);
            if (moves || row >= 0)
                w->ties = 0;
            else if (!@_tie(w))
                return 1;
            if (row >= 0)
                @_hold(w, row, side);
        }
        w->changes++;
    }
    return 0;
}

static int @_minimise(@_work *w, int goal)
{
    int found;
    w->goal = goal;
    @_refresh(w);
    found = @_search(w);
    w->certificate = fmax(w->certificate, @_stationarity(w));
    return found;
}


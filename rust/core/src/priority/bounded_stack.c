/* A stack of levels with bounds by the active-set method. The code mirrors armlet's solver, and its comments are there: a level minimises its
   violations on the rows and bounds that the higher levels leave. No memory is allocated, and the number of iterations is bounded. */
enum {
    @_LEVELS = sizeof @_first / sizeof *@_first - 1,
    @_TASKS = @_ROWS - @_LIMITS,
    @_MOST = @_ROWS + @_N,
    @_COLUMNS = @_ROWS + 3 * @_N + 1
};
enum { @_LATER, @_OWN, @_KEPT, @_WORKING, @_FIXED };

typedef struct {
    int m, k, p;
    double work[@_MOST * @_N], beta[@_N], g[@_N * @_N], vt[@_N * @_N], ut[@_N * @_MOST], s[@_N];
} @_svd;

typedef struct {
    double a[@_ROWS * @_N], lower[@_ROWS], upper[@_ROWS], size[@_MOST], eps[@_LEVELS], frobenius[@_LEVELS];
    int exponent[@_LEVELS];
    double column[@_COLUMNS * @_N];
    int used, live[@_COLUMNS], lives;
    @_svd svd, other;
    double matrix[(@_N + 1) * @_MOST], beta[@_N], diagonal[@_N], scratch[@_MOST], condition;
    int form, from, rank, taken;
    double norm, rounding, product;
    double x[@_N], reach, value[@_MOST], multiplier[@_ROWS];
    int part[@_ROWS], side[@_MOST], violated[@_ROWS];
    int watched[@_ROWS], watches, working[@_N], works, pulled[@_MOST], pulls, tied[@_ROWS], tied_side[@_ROWS], ties, penalties;
    double step[@_N], rate[@_MOST], right[@_MOST];
    int goal, touched, changes;
    double certificate, ranks[@_LEVELS];
    double preferred[@_LEVELS * @_N], scale[@_N], square[@_N * @_N];
    int known, prefers;
    double directions[@_N * @_N], remains[@_N], turned[@_N * @_N];
} @_work;

static double @_dot(const double *a, const double *b, int n)
{
    double sum = 0.0;
    int i;
    for (i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

static void @_add(double s, const double *x, double *y, int n)
{
    int i;
    for (i = 0; i < n; i++)
        y[i] += s * x[i];
}

static double @_reflector(double *x, int n, double *beta)
{
    const double x0 = x[0], tail = @_dot(x + 1, x + 1, n - 1);
    double norm, alpha;
    *beta = 0.0;
    if (tail < 1e-290)
        return x0;
    norm = sqrt(x0 * x0 + tail);
    alpha = -copysign(norm, x0);
    x[0] = x0 - alpha;
    *beta = 1.0 / (norm * (norm + fabs(x0)));
    return alpha;
}

static void @_reflect(const double *w, double beta, double *y, int n)
{
    @_add(-beta * @_dot(w, y, n), w, y, n);
}

static void @_swap(double *a, double *b, int n)
{
    int i;
    for (i = 0; i < n; i++) {
        const double x = a[i];
        a[i] = b[i];
        b[i] = x;
    }
}

static void @_turn(double *a, double *b, int n, double c, double s)
{
    int i;
    for (i = 0; i < n; i++) {
        const double x = a[i], y = b[i];
        a[i] = c * x - s * y;
        b[i] = s * x + c * y;
    }
}

/* Singular value decomposition by rotations of the triangular factor. */
static int @_decompose(@_svd *d, const double *a, int m, int k)
{
    const int p = m < k ? m : k, len = m <= k ? k : m;
    const double tol = 0x1p-52 * (p > 4 ? p : 4);
    int i, j, sweep, quiet = 0;
    d->m = m;
    d->k = k;
    d->p = p;
    memset(d->vt, 0, sizeof d->vt);
    for (i = 0; i < k; i++)
        d->vt[i * k + i] = 1.0;
    for (i = 0; i < m; i++)
        for (j = 0; j < k; j++)
            d->work[m <= k ? i * k + j : j * m + i] = a[i * k + j];
    for (j = 0; j < p; j++) {
        d->s[j] = @_reflector(d->work + j * len + j, len - j, d->beta + j);
        if (d->beta[j] != 0.0)
            for (i = j + 1; i < p; i++)
                @_reflect(d->work + j * len + j, d->beta[j], d->work + i * len + j, len - j);
    }
    if (m <= k)
        for (j = m - 1; j >= 0; j--)
            for (i = j; i < k; i++)
                @_reflect(d->work + j * k + j, d->beta[j], d->vt + i * k + j, k - j);
    for (i = 0; i < p; i++) {
        for (j = 0; j < i; j++) {
            const double x = d->work[i * len + j];
            d->g[j * p + i] = m <= k ? x : 0.0;
            d->g[i * p + j] = m <= k ? 0.0 : x;
        }
        d->g[i * p + i] = d->s[i];
    }
    for (sweep = 0; sweep < 60 && !quiet; sweep++) {
        quiet = 1;
        for (i = 0; i < p; i++)
            for (j = i + 1; j < p; j++) {
                double *gi = d->g + i * p, *gj = d->g + j * p;
                const double a2 = @_dot(gi, gi, p), b2 = @_dot(gj, gj, p), c = @_dot(gi, gj, p);
                double zeta, t, cosine;
                if (c * c <= tol * tol * a2 * b2 || a2 == 0.0 || b2 == 0.0)
                    continue;
                quiet = 0;
                zeta = (b2 - a2) / (2.0 * c);
                t = fabs(zeta) > 1e150 ? 0.5 / zeta : copysign(1.0, zeta) / (fabs(zeta) + sqrt(1.0 + zeta * zeta));
                cosine = 1.0 / sqrt(1.0 + t * t);
                @_turn(gi, gj, p, cosine, cosine * t);
                @_turn(d->vt + i * k, d->vt + j * k, k, cosine, cosine * t);
            }
    }
    for (j = 0; j < p; j++)
        d->s[j] = sqrt(@_dot(d->g + j * p, d->g + j * p, p));
    for (i = 0; i < p; i++) {
        double *u = d->ut + i * m;
        int top = i;
        for (j = i + 1; j < p; j++)
            if (d->s[j] > d->s[top])
                top = j;
        if (top != i) {
            @_swap(d->s + i, d->s + top, 1);
            @_swap(d->g + i * p, d->g + top * p, p);
            @_swap(d->vt + i * k, d->vt + top * k, k);
        }
        memset(u, 0, (size_t)m * sizeof *u);
        if (d->s[i] > 0.0)
            @_add(1.0 / d->s[i], d->g + i * p, u, p);
        if (m > k)
            for (j = k - 1; j >= 0; j--)
                @_reflect(d->work + j * m + j, d->beta[j], u + j, m - j);
    }
    return quiet;
}

static int @_above(const @_svd *d, double cut)
{
    int i, count = 0;
    for (i = 0; i < d->p; i++)
        count += d->s[i] > cut;
    return count;
}

static double @_remainder(const @_svd *d, int j, double eps)
{
    const double s = j < d->p ? d->s[j] : 0.0, x = s / eps;
    return s <= 0.0 ? 1.0 : x >= 1.0 ? 0.0 : (1.0 - x) * (1.0 + x);
}

/* The frame. */

static double *@_col(@_work *w, int i)
{
    return w->column + i * @_N;
}

static void @_hold_column(@_work *w, int i, int from)
{
    double v[@_N], beta, alpha;
    const int n = @_N - from;
    int at;
    memcpy(v, @_col(w, i) + from, (size_t)n * sizeof *v);
    alpha = @_reflector(v, n, &beta);
    if (beta != 0.0)
        for (at = 0; at < w->lives; at++)
            @_reflect(v, beta, @_col(w, w->live[at]) + from, n);
    memset(@_col(w, i) + from, 0, (size_t)n * sizeof *v);
    @_col(w, i)[from] = alpha;
}

static void @_rotate(@_work *w, int i, int at)
{
    const double x = @_col(w, i)[at], y = @_col(w, i)[at + 1], r = hypot(x, y);
    int k;
    if (y == 0.0 || r == 0.0)
        return;
    for (k = 0; k < w->lives; k++) {
        double *c = @_col(w, w->live[k]) + at;
        const double c0 = c[0], c1 = c[1];
        c[0] = x / r * c0 + y / r * c1;
        c[1] = x / r * c1 - y / r * c0;
    }
    @_col(w, i)[at + 1] = 0.0;
}

static void @_turn_frame(@_work *w, const @_svd *d, int from, int smallest_first)
{
    const int k = @_N - from;
    double old[@_N];
    int at, j;
    for (at = 0; at < w->lives; at++) {
        double *c = @_col(w, w->live[at]) + from;
        memcpy(old, c, (size_t)k * sizeof *old);
        for (j = 0; j < k; j++)
            c[j] = @_dot(d->vt + (smallest_first ? k - 1 - j : j) * k, old, k);
    }
}

/* The face. */

static int @_decompose_rows(@_work *w, const int *rows, int m, int from)
{
    const int k = @_N - from;
    int r;
    for (r = 0; r < m; r++)
        memcpy(w->matrix + r * k, @_col(w, rows[r]) + from, (size_t)k * sizeof(double));
    return @_decompose(&w->svd, w->matrix, m, k);
}

static double @_triangle_bound(@_work *w, const int *rows, int m, int from)
{
    double sum = 0.0;
    int c, i, j;
    for (c = 0; c < m; c++)
        for (i = c; i < m; i++) {
            const double *row = @_col(w, rows[i]) + from;
            double known = 0.0;
            for (j = c; j < i; j++)
                known += row[j] / w->size[rows[i]] * w->scratch[j];
            w->scratch[i] = ((i == c ? 1.0 : 0.0) - known) / (row[i] / w->size[rows[i]]);
            sum += w->scratch[i] * w->scratch[i];
        }
    return sum <= 1.7976931348623157e308 ? 1.0 / sqrt(sum) : 0.0;
}

static double @_factor_tall(@_work *w, int m, int k)
{
    double sum = 0.0;
    int c, i, j;
    for (i = 0; i < m; i++)
        for (c = 0; c < k; c++)
            w->matrix[c * m + i] = @_col(w, w->pulled[i])[w->from + c];
    for (c = 0; c < k; c++) {
        double *v = w->matrix + c * m + c;
        w->diagonal[c] = @_reflector(v, m - c, w->beta + c);
        if (w->beta[c] != 0.0)
            for (j = c + 1; j < k; j++)
                @_reflect(v, w->beta[c], w->matrix + j * m + c, m - c);
    }
    for (c = 0; c < k; c++)
        for (i = c; i < k; i++) {
            double known = 0.0;
            for (j = c; j < i; j++)
                known += w->matrix[i * m + j] * w->scratch[j];
            w->scratch[i] = ((i == c ? 1.0 : 0.0) - known) / w->diagonal[i];
            sum += w->scratch[i] * w->scratch[i];
        }
    return sum <= 1.7976931348623157e308 ? 1.0 / sqrt(sum) : 0.0;
}

static int @_factor(@_work *w, int from)
{
    const int m = w->pulls, k = @_N - from;
    double regular, shortest = w->norm, noise = w->rounding * w->norm;
    int i;
    w->from = from;
    w->rank = w->taken = m < k ? m : k;
    w->condition = 1.0;
    w->form = m <= k ? 0 : 1;
    if (w->rank == 0)
        return 1;
    if (m <= k) {
        for (i = 0; i < m; i++)
            @_hold_column(w, w->pulled[i], from + i);
        regular = @_triangle_bound(w, w->pulled, m, from);
    } else {
        regular = @_factor_tall(w, m, k) / w->norm;
    }
    for (i = 0; i < m; i++)
        shortest = fmin(shortest, w->size[w->pulled[i]]);
    shortest /= w->norm;
    if (regular > fmax(1e-6, w->rounding * w->product) && (m > k || regular * shortest > w->rounding)) {
        w->condition = 1.0 / regular;
        return 1;
    }
    if (!@_decompose_rows(w, w->pulled, m, from))
        return 0;
    @_turn_frame(w, &w->svd, from, 0);
    w->form = 2;
    w->rank = @_above(&w->svd, noise * w->product);
    w->taken = @_above(&w->svd, noise);
    w->taken = w->taken > w->rank ? w->taken : w->rank;
    w->condition = w->rank > 0 ? w->norm / w->svd.s[w->rank - 1] : 1.0;
    return 1;
}

static void @_solve_face(@_work *w)
{
    const int m = w->pulls, from = w->from, k = @_N - from;
    double *r = w->right, *p = w->step;
    int c, j;
    memset(p, 0, sizeof w->step);
    if (w->form == 0) {
        for (j = 0; j < m; j++) {
            const double *row = @_col(w, w->pulled[j]) + from;
            p[from + j] = (r[j] - @_dot(row, p + from, j)) / row[j];
        }
    } else if (w->form == 1) {
        for (c = 0; c < k; c++)
            @_reflect(w->matrix + c * m + c, w->beta[c], r + c, m - c);
        for (c = k - 1; c >= 0; c--) {
            p[from + c] = r[c] / w->diagonal[c];
            @_add(-p[from + c], w->matrix + c * m, r, c);
        }
    } else {
        for (j = 0; j < w->rank; j++)
            p[from + j] = @_dot(w->svd.ut + j * m, r, m) / w->svd.s[j];
    }
}

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
    const double size = w->goal == 1 ? 1.0 : w->norm;
    double term = 0.0, largest, most = 0.0;
    int k, at;
    for (k = 0; k < w->pulls; k++)
        if (w->pulled[k] < @_ROWS)
            term = fmax(term, fabs(@_distance(w, w->pulled[k])));
    largest = size * fmax(term, size * w->reach);
    for (k = 0; k < w->works; k++)
        largest = fmax(largest, fabs(w->multiplier[w->working[k]]) * w->size[w->working[k]]);
    for (at = w->used; at < @_N; at++) {
        double rest = @_gradient(w, at);
        for (k = 0; k < w->works; k++)
            rest += w->multiplier[w->working[k]] * @_col(w, w->working[k])[at];
        most = fmax(most, fabs(rest));
    }
    return most == 0.0 ? 0.0 : most / fmax(largest, most);
}

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
    if (regular)
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


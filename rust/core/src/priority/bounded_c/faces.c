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


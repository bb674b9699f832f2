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
    int level;
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


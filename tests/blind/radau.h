/* Steps of the three-stage Radau IIA method (Hairer and Wanner, Solving ODEs II, IV.8) for tube.c, which includes this
 * once its right-hand side `rates`, its inputs and the sizes of its states are known. */
/* LU with pivots, in place; 0 where singular. */
static int factor(int n, double *M, int *pivot)
{
    for (int k = 0; k < n; k++) {
        int best = k;
        for (int i = k + 1; i < n; i++) if (fabs(M[i * n + k]) > fabs(M[best * n + k])) best = i;
        pivot[k] = best;
        if (M[best * n + k] == 0) return 0;
        if (best != k) for (int j = 0; j < n; j++) {
            double s = M[k * n + j]; M[k * n + j] = M[best * n + j]; M[best * n + j] = s;
        }
        for (int i = k + 1; i < n; i++) {
            double f = M[i * n + k] /= M[k * n + k];
            if (f != 0) for (int j = k + 1; j < n; j++) M[i * n + j] -= f * M[k * n + j];
        }
    }
    return 1;
}

static void solve(int n, const double *M, const int *pivot, double *r)
{
    for (int k = 0; k < n; k++) { double s = r[k]; r[k] = r[pivot[k]]; r[pivot[k]] = s; }
    for (int i = 1; i < n; i++) for (int j = 0; j < i; j++) r[i] -= M[i * n + j] * r[j];
    for (int i = n - 1; i >= 0; i--) {
        for (int j = i + 1; j < n; j++) r[i] -= M[i * n + j] * r[j];
        r[i] /= M[i * n + i];
    }
}

#define S6 2.449489742783178
static const double NODE[3] = {(4 - S6) / 10, (4 + S6) / 10, 1};
static const double RADAU[3][3] = {{(88 - 7 * S6) / 360, (296 - 169 * S6) / 1800, (-2 + 3 * S6) / 225},
                                   {(296 + 169 * S6) / 1800, (88 + 7 * S6) / 360, (-2 - 3 * S6) / 225},
                                   {(16 - S6) / 36, (16 + S6) / 36, 1. / 9}};
static const double DENSE[3][3] = {{13. / 3 + 7 * S6 / 3, -23. / 3 - 22 * S6 / 3, 10. / 3 + 5 * S6},
                                   {13. / 3 - 7 * S6 / 3, -23. / 3 + 22 * S6 / 3, 10. / 3 - 5 * S6},
                                   {1. / 3, -8. / 3, 10. / 3}};
static const double ESTIMATE[3] = {(-13 - 7 * S6) / 3, (-13 + 7 * S6) / 3, -1. / 3};
#define REAL_ROOT 3.637834252744496
enum { WIDE = 3 * NX, TURNS = 8 };

typedef struct { double z[3][NX]; double error; } Step;

static void jacobian(const Bench *b, int n, const int *used, double t, const double *x, double p, double v, double *J)
{
    double moved[NX], f[NX], g[NX];
    rates(b, t, x, p, v, f);
    memcpy(moved, x, sizeof moved);
    for (int j = 0; j < n; j++) {
        double h = 1e-7 * (SIZE[used[j]] + fabs(x[used[j]]));
        moved[used[j]] += h;
        rates(b, t, moved, p, v, g);
        moved[used[j]] = x[used[j]];
        for (int i = 0; i < n; i++) J[i * n + j] = (g[used[i]] - f[used[i]]) / h;
    }
}

/* One step of h from x; 0 where Newton does not settle. `s->z` may hold a guess. */
static int step(const Bench *b, int n, const int *used, Inputs *in, long last, double t, double h, const double *x,
                double tol, Step *s)
{
    double J[NX * NX], M[WIDE * WIDE], R[NX * NX], r[WIDE], y[NX], f[3][NX], p, v, before = 0;
    int pivot[WIDE], turned[NX], turn;
    inputs_at(in, t, &p, &v, last);
    jacobian(b, n, used, t, x, p, v, J);
    for (int k = 0; k < 3; k++) for (int l = 0; l < 3; l++)
        for (int i = 0; i < n; i++) for (int j = 0; j < n; j++)
            M[(k * n + i) * 3 * n + l * n + j] = (k == l && i == j) - h * RADAU[k][l] * J[i * n + j];
    if (!factor(3 * n, M, pivot)) return 0;
    for (turn = 0; turn < TURNS; turn++) {
        double size = 0;
        for (int k = 0; k < 3; k++) {
            memcpy(y, x, sizeof y);
            for (int i = 0; i < n; i++) y[used[i]] += s->z[k][i];
            inputs_at(in, t + NODE[k] * h, &p, &v, last);
            rates(b, t + NODE[k] * h, y, p, v, f[k]);
        }
        for (int k = 0; k < 3; k++) for (int i = 0; i < n; i++) {
            double sum = 0;
            for (int l = 0; l < 3; l++) sum += RADAU[k][l] * f[l][used[i]];
            r[k * n + i] = h * sum - s->z[k][i];
        }
        solve(3 * n, M, pivot, r);
        for (int k = 0; k < 3; k++) for (int i = 0; i < n; i++) {
            s->z[k][i] += r[k * n + i];
            double q = r[k * n + i] / (SIZE[used[i]] + fabs(x[used[i]]));
            size += q * q;
        }
        size = sqrt(size / (3 * n));
        if (!isfinite(size) || (turn && size > 2 * before)) return 0;
        if (size < 0.03 * tol) break;
        before = size;
    }
    if (turn == TURNS) return 0;
    for (int i = 0; i < n * n; i++) R[i] = -J[i];
    for (int i = 0; i < n; i++) R[i * n + i] += REAL_ROOT / h;
    inputs_at(in, t, &p, &v, last);
    rates(b, t, x, p, v, f[0]);
    for (int i = 0; i < n; i++) {
        r[i] = f[0][used[i]];
        for (int k = 0; k < 3; k++) r[i] += ESTIMATE[k] * s->z[k][i] / h;
    }
    if (!factor(n, R, turned)) return 0;
    solve(n, R, turned, r);
    s->error = 0;
    for (int i = 0; i < n; i++) {
        double q = r[i] / (tol * (SIZE[used[i]] + fabs(x[used[i]])));
        s->error += q * q / n;
    }
    s->error = fmax(sqrt(s->error), 1e-10);
    return isfinite(s->error);
}


/* A tubular DEA on a bench, written for blind trials: own equations of motion, own integrator, own effects.
 *
 * Forces are divided by the wall volume of one half tube (see tests/independent.py); effects are in other functional
 * forms than those of the package on purpose. Time is stepped by Alexander's two-stage SDIRK (L-stable, order 2). */
#include <math.h>
#include <string.h>

enum { LAM, RATE, VIS1, VIS2, ELEC1, ELEC2, SLEWED, TRAP, HOOP1, HOOP2, EXTRA1, EXTRA2, GRIP, MOST, SET, WARMTH, LINE1,
       LINE2, NX };
enum { R_O, L_O, H_O, H_AO, RHO, C_1, C_2, C_3, EPS_R, ETA_O, K_1, ETA_1, K_2, ETA_2, N_TUBE };
/* Effect numbers and what their a, b, c are: see EFFECTS in bench.py. */
enum { NOTHING, ELECTRODE, SLEW, TRAPPING, EPS_STRETCH, EPS_FIELD, THINNING, ETA_STRETCH, HOOP_VISCO, THIRD_BRANCH,
       MULLINS, FRICTION, PERMANENT_SET, PRESTRETCH, PASSIVE, STIFFENING, CLAMP, STOP, THERMAL, P_OFFSET, P_GAIN,
       P_DELAY, P_LINE, R_OFFSET, R_GAIN, R_LAG, R_DELAY, ODD_MECHANICAL, ODD_ELECTRICAL, ODD_PRESSURE, N_EFFECTS };

typedef struct { const double *tube; const double *on; /* N_EFFECTS x 4: switched on, a, b, c */ } Bench;
#define HAS(e) (b->on[4 * (e)] != 0)
#define A(e) (b->on[4 * (e) + 1])
#define B(e) (b->on[4 * (e) + 2])
#define C(e) (b->on[4 * (e) + 3])

static double softplus(double x) { return x > 30 ? x : log1p(exp(x)); }

static void rates(const Bench *b, double t, const double *x, double p, double p_rate, double v, double *dx)
{
    const double *c = b->tube;
    double lam = x[LAM], rate = x[RATE], r_l = c[R_O] / c[L_O];
    memset(dx, 0, NX * sizeof *dx);
    /* pressure path */
    if (HAS(P_GAIN)) p *= A(P_GAIN);
    if (HAS(P_OFFSET)) p += A(P_OFFSET);
    if (HAS(ODD_PRESSURE)) p += A(ODD_PRESSURE) * sin(p / B(ODD_PRESSURE));
    if (HAS(P_LINE)) { /* two compartments in a row */
        dx[LINE1] = (p - x[LINE1]) / A(P_LINE);
        dx[LINE2] = (x[LINE1] - x[LINE2]) / B(P_LINE);
        p = x[LINE2];
    }
    /* electrical path */
    double u = v;
    if (HAS(ELECTRODE)) { /* a ladder of two sections */
        dx[ELEC1] = (v - x[ELEC1]) / (A(ELECTRODE) * 0.75);
        dx[ELEC2] = (x[ELEC1] - x[ELEC2]) / (A(ELECTRODE) * 0.25);
        u = x[ELEC2];
    }
    if (HAS(SLEW)) {
        dx[SLEWED] = A(SLEW) * tanh((u - x[SLEWED]) / (A(SLEW) * 1.5e-3));
        u = x[SLEWED];
    }
    if (HAS(TRAPPING)) { /* charge creeps in, the faster the stronger the field */
        dx[TRAP] = (A(TRAPPING) * u - x[TRAP]) / B(TRAPPING) * (1 + 0.3 * u * u / 25e6);
        u -= x[TRAP];
    }
    double eps = c[EPS_R];
    if (HAS(EPS_STRETCH)) eps *= exp(-A(EPS_STRETCH) * (lam * lam - 1) / 2);
    double s = (lam - 1) * r_l;
    if (HAS(CLAMP)) s /= 1 + A(CLAMP) * (lam - 1);
    double l1 = sqrt(1 + s * s), sine = s / l1, l1_rate = r_l * sine * rate;
    double field = u / c[H_AO] * l1 * lam;
    if (HAS(EPS_FIELD)) eps *= 1 + A(EPS_FIELD) * (1 - 1 / (1 + field * field / (B(EPS_FIELD) * B(EPS_FIELD))));
    double maxwell = 8.854e-12 * eps * field * field;
    if (HAS(ODD_ELECTRICAL)) maxwell += A(ODD_ELECTRICAL) * sin(field / B(ODD_ELECTRICAL)) * field / 5e7;
    /* elastic stresses */
    double e1 = l1, e2 = lam;
    if (HAS(PRESTRETCH)) { e1 *= A(PRESTRETCH); e2 *= B(PRESTRETCH); }
    if (HAS(PERMANENT_SET)) {
        double above = x[LAM] - 1 > x[SET] ? x[LAM] - 1 - x[SET] : 0;
        dx[SET] = above / B(PERMANENT_SET);
        e2 /= 1 + A(PERMANENT_SET) * x[SET];
    }
    double a1 = e1 * e1, a2 = e2 * e2, a3 = 1 / (a1 * a2), j = a1 + a2 + a3 - 3;
    double stiff = 2 * (c[C_1] + j * (2 * c[C_2] + 3 * c[C_3] * j));
    if (HAS(STIFFENING)) stiff += 2 * A(STIFFENING) * (exp(B(STIFFENING) * j * j) - 1);
    if (HAS(MULLINS)) {
        dx[MOST] = j > x[MOST] ? (j - x[MOST]) / 4e-3 : 0;
        double gap = x[MOST] - j > 0 ? x[MOST] - j : 0;
        stiff *= 1 - A(MULLINS) * erf(gap / (B(MULLINS) + 0.2 * x[MOST]));
    }
    if (HAS(THERMAL)) {
        dx[WARMTH] = (u * u / 25e6 - x[WARMTH]) / B(THERMAL);
        stiff *= 1 / (1 + A(THERMAL) * x[WARMTH]);
    }
    double axial = stiff * (a1 - a3) - maxwell, hoop = stiff * (a2 - a3) - maxwell;
    if (HAS(PASSIVE)) hoop += A(PASSIVE) * (a2 - 1 / (a2 * sqrt(a2)));
    if (HAS(ODD_MECHANICAL)) hoop += A(ODD_MECHANICAL) * sin((lam - 1) / B(ODD_MECHANICAL));
    /* losses */
    double eta = c[ETA_O], soft = 1;
    if (HAS(THINNING)) eta *= pow(1 + fabs(rate) / B(THINNING), A(THINNING));
    if (HAS(ETA_STRETCH)) soft = 1 + A(ETA_STRETCH) * (a2 - 1) / 2;
    axial += x[VIS1] + x[VIS2] + eta * soft * l1_rate;
    dx[VIS1] = c[K_1] * (l1_rate - x[VIS1] / c[ETA_1]);
    dx[VIS2] = c[K_2] * (l1_rate - x[VIS2] / c[ETA_2]);
    if (HAS(THIRD_BRANCH)) { /* two neighbours instead of one */
        dx[EXTRA1] = 0.6 * A(THIRD_BRANCH) * l1_rate - x[EXTRA1] / (0.7 * B(THIRD_BRANCH));
        dx[EXTRA2] = 0.4 * A(THIRD_BRANCH) * l1_rate - x[EXTRA2] / (1.6 * B(THIRD_BRANCH));
        axial += x[EXTRA1] + x[EXTRA2];
    }
    if (HAS(HOOP_VISCO)) { /* in the logarithmic strain */
        dx[HOOP1] = 0.6 * A(HOOP_VISCO) * rate / lam - x[HOOP1] / (0.6 * B(HOOP_VISCO));
        dx[HOOP2] = 0.4 * A(HOOP_VISCO) * rate / lam - x[HOOP2] / (2.0 * B(HOOP_VISCO));
        hoop += x[HOOP1] + x[HOOP2] + C(HOOP_VISCO) * rate;
    }
    if (HAS(FRICTION)) { /* Bouc and Wen, exponent 2 */
        double z = x[GRIP], n = z * fabs(z);
        dx[GRIP] = (rate - 0.5 * fabs(rate) * n - 0.5 * rate * z * z) / B(FRICTION);
        hoop += A(FRICTION) * z;
    }
    if (HAS(STOP)) p -= A(STOP) * B(STOP) * softplus((lam - C(STOP)) / B(STOP));
    double push = p * (1 + lam) * l1 / c[H_O];
    double pull = 2 * axial * sine / (c[L_O] * l1) + hoop / (c[R_O] * lam);
    dx[LAM] = rate;
    dx[RATE] = (push - pull) / (2 * c[RHO] * c[R_O]);
    (void)t, (void)p_rate;
}

/* The states that move, in `used`; their number. */
static int moving(const Bench *b, int *used)
{
    static const int own[N_EFFECTS][2] = {
        [ELECTRODE] = {ELEC1, ELEC2}, [SLEW] = {SLEWED}, [TRAPPING] = {TRAP}, [HOOP_VISCO] = {HOOP1, HOOP2},
        [THIRD_BRANCH] = {EXTRA1, EXTRA2}, [FRICTION] = {GRIP}, [MULLINS] = {MOST}, [PERMANENT_SET] = {SET},
        [THERMAL] = {WARMTH}, [P_LINE] = {LINE1, LINE2}};
    int n = 0;
    for (int i = LAM; i <= VIS2; i++) used[n++] = i;
    for (int e = 0; e < N_EFFECTS; e++)
        for (int i = 0; i < 2 && HAS(e) && own[e][i]; i++) used[n++] = own[e][i];
    return n;
}

static int invert_step(int n, double M[NX][NX], double *r)
{
    for (int k = 0; k < n; k++) {
        int best = k;
        for (int i = k + 1; i < n; i++) if (fabs(M[i][k]) > fabs(M[best][k])) best = i;
        if (M[best][k] == 0) return 0;
        if (best != k) {
            for (int j = k; j < n; j++) { double s = M[k][j]; M[k][j] = M[best][j]; M[best][j] = s; }
            double s = r[k]; r[k] = r[best]; r[best] = s;
        }
        for (int i = k + 1; i < n; i++) {
            double f = M[i][k] / M[k][k];
            if (f == 0) continue;
            for (int j = k; j < n; j++) M[i][j] -= f * M[k][j];
            r[i] -= f * r[k];
        }
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int j = i + 1; j < n; j++) r[i] -= M[i][j] * r[j];
        r[i] /= M[i][i];
    }
    return 1;
}

typedef struct { long n; const double *t, *p, *v; } Inputs; /* straight lines; a time listed twice is a jump */

static void inputs_in(const Inputs *in, long k, double t, double *p, double *v)
{
    double part = (t - in->t[k]) / (in->t[k + 1] - in->t[k]);
    *p = in->p[k] + part * (in->p[k + 1] - in->p[k]);
    *v = in->v[k] + part * (in->v[k + 1] - in->v[k]);
}

/* One stage: y = base + gamma h f(t, y), Newton with a Jacobian by differences at the first guess. */
static int stage(const Bench *b, int n, const int *used, double t, double gh, const double *base, double p, double v,
                 double *y, double *f)
{
    static const double size[NX] = {[LAM] = 1, [RATE] = 10, [VIS1] = 1e5, [VIS2] = 1e5, [ELEC1] = 1e3, [ELEC2] = 1e3,
                                    [SLEWED] = 1e3, [TRAP] = 1e2, [HOOP1] = 1e4, [HOOP2] = 1e4, [EXTRA1] = 1e5,
                                    [EXTRA2] = 1e5, [GRIP] = 1, [MOST] = .1, [SET] = .1, [WARMTH] = .1, [LINE1] = 1e4,
                                    [LINE2] = 1e4};
    double J[NX][NX], moved[NX], g[NX];
    rates(b, t, y, p, 0, v, f);
    for (int j = 0; j < n; j++) {
        memcpy(moved, y, sizeof moved);
        double h = 1e-7 * (size[used[j]] + fabs(y[used[j]]));
        moved[used[j]] += h;
        rates(b, t, moved, p, 0, v, g);
        for (int i = 0; i < n; i++) J[i][j] = (i == j) - gh * (g[used[i]] - f[used[i]]) / h;
    }
    for (int turn = 0; turn < 12; turn++) {
        double M[NX][NX], r[NX], worst = 0;
        memcpy(M, J, sizeof M);
        for (int i = 0; i < n; i++) r[i] = base[used[i]] + gh * f[used[i]] - y[used[i]];
        if (!invert_step(n, M, r)) return 0;
        for (int i = 0; i < n; i++) {
            y[used[i]] += r[i];
            worst = fmax(worst, fabs(r[i]) / (size[used[i]] + fabs(y[used[i]])));
        }
        rates(b, t, y, p, 0, v, f);
        if (worst < 1e-11) return 1;
        if (!isfinite(worst)) return 0;
    }
    return 1;
}

/* lambda_2 at n_samples times, `every` apart, by `steps` steps in between; 0 where the tube bursts. In the beginning
 * there are FINER times as many: at lambda_2 = 1 the tube rings undamped, and must neither be damped nor slowed. */
#define RINGING 0.6 /* s */
#define FINER 10
__attribute__((visibility("default")))
int trajectory(const double *tube, const double *on, long n, const double *t, const double *p, const double *v,
               double every, long n_samples, long steps, double *lambda_2)
{
    const double gamma = 1 - sqrt(0.5);
    Bench bench = {tube, on};
    Inputs in = {n, t, p, v};
    double x[NX] = {1}, y[NX], f1[NX], f2[NX], base[NX], pp, vv;
    int used[NX];
    const int moved = moving(&bench, used);
    long k = 0;
    for (long sample = 0; sample < n_samples; sample++) {
        const long count = (double)sample * every < RINGING ? FINER * steps : steps;
        const double h = every / (double)count;
        lambda_2[sample] = x[LAM];
        for (long step = 0; step < count; step++) {
            const double now = (double)sample * every + (double)step * h;
            while (k + 2 < n && (t[k + 1] <= now + 1e-9 || t[k + 1] <= t[k])) k++;
            inputs_in(&in, k, now + gamma * h, &pp, &vv);
            memcpy(y, x, sizeof y);
            if (!stage(&bench, moved, used, now + gamma * h, gamma * h, x, pp, vv, y, f1)) return 0;
            for (int i = 0; i < NX; i++) base[i] = x[i] + (1 - gamma) * h * f1[i];
            inputs_in(&in, k, now + h, &pp, &vv);
            if (!stage(&bench, moved, used, now + h, gamma * h, base, pp, vv, y, f2)) return 0;
            memcpy(x, y, sizeof x);
            if (!(x[LAM] > 0.5 && x[LAM] < 3.5)) return 0;
        }
    }
    return 1;
}

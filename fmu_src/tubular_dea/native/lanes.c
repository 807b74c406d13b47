#define MODEL_SOLVER
#include "lanes.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "rodas5p.h"

#define NX AT_LEAST_ONE(MODEL_NX)
#define NU AT_LEAST_ONE(MODEL_NU)
#define NQ AT_LEAST_ONE(MODEL_NQ)
#define NJ AT_LEAST_ONE(MODEL_NJ)
#define NL AT_LEAST_ONE(MODEL_NL)

#if defined(__clang__)
#define EVERY_LANE(l) \
    _Pragma("clang loop vectorize(enable) vectorize_width(8) interleave(disable) unroll(disable)") \
    for (int l = 0; l < LANES; l++)
#else
#define EVERY_LANE(l) for (int l = 0; l < LANES; l++)
#endif

/* The equations at the start of the steps, and the stages. */
typedef struct {
    Lane dx[NX], J[NJ], dx_dt[NX], scale[NX]; /* as Start in rosenbrock.c */
    Lane L[NL], k[STAGES][NX], inverse_h, regular;
    Lane at[NX]; /* where the last stage was taken */
} Work;

/* One lane of an array of them, as the emitted functions want it. */
#define TAKE(to, from, n) \
    for (int i_ = 0; i_ < (n); i_++) (to)[i_] = (from)[i_][l]
#define PUT(to, from, n) \
    for (int i_ = 0; i_ < (n); i_++) (to)[i_][l] = (from)[i_]

static inline double smaller(double a, double b) { return a < b ? a : b; }
static inline double larger(double a, double b) { return a > b ? a : b; }

/* value^(-1/10) within 6 % for positive values; in doubles, so that it runs in lanes. */
static inline double inverse_tenth_root(double value)
{
    const int64_t one = INT64_C(0x3ff) << 52;
    int64_t bits;
    memcpy(&bits, &value, sizeof bits);
    bits = one - (int64_t)(0.1 * (double)(bits - one));
    memcpy(&value, &bits, sizeof value);
    return value;
}

static inline double mean_square(const double *scale, const double *value)
{
    double sum = 0;
    for (int i = 0; i < MODEL_NX; i++) {
        const double scaled = value[i] * scale[i];
        sum += scaled * scaled;
    }
    return sum / NX;
}

static void linearise(const Lanes *lanes, Work *work)
{
    const double tolerance = lanes->tolerance;
    EVERY_LANE(l) {
        double x[NX], u[NU], du[NU], q[NQ], dx[NX], J[NJ], dx_dt[NX];
        const double since = lanes->time[l] - lanes->piece_start[l];
        TAKE(x, lanes->x, MODEL_NX);
        TAKE(q, lanes->q, MODEL_NQ);
        TAKE(du, lanes->du, MODEL_NU);
        for (int i = 0; i < MODEL_NU; i++) u[i] = lanes->u[i][l] + since * du[i];
        model_linearise(lanes->time[l], x, u, du, q, dx, J, dx_dt);
        PUT(work->dx, dx, MODEL_NX);
        PUT(work->J, J, MODEL_NJ);
        PUT(work->dx_dt, dx_dt, MODEL_NX);
        for (int i = 0; i < MODEL_NX; i++) work->scale[i][l] = 1 / (tolerance * (model_nominal[i] + fabs(x[i])));
    }
}

/* Where inputs have jumped, a step that resolves the fastest motion: resolving_step in rosenbrock.c. */
static void resolve(Lanes *lanes, const Work *work, int l)
{
    double J[NJ], dx[NX], dx_dt[NX], scale[NX], second[NX], third[NX];
    TAKE(J, work->J, MODEL_NJ);
    TAKE(dx, work->dx, MODEL_NX);
    TAKE(dx_dt, work->dx_dt, MODEL_NX);
    TAKE(scale, work->scale, MODEL_NX);
    model_multiply(J, dx, second);
    for (int i = 0; i < MODEL_NX; i++) second[i] += dx_dt[i];
    model_multiply(J, second, third);
    const double a = mean_square(scale, second), b = mean_square(scale, third);
    const double speed = b / a, reach = a / (speed * speed);
    const double limit = lanes->wanted[l] < INFINITY ? lanes->wanted[l] : lanes->piece_end[l] - lanes->time[l];
    lanes->wanted[l] = reach > 1 && reach < INFINITY ? smaller(limit, inverse_tenth_root(1e-8 * reach) / sqrt(speed)) : limit;
    lanes->fresh[l] = 0;
}

static void factorise(Lanes *lanes, Work *work)
{
    EVERY_LANE(l) {
        double J[NJ], L[NL], pivot[NX], b[NX], k[NX];
        const double left = lanes->piece_end[l] - lanes->time[l];
        const double crumb = larger(1e-9 * left, 4e-15 * fabs(lanes->time[l]));
        const int last = lanes->wanted[l] >= left - crumb;
        const double h = last ? left : lanes->wanted[l];
        const double inverse_h = 1 / h, shift = inverse_h * (1 / GAMMA);
        double good = 1;
        TAKE(J, work->J, MODEL_NJ);
        model_factorise(shift, J, L, pivot);
        for (int i = 0; i < MODEL_NX; i++) good = fabs(pivot[i]) > 1e-9 * shift ? good : 0;
        lanes->below[l] = 0;
        for (int i = 0; i < MODEL_NX; i++) b[i] = work->dx[i][l] + DELTA[0] * h * work->dx_dt[i][l];
        model_solve(L, b, k);
        PUT(work->L, L, MODEL_NL);
        PUT(work->k[0], k, MODEL_NX);
        work->regular[l] = good;
        work->inverse_h[l] = inverse_h;
        lanes->h[l] = h;
        lanes->last[l] = last;
    }
}

/* Stage s from the stages before it; the last one gives the step's end and its error. */
static inline __attribute__((always_inline)) void stage(Lanes *lanes, Work *work, const int s)
{
    EVERY_LANE(l) {
        double x[NX], u[NU], du[NU], q[NQ], L[NL], b[NX], k[NX];
        const double h = lanes->h[l], inverse_h = work->inverse_h[l];
        const double time = lanes->time[l] + ALPHA[s] * h, since = time - lanes->piece_start[l];
        for (int i = 0; i < MODEL_NX; i++) {
            x[i] = s > 5 ? work->at[i][l] + work->k[s - 1][i][l] : lanes->x[i][l];
            if (s <= 5)
                for (int j = 0; j < s; j++) x[i] += A[s][j] * work->k[j][i][l];
        }
        lanes->below[l] = model_below(x) ? 1 : lanes->below[l];
        TAKE(q, lanes->q, MODEL_NQ);
        TAKE(L, work->L, MODEL_NL);
        TAKE(du, lanes->du, MODEL_NU);
        for (int i = 0; i < MODEL_NU; i++) u[i] = lanes->u[i][l] + since * du[i];
        model_slopes(time, x, u, du, q, b);
        for (int i = 0; i < MODEL_NX; i++) {
            double sum = 0;
            for (int j = 0; j < s; j++) sum += C[s][j] * work->k[j][i][l];
            b[i] += sum * inverse_h + DELTA[s] * h * work->dx_dt[i][l];
        }
        model_solve(L, b, k);
        PUT(work->k[s], k, MODEL_NX);
        if (s >= 5) PUT(work->at, x, MODEL_NX);
        if (s < STAGES - 1) continue;
        for (int i = 0; i < MODEL_NX; i++) x[i] += k[i];
        PUT(lanes->x_new, x, MODEL_NX);
        lanes->below[l] = model_below(x) ? 1 : lanes->below[l];
    }
}

/* Accepted or not, and how the step size goes on; as solver_advance and growth in rosenbrock.c. */
static void judge(Lanes *lanes, const Work *work)
{
    for (int l = 0; l < LANES; l++) {
        double error = 0;
        for (int i = 0; i < MODEL_NX; i++) {
            const double scaled = work->k[STAGES - 1][i][l] * work->scale[i][l];
            error += scaled * scaled;
        }
        error /= NX;
        const int finite = (error < INFINITY) & (work->regular[l] > 0) & !(lanes->below[l] > 0);
        const int accepted = finite & (error <= 1);
        const double factor = finite ? smaller(10, larger(0.1, 0.8 * inverse_tenth_root(larger(error, 1e-12)))) : 0.1;
        const double h = lanes->h[l], next = h * factor, wanted = lanes->wanted[l];
        const double after_last = lanes->last[l] > 0 ? larger(next, wanted) : next;
        const double after_accepted = lanes->rejected[l] > 0 ? smaller(next, h) : after_last;
        lanes->wanted[l] = accepted ? after_accepted : next;
        lanes->accepted[l] = accepted;
        lanes->rejected[l] = !accepted;
    }
}

static void bends(Lanes *lanes, const Work *work)
{
    for (int d = 0; d < 3; d++)
        for (int i = 0; i < MODEL_NX; i++)
            EVERY_LANE(l) {
                double sum = 0;
                for (int j = 0; j < STAGES; j++) sum += DENSE[d][j] * work->k[j][i][l];
                lanes->bend[d][i][l] = sum;
            }
}

void lanes_attempt(Lanes *lanes, int with_bend)
{
    Work work;
    linearise(lanes, &work);
    for (int l = 0; l < LANES; l++)
        if (lanes->fresh[l] > 0) resolve(lanes, &work, l);
    factorise(lanes, &work);
    stage(lanes, &work, 1);
    stage(lanes, &work, 2);
    stage(lanes, &work, 3);
    stage(lanes, &work, 4);
    stage(lanes, &work, 5);
    stage(lanes, &work, 6);
    stage(lanes, &work, 7);
    judge(lanes, &work);
    if (with_bend) bends(lanes, &work);
}

void lanes_move(Lanes *lanes)
{
    EVERY_LANE(l) {
        const int accepted = lanes->accepted[l] > 0;
        const double end = lanes->last[l] > 0 ? lanes->piece_end[l] : lanes->time[l] + lanes->h[l];
        lanes->time[l] = accepted ? end : lanes->time[l];
        for (int i = 0; i < MODEL_NX; i++) lanes->x[i][l] = accepted ? lanes->x_new[i][l] : lanes->x[i][l];
    }
}

void lanes_interpolate(const Lanes *lanes, int l, double s, double *x)
{
    const double r = 1 - s;
    for (int i = 0; i < MODEL_NX; i++) {
        const double bend = lanes->bend[0][i][l] + s * (lanes->bend[1][i][l] + s * lanes->bend[2][i][l]);
        x[i] = lanes->x[i][l] * r + s * (lanes->x_new[i][l] + r * bend);
    }
}

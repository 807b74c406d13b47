/* One attempt at a step of Rodas5P, in lanes side by side: the method's one recursion. One lane makes the scalar
 * integrator, several go through the processor's vector units, and a right-hand side that keeps its derivatives serves
 * the tangents. The arithmetic of a lane never looks at another, so a trajectory comes out the same to the last bit in
 * any.
 *
 * The file that includes it (once, with MODEL_SOLVER) has defined
 *
 *   WIDTH, Lane                          how many lanes, and one number in each: typedef double Lane[WIDTH]
 *   Source                               the type of what inputs come from
 *   source_inputs(source, l, time, u, du)   the inputs of lane l and their rates
 *   RIGHT_HAND_SIDE(source, s, time, x, u, du, q, dx)   optional: state derivatives at stage s
 */
#include "method.h"

#define NX AT_LEAST_ONE(MODEL_NX)
#define NU AT_LEAST_ONE(MODEL_NU)
#define NQ AT_LEAST_ONE(MODEL_NQ)
#define NJ AT_LEAST_ONE(MODEL_NJ)
#define NL AT_LEAST_ONE(MODEL_NL)

#define INLINED static inline __attribute__((always_inline))

#if WIDTH > 1 && defined(__clang__)
#define EVERY_LANE(l) \
    _Pragma("clang loop vectorize(enable) vectorize_width(8) interleave(disable) unroll(disable)") \
    for (int l = 0; l < WIDTH; l++)
#else
#define EVERY_LANE(l) for (int l = 0; l < WIDTH; l++)
#endif

/* One lane of an array of them, as the emitted functions want it; and back. */
#if WIDTH == 1
#define TAKE(name, from, n) const double *const name = (const double *)(from)
#else
#define TAKE(name, from, n) \
    double name[AT_LEAST_ONE(n)]; \
    for (int i_ = 0; i_ < (n); i_++) (name)[i_] = (from)[i_][l]
#endif
#define PUT(to, from, n) \
    for (int i_ = 0; i_ < (n); i_++) (to)[i_][l] = (from)[i_]

#ifndef RIGHT_HAND_SIDE
#define RIGHT_HAND_SIDE(source, s, time, x, u, du, q, dx) model_right_hand_side(time, x, u, du, q, dx)
#endif

/* The equations at the start of a step. */
typedef struct {
    Lane dx[NX], J[NJ], dx_dt[NX];
    Lane scale[NX]; /* one over the tolerance of each state */
} Start;

/* The stages of a step. */
typedef struct {
    Lane k[STAGES][NX], L[NL], inverse_h, regular;
    Lane at[NX]; /* where the last stage was taken */
    Lane below;  /* 1: a stage or the end left the range of the equations */
} Work;

/* The step that is tried. */
typedef struct {
    const double *time, *h; /* of every lane */
    const Lane *x, *q;      /* states, and parameters as model_prepare leaves them */
} Tried;

INLINED void linearise(const Source *source, const Tried *step, double tolerance, Start *start)
{
    EVERY_LANE(l) {
        double u[NU], du[NU], dx[NX], J[NJ], dx_dt[NX];
        TAKE(x, step->x, MODEL_NX);
        TAKE(q, step->q, MODEL_NQ);
        source_inputs(source, l, step->time[l], u, du);
        model_linearise(step->time[l], x, u, du, q, dx, J, dx_dt);
        PUT(start->dx, dx, MODEL_NX);
        PUT(start->J, J, MODEL_NJ);
        PUT(start->dx_dt, dx_dt, MODEL_NX);
        for (int i = 0; i < MODEL_NX; i++) start->scale[i][l] = 1 / (tolerance * (model_nominal[i] + fabs(x[i])));
    }
}

/* As `resolving`, of lane l. */
INLINED double resolving_step(const Start *start, int l, double limit)
{
    double second[NX], third[NX];
    TAKE(J, start->J, MODEL_NJ);
    TAKE(dx, start->dx, MODEL_NX);
    TAKE(scale, start->scale, MODEL_NX);
    model_multiply(J, dx, second);
    for (int i = 0; i < MODEL_NX; i++) second[i] += start->dx_dt[i][l];
    model_multiply(J, second, third);
    return resolving(mean_square(MODEL_NX, scale, second), mean_square(MODEL_NX, scale, third), limit);
}

INLINED void factorise(const Tried *step, const Start *start, Work *work)
{
    EVERY_LANE(l) {
        double L[NL], pivot[NX], b[NX], k[NX], regular = 1;
        const double h = step->h[l], inverse_h = 1 / h, shift = inverse_h * (1 / GAMMA);
        TAKE(J, start->J, MODEL_NJ);
        model_factorise(shift, J, L, pivot);
        for (int i = 0; i < MODEL_NX; i++) regular = fabs(pivot[i]) > LEAST_PIVOT * shift ? regular : 0;
        for (int i = 0; i < MODEL_NX; i++)
            b[i] = stage_rhs(0, start->dx[i][l], start->dx_dt[i][l], NULL, 0, h, inverse_h);
        model_solve(L, b, k);
        PUT(work->L, L, MODEL_NL);
        PUT(work->k[0], k, MODEL_NX);
        work->regular[l] = regular;
        work->inverse_h[l] = inverse_h;
        work->below[l] = 0;
    }
}

INLINED void stage(const Source *source, const Tried *step, const Start *start, Work *work, const int s)
{
    EVERY_LANE(l) {
        double x[NX], u[NU], du[NU], b[NX], k[NX];
        const double h = step->h[l], time = step->time[l] + ALPHA[s] * h;
        TAKE(q, step->q, MODEL_NQ);
        TAKE(L, work->L, MODEL_NL);
        for (int i = 0; i < MODEL_NX; i++)
            x[i] = stage_place(s, step->x[i][l], work->at[i][l], &work->k[0][i][l], NX * WIDTH);
        work->below[l] = model_below(x) ? 1 : work->below[l];
        source_inputs(source, l, time, u, du);
        RIGHT_HAND_SIDE(source, s, time, x, u, du, q, b);
        for (int i = 0; i < MODEL_NX; i++)
            b[i] = stage_rhs(s, b[i], start->dx_dt[i][l], &work->k[0][i][l], NX * WIDTH, h, work->inverse_h[l]);
        model_solve(L, b, k);
        PUT(work->k[s], k, MODEL_NX);
        if (s >= STAGES - 3) PUT(work->at, x, MODEL_NX);
    }
}

/* The end of the step, and the square of its error over the tolerance: infinite where it broke down, or BELOW. */
INLINED void finish(const Start *start, Work *work, Lane *x_new, double *error)
{
    EVERY_LANE(l) {
        double end[NX];
        TAKE(k, work->k[STAGES - 1], MODEL_NX);
        TAKE(scale, start->scale, MODEL_NX);
        for (int i = 0; i < MODEL_NX; i++) end[i] = work->at[i][l] + k[i];
        const double square = mean_square(MODEL_NX, scale, k);
        const double finite = square < INFINITY ? square : INFINITY;
        const double inside = (work->below[l] > 0) | model_below(end) ? BELOW : finite;
        error[l] = work->regular[l] > 0 ? inside : INFINITY;
        PUT(x_new, end, MODEL_NX);
    }
}

/* One lane alone need not go on to the end of a step that is lost. */
#define UNLESS_LOST(lost, what) \
    if (WIDTH == 1 && (lost)) { \
        error[0] = what; \
        return; \
    }
#define STAGE(s) \
    stage(source, step, start, work, s); \
    UNLESS_LOST(work->below[0] > 0, BELOW)

INLINED void attempt(const Source *source, const Tried *step, const Start *start, Work *work, Lane *x_new, double *error)
{
    factorise(step, start, work);
    UNLESS_LOST(!(work->regular[0] > 0), INFINITY)
    STAGE(1)
    STAGE(2)
    STAGE(3)
    STAGE(4)
    STAGE(5)
    STAGE(6)
    STAGE(7)
    finish(start, work, x_new, error);
}

/* How the solution bends inside the step: see `within`. */
INLINED void bends(const Work *work, Lane bend[3][NX])
{
    for (int d = 0; d < 3; d++)
        for (int i = 0; i < MODEL_NX; i++)
            EVERY_LANE(l) bend[d][i][l] = weighted(0, DENSE[d], STAGES, &work->k[0][i][l], NX * WIDTH);
}

/* A step of Rodas5P (rosenbrock.c) differentiated, its size held:
 *
 *     (shift I - J) k_s = f(t_s, x_s) + sum C_sj k_j / h + DELTA_s h df/dt
 *     (shift I - J) k_s' = f' + sum C_sj k_j' / h + DELTA_s h (df/dt)' + J' k_s,     f' = J(x_s) x_s' + df/dp
 *
 * with ' the derivative to a parameter. The first derivatives are the emitted ones; J' and (df/dt)' are central
 * differences of them along (x', p'), good to nine digits. The factors of shift I - J serve all columns.
 */
#define MODEL_SOLVER
#include "tangent.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "gradients.h"
#include "pieces.h"
#include "start.h"

#define NP AT_LEAST_ONE(GRADIENTS_NP)

/* The step itself: the method in one lane, with a right-hand side that keeps its derivatives of every stage. */
typedef struct {
    const Inputs *inputs;
    const double *gradients; /* prepared parameters of model_gradients */
    struct Taken *taken;
} Source;

#define WIDTH 1
typedef double Lane[WIDTH];
static inline void source_inputs(const Source *source, int l, double time, double *u, double *du)
{
    (void)l;
    inputs_at(source->inputs, time, u, du);
}
static inline void keep(const Source *source, int s, double time, const double *x, const double *u, const double *du,
                        double *dx);
#define RIGHT_HAND_SIDE(source, s, time, x, u, du, q, dx) ((void)(q), keep(source, s, time, x, u, du, dx))
#include "attempt.h"

#define DIFFERENCE 1e-6 /* of the columns' sizes, for J' */

/* Columns that are worked on at once: what a vector register holds, as idle ones cost as much as others. */
#if defined(__AVX512F__)
#define COLUMNS_WIDE 8
#define VECTORIZED "clang loop vectorize(enable) vectorize_width(8) interleave(disable) unroll(disable)"
#else
#define COLUMNS_WIDE 4
#define VECTORIZED "clang loop vectorize(enable) vectorize_width(4) interleave(disable) unroll(disable)"
#endif

typedef double Wide[COLUMNS_WIDE]; /* one value of each of these columns */

#if defined(__clang__)
#define EVERY_COLUMN(l) _Pragma(VECTORIZED) for (int l = 0; l < COLUMNS_WIDE; l++)
#else
#define EVERY_COLUMN(l) for (int l = 0; l < COLUMNS_WIDE; l++)
#endif

/* Columns side by side; those of a last incomplete block are idle (their parameter and input are -1). */
typedef struct {
    int parameter[COLUMNS_WIDE], input[COLUMNS_WIDE], column[COLUMNS_WIDE];
    int n_forced, forced_entry[NP], forced_column[NP]; /* entries of P, and the column here that they force */
    Wide size, up[NQ], down[NQ]; /* prepared parameters, a difference up and down */
    Wide x[NX], k[STAGES][NX], bend[3][NX], x_new[NX];
} Block;

/* The step that is differentiated. */
typedef struct Taken {
    double time, h, u[NU], du[NU], x[NX], x_new[NX], bend[3][NX];
    double J[STAGES][NJ], P[STAGES][NP]; /* of the state derivatives, at the stages */
    Work work;
} Taken;

typedef struct {
    const double *p, *samples;
    long n_samples, next, n_columns, n_blocks;
    Block *blocks;
    Inputs inputs;
    double prepared[NQ], gradients[AT_LEAST_ONE(GRADIENTS_NQ)];
    double *x, *y, *x_tangent, *observed_tangent, *observed_rate;
} TangentRun;

/* Starts ------------------------------------------------------------------------------------------------------ */

/* The start states, and how they move with the columns of the blocks; SOLVER_OK or why there are none. */
static int start(const double *p, const double *u, double *x, Block *blocks, long n_blocks)
{
    const int status = piece_start(p, u, x);
    for (long c = 0; status == SOLVER_OK && c < n_blocks * COLUMNS_WIDE; c++) {
        Block *block = &blocks[c / COLUMNS_WIDE];
        double v_u[NU] = {0}, v_p[AT_LEAST_ONE(MODEL_NP)] = {0}, v_x[NX];
        const int l = (int)(c % COLUMNS_WIDE), parameter = block->parameter[l];
        if (parameter < 0) continue;
        v_p[parameter] = 1;
        start_tangent(u, p, x, v_u, v_p, v_x);
        for (int i = 0; i < MODEL_NX; i++) {
            if (!isfinite(v_x[i])) return NO_REST_STATE; /* at the fold itself */
            block->x[i][l] = v_x[i];
        }
    }
    return status;
}

/* The parameters of one column moved by `by`, as the solver wants them. */
static void prepare_moved(const TangentRun *run, int parameter, double by, int l, Wide q[NQ])
{
    double p[AT_LEAST_ONE(MODEL_NP)], prepared[NQ];
    memcpy(p, run->p, MODEL_NP * sizeof *p);
    if (parameter >= 0) p[parameter] += by;
    model_prepare(p, prepared);
    for (int i = 0; i < MODEL_NQ; i++) q[i][l] = prepared[i];
}

static void prepare(TangentRun *run, const int *columns, const double *sizes)
{
    model_prepare(run->p, run->prepared);
    model_prepare_gradients(run->p, run->gradients);
    for (long c = 0; c < run->n_blocks * COLUMNS_WIDE; c++) {
        Block *block = &run->blocks[c / COLUMNS_WIDE];
        const int l = (int)(c % COLUMNS_WIDE), column = c < run->n_columns ? columns[c] : -1;
        const int parameter = column < 0 ? -1 : COLUMN_PARAMETER[column];
        block->column[l] = column;
        block->parameter[l] = parameter;
        block->input[l] = column < 0 ? -1 : COLUMN_INPUT[column];
        block->size[l] = column < 0 ? 1 : DIFFERENCE * sizes[c];
        prepare_moved(run, parameter, block->size[l], l, block->up);
        prepare_moved(run, parameter, -block->size[l], l, block->down);
        for (int e = 0; e < GRADIENTS_NP; e++)
            if (P_COLUMN[e] == column) {
                block->forced_entry[block->n_forced] = e;
                block->forced_column[block->n_forced++] = l;
            }
    }
}

/* One step ----------------------------------------------------------------------------------------------------- */

static inline void keep(const Source *source, int s, double time, const double *x, const double *u, const double *du,
                        double *dx)
{
    model_gradients(time, x, u, du, source->gradients, dx, source->taken->J[s], source->taken->P[s]);
}

/* Takes the step from `x`. */
static SolverStatus take(const TangentRun *run, double time, double h, const double *x, Taken *s)
{
    double dx[NX], error;
    Start start;
    const Source source = {&run->inputs, run->gradients, s};
    const Tried trial = {&s->time, &s->h, (const Lane *)s->x, (const Lane *)run->prepared};
    s->time = time;
    s->h = h;
    memcpy(s->x, x, sizeof s->x);
    inputs_at(&run->inputs, time, s->u, s->du);
    linearise(&source, &trial, 1, &start);
    keep(&source, 0, time, x, s->u, s->du, dx);
    attempt(&source, &trial, &start, &s->work, (Lane *)s->x_new, &error);
    if (error < 0) return SOLVER_BELOW_MINIMUM;
    return error < INFINITY ? SOLVER_OK : SOLVER_STEP_TOO_SMALL;
}

/* J and df/dt at a place `sign` sizes along the columns. Flattened: a loop that calls anything is not vectorised. */
__attribute__((flatten)) static void linearise_moved(const Taken *s, const Block *block, const Wide prepared[NQ],
                                                     double sign, Wide J[NJ], Wide dx_dt[NX])
{
    Wide x[NX], u[NU], q[NQ], entries[NJ], along[NX]; /* local: the compiler knows that they do not overlap */
    double du[NU];
    const double time = s->time;
    memcpy(du, s->du, sizeof du);
    memcpy(q, prepared, sizeof q);
    for (int i = 0; i < MODEL_NX; i++)
        EVERY_COLUMN(l) x[i][l] = s->x[i] + sign * block->size[l] * block->x[i][l];
    for (int i = 0; i < MODEL_NU; i++)
        EVERY_COLUMN(l) u[i][l] = s->u[i] - (i == block->input[l] ? sign * block->size[l] * s->du[i] : 0);
    EVERY_COLUMN(l) {
        double at[NX], inputs[NU], own[NQ], dx[NX], j[NJ], dt[NX];
        for (int i = 0; i < MODEL_NX; i++) at[i] = x[i][l];
        for (int i = 0; i < MODEL_NU; i++) inputs[i] = u[i][l];
        for (int i = 0; i < MODEL_NQ; i++) own[i] = q[i][l];
        model_linearise(time, at, inputs, du, own, dx, j, dt);
        for (int e = 0; e < MODEL_NJ; e++) entries[e][l] = j[e];
        for (int i = 0; i < MODEL_NX; i++) along[i][l] = dt[i];
    }
    memcpy(J, entries, sizeof entries);
    memcpy(dx_dt, along, sizeof along);
}

/* J' and (df/dt)' of the columns of a block at the start of the step. */
static void second(const Taken *s, const Block *block, Wide J[NJ], Wide dx_dt[NX])
{
    Wide J_down[NJ], along_down[NX], inverse;
    linearise_moved(s, block, block->up, 1, J, dx_dt);
    linearise_moved(s, block, block->down, -1, J_down, along_down);
    EVERY_COLUMN(l) inverse[l] = 0.5 / block->size[l];
    for (int e = 0; e < MODEL_NJ; e++)
        EVERY_COLUMN(l) J[e][l] = (J[e][l] - J_down[e][l]) * inverse[l];
    for (int i = 0; i < MODEL_NX; i++)
        EVERY_COLUMN(l) dx_dt[i][l] = (dx_dt[i][l] - along_down[i][l]) * inverse[l];
}

/* df/dp of each stage and column: entries of P, or, for a delay, minus the rate of the delayed signal times theirs. */
static void forcing(const Taken *s, const Block *block, int stage, Wide b[NX])
{
    for (int i = 0; i < MODEL_NX; i++)
        EVERY_COLUMN(l) b[i][l] = 0;
    for (int f = 0; f < block->n_forced; f++) {
        const int e = block->forced_entry[f], l = block->forced_column[f], input = block->input[l];
        b[P_ROW[e]][l] += s->P[stage][e] * (input < 0 ? 1 : -s->du[input]);
    }
}

/* Stage s of the columns of a block: the stage's sums over derivatives, with J' k and the forcing among the derivatives. */
INLINED void differentiate_stage(const Taken *taken, const Wide start[NX], const Wide J[NJ], const Wide dx_dt[NX], Block *block,
                                 Wide at[NX], const int s)
{
    double J_here[NJ], k_here[NX], L[NL];
    Wide force[NX];
    const double h = taken->h, inverse_h = 1 / h;
    forcing(taken, block, s, force);
    memcpy(J_here, taken->J[s], sizeof J_here);
    memcpy(k_here, taken->work.k[s], sizeof k_here);
    memcpy(L, taken->work.L, sizeof L);
    EVERY_COLUMN(l) {
        double x[NX], entries[NJ], b[NX], first[NX], other[NX], k[NX];
        for (int i = 0; i < MODEL_NX; i++)
            x[i] = s ? stage_place(s, start[i][l], at[i][l], &block->k[0][i][l], NX * COLUMNS_WIDE) : start[i][l];
        for (int e = 0; e < MODEL_NJ; e++) entries[e] = J[e][l];
        model_multiply(J_here, x, first);
        model_multiply(entries, k_here, other);
        for (int i = 0; i < MODEL_NX; i++) {
            const double rate = force[i][l] + first[i] + other[i];
            b[i] = stage_rhs(s, rate, dx_dt[i][l], &block->k[0][i][l], NX * COLUMNS_WIDE, h, inverse_h);
        }
        model_solve(L, b, k);
        for (int i = 0; i < MODEL_NX; i++) block->k[s][i][l] = k[i];
        for (int i = 0; i < MODEL_NX; i++) at[i][l] = x[i];
    }
}

static void differentiate(const Taken *taken, Block *block)
{
    Wide start[NX], at[NX], J[NJ], dx_dt[NX];
    second(taken, block, J, dx_dt);
    memcpy(start, block->x, sizeof start);
    differentiate_stage(taken, start, J, dx_dt, block, at, 0);
    differentiate_stage(taken, start, J, dx_dt, block, at, 1);
    differentiate_stage(taken, start, J, dx_dt, block, at, 2);
    differentiate_stage(taken, start, J, dx_dt, block, at, 3);
    differentiate_stage(taken, start, J, dx_dt, block, at, 4);
    differentiate_stage(taken, start, J, dx_dt, block, at, 5);
    differentiate_stage(taken, start, J, dx_dt, block, at, 6);
    differentiate_stage(taken, start, J, dx_dt, block, at, 7);
    for (int i = 0; i < MODEL_NX; i++)
        EVERY_COLUMN(l) block->x_new[i][l] = at[i][l] + block->k[STAGES - 1][i][l];
}

/* Samples ------------------------------------------------------------------------------------------------------ */

static void bend_columns(Block *block)
{
    for (int d = 0; d < 3; d++)
        for (int i = 0; i < MODEL_NX; i++)
            EVERY_COLUMN(l) block->bend[d][i][l] = weighted(0, DENSE[d], STAGES, &block->k[0][i][l], NX * COLUMNS_WIDE);
}

/* Writes the next sample from states `x` and the tangents v[column * MODEL_NX + state]; `rates` as in kernel.c. */
static void record(TangentRun *run, double time, const double *x, const double *v, const double *rates)
{
    double u[NU], du[NU], observed[AT_LEAST_ONE(OBSERVED)], Y[AT_LEAST_ONE(OBSERVED_N)];
    const double fold = 0;
    const long row = run->next++;
    double *y = run->y + row * (MODEL_NY + 1);
    inputs_at(&run->inputs, time, u, du);
    if (rates) memcpy(du, rates, sizeof du);
    memcpy(run->x + row * MODEL_NX, x, MODEL_NX * sizeof *x);
    model_outputs(time, x, u, du, run->p, &fold, y);
    y[MODEL_NY] = 0;
    if (run->x_tangent)
        memcpy(run->x_tangent + row * run->n_columns * MODEL_NX, v, run->n_columns * MODEL_NX * sizeof *v);
    if (!run->observed_tangent) return;
    double *out = run->observed_tangent + row * run->n_columns * OBSERVED, dx[NX];
    model_observed(time, x, u, du, run->p, &fold, observed, Y);
    model_derivatives(time, x, u, du, run->p, &fold, dx);
    for (int o = 0; o < OBSERVED; o++) run->observed_rate[row * OBSERVED + o] = 0;
    for (int e = 0; e < OBSERVED_N; e++) {
        const int of = OBSERVED_COLUMN[e], input = of - MODEL_NX - COLUMNS;
        const double rate = of < MODEL_NX ? dx[of] : input >= 0 ? du[input] : 0;
        run->observed_rate[row * OBSERVED + OBSERVED_ROW[e]] += Y[e] * rate;
    }
    memset(out, 0, run->n_columns * OBSERVED * sizeof *out);
    for (long c = 0; c < run->n_columns; c++) {
        const Block *block = &run->blocks[c / COLUMNS_WIDE];
        const int l = (int)(c % COLUMNS_WIDE);
        for (int e = 0; e < OBSERVED_N; e++) {
            const int of = OBSERVED_COLUMN[e];
            if (of < MODEL_NX) out[c * OBSERVED + OBSERVED_ROW[e]] += Y[e] * v[c * MODEL_NX + of];
            else if (of - MODEL_NX == block->column[l])
                out[c * OBSERVED + OBSERVED_ROW[e]] += Y[e] * (block->input[l] < 0 ? 1 : -du[block->input[l]]);
        }
    }
}

/* At the present states, before or after a step. */
static void record_here(TangentRun *run, double time, const double *x, double *v, const double *rates)
{
    for (long c = 0; c < run->n_columns; c++)
        for (int i = 0; i < MODEL_NX; i++) v[c * MODEL_NX + i] = run->blocks[c / COLUMNS_WIDE].x[i][c % COLUMNS_WIDE];
    record(run, time, x, v, rates);
}

static void record_within(TangentRun *run, const Taken *s, double time, double *v)
{
    double x[NX];
    const double f = (time - s->time) / s->h;
    for (int i = 0; i < MODEL_NX; i++)
        x[i] = within(f, s->x[i], s->x_new[i], s->bend[0][i], s->bend[1][i], s->bend[2][i]);
    for (long c = 0; c < run->n_columns; c++) {
        const Block *b = &run->blocks[c / COLUMNS_WIDE];
        const int l = (int)(c % COLUMNS_WIDE);
        for (int i = 0; i < MODEL_NX; i++)
            v[c * MODEL_NX + i] =
                within(f, b->x[i][l], b->x_new[i][l], b->bend[0][i][l], b->bend[1][i][l], b->bend[2][i][l]);
    }
    record(run, time, x, v, NULL);
}

/* The run ------------------------------------------------------------------------------------------------------ */

static int step_to(TangentRun *run, double time, double end, double *x, double *v)
{
    Taken s;
    const SolverStatus status = take(run, time, end - time, x, &s);
    if (status != SOLVER_OK) return status;
    for (long b = 0; b < run->n_blocks; b++) differentiate(&s, &run->blocks[b]);
    if (run->next < run->n_samples && run->samples[run->next] < end) {
        bends(&s.work, (Lane(*)[NX])s.bend);
        for (long b = 0; b < run->n_blocks; b++) bend_columns(&run->blocks[b]);
        while (run->next < run->n_samples && run->samples[run->next] < end)
            record_within(run, &s, run->samples[run->next], v);
    }
    memcpy(x, s.x_new, sizeof s.x_new);
    for (long b = 0; b < run->n_blocks; b++) memcpy(run->blocks[b].x, run->blocks[b].x_new, sizeof run->blocks[b].x);
    return SOLVER_OK;
}

/* Where a delayed signal jumps, a longer delay lets what was before act a little longer. */
static void jump(TangentRun *run, double time, const double *before, const double *after, const double *x)
{
    const double still[NU] = {0}, fold = 0;
    for (long c = 0; c < run->n_columns; c++) {
        Block *block = &run->blocks[c / COLUMNS_WIDE];
        const int l = (int)(c % COLUMNS_WIDE), input = block->input[l];
        if (input < 0 || before[input] == after[input]) continue;
        double u[NU], longer[NX], now[NX];
        memcpy(u, after, MODEL_NU * sizeof *u);
        model_derivatives(time, x, u, still, run->p, &fold, now);
        u[input] = before[input];
        model_derivatives(time, x, u, still, run->p, &fold, longer);
        for (int i = 0; i < MODEL_NX; i++) block->x[i][l] += longer[i] - now[i];
    }
}

/* Through all pieces; samples at the end of a piece belong to the next one. */
static int walk(TangentRun *run, long n_points, const double *points, const double *u, long n_mesh, const double *mesh,
                double *x, double *v, double *reached)
{
    const double *last = NULL; /* inputs at the end of the piece before */
    double rates[NU], here[NU];
    long m = 0;
    for (long k = 0; k < n_points - 1; k++) {
        const double end = points[k + 1];
        double time = points[k];
        if (piece_is_jump(points, k)) continue;
        piece_inputs(&run->inputs, points, u, k);
        if (last) jump(run, time, last, u + k * MODEL_NU, x);
        piece_rates(&run->inputs, last, rates, here);
        last = u + (k + 1) * MODEL_NU;
        while (run->next < run->n_samples && run->samples[run->next] <= time) record_here(run, time, x, v, here);
        while (time < end) {
            const double closest = 1e-9 * (end - points[k]);
            while (m < n_mesh && mesh[m] <= time + closest) m++;
            const double to = m < n_mesh && mesh[m] < end - closest ? mesh[m] : end;
            const int status = step_to(run, time, to, x, v);
            if (status != SOLVER_OK) return status;
            *reached = time = to;
        }
    }
    while (run->next < run->n_samples) record_here(run, points[n_points - 1], x, v, NULL);
    return SOLVER_OK;
}

int kernel_tangents(const double *p, long n_points, const double *points, const double *u, long n_mesh,
                    const double *mesh, long n_columns, const int *columns, const double *sizes, long n_samples,
                    const double *samples, double *x, double *y, double *x_tangent, double *observed_tangent,
                    double *observed_rate, double *reached)
{
    double state[NX];
    TangentRun run = {0};
    int status = -2;
    const long first = piece_first(n_points, points);
    run.p = p, run.samples = samples, run.n_samples = n_samples, run.n_columns = n_columns;
    run.n_blocks = (n_columns + COLUMNS_WIDE - 1) / COLUMNS_WIDE;
    run.x = x, run.y = y, run.x_tangent = x_tangent, run.observed_tangent = observed_tangent;
    run.observed_rate = observed_rate;
    run.blocks = calloc(AT_LEAST_ONE((size_t)run.n_blocks), sizeof *run.blocks);
    double *v = calloc(AT_LEAST_ONE((size_t)n_columns) * NX, sizeof *v);
    *reached = points[0];
    if (run.blocks && v) {
        prepare(&run, columns, sizes);
        status = start(p, u + first * MODEL_NU, state, run.blocks, run.n_blocks);
        if (status == SOLVER_OK)
            status = walk(&run, n_points, points, u, n_mesh, mesh, state, v, reached);
    }
    free(run.blocks);
    free(v);
    return status;
}

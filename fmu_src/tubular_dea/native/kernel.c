#include "kernel.h"

#include <string.h>

#include "equilibrium.h"
#include "pieces.h"

#define NU AT_LEAST_ONE(MODEL_NU)

/* Where the trajectory is being written. */
typedef struct {
    Solver *solver;
    const double *samples;
    long n_samples, next;
    double piece_end;
    int last_piece, with_fold;
    double *x, *y, *mesh;
    long room;
} Recorder;

/* The next sample; `rates` of the inputs, where they are not those of the present piece. */
static void record(Recorder *recorder, double time, const double *x, const double *rates)
{
    double u[NU], du[NU], fold = 0;
    memcpy(recorder->x + recorder->next * MODEL_NX, x, MODEL_NX * sizeof *x);
    double *row = recorder->y ? recorder->y + recorder->next * (MODEL_NY + 1) : NULL;
    recorder->next++;
    if (!row) return;
    inputs_at(&recorder->solver->inputs, time, u, du);
    if (rates) memcpy(du, rates, sizeof du);
#if MODEL_HAS_CURVE
    if (recorder->with_fold) fold = curve_fold(u, recorder->solver->p).load;
#endif
    model_outputs(time, x, u, du, recorder->solver->p, &fold, row);
    row[MODEL_NY] = fold;
}

/* The step's end, and samples inside it; one at the end of the piece belongs to the next, whose inputs hold there. */
static int sample(void *context, const Step *step)
{
    Recorder *recorder = context;
    double x[AT_LEAST_ONE(MODEL_NX)];
    const double end = step->time + step->h;
    const long number = recorder->solver->steps - 1;
    if (number < recorder->room) recorder->mesh[number] = end;
    while (recorder->next < recorder->n_samples) {
        const double time = recorder->samples[recorder->next];
        if (time > end || (time >= recorder->piece_end && !recorder->last_piece)) break;
        step_within(step, (time - step->time) / step->h, x); /* 1 at the end, to the last bit */
        record(recorder, time, x, NULL);
    }
    return 0;
}

int kernel_trajectory(const double *p, long n_points, const double *points, const double *u, double tolerance,
                      long max_steps, long total_steps, long n_samples, const double *samples, int with_fold,
                      double *x, double *y, long room, double *mesh, long *counts, double *reached)
{
    double state[AT_LEAST_ONE(MODEL_NX)], rates[NU], here[NU], time = points[0], h = 0;
    Solver solver = {0};
    Recorder recorder = {&solver, samples, n_samples, 0, 0, 0, with_fold, x, y, mesh, room};
    int status;
    const double *before = NULL; /* inputs at the end of the piece before */
    const long first = piece_first(n_points, points);
    long last = n_points - 2;
    while (last > first && piece_is_jump(points, last)) last--;
    solver.p = p;
    solver.tolerance = tolerance;
    solver.observer = sample;
    solver.context = &recorder;
    *reached = time;
    status = piece_start(p, u + first * MODEL_NU, state);
    for (long k = first; k <= last && status == SOLVER_OK; k++) {
        if (piece_is_jump(points, k)) continue;
        piece_inputs(&solver.inputs, points, u, k);
        recorder.piece_end = points[k + 1];
        recorder.last_piece = k == last;
        solver.unbroken = before && !memcmp(before, u + k * MODEL_NU, MODEL_NU * sizeof *u);
        piece_rates(&solver.inputs, before, rates, here);
        before = u + (k + 1) * MODEL_NU;
        if (!(h > 0)) h = points[k + 1] - time;
        while (recorder.next < n_samples && samples[recorder.next] <= time) record(&recorder, time, state, here);
        solver.max_steps = total_steps - solver.steps < max_steps ? total_steps - solver.steps : max_steps;
        status = solver_advance(&solver, &time, points[k + 1], state, &h);
    }
    while (status == SOLVER_OK && recorder.next < n_samples && samples[recorder.next] <= time)
        record(&recorder, time, state, NULL); /* one at the very end, where the last step's own end was rounded to before it */
    counts[0] = solver.steps;
    counts[1] = solver.rejected;
    *reached = time;
    return status;
}

void kernel_derivatives(double time, const double *x, const double *u, const double *du, const double *p, double *dx)
{
    const double fold = 0;
    model_derivatives(time, x, u, du, p, &fold, dx);
}

void kernel_jacobian(double time, const double *x, const double *u, const double *du, const double *p, double *J,
                     double *dx_dt)
{
    const double fold = 0;
    model_jacobian(time, x, u, du, p, &fold, J, dx_dt);
}

int kernel_curve(const double *u, const double *p, long n, const double *unknown, double *load, double *slope,
                 double *fold)
{
#if MODEL_HAS_CURVE
    double x[AT_LEAST_ONE(MODEL_NX)];
    for (long i = 0; i < n; i++) model_equilibrium(unknown[i], u, p, &load[i], &slope[i], x);
    const CurvePoint top = curve_fold(u, p);
    fold[0] = top.unknown;
    fold[1] = top.load;
    return 0;
#else
    (void)u, (void)p, (void)n, (void)unknown, (void)load, (void)slope, (void)fold;
    return -1;
#endif
}

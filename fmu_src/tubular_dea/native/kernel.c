#include "kernel.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "equilibrium.h"
#include "instance.h"

#define NU AT_LEAST_ONE(MODEL_NU)
#define MAX_STEPS 10000000 /* in one trajectory */

/* Where the trajectory is being written. */
typedef struct {
    Solver *solver;
    const double *samples;
    long n_samples, next;
    double piece_end;
    int last_piece, with_fold;
    double *x, *y;
} Recorder;

static void record(Recorder *recorder, double time, const double *x)
{
    double u[NU], du[NU], fold = 0;
    memcpy(recorder->x + recorder->next * MODEL_NX, x, MODEL_NX * sizeof *x);
    double *row = recorder->y ? recorder->y + recorder->next * (MODEL_NY + 1) : NULL;
    recorder->next++;
    if (!row) return;
    inputs_at(&recorder->solver->inputs, time, u, du);
#if MODEL_HAS_CURVE
    if (recorder->with_fold) fold = curve_fold(u, recorder->solver->p).load;
#endif
    model_outputs(time, x, u, du, recorder->solver->p, &fold, row);
    row[MODEL_NY] = fold;
}

/* Samples inside the step; one at the end of the piece belongs to the next piece, whose inputs hold there. */
static int sample(void *context, const Step *step)
{
    Recorder *recorder = context;
    double x[AT_LEAST_ONE(MODEL_NX)];
    const double end = step->time + step->h;
    while (recorder->next < recorder->n_samples) {
        const double time = recorder->samples[recorder->next];
        if (time > end || (time >= recorder->piece_end && !recorder->last_piece)) break;
        step_interpolate(step, time, x);
        record(recorder, time, x);
    }
    return 0;
}

static void set_piece(Solver *solver, const double *points, const double *u, long k)
{
    const double length = points[k + 1] - points[k];
    memset(solver->inputs.u, 0, sizeof solver->inputs.u);
    solver->inputs.time = points[k];
    for (int i = 0; i < MODEL_NU; i++) {
        const double left = u[k * MODEL_NU + i], right = u[(k + 1) * MODEL_NU + i];
        solver->inputs.u[i][0] = left;
        solver->inputs.u[i][1] = (right - left) / length;
    }
}

/* The initial states for parameters and first inputs, by way of an instance; 0 where there are none. */
static int start_states(const double *p, const double *u, double time, double *x)
{
    char problem[PROBLEM_SIZE];
    Instance *instance = instance_create("kernel", MODEL_GUID, CO_SIMULATION, problem);
    if (!instance) return 0;
    memcpy(instance->now.p, p, MODEL_NP * sizeof *p);
    for (int i = 0; i < MODEL_NU; i++) instance->now.u[i][0] = u[i];
    instance->now.time = time;
    instance_enter_initialization(instance);
    const int found = instance_get_states(instance, x, MODEL_NX) == STATUS_OK;
    instance_free(instance);
    return found;
}

int kernel_trajectory(const double *p, long n_points, const double *points, const double *u, double tolerance,
                      long n_samples, const double *samples, int with_fold, double *x, double *y, long *counts,
                      double *reached)
{
    double state[AT_LEAST_ONE(MODEL_NX)], time = points[0], h = 0;
    Solver solver = {0};
    Recorder recorder = {&solver, samples, n_samples, 0, 0, 0, with_fold, x, y};
    SolverStatus status = SOLVER_OK;
    long first = 0, last = n_points - 2;
    while (first < last && points[first + 1] <= points[first]) first++;
    while (last > first && points[last + 1] <= points[last]) last--;
    solver.p = p;
    solver.tolerance = tolerance;
    solver.max_steps = MAX_STEPS;
    solver.observer = sample;
    solver.context = &recorder;
    *reached = time;
    if (!start_states(p, u + first * MODEL_NU, time, state)) return -1;
    for (long k = first; k <= last && status == SOLVER_OK; k++) {
        if (points[k + 1] <= points[k]) continue;
        set_piece(&solver, points, u, k);
        recorder.piece_end = points[k + 1];
        recorder.last_piece = k == last;
        if (!(h > 0)) h = solver_first_step(&solver, time, state, points[k + 1] - time);
        while (recorder.next < n_samples && samples[recorder.next] <= time) record(&recorder, time, state);
        status = solver_advance(&solver, &time, points[k + 1], state, &h);
    }
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

#define MODEL_SOLVER
#include "rosenbrock.h"

/* Inputs ----------------------------------------------------------------------------------------------------- */

static inline void input_values(const Inputs *inputs, double time, double *u, double *du)
{
    const double s = time - inputs->time;
    for (int i = 0; i < MODEL_NU; i++) {
        const double *c = inputs->u[i];
        u[i] = c[0] + s * (c[1] + s * (c[2] * (1.0 / 2) + s * (c[3] * (1.0 / 6))));
        du[i] = c[1] + s * (c[2] + s * (c[3] * (1.0 / 2)));
    }
}

void inputs_at(const Inputs *inputs, double time, double *u, double *du)
{
    input_values(inputs, time, u, du);
}

void inputs_move(Inputs *inputs, double time)
{
    double u[AT_LEAST_ONE(MODEL_NU)], du[AT_LEAST_ONE(MODEL_NU)];
    const double s = time - inputs->time;
    input_values(inputs, time, u, du);
    for (int i = 0; i < MODEL_NU; i++) {
        inputs->u[i][0] = u[i];
        inputs->u[i][1] = du[i];
        inputs->u[i][2] += s * inputs->u[i][3];
    }
    inputs->time = time;
}

/* The method, in one lane ------------------------------------------------------------------------------------ */

#define WIDTH 1
typedef double Lane[WIDTH];
typedef Inputs Source;

static inline void source_inputs(const Inputs *inputs, int l, double time, double *u, double *du)
{
    (void)l;
    input_values(inputs, time, u, du);
}

#include "attempt.h"

SolverStatus solver_advance(Solver *solver, double *time, double end, double *x, double *h)
{
    double q[NQ], error;
    Start start;
    Work work;
    Step step;
    long tries = 0, since_below = LATELY;
    int begins = 1;
    model_prepare(solver->p, q);
    const Tried trial = {&step.time, &step.h, (const Lane *)step.x, (const Lane *)q};
    while (*time < end) {
        const double left = end - *time;
        double wanted = *h;
        int rejected = 0, last;
        step.time = *time;
        memcpy(step.x, x, sizeof step.x);
        linearise(&solver->inputs, &trial, solver->tolerance, &start);
        if (begins) wanted = solver->unbroken ? at_corner(wanted, solver->corner) : resolving_step(&start, 0, wanted);
        for (;;) {
            if (tries++ >= solver->max_steps) return SOLVER_TOO_MANY_STEPS;
            last = is_last(wanted, left, *time);
            step.h = last ? left : wanted;
            if (is_too_short(step.h, *time)) return since_below < LATELY ? SOLVER_BELOW_MINIMUM : SOLVER_STEP_TOO_SMALL;
            attempt(&solver->inputs, &trial, &start, &work, (Lane *)step.x_new, &error);
            since_below = error < 0 ? 0 : since_below + 1;
            wanted = wanted_next(error, step.h, wanted, last, rejected);
            if (is_accepted(error)) break;
            rejected = 1;
            solver->rejected++;
        }
        if (begins && solver->unbroken) solver->corner = step.h * growth(error);
        begins = 0;
        *h = wanted;
        *time = last ? end : *time + step.h;
        solver->steps++;
        memcpy(x, step.x_new, sizeof step.x_new);
        if (!solver->observer) continue;
        bends(&work, (Lane(*)[NX])step.bend);
        if (solver->observer(solver->context, &step)) return SOLVER_STOPPED;
    }
    return SOLVER_OK;
}

void step_interpolate(const Step *step, double time, double *x)
{
    step_within(step, (time - step->time) / step->h, x);
}

#define MODEL_SOLVER
#include "rosenbrock.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "rodas5p.h"

#define NX AT_LEAST_ONE(MODEL_NX)
#define NU AT_LEAST_ONE(MODEL_NU)
#define NQ AT_LEAST_ONE(MODEL_NQ)
#define NJ AT_LEAST_ONE(MODEL_NJ)
#define NL AT_LEAST_ONE(MODEL_NL)

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
    double u[NU], du[NU];
    const double s = time - inputs->time;
    input_values(inputs, time, u, du);
    for (int i = 0; i < MODEL_NU; i++) {
        inputs->u[i][0] = u[i];
        inputs->u[i][1] = du[i];
        inputs->u[i][2] += s * inputs->u[i][3];
    }
    inputs->time = time;
}

/* One step --------------------------------------------------------------------------------------------------- */

/* The equations at the start of a step: slopes, their Jacobian and their derivative along time. */
typedef struct {
    double dx[NX], J[NJ], dx_dt[NX];
    double scale[NX]; /* one over the tolerance of each state */
} Start;

static void linearise(const Solver *solver, const double *q, double time, const double *x, Start *start)
{
    double u[NU], du[NU];
    input_values(&solver->inputs, time, u, du);
    model_linearise(time, x, u, du, q, start->dx, start->J, start->dx_dt);
    for (int i = 0; i < MODEL_NX; i++) start->scale[i] = 1 / (solver->tolerance * (model_nominal[i] + fabs(x[i])));
}

/* Mean square of the values over their tolerances. */
static inline double mean_square(const Start *start, const double *value)
{
    double sum = 0;
    for (int i = 0; i < MODEL_NX; i++) {
        const double scaled = value[i] * start->scale[i];
        sum += scaled * scaled;
    }
    return sum / NX;
}

/* A pivot this small beside the shift has lost its digits (or is no number). */
static inline int regular(const double *pivot, double shift)
{
    int good = 1;
    for (int i = 0; i < MODEL_NX; i++) good &= fabs(pivot[i]) > 1e-9 * shift;
    return good;
}

/* What `attempt` answers where a state goes below its minimum: no error is negative. */
#define BELOW (-1.0)

/* One step of size step->h from step->x; returns the square of the error over its tolerance, infinite where the step
 * broke down, BELOW where a stage or its end left the range of the equations. */
static double attempt(const Solver *solver, const double *q, const Start *start, Step *step)
{
    double k[STAGES][NX], x[NX], b[NX], L[NL], pivot[NX], u[NU], du[NU];
    const double h = step->h, inverse_h = 1 / h, shift = inverse_h * (1 / GAMMA);
    model_factorise(shift, start->J, L, pivot);
    if (!regular(pivot, shift)) return INFINITY;

#define STAGE(s)                                                                                      \
    do {                                                                                              \
        for (int i = 0; i < MODEL_NX; i++) {                                                          \
            double sum = s < 6 ? step->x[i] : x[i] + k[s - 1][i];                                     \
            if (s < 6)                                                                                \
                for (int j = 0; j < s; j++) sum += A[s][j] * k[j][i];                                 \
            x[i] = sum;                                                                               \
        }                                                                                             \
        if (model_below(x)) return BELOW;                                                             \
        if (s < 6) input_values(&solver->inputs, step->time + ALPHA[s] * h, u, du);                   \
        model_slopes(step->time + ALPHA[s] * h, x, u, du, q, b);                                      \
        for (int i = 0; i < MODEL_NX; i++) {                                                          \
            double sum = 0;                                                                           \
            for (int j = 0; j < s; j++) sum += C[s][j] * k[j][i];                                     \
            b[i] += sum * inverse_h;                                                                  \
            if (s < 5) b[i] += DELTA[s] * h * start->dx_dt[i];                                        \
        }                                                                                             \
        model_solve(L, b, k[s]);                                                                      \
    } while (0)

    for (int i = 0; i < MODEL_NX; i++) b[i] = start->dx[i] + DELTA[0] * h * start->dx_dt[i];
    model_solve(L, b, k[0]);
    STAGE(1);
    STAGE(2);
    STAGE(3);
    STAGE(4);
    STAGE(5);
    STAGE(6);
    STAGE(7);
#undef STAGE
    for (int i = 0; i < MODEL_NX; i++) step->x_new[i] = x[i] + k[STAGES - 1][i];
    if (model_below(step->x_new)) return BELOW;
    if (solver->observer)
        for (int d = 0; d < 3; d++)
            for (int i = 0; i < MODEL_NX; i++) {
                double sum = 0;
                for (int j = 0; j < STAGES; j++) sum += DENSE[d][j] * k[j][i];
                step->bend[d][i] = sum;
            }
    const double error = mean_square(start, k[STAGES - 1]);
    return error < INFINITY ? error : INFINITY;
}

/* Step size -------------------------------------------------------------------------------------------------- */

/* value^(-1/n), up to 7 % too large, for positive values: the bits of a double are nearly its logarithm. Unlike pow()
 * it is the same on every machine with IEEE doubles. */
static inline double inverse_root(double value, int n)
{
    const int64_t one = INT64_C(0x3ff) << 52;
    int64_t bits;
    memcpy(&bits, &value, sizeof bits);
    bits = one - (bits - one) / n;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* Not fmin and fmax: those are calls into the library with some compilers. */
static inline double smaller(double a, double b) { return a < b ? a : b; }
static inline double larger(double a, double b) { return a > b ? a : b; }

/* By how much the step may grow (or must shrink) for the square of an error. The sixth root of the error, not the fifth
 * that its order gives: steps swing less, and fewer are rejected. To remember the error before would gain nothing. */
static double growth(double error)
{
    if (!(error >= 0 && error < INFINITY)) return 0.1;
    return smaller(10, larger(0.1, 0.8 * inverse_root(larger(error, 1e-12), 12)));
}

/* As solver_first_step. Along the solution, x'' = J x' + d(x')/dt and x''' is near J x''. Their ratio is the speed of
 * the fastest motion, and x'' over the square of that speed how far it goes; if that is beyond the tolerance, the step
 * has to resolve it, to an error of about reach (speed h)^5 / 1000. */
static double resolving_step(const Start *start, double limit)
{
    double second[NX], third[NX];
    model_multiply(start->J, start->dx, second);
    for (int i = 0; i < MODEL_NX; i++) second[i] += start->dx_dt[i];
    model_multiply(start->J, second, third);
    const double a = mean_square(start, second), b = mean_square(start, third);
    const double speed = b / a, reach = a / (speed * speed); /* squares of both */
    if (!(reach > 1 && reach < INFINITY)) return limit;
    return smaller(limit, inverse_root(1e-6 * reach, 10) / sqrt(speed));
}

double solver_first_step(const Solver *solver, double time, const double *x, double limit)
{
    double q[NQ];
    Start start;
    model_prepare(solver->p, q);
    linearise(solver, q, time, x, &start);
    return resolving_step(&start, limit);
}

SolverStatus solver_advance(Solver *solver, double *time, double end, double *x, double *h)
{
    double q[NQ];
    Start start;
    Step step;
    long tries = 0, since_below = LATELY;
    int first = 1;
    model_prepare(solver->p, q);
    while (*time < end) {
        const double left = end - *time;
        double wanted = *h;
        int rejected = 0;
        linearise(solver, q, *time, x, &start);
        if (first) wanted = resolving_step(&start, wanted);
        first = 0;
        step.time = *time;
        memcpy(step.x, x, sizeof step.x);
        for (;;) {
            if (tries++ >= solver->max_steps) return SOLVER_TOO_MANY_STEPS;
            const int last = wanted >= left - larger(1e-9 * left, 4e-15 * fabs(*time)); /* leave no crumbs */
            step.h = last ? left : wanted;
            if (!(step.h > 4e-16 * fabs(*time) && step.h > 1e-300))
                return since_below < LATELY ? SOLVER_BELOW_MINIMUM : SOLVER_STEP_TOO_SMALL;
            const double error = attempt(solver, q, &start, &step);
            const double next = step.h * growth(error);
            since_below = error < 0 ? 0 : since_below + 1;
            if (error >= 0 && error <= 1) {
                *h = rejected ? smaller(next, step.h) : last ? larger(next, wanted) : next;
                *time = last ? end : *time + step.h;
                break;
            }
            wanted = next;
            rejected = 1;
            solver->rejected++;
        }
        solver->steps++;
        memcpy(x, step.x_new, sizeof step.x_new);
        if (solver->observer && solver->observer(solver->context, &step)) return SOLVER_STOPPED;
    }
    return SOLVER_OK;
}

void step_interpolate(const Step *step, double time, double *x)
{
    const double s = (time - step->time) / step->h, r = 1 - s;
    for (int i = 0; i < MODEL_NX; i++) {
        const double bend = step->bend[0][i] + s * (step->bend[1][i] + s * step->bend[2][i]);
        x[i] = step->x[i] * r + s * (step->x_new[i] + r * bend);
    }
}

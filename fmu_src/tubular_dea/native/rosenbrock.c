#include "rosenbrock.h"

#include <math.h>
#include <string.h>

#define NX AT_LEAST_ONE(MODEL_NX)
#define STAGES 6

static const double GAMMA = 0.25;

/* Stage positions, and gamma_i for the derivative along time. */
static const double ALPHA[STAGES] = {0, 0.386, 0.21, 0.63, 1, 1};
static const double DELTA[STAGES] = {0.25, -0.1043, 0.1035, -0.03620000000000023, 0, 0};

static const double A[STAGES][STAGES - 1] = {
    {0},
    {1.544},
    {0.9466785280815826, 0.2557011698983284},
    {3.314825187068521, 2.896124015972201, 0.9986419139977817},
    {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.687886036105895},
    {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.687886036105895, 1},
};

static const double C[STAGES][STAGES - 1] = {
    {0},
    {-5.6688},
    {-2.430093356833875, -0.2063599157091915},
    {-0.1073529058151375, -9.594562251023355, -20.47028614809616},
    {7.496443313967647, -10.24680431464352, -33.99990352819905, 11.7089089320616},
    {8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054},
};

static const double DENSE3[STAGES - 1] = {10.12623508344586, -7.487995877610167, -34.80091861555747,
                                          -7.992771707568823, 1.025137723295662};
static const double DENSE4[STAGES - 1] = {-0.6762803392801253, 6.087714651680015, 16.43084320892478,
                                          24.76722511418386, -6.594389125716872};

void inputs_at(const Inputs *inputs, double time, double *u, double *du)
{
    const double s = time - inputs->time;
    for (int i = 0; i < MODEL_NU; i++) {
        const double *c = inputs->u[i];
        u[i] = c[0] + s * (c[1] + s * (c[2] / 2 + s * (c[3] / 6)));
        du[i] = c[1] + s * (c[2] + s * (c[3] / 2));
    }
}

void inputs_move(Inputs *inputs, double time)
{
    double u[AT_LEAST_ONE(MODEL_NU)], du[AT_LEAST_ONE(MODEL_NU)];
    const double s = time - inputs->time;
    inputs_at(inputs, time, u, du);
    for (int i = 0; i < MODEL_NU; i++) {
        inputs->u[i][0] = u[i];
        inputs->u[i][1] = du[i];
        inputs->u[i][2] += s * inputs->u[i][3];
    }
    inputs->time = time;
}

static void rates(const Solver *solver, double time, const double *x, double *dx)
{
    double u[AT_LEAST_ONE(MODEL_NU)], du[AT_LEAST_ONE(MODEL_NU)];
    const double fold = 0; /* no state derivative may use the fold: it is an output only */
    inputs_at(&solver->inputs, time, u, du);
    model_derivatives(time, x, u, du, solver->p, &fold, dx);
}

static void linearise(const Solver *solver, double time, const double *x, double *J, double *dx_dt)
{
    double u[AT_LEAST_ONE(MODEL_NU)], du[AT_LEAST_ONE(MODEL_NU)];
    const double fold = 0;
    inputs_at(&solver->inputs, time, u, du);
    model_jacobian(time, x, u, du, solver->p, &fold, J, dx_dt);
}

/* LU with partial pivoting, in place; 0 where the matrix is singular or not finite. */
static int factorise(double M[NX][NX], int pivot[NX])
{
    for (int k = 0; k < MODEL_NX; k++) {
        int best = k;
        for (int i = k + 1; i < MODEL_NX; i++)
            if (fabs(M[i][k]) > fabs(M[best][k])) best = i;
        pivot[k] = best;
        if (!(fabs(M[best][k]) > 0) || !isfinite(M[best][k])) return 0;
        if (best != k)
            for (int j = 0; j < MODEL_NX; j++) {
                const double swap = M[k][j];
                M[k][j] = M[best][j];
                M[best][j] = swap;
            }
        for (int i = k + 1; i < MODEL_NX; i++) {
            M[i][k] /= M[k][k];
            for (int j = k + 1; j < MODEL_NX; j++) M[i][j] -= M[i][k] * M[k][j];
        }
    }
    return 1;
}

static void solve(double M[NX][NX], const int pivot[NX], double *b)
{
    for (int k = 0; k < MODEL_NX; k++) {
        const double swap = b[k];
        b[k] = b[pivot[k]];
        b[pivot[k]] = swap;
    }
    for (int i = 1; i < MODEL_NX; i++)
        for (int j = 0; j < i; j++) b[i] -= M[i][j] * b[j];
    for (int i = MODEL_NX - 1; i >= 0; i--) {
        for (int j = i + 1; j < MODEL_NX; j++) b[i] -= M[i][j] * b[j];
        b[i] /= M[i][i];
    }
}

/* Root mean square of the values over their tolerances. */
static double norm(const Solver *solver, const double *value, const double *x, const double *x_new)
{
    double sum = 0;
    for (int i = 0; i < MODEL_NX; i++) {
        const double size = fmax(fabs(x[i]), fabs(x_new[i]));
        const double scaled = value[i] / (solver->tolerance * (model_nominal[i] + size));
        sum += scaled * scaled;
    }
    return sqrt(sum / NX);
}

/* One step of size step->h from step->x; returns the error over its tolerance, infinite where it broke down. */
static double attempt(const Solver *solver, const double J[NX * NX], const double *dx_dt, Step *step)
{
    double k[STAGES][NX], M[NX][NX], x[NX];
    int pivot[NX];
    const double h = step->h;
    for (int i = 0; i < MODEL_NX; i++)
        for (int j = 0; j < MODEL_NX; j++) M[i][j] = (i == j ? 1 / (h * GAMMA) : 0) - J[i * MODEL_NX + j];
    if (!factorise(M, pivot)) return INFINITY;

    for (int s = 0; s < STAGES; s++) {
        for (int i = 0; i < MODEL_NX; i++) {
            x[i] = step->x[i];
            for (int j = 0; j < s; j++) x[i] += A[s][j] * k[j][i];
        }
        rates(solver, step->time + ALPHA[s] * h, x, k[s]);
        for (int i = 0; i < MODEL_NX; i++) {
            double sum = 0;
            for (int j = 0; j < s; j++) sum += C[s][j] * k[j][i];
            k[s][i] += sum / h + DELTA[s] * h * dx_dt[i];
        }
        solve(M, pivot, k[s]);
    }
    for (int i = 0; i < MODEL_NX; i++) {
        step->x_new[i] = x[i] + k[STAGES - 1][i];
        step->c3[i] = step->c4[i] = 0;
        for (int j = 0; j < STAGES - 1; j++) {
            step->c3[i] += DENSE3[j] * k[j][i];
            step->c4[i] += DENSE4[j] * k[j][i];
        }
    }
    const double error = norm(solver, k[STAGES - 1], step->x, step->x_new);
    return isfinite(error) ? error : INFINITY;
}

/* By how much the step may grow (or must shrink) for an error of the third-order method. */
static double growth(double error)
{
    if (!(error < INFINITY)) return 0.1;
    const double factor = 0.9 / sqrt(sqrt(fmax(error, 1e-12)));
    return fmin(6, fmax(0.2, factor));
}

double solver_first_step(const Solver *solver, double time, const double *x, double limit)
{
    double dx[NX];
    rates(solver, time, x, dx);
    const double size = norm(solver, x, x, x), speed = norm(solver, dx, x, x);
    const double h = speed > 0 ? 0.01 * size / speed : limit;
    return isfinite(h) && h > 0 ? fmin(h, limit) : limit;
}

SolverStatus solver_advance(Solver *solver, double *time, double end, double *x, double *h)
{
    double J[NX * NX], dx_dt[NX];
    Step step;
    long tries = 0;
    while (*time < end) {
        const double left = end - *time;
        double wanted = *h;
        int rejected = 0;
        linearise(solver, *time, x, J, dx_dt);
        step.time = *time;
        memcpy(step.x, x, sizeof step.x);
        for (;;) {
            if (tries++ >= solver->max_steps) return SOLVER_TOO_MANY_STEPS;
            const int last = wanted >= left * (1 - 1e-9);
            step.h = last ? left : wanted;
            if (!(step.h > 4e-16 * fabs(*time) && step.h > 1e-300)) return SOLVER_STEP_TOO_SMALL;
            const double error = attempt(solver, J, dx_dt, &step);
            const double next = step.h * growth(error);
            if (error <= 1) {
                *h = rejected ? fmin(next, step.h) : last ? fmax(next, wanted) : next;
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
    for (int i = 0; i < MODEL_NX; i++)
        x[i] = step->x[i] * r + s * (step->x_new[i] + r * (step->c3[i] + s * step->c4[i]));
}

#define MODEL_SOLVER
#include "pieces.h"

#include <math.h>
#include <string.h>

#include "start.h"

int piece_is_jump(const double *points, long k)
{
    return points[k + 1] - points[k] <= 1e-15 * fabs(points[k + 1]);
}

long piece_first(long n_points, const double *points)
{
    long first = 0;
    while (first < n_points - 2 && piece_is_jump(points, first)) first++;
    return first;
}

void piece_inputs(Inputs *inputs, const double *points, const double *u, long k)
{
    const double length = points[k + 1] - points[k];
    memset(inputs->u, 0, sizeof inputs->u);
    inputs->time = points[k];
    for (int i = 0; i < MODEL_NU; i++) {
        const double left = u[k * MODEL_NU + i], right = u[(k + 1) * MODEL_NU + i];
        inputs->u[i][0] = left;
        inputs->u[i][1] = (right - left) / length;
    }
}

void piece_rates(const Inputs *inputs, const double *before, double *rates, double *du)
{
    for (int i = 0; i < MODEL_NU; i++) {
        const double rate = inputs->u[i][1];
        du[i] = before && before[i] == inputs->u[i][0] ? 0.5 * (rates[i] + rate) : rate;
        rates[i] = rate;
    }
}

int piece_start(const double *p, const double *u, double *x)
{
    if (!start_states(u, p, x)) return NO_REST_STATE;
    return model_below(x) ? SOLVER_BELOW_MINIMUM : SOLVER_OK;
}

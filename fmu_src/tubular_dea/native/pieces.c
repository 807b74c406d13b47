#include "pieces.h"

#include <string.h>

long piece_first(long n_points, const double *points)
{
    long first = 0;
    while (first < n_points - 2 && points[first + 1] <= points[first]) first++;
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

Instance *piece_start(const double *p, const double *u, double time, double *x, int *status)
{
    char problem[PROBLEM_SIZE];
    *status = NO_REST_STATE;
    Instance *instance = instance_create("kernel", MODEL_GUID, CO_SIMULATION, problem);
    if (!instance) return NULL;
    memcpy(instance->now.p, p, MODEL_NP * sizeof *p);
    for (int i = 0; i < MODEL_NU; i++) instance->now.u[i][0] = u[i];
    instance->now.time = time;
    instance_enter_initialization(instance);
    if (instance_get_states(instance, x, MODEL_NX) == STATUS_OK) return instance;
    if (instance_above_minima(instance, "", instance->now.x, STATUS_ERROR) != STATUS_OK) *status = SOLVER_BELOW_MINIMUM;
    instance_free(instance);
    return NULL;
}

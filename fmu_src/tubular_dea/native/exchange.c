/* Model exchange: the host integrates. */
#include <math.h>
#include <string.h>

#include "instance.h"

#define NX AT_LEAST_ONE(MODEL_NX)

static Status check_count(Instance *instance, const char *what, const void *array, size_t n, size_t expected)
{
    if (n != expected)
        return instance_report(instance, STATUS_ERROR, "%s: expected %zu values but was given %zu", what, expected, n);
    if (n > 0 && !array)
        return instance_report(instance, STATUS_ERROR, "%s: expected %zu values but was given NULL", what, expected);
    return STATUS_OK;
}

Status instance_set_time(Instance *instance, double time)
{
    if (!isfinite(time) || time < instance->now.start)
        return instance_report(instance, STATUS_ERROR,
                               "time: expected a finite number, at least the start time %g, but was given %g",
                               instance->now.start, time);
    instance->now.time = time;
    instance->outputs_are_stale = 1;
    return STATUS_OK;
}

Status instance_set_states(Instance *instance, const double *x, size_t n)
{
    const Status status = check_count(instance, "continuous states", x, n, MODEL_NX);
    if (status != STATUS_OK) return status;
    for (size_t i = 0; i < n; i++)
        if (!isfinite(x[i]))
            return instance_report(instance, STATUS_ERROR, "continuous state %s: expected a finite number but was given %g",
                                   instance_name_of(STATE, (int)i), x[i]);
    /* Not an error: a solver that tried too large a step tries a smaller one. */
    if (instance_above_minima(instance, "continuous state", x, STATUS_DISCARD) != STATUS_OK) return STATUS_DISCARD;
    if (n > 0) memcpy(instance->now.x, x, n * sizeof *x);
    instance->outputs_are_stale = 1;
    return STATUS_OK;
}

Status instance_get_states(Instance *instance, double *x, size_t n)
{
    Status status = check_count(instance, "continuous states", x, n, MODEL_NX);
    if (status == STATUS_OK) status = instance_update_start(instance);
    if (status == STATUS_OK && n > 0) memcpy(x, instance->now.x, n * sizeof *x);
    return status;
}

static int inputs_differ(const Instance *instance)
{
    for (int i = 0; i < MODEL_NU; i++)
        if (instance->held.u[i] != instance->now.u[i][0]) return 1;
    return 0;
}

static void note_inputs(Instance *instance)
{
    Held *const held = &instance->held;
    if (held->within && inputs_differ(instance)) held->varies = 1;
    held->asked = held->within = 1;
    for (int i = 0; i < MODEL_NU; i++) held->u[i] = instance->now.u[i][0];
}

int instance_completed_step(Instance *instance)
{
    Held *const held = &instance->held;
    held->within = 0;
    return held->asked && !held->varies && inputs_differ(instance);
}

Status instance_get_derivatives(Instance *instance, double *dx, size_t n)
{
    Status status = check_count(instance, "state derivatives", dx, n, MODEL_NX);
    double value[NX];
    if (status == STATUS_OK) status = instance_update_start(instance);
    if (status != STATUS_OK) return status;
    instance_derivatives(instance, value);
    for (size_t i = 0; i < n; i++)
        if (!isfinite(value[i]))
            return instance_report(instance, STATUS_ERROR,
                                   "%s is not a finite number at time %.9g; check the states and inputs that were set",
                                   instance_name_of(DERIVATIVE, (int)i), instance->now.time);
    if (n > 0) memcpy(dx, value, n * sizeof *dx);
    if (instance->now.mode == CONTINUOUS_TIME) note_inputs(instance);
    return STATUS_OK;
}

Status instance_get_nominals(Instance *instance, double *nominal, size_t n)
{
    const Status status = check_count(instance, "nominal values", nominal, n, MODEL_NX);
    if (status == STATUS_OK && n > 0) memcpy(nominal, model_nominal, n * sizeof *nominal);
    return status;
}

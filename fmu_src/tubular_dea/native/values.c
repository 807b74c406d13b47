/* Getting and setting variables: every value is checked before any is changed. */
#include <math.h>
#include <string.h>

#include "instance.h"

#define NX AT_LEAST_ONE(MODEL_NX)

static Status known_reference(Instance *instance, const char *function, unsigned vr)
{
    if (model_variable(vr)) return STATUS_OK;
    return instance_report(instance, STATUS_ERROR, "%s: unknown value reference %u; expected 1 to %d", function, vr,
                           MODEL_VARIABLES);
}

static Status right_type(Instance *instance, const char *function, const Variable *v, Type type)
{
    static const char *const names[] = {"Real (Float64)", "Integer (Int32)", "Boolean"};
    if (v->type == type) return STATUS_OK;
    return instance_report(instance, STATUS_ERROR, "%s: %s is of type %s, not %s; use the function of its type",
                           function, v->name, names[v->type], names[type]);
}

static Status value_of(Instance *instance, const Variable *v, double *value)
{
    const Snapshot *now = &instance->now;
    double dx[NX];
    switch (v->kind) {
    case TIME: *value = now->time; return STATUS_OK;
    case INPUT: *value = now->u[v->index][0]; return STATUS_OK;
    case PARAMETER: *value = now->p[v->index]; return STATUS_OK;
    default: break;
    }
    const Status status = instance_update_start(instance);
    if (status != STATUS_OK) return status;
    if (v->needs_fold) instance_update_fold(instance);
    switch (v->kind) {
    case FOLD: *value = instance->fold; break;
    case STATE: *value = now->x[v->index]; break;
    case SAMPLED: *value = now->p[v->index]; break;
    case DERIVATIVE:
        instance_derivatives(instance, dx);
        *value = dx[v->index];
        break;
    default:
        instance_update_outputs(instance);
        *value = instance->y[v->index];
    }
    if (isfinite(*value)) return STATUS_OK;
    return instance_report(instance, STATUS_ERROR, "%s is not a finite number at time %.9g; check inputs and parameters",
                           v->name, now->time);
}

Status instance_get(Instance *instance, const char *function, Type type, const unsigned *vr, size_t n, double *value)
{
    Status status = instance_allow(instance, function, INITIALIZATION | RUNNING | TERMINATED);
    if (status == STATUS_OK && n > 0 && (!vr || !value))
        status = instance_report(instance, STATUS_ERROR, "%s: expected arrays of %zu values but was given NULL",
                                 function, n);
    for (size_t i = 0; i < n && status == STATUS_OK; i++) {
        status = known_reference(instance, function, vr[i]);
        if (status == STATUS_OK) status = right_type(instance, function, model_variable(vr[i]), type);
        if (status == STATUS_OK) status = value_of(instance, model_variable(vr[i]), &value[i]);
    }
    return status;
}

static Status settable(Instance *instance, const char *function, const Variable *v)
{
    if (v->kind == INPUT) return STATUS_OK;
    if (v->kind != PARAMETER)
        return instance_report(instance, STATUS_ERROR,
                               "%s: %s is calculated by the model and cannot be set; set inputs and parameters",
                               function, v->name);
    if (v->variability == FIXED && (instance->now.mode & RUNNING))
        return instance_report(instance, STATUS_ERROR,
                               "%s: %s is a fixed parameter; set it before the end of initialization mode", function,
                               v->name);
    if (instance->now.mode == CONTINUOUS_TIME)
        return instance_report(instance, STATUS_ERROR,
                               "%s: the parameter %s cannot change in continuous-time mode; enter event mode first",
                               function, v->name);
    if (instance->now.mode == INTERMEDIATE)
        return instance_report(instance, STATUS_ERROR,
                               "%s: the parameter %s cannot change during an intermediate update; set it between steps",
                               function, v->name);
    return STATUS_OK;
}

static Status in_range(Instance *instance, const char *function, const Variable *v, double value)
{
    const int plain = !strcmp(v->unit, "1");
    const char *space = plain ? "" : " ", *unit = plain ? "" : v->unit;
    if (!isfinite(value))
        return instance_report(instance, STATUS_ERROR, "%s: %s: expected a finite number%s%s but was given %g",
                               function, v->name, plain ? "" : " in ", unit, value);
    if (value < v->minimum)
        return instance_report(instance, STATUS_ERROR, "%s: %s: expected at least %g%s%s but was given %.10g", function,
                               v->name, v->minimum, space, unit, value);
    if (value > v->maximum)
        return instance_report(instance, STATUS_ERROR, "%s: %s: expected at most %g%s%s but was given %.10g", function,
                               v->name, v->maximum, space, unit, value);
    return STATUS_OK;
}

Status instance_set(Instance *instance, const char *function, Type type, const unsigned *vr, size_t n,
                    const double *value)
{
    Status status = instance_allow(instance, function, INSTANTIATED | INITIALIZATION | RUNNING);
    if (status == STATUS_OK && n > 0 && (!vr || !value))
        status = instance_report(instance, STATUS_ERROR, "%s: expected arrays of %zu values but was given NULL",
                                 function, n);
    for (size_t i = 0; i < n && status == STATUS_OK; i++) {
        status = known_reference(instance, function, vr[i]);
        if (status != STATUS_OK) break;
        const Variable *v = model_variable(vr[i]);
        status = right_type(instance, function, v, type);
        if (status == STATUS_OK) status = settable(instance, function, v);
        if (status == STATUS_OK) status = in_range(instance, function, v, value[i]);
    }
    if (status != STATUS_OK) return status;
    for (size_t i = 0; i < n; i++) {
        const Variable *v = model_variable(vr[i]);
        if (v->kind == INPUT) {
            instance_drop_spent(instance, v->index);
            instance->now.u[v->index][0] = value[i];
        } else {
            instance->now.p[v->index] = value[i];
        }
    }
    if (n > 0) instance_forget(instance);
    return STATUS_OK;
}

Status instance_set_input_derivatives(Instance *instance, const unsigned *vr, size_t n, const int32_t *order,
                                      const double *value)
{
    static const char function[] = "input derivatives";
    Status status = STATUS_OK;
    if (n > 0 && (!vr || !order || !value))
        status = instance_report(instance, STATUS_ERROR, "%s: expected arrays of %zu values but was given NULL",
                                 function, n);
    for (size_t i = 0; i < n && status == STATUS_OK; i++) {
        status = known_reference(instance, function, vr[i]);
        if (status != STATUS_OK) break;
        const Variable *v = model_variable(vr[i]);
        if (v->kind != INPUT)
            status = instance_report(instance, STATUS_ERROR, "%s: %s is not an input", function, v->name);
        else if (order[i] < 1 || order[i] > INPUT_ORDER)
            status = instance_report(instance, STATUS_ERROR, "%s: %s: expected an order from 1 to %d but was given %d",
                                     function, v->name, INPUT_ORDER, (int)order[i]);
        else if (!isfinite(value[i]))
            status = instance_report(instance, STATUS_ERROR,
                                     "%s: the derivative of %s: expected a finite number but was given %g", function,
                                     v->name, value[i]);
    }
    if (status != STATUS_OK) return status;
    if (n == 0) return STATUS_OK;
    for (int i = 0; i < MODEL_NU; i++) instance_drop_spent(instance, i);
    instance->now.marks &= ~SPENT;
    for (size_t i = 0; i < n; i++) instance->now.u[model_variable(vr[i])->index][order[i]] = value[i];
    instance->outputs_are_stale = 1;
    return STATUS_OK;
}

/* Directional derivatives of outputs and state derivatives, exact, from the emitted tangents. */
#include <math.h>
#include <string.h>

#include "equilibrium.h"
#include "instance.h"

#define NX AT_LEAST_ONE(MODEL_NX)
#define NU AT_LEAST_ONE(MODEL_NU)
#define NP AT_LEAST_ONE(MODEL_NP)
#define NY AT_LEAST_ONE(MODEL_NY)

/* Tangents of everything the equations depend on, and of what they yield. */
typedef struct {
    double time, x[NX], u[NU], du[NU], p[NP], fold;
    double dx[NX], y[NY];
} Tangent;

#if MODEL_HAS_CURVE
/* Rest states move with inputs and parameters along the curve: the implicit function theorem. */
static void rest_tangent(const Instance *instance, const double *u, Tangent *v)
{
    double load, rise, x[NX], v_load, v_x[NX];
    const double unknown = instance->now.x[CURVE_UNKNOWN], *p = instance->now.p;
    model_equilibrium(unknown, u, p, &load, &rise, x);
    model_equilibrium_tangent(unknown, u, p, 0, v->u, v->p, &v_load, v_x);
    model_equilibrium_tangent(unknown, u, p, (v->u[CURVE_LOAD] - v_load) / rise, v->u, v->p, &v_load, v->x);
}
#endif

/* How the states at the start move with inputs and parameters. */
static void start_tangent(const Instance *instance, const double *u, Tangent *v)
{
#if MODEL_HAS_CURVE
    if (instance->now.p[CURVE_SWITCH] != 0) {
        rest_tangent(instance, u, v);
        return;
    }
#endif
    model_start_tangent(u, instance->now.p, v->u, v->p, v->x);
}

/* Completes `v` from the tangents of time, inputs and parameters (and states, once they are free). */
static void push_forward(Instance *instance, Tangent *v)
{
    const Snapshot *now = &instance->now;
    double u[NU], du[NU];
    instance_inputs(instance, u, du);
    instance_update_fold(instance);
#if MODEL_HAS_CURVE
    /* The fold is a maximum (or an end of the interval): its load moves as if its place did not. */
    double v_x[NX];
    model_equilibrium_tangent(instance->fold_unknown, u, now->p, 0, v->u, v->p, &v->fold, v_x);
#endif
    if (now->mode == INITIALIZATION) start_tangent(instance, u, v);
    model_tangent(now->time, now->x, u, du, now->p, &instance->fold, v->time, v->x, v->u, v->du, v->p, &v->fold, v->dx,
                  v->y);
}

static double tangent_of(const Tangent *v, const Variable *variable)
{
    switch (variable->kind) {
    case TIME: return v->time;
    case INPUT: return v->u[variable->index];
    case STATE: return v->x[variable->index];
    case DERIVATIVE: return v->dx[variable->index];
    case PARAMETER: return v->p[variable->index];
    case FOLD: return v->fold;
    default: return v->y[variable->index];
    }
}

static void seed(Tangent *v, const Variable *variable, double value)
{
    if (variable->kind == INPUT) v->u[variable->index] += value;
    else if (variable->kind == STATE) v->x[variable->index] += value;
    else if (variable->kind == PARAMETER) v->p[variable->index] += value;
    else v->time += value;
}

static Status check(Instance *instance, const unsigned *unknown, size_t n_unknown, const unsigned *known, size_t n_known,
                    const void *seeds, const void *sensitivity)
{
    const int starting = instance->now.mode == INITIALIZATION;
    if ((n_unknown && !unknown) || (n_known && !known) || !seeds || !sensitivity)
        return instance_report(instance, STATUS_ERROR, "directional derivative: expected arrays but was given NULL");
    for (size_t i = 0; i < n_unknown; i++) {
        const Kind kind = unknown[i] < MODEL_VARIABLES ? model_variables[unknown[i]].kind : TIME;
        if (kind == TIME || kind == INPUT || kind == PARAMETER)
            return instance_report(instance, STATUS_ERROR,
                                   "directional derivative: value reference %u is not an unknown; expected an output or a "
                                   "state derivative",
                                   unknown[i]);
    }
    for (size_t i = 0; i < n_known; i++) {
        const Variable *v = known[i] < MODEL_VARIABLES ? &model_variables[known[i]] : NULL;
        const int allowed = v && v->type == TYPE_REAL &&
                            (v->kind == INPUT || v->kind == PARAMETER || (!starting && (v->kind == STATE || v->kind == TIME)));
        if (!allowed)
            return instance_report(instance, STATUS_ERROR,
                                   "directional derivative: value reference %u is not a known %s; expected an input, a "
                                   "parameter%s",
                                   known[i], starting ? "at initialization" : "now",
                                   starting ? "" : ", a state or the time");
    }
    return instance_update_start(instance);
}

Status instance_directional(Instance *instance, const unsigned *unknown, size_t n_unknown, const unsigned *known,
                            size_t n_known, const double *seeds, double *sensitivity)
{
    const Status status = check(instance, unknown, n_unknown, known, n_known, seeds, sensitivity);
    if (status != STATUS_OK) return status;
    Tangent v;
    memset(&v, 0, sizeof v);
    for (size_t k = 0; k < n_known; k++) seed(&v, &model_variables[known[k]], seeds[k]);
    push_forward(instance, &v);
    for (size_t i = 0; i < n_unknown; i++) sensitivity[i] = tangent_of(&v, &model_variables[unknown[i]]);
    return STATUS_OK;
}

/* By one forward pass for each known: with so few knowns a reverse pass would gain nothing. */
Status instance_adjoint(Instance *instance, const unsigned *unknown, size_t n_unknown, const unsigned *known,
                        size_t n_known, const double *seeds, double *sensitivity)
{
    const Status status = check(instance, unknown, n_unknown, known, n_known, seeds, sensitivity);
    if (status != STATUS_OK) return status;
    for (size_t k = 0; k < n_known; k++) {
        Tangent v;
        memset(&v, 0, sizeof v);
        seed(&v, &model_variables[known[k]], 1);
        push_forward(instance, &v);
        sensitivity[k] = 0;
        for (size_t i = 0; i < n_unknown; i++) sensitivity[k] += seeds[i] * tangent_of(&v, &model_variables[unknown[i]]);
    }
    return STATUS_OK;
}

Status instance_get_output_derivatives(Instance *instance, const unsigned *vr, size_t n, const int32_t *order,
                                       double *value)
{
    double dx[NX];
    Status status = STATUS_OK;
    if (n > 0 && (!vr || !order || !value))
        return instance_report(instance, STATUS_ERROR, "output derivatives: expected arrays of %zu values but was given NULL", n);
    for (size_t i = 0; i < n; i++) {
        const Variable *v = vr[i] < MODEL_VARIABLES ? &model_variables[vr[i]] : NULL;
        if (!v || (v->kind != OUTPUT && v->kind != STATE && v->kind != FOLD))
            return instance_report(instance, STATUS_ERROR, "output derivatives: value reference %u is not an output", vr[i]);
        if (order[i] != 1)
            return instance_report(instance, STATUS_ERROR,
                                   "output derivatives: %s: expected order 1 but was given %d", v->name, (int)order[i]);
    }
    if (MODEL_NX > 0) status = instance_get_derivatives(instance, dx, MODEL_NX);
    if (status != STATUS_OK) return status;
    Tangent v;
    memset(&v, 0, sizeof v);
    v.time = 1;
    for (int i = 0; i < MODEL_NX; i++) v.x[i] = dx[i];
    for (int i = 0; i < MODEL_NU; i++) {
        v.u[i] = instance->now.u[i][1];
        v.du[i] = instance->now.u[i][2];
    }
    push_forward(instance, &v);
    for (size_t i = 0; i < n; i++) value[i] = tangent_of(&v, &model_variables[vr[i]]);
    return STATUS_OK;
}

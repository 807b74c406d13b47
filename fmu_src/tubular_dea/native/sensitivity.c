/* Directional derivatives of outputs and state derivatives, exact, from the emitted tangents. */
#include <math.h>
#include <string.h>

#include "delay.h"
#include "equilibrium.h"
#include "instance.h"
#include "start.h"

#define NX AT_LEAST_ONE(MODEL_NX)
#define NU AT_LEAST_ONE(MODEL_NU)
#define NP AT_LEAST_ONE(MODEL_NP)
#define NY AT_LEAST_ONE(MODEL_NY)

/* Tangents of everything the equations depend on, and of what they yield. */
typedef struct {
    double time, x[NX], u[NU], du[NU], p[NP], fold;
    double dx[NX], y[NY];
} Tangent;

#if MODEL_DELAYS
/* Delayed inputs move with the inputs where nothing is delayed yet, else along time; and with their delays. */
static void delayed_tangent(const Instance *instance, const double *du, Tangent *v)
{
    for (int line = 0; line < MODEL_DELAYS; line++) {
        const DelayLine *delay = &model_delays[line];
        if (delay->input < 0) continue;
        const int open = delay_is_open(instance, line), starting = instance->now.mode == INITIALIZATION;
        const double late = starting ? 0 : -du[delay->slot] * v->p[delay->parameter];
        v->u[delay->slot] = late + (open ? v->u[delay->input] : du[delay->slot] * v->time);
        v->du[delay->slot] = open ? v->du[delay->input] : 0;
    }
}

/* The same for delayed definitions, once the tangents of the outputs are known. */
static void delayed_output_tangent(const Instance *instance, double *u, double *du, Tangent *v)
{
    double y[NY];
    model_outputs(instance->now.time, instance->now.x, u, du, instance->now.p, &instance->fold, y);
    delay_read_outputs(instance, y, u, du);
    for (int line = 0; line < MODEL_DELAYS; line++) {
        const DelayLine *delay = &model_delays[line];
        if (delay->output < 0) continue;
        v->u[delay->slot] = delay_is_open(instance, line) ? v->y[delay->output]
                                                          : du[delay->slot] * (v->time - v->p[delay->parameter]);
    }
}
#endif

/* Completes `v` from the tangents of time, inputs and parameters (and states, once they are free). */
static void push_forward(Instance *instance, Tangent *v)
{
    const Snapshot *now = &instance->now;
    double u[NU], du[NU];
    instance_inputs(instance, u, du);
    instance_update_fold(instance);
#if MODEL_DELAYS
    delayed_tangent(instance, du, v);
#endif
#if MODEL_HAS_CURVE
    /* The fold is a maximum (or an end of the interval): its load moves as if its place did not. */
    double v_x[NX];
    model_equilibrium_tangent(instance->fold_unknown, u, now->p, 0, v->u, v->p, &v->fold, v_x);
#endif
    if (now->mode == INITIALIZATION) start_tangent(u, now->p, now->x, v->u, v->p, v->x);
    model_tangent(now->time, now->x, u, du, now->p, &instance->fold, v->time, v->x, v->u, v->du, v->p, &v->fold, v->dx,
                  v->y);
#if MODEL_DELAYS
    delayed_output_tangent(instance, u, du, v);
    model_tangent(now->time, now->x, u, du, now->p, &instance->fold, v->time, v->x, v->u, v->du, v->p, &v->fold, v->dx,
                  v->y);
#endif
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
    case SAMPLED: return 0; /* constant between samples */
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

static const char *name_of(unsigned vr) 
{
    const Variable *v = model_variable(vr);
    return v ? v->name : "no variable";
}

static int is_unknown(unsigned vr)
{
    const Variable *v = model_variable(vr);
    const Kind kind = v ? v->kind : TIME;
    return kind != TIME && kind != INPUT && kind != PARAMETER;
}

/* At initialization, states follow from inputs and parameters, and time stands still. */
static int is_known(const Instance *instance, unsigned vr)
{
    const Variable *v = model_variable(vr);
    if (!v || v->type != TYPE_REAL) return 0;
    const Kind kind = v->kind;
    return kind == INPUT || kind == PARAMETER ||
           (instance->now.mode != INITIALIZATION && (kind == STATE || kind == TIME));
}

static Status check_request(Instance *instance, const unsigned *unknown, size_t n_unknown, const unsigned *known, size_t n_known)
{
    for (size_t i = 0; i < n_unknown; i++)
        if (!is_unknown(unknown[i]))
            return instance_report(instance, STATUS_ERROR,
                                   "partial derivatives: expected an output or a state derivative as unknown %zu but was "
                                   "given value reference %u (%s)",
                                   i, unknown[i], name_of(unknown[i]));
    for (size_t i = 0; i < n_known; i++)
        if (!is_known(instance, known[i]))
            return instance_report(instance, STATUS_ERROR,
                                   "partial derivatives: expected a real input or parameter%s as known %zu but was given "
                                   "value reference %u (%s)",
                                   instance->now.mode == INITIALIZATION ? "" : ", a state or the time", i, known[i],
                                   name_of(known[i]));
    return instance_update_start(instance);
}

static Status null_arrays(Instance *instance)
{
    return instance_report(instance, STATUS_ERROR, "partial derivatives: expected arrays but was given NULL");
}

static Status check_finite(Instance *instance, const unsigned *vr, size_t n, const double *value)
{
    for (size_t i = 0; i < n; i++)
        if (!isfinite(value[i]))
            return instance_report(instance, STATUS_ERROR,
                                   "the derivative by or of %s is not a finite number at time %.9g; check the seeds, and that "
                                   "the start is not exactly at the fold",
                                   name_of(vr[i]), instance->now.time);
    return STATUS_OK;
}

Status instance_directional(Instance *instance, const unsigned *unknown, size_t n_unknown, const unsigned *known,
                            size_t n_known, const double *seeds, double *sensitivity)
{
    if ((n_unknown && (!unknown || !sensitivity)) || (n_known && (!known || !seeds))) return null_arrays(instance);
    const Status status = check_request(instance, unknown, n_unknown, known, n_known);
    if (status != STATUS_OK) return status;
    Tangent v;
    memset(&v, 0, sizeof v);
    for (size_t k = 0; k < n_known; k++) seed(&v, model_variable(known[k]), seeds[k]);
    push_forward(instance, &v);
    for (size_t i = 0; i < n_unknown; i++) sensitivity[i] = tangent_of(&v, model_variable(unknown[i]));
    return check_finite(instance, unknown, n_unknown, sensitivity);
}

/* By one forward pass for each known: with so few knowns a reverse pass would gain nothing. */
Status instance_adjoint(Instance *instance, const unsigned *unknown, size_t n_unknown, const unsigned *known,
                        size_t n_known, const double *seeds, double *sensitivity)
{
    if ((n_unknown && (!unknown || !seeds)) || (n_known && (!known || !sensitivity))) return null_arrays(instance);
    const Status status = check_request(instance, unknown, n_unknown, known, n_known);
    if (status != STATUS_OK) return status;
    for (size_t k = 0; k < n_known; k++) {
        Tangent v;
        memset(&v, 0, sizeof v);
        seed(&v, model_variable(known[k]), 1);
        push_forward(instance, &v);
        sensitivity[k] = 0;
        for (size_t i = 0; i < n_unknown; i++) sensitivity[k] += seeds[i] * tangent_of(&v, model_variable(unknown[i]));
    }
    return check_finite(instance, known, n_known, sensitivity);
}

Status instance_get_output_derivatives(Instance *instance, const unsigned *vr, size_t n, const int32_t *order,
                                       double *value)
{
    double dx[NX];
    Status status = STATUS_OK;
    if (n > 0 && (!vr || !order || !value))
        return instance_report(instance, STATUS_ERROR, "output derivatives: expected arrays of %zu values but was given NULL", n);
    for (size_t i = 0; i < n; i++) {
        const Variable *v = model_variable(vr[i]);
        if (!v || (v->kind != OUTPUT && v->kind != STATE && v->kind != FOLD))
            return instance_report(instance, STATUS_ERROR,
                                   "output derivatives: expected an output but was given value reference %u (%s)", vr[i],
                                   name_of(vr[i]));
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
    for (size_t i = 0; i < n; i++) value[i] = tangent_of(&v, model_variable(vr[i]));
    return check_finite(instance, vr, n, value);
}

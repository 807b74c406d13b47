/* Co-simulation: one communication step. */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "delay.h"
#include "instance.h"

#ifndef MAX_STEPS
#define MAX_STEPS 1000000 /* internal steps in one communication step: bounded, so that no call hangs */
#endif

static Status check_step(Instance *instance, double time, double step)
{
    const Snapshot *now = &instance->now;
    if (!isfinite(step) || !(step > 0))
        return instance_report(instance, STATUS_ERROR,
                               "communication step size: expected a positive finite number in s but was given %g",
                               step);
    /* Hosts count time in their own ways: allow for rounding, and for a part of the step that changes nothing. */
    const double slack = fmax(1e-15 * fabs(now->time), fmin(1e-9 * fmax(fabs(now->time), step), 1e-3 * step));
    if (!isfinite(time) || fabs(time - now->time) > slack)
        return instance_report(instance, STATUS_ERROR,
                               "communication point: expected the present time %.12g s but was given %.12g; the "
                               "instance neither goes back in time nor skips any, unless a saved state is restored",
                               now->time, time);
    if (!isfinite(time + step))
        return instance_report(instance, STATUS_ERROR,
                               "communication step: expected an end that is a number but %g s after %.12g s there is none",
                               step, time);
    if (time + step > now->stop + slack)
        return instance_report(instance, STATUS_ERROR,
                               "communication step: expected an end at or before the stop time %.12g s but was given "
                               "%.12g",
                               now->stop, time + step);
    if (!(step > 1e-15 * fabs(time) && step > 1e-290))
        return instance_report(instance, STATUS_ERROR,
                               "communication step size: %g s is lost in rounding at time %.12g s; expected more", step,
                               time);
    return STATUS_OK;
}

typedef struct {
    Instance *instance;
    Solver *solver;
    Between between;
    double end; /* of the communication step */
} Watch;

/* After an internal step: keep the delayed signals, and let the host look at the instance. Stops the solver if inputs or
 * the end have changed. */
static int look(void *context, const Step *step)
{
    Watch *watch = context;
    Instance *instance = watch->instance;
    const double end = watch->end;
    Inputs inputs = watch->solver->inputs;
    delay_keep_outputs(instance, &inputs, step);
    if (!watch->between) return 0;
    inputs_move(&inputs, instance->now.time);
    memcpy(instance->now.u, inputs.u, sizeof inputs.u);
    instance_forget(instance);
    instance->now.mode = INTERMEDIATE;
    watch->end = fmax(instance->now.time, fmin(end, watch->between(instance, end)));
    instance->now.mode = STEPPING;
    return watch->end < end || memcmp(instance->now.u, inputs.u, sizeof inputs.u);
}

/* The state that is nearest to its minimum, by its nominal value. */
static const Variable *nearest_minimum(const double *x)
{
    const Variable *nearest = model_variables;
    double least = INFINITY;
    for (int i = 0; i < MODEL_VARIABLES; i++) {
        const Variable *v = &model_variables[i];
        if (v->kind != STATE) continue;
        const double room = (x[v->index] - v->minimum) / model_nominal[v->index];
        if (room < least) nearest = v, least = room;
    }
    return nearest;
}

static Status solver_failed(Instance *instance, SolverStatus failure, const Snapshot *reached)
{
    char states[512] = "";
    size_t used = 0;
    for (int i = 0; i < MODEL_VARIABLES; i++) {
        const Variable *v = &model_variables[i];
        if (v->kind == STATE && used < sizeof states - 1)
            used += (size_t)snprintf(states + used, sizeof states - used, "%s%s = %.6g", used ? ", " : "", v->name,
                                     reached->x[v->index]);
    }
    if (failure == SOLVER_BELOW_MINIMUM) {
        const Variable *v = nearest_minimum(reached->x);
        return instance_report(instance, STATUS_ERROR,
                               "%s would come to %g, where the equations end, at time %.9g with %s; the instance is as it "
                               "was before the step; check inputs and parameters, and their units",
                               v->name, v->minimum, reached->time, states);
    }
    if (failure == SOLVER_TOO_MANY_STEPS)
        return instance_report(instance, STATUS_ERROR,
                               "more than %d internal steps were needed: stopped at time %.9g with %s; the instance is as "
                               "it was before the step; use a shorter step or a larger tolerance",
                               MAX_STEPS, reached->time, states);
    return instance_report(instance, STATUS_ERROR,
                           "no step size, however small, solves the equations at time %.9g with %s; the instance is as it "
                           "was before the step; check inputs and parameters",
                           reached->time, states);
}

/* The input that its derivatives have carried beyond every number; NULL where there is none. */
static const Variable *endless_input(const Instance *instance)
{
    for (int i = 0; i < MODEL_VARIABLES; i++) {
        const Variable *v = &model_variables[i];
        if (v->kind == INPUT && !isfinite(instance->now.u[v->index][0])) return v;
    }
    return NULL;
}

/* Integrate towards `end` with the instance's present inputs; the observer, if any, may stop it on the way. */
static SolverStatus run(Instance *instance, Solver *solver, double end)
{
    Snapshot *now = &instance->now;
    SolverStatus outcome;
    delay_keep_inputs(instance, end);
    for (;;) {
        const double stop = delay_next(instance, end);
        solver->inputs.time = now->time;
        memcpy(solver->inputs.u, now->u, sizeof solver->inputs.u);
        delay_drive(instance, &solver->inputs);
        solver->max_steps = MAX_STEPS - solver->steps - solver->rejected;
        if (!(now->h > 0)) now->h = stop - now->time;
        outcome = solver_advance(solver, &now->time, stop, now->x, &now->h);
        if (outcome != SOLVER_OK || now->time >= end) return outcome;
        inputs_move(&solver->inputs, now->time);
        memcpy(now->u, solver->inputs.u, sizeof now->u);
    }
}

/* What decays comes to zero, not to denormal numbers, which are slow. */
static void decayed(int n, double *value)
{
    for (int i = 0; i < n; i++)
        if (fabs(value[i]) < DBL_MIN) value[i] = 0;
}

/* The discretes change here and nowhere else, from the inputs as they are at the start of the step. */
static void take_sample(Instance *instance)
{
#if MODEL_ND
    Snapshot *now = &instance->now;
    double u[AT_LEAST_ONE(MODEL_NU)], du[AT_LEAST_ONE(MODEL_NU)], sampled[MODEL_ND];
    instance_inputs(instance, u, du);
    model_sample(now->time, now->x, u, now->p, sampled);
    decayed(MODEL_ND, sampled);
    memcpy(now->p + MODEL_NP - MODEL_ND, sampled, sizeof sampled);
#else
    (void)instance;
#endif
}

Status instance_do_step(Instance *instance, double time, double step, Between between)
{
    const Status status = check_step(instance, time, step);
    if (status != STATUS_OK) return status;
    const Snapshot before = instance->now;
    Snapshot *now = &instance->now;
    Solver solver = {0};
    Watch watch = {instance, &solver, between, time + step};
    SolverStatus outcome;
    solver.p = now->p;
    solver.tolerance = now->tolerance;
    solver.observer = between || MODEL_DELAYS > 0 ? look : NULL;
    solver.context = &watch;
    for (int i = 0; i < MODEL_NU; i++) instance_drop_spent(instance, i);
    now->marks &= ~SPENT;
    now->time = time;
    take_sample(instance);
    do outcome = run(instance, &solver, watch.end);
    while (outcome == SOLVER_STOPPED && now->time < watch.end);
    instance_forget(instance);
    if (outcome != SOLVER_OK && outcome != SOLVER_STOPPED) {
        const Snapshot reached = instance->now;
        instance->now = before;
        return solver_failed(instance, outcome, &reached);
    }
    if (outcome == SOLVER_OK) {
        inputs_move(&solver.inputs, now->time);
        memcpy(now->u, solver.inputs.u, sizeof now->u);
    }
    const Variable *endless = endless_input(instance);
    if (endless) {
        instance->now = before;
        return instance_report(instance, STATUS_ERROR,
                               "input %s: expected derivatives under which it stays a number but they carry it beyond the "
                               "largest one within the step of %g s; the instance is as it was before the step",
                               endless->name, step);
    }
    decayed(MODEL_NX, now->x);
    now->marks |= SPENT;
    instance_note(instance, LOG_SOLVER, "stepped to time %.9g: %ld internal steps, %ld rejected", now->time,
                  solver.steps, solver.rejected);
    return STATUS_OK;
}

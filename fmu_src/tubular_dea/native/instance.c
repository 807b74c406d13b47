#include "instance.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "delay.h"
#include "equilibrium.h"
#include "start.h"

#define NU AT_LEAST_ONE(MODEL_NU)
#define DEFAULT_TOLERANCE 1e-6
#define SMALLEST_TOLERANCE 1e-12
#define LARGEST_TOLERANCE 1e-2

/* Life ------------------------------------------------------------------------------------------------------ */

static int is_blank(const char *text) { return !text || !text[strspn(text, " \t\r\n")]; }

Instance *instance_create(const char *name, const char *guid, Interface interface, char problem[PROBLEM_SIZE])
{
    if (is_blank(name)) {
        snprintf(problem, PROBLEM_SIZE, "instantiate: expected an instance name but was given none");
        return NULL;
    }
    if (!guid || strcmp(guid, MODEL_GUID)) {
        snprintf(problem, PROBLEM_SIZE,
                 "instantiate: expected the GUID (instantiation token) %s of modelDescription.xml but was given %.80s",
                 MODEL_GUID, guid ? guid : "NULL");
        return NULL;
    }
    if (MODEL_DELAYS > 0 && interface == MODEL_EXCHANGE) {
        snprintf(problem, PROBLEM_SIZE,
                 "instantiate: %s keeps delayed signals between communication points; expected co-simulation but was asked "
                 "for model exchange",
                 MODEL_NAME);
        return NULL;
    }
    if (MODEL_ND > 0 && interface == MODEL_EXCHANGE) {
        snprintf(problem, PROBLEM_SIZE,
                 "instantiate: %s is sampled at communication points; expected co-simulation but was asked for model exchange",
                 MODEL_NAME);
        return NULL;
    }
    Instance *instance = calloc(1, sizeof *instance);
    if (instance) instance->name = calloc(strlen(name) + 1, 1);
    if (!instance || !instance->name) {
        snprintf(problem, PROBLEM_SIZE, "instantiate: out of memory");
        free(instance);
        return NULL;
    }
    strcpy(instance->name, name);
    instance->interface = interface;
    instance_reset(instance);
    return instance;
}

void instance_free(Instance *instance)
{
    if (!instance) return;
    free(instance->name);
    free(instance);
}

void instance_forget(Instance *instance)
{
    instance->start_is_stale = instance->outputs_are_stale = instance->fold_is_stale = 1;
}

void instance_reset(Instance *instance)
{
    memset(&instance->now, 0, sizeof instance->now);
    memset(&instance->held, 0, sizeof instance->held);
    instance->now.stop = INFINITY;
    instance->now.tolerance = DEFAULT_TOLERANCE;
    instance->now.mode = INSTANTIATED;
    for (int i = 0; i < MODEL_VARIABLES; i++) {
        const Variable *v = &model_variables[i];
        if (v->kind == INPUT) instance->now.u[v->index][0] = v->start;
        if (v->kind == PARAMETER) instance->now.p[v->index] = v->start;
    }
    instance_forget(instance);
}

/* Messages -------------------------------------------------------------------------------------------------- */

static const char *category_of(Status status)
{
    switch (status) {
    case STATUS_WARNING: return "logStatusWarning";
    case STATUS_DISCARD: return "logStatusDiscard";
    case STATUS_FATAL: return "logStatusFatal";
    default: return "logStatusError";
    }
}

Status instance_report(Instance *instance, Status status, const char *format, ...)
{
    char message[1024];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    if (instance->log) instance->log(instance, status, category_of(status), message);
    return status;
}

void instance_note(Instance *instance, LogCategory category, const char *format, ...)
{
    char message[1024];
    va_list arguments;
    if (!instance->log || !(instance->logged & category)) return;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    instance->log(instance, STATUS_OK, category == LOG_EVENTS ? "logEvents" : "logSolver", message);
}

static const char *mode_name(int mode)
{
    switch (mode) {
    case INSTANTIATED: return "before initialization mode";
    case INITIALIZATION: return "in initialization mode";
    case EVENT: return "in event mode";
    case CONTINUOUS_TIME: return "in continuous-time mode";
    case STEPPING: return "in step mode";
    case INTERMEDIATE: return "during an intermediate update";
    default: return "after terminate";
    }
}

Status instance_allow(Instance *instance, const char *function, int modes)
{
    if (instance->now.mode & modes) return STATUS_OK;
    return instance_report(instance, STATUS_ERROR, "%s cannot be called %s; the call was ignored", function,
                           mode_name(instance->now.mode));
}

Status instance_allow_only(Instance *instance, const char *function, Interface interface, int modes)
{
    static const char *const names[] = {"model exchange", "co-simulation"};
    if (instance->interface == interface) return instance_allow(instance, function, modes);
    return instance_report(instance, STATUS_ERROR,
                           "%s belongs to %s, but this instance was made for %s; the call was ignored", function,
                           names[interface], names[instance->interface]);
}

const char *instance_name_of(Kind kind, int index)
{
    for (int i = 0; i < MODEL_VARIABLES; i++)
        if (model_variables[i].kind == kind && model_variables[i].index == index) return model_variables[i].name;
    return "?";
}

static int is_status_category(const char *name)
{
    static const char *const known[] = {"logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal"};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (!strcmp(name, known[i])) return 1;
    return 0;
}

Status instance_set_logging(Instance *instance, int on, size_t n, const char *const *categories)
{
    unsigned wanted = n ? 0 : LOG_EVENTS | LOG_SOLVER;
    for (size_t i = 0; i < n; i++) {
        const char *name = categories && categories[i] ? categories[i] : "";
        if (!strcmp(name, "logEvents")) wanted |= LOG_EVENTS;
        else if (!strcmp(name, "logSolver")) wanted |= LOG_SOLVER;
        else if (!strcmp(name, "logAll")) wanted |= LOG_EVENTS | LOG_SOLVER;
        else if (!is_status_category(name)) /* errors and warnings are always reported */
            return instance_report(instance, STATUS_ERROR,
                                   "debug logging: expected a log category of modelDescription.xml but was given '%s'",
                                   name);
    }
    instance->logged = on ? wanted : 0;
    return STATUS_OK;
}

void instance_drop_spent(Instance *instance, int i)
{
    if (instance->now.marks & SPENT)
        for (int k = 1; k <= INPUT_ORDER; k++) instance->now.u[i][k] = 0;
}

/* What is recomputed from the snapshot ------------------------------------------------------------------------ */

void instance_inputs(const Instance *instance, double *u, double *du)
{
    for (int i = 0; i < MODEL_NU; i++) {
        u[i] = instance->now.u[i][0];
        du[i] = instance->now.u[i][1];
    }
    delay_read_inputs(instance, u, du);
}

#if MODEL_HAS_CURVE
/* The fold costs as much as a whole step: it is sought again only when something that moves the curve has changed. */
static int curve_moved(Instance *instance, const double *u)
{
    static const int moves[] = CURVE_MOVED_BY;
    int moved = memcmp(instance->fold_p, instance->now.p, sizeof instance->fold_p) != 0;
    for (int i = 0; i < MODEL_NU; i++) moved |= moves[i] && instance->fold_u[i] != u[i];
    memcpy(instance->fold_p, instance->now.p, sizeof instance->fold_p);
    memcpy(instance->fold_u, u, sizeof instance->fold_u);
    return moved;
}
#endif

void instance_update_fold(Instance *instance)
{
#if MODEL_HAS_CURVE
    if (instance->fold_is_stale) {
        double u[NU], du[NU];
        instance_inputs(instance, u, du);
        if (curve_moved(instance, u)) {
            const CurvePoint fold = curve_fold(u, instance->now.p);
            instance->fold = fold.load;
            instance->fold_unknown = fold.unknown;
        }
        instance->outputs_are_stale = 1;
    }
#endif
    instance->fold_is_stale = 0;
}

Status instance_above_minima(Instance *instance, const char *what, const double *x, Status status)
{
    for (int i = 0; i < MODEL_VARIABLES; i++) {
        const Variable *v = &model_variables[i];
        if (v->kind == STATE && x[v->index] <= v->minimum)
            return instance_report(instance, status,
                                   "%s %s: expected more than %g, where the equations end, but was given %.6g", what, v->name,
                                   v->minimum, x[v->index]);
    }
    return STATUS_OK;
}

static Status no_rest_state(Instance *instance, const double *u)
{
#if MODEL_HAS_CURVE
    instance_update_fold(instance);
    instance_report(instance, STATUS_ERROR,
                    "no rest state to start at: expected a load between that of the lower end of the curve and the fold "
                    "at %.6g, but the load was %.6g; lower the load, change the other inputs, or do not start at equilibrium",
                    instance->fold, u[CURVE_LOAD]);
#else
    (void)instance, (void)u;
#endif
    return STATUS_ERROR;
}

/* Initial states from parameters and inputs, while in initialization mode. */
Status instance_update_start(Instance *instance)
{
    Snapshot *now = &instance->now;
    double u[NU], du[NU];
    if (now->mode != INITIALIZATION || !instance->start_is_stale) return STATUS_OK;
    instance_inputs(instance, u, du);
#if MODEL_ND
    model_sample_start(u, now->p, now->p + MODEL_NP - MODEL_ND);
#endif
    if (!start_states(u, now->p, now->x)) return no_rest_state(instance, u);
    if (instance_above_minima(instance, "start value of", now->x, STATUS_ERROR) != STATUS_OK) return STATUS_ERROR;
    instance->start_is_stale = 0;
    instance->outputs_are_stale = 1;
    return STATUS_OK;
}

void instance_update_outputs(Instance *instance)
{
    double u[NU], du[NU];
    if (!instance->outputs_are_stale) return;
    instance_inputs(instance, u, du);
    model_outputs(instance->now.time, instance->now.x, u, du, instance->now.p, &instance->fold, instance->y);
    if (MODEL_DELAYS > 0) {
        delay_read_outputs(instance, instance->y, u, du);
        model_outputs(instance->now.time, instance->now.x, u, du, instance->now.p, &instance->fold, instance->y);
    }
    instance->outputs_are_stale = 0;
}

void instance_derivatives(const Instance *instance, double *dx)
{
    double u[NU], du[NU];
    const double fold = 0; /* no state derivative may use the fold */
    instance_inputs(instance, u, du);
    model_derivatives(instance->now.time, instance->now.x, u, du, instance->now.p, &fold, dx);
}

/* Initialization ------------------------------------------------------------------------------------------------ */

Status instance_setup(Instance *instance, int has_tolerance, double tolerance, double start, int has_stop, double stop)
{
    Snapshot *now = &instance->now;
    if (!isfinite(start))
        return instance_report(instance, STATUS_ERROR, "start time: expected a finite number but was given %g", start);
    if (has_stop && !(stop >= start))
        return instance_report(instance, STATUS_ERROR, "stop time: expected at least the start time %g but was given %g",
                               start, stop);
    if (has_tolerance && !(tolerance > 0 && isfinite(tolerance)))
        return instance_report(instance, STATUS_ERROR, "tolerance: expected a positive number but was given %g",
                               tolerance);
    now->start = now->time = start;
    now->stop = has_stop ? stop : INFINITY;
    now->tolerance = DEFAULT_TOLERANCE;
    now->marks |= SET_UP;
    if (!has_tolerance) return STATUS_OK;
    now->tolerance = fmin(LARGEST_TOLERANCE, fmax(SMALLEST_TOLERANCE, tolerance));
    if (now->tolerance == tolerance) return STATUS_OK;
    return instance_report(instance, STATUS_WARNING, "tolerance: expected %g to %g but was given %g; using %g",
                           SMALLEST_TOLERANCE, LARGEST_TOLERANCE, tolerance, now->tolerance);
}

Status instance_enter_initialization(Instance *instance)
{
    instance->now.mode = INITIALIZATION;
    instance_forget(instance);
    return STATUS_OK;
}

Status instance_exit_initialization(Instance *instance)
{
    const Status status = instance_update_start(instance);
    if (status != STATUS_OK) return status;
    instance->now.mode = instance->interface == CO_SIMULATION ? STEPPING : EVENT;
    instance->now.h = 0;
    instance_note(instance, LOG_EVENTS, "initialized at time %g with tolerance %g", instance->now.time,
                  instance->now.tolerance);
    return STATUS_OK;
}

/* The calls of FMI 3.0. */
#include "fmi3Functions.h"

#define F(name) fmi3##name

static int get_real(void *c, unsigned vr, double *x) { return finite(fmi3GetFloat64(c, &vr, 1, x, 1), x, 1); }
static int take_state(void *c, void **state) { return fmi3GetFMUState(c, state); }
static int put_state(void *c, void *state) { return fmi3SetFMUState(c, state); }
static int drop_state(void *c, void **state) { return fmi3FreeFMUState(c, state); }
static int state_bytes(void *c, void *state, size_t *size) { return fmi3SerializedFMUStateSize(c, state, size); }
static int write_state(void *c, void *state, unsigned char *into, size_t size)
{
    return fmi3SerializeFMUState(c, state, into, size);
}
static int read_state(void *c, const unsigned char *from, size_t size, void **state)
{
    return fmi3DeserializeFMUState(c, from, size, state);
}

static void hear(void *environment, fmi3Status status, fmi3String category, fmi3String text)
{
    if (!text || !*text || !category || status > fmi3Fatal || !environment) stop_here("a message without text", "logger");
    messages++;
}

static void call_one(Slot *s);

/* Now and then something else is called from inside a step, and the step ended early. */
static void update(void *environment, double time, bool set, bool get, bool finished, bool may_return, bool *stop,
                   double *stop_time)
{
    Slot *s = environment;
    if (!isfinite(time) || !set || !get || !finished) stop_here("wrong arguments", "intermediate update");
    if (once_in(20) && !s->inside) {
        s->inside = 1;
        call_one(s);
        s->inside = 0;
    }
    *stop = may_return && once_in(10);
    *stop_time = wild(time + between(0, 0.01));
}

static void *instantiate(Slot *s, const char *name, const char *guid)
{
    if (!s->cosimulation) return fmi3InstantiateModelExchange(name, guid, NULL, false, pick(2), s, hear);
    return fmi3InstantiateCoSimulation(name, guid, NULL, false, pick(2), false, pick(2), NULL, 0, s, hear, MAYBE(update));
}

#include "common_calls.h"

static int enter_initialization(Slot *s)
{
    return fmi3EnterInitializationMode(s->c, pick(2), wild(1e-6), wild(0), pick(2), wild(between(0, 100)));
}
static int get_reals(Slot *s) { return fmi3GetFloat64(s->c, MAYBE(a.vr), a.n, MAYBE(a.y), COUNT(a.n)); }
static int set_reals(Slot *s)
{
    a.n = pick(2);
    return fmi3SetFloat64(s->c, MAYBE(a.vr), a.n, MAYBE(a.x), COUNT(a.n));
}
static int set_many_reals(Slot *s) { return fmi3SetFloat64(s->c, MAYBE(a.vr), a.n, MAYBE(a.x), COUNT(a.n)); }
static int get_integers(Slot *s) { return fmi3GetInt32(s->c, MAYBE(a.vr), a.n, MAYBE(a.i), COUNT(a.n)); }
static int set_integers(Slot *s) { return fmi3SetInt32(s->c, MAYBE(a.vr), a.n, MAYBE(a.i), COUNT(a.n)); }

static int booleans(Slot *s)
{
    bool values[MANY] = {false, true, false, true, false, true};
    if (pick(2)) return fmi3GetBoolean(s->c, MAYBE(a.vr), a.n, MAYBE(values), COUNT(a.n));
    a.n = pick(2);
    return fmi3SetBoolean(s->c, MAYBE(a.vr), a.n, MAYBE(values + pick(2)), COUNT(a.n));
}

static int directional(Slot *s)
{
    double out[MANY] = {0};
    const int status = fmi3GetDirectionalDerivative(s->c, MAYBE(a.vr), a.n, MAYBE(a.other), a.m, MAYBE(a.y), COUNT(a.m),
                                                    MAYBE(out), COUNT(a.n));
    return finite(status, out, a.n);
}

static int adjoint(Slot *s)
{
    double out[MANY] = {0};
    const int status = fmi3GetAdjointDerivative(s->c, MAYBE(a.vr), a.n, MAYBE(a.other), a.m, MAYBE(a.y), COUNT(a.n),
                                                MAYBE(out), COUNT(a.m));
    return finite(status, out, a.m);
}

static int output_derivatives(Slot *s)
{
    double out[MANY] = {0};
    for (unsigned k = 0; k < a.n; k++) a.order[k] = once_in(20) ? a.order[k] : 1;
    return finite(fmi3GetOutputDerivatives(s->c, MAYBE(a.vr), a.n, MAYBE(a.order), MAYBE(out), COUNT(a.n)), out, a.n);
}

static int step(Slot *s)
{
    bool events = false, end = false, early = false;
    double reached = 0;
    return finite(fmi3DoStep(s->c, once_in(30) ? wild(0) : present(s->c), wild(between(0, 0.05)), pick(2), MAYBE(&events),
                             MAYBE(&end), MAYBE(&early), MAYBE(&reached)), &reached, 1);
}

static int update_discrete(Slot *s)
{
    bool flag[5];
    double time;
    return fmi3UpdateDiscreteStates(s->c, MAYBE(&flag[0]), &flag[1], &flag[2], MAYBE(&flag[3]), &flag[4], MAYBE(&time));
}

static int completed(Slot *s)
{
    bool event, end;
    return fmi3CompletedIntegratorStep(s->c, pick(2), MAYBE(&event), MAYBE(&end));
}

static int get_rates(Slot *s)
{
    double x[MANY + MODEL_NX] = {0};
    return finite(fmi3GetContinuousStateDerivatives(s->c, MAYBE(x), COUNT(MODEL_NX)), x, MODEL_NX);
}

/* What the FMU does not have is refused with whatever arguments. */
static int absent(Slot *s)
{
    float f[MANY] = {0};
    size_t n = 0;
    switch (pick(12)) {
    case 0: return fmi3GetFloat32(s->c, a.vr, a.n, f, a.n);
    case 1: return fmi3SetFloat32(s->c, a.vr, a.n, f, a.n);
    case 2: return fmi3GetString(s->c, NULL, a.n, NULL, a.n);
    case 3: return fmi3SetBinary(s->c, NULL, a.n, NULL, NULL, a.n);
    case 4: return fmi3GetClock(s->c, a.vr, a.n, NULL);
    case 5: return fmi3EnterStepMode(s->c);
    case 6: return fmi3EnterConfigurationMode(s->c);
    case 7: return fmi3ActivateModelPartition(s->c, 0, 0);
    case 8: return fmi3GetIntervalDecimal(s->c, a.vr, a.n, NULL, NULL);
    case 9: return fmi3GetNumberOfVariableDependencies(s->c, 0, &n);
    case 10: return fmi3GetNumberOfContinuousStates(s->c, MAYBE(&n));
    default: return fmi3EvaluateDiscreteStates(s->c);
    }
}

typedef struct {
    const char *name;
    int (*call)(Slot *);
    unsigned weight;
} Action;

#define ACTION(call, weight) {#call, call, weight}

static const Action actions[] = {
    ACTION(renew, 2), ACTION(nothing, 1), ACTION(set_logging, 3), ACTION(enter_initialization, 60),
    ACTION(leave_initialization, 30), ACTION(terminate, 1), ACTION(reset, 3), ACTION(get_reals, 30), ACTION(set_reals, 60),
    ACTION(set_many_reals, 20), ACTION(get_integers, 5), ACTION(set_integers, 5), ACTION(booleans, 10),
    ACTION(keep_state, 20), ACTION(return_to_state, 10), ACTION(forget_state, 5), ACTION(store_state, 10),
    ACTION(load_state, 20), ACTION(directional, 20), ACTION(adjoint, 10), ACTION(output_derivatives, 20),
    ACTION(step, 80), ACTION(enter_event, 20), ACTION(update_discrete, 10), ACTION(enter_continuous, 30),
    ACTION(completed, 10), ACTION(set_time, 20), ACTION(set_states, 20), ACTION(get_rates, 20), ACTION(get_indicators, 5),
    ACTION(get_states, 10), ACTION(get_nominals, 10), ACTION(absent, 10), {NULL, NULL, 0},
};

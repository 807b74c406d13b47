/* The calls of FMI 2.0. */
#include "fmi2Functions.h"

#define F(name) fmi2##name

static int get_real(void *c, unsigned vr, double *x) { return finite(fmi2GetReal(c, &vr, 1, x), x, 1); }
static int take_state(void *c, void **state) { return fmi2GetFMUstate(c, state); }
static int put_state(void *c, void *state) { return fmi2SetFMUstate(c, state); }
static int drop_state(void *c, void **state) { return fmi2FreeFMUstate(c, state); }
static int state_bytes(void *c, void *state, size_t *size) { return fmi2SerializedFMUstateSize(c, state, size); }
static int write_state(void *c, void *state, unsigned char *into, size_t size)
{
    return fmi2SerializeFMUstate(c, state, (char *)into, size);
}
static int read_state(void *c, const unsigned char *from, size_t size, void **state)
{
    return fmi2DeSerializeFMUstate(c, (const char *)from, size, state);
}

static void hear(void *environment, fmi2String name, fmi2Status status, fmi2String category, fmi2String format, ...)
{
    char text[4096];
    va_list arguments;
    va_start(arguments, format);
    if (vsnprintf(text, sizeof text, format, arguments) <= 0 || !name || !category || status > fmi2Fatal || environment)
        stop_here("a message without text", "logger");
    va_end(arguments);
    messages++;
}

static void *instantiate(Slot *s, const char *name, const char *guid)
{
    const fmi2CallbackFunctions callbacks = {hear, calloc, free, NULL, NULL};
    const fmi2Type type = s->cosimulation ? fmi2CoSimulation : fmi2ModelExchange;
    return fmi2Instantiate(name, type, guid, NULL, &callbacks, 0, (int)pick(2));
}

#include "common_calls.h"

static int set_up(Slot *s)
{
    return fmi2SetupExperiment(s->c, pick(2), wild(1e-6), wild(0), pick(2), wild(between(0, 100)));
}
static int enter_initialization(Slot *s) { return fmi2EnterInitializationMode(s->c); }
static int get_reals(Slot *s) { return finite(fmi2GetReal(s->c, MAYBE(a.vr), a.n, MAYBE(a.y)), NULL, 0); }
static int set_reals(Slot *s) { return fmi2SetReal(s->c, MAYBE(a.vr), pick(2), MAYBE(a.x)); }
static int set_many_reals(Slot *s) { return fmi2SetReal(s->c, MAYBE(a.vr), a.n, MAYBE(a.x)); }
static int get_integers(Slot *s) { return fmi2GetInteger(s->c, MAYBE(a.vr), a.n, MAYBE(a.i)); }
static int set_integers(Slot *s) { return fmi2SetInteger(s->c, MAYBE(a.vr), a.n, MAYBE(a.i)); }
static int get_booleans(Slot *s) { return fmi2GetBoolean(s->c, MAYBE(a.vr), a.n, MAYBE(a.i)); }
static int set_booleans(Slot *s) { return fmi2SetBoolean(s->c, MAYBE(a.vr), pick(2), MAYBE(a.i)); }
static int get_strings(Slot *s) { return fmi2GetString(s->c, a.vr, a.n, NULL); }
static int set_strings(Slot *s) { return fmi2SetString(s->c, a.vr, a.n, NULL); }

static int directional(Slot *s)
{
    double out[MANY] = {0};
    const int status =
        fmi2GetDirectionalDerivative(s->c, MAYBE(a.vr), a.n, MAYBE(a.other), a.m, MAYBE(a.y), MAYBE(out));
    return finite(status, out, a.n);
}

static int input_derivatives(Slot *s)
{
    for (unsigned k = 0; k < a.n; k++)
        if (!once_in(10)) a.vr[k] = 1 + pick(MODEL_NU), a.y[k] *= 1e4;
    return fmi2SetRealInputDerivatives(s->c, MAYBE(a.vr), a.n, MAYBE(a.order), MAYBE(a.y));
}

static int output_derivatives(Slot *s)
{
    double out[MANY] = {0};
    for (unsigned k = 0; k < a.n; k++) a.order[k] = once_in(20) ? a.order[k] : 1;
    return finite(fmi2GetRealOutputDerivatives(s->c, MAYBE(a.vr), a.n, MAYBE(a.order), MAYBE(out)), out, a.n);
}

static int step(Slot *s)
{
    return fmi2DoStep(s->c, once_in(30) ? wild(0) : present(s->c), wild(between(0, 0.05)), (int)pick(2));
}

static int statuses(Slot *s)
{
    const fmi2StatusKind kind = (fmi2StatusKind)pick(6);
    double real = 0;
    int integer = 0;
    fmi2String text = NULL;
    fmi2Status status;
    switch (pick(6)) {
    case 0: return fmi2GetStatus(s->c, kind, MAYBE(&status));
    case 1: return fmi2GetRealStatus(s->c, kind, MAYBE(&real));
    case 2: return fmi2GetIntegerStatus(s->c, kind, MAYBE(&integer));
    case 3: return fmi2GetBooleanStatus(s->c, kind, MAYBE(&integer));
    case 4: return fmi2GetStringStatus(s->c, kind, MAYBE(&text));
    default: return fmi2CancelStep(s->c);
    }
}

static int new_discrete(Slot *s)
{
    fmi2EventInfo info;
    return fmi2NewDiscreteStates(s->c, MAYBE(&info));
}

static int completed(Slot *s)
{
    int event, end;
    return fmi2CompletedIntegratorStep(s->c, (int)pick(2), MAYBE(&event), MAYBE(&end));
}

static int get_rates(Slot *s)
{
    double x[MANY + MODEL_NX] = {0};
    return finite(fmi2GetDerivatives(s->c, MAYBE(x), COUNT(MODEL_NX)), x, MODEL_NX);
}

typedef struct {
    const char *name;
    int (*call)(Slot *);
    unsigned weight;
} Action;

#define ACTION(call, weight) {#call, call, weight}

static const Action actions[] = {
    ACTION(renew, 2), ACTION(nothing, 1), ACTION(set_logging, 3), ACTION(set_up, 30), ACTION(enter_initialization, 30),
    ACTION(leave_initialization, 30), ACTION(terminate, 1), ACTION(reset, 3), ACTION(get_reals, 30), ACTION(set_reals, 60),
    ACTION(set_many_reals, 20), ACTION(get_integers, 5), ACTION(set_integers, 5), ACTION(get_booleans, 5),
    ACTION(set_booleans, 5), ACTION(get_strings, 2), ACTION(set_strings, 2), ACTION(keep_state, 20),
    ACTION(return_to_state, 10), ACTION(forget_state, 5), ACTION(store_state, 10), ACTION(load_state, 20),
    ACTION(directional, 20), ACTION(input_derivatives, 20), ACTION(output_derivatives, 20), ACTION(step, 80),
    ACTION(statuses, 10), ACTION(enter_event, 20), ACTION(new_discrete, 10), ACTION(enter_continuous, 30),
    ACTION(completed, 10), ACTION(set_time, 20), ACTION(set_states, 20), ACTION(get_rates, 20), ACTION(get_indicators, 5),
    ACTION(get_states, 10), ACTION(get_nominals, 10), {NULL, NULL, 0},
};

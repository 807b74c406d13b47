/* Calls that differ between the versions by a name at most: F(name) is the function, R and I its value types. */

static double present(void *c)
{
    double time = 0;
    return get_real(c, 0, &time) == OK ? time : 0;
}

static void release(Slot *s)
{
    drop_state(s->c, &s->scratch);
    F(FreeInstance)(s->c);
    s->c = NULL;
}

/* A new instance in place of the old; instantiation with a bad name or GUID must yield none. */
static int renew(Slot *s)
{
    static const char *const names[] = {"tube", "", NULL, " ", "%s%n"};
    static const char *const guids[] = {MODEL_GUID, "{}", NULL, ""};
    const unsigned name = once_in(4) ? pick(5) : 0, guid = once_in(4) ? pick(4) : 0;
    if (s->inside) {
        F(FreeInstance)(s->c); /* must be refused */
        return OK;
    }
    release(s);
    s->cosimulation = PICK_INTERFACE();
    s->c = instantiate(s, names[name], guids[guid]);
    if (!s->c != ((name > 0 && name < 4) || guid > 0)) stop_here("instantiated wrongly", "instantiate");
    if (!s->c) s->c = instantiate(s, names[0], guids[0]);
    return OK;
}

static int nothing(Slot *s)
{
    (void)s;
    F(FreeInstance)(NULL);
    if ((int)F(Terminate)(NULL) != ERROR) stop_here("no instance, no error", "terminate");
    return OK;
}

static int set_logging(Slot *s)
{
    static const char *const names[] = {"logEvents", "logSolver", "logAll", "logStatusError", "%n", "", NULL};
    const char *chosen[2] = {names[pick(7)], names[pick(3)]};
    return F(SetDebugLogging)(s->c, pick(2), pick(3), MAYBE(chosen));
}

static int terminate(Slot *s) { return F(Terminate)(s->c); }
static int reset(Slot *s) { return F(Reset)(s->c); }
static int leave_initialization(Slot *s) { return F(ExitInitializationMode)(s->c); }
static int enter_continuous(Slot *s) { return F(EnterContinuousTimeMode)(s->c); }
static int enter_event(Slot *s) { return F(EnterEventMode)(s->c); }
static int set_time(Slot *s) { return F(SetTime)(s->c, wild(present(s->c) + between(0, 0.1))); }

static int set_states(Slot *s)
{
    double x[MODEL_NX + 1];
    for (int i = 0; i <= MODEL_NX; i++) x[i] = wild(i < MODEL_NX ? model_nominal[i] * between(-0.2, 2) : 0);
    return F(SetContinuousStates)(s->c, MAYBE(x), COUNT(MODEL_NX));
}

static int get_states(Slot *s)
{
    double x[MANY + MODEL_NX] = {0};
    return finite(F(GetContinuousStates)(s->c, MAYBE(x), COUNT(MODEL_NX)), x, MODEL_NX);
}

static int get_nominals(Slot *s)
{
    double x[MANY + MODEL_NX] = {0};
    return finite(F(GetNominalsOfContinuousStates)(s->c, MAYBE(x), COUNT(MODEL_NX)), x, MODEL_NX);
}

static int get_indicators(Slot *s) { return F(GetEventIndicators)(s->c, MAYBE(a.x), COUNT(0)); }

/* Saved states --------------------------------------------------------------------------------------------------- */

static int keep_state(Slot *s) { return take_state(s->c, MAYBE(&states[pick(STATES)])); }
static int return_to_state(Slot *s) { return put_state(s->c, states[pick(STATES)]); }
static int forget_state(Slot *s) { return drop_state(s->c, MAYBE(&states[pick(STATES)])); }

static int store_state(Slot *s)
{
    void *state = states[pick(STATES)];
    size_t size = 0;
    int status = state_bytes(s->c, state, MAYBE(&size));
    if (status != OK || size == 0 || size > STATE_SIZE) return status;
    const size_t room = once_in(4) ? pick((unsigned)size) : size;
    status = write_state(s->c, state, MAYBE(bytes), room);
    if (status == OK) n_bytes = room;
    return status;
}

/* As stored, or truncated, or with bits flipped: then it must be refused. */
static int load_state(Slot *s)
{
    unsigned char changed[STATE_SIZE];
    size_t size = once_in(4) ? pick(STATE_SIZE) : n_bytes;
    memcpy(changed, bytes, sizeof changed);
    if (size && once_in(2)) changed[pick((unsigned)size)] ^= (unsigned char)(1u << pick(8));
    const int spoilt = size != n_bytes || memcmp(changed, bytes, size);
    const int status = read_state(s->c, MAYBE(changed), size, MAYBE(&states[pick(STATES)]));
    if (spoilt && status == OK) stop_here("spoilt bytes were taken", "deserialize");
    return status;
}

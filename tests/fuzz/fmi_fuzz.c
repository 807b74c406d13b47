/* Calls every function of the FMU in legal and illegal orders with wild arguments, and looks after each call.
 *
 *     fmi_fuzz COUNT SEED        VERSION (2 or 3) and MAX_STEPS are set when it is compiled: see test_fuzz.py
 *
 * Compiled with the sanitizers, together with the FMU's own sources. Beside what they find, it stops where
 *   - a refused call changed the instance (its serialised state),
 *   - a refused call said nothing,
 *   - a successful call handed out a number that is not finite,
 *   - what an instance shows depends on what it was asked before (checked by restoring its own state).
 * Sizes are respected where a callee cannot know them; that is all the restraint there is.
 */
#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "instance.h"

enum { OK, WARNING, DISCARD, ERROR };
enum { SLOTS = 4, STATES = 6, MANY = 6, STATE_SIZE = sizeof(Snapshot) + 1024 };

#if MODEL_ND || MODEL_DELAYS /* what is sampled or delayed has no model exchange */
#define PICK_INTERFACE() 1
#else
#define PICK_INTERFACE() ((int)pick(2))
#endif

/* Chance ----------------------------------------------------------------------------------------------------- */

static uint64_t chance;

static unsigned pick(unsigned n) /* 0 ... n - 1, by xorshift */
{
    chance ^= chance << 13, chance ^= chance >> 7, chance ^= chance << 17;
    return (unsigned)((chance >> 20) % n);
}

static int once_in(unsigned n) { return pick(n) == 0; }

static double between(double a, double b) { return a + (b - a) * pick(1 << 20) / (1 << 20); }

static double wild(double tame)
{
    static const double values[] = {0, -0.0, 1, -1, NAN, INFINITY, -INFINITY, 1e-320, 1e300, -1e300, DBL_MAX, 1e8};
    return once_in(15) ? values[pick(sizeof values / sizeof *values)] : tame;
}

static unsigned reference(void)
{
    static const unsigned values[] = {MODEL_VARIABLES, UINT32_MAX, 1u << 31};
    return once_in(30) ? values[pick(3)] : pick(MODEL_VARIABLES);
}

static double value_for(unsigned vr)
{
    if (vr >= MODEL_VARIABLES) return wild(1);
    const Variable *v = &model_variables[vr];
    if (v->kind == INPUT) return wild(v->unit[0] == 'V' ? between(-8e3, 8e3) : between(-5e3, 25e3));
    return wild(v->type == TYPE_BOOLEAN ? pick(2) : v->start * between(0.7, 1.4));
}

/* Arguments for one call. */
static struct {
    unsigned vr[MANY], other[MANY];
    double x[MANY], y[MANY];
    int32_t order[MANY], i[MANY];
    unsigned n, m;
} a;

/* Every array may be NULL now and then. */
#define MAYBE(array) (once_in(40) ? NULL : (array))
/* A count that the callee can check against the other. */
#define COUNT(n) (once_in(40) ? pick(MANY) : (n))

static void draw(void)
{
    a.n = pick(MANY), a.m = pick(MANY);
    for (int k = 0; k < MANY; k++) {
        a.vr[k] = reference(), a.other[k] = reference();
        a.x[k] = value_for(a.vr[k]), a.y[k] = wild(between(-1, 1));
        a.order[k] = (int32_t)pick(5), a.i[k] = (int32_t)pick(20) - 2;
    }
}

/* What the calls work on ----------------------------------------------------------------------------------------- */

typedef struct {
    void *c; /* the FMU's instance */
    int cosimulation, inside; /* inside its own intermediate update */
    void *scratch; /* a state for looking at it */
} Slot;

static Slot slots[SLOTS];
static void *states[STATES]; /* taken from any of them */
static unsigned char bytes[STATE_SIZE];
static size_t n_bytes;
static long calls, refused, messages, steps, looks;

static void stop_here(const char *what, const char *function)
{
    fprintf(stderr, "after %ld calls, %s: %s\n", calls, function, what);
    abort();
}

static int finite(int status, const double *x, size_t n)
{
    for (size_t i = 0; status <= WARNING && x && i < n; i++)
        if (!isfinite(x[i])) stop_here("a number that is not finite", "get");
    return status;
}

#if VERSION == 2
#include "fmi2_calls.h"
#else
#include "fmi3_calls.h"
#endif

/* Looking ------------------------------------------------------------------------------------------------------- */

/* The serialised state; 0 where the mode does not give it. */
static size_t look(Slot *s, unsigned char *into)
{
    size_t size = 0;
    if (!s->c || s->inside || take_state(s->c, &s->scratch) != OK) return 0;
    if (state_bytes(s->c, s->scratch, &size) != OK || size > STATE_SIZE) stop_here("no size", "state");
    if (write_state(s->c, s->scratch, into, size) != OK) stop_here("not written", "state");
    return size;
}

/* All values, as far as they can be had: nothing may depend on what was asked for before. */
static void check_memory(Slot *s)
{
    double before[MODEL_VARIABLES], after[MODEL_VARIABLES];
    int had[MODEL_VARIABLES];
    unsigned char state[STATE_SIZE];
    if (!look(s, state)) return;
    looks++;
    for (unsigned vr = 0; vr < MODEL_VARIABLES; vr++) had[vr] = get_real(s->c, vr, &before[vr]);
    if (put_state(s->c, s->scratch) != OK) stop_here("its own state was refused", "state");
    for (unsigned k = 0; k < MODEL_VARIABLES; k++) {
        const unsigned vr = MODEL_VARIABLES - 1 - k;
        if (had[vr] != get_real(s->c, vr, &after[vr])) stop_here("once given, once not", model_variables[vr].name);
        if (had[vr] == OK && memcmp(&before[vr], &after[vr], sizeof(double)))
            stop_here("depends on what was asked before", model_variables[vr].name);
    }
}

static void call_one(Slot *s)
{
    static unsigned total;
    unsigned char before[STATE_SIZE], after[STATE_SIZE];
    const size_t size = look(s, before);
    const long told = messages;
    const Action *action = actions;
    if (!total)
        for (const Action *each = actions; each->call; each++) total += each->weight;
    for (unsigned at = pick(total); at >= action->weight; action++) at -= action->weight;
    draw();
    calls++;
    const int status = action->call(s);
    steps += status == OK && action->call == step;
    if (status != ERROR || !s->c) return;
    refused++;
    if (messages == told) stop_here("refused without a word", action->name);
    if (size && (look(s, after) != size || memcmp(before, after, size))) stop_here("refused, but it changed", action->name);
}

int main(int argc, char **argv)
{
    const long count = argc > 1 ? atol(argv[1]) : 100000;
    const unsigned long seed = argc > 2 ? strtoul(argv[2], NULL, 10) : 1;
    chance = 0x9E3779B97F4A7C15u ^ (seed * 0xD1342543DE82EF95u + 1);
    for (int i = 0; i < SLOTS; i++) renew(&slots[i]);
    while (calls < count) {
        Slot *s = &slots[pick(SLOTS)];
        call_one(s);
        if (once_in(50)) check_memory(s);
    }
    for (int i = 0; i < STATES; i++) drop_state(slots[0].c, &states[i]);
    for (int i = 0; i < SLOTS; i++) release(&slots[i]);
    printf("FMI %d, seed %lu: %ld calls, %ld refused, %ld steps done, %ld looked through\n", VERSION, seed, calls, refused, steps,
           looks);
    return 0;
}

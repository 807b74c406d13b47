/* Random tubes, far beyond the physical ones, stepped through the FMI 2.0 functions and held against themselves.
 *
 *     physics_fuzz COUNT SEED SHOW [messages]     MAX_STEPS is set when it is compiled: see test_physics_fuzz.py
 *
 * Every case draws parameters, a tolerance, inputs (held or ramped) and communication steps, and is run four times:
 * as it is, a thousand times more tightly, and twice tightly with all states kicked by the tolerance at every
 * communication point (where that leaves ten tolerances, by a hundredth of it at every internal step, too): this tells
 * how much the equations themselves make of an error (past the fold, everything). A case either agrees with the tight
 * run or ends in an error with a message. It stops where
 *   - a number is handed out that is not finite,
 *   - a call is refused without a message,
 *   - lambda_2 falls to 0, where the equations end, without an error,
 *   - the run is further from the tight one than `tolerated` times its tolerance and what the equations make of it.
 * The first SHOW cases of the physical envelope are printed for other solvers.
 */
#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmi2Functions.h"
#include "instance.h"

enum { MOST_STEPS = 8, NX = MODEL_NX };
enum { PHYSICAL, WIDE, BOUNDS, KINDS, OFTEN = 4 };
static const char *const kinds[] = {"physical", "wide", "bounds"};
/* A tolerance is that of each internal step; errors add up, and inside a step absurd tubes amplify them unseen. */
static const double tolerated[] = {30, 300, 300}, suspicious = 10;

/* Chance ----------------------------------------------------------------------------------------------------- */

static uint64_t chance;

static double uniform(double a, double b) /* xorshift */
{
    chance ^= chance << 13, chance ^= chance >> 7, chance ^= chance << 17;
    return a + (b - a) * (double)(chance >> 11) / 9007199254740992.0;
}

static int once_in(int n) { return uniform(0, n) < 1; }
static double decades(double low, double high) { return pow(10, uniform(low, high)); }

/* Cases ------------------------------------------------------------------------------------------------------ */

typedef struct {
    int kind, n;
    double p[MODEL_VARIABLES], tolerance;
    double h[MOST_STEPS], u[MOST_STEPS][MODEL_NU], du[MOST_STEPS][MODEL_NU];
    int ramped[MOST_STEPS];
} Case;

typedef struct {
    int failed;
    double x[NX], largest[NX];
} Run;

static long looks_refused, slow_case, step_count;
static double slowest, worst[KINDS];
static char message[1024], reason[1024]; /* the last of all, and why the last run ended in an error */

static double inside(const Variable *v, double value) { return fmax(v->minimum, fmin(v->maximum, value)); }

static double parameter(const Variable *v, int kind)
{
    if (v->type == TYPE_BOOLEAN) return once_in(4);
    const double start = v->start;
    double value = start * uniform(0.8, 1.25);
    if (kind == WIDE) value = start * decades(-2, 2);
    if (kind == BOUNDS && once_in(3)) value = once_in(2) ? v->minimum : v->maximum;
    if (kind == BOUNDS && !isfinite(value)) value = (once_in(2) ? 1 : -1) * decades(-3, 15);
    value = inside(v, value);
    return v->type == TYPE_INTEGER ? floor(value) : value;
}

static void draw(Case *c, int kind)
{
    static const double low[] = {-2e3, -7e3}, high[] = {18e3, 7e3};
    memset(c, 0, sizeof *c);
    c->kind = kind;
    c->tolerance = decades(-8, -3);
    for (unsigned i = 0; i < MODEL_VARIABLES; i++)
        if (model_variables[i].kind == PARAMETER) c->p[i] = parameter(&model_variables[i], kind);
    c->n = 1 + (int)uniform(0, MOST_STEPS);
    const double scale = kind == PHYSICAL ? 1 : decades(-2, kind == WIDE ? 2 : 6);
    const double step = kind == PHYSICAL ? decades(-4, -0.5) : decades(-8, kind == WIDE ? 1 : 6);
    for (int k = 0; k < c->n; k++) {
        c->h[k] = step * uniform(0.1, 1);
        c->ramped[k] = once_in(2);
        for (int i = 0; i < MODEL_NU; i++) {
            c->u[k][i] = k && once_in(3) ? c->u[k - 1][i] : scale * uniform(low[i], high[i]);
            c->du[k][i] = c->ramped[k] ? (scale * uniform(low[i], high[i]) - c->u[k][i]) / c->h[k] : 0;
        }
    }
}

/* Runs ------------------------------------------------------------------------------------------------------- */

static void hear(void *environment, fmi2String name, fmi2Status status, fmi2String category, fmi2String format, ...)
{
    va_list arguments;
    (void)environment, (void)name, (void)status, (void)category;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
}

static void stop_here(const char *what, long place, const Case *c)
{
    fprintf(stderr, "case %ld (%s, tolerance %g): %s; last message: %s\n", place, kinds[c->kind], c->tolerance, what,
            message);
    for (unsigned i = 0; i < MODEL_VARIABLES; i++)
        if (model_variables[i].kind == PARAMETER) fprintf(stderr, "  %s = %.17g\n", model_variables[i].name, c->p[i]);
    for (int k = 0; k < c->n; k++)
        fprintf(stderr, "  step %g: pressure %.17g + %.17g t, voltage %.17g + %.17g t\n", c->h[k], c->u[k][0], c->du[k][0],
                c->u[k][1], c->du[k][1]);
    exit(1);
}

static int refused(fmi2Status status, long place, const Case *c)
{
    if (status <= fmi2Warning) return 0;
    if (!*message) stop_here("refused without a word", place, c);
    return 1;
}

static int start(fmi2Component tube, const Case *c, double tolerance, long place)
{
    if (refused(fmi2SetupExperiment(tube, 1, tolerance, 0, 0, 0), place, c)) return 1;
    for (unsigned i = 0; i < MODEL_VARIABLES; i++) {
        const Variable *v = &model_variables[i];
        const fmi2Integer integer = (fmi2Integer)c->p[i];
        const double value = c->p[i];
        if (v->kind != PARAMETER) continue;
        if (refused(v->type == TYPE_REAL ? fmi2SetReal(tube, (const unsigned[]){i + 1}, 1, &value) :
                    v->type == TYPE_INTEGER ? fmi2SetInteger(tube, (const unsigned[]){i + 1}, 1, &integer) : fmi2SetBoolean(tube, (const unsigned[]){i + 1}, 1, &integer),
                    place, c)) return 1;
    }
    for (unsigned i = 0; i < MODEL_VARIABLES; i++)
        if (model_variables[i].kind == INPUT && refused(fmi2SetReal(tube, (const unsigned[]){i + 1}, 1, &c->u[0][model_variables[i].index]), place, c))
            return 1;
    return refused(fmi2EnterInitializationMode(tube), place, c) || refused(fmi2ExitInitializationMode(tube), place, c);
}

/* Every variable, one by one: finite, or refused with a message. */
static int look(fmi2Component tube, long place, const Case *c)
{
    int some = 0;
    for (unsigned i = 0; i < MODEL_VARIABLES; i++) {
        double value = 0;
        if (model_variables[i].type != TYPE_REAL) continue;
        *message = '\0';
        const int no = refused(fmi2GetReal(tube, (const unsigned[]){i + 1}, 1, &value), place, c);
        if (!no && !isfinite(value)) stop_here(model_variables[i].name, place, c);
        some |= no;
    }
    return some;
}

static double lowest /* lambda_2 after any internal step */, kick_size;
static int kicked; /* 0: not; 1 or 2: all states, with different signs; | OFTEN: at internal steps, too */

/* All states off by a share of the tolerance, up or down in turns. */
static void kick(Instance *tube, double share)
{
    for (int i = 0; i < NX; i++)
        tube->now.x[i] += (i & kicked & 3 ? share : -share) * kick_size * (model_nominal[i] + fabs(tube->now.x[i]));
    instance_forget(tube);
}

static double watch(Instance *tube, double end) /* called after every internal step */
{
    lowest = fmin(lowest, tube->now.x[0]);
    if (kicked & OFTEN) kick(tube, 0.01);
    return end;
}

/* As fmi2DoStep, with an eye on the internal steps. */
static int step(fmi2Component tube, const Case *c, int k, double *time, long place)
{
    for (unsigned i = 0; i < MODEL_VARIABLES; i++) {
        const Variable *v = &model_variables[i];
        const fmi2Integer one = 1;
        if (v->kind != INPUT) continue;
        if (refused(fmi2SetReal(tube, (const unsigned[]){i + 1}, 1, &c->u[k][v->index]), place, c)) return 1;
        if (c->ramped[k] && refused(fmi2SetRealInputDerivatives(tube, (const unsigned[]){i + 1}, 1, &one, &c->du[k][v->index]), place, c)) return 1;
    }
    const clock_t begin = clock();
    *message = '\0';
    const int no = refused((fmi2Status)instance_do_step(tube, *time, c->h[k], watch), place, c);
    const double spent = (double)(clock() - begin) / CLOCKS_PER_SEC;
    if (spent > slowest) slowest = spent, slow_case = place;
    step_count++;
    *time += c->h[k];
    return no;
}

static Run run(const Case *c, double tolerance, int kicks, long place)
{
    const fmi2CallbackFunctions callbacks = {hear, calloc, free, NULL, NULL};
    fmi2Component tube = fmi2Instantiate("tube", fmi2CoSimulation, MODEL_GUID, NULL, &callbacks, 0, 0);
    Run made = {0, {0}, {0}};
    double time = 0;
    *message = '\0';
    lowest = INFINITY, kicked = kicks, kick_size = c->tolerance;
    made.failed = start(tube, c, tolerance, place);
    memcpy(reason, message, sizeof reason);
    for (int k = 0; k < c->n && !made.failed; k++) {
        if (kicked) kick(tube, 1);
        made.failed = step(tube, c, k, &time, place);
        memcpy(reason, message, sizeof reason);
        if (!kicks) looks_refused += look(tube, place, c);
        for (int i = 0; i < NX; i++) {
            made.x[i] = ((Instance *)tube)->now.x[i];
            made.largest[i] = fmax(made.largest[i], fabs(made.x[i]));
            if (!isfinite(made.x[i])) stop_here("a state that is not finite", place, c);
        }
    }
    if (!kicks && lowest <= 0) stop_here("lambda_2 fell to 0", place, c);
    fmi2FreeInstance(tube);
    return made;
}

/* How many times its allowance the run is off the tight one. */
static double distance(const Case *c, const Run *as_is, const Run *tight, const Run *one, const Run *other)
{
    double most = 0;
    for (int i = 0; i < NX; i++) {
        const double own = c->tolerance * (model_nominal[i] + fmax(as_is->largest[i], tight->largest[i]));
        const double made = fmax(fabs(one->x[i] - tight->x[i]), fabs(other->x[i] - tight->x[i]));
        most = fmax(most, fabs(as_is->x[i] - tight->x[i]) / (own + made));
    }
    return most;
}

static void show(const Case *c, const Run *tight)
{
    printf("case");
    for (unsigned i = 0; i < MODEL_VARIABLES; i++)
        if (model_variables[i].kind == PARAMETER) printf(" %s=%.17g", model_variables[i].name, c->p[i]);
    for (int k = 0; k < c->n; k++)
        printf(" step=%.17g,%.17g,%.17g,%.17g,%.17g", c->h[k], c->u[k][0], c->du[k][0], c->u[k][1], c->du[k][1]);
    for (int i = 0; i < NX; i++) printf(" x=%.17g", tight->x[i]);
    printf(" tolerance=%.17g\n", c->tolerance);
}

int main(int argc, char **argv)
{
    const long count = argc > 1 ? atol(argv[1]) : 1000;
    const unsigned long seed = argc > 2 ? strtoul(argv[2], NULL, 10) : 1;
    long shown = argc > 3 ? atol(argv[3]) : 0, agreed[KINDS] = {0}, failed[KINDS] = {0}, unsure[KINDS] = {0};
    for (long place = 0; place < count; place++) {
        Case c;
        chance = (0x9E3779B97F4A7C15u * (seed + 1)) ^ ((uint64_t)(place + 1) * 0xD1342543DE82EF95u);
        for (int k = 0; k < 5; k++) uniform(0, 1);
        draw(&c, (int)(place % KINDS));
        const Run as_is = run(&c, c.tolerance, 0, place);
        if (as_is.failed) {
            failed[c.kind]++;
            if (argc > 4) fprintf(stderr, "%ld: %s\n", place, reason);
            continue;
        }
        const double tightly = fmax(1e-12, 1e-3 * c.tolerance);
        const Run tight = run(&c, tightly, 0, place);
        Run one = run(&c, tightly, 1, place), other = run(&c, tightly, 2, place);
        if (tight.failed || one.failed || other.failed) {
            unsure[c.kind]++; /* the tolerance was met, the tight one could not be */
            continue;
        }
        double far = distance(&c, &as_is, &tight, &one, &other);
        if (far > suspicious) {
            one = run(&c, tightly, 1 | OFTEN, place), other = run(&c, tightly, 2 | OFTEN, place);
            if (one.failed || other.failed) {
                unsure[c.kind]++;
                continue;
            }
            far = distance(&c, &as_is, &tight, &one, &other);
        }
        worst[c.kind] = fmax(worst[c.kind], far);
        if (!(far <= tolerated[c.kind])) {
            snprintf(message, sizeof message, "%g times the allowance", far);
            stop_here("off the tight run", place, &c);
        }
        agreed[c.kind]++;
        if (c.kind == PHYSICAL && shown > 0) show(&c, &tight), shown--;
    }
    for (int kind = 0; kind < KINDS; kind++)
        printf("%s: %ld agree (worst %.3g of %g tolerances), %ld ended in an error, %ld have no tight run\n",
               kinds[kind], agreed[kind], worst[kind], tolerated[kind], failed[kind],
               unsure[kind]);
    printf("%ld cases, %ld steps, slowest step %.3g s (case %ld), %ld looks refused, seed %lu\n", count, step_count, slowest,
           slow_case, looks_refused, seed);
    return 0;
}

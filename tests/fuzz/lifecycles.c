/* Many whole lifecycles of an instance: created, run, its state saved, stored and restored, freed. LeakSanitizer counts.
 *
 *     lifecycles COUNT        VERSION (2 or 3) is set when it is compiled: see test_leaks.py
 */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#include "model.h"

enum { STEPS = 5, MOST = 1 << 20 };

static void must(int status, const char *what)
{
    if (status == 0) return;
    fprintf(stderr, "%s: status %d\n", what, status);
    exit(1);
}

static unsigned char bytes[MOST];

#if VERSION == 2
#include "fmi2Functions.h"
#define F(name) fmi2##name
#define STATE(name) fmi2##name##FMUstate
#define SIZE fmi2SerializedFMUstateSize
#define BYTES(b) (char *)(b)

static void hear(void *e, fmi2String n, fmi2Status s, fmi2String c, fmi2String m, ...)
{
    (void)e, (void)n, (void)s, (void)c, (void)m;
}

static void *born(void)
{
    static const fmi2CallbackFunctions callbacks = {hear, calloc, free, NULL, NULL};
    void *c = fmi2Instantiate("tube", fmi2CoSimulation, MODEL_GUID, NULL, &callbacks, 0, 1);
    must(!c, "instantiate");
    must(fmi2SetupExperiment(c, 0, 0, 0, 0, 0), "setup");
    must(fmi2EnterInitializationMode(c), "initialization");
    return c;
}

static void walk(void *c, int k) { must(fmi2DoStep(c, 1e-3 * k, 1e-3, 1), "step"); }
#else
#include "fmi3Functions.h"
#define F(name) fmi3##name
#define STATE(name) fmi3##name##FMUState
#define SIZE fmi3SerializedFMUStateSize
#define BYTES(b) (b)

static void hear(void *e, fmi3Status s, fmi3String c, fmi3String m) { (void)e, (void)s, (void)c, (void)m; }

static void *born(void)
{
    void *c = fmi3InstantiateCoSimulation("tube", MODEL_GUID, NULL, false, true, false, false, NULL, 0, NULL, hear, NULL);
    must(!c, "instantiate");
    must(fmi3EnterInitializationMode(c, false, 0, 0, false, 0), "initialization");
    return c;
}

static void walk(void *c, int k)
{
    bool event, end, early;
    double time;
    must(fmi3DoStep(c, 1e-3 * k, 1e-3, true, &event, &end, &early, &time), "step");
}
#endif

static void lifecycle(void)
{
    void *c = born(), *state = NULL, *read = NULL;
    size_t size = 0;
    must(F(ExitInitializationMode)(c), "initialization");
    for (int k = 0; k < STEPS; k++) walk(c, k);
    must(STATE(Get)(c, &state), "state");
    must(SIZE(c, state, &size), "size");
    must(size > MOST, "size");
    must(STATE(Serialize)(c, state, BYTES(bytes), size), "store");
    walk(c, STEPS);
#if VERSION == 2
    must(fmi2DeSerializeFMUstate(c, (char *)bytes, size, &read), "read");
#else
    must(fmi3DeserializeFMUState(c, bytes, size, &read), "read");
#endif
    must(STATE(Set)(c, read), "restore");
    walk(c, STEPS);
    must(STATE(Free)(c, &state), "free state");
    must(STATE(Free)(c, &read), "free state");
    must(F(Reset)(c), "reset");
    F(FreeInstance)(c);
}

int main(int argc, char **argv)
{
    const long count = argc > 1 ? atol(argv[1]) : 100;
    for (long k = 0; k < count; k++) lifecycle();
    if (argc > 2) { /* the test of the test: one that is never freed */
        born();
    }
    printf("FMI %d: %ld lifecycles\n", VERSION, count);
    return 0;
}

/* The assisted heart in one call: the FMUs' own functions and the master, wired as `wiring.h` says (printed by Python).
 *
 * What cosim/slaves.py and cosim/master.py do around the master in Python is done here in C: start values, the sweep
 * over connected initial values, and the run.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "fmi2FunctionTypes.h"
#include "master.h"

#define MESSAGE 2048
#define SWEEPS 50 /* as cosim/slaves.py */

typedef struct {
    const char *name, *guid;
    fmi2InstantiateTYPE *instantiate;
    fmi2SetupExperimentTYPE *setup;
    fmi2EnterInitializationModeTYPE *enter;
    fmi2ExitInitializationModeTYPE *leave;
    fmi2SetIntegerTYPE *set_integer;
    fmi2SetBooleanTYPE *set_boolean;
    fmi2FreeInstanceTYPE *free;
    Slave slave;
} Part;

/* A connection of `part`'s input: the output `reference` of the part `from`, or the table `from` where that is none. */
typedef struct {
    int part;
    unsigned input;
    int from_table, from;
    unsigned reference;
} Wire;

#include "wiring.h"

static char said[N_PARTS][MESSAGE];

static void listen(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...)
{
    (void)environment;
    (void)category;
    for (int i = 0; i < N_PARTS; i++)
        if (status > fmi2OK && !strcmp(name, parts[i].name)) snprintf(said[i], MESSAGE, "%s", message);
}

/* The last message of a part. */
const char *coupled_said(int part) { return said[part]; }

/* How a value is set. */
enum { AS_REAL, AS_INTEGER, AS_BOOLEAN };

static int set_value(const Part *part, void *component, unsigned reference, int type, double value)
{
    const int whole = (int)value;
    if (type == AS_INTEGER) return part->set_integer(component, &reference, 1, &whole);
    if (type == AS_BOOLEAN) return part->set_boolean(component, &reference, 1, &whole);
    return part->slave.set_real(component, &reference, 1, &value);
}

/* Connected values at the start, swept until none changes; 0 where they do not settle. */
static int sweep(Part *part, const Table *tables)
{
    double last[N_WIRES];
    for (int i = 0; i < N_WIRES; i++) last[i] = INFINITY;
    for (int round = 0; round < SWEEPS; round++) {
        int settled = 1;
        for (int i = 0; i < N_WIRES; i++) {
            const Wire *w = &wires[i];
            double value = w->from_table ? tables[w->from].value[0] : 0;
            if (!w->from_table) part[w->from].slave.get_real(part[w->from].slave.component, &w->reference, 1, &value);
            part[w->part].slave.set_real(part[w->part].slave.component, &w->input, 1, &value);
            settled = settled && fabs(value - last[i]) <= 1e-9 * (fabs(value) + 1e-12);
            last[i] = value;
        }
        if (settled) return 1;
    }
    return 0;
}

/* Results beside the MasterStatus. */
enum { START_REFUSED = 100, START_UNSETTLED };

static int start(Part *part, long n_set, const int *set, const double *values, double stop, const Table *tables)
{
    static const fmi2CallbackFunctions callbacks = {listen, NULL, NULL, NULL, NULL};
    for (int i = 0; i < N_PARTS; i++) {
        Part *p = &part[i];
        *p = parts[i];
        p->slave.component = p->instantiate(p->name, fmi2CoSimulation, p->guid, "", &callbacks, 0, 0);
        int refused = !p->slave.component || p->setup(p->slave.component, 1, SLAVE_TOLERANCE, 0.0, 1, stop) > 1;
        for (long k = 0; k < n_set && !refused; k++)
            if (set[3 * k] == i)
                refused = set_value(p, p->slave.component, (unsigned)set[3 * k + 1], set[3 * k + 2], values[k]) > 1;
        if (refused || p->enter(p->slave.component) > 1) return START_REFUSED + 10 * i;
    }
    if (!sweep(part, tables)) return START_UNSETTLED;
    for (int i = 0; i < N_PARTS; i++)
        if (part[i].leave(part[i].slave.component) > 1) return START_REFUSED + 10 * i;
    return 0;
}

/* A run from 0 to `stop` [s] at communication steps of `step` [s]; of at most that where `variable` is a tolerance.
 *
 * `set` has (part, value reference, type) for each of the n_set start `values`. Table i has n[i] breakpoints (time,
 * value), one table after the other. Writes up to `capacity` rows of 4 + N_SIGNALS: time, step, iterations, error, all
 * signals. Returns a MasterStatus (`where` is the slave or signal it names), START_UNSETTLED, or START_REFUSED plus ten
 * times the part's number. */
int coupled_run(long n_set, const int *set, const double *values, const long *n, const double *time, const double *value,
                double stop, double step, double variable, double *rows, long capacity, long *n_rows, int *where)
{
    Part part[N_PARTS];
    Slave slaves[N_PARTS];
    Table tables[N_TABLES + 1];
    MasterSettings settings = SETTINGS;
    memset(part, 0, sizeof part);
    memset(said, 0, sizeof said);
    for (int i = 0, at = 0; i < N_TABLES; at += n[i++]) tables[i] = (Table){n[i], time + at, value + at, 0};
    *n_rows = 0;
    int status = start(part, n_set, set, values, stop, tables);
    if (!status) {
        settings.stop = stop;
        settings.step = step;
        settings.variable = variable > 0;
        if (settings.variable) settings.tolerance = variable;
        settings.smallest = step / 1000;
        for (int i = 0; i < N_PARTS; i++) slaves[i] = part[i].slave;
        Master *master = master_new(&settings, N_PARTS, slaves, N_TABLES, tables, N_SIGNALS, scale);
        status = master ? (int)master_run(master, rows, capacity, n_rows, where) : MASTER_MEMORY;
        master_free(master);
    }
    for (int i = 0; i < N_PARTS; i++)
        if (part[i].slave.component) part[i].free(part[i].slave.component);
    return status;
}

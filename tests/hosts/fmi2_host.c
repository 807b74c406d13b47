/* Runs one FMI 2.0 co-simulation unit with nothing but this file: no importer in between.
 *
 *   fmi2_host LIBRARY GUID RESOURCE_URI STOP STEP PRESSURE_VR VOLTAGE_VR OUTPUT_VR[,VR...]
 *             [--repeat N] [--time] [--save K FILE] [--restore K FILE] < inputs
 *
 * stdin:  one row `time [s] pressure [Pa] voltage [V]` per communication point 0, STEP, 2 STEP, ...;
 *         each row is held during the step that starts there. A row at STOP itself may be left out.
 * stdout: one row `time,output...` per communication point, STOP included, exact to the last bit
 *         (%.17g). The output at t is read after the step that reached t, before the inputs change.
 *
 * --repeat N  run N times, each with an instance of its own; the last run is printed
 * --time      print the nanoseconds per step (fmi2SetReal + fmi2DoStep + fmi2GetReal), the least of
 *             all runs, to stderr
 * --save K FILE     after K steps, write the serialised state into FILE
 * --restore K FILE  after K steps, go on from the serialised state in FILE instead
 *
 * Anything worse than fmi2Warning is told on stderr and ends the program with exit code 1.
 */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2FunctionTypes.h"

#ifdef _WIN32

#include <windows.h>

typedef HMODULE Library;

static Library open_library(const char *path) { return LoadLibraryA(path); }

static void *find_symbol(Library library, const char *name)
{
    return (void *)GetProcAddress(library, name);
}

static void describe_library_error(char *text, size_t size)
{
    snprintf(text, size, "Windows error %lu", GetLastError());
}

static double now_ns(void)
{
    LARGE_INTEGER ticks, ticks_per_second;
    QueryPerformanceCounter(&ticks);
    QueryPerformanceFrequency(&ticks_per_second);
    return 1e9 * (double)ticks.QuadPart / (double)ticks_per_second.QuadPart;
}

#else

#include <dlfcn.h>
#include <time.h>

typedef void *Library;

static Library open_library(const char *path) { return dlopen(path, RTLD_NOW | RTLD_LOCAL); }

static void *find_symbol(Library library, const char *name) { return dlsym(library, name); }

static void describe_library_error(char *text, size_t size)
{
    snprintf(text, size, "%s", dlerror());
}

static double now_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return 1e9 * (double)now.tv_sec + (double)now.tv_nsec;
}

#endif

enum { POSITIONAL = 8, INPUTS = 2, MAX_OUTPUTS = 64, MAX_STATE = 1 << 20 };

typedef struct {
    fmi2InstantiateTYPE *instantiate;
    fmi2SetupExperimentTYPE *setup_experiment;
    fmi2EnterInitializationModeTYPE *enter_initialization;
    fmi2ExitInitializationModeTYPE *exit_initialization;
    fmi2SetRealTYPE *set_real;
    fmi2DoStepTYPE *do_step;
    fmi2GetRealTYPE *get_real;
    fmi2TerminateTYPE *terminate;
    fmi2FreeInstanceTYPE *free_instance;
    fmi2GetFMUstateTYPE *get_state;
    fmi2SetFMUstateTYPE *set_state;
    fmi2FreeFMUstateTYPE *free_state;
    fmi2SerializedFMUstateSizeTYPE *state_size;
    fmi2SerializeFMUstateTYPE *serialize;
    fmi2DeSerializeFMUstateTYPE *deserialize;
} Unit;

typedef struct {
    double time;           /* s */
    fmi2Real held[INPUTS]; /* Pa, V */
} Row;

/* A state that is written or read after some steps; never, where there is no file. */
typedef struct {
    size_t after;
    const char *file;
} Stored;

typedef struct {
    const char *guid, *resource_uri;
    Stored saved, restored;
    double step; /* s */
    size_t steps;
    fmi2ValueReference inputs[INPUTS];
    fmi2ValueReference outputs[MAX_OUTPUTS];
    size_t output_count;
    const Row *rows;
} Experiment;

/* What the FMU complained of last: FMI returns a status, its reason comes through the logger. */
static char last_message[1024];

static const char *reason(void) { return *last_message ? last_message : "the FMU logged no message"; }

static void fail(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    fputs("fmi2_host: ", stderr);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    va_end(arguments);
    exit(1);
}

static void remember_message(fmi2ComponentEnvironment environment, fmi2String instance,
                             fmi2Status status, fmi2String category, fmi2String message, ...)
{
    va_list arguments;
    (void)environment, (void)instance, (void)category;
    if (status == fmi2OK)
        return;
    va_start(arguments, message);
    vsnprintf(last_message, sizeof last_message, message, arguments);
    va_end(arguments);
}

static const char *status_name(fmi2Status status)
{
    static const char *const names[] = {"fmi2OK",    "fmi2Warning", "fmi2Discard",
                                        "fmi2Error", "fmi2Fatal",   "fmi2Pending"};
    return (size_t)status < sizeof names / sizeof *names ? names[status] : "an unknown status";
}

static void check(fmi2Status status, const char *function, double time)
{
    if (status == fmi2OK)
        return;
    if (status != fmi2Warning)
        fail("%s at t = %g s returned %s: %s", function, time, status_name(status), reason());
    fprintf(stderr, "fmi2_host: warning: %s at t = %g s: %s\n", function, time, reason());
    *last_message = '\0';
}

static void *require(Library library, const char *name)
{
    void *symbol = find_symbol(library, name);
    if (!symbol)
        fail("the library exports no %s", name);
    return symbol;
}

static Unit load_unit(const char *path)
{
    char error[512];
    Library library = open_library(path);
    if (!library) {
        describe_library_error(error, sizeof error);
        fail("cannot load %s: %s", path, error);
    }
    return (Unit){
        (fmi2InstantiateTYPE *)require(library, "fmi2Instantiate"),
        (fmi2SetupExperimentTYPE *)require(library, "fmi2SetupExperiment"),
        (fmi2EnterInitializationModeTYPE *)require(library, "fmi2EnterInitializationMode"),
        (fmi2ExitInitializationModeTYPE *)require(library, "fmi2ExitInitializationMode"),
        (fmi2SetRealTYPE *)require(library, "fmi2SetReal"),
        (fmi2DoStepTYPE *)require(library, "fmi2DoStep"),
        (fmi2GetRealTYPE *)require(library, "fmi2GetReal"),
        (fmi2TerminateTYPE *)require(library, "fmi2Terminate"),
        (fmi2FreeInstanceTYPE *)require(library, "fmi2FreeInstance"),
        (fmi2GetFMUstateTYPE *)require(library, "fmi2GetFMUstate"),
        (fmi2SetFMUstateTYPE *)require(library, "fmi2SetFMUstate"),
        (fmi2FreeFMUstateTYPE *)require(library, "fmi2FreeFMUstate"),
        (fmi2SerializedFMUstateSizeTYPE *)require(library, "fmi2SerializedFMUstateSize"),
        (fmi2SerializeFMUstateTYPE *)require(library, "fmi2SerializeFMUstate"),
        (fmi2DeSerializeFMUstateTYPE *)require(library, "fmi2DeSerializeFMUstate"),
    };
}

static fmi2Component start(const Unit *unit, const Experiment *experiment)
{
    /* An FMU may keep the pointer to its callbacks as long as it lives. */
    static const fmi2CallbackFunctions callbacks = {remember_message, calloc, free, NULL, NULL};
    const double stop = (double)experiment->steps * experiment->step;
    fmi2Component tube = unit->instantiate("tube", fmi2CoSimulation, experiment->guid,
                                           experiment->resource_uri, &callbacks, fmi2False, fmi2False);
    if (!tube)
        fail("fmi2Instantiate returned no instance: %s", reason());
    check(unit->setup_experiment(tube, fmi2False, 0.0, 0.0, fmi2True, stop), "fmi2SetupExperiment", 0);
    check(unit->enter_initialization(tube), "fmi2EnterInitializationMode", 0);
    check(unit->set_real(tube, experiment->inputs, INPUTS, experiment->rows[0].held), "fmi2SetReal", 0);
    check(unit->exit_initialization(tube), "fmi2ExitInitializationMode", 0);
    return tube;
}

static FILE *open_state(const char *path, const char *how)
{
    FILE *file = fopen(path, how);
    if (!file)
        fail("cannot open the state %s", path);
    return file;
}

static void save_state(const Unit *unit, fmi2Component tube, const char *path, double time)
{
    fmi2FMUstate state = NULL;
    size_t size = 0;
    check(unit->get_state(tube, &state), "fmi2GetFMUstate", time);
    check(unit->state_size(tube, state, &size), "fmi2SerializedFMUstateSize", time);
    fmi2Byte *bytes = malloc(size);
    if (!bytes)
        fail("no memory for a state of %zu bytes", size);
    check(unit->serialize(tube, state, bytes, size), "fmi2SerializeFMUstate", time);
    check(unit->free_state(tube, &state), "fmi2FreeFMUstate", time);
    FILE *file = open_state(path, "wb");
    if (fwrite(bytes, 1, size, file) != size || fclose(file))
        fail("cannot write the state %s", path);
    free(bytes);
}

static void restore_state(const Unit *unit, fmi2Component tube, const char *path, double time)
{
    static fmi2Byte bytes[MAX_STATE];
    fmi2FMUstate state = NULL;
    FILE *file = open_state(path, "rb");
    const size_t size = fread(bytes, 1, sizeof bytes, file);
    fclose(file);
    check(unit->deserialize(tube, bytes, size, &state), "fmi2DeSerializeFMUstate", time);
    check(unit->set_state(tube, state), "fmi2SetFMUstate", time);
    check(unit->free_state(tube, &state), "fmi2FreeFMUstate", time);
}

/* Fills `results` with the outputs at each communication point; returns the nanoseconds per step. */
static double simulate(const Unit *unit, const Experiment *experiment, fmi2Real *results)
{
    const fmi2ValueReference *inputs = experiment->inputs, *outputs = experiment->outputs;
    const size_t count = experiment->output_count;
    fmi2Component tube = start(unit, experiment);
    check(unit->get_real(tube, outputs, count, results), "fmi2GetReal", 0);

    const double begin = now_ns();
    for (size_t k = 0; k < experiment->steps; ++k) {
        const double time = (double)k * experiment->step;
        if (experiment->restored.file && experiment->restored.after == k)
            restore_state(unit, tube, experiment->restored.file, time);
        if (experiment->saved.file && experiment->saved.after == k)
            save_state(unit, tube, experiment->saved.file, time);
        check(unit->set_real(tube, inputs, INPUTS, experiment->rows[k].held), "fmi2SetReal", time);
        check(unit->do_step(tube, time, experiment->step, fmi2True), "fmi2DoStep", time);
        check(unit->get_real(tube, outputs, count, results + (k + 1) * count), "fmi2GetReal", time);
    }
    const double spent = now_ns() - begin;

    check(unit->terminate(tube), "fmi2Terminate", (double)experiment->steps * experiment->step);
    unit->free_instance(tube);
    return spent / (double)experiment->steps;
}

static double parse_number(const char *what, const char *text)
{
    char *end;
    const double value = strtod(text, &end);
    if (end == text || *end || !isfinite(value))
        fail("expected a number for %s but was given '%s'", what, text);
    return value;
}

static size_t parse_references(const char *what, const char *text, fmi2ValueReference *references,
                               size_t limit)
{
    size_t count = 0;
    for (char *end;; text = end + 1) {
        if (count == limit)
            fail("expected no more than %zu value reference(s) for %s", limit, what);
        references[count++] = (fmi2ValueReference)strtoul(text, &end, 10);
        if (end == text || (*end && *end != ','))
            fail("expected value references for %s but was given '%s'", what, text);
        if (!*end)
            return count;
    }
}

static Row *read_rows(size_t steps, double step)
{
    Row *rows = calloc(steps, sizeof *rows);
    if (!rows)
        fail("no memory for %zu rows of inputs", steps);
    for (size_t k = 0; k < steps; ++k) {
        Row *row = rows + k;
        if (scanf("%lf %lf %lf", &row->time, &row->held[0], &row->held[1]) != 3)
            fail("expected %zu rows 'time pressure voltage' but row %zu is missing or incomplete",
                 steps, k + 1);
        if (fabs(row->time - (double)k * step) > 1e-6 * step)
            fail("expected input row %zu at t = %.9g s but was given t = %.9g s", k + 1,
                 (double)k * step, row->time);
    }
    return rows;
}

static Experiment parse_experiment(char **arguments)
{
    Experiment experiment = {.guid = arguments[1], .resource_uri = arguments[2]};
    const double stop = parse_number("STOP", arguments[3]);
    experiment.step = parse_number("STEP", arguments[4]);
    if (experiment.step <= 0 || stop < experiment.step)
        fail("expected 0 < STEP <= STOP but was given %g s and %g s", experiment.step, stop);
    experiment.steps = (size_t)(stop / experiment.step + 0.5);
    parse_references("PRESSURE_VR", arguments[5], &experiment.inputs[0], 1);
    parse_references("VOLTAGE_VR", arguments[6], &experiment.inputs[1], 1);
    experiment.output_count =
        parse_references("OUTPUT_VR", arguments[7], experiment.outputs, MAX_OUTPUTS);
    experiment.rows = read_rows(experiment.steps, experiment.step);
    return experiment;
}

static Stored parse_stored(char **arguments)
{
    if (!arguments[0] || !arguments[1])
        fail("expected a number of steps and a file after --save and --restore");
    return (Stored){(size_t)parse_number("steps before a state", arguments[0]), arguments[1]};
}

static void parse_options(char **arguments, size_t *repeat, int *timed, Experiment *experiment)
{
    for (; *arguments; ++arguments) {
        if (!strcmp(*arguments, "--time"))
            *timed = 1;
        else if (!strcmp(*arguments, "--repeat") && arguments[1] && atol(arguments[1]) > 0)
            *repeat = (size_t)atol(*++arguments);
        else if (!strcmp(*arguments, "--save"))
            experiment->saved = parse_stored(arguments + 1), arguments += 2;
        else if (!strcmp(*arguments, "--restore"))
            experiment->restored = parse_stored(arguments + 1), arguments += 2;
        else
            fail("expected --repeat N with N >= 1, --time, --save or --restore, but was given '%s'", *arguments);
    }
}

static void print_results(const Experiment *experiment, const fmi2Real *results)
{
    for (size_t k = 0; k <= experiment->steps; ++k) {
        printf("%.17g", (double)k * experiment->step);
        for (size_t i = 0; i < experiment->output_count; ++i)
            printf(",%.17g", results[k * experiment->output_count + i]);
        putchar('\n');
    }
}

int main(int argc, char **argv)
{
    size_t repeat = 1;
    int timed = 0;
    double least = HUGE_VAL;

    if (argc < 1 + POSITIONAL)
        fail("expected LIBRARY GUID RESOURCE_URI STOP STEP PRESSURE_VR VOLTAGE_VR OUTPUT_VR[,VR...]");
    Experiment experiment = parse_experiment(argv + 1);
    parse_options(argv + 1 + POSITIONAL, &repeat, &timed, &experiment);
    const Unit unit = load_unit(argv[1]);
    fmi2Real *results = calloc((experiment.steps + 1) * experiment.output_count, sizeof *results);
    if (!results)
        fail("no memory for %zu rows of outputs", experiment.steps + 1);

    for (size_t run = 0; run < repeat; ++run)
        least = fmin(least, simulate(&unit, &experiment, results));
    print_results(&experiment, results);
    if (timed)
        fprintf(stderr, "%.1f ns per step\n", least);
    free(results);
    free((void *)experiment.rows);
    return 0;
}

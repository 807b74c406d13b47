/* FMI 2.0 for an Instance: types, modes and memory; what the calls mean is in instance.c. */
#include <string.h>

#include "fmi2Functions.h"
#include "instance.h"

/* The statuses of FMI 2 and of Instance have the same values, up to "pending", which is not used. */
#define STATUS(status) ((fmi2Status)(status))
#define ALLOW(modes)                                              \
    Instance *const instance = c;                                 \
    if (!instance || instance_allow(instance, __func__, (modes))) \
    return fmi2Error
#define ALLOW_ONLY(interface, modes)                                            \
    Instance *const instance = c;                                               \
    if (!instance || instance_allow_only(instance, __func__, (interface), (modes))) \
    return fmi2Error

/* The text is its own format: hosts written in Python see nothing of the arguments of a variadic logger. */
static void send(fmi2CallbackLogger log, void *environment, fmi2String name, Status status, const char *category,
                 const char *message)
{
    char format[2048]; /* twice the longest message */
    size_t n = 0;
    for (; *message && n < sizeof format - 2; message++) {
        if (*message == '%') format[n++] = '%';
        format[n++] = *message;
    }
    format[n] = '\0';
    if (log) log(environment, name, STATUS(status), category, format);
}

static void log_message(Instance *instance, Status status, const char *category, const char *message)
{
    fmi2CallbackLogger log;
    memcpy(&log, &instance->host, sizeof log); /* C has no cast from a data to a function pointer */
    send(log, instance->environment, instance->name, status, category, message);
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

/* Life ------------------------------------------------------------------------------------------------------ */

static void refuse(const fmi2CallbackFunctions *callbacks, fmi2String name, const char *message)
{
    if (callbacks)
        send(callbacks->logger, callbacks->componentEnvironment, name ? name : "", STATUS_ERROR, "logStatusError", message);
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions,
                              fmi2Boolean visible, fmi2Boolean loggingOn)
{
    (void)fmuResourceLocation;
    (void)visible;
    char problem[PROBLEM_SIZE];
    if (fmuType != fmi2CoSimulation && fmuType != fmi2ModelExchange) {
        refuse(functions, instanceName, "fmi2Instantiate: expected fmi2ModelExchange or fmi2CoSimulation");
        return NULL;
    }
    Instance *instance =
        instance_create(instanceName, fmuGUID, fmuType == fmi2CoSimulation ? CO_SIMULATION : MODEL_EXCHANGE, problem);
    if (!instance) {
        refuse(functions, instanceName, problem);
        return NULL;
    }
    instance->log = log_message;
    if (functions) { /* copied, as some hosts free them after this call */
        memcpy(&instance->host, &functions->logger, sizeof functions->logger);
        instance->environment = functions->componentEnvironment;
    }
    instance->logged = loggingOn ? LOG_EVENTS | LOG_SOLVER : 0;
    return instance;
}

void fmi2FreeInstance(fmi2Component c) { instance_free(c); }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories, const fmi2String categories[])
{
    ALLOW(INSTANTIATED | INITIALIZATION | RUNNING | TERMINATED);
    return STATUS(instance_set_logging(instance, loggingOn, nCategories, categories));
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime,
                               fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    ALLOW(INSTANTIATED);
    return STATUS(instance_setup(instance, toleranceDefined, tolerance, startTime, stopTimeDefined, stopTime));
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    ALLOW(INSTANTIATED);
    if (!(instance->now.marks & SET_UP))
        return STATUS(instance_report(instance, STATUS_ERROR, "%s: expected fmi2SetupExperiment before it, for the start time",
                                      __func__));
    return STATUS(instance_enter_initialization(instance));
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    ALLOW(INITIALIZATION);
    return STATUS(instance_exit_initialization(instance));
}

fmi2Status fmi2Terminate(fmi2Component c)
{
    ALLOW(RUNNING);
    instance->now.mode = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c)
{
    ALLOW(INSTANTIATED | INITIALIZATION | RUNNING | TERMINATED);
    instance_reset(instance);
    return fmi2OK;
}

/* Values ------------------------------------------------------------------------------------------------------ */

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    return c ? STATUS(instance_get(c, __func__, TYPE_REAL, vr, nvr, value)) : fmi2Error;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[])
{
    return c ? STATUS(instance_set(c, __func__, TYPE_REAL, vr, nvr, value)) : fmi2Error;
}

/* Integers and Booleans are kept as doubles, which hold them exactly; both are C ints in FMI 2. */
static fmi2Status get_ints(fmi2Component c, const char *function, Type type, const fmi2ValueReference vr[], size_t nvr,
                           int value[])
{
    Instance *const instance = c;
    if (!instance) return fmi2Error;
    if (nvr && !value)
        return STATUS(instance_report(instance, STATUS_ERROR, "%s: expected arrays of %zu values but was given NULL", function,
                                      nvr));
    if (nvr == 0) return STATUS(instance_get(instance, function, type, NULL, 0, NULL));
    for (size_t i = 0; i < nvr; i++) {
        double real = 0;
        const Status status = instance_get(instance, function, type, vr ? vr + i : NULL, 1, &real);
        if (status != STATUS_OK) return STATUS(status);
        value[i] = (int)real;
    }
    return fmi2OK;
}

static fmi2Status set_ints(fmi2Component c, const char *function, Type type, const fmi2ValueReference vr[], size_t nvr,
                           const int value[])
{
    Instance *const instance = c;
    double real[MODEL_VARIABLES];
    if (!instance) return fmi2Error;
    if (nvr && !value)
        return STATUS(instance_report(instance, STATUS_ERROR, "%s: expected arrays of %zu values but was given NULL", function,
                                      nvr));
    if (nvr > MODEL_VARIABLES)
        return STATUS(instance_report(instance, STATUS_ERROR, "%s: expected at most %d values but was given %zu", function,
                                      MODEL_VARIABLES, nvr));
    for (size_t i = 0; i < nvr; i++) real[i] = type == TYPE_BOOLEAN ? value[i] != 0 : value[i];
    return STATUS(instance_set(instance, function, type, vr, nvr, real));
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[])
{
    return get_ints(c, __func__, TYPE_INTEGER, vr, nvr, value);
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[])
{
    return set_ints(c, __func__, TYPE_INTEGER, vr, nvr, value);
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[])
{
    return get_ints(c, __func__, TYPE_BOOLEAN, vr, nvr, value);
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[])
{
    return set_ints(c, __func__, TYPE_BOOLEAN, vr, nvr, value);
}

static fmi2Status no_strings(fmi2Component c, const char *function, size_t nvr)
{
    Instance *const instance = c;
    if (!instance) return fmi2Error;
    if (nvr == 0) return fmi2OK;
    return STATUS(instance_report(instance, STATUS_ERROR, "%s: the model has no String variables", function));
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[])
{
    (void)vr;
    (void)value;
    return no_strings(c, __func__, nvr);
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[])
{
    (void)vr;
    (void)value;
    return no_strings(c, __func__, nvr);
}

/* Saved states -------------------------------------------------------------------------------------------------- */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    return c ? STATUS(state_get(c, __func__, state)) : fmi2Error;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    return c ? STATUS(state_set(c, __func__, state)) : fmi2Error;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    if (!c) return fmi2Error;
    state_free(state);
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    return c ? STATUS(state_size(c, __func__, state, size)) : fmi2Error;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    return c ? STATUS(state_serialize(c, __func__, state, (unsigned char *)bytes, size)) : fmi2Error;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    return c ? STATUS(state_deserialize(c, __func__, (const unsigned char *)bytes, size, state)) : fmi2Error;
}

/* Derivatives --------------------------------------------------------------------------------------------------- */

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown[], size_t nUnknown,
                                        const fmi2ValueReference vKnown[], size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[])
{
    ALLOW(INITIALIZATION | RUNNING | TERMINATED);
    return STATUS(instance_directional(instance, vUnknown, nUnknown, vKnown, nKnown, dvKnown, dvUnknown));
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[])
{
    ALLOW_ONLY(CO_SIMULATION, INSTANTIATED | INITIALIZATION | STEPPING);
    return STATUS(instance_set_input_derivatives(instance, vr, nvr, order, value));
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[])
{
    ALLOW_ONLY(CO_SIMULATION, STEPPING | TERMINATED);
    return STATUS(instance_get_output_derivatives(instance, vr, nvr, order, value));
}

/* Co-simulation --------------------------------------------------------------------------------------------------- */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    (void)noSetFMUStatePriorToCurrentPoint;
    ALLOW_ONLY(CO_SIMULATION, STEPPING);
    return STATUS(instance_do_step(instance, currentCommunicationPoint, communicationStepSize, NULL));
}

fmi2Status fmi2CancelStep(fmi2Component c)
{
    ALLOW_ONLY(CO_SIMULATION, STEPPING);
    return STATUS(instance_report(instance, STATUS_ERROR, "fmi2CancelStep: steps are never pending"));
}

/* Steps are never pending: of all that can be asked for, there are the time and the wish to terminate. */
static fmi2Status no_status(fmi2Component c, const char *function, const void *value)
{
    Instance *const instance = c;
    if (!instance || instance_allow_only(instance, function, CO_SIMULATION, STEPPING | TERMINATED)) return fmi2Error;
    if (!value)
        return STATUS(instance_report(instance, STATUS_ERROR, "%s: expected a pointer but was given NULL", function));
    return STATUS(instance_report(instance, STATUS_DISCARD, "%s: there is no status of this kind; steps are never pending",
                                  function));
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    if (kind != fmi2LastSuccessfulTime || !value) return no_status(c, __func__, value);
    ALLOW_ONLY(CO_SIMULATION, STEPPING | TERMINATED);
    *value = instance->now.time;
    return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value)
{
    if (kind != fmi2Terminated || !value) return no_status(c, __func__, value);
    ALLOW_ONLY(CO_SIMULATION, STEPPING | TERMINATED);
    *value = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value)
{
    (void)kind;
    return no_status(c, __func__, value);
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value)
{
    (void)kind;
    return no_status(c, __func__, value);
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value)
{
    (void)kind;
    return no_status(c, __func__, value);
}

/* Model exchange ------------------------------------------------------------------------------------------------ */

#define FMI(name) fmi2##name
#define FMI_HANDLE fmi2Component
#define FMI_GET_DERIVATIVES fmi2GetDerivatives
#define FMI_NOMINALS_MODES (INSTANTIATED | INITIALIZATION | EVENT | CONTINUOUS_TIME | TERMINATED)
#include "exchange.h"

fmi2Status fmi2EnterEventMode(fmi2Component c)
{
    ALLOW_ONLY(MODEL_EXCHANGE, CONTINUOUS_TIME | EVENT);
    instance->now.mode = EVENT;
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info)
{
    ALLOW_ONLY(MODEL_EXCHANGE, EVENT);
    if (!info) return STATUS(instance_report(instance, STATUS_ERROR, "%s: expected an event info but was given NULL", __func__));
    memset(info, 0, sizeof *info); /* no discrete states, no time events */
    return fmi2OK;
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real indicators[], size_t ni)
{
    (void)indicators;
    ALLOW_ONLY(MODEL_EXCHANGE, INITIALIZATION | EVENT | CONTINUOUS_TIME | TERMINATED);
    if (ni == 0) return fmi2OK;
    return STATUS(instance_report(instance, STATUS_ERROR, "%s: expected 0 values but was given %zu", __func__, ni));
}

/* FMI 3.0 for an Instance: types, modes and callbacks; what the calls mean is in instance.c and its neighbours. */
#include <string.h>

#include "fmi3Functions.h"
#include "instance.h"

#define STATUS(status) ((fmi3Status)(status)) /* the same values in FMI 3 and Instance */
#define ALLOW(modes)                                                   \
    Instance *const me = instance;                                     \
    if (!me || instance_allow(me, __func__, (modes)) != STATUS_OK)     \
    return fmi3Error
#define ALLOW_ONLY(interface, modes)                                                       \
    Instance *const me = instance;                                                         \
    if (!me || instance_allow_only(me, __func__, (interface), (modes)) != STATUS_OK) \
    return fmi3Error
#define ANY_MODE (INSTANTIATED | INITIALIZATION | RUNNING | TERMINATED)

const char *fmi3GetVersion(void) { return fmi3Version; }

/* Life ------------------------------------------------------------------------------------------------------ */

static void log_message(Instance *instance, Status status, const char *category, const char *message)
{
    fmi3LogMessageCallback log;
    memcpy(&log, &instance->host, sizeof log); /* C has no cast from a data to a function pointer */
    if (log) log(instance->environment, STATUS(status), category, message);
}

static fmi3Instance instantiate(fmi3String name, fmi3String token, fmi3Boolean loggingOn, Interface interface,
                                fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    char problem[PROBLEM_SIZE];
    Instance *me = instance_create(name, token, interface, problem);
    if (!me) {
        if (log) log(environment, fmi3Error, "logStatusError", problem);
        return NULL;
    }
    me->log = log_message;
    memcpy(&me->host, &log, sizeof log);
    me->environment = environment;
    me->logged = loggingOn ? LOG_EVENTS | LOG_SOLVER : 0;
    return me;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
                                          fmi3Boolean visible, fmi3Boolean loggingOn,
                                          fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage)
{
    (void)resourcePath;
    (void)visible;
    return instantiate(instanceName, instantiationToken, loggingOn, MODEL_EXCHANGE, instanceEnvironment, logMessage);
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
                                         fmi3Boolean visible, fmi3Boolean loggingOn, fmi3Boolean eventModeUsed,
                                         fmi3Boolean earlyReturnAllowed,
                                         const fmi3ValueReference requiredIntermediateVariables[],
                                         size_t nRequiredIntermediateVariables,
                                         fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage,
                                         fmi3IntermediateUpdateCallback intermediateUpdate)
{
    (void)resourcePath;
    (void)visible;
    (void)requiredIntermediateVariables; /* every variable is available then */
    (void)nRequiredIntermediateVariables;
    if (eventModeUsed) {
        if (logMessage)
            logMessage(instanceEnvironment, fmi3Error, "logStatusError",
                       "instantiate: expected eventModeUsed = false (hasEventMode is false) but was given true");
        return NULL;
    }
    Instance *me =
        instantiate(instanceName, instantiationToken, loggingOn, CO_SIMULATION, instanceEnvironment, logMessage);
    if (!me) return NULL;
    memcpy(&me->intermediate_update, &intermediateUpdate, sizeof intermediateUpdate);
    me->may_return_early = earlyReturnAllowed;
    return me;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String instanceName, fmi3String instantiationToken,
                                               fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                               fmi3InstanceEnvironment instanceEnvironment,
                                               fmi3LogMessageCallback logMessage, fmi3ClockUpdateCallback clockUpdate,
                                               fmi3LockPreemptionCallback lockPreemption,
                                               fmi3UnlockPreemptionCallback unlockPreemption)
{
    (void)instanceName, (void)instantiationToken, (void)resourcePath, (void)visible, (void)loggingOn;
    (void)clockUpdate, (void)lockPreemption, (void)unlockPreemption;
    if (logMessage)
        logMessage(instanceEnvironment, fmi3Error, "logStatusError",
                   "instantiate: this FMU offers model exchange and co-simulation, not scheduled execution");
    return NULL;
}

void fmi3FreeInstance(fmi3Instance instance)
{
    Instance *const me = instance;
    if (me && instance_allow(me, __func__, ANY_MODE & ~INTERMEDIATE) == STATUS_OK) instance_free(me);
}

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories,
                               const fmi3String categories[])
{
    ALLOW(ANY_MODE);
    return STATUS(instance_set_logging(me, loggingOn, nCategories, categories));
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
                                       fmi3Float64 startTime, fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    ALLOW(INSTANTIATED);
    const Status status = instance_setup(me, toleranceDefined, tolerance, startTime, stopTimeDefined, stopTime);
    if (status > STATUS_WARNING) return STATUS(status);
    instance_enter_initialization(me);
    return STATUS(status);
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    ALLOW(INITIALIZATION);
    return STATUS(instance_exit_initialization(me));
}

fmi3Status fmi3EnterEventMode(fmi3Instance instance)
{
    ALLOW_ONLY(MODEL_EXCHANGE, CONTINUOUS_TIME);
    me->now.mode = EVENT;
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance instance)
{
    ALLOW(EVENT | CONTINUOUS_TIME | STEPPING);
    me->now.mode = TERMINATED;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance instance)
{
    ALLOW(ANY_MODE & ~INTERMEDIATE);
    instance_reset(me);
    return fmi3OK;
}

/* Values ------------------------------------------------------------------------------------------------------ */

static Status check_sizes(Instance *me, const char *function, size_t nReferences, size_t nValues)
{
    if (nReferences == nValues) return STATUS_OK;
    return instance_report(me, STATUS_ERROR, "%s: expected %zu values but was given room for %zu", function, nReferences,
                           nValues);
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          fmi3Float64 values[], size_t nValues)
{
    Instance *const me = instance;
    if (!me || check_sizes(me, __func__, nValueReferences, nValues) != STATUS_OK) return fmi3Error;
    return STATUS(instance_get(me, __func__, TYPE_REAL, valueReferences, nValueReferences, values));
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          const fmi3Float64 values[], size_t nValues)
{
    Instance *const me = instance;
    if (!me || check_sizes(me, __func__, nValueReferences, nValues) != STATUS_OK) return fmi3Error;
    return STATUS(instance_set(me, __func__, TYPE_REAL, valueReferences, nValueReferences, values));
}

/* Integers and Booleans are kept as doubles, which hold them exactly. */
#define GET_AND_SET(NAME, C_TYPE, TYPE)                                                                               \
    fmi3Status fmi3Get##NAME(fmi3Instance instance, const fmi3ValueReference valueReferences[],                      \
                             size_t nValueReferences, C_TYPE values[], size_t nValues)                               \
    {                                                                                                                 \
        Instance *const me = instance;                                                                                \
        if (!me || check_sizes(me, __func__, nValueReferences, nValues) != STATUS_OK) return fmi3Error;               \
        if (nValues == 0) return STATUS(instance_get(me, __func__, TYPE, NULL, 0, NULL));                             \
        if (!values)                                                                                                  \
            return STATUS(instance_report(me, STATUS_ERROR, "%s: expected an array but was given NULL", __func__));   \
        for (size_t i = 0; i < nValues; i++) {                                                                        \
            double real = 0;                                                                                          \
            const Status status =                                                                                     \
                instance_get(me, __func__, TYPE, valueReferences ? valueReferences + i : NULL, 1, &real);             \
            if (status != STATUS_OK) return STATUS(status);                                                           \
            values[i] = (C_TYPE)real;                                                                                 \
        }                                                                                                             \
        return fmi3OK;                                                                                                \
    }                                                                                                                 \
    fmi3Status fmi3Set##NAME(fmi3Instance instance, const fmi3ValueReference valueReferences[],                      \
                             size_t nValueReferences, const C_TYPE values[], size_t nValues)                         \
    {                                                                                                                 \
        Instance *const me = instance;                                                                                \
        double real[MODEL_VARIABLES];                                                                                 \
        if (!me || check_sizes(me, __func__, nValueReferences, nValues) != STATUS_OK) return fmi3Error;               \
        if (nValues > MODEL_VARIABLES || (nValues > 0 && !values))                                                    \
            return STATUS(instance_report(me, STATUS_ERROR, "%s: expected an array of at most %d values", __func__,   \
                                          MODEL_VARIABLES));                                                          \
        for (size_t i = 0; i < nValues; i++) real[i] = values[i];                                                     \
        return STATUS(instance_set(me, __func__, TYPE, valueReferences, nValueReferences, real));                     \
    }

GET_AND_SET(Int32, fmi3Int32, TYPE_INTEGER)
GET_AND_SET(Boolean, fmi3Boolean, TYPE_BOOLEAN)

static fmi3Status no_such_type(Instance *me, const char *function, size_t n)
{
    if (!me) return fmi3Error;
    if (n == 0) return fmi3OK;
    return STATUS(instance_report(me, STATUS_ERROR, "%s: the model has no variables of this type", function));
}

#define ABSENT(NAME)                                                                                              \
    fmi3Status fmi3Get##NAME(fmi3Instance instance, const fmi3ValueReference valueReferences[],                  \
                             size_t nValueReferences, fmi3##NAME values[], size_t nValues)                       \
    {                                                                                                             \
        (void)valueReferences, (void)values, (void)nValues;                                                       \
        return no_such_type(instance, __func__, nValueReferences);                                                \
    }                                                                                                             \
    fmi3Status fmi3Set##NAME(fmi3Instance instance, const fmi3ValueReference valueReferences[],                  \
                             size_t nValueReferences, const fmi3##NAME values[], size_t nValues)                 \
    {                                                                                                             \
        (void)valueReferences, (void)values, (void)nValues;                                                       \
        return no_such_type(instance, __func__, nValueReferences);                                                \
    }

ABSENT(Float32)
ABSENT(Int8)
ABSENT(UInt8)
ABSENT(Int16)
ABSENT(UInt16)
ABSENT(UInt32)
ABSENT(Int64)
ABSENT(UInt64)
ABSENT(String)

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         size_t valueSizes[], fmi3Binary values[], size_t nValues)
{
    (void)valueReferences, (void)valueSizes, (void)values, (void)nValues;
    return no_such_type(instance, __func__, nValueReferences);
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         const size_t valueSizes[], const fmi3Binary values[], size_t nValues)
{
    (void)valueReferences, (void)valueSizes, (void)values, (void)nValues;
    return no_such_type(instance, __func__, nValueReferences);
}

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        fmi3Clock values[])
{
    (void)valueReferences, (void)values;
    return no_such_type(instance, __func__, nValueReferences);
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        const fmi3Clock values[])
{
    (void)valueReferences, (void)values;
    return no_such_type(instance, __func__, nValueReferences);
}

/* Saved states -------------------------------------------------------------------------------------------------- */

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    ALLOW(ANY_MODE & ~INTERMEDIATE);
    return STATUS(state_get(me, __func__, FMUState));
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState)
{
    ALLOW(ANY_MODE & ~INTERMEDIATE);
    return STATUS(state_set(me, __func__, FMUState));
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    if (!instance) return fmi3Error;
    state_free(FMUState);
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState FMUState, size_t *size)
{
    return instance ? STATUS(state_size(instance, __func__, FMUState, size)) : fmi3Error;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState FMUState, fmi3Byte serializedState[], size_t size)
{
    return instance ? STATUS(state_serialize(instance, __func__, FMUState, serializedState, size)) : fmi3Error;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte serializedState[], size_t size,
                                   fmi3FMUState *FMUState)
{
    return instance ? STATUS(state_deserialize(instance, __func__, serializedState, size, FMUState)) : fmi3Error;
}

/* Derivatives --------------------------------------------------------------------------------------------------- */

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                        const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
                                        size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity)
{
    ALLOW(INITIALIZATION | RUNNING | TERMINATED);
    if (check_sizes(me, __func__, nKnowns, nSeed) || check_sizes(me, __func__, nUnknowns, nSensitivity)) return fmi3Error;
    return STATUS(instance_directional(me, unknowns, nUnknowns, knowns, nKnowns, seed, sensitivity));
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                    const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
                                    size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity)
{
    ALLOW(INITIALIZATION | RUNNING | TERMINATED);
    if (check_sizes(me, __func__, nUnknowns, nSeed) || check_sizes(me, __func__, nKnowns, nSensitivity)) return fmi3Error;
    return STATUS(instance_adjoint(me, unknowns, nUnknowns, knowns, nKnowns, seed, sensitivity));
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                    size_t nValueReferences, const fmi3Int32 orders[], fmi3Float64 values[], size_t nValues)
{
    ALLOW_ONLY(CO_SIMULATION, STEPPING | INTERMEDIATE | TERMINATED);
    if (check_sizes(me, __func__, nValueReferences, nValues)) return fmi3Error;
    return STATUS(instance_get_output_derivatives(me, valueReferences, nValueReferences, orders, values));
}

/* Dependencies are those of modelDescription.xml, which never change (providesPerElementDependencies is false). */
fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference valueReference,
                                               size_t *nDependencies)
{
    (void)valueReference, (void)nDependencies;
    if (!instance) return fmi3Error;
    return STATUS(instance_report(instance, STATUS_ERROR, "%s: read the dependencies from modelDescription.xml", __func__));
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent,
                                       size_t elementIndicesOfDependent[], fmi3ValueReference independents[],
                                       size_t elementIndicesOfIndependents[], fmi3DependencyKind dependencyKinds[],
                                       size_t nDependencies)
{
    (void)dependent, (void)elementIndicesOfDependent, (void)independents, (void)elementIndicesOfIndependents;
    (void)dependencyKinds, (void)nDependencies;
    if (!instance) return fmi3Error;
    return STATUS(instance_report(instance, STATUS_ERROR, "%s: read the dependencies from modelDescription.xml", __func__));
}

/* Co-simulation --------------------------------------------------------------------------------------------------- */

static double intermediate_update(Instance *me, double end)
{
    fmi3IntermediateUpdateCallback update;
    fmi3Boolean stop = fmi3False;
    fmi3Float64 stop_time = me->now.time;
    memcpy(&update, &me->intermediate_update, sizeof update);
    update(me->environment, me->now.time, fmi3True, fmi3True, fmi3True, me->may_return_early && me->now.time < end,
           &stop, &stop_time);
    return me->may_return_early && stop ? stop_time : end;
}

fmi3Status fmi3EnterStepMode(fmi3Instance instance)
{
    ALLOW_ONLY(CO_SIMULATION, 0); /* only reached from event mode, which this FMU's co-simulation does not have */
    return fmi3Error;
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint, fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *eventHandlingNeeded,
                      fmi3Boolean *terminateSimulation, fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime)
{
    (void)noSetFMUStatePriorToCurrentPoint;
    ALLOW_ONLY(CO_SIMULATION, STEPPING);
    const double end = currentCommunicationPoint + communicationStepSize;
    const Status status = instance_do_step(me, currentCommunicationPoint, communicationStepSize,
                                           me->intermediate_update ? intermediate_update : NULL);
    if (eventHandlingNeeded) *eventHandlingNeeded = fmi3False;
    if (terminateSimulation) *terminateSimulation = fmi3False;
    if (earlyReturn) *earlyReturn = status == STATUS_OK && me->now.time < end;
    if (lastSuccessfulTime) *lastSuccessfulTime = me->now.time;
    return STATUS(status);
}

/* Model exchange ------------------------------------------------------------------------------------------------ */

#define FMI(name) fmi3##name
#define FMI_HANDLE fmi3Instance
#define FMI_GET_DERIVATIVES fmi3GetContinuousStateDerivatives
#define FMI_NOMINALS_MODES (INITIALIZATION | EVENT | CONTINUOUS_TIME | TERMINATED)
#include "exchange.h"

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate,
                                    fmi3Boolean *terminateSimulation, fmi3Boolean *nominalsOfContinuousStatesChanged,
                                    fmi3Boolean *valuesOfContinuousStatesChanged, fmi3Boolean *nextEventTimeDefined,
                                    fmi3Float64 *nextEventTime)
{
    ALLOW_ONLY(MODEL_EXCHANGE, EVENT);
    fmi3Boolean *const flags[] = {discreteStatesNeedUpdate, terminateSimulation, nominalsOfContinuousStatesChanged,
                                  valuesOfContinuousStatesChanged, nextEventTimeDefined};
    for (size_t i = 0; i < sizeof flags / sizeof *flags; i++)
        if (flags[i]) *flags[i] = fmi3False; /* no discrete states, no time events */
    if (nextEventTime) *nextEventTime = 0;
    return fmi3OK;
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance)
{
    ALLOW_ONLY(MODEL_EXCHANGE, INITIALIZATION | EVENT);
    return fmi3OK;
}

fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 eventIndicators[], size_t nEventIndicators)
{
    (void)eventIndicators;
    ALLOW_ONLY(MODEL_EXCHANGE, INITIALIZATION | EVENT | CONTINUOUS_TIME | TERMINATED);
    return STATUS(check_sizes(me, __func__, 0, nEventIndicators));
}

static fmi3Status count(Instance *me, const char *function, size_t *n, size_t value)
{
    if (!me || instance_allow_only(me, function, MODEL_EXCHANGE, ANY_MODE) != STATUS_OK) return fmi3Error;
    if (!n) return STATUS(instance_report(me, STATUS_ERROR, "%s: expected a pointer but was given NULL", function));
    *n = value;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *nEventIndicators)
{
    return count(instance, __func__, nEventIndicators, 0);
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *nContinuousStates)
{
    return count(instance, __func__, nContinuousStates, MODEL_NX);
}

/* What this FMU does not have: structural parameters, clocks, scheduled execution -------------------------------- */

static fmi3Status absent(Instance *me, const char *function, const char *what)
{
    if (!me) return fmi3Error;
    return STATUS(instance_report(me, STATUS_ERROR, "%s: the model has no %s", function, what));
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance) { return absent(instance, __func__, "structural parameters"); }

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance) { return absent(instance, __func__, "structural parameters"); }

fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clockReference, fmi3Float64 activationTime)
{
    (void)clockReference, (void)activationTime;
    return absent(instance, __func__, "clocks");
}

#define NO_CLOCK(NAME, ...)                                                                                     \
    fmi3Status fmi3##NAME(fmi3Instance instance, const fmi3ValueReference valueReferences[],                    \
                          size_t nValueReferences, __VA_ARGS__)                                                 \
    {                                                                                                           \
        (void)valueReferences, (void)nValueReferences, (void)a, (void)b;                                        \
        return absent(instance, __func__, "clocks");                                                            \
    }

NO_CLOCK(GetIntervalDecimal, fmi3Float64 a[], fmi3IntervalQualifier b[])
NO_CLOCK(SetIntervalFraction, const fmi3UInt64 a[], const fmi3UInt64 b[])
NO_CLOCK(GetShiftFraction, fmi3UInt64 a[], fmi3UInt64 b[])
NO_CLOCK(SetShiftFraction, const fmi3UInt64 a[], const fmi3UInt64 b[])

#define NO_CLOCK_ONE(NAME, ...)                                                                                 \
    fmi3Status fmi3##NAME(fmi3Instance instance, const fmi3ValueReference valueReferences[],                    \
                          size_t nValueReferences, __VA_ARGS__)                                                 \
    {                                                                                                           \
        (void)valueReferences, (void)nValueReferences, (void)a;                                                 \
        return absent(instance, __func__, "clocks");                                                            \
    }

NO_CLOCK_ONE(SetIntervalDecimal, const fmi3Float64 a[])
NO_CLOCK_ONE(GetShiftDecimal, fmi3Float64 a[])
NO_CLOCK_ONE(SetShiftDecimal, const fmi3Float64 a[])

fmi3Status fmi3GetIntervalFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                   size_t nValueReferences, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
                                   fmi3IntervalQualifier qualifiers[])
{
    (void)valueReferences, (void)nValueReferences, (void)counters, (void)resolutions, (void)qualifiers;
    return absent(instance, __func__, "clocks");
}

/* Model exchange as FMI 2 and FMI 3 have it alike: the same functions under the names and types of a version.
 *
 * The file that includes it (once) has defined
 *
 *   FMI(name), FMI_HANDLE    a name with the version's prefix, and the type of what hosts hand over
 *   FMI_GET_DERIVATIVES      the one function that has another name in each
 *   FMI_NOMINALS_MODES       when nominals may be asked for
 *   STATUS                   a version's status from ours
 */
#define ONLY_IN(modes)                                                                                            \
    Instance *const own = handle;                                                                                 \
    if (!own || instance_allow_only(own, __func__, MODEL_EXCHANGE, (modes)) != STATUS_OK) return FMI(Error)
#define EVALUATED (INITIALIZATION | EVENT | CONTINUOUS_TIME | TERMINATED)

FMI(Status) FMI(EnterContinuousTimeMode)(FMI_HANDLE handle)
{
    ONLY_IN(EVENT);
    own->now.mode = CONTINUOUS_TIME;
    return FMI(OK);
}

FMI(Status) FMI(CompletedIntegratorStep)(FMI_HANDLE handle, FMI(Boolean) no_state_before_now, FMI(Boolean) *enter_event_mode,
                                         FMI(Boolean) *terminate)
{
    (void)no_state_before_now;
    ONLY_IN(CONTINUOUS_TIME);
    const int jumped = instance_completed_step(own);
    if (enter_event_mode) *enter_event_mode = jumped ? FMI(True) : FMI(False);
    if (terminate) *terminate = FMI(False);
    return FMI(OK);
}

FMI(Status) FMI(SetTime)(FMI_HANDLE handle, double time)
{
    ONLY_IN(EVENT | CONTINUOUS_TIME);
    return STATUS(instance_set_time(own, time));
}

FMI(Status) FMI(SetContinuousStates)(FMI_HANDLE handle, const double x[], size_t n)
{
    ONLY_IN(CONTINUOUS_TIME);
    return STATUS(instance_set_states(own, x, n));
}

FMI(Status) FMI(GetContinuousStates)(FMI_HANDLE handle, double x[], size_t n)
{
    ONLY_IN(EVALUATED);
    return STATUS(instance_get_states(own, x, n));
}

FMI(Status) FMI_GET_DERIVATIVES(FMI_HANDLE handle, double derivatives[], size_t n)
{
    ONLY_IN(EVALUATED);
    return STATUS(instance_get_derivatives(own, derivatives, n));
}

FMI(Status) FMI(GetNominalsOfContinuousStates)(FMI_HANDLE handle, double nominals[], size_t n)
{
    ONLY_IN(FMI_NOMINALS_MODES);
    return STATUS(instance_get_nominals(own, nominals, n));
}

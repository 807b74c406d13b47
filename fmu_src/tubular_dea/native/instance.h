/* One instance of the model, independent of the FMI version: what fmi2.c and fmi3.c put their names to.
 *
 * Nothing is global. Everything that determines the future of an instance is in its `Snapshot`, so that saving and
 * restoring it is exact; everything else is either fixed at instantiation or recomputed from the snapshot.
 * A refused call changes nothing.
 */
#ifndef INSTANCE_H
#define INSTANCE_H

#include <stddef.h>
#include <stdint.h>

#include "model.h"
#include "rosenbrock.h"

typedef enum { STATUS_OK, STATUS_WARNING, STATUS_DISCARD, STATUS_ERROR, STATUS_FATAL } Status;

/* Modes of the FMI state machines, as bits. */
typedef enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    EVENT = 4,
    CONTINUOUS_TIME = 8,
    STEPPING = 16,
    TERMINATED = 32,
    INTERMEDIATE = 64 /* inside the host's intermediate update (FMI 3) */
} Mode;

#define RUNNING (EVENT | CONTINUOUS_TIME | STEPPING | INTERMEDIATE)

typedef enum { MODEL_EXCHANGE, CO_SIMULATION } Interface;

typedef enum { LOG_EVENTS = 1, LOG_SOLVER = 2 } LogCategory;

/* What has happened, as bits of `marks`. */
typedef enum {
    SET_UP = 1, /* the start time has been given */
    SPENT = 2   /* the inputs' derivatives are those of the last step: outputs see them, the next step does not */
} Mark;

#define PAST_ROOM 1024

/* A piece of what a delayed signal was, from `time` on: an input's value and derivatives there, or a definition as
 * Newton's polynomial over the piece (delay.c). */
typedef struct {
    double time, length, c[6];
} Past;

/* Doubles first, then an even number of 32-bit integers: the same layout on every platform, no padding. */
typedef struct {
    double time, start, stop; /* stop is infinite where the host gave none */
    double tolerance;
    double h; /* step size to go on with; 0 before the first step */
    double x[AT_LEAST_ONE(MODEL_NX)];
    double u[AT_LEAST_ONE(MODEL_NU)][INPUT_ORDER + 1]; /* inputs and their derivatives at `time` */
    double p[AT_LEAST_ONE(MODEL_NP)];
#if MODEL_DELAYS
    Past past[MODEL_DELAYS][PAST_ROOM];
    int32_t n_past[2 * MODEL_DELAYS]; /* the first half is in use */
#endif
    int32_t mode;
    int32_t marks;
} Snapshot;

/* How a host of model exchange treats inputs: with which ones it asked for derivatives last (where it has at all, and
 * whether since the last completed step), and whether it has ever changed them within a step. */
typedef struct {
    int asked, within, varies;
    double u[AT_LEAST_ONE(MODEL_NU)];
} Held;

typedef struct Instance {
    Snapshot now;
    /* recomputed from the snapshot when wanted */
    int start_is_stale, outputs_are_stale, fold_is_stale;
    double y[AT_LEAST_ONE(MODEL_NY)];
    double fold, fold_unknown;
    double fold_u[AT_LEAST_ONE(MODEL_NU)], fold_p[AT_LEAST_ONE(MODEL_NP)]; /* for which the fold was sought; p = 0: none */
    Held held;
    /* fixed at instantiation */
    Interface interface;
    char *name;
    unsigned logged; /* LogCategory bits */
    void (*log)(struct Instance *, Status, const char *category, const char *message);
    void *host, *environment; /* the host's logger (a function, copied bytewise) and its argument */
    void *intermediate_update; /* FMI 3 callback, or NULL */
    int may_return_early;
} Instance;

/* NULL, and the reason in `problem`, where the name is empty or the GUID is not the model's. */
#define PROBLEM_SIZE 256
Instance *instance_create(const char *name, const char *guid, Interface interface, char problem[PROBLEM_SIZE]);
void instance_free(Instance *instance);
void instance_reset(Instance *instance);

/* Logs a message (printf style) and returns `status`, so that callers can `return instance_report(...)`. */
Status instance_report(Instance *instance, Status status, const char *format, ...);
void instance_note(Instance *instance, LogCategory category, const char *format, ...);

/* Which debug messages are sent: all categories where n is 0. */
Status instance_set_logging(Instance *instance, int on, size_t n, const char *const *categories);

/* OK where `function` may be called in the present mode; an error that names both where not. */
Status instance_allow(Instance *instance, const char *function, int modes);

/* The same for functions that belong to one interface alone. */
Status instance_allow_only(Instance *instance, const char *function, Interface interface, int modes);

/* Values by reference, in the modes that allow it. `type` is what the caller's function transports. */
Status instance_get(Instance *instance, const char *function, Type type, const unsigned *vr, size_t n, double *value);
Status instance_set(Instance *instance, const char *function, Type type, const unsigned *vr, size_t n,
                    const double *value);
Status instance_set_input_derivatives(Instance *instance, const unsigned *vr, size_t n, const int32_t *order,
                                      const double *value);
Status instance_get_output_derivatives(Instance *instance, const unsigned *vr, size_t n, const int32_t *order,
                                       double *value);

Status instance_setup(Instance *instance, int has_tolerance, double tolerance, double start, int has_stop, double stop);
Status instance_enter_initialization(Instance *instance);
Status instance_exit_initialization(Instance *instance);

/* Called after internal steps, at `now.time`, with the end of the communication step; returns where it is to end. */
typedef double (*Between)(Instance *instance, double end);

/* From `time` over `step`; on success now.time is the end (or where `between` let it end). */
Status instance_do_step(Instance *instance, double time, double step, Between between);

Status instance_set_time(Instance *instance, double time);
Status instance_set_states(Instance *instance, const double *x, size_t n);
Status instance_get_states(Instance *instance, double *x, size_t n);
Status instance_get_derivatives(Instance *instance, double *dx, size_t n);
Status instance_get_nominals(Instance *instance, double *nominal, size_t n);

/* Whether the inputs now differ from those of the last derivatives, in a host that holds them over its steps: to its
 * solver the derivatives jump here, so that it has to start anew (an event). */
int instance_completed_step(Instance *instance);

/* OK where all states are above their minima; `status` and a message that names the first one that is not. */
Status instance_above_minima(Instance *instance, const char *what, const double *x, Status status);

/* The name of a variable for messages. */
const char *instance_name_of(Kind kind, int index);

/* Derivatives of inputs hold for one step: drops those of input `i` where the step was made. */
void instance_drop_spent(Instance *instance, int i);

/* What follows from the snapshot; each is recomputed only when it is stale. */
void instance_inputs(const Instance *instance, double *u, double *du);
void instance_update_fold(Instance *instance);
void instance_update_outputs(Instance *instance);
void instance_derivatives(const Instance *instance, double *dx);
Status instance_update_start(Instance *instance);
void instance_forget(Instance *instance);

/* Forward: sensitivity = d(unknowns)/d(knowns) . seed; adjoint: sensitivity = seed . d(unknowns)/d(knowns). */
Status instance_directional(Instance *instance, const unsigned *unknown, size_t n_unknown, const unsigned *known,
                            size_t n_known, const double *seed, double *sensitivity);
Status instance_adjoint(Instance *instance, const unsigned *unknown, size_t n_unknown, const unsigned *known,
                        size_t n_known, const double *seed, double *sensitivity);

/* Saved states, for both FMI versions: `function` is the name in messages; *state is allocated where it is NULL. */
Status state_get(Instance *instance, const char *function, void **state);
Status state_set(Instance *instance, const char *function, const void *state);
void state_free(void **state);
Status state_size(Instance *instance, const char *function, const void *state, size_t *size);
Status state_serialize(Instance *instance, const char *function, const void *state, unsigned char *bytes, size_t size);
Status state_deserialize(Instance *instance, const char *function, const unsigned char *bytes, size_t size, void **state);

#endif

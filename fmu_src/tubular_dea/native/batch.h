/* Many trajectories, or rest states, in one call: each row has its own parameters and inputs, and leaves a few numbers.
 *
 * A row's numbers depend on that row alone, to the last bit: not on the other rows of the call or on their order. Calls
 * share nothing, so threads may make them at the same time.
 */
#ifndef BATCH_H
#define BATCH_H

#include "kernel.h"

/* One input of all rows: straight between breakpoints (time, value), level outside; a time listed twice is a jump.
 * A stride is the number of doubles from one row to the next, 0 where the rows share them. */
typedef struct {
    long n; /* breakpoints, at least one */
    const double *time, *value;
    long time_stride, value_stride;
} BatchInput;

typedef enum {
    PROBE_FINAL,   /* at the end */
    PROBE_MINIMUM, /* from `time` on, as all that follow but the next */
    PROBE_MAXIMUM,
    PROBE_MEAN, /* over time */
    PROBE_AT,   /* at `time`; after a jump there */
    PROBE_RISE, /* the first time at or above `threshold`; NaN where there is none */
    PROBE_FALL
} ProbeKind;

typedef enum {
    SOURCE_STATE,
    SOURCE_OUTPUT,
    SOURCE_INPUT,
    SOURCE_FOLD,        /* the load at the fold, under the present inputs */
    SOURCE_FOLD_PLACE,  /* the curve's unknown at the fold */
    SOURCE_BEYOND_FOLD, /* how far the unknown is beyond its place at the fold */
    SOURCE_TIME
} ProbeSource;

/* A number wanted of each row. */
typedef struct {
    int kind, source, index;
    const double *time; /* NULL: the start */
    long time_stride;
    double threshold;
} Probe;

typedef struct {
    long n;
    const double *p;          /* n x MODEL_NP */
    const BatchInput *inputs; /* MODEL_NU of them */
    double start, tolerance;
    const double *stop;
    long stop_stride, max_steps;
    long n_probes;
    const Probe *probes;
    int with_fold;     /* some output needs the fold of the equilibrium curve */
    double *results;   /* n x n_probes; NaN in rows that failed */
    int *status;       /* n: as kernel_trajectory */
    double *reached;   /* n: the time at which the row ended */
    long *steps;       /* n: accepted internal steps */
} Batch;

KERNEL_EXPORT void batch_trajectories(const Batch *batch);

/* Rest states under constant inputs (n x MODEL_NU values in `u`); of the probes, only `source` and `index` are read.
 * `status` is 0, or NO_REST_STATE. */
KERNEL_EXPORT void batch_rest(long n, const double *p, const double *u, long n_probes, const Probe *probes,
                              double *results, int *status);

#endif

/* A co-simulation master: it steps FMI 2 slaves that somebody else has loaded and initialised.
 *
 * All values live in one array of signals: first those of tables (known functions of time), then the outputs of each
 * slave. An input follows one signal: either held at its value at the start of the step, or interpolated over the
 * step: straight between its ends, or as the cubic that also has the slopes which the source tells for both ends. What
 * is not known at the end of a step yet is extrapolated.
 */
#ifndef MASTER_H
#define MASTER_H

#include <stddef.h>

#if defined(_WIN32)
#define MASTER_EXPORT __declspec(dllexport)
#else
#define MASTER_EXPORT __attribute__((visibility("default")))
#endif

typedef enum { JACOBI, GAUSS_SEIDEL, IMPLICIT } Scheme;

/* One slave: its functions, and what its inputs and outputs are connected to. The arrays stay with the caller. */
typedef struct {
    void *component;
    int (*set_real)(void *, const unsigned *, size_t, const double *);
    int (*set_derivatives)(void *, const unsigned *, size_t, const int *, const double *); /* NULL: cannot interpolate */
    int (*get_real)(void *, const unsigned *, size_t, double *);
    int (*get_derivatives)(void *, const unsigned *, size_t, const int *, double *); /* of outputs; NULL: has none */
    int (*do_step)(void *, double, double, int);
    int (*get_state)(void *, void **); /* NULL: cannot roll back */
    int (*set_state)(void *, void *);
    int (*free_state)(void *, void **);
    int n_inputs;
    const unsigned *inputs;
    const int *signals; /* for each input, the signal it follows */
    const int *held;    /* for each input, whether it keeps its value over the step */
    int n_outputs;
    const unsigned *outputs; /* all that is recorded; signals first, first + 1, ... */
    int first;
    int n_shared;
    const unsigned *shared; /* those outputs that inputs follow ... */
    const int *shared_signals; /* ... and their signals */
} Slave;

/* A known signal: straight between breakpoints, a time listed twice is a jump. Signal i is table i. */
typedef struct {
    long n;
    const double *time, *value;
    long at; /* the breakpoint at or before now */
} Table;

typedef struct {
    Scheme scheme;
    int order;        /* of extrapolation: 0 holds, 1 goes on straight */
    int cubic;        /* interpolate by cubics where the source tells slopes */
    double restart;   /* length of the first step after an event, over `step`; doubled from step to step; 1: none */
    int variable;     /* adapt the step to `tolerance` */
    double start, stop, step;
    double refine;    /* fixed steps with a larger error than this are divided; 0: none (implicit scheme only) */
    double tolerance; /* of the interface, over each signal's scale: iteration (fixed step) or step error (variable) */
    double smallest;  /* step below which the run fails */
    int iterations;   /* at most, in one step */
    int loop_first, loop_last; /* slaves loop_first <= i < loop_last are iterated together */
    int n_unknown;
    const int *unknown; /* signals that are iterated: those that go back to an earlier slave of the loop */
    int n_events;
    const int *events; /* signals that announce the time of the next event */
    int n_watched;
    const int *watched; /* signals whose growing alternation is divergence */
} MasterSettings;

typedef enum {
    MASTER_GOING,    /* the rows given are full; call again */
    MASTER_DONE,     /* the stop time is reached */
    MASTER_SLAVE,    /* slave `where` refused */
    MASTER_DIVERGED, /* signal `where` alternates and grows: the scheme is unstable */
    MASTER_STUCK,    /* the interface did not converge, or the step error stays above its tolerance, signal `where` */
    MASTER_MEMORY,
    MASTER_NOT_FINITE /* signal `where` is not a number */
} MasterStatus;

typedef struct Master Master;

/* `scale` has one typical size for each signal. Slaves are initialised and in step mode. NULL without memory. */
MASTER_EXPORT Master *master_new(const MasterSettings *settings, int n_slaves, const Slave *slaves, int n_tables,
                                 const Table *tables, int n_signals, const double *scale);

/* Steps until the stop time or until `capacity` rows are filled: time, step, iterations, error, then all signals. */
MASTER_EXPORT MasterStatus master_run(Master *master, double *rows, long capacity, long *n_rows, int *where);

/* Totals so far: steps, iterations, rejected steps. */
MASTER_EXPORT void master_counts(const Master *master, long counts[3]);

MASTER_EXPORT void master_free(Master *master);

#endif

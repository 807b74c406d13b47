/* What the master is made of, for its own files: master.c (life, and the walk from point to point), master_tables.c,
 * master_slaves.c, master_steps.c (one step, as long as it may be), master_loop.c (the implicit loop), master_watch.c. */
#ifndef MASTER_STATE_H
#define MASTER_STATE_H

#include "master.h"

#define SAME_TIME 1e-9    /* s: events closer than this to a communication point are on it */
#define WATCHED 16        /* steps that are looked at for divergence */

struct Master {
    MasterSettings settings;
    int n_slaves, n_tables, n_signals;
    Slave *slaves;
    Table *tables;
    double *scale;
    double time, h;    /* now, and the step to try next (variable) */
    long point;        /* the next communication point of the fixed grid is start + (point + 1) * step */
    double *now, *next; /* signals at both ends of the step */
    double *slope;      /* as extrapolated from the last step */
    double *rate, *next_rate; /* slopes at both ends, as the sources tell them; NAN where they do not */
    double *changes;    /* of the last WATCHED steps of each signal, for the watch */
    char *known; /* next[i] is a value at the end of this step */
    double restart;    /* length of the next step after an event; 0 when there was none lately */
    void **state;
    double *guess, *answer, *residual, *last_guess, *last_answer; /* of the unknowns */
    double *gain;                                                  /* d answer / d guess, scaled, kept from step to step */
    double *system;
    int roll_back; /* every slave can */
    int started;
    long steps, iterations, rejected;
    int where;
};

/* Tables: their values and slopes now; the end of a step that would go to `target`, there or at the first event before
 * it (*event says which). */
void master_read_tables(Master *m);
double master_before_events(const Master *m, double target, int *event);

/* Slaves: the number i over a step of h, and its outputs known at the end of it; all outputs; states, kept and taken up
 * again. What is not 0 is a failure of the slave `where`. */
int master_step_slave(Master *m, int i, double h);
void master_now_known(Master *m, int i);
MasterStatus master_read_outputs(Master *m);
int master_save(Master *m);
int master_restore(Master *m, int first, int last);

/* The slaves of the implicit loop over the step, again and again, until what comes out of it is what went in. */
MasterStatus master_iterate(Master *m, double h, double tolerance, int *iterations);

/* One accepted step towards `target`: what it took is in `h`, `iterations`, `error`. */
MasterStatus master_advance(Master *m, double target, double *h, int *iterations, double *error);

/* Whether some signal has begun to swing. */
int master_diverges(Master *m);

#endif

/* The integrator of one trajectory: Rodas5P with steps of its own choice (attempt.h, method.h).
 *
 * It uses the model's exact Jacobian and its exact derivative along time, so that inputs which move during a step cost
 * nothing in order. */
#ifndef ROSENBROCK_H
#define ROSENBROCK_H

#include "model.h" /* first: its names are the user's, and method.h defines some */

#include "method.h"

#define INPUT_ORDER 3                             /* highest input derivative that is used */
#define AT_LEAST_ONE(n) ((n) > 0 ? (n) : 1)       /* C has no arrays of size zero */

/* Inputs as polynomials in time: value and derivatives at `time`. */
typedef struct {
    double time;
    double u[AT_LEAST_ONE(MODEL_NU)][INPUT_ORDER + 1];
} Inputs;

/* One accepted step, with what is needed to interpolate inside it. */
typedef struct {
    double time, h;
    double x[AT_LEAST_ONE(MODEL_NX)], x_new[AT_LEAST_ONE(MODEL_NX)];
    double bend[3][AT_LEAST_ONE(MODEL_NX)]; /* off the straight line; set only where there is an observer */
} Step;

typedef enum {
    SOLVER_OK,
    SOLVER_STOPPED,        /* the observer asked to stop after a step */
    SOLVER_TOO_MANY_STEPS, /* the bound on internal steps was reached */
    SOLVER_STEP_TOO_SMALL, /* no step, however small, meets the tolerance or stays finite */
    SOLVER_BELOW_MINIMUM   /* the same, because a state would leave the range where the equations hold */
} SolverStatus;

/* Called after every accepted step; a non-zero answer stops the integration there. */
typedef int (*Observer)(void *context, const Step *step);

typedef struct {
    const double *p; /* parameters */
    Inputs inputs;
    double tolerance; /* relative to |x| + nominal, per step */
    long max_steps;
    int unbroken;      /* 1: where it begins nothing has jumped since the last call, at most rates */
    double corner;     /* the step size that the last such place allowed; 0: not known yet */
    Observer observer; /* may be NULL */
    void *context;
    long steps, rejected; /* counters, added to */
} Solver;

/* Value and rates of the inputs at `time`. */
void inputs_at(const Inputs *inputs, double time, double *u, double *du);

/* The same polynomials, expanded about `time`. */
void inputs_move(Inputs *inputs, double time);

/* From `*time` to `end`; `x` and `*time` are advanced as far as the integration came, `*h` is the step size to go
 * on with. Where inputs or states may have jumped, its first step resolves the fastest motion, and is at most `*h`. */
SolverStatus solver_advance(Solver *solver, double *time, double end, double *x, double *h);

/* The solution inside an accepted step that was handed to an observer (order 4 in between, exact at both ends), at a
 * time, or at a fraction of the step. */
void step_interpolate(const Step *step, double time, double *x);
static inline void step_within(const Step *step, double f, double *x)
{
    for (int i = 0; i < MODEL_NX; i++)
        x[i] = within(f, step->x[i], step->x_new[i], step->bend[0][i], step->bend[1][i], step->bend[2][i]);
}

#endif

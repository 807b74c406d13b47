/* RODAS4: a stiffly accurate, L-stable Rosenbrock method of order 4 with an embedded order 3.
 *
 * E. Hairer, G. Wanner, "Solving Ordinary Differential Equations II", 2nd ed., section IV.7 and the code RODAS
 * (coefficient set 1). It uses the model's exact Jacobian and its exact derivative along time, so that inputs which
 * move during a step cost nothing in order.
 */
#ifndef ROSENBROCK_H
#define ROSENBROCK_H

#include "model.h"

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
    double c3[AT_LEAST_ONE(MODEL_NX)], c4[AT_LEAST_ONE(MODEL_NX)];
} Step;

typedef enum {
    SOLVER_OK,
    SOLVER_STOPPED,        /* the observer asked to stop after a step */
    SOLVER_TOO_MANY_STEPS, /* the bound on internal steps was reached */
    SOLVER_STEP_TOO_SMALL  /* no step, however small, meets the tolerance or stays finite */
} SolverStatus;

/* Called after every accepted step; a non-zero answer stops the integration there. */
typedef int (*Observer)(void *context, const Step *step);

typedef struct {
    const double *p; /* parameters */
    Inputs inputs;
    double tolerance; /* relative to |x| + nominal, per step */
    long max_steps;
    Observer observer; /* may be NULL */
    void *context;
    long steps, rejected; /* counters, added to */
} Solver;

/* Value and rates of the inputs at `time`. */
void inputs_at(const Inputs *inputs, double time, double *u, double *du);

/* The same polynomials, expanded about `time`. */
void inputs_move(Inputs *inputs, double time);

/* A cautious first step at (time, x) for the present inputs, at most `limit`. */
double solver_first_step(const Solver *solver, double time, const double *x, double limit);

/* From `*time` to `end`; `x` and `*time` are advanced as far as the integration came, `*h` is the step size to go
 * on with. */
SolverStatus solver_advance(Solver *solver, double *time, double end, double *x, double *h);

/* The solution inside an accepted step (order 3 in between, exact at both ends). */
void step_interpolate(const Step *step, double time, double *x);

#endif

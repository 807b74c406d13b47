/* Rodas5P: a stiffly accurate, L-stable Rosenbrock method of order 5 with an embedded order 4, in eight stages.
 *
 * G. Steinebach, "Construction of Rosenbrock-Wanner method Rodas5P and numerical benchmarks within the Julia
 * Differential Equations package", BIT Numerical Mathematics 63:27, 2023. It uses the model's exact Jacobian and its
 * exact derivative along time, so that inputs which move during a step cost nothing in order.
 *
 * Of the family (RODAS, RODASP, Rodas4P2, Rodas5) it needs the fewest stages for an error of 1e-6 in the stretch, in
 * steps, ramps and the snap-through alike: two thirds of RODAS, with half as many steps.
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
    double bend[3][AT_LEAST_ONE(MODEL_NX)]; /* off the straight line; set only where there is an observer */
} Step;

#define LATELY 10 /* attempts: where one of the last ones came to a state's minimum, that is why there is no step */

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
    Observer observer; /* may be NULL */
    void *context;
    long steps, rejected; /* counters, added to */
} Solver;

/* Value and rates of the inputs at `time`. */
void inputs_at(const Inputs *inputs, double time, double *u, double *du);

/* The same polynomials, expanded about `time`. */
void inputs_move(Inputs *inputs, double time);

/* A step that resolves the fastest motion at (time, x) under the present inputs, at most `limit`: where inputs or
 * states have jumped, the step size of before says nothing. */
double solver_first_step(const Solver *solver, double time, const double *x, double limit);

/* From `*time` to `end`; `x` and `*time` are advanced as far as the integration came, `*h` is the step size to go
 * on with. */
SolverStatus solver_advance(Solver *solver, double *time, double end, double *x, double *h);

/* The solution inside an accepted step that was handed to an observer (order 4 in between, exact at both ends). */
void step_interpolate(const Step *step, double time, double *x);

#endif

/* WIDTH trajectories that take their steps at the same time, each with its own time, step size, inputs and parameters.
 *
 * The arithmetic of one lane never looks at another lane, so a trajectory comes out the same to the last bit whichever
 * lane it is in and whatever is in the others. The loops over lanes are written for the compiler to turn into vector
 * instructions; where it cannot, they are merely loops.
 */
#ifndef LANES_H
#define LANES_H

#include "rosenbrock.h"

#define WIDTH 8

enum { NOTHING, JUMPED, CORNER }; /* what inputs have just done: in a corner only their rates jump */

typedef double Lane[WIDTH];

typedef struct {
    /* Set by the caller: where each trajectory stands, and the end of its piece, over which inputs run straight. */
    Lane time, piece_start, piece_end;
    Lane x[AT_LEAST_ONE(MODEL_NX)];
    Lane u[AT_LEAST_ONE(MODEL_NU)], du[AT_LEAST_ONE(MODEL_NU)]; /* inputs at piece_start, and their slopes */
    Lane q[AT_LEAST_ONE(MODEL_NQ)];                             /* the parameters, as model_prepare leaves them */
    Lane wanted;   /* step size to try next; a lane is idle where it is 0 */
    Lane fresh;    /* JUMPED: inputs have, `wanted` is an upper bound only (infinite at the start); CORNER; or NOTHING */
    Lane corner;   /* the step size that the last corner allowed; 0: not known yet */
    Lane cornered; /* 1: the step that is tried is the first behind a corner */
    Lane rejected; /* 1: the last attempt was refused */
    /* Results of the last attempt: a step of size h to x_new, accepted or not, to the end of the piece or not. */
    Lane h, accepted, last;
    Lane below; /* 1: a stage or the end of the last attempt left the range of the equations */
    Lane x_new[AT_LEAST_ONE(MODEL_NX)], bend[3][AT_LEAST_ONE(MODEL_NX)]; /* bend as in Step */
    double tolerance;
} Lanes;

/* One attempt in every lane. */
void lanes_attempt(Lanes *lanes, int with_bend);

/* Moves every lane whose attempt was accepted to the end of its step, and sets all step sizes. */
void lanes_move(Lanes *lanes);

/* The solution of lane `l` at the fraction `s` of its step, before lanes_move. */
void lanes_interpolate(const Lanes *lanes, int l, double s, double *x);

#endif

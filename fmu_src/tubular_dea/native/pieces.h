/* A trajectory as Python hands it over: pieces between points, over which the inputs run straight. */
#ifndef PIECES_H
#define PIECES_H

#include "kernel.h"

#define MAX_STEPS 10000000 /* between two points */

/* Whether piece k is a jump: a time listed twice, or two times that are the same to within rounding. */
int piece_is_jump(const double *points, long k);

/* The first piece that has a length; `points` ascend. */
long piece_first(long n_points, const double *points);

/* Inputs over piece k; `u` has n_points x MODEL_NU values. */
void piece_inputs(Inputs *inputs, const double *points, const double *u, long k);

/* The rates `du` of the inputs at the begin of a piece that follows inputs `before` (NULL: none) with `rates`, which
 * become its own: where both pieces meet, the mean of theirs, as the rate of either is that of half a piece away. */
void piece_rates(const Inputs *inputs, const double *before, double *rates, double *du);

/* The states `x` to start in, under parameters and first inputs: SOLVER_OK, NO_REST_STATE or SOLVER_BELOW_MINIMUM. */
int piece_start(const double *p, const double *u, double *x);

#endif

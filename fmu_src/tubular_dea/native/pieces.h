/* A trajectory as Python hands it over: pieces between points, over which the inputs run straight. */
#ifndef PIECES_H
#define PIECES_H

#include "instance.h"
#include "kernel.h"

#define MAX_STEPS 10000000 /* between two points */

/* The first piece that has a length; `points` ascend, a time listed twice is a jump. */
long piece_first(long n_points, const double *points);

/* Inputs over piece k; `u` has n_points x MODEL_NU values. */
void piece_inputs(Inputs *inputs, const double *points, const double *u, long k);

/* An instance in initialization at `time`, under parameters and first inputs, and the states `x` that it starts in;
 * NULL where there are none: NO_REST_STATE or SOLVER_BELOW_MINIMUM in `status`. The caller frees it. */
Instance *piece_start(const double *p, const double *u, double time, double *x, int *status);

#endif

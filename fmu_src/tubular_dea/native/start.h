/* The states that a simulation starts in, and how they move with inputs and parameters. */
#ifndef START_H
#define START_H

#include "equilibrium.h"

/* Under inputs `u` and parameters `p`: the declared start, or the rest state where the model is told to start there; 0
 * where there is none. */
int start_states(const double *u, const double *p, double *x);

/* The same along the tangents v_u and v_p, at the states `x` that start_states gave. */
void start_tangent(const double *u, const double *p, const double *x, const double *v_u, const double *v_p,
                   double *v_x);

#endif

/* Trajectories with their sensitivities: the derivative of the discrete solution, taken along with its own steps. */
#ifndef TANGENT_H
#define TANGENT_H

#include "kernel.h"

/* A trajectory whose steps end at the times `mesh` (and at the points), and its derivatives.
 *
 * `columns` (n_columns of them) say what is varied: a place in COLUMN_PARAMETER of gradients.h, for a delayed signal its
 * delay. `sizes` are their typical sizes. Writes states and outputs as kernel_trajectory does (the fold is not
 * computed), and, where they are not NULL, the derivatives of the states (n_samples x n_columns x MODEL_NX) and of the
 * observed outputs (n_samples x n_columns x OBSERVED), with the outputs' rates in time (n_samples x OBSERVED). */
KERNEL_EXPORT int kernel_tangents(const double *p, long n_points, const double *points, const double *u, long n_mesh,
                                  const double *mesh, long n_columns, const int *columns, const double *sizes,
                                  long n_samples, const double *samples, double *x, double *y, double *x_tangent,
                                  double *observed_tangent, double *observed_rate, double *reached);

#endif

/* The model and its integrator as a plain library, for Python: whole trajectories without a call per step. */
#ifndef KERNEL_H
#define KERNEL_H

#include "rosenbrock.h"

#if defined(_WIN32)
#define KERNEL_EXPORT __declspec(dllexport)
#else
#define KERNEL_EXPORT __attribute__((visibility("default")))
#endif

#define NO_REST_STATE (-1) /* beside the SolverStatus: there is none to start at */

/* Integrates from points[0] to points[n_points - 1] with inputs that run straight between points (n_points x MODEL_NU
 * values in `u`); a time listed twice is a jump. `p` are the parameters.
 *
 * Writes states (n_samples x MODEL_NX) and outputs (n_samples x MODEL_NY + 1, the fold last; it is computed only if
 * `with_fold`; none at all where `y` is NULL) at the ascending times `samples`; at a jump they carry the values after
 * it. Between two points, no more than `max_steps` steps are tried, and once `total_steps` have been taken, no more
 * at all. `mesh` receives the ends of the steps (of the first `room` ones), `counts` the number of steps and of
 * rejected ones, `reached` the time at which the integration ended. Returns 0, a SolverStatus, or NO_REST_STATE. */
KERNEL_EXPORT int kernel_trajectory(const double *p, long n_points, const double *points, const double *u,
                                    double tolerance, long max_steps, long total_steps, long n_samples,
                                    const double *samples, int with_fold, double *x, double *y, long room,
                                    double *mesh, long *counts, double *reached);

/* The emitted functions at one point, for checks and for those who want the equations alone. */
KERNEL_EXPORT void kernel_derivatives(double time, const double *x, const double *u, const double *du, const double *p,
                                      double *dx);
KERNEL_EXPORT void kernel_jacobian(double time, const double *x, const double *u, const double *du, const double *p,
                                   double *J, double *dx_dt);

/* The equilibrium curve at n values of its unknown: load and slope; and the fold (unknown, load). */
KERNEL_EXPORT int kernel_curve(const double *u, const double *p, long n, const double *unknown, double *load,
                               double *slope, double *fold);

#endif

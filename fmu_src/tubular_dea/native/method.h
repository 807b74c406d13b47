/* What every integration by Rodas5P shares: the sums of its stages, its measure of error, the choice of step sizes
 * (step_control.h). attempt.h puts them together; coefficients and constants are those of rodas5p.h. */
#ifndef METHOD_H
#define METHOD_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "rodas5p.h"

/* Stages. `k` is one component of the first stage, `stride` the distance to the same of the next ------------------- */

/* The newest stage comes last, so that least has to wait for it. */
static inline double weighted(double sum, const double *weights, int n, const double *k, int stride)
{
    for (int j = 0; j < n; j++) sum += weights[j] * k[j * stride];
    return sum;
}

/* Where stage s > 0 stands, of a step from `x`; `before` is where the stage before it stood. */
static inline double stage_place(int s, double x, double before, const double *k, int stride)
{
    return OWN_PLACE[s] ? weighted(x, A[s], s, k, stride) : before + k[(s - 1) * stride];
}

/* The right-hand side of stage s from the rate there and its derivative along time at the start of the step. */
static inline double stage_rhs(int s, double rate, double dx_dt, const double *k, int stride, double h, double inverse_h)
{
    const double drift = DELTA[s] != 0 ? DELTA[s] * h * dx_dt : 0;
    if (s == 0) return rate + drift;
    rate += weighted(0, C[s], s, k, stride) * inverse_h;
    return DELTA[s] != 0 ? rate + drift : rate;
}

/* The solution at the fraction `f` of a step, from its ends and how it bends between them. */
static inline double within(double f, double left, double right, double bend_0, double bend_1, double bend_2)
{
    const double rest = 1 - f;
    return left * rest + f * (right + rest * (bend_0 + f * (bend_1 + f * bend_2)));
}

/* Error and step size ------------------------------------------------------------------------------------------------ */

/* Mean square of n values over their tolerances, of which `scale` holds the inverse. */
static inline double mean_square(int n, const double *scale, const double *value)
{
    double sum = 0;
    for (int i = 0; i < n; i++) {
        const double scaled = value[i] * scale[i];
        sum += scaled * scaled;
    }
    return sum / (n > 0 ? n : 1);
}

/* As in emit/step_control.py, for positive values: of the bits of a double. */
static inline double inverse_root(double value, int n)
{
    const int64_t one = INT64_C(0x3ff) << 52;
    int64_t bits;
    memcpy(&bits, &value, sizeof bits);
    bits = one - (bits - one) / n;
    memcpy(&value, &bits, sizeof value);
    return value;
}

#include "step_control.h"

#endif

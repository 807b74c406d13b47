/* What every integration by Rodas5P shares: the sums of its stages, its measure of error, the choice of step sizes.
 * attempt.h puts them together; coefficients and constants are those of rodas5p.h. */
#ifndef METHOD_H
#define METHOD_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "rodas5p.h"

#define BELOW (-1.0) /* in the place of an error, where a state leaves the range of the equations: no error is negative */

/* Not fmin and fmax: those are calls into the library with some compilers. */
static inline double smaller(double a, double b) { return a < b ? a : b; }
static inline double larger(double a, double b) { return a > b ? a : b; }

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

/* The right side of stage s from the slope there and its derivative along time at the start of the step. */
static inline double stage_right(int s, double slope, double dx_dt, const double *k, int stride, double h, double inverse_h)
{
    const double drift = DELTA[s] != 0 ? DELTA[s] * h * dx_dt : 0;
    if (s == 0) return slope + drift;
    slope += weighted(0, C[s], s, k, stride) * inverse_h;
    return DELTA[s] != 0 ? slope + drift : slope;
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

/* value^(-1/n), up to 7 % too large, for positive values: the bits of a double are nearly its logarithm. Unlike pow()
 * it is the same on every machine with IEEE doubles. */
static inline double inverse_root(double value, int n)
{
    const int64_t one = INT64_C(0x3ff) << 52;
    int64_t bits;
    memcpy(&bits, &value, sizeof bits);
    bits = one - (bits - one) / n;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* By how much a step may grow (or must shrink) for the square of its error; to remember the error before would gain
 * nothing. */
static inline double growth(double error)
{
    if (!(error >= 0 && error < INFINITY)) return LEAST_GROWTH;
    const double factor = SAFETY * inverse_root(larger(error, LEAST_ERROR), GROWTH_ROOT);
    return smaller(LARGEST_GROWTH, larger(LEAST_GROWTH, factor));
}

/* A step that resolves the fastest motion, at most `limit`: where inputs or states have jumped, the step size of before
 * says nothing. Along the solution x'' = J x' + d(x')/dt, and x''' is near J x''; `second` and `third` are their mean
 * squares. Their ratio is the speed of the fastest motion, and x'' over the square of that speed how far it goes; if that
 * is beyond the tolerance, the step has to resolve it. */
static inline double resolving(double second, double third, double limit)
{
    const double speed = third / second, reach = second / (speed * speed); /* squares of both */
    if (!(reach > 1 && reach < INFINITY)) return limit;
    return smaller(limit, inverse_root(RESOLVED * reach, RESOLVING_ROOT) / sqrt(speed));
}

/* Whether a step as large as wanted reaches the end of what is left, or leaves no more than a crumb of it. */
static inline int is_last(double wanted, double left, double time)
{
    return wanted >= left - larger(CRUMB * left, TIME_ROUNDING * fabs(time));
}

static inline int is_too_short(double h, double time) { return !(h > SHORTEST * fabs(time) && h > 1e-300); }

static inline int is_accepted(double error) { return error >= 0 && error <= 1; }

/* The step size to try next, after a step of size `h` with that error where `wanted` was wanted: a step cut short by the
 * end of its piece says little against what was wanted, and one that follows a refusal does not grow. */
static inline double wanted_next(double error, double h, double wanted, int last, int rejected)
{
    const double next = h * growth(error);
    if (!is_accepted(error)) return next;
    return rejected ? smaller(next, h) : last ? larger(next, wanted) : next;
}

#endif

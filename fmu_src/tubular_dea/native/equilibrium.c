#include "equilibrium.h"

#if MODEL_HAS_CURVE

/* Scanning steps along the curve: two folds closer than (UPPER - LOWER) / SCAN are not told apart. */
#define SCAN 100
#define AT_LEAST_ONE_STATE (MODEL_NX > 0 ? MODEL_NX : 1)

/* A function of the unknown whose falling zero is sought. */
typedef double (*Residual)(double unknown, const double *u, const double *p);

static double slope(double unknown, const double *u, const double *p)
{
    double load, rise, x[AT_LEAST_ONE_STATE];
    model_equilibrium(unknown, u, p, &load, &rise, x);
    return rise;
}

static double surplus(double unknown, const double *u, const double *p)
{
    double load, rise, x[AT_LEAST_ONE_STATE];
    model_equilibrium(unknown, u, p, &load, &rise, x);
    return u[CURVE_LOAD] - load;
}

/* The zero between `a` (value positive) and `b` (value not positive): regula falsi with Illinois weights. */
static double zero(Residual f, double a, double b, const double *u, const double *p)
{
    double fa = f(a, u, p), fb = f(b, u, p), middle = b;
    int side = 0;
    for (int i = 0; i < 200 && fb != 0 && b - a > 4e-16 * b; i++) {
        middle = (fa * b - fb * a) / (fa - fb);
        if (!(middle > a && middle < b)) middle = 0.5 * (a + b);
        const double value = f(middle, u, p);
        if (value > 0) {
            a = middle, fa = value;
            if (side == 1) fb *= 0.5;
            side = 1;
        } else if (value < 0) {
            b = middle, fb = value;
            if (side == -1) fa *= 0.5;
            side = -1;
        } else {
            return middle;
        }
    }
    return middle;
}

CurvePoint curve_fold(const double *u, const double *p)
{
    const double width = (CURVE_UPPER - CURVE_FOLD_LOWER) / SCAN;
    CurvePoint fold = {CURVE_UPPER, 0};
    double rise, x[AT_LEAST_ONE_STATE];
    if (!(slope(CURVE_FOLD_LOWER, u, p) > 0)) fold.unknown = CURVE_FOLD_LOWER;
    else
        for (int i = 1; i <= SCAN; i++) {
            const double right = CURVE_FOLD_LOWER + i * width;
            if (slope(right, u, p) > 0) continue;
            fold.unknown = zero(slope, right - width, right, u, p);
            break;
        }
    model_equilibrium(fold.unknown, u, p, &fold.load, &rise, x);
    return fold;
}

CurvePoint curve_fold_near(const double *u, const double *p, double place)
{
    const double width = (CURVE_UPPER - CURVE_FOLD_LOWER) / SCAN;
    const double left = place - width, right = place + width;
    CurvePoint fold;
    double rise, x[AT_LEAST_ONE_STATE];
    if (!(left > CURVE_FOLD_LOWER && right < CURVE_UPPER)) return curve_fold(u, p);
    if (!(slope(left, u, p) > 0) || slope(right, u, p) > 0) return curve_fold(u, p);
    fold.unknown = zero(slope, left, right, u, p);
    model_equilibrium(fold.unknown, u, p, &fold.load, &rise, x);
    return fold;
}

/* Along the branch from its lower end, until the load is reached: where it is, only what lies before it is looked at. */
static int bracket(const double *u, const double *p, double *left, double *right)
{
    const double width = (CURVE_UPPER - CURVE_FOLD_LOWER) / SCAN;
    *left = CURVE_LOWER;
    for (int i = 0; i <= SCAN; i++, *left = *right) {
        double load, rise, x[AT_LEAST_ONE_STATE];
        *right = CURVE_FOLD_LOWER + i * width;
        model_equilibrium(*right, u, p, &load, &rise, x);
        if (!(rise > 0)) { /* the fold is on the way here */
            if (i > 0) *right = zero(slope, *left, *right, u, p);
            return surplus(*right, u, p) <= 0;
        }
        if (u[CURVE_LOAD] - load <= 0) return 1;
    }
    return 0;
}

int curve_rest(const double *u, const double *p, double *unknown, double *x)
{
    double load, rise, left, right;
    if (!(surplus(CURVE_LOWER, u, p) > 0) || !bracket(u, p, &left, &right)) return 0;
    *unknown = zero(surplus, left, right, u, p);
    model_equilibrium(*unknown, u, p, &load, &rise, x);
    return 1;
}

#endif

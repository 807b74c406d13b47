#include "start.h"

#if MODEL_HAS_CURVE

/* Rest states move with inputs and parameters along the curve: the implicit function theorem. */
static void rest_tangent(const double *u, const double *p, double unknown, const double *v_u, const double *v_p,
                         double *v_x)
{
    double load, rise, v_load, x[MODEL_NX];
    model_equilibrium(unknown, u, p, &load, &rise, x);
    model_equilibrium_tangent(unknown, u, p, 0, v_u, v_p, &v_load, v_x);
    model_equilibrium_tangent(unknown, u, p, (v_u[CURVE_LOAD] - v_load) / rise, v_u, v_p, &v_load, v_x);
}

#endif

int start_states(const double *u, const double *p, double *x)
{
#if MODEL_HAS_CURVE
    double unknown;
    if (p[CURVE_SWITCH] != 0) return curve_rest(u, p, &unknown, x);
#endif
    model_start(u, p, x);
    return 1;
}

void start_tangent(const double *u, const double *p, const double *x, const double *v_u, const double *v_p, double *v_x)
{
#if MODEL_HAS_CURVE
    if (p[CURVE_SWITCH] != 0) {
        rest_tangent(u, p, x[CURVE_UNKNOWN], v_u, v_p, v_x);
        return;
    }
#endif
    (void)x;
    model_start_tangent(u, p, v_u, v_p, v_x);
}

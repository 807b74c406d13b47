/* Rest states of a model: its equilibrium curve load = f(unknown), and the fold that ends its first rising branch. */
#ifndef EQUILIBRIUM_H
#define EQUILIBRIUM_H

#include "model.h"

/* A point of the curve. */
typedef struct {
    double unknown, load;
} CurvePoint;

#if MODEL_HAS_CURVE

/* The first local maximum of the load from CURVE_FOLD_LOWER on; the end of the interval where there is none. */
CurvePoint curve_fold(const double *u, const double *p);

/* The same where inputs have changed a little since the fold was at `place`: found at once if it has not gone far. */
CurvePoint curve_fold_near(const double *u, const double *p, double place);

/* The rest state under the inputs `u` on the branch before the fold; 0 where there is none. */
int curve_rest(const double *u, const double *p, double *unknown, double *x);

#endif
#endif

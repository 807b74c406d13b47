/* Integer powers as products, as the generated functions use them. */
#ifndef POWERS_H
#define POWERS_H

static inline double square(double a) { return a * a; }
static inline double cube(double a) { return a * a * a; }
static inline double fourth(double a) { return (a * a) * (a * a); }

#endif

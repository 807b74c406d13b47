/* Delay lines: what delayed signals were, kept with the instance's state, so that saving it is exact.
 *
 * An input's past is kept as the polynomials that the host gave for each communication step: reading it back is exact,
 * and the integrator's steps end where a late breakpoint passes. A definition's past is kept step by step, as the
 * polynomial through six values of the integrator's own interpolation.
 */
#ifndef DELAY_H
#define DELAY_H

#include "instance.h"

/* Values and rates of the delayed inputs at the present time, into their places of `u` and `du`. */
void delay_read_inputs(const Instance *instance, double *u, double *du);

/* Values of the delayed definitions now; `y` are the outputs as they would be without them. */
void delay_read_outputs(const Instance *instance, const double *y, double *u, double *du);

/* From now to `end`, the inputs run as the instance has them: keeps that. */
void delay_keep_inputs(Instance *instance, double end);

/* Where, before `end`, a breakpoint of a delayed input comes next; `end` if there is none. */
double delay_next(const Instance *instance, double end);

/* Sets the polynomials of the delayed inputs from the present time on, up to delay_next. */
void delay_drive(const Instance *instance, Inputs *inputs);

/* Keeps the delayed definitions over a step that was taken under `inputs`. */
void delay_keep_outputs(Instance *instance, const Inputs *inputs, const Step *step);

/* 1 where a change of the signal is seen at once: before the first step, or without delay. */
int delay_is_open(const Instance *instance, int line);

#endif

/* One step, in parts where it cannot be taken whole. */
#include "master_state.h"

#include <math.h>
#include <string.h>

#define FINEST 0.04       /* of the step: fixed steps shorter than this are not divided */

static MasterStatus explicit_step(Master *m, int first, int last, double h)
{
    for (int i = first; i < last; i++) {
        if (master_step_slave(m, i, h)) return MASTER_SLAVE;
        if (m->settings.scheme != JACOBI) master_now_known(m, i);
    }
    return MASTER_GOING;
}

static MasterStatus try_step(Master *m, double h, int *iterations)
{
    const MasterSettings *p = &m->settings;
    const int loop = p->scheme == IMPLICIT && p->n_unknown > 0;
    memset(m->known, 0, (size_t)m->n_signals);
    *iterations = 1;
    MasterStatus status = explicit_step(m, 0, loop ? p->loop_first : m->n_slaves, h);
    if (!loop || status != MASTER_GOING) return status;
    status = master_iterate(m, h, p->variable ? 1e-2 * p->tolerance : p->tolerance, iterations);
    return status == MASTER_GOING ? explicit_step(m, p->loop_last, m->n_slaves, h) : status;
}

/* How far the interface went from the straight line of the last step, over its scale: what interpolation misses. Of a
 * step that is shorter than the longest, only that part counts: what is missed is missed for a shorter time. */
static double step_error(Master *m, double h)
{
    const double part = fmin(1, h / m->settings.step) / 6;
    double largest = 0;
    for (int i = 0; i < m->settings.n_watched; i++) {
        const int k = m->settings.watched[i];
        const double error = part * fabs(m->next[k] - m->now[k] - m->slope[k] * h) / m->scale[k];
        if (!(error <= largest)) largest = error, m->where = k;
    }
    return largest;
}

/* Steps that were tried and did not do: back to the start of the step. */
static int back(Master *m)
{
    m->rejected++;
    return master_restore(m, 0, m->n_slaves);
}

/* Whether a step that was taken has to be taken again in parts. Fixed steps are divided a few times at most. */
static int too_long(const Master *m, double error, double h)
{
    const MasterSettings *p = &m->settings;
    if (p->variable) return !(error <= p->tolerance);
    return p->scheme == IMPLICIT && p->refine > 0 && error > p->refine && h > FINEST * p->step;
}

/* One accepted step towards `target`; what it took is in `h`, `iterations`, `error`. A step that cannot be taken
 * (no convergence, a slave that refuses a guess, too large an error) is tried again with a part of its length. */
MasterStatus master_advance(Master *m, double target, double *h, int *iterations, double *error)
{
    const MasterSettings *p = &m->settings;
    const int again = m->roll_back && (p->scheme == IMPLICIT || p->variable);
    *h = target - m->time;
    if (again && master_save(m)) return MASTER_SLAVE;
    for (;;) {
        const MasterStatus status = try_step(m, *h, iterations);
        *error = status == MASTER_GOING ? step_error(m, *h) : INFINITY;
        if (status == MASTER_GOING && !(again && too_long(m, *error, *h))) return status;
        if (!again) return status;
        if (*h <= p->smallest * (1 + 1e-9)) return status == MASTER_GOING ? MASTER_STUCK : status;
        if (back(m)) return MASTER_SLAVE;
        const double limit = p->variable ? p->tolerance : p->refine;
        const double shrink = isfinite(*error) ? 0.9 * cbrt(limit / *error) : 0.5;
        *h = fmax(p->smallest, *h * fmin(0.5, fmax(0.1, shrink)));
        if (!p->variable) m->restart = *h; /* and then a little further each time */
    }
}

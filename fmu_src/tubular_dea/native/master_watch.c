/* Divergence, seen in time. */
#include "master_state.h"

#include <math.h>

#define TURNS 7           /* of WATCHED steps: a signal turns at least so often ... */
#define LEAST_SWING 1e-2  /* ... by at least this part of its scale, and does not calm down */

/* Divergence: a signal that turns back and forth every step or two, by as much as before or more. Only turns that are
 * no rounding count: by more than `least` on both sides. */
static int swings(const double *changes, long newest, double least)
{
    double older = 0, newer = 0;
    int turns = 0;
    for (long i = 0; i < WATCHED; i++) {
        const double change = changes[(newest + 1 + i) % WATCHED];
        const double last = i > 0 ? changes[(newest + i) % WATCHED] : 0;
        turns += change * last < 0 && fmin(fabs(change), fabs(last)) > least;
        if (i < WATCHED / 2) older += fabs(change);
        else newer += fabs(change);
    }
    return turns >= TURNS && newer >= 0.9 * older;
}

int master_diverges(Master *m)
{
    for (int i = 0; i < m->settings.n_watched; i++) {
        const int k = m->settings.watched[i];
        double *changes = m->changes + WATCHED * k;
        changes[m->steps % WATCHED] = m->next[k] - m->now[k];
        m->where = k;
        if (!isfinite(m->next[k]) || swings(changes, m->steps % WATCHED, LEAST_SWING * m->scale[k])) return 1;
    }
    return 0;
}

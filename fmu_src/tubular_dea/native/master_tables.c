/* Tables, and the events at which a step ends. */
#include "master_state.h"

#include <math.h>

/* The value of a table at the present time (after a jump there), and its slope until its next breakpoint. */
static double table_value(Table *t, double time, double *slope)
{
    while (t->at + 1 < t->n && t->time[t->at + 1] <= time + SAME_TIME) t->at++;
    *slope = 0;
    if (t->at + 1 >= t->n || time < t->time[0]) return t->value[t->at];
    *slope = (t->value[t->at + 1] - t->value[t->at]) / (t->time[t->at + 1] - t->time[t->at]);
    return t->value[t->at] + *slope * fmax(0, time - t->time[t->at]);
}

void master_read_tables(Master *m)
{
    for (int i = 0; i < m->n_tables; i++) m->now[i] = table_value(&m->tables[i], m->time, &m->slope[i]);
}

/* An event at or before the end of the step ends it. */
static void earlier(double at, double *target, int *event)
{
    if (at > *target + SAME_TIME) return;
    if (at < *target - SAME_TIME) *target = at;
    *event = 1;
}

/* The end of the step that would go to `target`: there, or at the first event before it; *event says which. */
double master_before_events(const Master *m, double target, int *event)
{
    *event = 0;
    for (int i = 0; i < m->n_tables; i++) {
        const Table *t = &m->tables[i];
        if (t->at + 1 < t->n) earlier(t->time[t->at + 1], &target, event);
    }
    for (int i = 0; i < m->settings.n_events; i++) {
        const double at = m->now[m->settings.events[i]];
        if (at > m->time + SAME_TIME) earlier(at, &target, event);
    }
    return target;
}

/* One slave over a step: how its inputs go, what it tells at the end. */
#include "master_state.h"

#include <math.h>

#define MAX_INPUTS 64

/* How a signal goes over the step: value, and derivatives of order 1 to 3, at its start. */
static void course(const Master *m, int signal, int held, double h, double u[4])
{
    u[0] = m->now[signal];
    u[1] = u[2] = u[3] = 0;
    if (held) return;
    if (signal < m->n_tables) {
        u[1] = m->slope[signal];
        return;
    }
    if (!m->known[signal]) {
        if (m->settings.order > 0) u[1] = m->slope[signal];
        return;
    }
    const double straight = (m->next[signal] - m->now[signal]) / h;
    const double first = m->rate[signal], last = m->next_rate[signal];
    u[1] = straight;
    if (!m->settings.cubic || isnan(first) || isnan(last)) return;
    u[1] = first;
    u[2] = 2 * (3 * straight - 2 * first - last) / h;
    u[3] = 6 * (first + last - 2 * straight) / (h * h);
}

/* Gives the slave its inputs for the step; one that cannot interpolate gets their mean. */
static int set_inputs(Master *m, const Slave *s, double h)
{
    double value[MAX_INPUTS], derivative[3 * MAX_INPUTS], u[4];
    unsigned reference[3 * MAX_INPUTS];
    int order[3 * MAX_INPUTS];
    size_t n = 0;
    if (s->n_inputs == 0) return 0;
    for (int i = 0; i < s->n_inputs; i++) {
        course(m, s->signals[i], s->held[i], h, u);
        value[i] = u[0];
        if (!s->set_derivatives) value[i] += h * (u[1] / 2 + h * (u[2] / 6 + h * u[3] / 24));
        for (int k = 1; k <= 3; k++) {
            if (k > 1 && u[2] == 0 && u[3] == 0) break;
            reference[n] = s->inputs[i];
            order[n] = k;
            derivative[n++] = u[k];
        }
    }
    if (s->set_real(s->component, s->inputs, (size_t)s->n_inputs, value) > 1) return 1;
    return s->set_derivatives && s->set_derivatives(s->component, reference, n, order, derivative) > 1;
}

/* The slopes of the shared outputs at the end of the step, for the slopes the inputs have there. */
static int read_rates(Master *m, const Slave *s, double h)
{
    double value[MAX_INPUTS], u[4];
    int first[MAX_INPUTS];
    for (int k = 0; k < s->n_shared; k++) m->next_rate[s->shared_signals[k]] = NAN;
    if (!m->settings.cubic || !s->get_derivatives) return 0;
    for (int i = 0; i < s->n_inputs; i++) {
        course(m, s->signals[i], s->held[i], h, u);
        value[i] = u[1] + h * (u[2] + h * u[3] / 2);
        first[i] = 1;
    }
    if (s->set_derivatives && s->n_inputs && s->set_derivatives(s->component, s->inputs, (size_t)s->n_inputs, first, value) > 1)
        return 1;
    for (int k = 0; k < s->n_shared; k++) first[k] = 1;
    if (s->get_derivatives(s->component, s->shared, (size_t)s->n_shared, first, value) > 1) return 1;
    for (int k = 0; k < s->n_shared; k++) m->next_rate[s->shared_signals[k]] = value[k];
    return 0;
}

int master_step_slave(Master *m, int i, double h)
{
    const Slave *s = &m->slaves[i];
    double shared[MAX_INPUTS];
    m->where = i;
    if (set_inputs(m, s, h)) return 1;
    if (s->do_step(s->component, m->time, h, !(m->settings.scheme == IMPLICIT || m->settings.variable)) != 0) return 1;
    if (s->n_shared == 0) return 0;
    if (s->get_real(s->component, s->shared, (size_t)s->n_shared, shared) > 1 || read_rates(m, s, h)) return 1;
    for (int k = 0; k < s->n_shared; k++) m->next[s->shared_signals[k]] = shared[k];
    return 0;
}

void master_now_known(Master *m, int i)
{
    for (int k = 0; k < m->slaves[i].n_shared; k++) m->known[m->slaves[i].shared_signals[k]] = 1;
}

int master_save(Master *m)
{
    for (int i = 0; i < m->n_slaves; i++) {
        m->where = i;
        if (m->slaves[i].get_state(m->slaves[i].component, &m->state[i]) > 1) return 1;
    }
    return 0;
}

int master_restore(Master *m, int first, int last)
{
    for (int i = first; i < last; i++) {
        m->where = i;
        if (m->slaves[i].set_state(m->slaves[i].component, m->state[i]) > 1) return 1;
    }
    return 0;
}

MasterStatus master_read_outputs(Master *m)
{
    for (int i = 0; i < m->n_slaves; i++) {
        const Slave *s = &m->slaves[i];
        m->where = i;
        if (s->n_outputs && s->get_real(s->component, s->outputs, (size_t)s->n_outputs, m->next + s->first) > 1)
            return MASTER_SLAVE;
    }
    return MASTER_GOING;
}

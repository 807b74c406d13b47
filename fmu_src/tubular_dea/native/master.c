#include "master_state.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SHORT_STEP 1e-3   /* of the step: too short to tell a slope from */

/* Life ---------------------------------------------------------------------------------------------------------- */

static void *copy(const void *from, size_t size)
{
    void *to = malloc(size ? size : 1);
    if (to && size) memcpy(to, from, size);
    return to;
}

static void *zeros(size_t n, size_t size) { return calloc(n ? n : 1, size); }

void master_free(Master *m)
{
    if (!m) return;
    for (int i = 0; m->state && i < m->n_slaves; i++)
        if (m->state[i]) m->slaves[i].free_state(m->slaves[i].component, &m->state[i]);
    void *all[] = {m->slaves, m->tables, m->scale, m->now, m->next, m->slope, m->rate, m->next_rate, m->changes, m->known,
                   m->state, m->guess, m->answer, m->residual, m->last_guess, m->last_answer, m->gain, m->system};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) free(all[i]);
    free(m);
}

static int allocate(Master *m)
{
    const size_t n = (size_t)m->n_signals, k = 2 * (size_t)m->settings.n_unknown;
    m->now = zeros(n, sizeof(double));
    m->next = zeros(n, sizeof(double));
    m->slope = zeros(n, sizeof(double));
    m->rate = zeros(n, sizeof(double));
    m->next_rate = zeros(n, sizeof(double));
    m->changes = zeros(WATCHED * n, sizeof(double));
    m->known = zeros(n, 1);
    m->state = zeros((size_t)m->n_slaves, sizeof(void *));
    m->guess = zeros(k, sizeof(double));
    m->answer = zeros(k, sizeof(double));
    m->residual = zeros(k, sizeof(double));
    m->last_guess = zeros(k, sizeof(double));
    m->last_answer = zeros(k, sizeof(double));
    m->gain = zeros(k * k, sizeof(double));
    m->system = zeros(k * (k + 1), sizeof(double));
    return m->slaves && m->tables && m->scale && m->now && m->next && m->slope && m->rate && m->next_rate && m->changes &&
           m->known && m->state && m->guess && m->answer && m->residual && m->last_guess && m->last_answer && m->gain &&
           m->system;
}

Master *master_new(const MasterSettings *settings, int n_slaves, const Slave *slaves, int n_tables, const Table *tables,
                   int n_signals, const double *scale)
{
    Master *m = calloc(1, sizeof *m);
    if (!m) return NULL;
    m->settings = *settings;
    m->n_slaves = n_slaves;
    m->n_tables = n_tables;
    m->n_signals = n_signals;
    m->slaves = copy(slaves, (size_t)n_slaves * sizeof *slaves);
    m->tables = copy(tables, (size_t)n_tables * sizeof *tables);
    m->scale = copy(scale, (size_t)n_signals * sizeof *scale);
    if (!allocate(m)) {
        m->n_slaves = 0;
        master_free(m);
        return NULL;
    }
    m->time = settings->start;
    m->h = settings->step;
    m->roll_back = 1;
    for (int i = 0; i < n_slaves; i++) m->roll_back = m->roll_back && slaves[i].get_state;
    return m;
}

void master_counts(const Master *m, long counts[3])
{
    counts[0] = m->steps;
    counts[1] = m->iterations;
    counts[2] = m->rejected;
}

/* The walk from point to point ---------------------------------------------------------------------------------- */

/* After an accepted step: all outputs, the slopes to go on with, the time. */
static MasterStatus take(Master *m, double end, double h)
{
    if (master_read_outputs(m) != MASTER_GOING) return MASTER_SLAVE;
    const int diverged = m->settings.scheme != IMPLICIT && master_diverges(m);
    for (int k = m->n_tables; k < m->n_signals; k++) {
        if (h > SHORT_STEP * m->settings.step) m->slope[k] = (m->next[k] - m->now[k]) / h;
        m->now[k] = m->next[k];
        m->rate[k] = m->next_rate[k];
    }
    m->time = end;
    m->steps++;
    return diverged ? MASTER_DIVERGED : MASTER_GOING;
}

static double *record(const Master *m, double *row, double h, int iterations, double error)
{
    row[0] = m->time;
    row[1] = h;
    row[2] = iterations;
    row[3] = error;
    memcpy(row + 4, m->now, (size_t)m->n_signals * sizeof *row);
    return row + 4 + m->n_signals;
}

/* Where the next step should end: a point of the grid, or as far as the step error lets it; an event if it comes
 * first; and near after an event, where things change fast, only a little further each time. */
static double target(Master *m, int *event)
{
    const MasterSettings *p = &m->settings;
    double wanted = p->variable ? m->time + m->h : p->start + (double)(m->point + 1) * p->step;
    if (m->restart > 0) {
        if (m->time + 1.5 * m->restart < wanted) wanted = m->time + m->restart;
        m->restart = m->restart < p->step ? 2 * m->restart : 0;
    }
    wanted = master_before_events(m, wanted > p->stop - SAME_TIME ? p->stop : wanted, event);
    return wanted;
}

static MasterStatus begin(Master *m)
{
    m->started = 1;
    if (master_read_outputs(m) != MASTER_GOING) return MASTER_SLAVE;
    memcpy(m->now, m->next, (size_t)m->n_signals * sizeof *m->now);
    for (int k = 0; k < m->n_signals; k++) m->rate[k] = m->next_rate[k] = NAN;
    if (m->settings.restart < 1) m->restart = m->settings.restart * m->settings.step;
    master_read_tables(m);
    return MASTER_GOING;
}

/* From one communication point to the next; *h, *iterations and *error as in master_advance(). */
static MasterStatus go(Master *m, double *h, int *iterations, double *error)
{
    const MasterSettings *p = &m->settings;
    const double start = m->time;
    int event;
    master_read_tables(m);
    const double end = target(m, &event);
    MasterStatus status = master_advance(m, end, h, iterations, error);
    if (status != MASTER_GOING) return status;
    const int whole = start + *h >= end - 1e-3 * SAME_TIME;
    status = take(m, whole ? end : start + *h, *h);
    if (whole && event && p->restart < 1) m->restart = p->restart * p->step;
    if (!p->variable && m->time >= p->start + (double)(m->point + 1) * p->step - SAME_TIME) m->point++;
    if (p->variable) m->h = fmin(p->step, *h * fmin(2, 0.9 * cbrt(p->tolerance / fmax(*error, 1e-12 * p->tolerance))));
    master_read_tables(m);
    return status;
}

MasterStatus master_run(Master *m, double *rows, long capacity, long *n_rows, int *where)
{
    MasterStatus status = MASTER_GOING;
    double *row = rows, h = 0, error = 0;
    int iterations = 0;
    *n_rows = 0;
    if (!m->started) {
        status = begin(m);
        if (status == MASTER_GOING) row = record(m, row, 0, 0, 0), ++*n_rows;
    }
    while (status == MASTER_GOING && *n_rows < capacity && m->time < m->settings.stop - SAME_TIME) {
        const long steps = m->steps;
        status = go(m, &h, &iterations, &error);
        if (m->steps > steps) row = record(m, row, h, iterations, error), ++*n_rows;
    }
    *where = m->where;
    if (status == MASTER_GOING && m->time >= m->settings.stop - SAME_TIME) return MASTER_DONE;
    return status;
}

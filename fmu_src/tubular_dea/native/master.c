#include "master.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SAME_TIME 1e-9    /* s: events closer than this to a communication point are on it */
#define WATCHED 16        /* steps that are looked at for divergence ... */
#define TURNS 7           /* ... in which a signal turns at least so often ... */
#define LEAST_SWING 1e-2  /* ... by at least this part of its scale, and does not calm down */
#define FINEST 0.04       /* of the step: fixed steps shorter than this are not divided */
#define SHORT_STEP 1e-3   /* of the step: too short to tell a slope from */
#define MAX_INPUTS 64

struct Master {
    Plan plan;
    int n_slaves, n_tables, n_signals;
    Slave *slaves;
    Table *tables;
    double *scale;
    double time, h;    /* now, and the step to try next (variable) */
    long point;        /* the next communication point of the fixed grid is start + (point + 1) * step */
    double *now, *next; /* signals at both ends of the step */
    double *slope;      /* as extrapolated from the last step */
    double *rate, *next_rate; /* slopes at both ends, as the sources tell them; NAN where they do not */
    double *changes;    /* of the last WATCHED steps of each signal, for the watch */
    char *known; /* next[i] is a value at the end of this step */
    double restart;    /* length of the next step after an event; 0 when there was none lately */
    void **state;
    double *guess, *answer, *residual, *last_guess, *last_answer; /* of the unknowns */
    double *gain;                                                  /* d answer / d guess, scaled, kept from step to step */
    double *system;
    int roll_back; /* every slave can */
    int started;
    long steps, iterations, rejected;
    int where;
};

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
    const size_t n = (size_t)m->n_signals, k = 2 * (size_t)m->plan.n_unknown;
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

Master *master_new(const Plan *plan, int n_slaves, const Slave *slaves, int n_tables, const Table *tables,
                   int n_signals, const double *scale)
{
    Master *m = calloc(1, sizeof *m);
    if (!m) return NULL;
    m->plan = *plan;
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
    m->time = plan->start;
    m->h = plan->step;
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

/* Tables -------------------------------------------------------------------------------------------------------- */

/* The value of a table at the present time (after a jump there), and its slope until its next breakpoint. */
static double table_value(Table *t, double time, double *slope)
{
    while (t->at + 1 < t->n && t->time[t->at + 1] <= time + SAME_TIME) t->at++;
    *slope = 0;
    if (t->at + 1 >= t->n || time < t->time[0]) return t->value[t->at];
    *slope = (t->value[t->at + 1] - t->value[t->at]) / (t->time[t->at + 1] - t->time[t->at]);
    return t->value[t->at] + *slope * fmax(0, time - t->time[t->at]);
}

static void read_tables(Master *m)
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
static double before_events(const Master *m, double target, int *event)
{
    *event = 0;
    for (int i = 0; i < m->n_tables; i++) {
        const Table *t = &m->tables[i];
        if (t->at + 1 < t->n) earlier(t->time[t->at + 1], &target, event);
    }
    for (int i = 0; i < m->plan.n_events; i++) {
        const double at = m->now[m->plan.events[i]];
        if (at > m->time + SAME_TIME) earlier(at, &target, event);
    }
    return target;
}

/* One slave ----------------------------------------------------------------------------------------------------- */

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
        if (m->plan.order > 0) u[1] = m->slope[signal];
        return;
    }
    const double straight = (m->next[signal] - m->now[signal]) / h;
    const double first = m->rate[signal], last = m->next_rate[signal];
    u[1] = straight;
    if (!m->plan.cubic || isnan(first) || isnan(last)) return;
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
    if (!m->plan.cubic || !s->get_derivatives) return 0;
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

static int step_slave(Master *m, int i, double h)
{
    const Slave *s = &m->slaves[i];
    double shared[MAX_INPUTS];
    m->where = i;
    if (set_inputs(m, s, h)) return 1;
    if (s->do_step(s->component, m->time, h, !(m->plan.scheme == IMPLICIT || m->plan.variable)) != 0) return 1;
    if (s->n_shared == 0) return 0;
    if (s->get_real(s->component, s->shared, (size_t)s->n_shared, shared) > 1 || read_rates(m, s, h)) return 1;
    for (int k = 0; k < s->n_shared; k++) m->next[s->shared_signals[k]] = shared[k];
    return 0;
}

static void now_known(Master *m, int i)
{
    for (int k = 0; k < m->slaves[i].n_shared; k++) m->known[m->slaves[i].shared_signals[k]] = 1;
}

static int save(Master *m)
{
    for (int i = 0; i < m->n_slaves; i++) {
        m->where = i;
        if (m->slaves[i].get_state(m->slaves[i].component, &m->state[i]) > 1) return 1;
    }
    return 0;
}

static int restore(Master *m, int first, int last)
{
    for (int i = first; i < last; i++) {
        m->where = i;
        if (m->slaves[i].set_state(m->slaves[i].component, m->state[i]) > 1) return 1;
    }
    return 0;
}

/* Schemes ------------------------------------------------------------------------------------------------------- */

static MasterStatus explicit_step(Master *m, int first, int last, double h)
{
    for (int i = first; i < last; i++) {
        if (step_slave(m, i, h)) return MASTER_SLAVE;
        if (m->plan.scheme != JACOBI) now_known(m, i);
    }
    return MASTER_GOING;
}

/* The unknowns of the loop are values at the end of the step and, for cubics, slopes there: value k, then slope k.
 * A slope counts as far as it moves the cubic: 4/27 of it times the step. */
static double unit(const Master *m, int k, double h)
{
    const int n = m->plan.n_unknown;
    const double scale = m->scale[m->plan.unknown[k % n]];
    return k < n ? scale : scale * 27 / (4 * h);
}

static int n_unknowns(const Master *m) { return m->plan.n_unknown * (m->plan.cubic ? 2 : 1); }

/* Residuals over their units, and the largest of them. A slope that nobody tells is no unknown. */
static double worst(Master *m, double h)
{
    double largest = 0;
    for (int k = 0; k < n_unknowns(m); k++) {
        m->residual[k] = (m->answer[k] - m->guess[k]) / unit(m, k, h);
        if (k >= m->plan.n_unknown && isnan(m->answer[k])) m->residual[k] = 0;
        if (!(fabs(m->residual[k]) <= largest)) largest = fabs(m->residual[k]), m->where = m->plan.unknown[k % m->plan.n_unknown];
    }
    return largest;
}

/* By how much unknown k has changed since the last guess (or answer), over its unit. */
static double moved(const Master *m, const double *now, const double *last, int k, double h)
{
    const double change = (now[k] - last[k]) / unit(m, k, h);
    return isnan(change) ? 0 : change;
}

/* Broyden's update of the gain from the last two guesses; steps lost in the slaves' own accuracy teach nothing. */
static void learn(Master *m, double h, double tolerance)
{
    const int n = n_unknowns(m);
    double length = 0;
    for (int k = 0; k < n; k++) length += moved(m, m->guess, m->last_guess, k, h) * moved(m, m->guess, m->last_guess, k, h);
    if (!(length > tolerance * tolerance)) return;
    for (int i = 0; i < n; i++) {
        double error = moved(m, m->answer, m->last_answer, i, h);
        for (int k = 0; k < n; k++) error -= m->gain[i * n + k] * moved(m, m->guess, m->last_guess, k, h);
        for (int k = 0; k < n; k++) m->gain[i * n + k] += error * moved(m, m->guess, m->last_guess, k, h) / length;
    }
}

/* guess += (1 - gain)^-1 residual; plain iteration, and nothing learned, where that matrix is singular. */
static void improve(Master *m, double h)
{
    const int n = n_unknowns(m), w = n + 1;
    double *a = m->system;
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < n; k++) a[i * w + k] = (i == k) - m->gain[i * n + k];
        a[i * w + n] = m->residual[i];
    }
    for (int k = 0; k < n; k++) {
        int best = k;
        for (int i = k + 1; i < n; i++)
            if (fabs(a[i * w + k]) > fabs(a[best * w + k])) best = i;
        if (!(fabs(a[best * w + k]) > 1e-6)) {
            memcpy(m->guess, m->answer, (size_t)n * sizeof *m->guess);
            memset(m->gain, 0, (size_t)(n * n) * sizeof *m->gain);
            return;
        }
        for (int j = 0; best != k && j < w; j++) {
            const double swap = a[k * w + j];
            a[k * w + j] = a[best * w + j];
            a[best * w + j] = swap;
        }
        for (int i = 0; i < n; i++) {
            const double f = i == k ? 0 : a[i * w + k] / a[k * w + k];
            for (int j = k; f != 0 && j < w; j++) a[i * w + j] -= f * a[k * w + j];
        }
    }
    for (int k = 0; k < n; k++) m->guess[k] += unit(m, k, h) * a[k * w + n] / a[k * w + k];
}

/* One pass through the loop's slaves with the present guess, which stays with them until the loop is closed. */
static MasterStatus pass(Master *m, double h)
{
    const Plan *p = &m->plan;
    const int n = p->n_unknown, slopes = p->cubic;
    for (int k = 0; k < n; k++) {
        m->next[p->unknown[k]] = m->guess[k];
        m->next_rate[p->unknown[k]] = slopes ? m->guess[n + k] : NAN;
        m->known[p->unknown[k]] = 1;
    }
    for (int i = p->loop_first; i < p->loop_last; i++) {
        if (step_slave(m, i, h)) return MASTER_SLAVE;
        now_known(m, i);
        for (int k = 0; k < n; k++) {
            const int signal = p->unknown[k];
            if (signal < m->slaves[i].first || signal >= m->slaves[i].first + m->slaves[i].n_outputs) continue;
            m->answer[k] = m->next[signal];
            m->next[signal] = m->guess[k];
            if (slopes) m->answer[n + k] = m->next_rate[signal];
            if (slopes) m->next_rate[signal] = m->guess[n + k];
        }
    }
    return MASTER_GOING;
}

static void first_guess(Master *m, double h)
{
    const int n = m->plan.n_unknown;
    for (int k = 0; k < n; k++) {
        const int signal = m->plan.unknown[k];
        const double rate = m->plan.cubic ? m->rate[signal] : NAN;
        m->guess[k] = m->now[signal] + (isnan(rate) ? m->slope[signal] : rate) * h;
        if (m->plan.cubic) m->guess[n + k] = rate;
    }
}

/* A slope that was not told at the start of the step (but is at its end) is guessed as it is then. */
static void first_slopes(Master *m)
{
    const int n = m->plan.n_unknown;
    for (int k = n; k < n_unknowns(m); k++)
        if (isnan(m->guess[k])) m->guess[k] = m->answer[k];
}

/* The loop's slaves over the step, again and again, until what comes out of the loop is what went in. */
static MasterStatus iterate(Master *m, double h, double tolerance, int *iterations)
{
    const Plan *p = &m->plan;
    const int n = p->n_unknown;
    const size_t bytes = (size_t)n_unknowns(m) * sizeof *m->guess;
    first_guess(m, h);
    for (*iterations = 1;; ++*iterations) {
        if (*iterations > 1 && restore(m, p->loop_first, p->loop_last)) return MASTER_SLAVE;
        const MasterStatus status = pass(m, h);
        if (status != MASTER_GOING) return status;
        m->iterations++;
        first_slopes(m);
        const double size = worst(m, h);
        if (!isfinite(size)) return MASTER_NOT_FINITE;
        if (*iterations > 1) learn(m, h, 1e-3 * tolerance);
        if (size <= tolerance) break;
        if (*iterations >= p->iterations) return MASTER_STUCK;
        memcpy(m->last_guess, m->guess, bytes);
        memcpy(m->last_answer, m->answer, bytes);
        improve(m, h);
    }
    for (int k = 0; k < n; k++) {
        m->next[p->unknown[k]] = m->answer[k];
        m->next_rate[p->unknown[k]] = p->cubic ? m->answer[n + k] : NAN;
    }
    return MASTER_GOING;
}

static MasterStatus try_step(Master *m, double h, int *iterations)
{
    const Plan *p = &m->plan;
    const int loop = p->scheme == IMPLICIT && p->n_unknown > 0;
    memset(m->known, 0, (size_t)m->n_signals);
    *iterations = 1;
    MasterStatus status = explicit_step(m, 0, loop ? p->loop_first : m->n_slaves, h);
    if (!loop || status != MASTER_GOING) return status;
    status = iterate(m, h, p->variable ? 1e-2 * p->tolerance : p->tolerance, iterations);
    return status == MASTER_GOING ? explicit_step(m, p->loop_last, m->n_slaves, h) : status;
}

/* How far the interface went from the straight line of the last step, over its scale: what interpolation misses. Of a
 * step that is shorter than the longest, only that part counts: what is missed is missed for a shorter time. */
static double step_error(Master *m, double h)
{
    const double part = fmin(1, h / m->plan.step) / 6;
    double largest = 0;
    for (int i = 0; i < m->plan.n_watched; i++) {
        const int k = m->plan.watched[i];
        const double error = part * fabs(m->next[k] - m->now[k] - m->slope[k] * h) / m->scale[k];
        if (!(error <= largest)) largest = error, m->where = k;
    }
    return largest;
}

/* Steps that were tried and did not do: back to the start of the step. */
static int back(Master *m)
{
    m->rejected++;
    return restore(m, 0, m->n_slaves);
}

/* Whether a step that was taken has to be taken again in parts. Fixed steps are divided a few times at most. */
static int too_long(const Master *m, double error, double h)
{
    const Plan *p = &m->plan;
    if (p->variable) return !(error <= p->tolerance);
    return p->scheme == IMPLICIT && p->refine > 0 && error > p->refine && h > FINEST * p->step;
}

/* One accepted step towards `target`; what it took is in `h`, `iterations`, `error`. A step that cannot be taken
 * (no convergence, a slave that refuses a guess, too large an error) is tried again with a part of its length. */
static MasterStatus advance(Master *m, double target, double *h, int *iterations, double *error)
{
    const Plan *p = &m->plan;
    const int again = m->roll_back && (p->scheme == IMPLICIT || p->variable);
    *h = target - m->time;
    if (again && save(m)) return MASTER_SLAVE;
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

static int diverges(Master *m)
{
    for (int i = 0; i < m->plan.n_watched; i++) {
        const int k = m->plan.watched[i];
        double *changes = m->changes + WATCHED * k;
        changes[m->steps % WATCHED] = m->next[k] - m->now[k];
        m->where = k;
        if (!isfinite(m->next[k]) || swings(changes, m->steps % WATCHED, LEAST_SWING * m->scale[k])) return 1;
    }
    return 0;
}

static MasterStatus read_outputs(Master *m)
{
    for (int i = 0; i < m->n_slaves; i++) {
        const Slave *s = &m->slaves[i];
        m->where = i;
        if (s->n_outputs && s->get_real(s->component, s->outputs, (size_t)s->n_outputs, m->next + s->first) > 1)
            return MASTER_SLAVE;
    }
    return MASTER_GOING;
}

/* After an accepted step: all outputs, the slopes to go on with, the time. */
static MasterStatus take(Master *m, double end, double h)
{
    if (read_outputs(m) != MASTER_GOING) return MASTER_SLAVE;
    const int diverged = m->plan.scheme != IMPLICIT && diverges(m);
    for (int k = m->n_tables; k < m->n_signals; k++) {
        if (h > SHORT_STEP * m->plan.step) m->slope[k] = (m->next[k] - m->now[k]) / h;
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
    const Plan *p = &m->plan;
    double wanted = p->variable ? m->time + m->h : p->start + (double)(m->point + 1) * p->step;
    if (m->restart > 0) {
        if (m->time + 1.5 * m->restart < wanted) wanted = m->time + m->restart;
        m->restart = m->restart < p->step ? 2 * m->restart : 0;
    }
    wanted = before_events(m, wanted > p->stop - SAME_TIME ? p->stop : wanted, event);
    return wanted;
}

static MasterStatus begin(Master *m)
{
    m->started = 1;
    if (read_outputs(m) != MASTER_GOING) return MASTER_SLAVE;
    memcpy(m->now, m->next, (size_t)m->n_signals * sizeof *m->now);
    for (int k = 0; k < m->n_signals; k++) m->rate[k] = m->next_rate[k] = NAN;
    if (m->plan.restart < 1) m->restart = m->plan.restart * m->plan.step;
    read_tables(m);
    return MASTER_GOING;
}

/* From one communication point to the next; *h, *iterations and *error as in advance(). */
static MasterStatus go(Master *m, double *h, int *iterations, double *error)
{
    const Plan *p = &m->plan;
    const double start = m->time;
    int event;
    read_tables(m);
    const double end = target(m, &event);
    MasterStatus status = advance(m, end, h, iterations, error);
    if (status != MASTER_GOING) return status;
    const int whole = start + *h >= end - 1e-3 * SAME_TIME;
    status = take(m, whole ? end : start + *h, *h);
    if (whole && event && p->restart < 1) m->restart = p->restart * p->step;
    if (!p->variable && m->time >= p->start + (double)(m->point + 1) * p->step - SAME_TIME) m->point++;
    if (p->variable) m->h = fmin(p->step, *h * fmin(2, 0.9 * cbrt(p->tolerance / fmax(*error, 1e-12 * p->tolerance))));
    read_tables(m);
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
    while (status == MASTER_GOING && *n_rows < capacity && m->time < m->plan.stop - SAME_TIME) {
        const long steps = m->steps;
        status = go(m, &h, &iterations, &error);
        if (m->steps > steps) row = record(m, row, h, iterations, error), ++*n_rows;
    }
    *where = m->where;
    if (status == MASTER_GOING && m->time >= m->plan.stop - SAME_TIME) return MASTER_DONE;
    return status;
}

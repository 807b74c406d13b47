/* The implicit loop: values (and slopes) at the end of the step that the slaves agree on, by Broyden's method. */
#include "master_state.h"

#include <math.h>
#include <string.h>

/* The unknowns of the loop are values at the end of the step and, for cubics, slopes there: value k, then slope k.
 * A slope counts as far as it moves the cubic: 4/27 of it times the step. */
static double unit(const Master *m, int k, double h)
{
    const int n = m->settings.n_unknown;
    const double scale = m->scale[m->settings.unknown[k % n]];
    return k < n ? scale : scale * 27 / (4 * h);
}

static int n_unknowns(const Master *m) { return m->settings.n_unknown * (m->settings.cubic ? 2 : 1); }

/* Residuals over their units, and the largest of them. A slope that nobody tells is no unknown. */
static double worst(Master *m, double h)
{
    double largest = 0;
    for (int k = 0; k < n_unknowns(m); k++) {
        m->residual[k] = (m->answer[k] - m->guess[k]) / unit(m, k, h);
        if (k >= m->settings.n_unknown && isnan(m->answer[k])) m->residual[k] = 0;
        if (!(fabs(m->residual[k]) <= largest)) {
            largest = fabs(m->residual[k]);
            m->where = m->settings.unknown[k % m->settings.n_unknown];
        }
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
    const MasterSettings *p = &m->settings;
    const int n = p->n_unknown, slopes = p->cubic;
    for (int k = 0; k < n; k++) {
        m->next[p->unknown[k]] = m->guess[k];
        m->next_rate[p->unknown[k]] = slopes ? m->guess[n + k] : NAN;
        m->known[p->unknown[k]] = 1;
    }
    for (int i = p->loop_first; i < p->loop_last; i++) {
        if (master_step_slave(m, i, h)) return MASTER_SLAVE;
        master_now_known(m, i);
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
    const int n = m->settings.n_unknown;
    for (int k = 0; k < n; k++) {
        const int signal = m->settings.unknown[k];
        const double rate = m->settings.cubic ? m->rate[signal] : NAN;
        m->guess[k] = m->now[signal] + (isnan(rate) ? m->slope[signal] : rate) * h;
        if (m->settings.cubic) m->guess[n + k] = rate;
    }
}

/* A slope that was not told at the start of the step (but is at its end) is guessed as it is then. */
static void first_slopes(Master *m)
{
    const int n = m->settings.n_unknown;
    for (int k = n; k < n_unknowns(m); k++)
        if (isnan(m->guess[k])) m->guess[k] = m->answer[k];
}

/* The loop's slaves over the step, again and again, until what comes out of the loop is what went in. */
MasterStatus master_iterate(Master *m, double h, double tolerance, int *iterations)
{
    const MasterSettings *p = &m->settings;
    const int n = p->n_unknown;
    const size_t bytes = (size_t)n_unknowns(m) * sizeof *m->guess;
    first_guess(m, h);
    for (*iterations = 1;; ++*iterations) {
        if (*iterations > 1 && master_restore(m, p->loop_first, p->loop_last)) return MASTER_SLAVE;
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

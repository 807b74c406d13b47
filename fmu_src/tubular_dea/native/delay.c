#include "delay.h"

#include <math.h>
#include <string.h>

#if MODEL_DELAYS

#define NX AT_LEAST_ONE(MODEL_NX)
#define NU AT_LEAST_ONE(MODEL_NU)
#define NY AT_LEAST_ONE(MODEL_NY)
#define SLACK 1e-9 /* s: times closer than this are the same */

int delay_is_open(const Instance *instance, int line)
{
    return instance->now.n_past[line] == 0 || !(instance->now.p[model_delays[line].parameter] > 0);
}

static double delay_of(const Instance *instance, int line)
{
    return instance->now.p[model_delays[line].parameter];
}

/* What was going on at `time`: the last piece that had begun by then, or the first one. */
static const Past *past_at(const Instance *instance, int line, double time)
{
    const Past *past = instance->now.past[line];
    int low = 0, high = instance->now.n_past[line] - 1;
    while (low < high) {
        const int middle = (low + high + 1) / 2;
        if (past[middle].time <= time + SLACK) low = middle;
        else high = middle - 1;
    }
    return &past[low];
}

/* Value and derivatives of an input's piece at `time`: a cubic; level before it began. */
static void read_input(const Past *piece, double time, double *derivatives)
{
    const double s = time - piece->time, *c = piece->c;
    memset(derivatives, 0, (INPUT_ORDER + 1) * sizeof *derivatives);
    derivatives[0] = c[0];
    if (s < -SLACK) return;
    derivatives[0] = c[0] + s * (c[1] + s * (c[2] * (1.0 / 2) + s * (c[3] * (1.0 / 6))));
    derivatives[1] = c[1] + s * (c[2] + s * (c[3] * (1.0 / 2)));
    derivatives[2] = c[2] + s * c[3];
    derivatives[3] = c[3];
}

/* Value and rate of a definition's piece: Newton's polynomial through its values at 0, 1/5, ... of its length. */
static void read_output(const Past *piece, double time, double *value, double *rate)
{
    const double s = fmax(0, 5 * (time - piece->time) / piece->length);
    double v = piece->c[5], slope = 0;
    for (int k = 4; k >= 0; k--) {
        slope = (slope * (s - k) + v) / (k + 1);
        v = piece->c[k] + (s - k) / (k + 1) * v;
    }
    *value = v;
    *rate = time < piece->time - SLACK ? 0 : 5 * slope / piece->length;
}

void delay_read_inputs(const Instance *instance, double *u, double *du)
{
    for (int line = 0; line < MODEL_DELAYS; line++) {
        const int slot = model_delays[line].slot, input = model_delays[line].input;
        double then[INPUT_ORDER + 1];
        if (input < 0) continue;
        if (delay_is_open(instance, line)) {
            u[slot] = u[input];
            du[slot] = du[input];
            continue;
        }
        const double time = instance->now.time - delay_of(instance, line);
        read_input(past_at(instance, line, time), time, then);
        u[slot] = then[0];
        du[slot] = then[1];
    }
}

void delay_read_outputs(const Instance *instance, const double *y, double *u, double *du)
{
    for (int line = 0; line < MODEL_DELAYS; line++) {
        const int slot = model_delays[line].slot, output = model_delays[line].output;
        if (output < 0) continue;
        u[slot] = y[output];
        du[slot] = 0;
        if (delay_is_open(instance, line)) continue;
        const double time = instance->now.time - delay_of(instance, line);
        read_output(past_at(instance, line, time), time, &u[slot], &du[slot]);
    }
}

/* Values at 0, 1/5, ... of a piece's length turned into Newton's differences, in place. */
static void differences(double c[6])
{
    for (int order = 1; order < 6; order++)
        for (int k = 5; k >= order; k--) c[k] -= c[k - 1];
}

/* Two neighbours as one: an input straight from end to end, a definition through six values. */
static Past merged(const Past *a, const Past *b, int is_input)
{
    Past both = {a->time, b->time + b->length - a->time, {0}};
    double ends[2][INPUT_ORDER + 1], rate;
    if (is_input) {
        read_input(a, a->time, ends[0]);
        read_input(b, b->time + b->length, ends[1]);
        both.c[0] = ends[0][0];
        both.c[1] = (ends[1][0] - ends[0][0]) / both.length;
        return both;
    }
    for (int node = 0; node < 6; node++) {
        const double time = both.time + node * both.length / 5;
        read_output(time < b->time ? a : b, time, &both.c[node], &rate);
    }
    differences(both.c);
    return both;
}

/* Room for one more piece: forgets what is older than the longest delay; where that is not enough, neighbours become
 * one until no two of them are together shorter than a 256th of the longest delay. */
static void make_room(Instance *instance, int line)
{
    Past *past = instance->now.past[line];
    int32_t *n = &instance->now.n_past[line];
    const double oldest = instance->now.time - model_delays[line].maximum - SLACK;
    int drop = 0;
    if (*n < PAST_ROOM) return;
    while (drop + 1 < *n && past[drop + 1].time <= oldest) drop++;
    *n -= drop;
    memmove(past, past + drop, (size_t)*n * sizeof *past);
    if (*n < PAST_ROOM) return;
    const double shortest = 4 * model_delays[line].maximum / PAST_ROOM;
    int to = 0;
    for (int i = 1; i < *n; i++)
        if (past[i].time + past[i].length - past[to].time < shortest)
            past[to] = merged(&past[to], &past[i], model_delays[line].input >= 0);
        else past[++to] = past[i];
    *n = to + 1;
}

static void keep(Instance *instance, int line, const Past *piece)
{
    Past *past = instance->now.past[line];
    int32_t *n = &instance->now.n_past[line];
    while (*n > 0 && past[*n - 1].time >= piece->time - SLACK / 2) (*n)--; /* a step that was cut short, begun anew */
    make_room(instance, line);
    past[(*n)++] = *piece;
}

/* Joins the last two pieces of a definition where one polynomial says as much: many short steps take little room. */
static void compress(Instance *instance, int line)
{
    const int n = instance->now.n_past[line];
    if (n < 2) return;
    Past *last = &instance->now.past[line][n - 2];
    const Past joined = merged(&last[0], &last[1], 0);
    for (int check = 0; check < 10; check++) {
        const Past *piece = &last[check / 5];
        const double time = piece->time + (check % 5 + 0.5) / 5 * piece->length;
        double one, other, rate;
        read_output(piece, time, &one, &rate);
        read_output(&joined, time, &other, &rate);
        if (!(fabs(one - other) <= 1e-7 * model_delays[line].nominal)) return;
    }
    last[0] = joined;
    instance->now.n_past[line]--;
}

static int is_level(const Past *piece) { return piece->c[1] == 0 && piece->c[2] == 0 && piece->c[3] == 0; }

void delay_keep_inputs(Instance *instance, double end)
{
    for (int line = 0; line < MODEL_DELAYS; line++) {
        const int input = model_delays[line].input, n = instance->now.n_past[line];
        if (input < 0) continue;
        Past piece = {instance->now.time, end - instance->now.time, {0}};
        memcpy(piece.c, instance->now.u[input], sizeof instance->now.u[input]);
        const Past *last = n ? &instance->now.past[line][n - 1] : NULL;
        if (last && is_level(last) && is_level(&piece) && last->c[0] == piece.c[0]) continue;
        keep(instance, line, &piece);
    }
}

double delay_next(const Instance *instance, double end)
{
    double next = end;
    for (int line = 0; line < MODEL_DELAYS; line++) {
        if (model_delays[line].input < 0 || delay_is_open(instance, line)) continue;
        const double delay = delay_of(instance, line), time = instance->now.time - delay;
        const Past *past = instance->now.past[line], *piece = past_at(instance, line, time);
        if (piece->time <= time + SLACK) piece++;
        if (piece < past + instance->now.n_past[line]) next = fmin(next, piece->time + delay);
    }
    return next < end - SLACK ? next : end;
}

void delay_drive(const Instance *instance, Inputs *inputs)
{
    for (int line = 0; line < MODEL_DELAYS; line++) {
        const int slot = model_delays[line].slot, input = model_delays[line].input;
        if (input < 0) continue;
        const double time = instance->now.time - delay_of(instance, line);
        if (delay_is_open(instance, line)) memcpy(inputs->u[slot], inputs->u[input], sizeof inputs->u[slot]);
        else read_input(past_at(instance, line, time), time, inputs->u[slot]);
    }
}

void delay_keep_outputs(Instance *instance, const Inputs *inputs, const Step *step)
{
    Past pieces[MODEL_DELAYS];
    const double fold = 0;
    for (int node = 0; node < 6; node++) {
        double x[NX], u[NU], du[NU], y[NY];
        const double time = step->time + node * step->h / 5;
        step_interpolate(step, time, x);
        inputs_at(inputs, time, u, du);
        model_outputs(time, x, u, du, instance->now.p, &fold, y);
        for (int line = 0; line < MODEL_DELAYS; line++)
            if (model_delays[line].output >= 0) pieces[line].c[node] = y[model_delays[line].output];
    }
    for (int line = 0; line < MODEL_DELAYS; line++) {
        if (model_delays[line].output < 0) continue;
        differences(pieces[line].c);
        pieces[line].time = step->time;
        pieces[line].length = step->h;
        keep(instance, line, &pieces[line]);
        compress(instance, line);
    }
}

#else

void delay_read_inputs(const Instance *instance, double *u, double *du) { (void)instance, (void)u, (void)du; }
void delay_read_outputs(const Instance *instance, const double *y, double *u, double *du)
{
    (void)instance, (void)y, (void)u, (void)du;
}
void delay_keep_inputs(Instance *instance, double end) { (void)instance, (void)end; }
double delay_next(const Instance *instance, double end) { return (void)instance, end; }
void delay_drive(const Instance *instance, Inputs *inputs) { (void)instance, (void)inputs; }
void delay_keep_outputs(Instance *instance, const Inputs *inputs, const Step *step)
{
    (void)instance, (void)inputs, (void)step;
}

#endif

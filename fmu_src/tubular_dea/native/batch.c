#define MODEL_SOLVER
#include "batch.h"

#include <math.h>
#include <string.h>

#include "equilibrium.h"
#include "lanes.h"
#include "method.h"
#include "start.h"

#define NX AT_LEAST_ONE(MODEL_NX)
#define NU AT_LEAST_ONE(MODEL_NU)
#define NQ AT_LEAST_ONE(MODEL_NQ)
#define NY AT_LEAST_ONE(MODEL_NY)
#define PARTS 4 /* of a step, at whose ends probes look */

/* The fold, kept as long as what moves it stays: all inputs but the load. One `Fold` serves one set of parameters. */
typedef struct {
    int known;
    double u[NU], place, load;
} Fold;

/* The trajectory in one lane. */
typedef struct {
    long row; /* -1: none */
    const double *p;
    double start, stop, near; /* breakpoints nearer than `near` are one */
    long segment[NU], tries, steps, since_below; /* the last: attempts since one came to a state's minimum */
    Fold fold;
} Trip;

typedef struct {
    const Batch *batch;
    Lanes lanes;
    Trip trips[WIDTH];
    long next_row;
    int looks_inside, needs_outputs, needs_fold; /* what the probes ask for */
} BatchRun;

/* Values ------------------------------------------------------------------------------------------------------- */

static void fold_update(Fold *fold, const double *u, const double *p)
{
#if MODEL_HAS_CURVE
    double key[NU];
    memcpy(key, u, sizeof key);
    key[CURVE_LOAD] = 0;
    if (fold->known && !memcmp(key, fold->u, sizeof key)) return;
    const CurvePoint top = fold->known ? curve_fold_near(u, p, fold->place) : curve_fold(u, p);
    fold->known = 1, fold->place = top.unknown, fold->load = top.load;
    memcpy(fold->u, key, sizeof key);
#else
    (void)u, (void)p, (void)fold;
#endif
}

/* A probe's value where states, inputs, outputs and fold are known. */
static double value_of(const Probe *probe, double time, const double *x, const double *u, const double *y,
                       const Fold *fold)
{
    switch (probe->source) {
    case SOURCE_STATE: return x[probe->index];
    case SOURCE_OUTPUT: return y[probe->index];
    case SOURCE_INPUT: return u[probe->index];
    case SOURCE_FOLD: return fold->load;
    case SOURCE_FOLD_PLACE: return fold->place;
#if MODEL_HAS_CURVE
    case SOURCE_BEYOND_FOLD: return x[CURVE_UNKNOWN] - fold->place;
#endif
    default: return time;
    }
}

/* Everything the probes may ask for at one instant of a lane's step. */
typedef struct {
    double time, x[NX], u[NU], du[NU], y[NY];
} Instant;

static void observe(BatchRun *run, int l, double time, Instant *now)
{
    const Lanes *lanes = &run->lanes;
    Trip *trip = &run->trips[l];
    now->time = time;
    for (int i = 0; i < MODEL_NU; i++) {
        now->du[i] = lanes->du[i][l];
        now->u[i] = lanes->u[i][l] + (time - lanes->piece_start[l]) * now->du[i];
    }
    if (run->needs_fold) fold_update(&trip->fold, now->u, trip->p);
    if (run->needs_outputs) model_outputs(time, now->x, now->u, now->du, trip->p, &trip->fold.load, now->y);
}

/* The probe's value at the fraction `s` of the step that has just been accepted in lane `l`. */
static double inside(BatchRun *run, int l, const Probe *probe, double s)
{
    Instant now;
    lanes_interpolate(&run->lanes, l, s, now.x);
    observe(run, l, run->lanes.time[l] + s * run->lanes.h[l], &now);
    return value_of(probe, now.time, now.x, now.u, now.y, &run->trips[l].fold);
}

/* Probes over a step ----------------------------------------------------------------------------------------------- */

static double time_of(const Probe *probe, const Trip *trip)
{
    return probe->time ? probe->time[trip->row * probe->time_stride] : trip->start;
}

/* The largest value of sign * f in the step: of the ends of its parts, and of the parabola through the best three. */
static double extreme(BatchRun *run, int l, const Probe *probe, const double *f, double sign)
{
    int best = 0;
    for (int j = 1; j <= PARTS; j++)
        if (sign * f[j] > sign * f[best]) best = j;
    const int middle = best == 0 ? 1 : best == PARTS ? PARTS - 1 : best;
    const double rise = f[middle + 1] - f[middle - 1], bend = f[middle + 1] - 2 * f[middle] + f[middle - 1];
    const double shift = -0.5 * rise / bend;
    if (!(sign * bend < 0) || !(fabs(shift) < 1)) return f[best];
    const double top = inside(run, l, probe, (middle + shift) / PARTS);
    return sign * top > sign * f[best] ? top : f[best];
}

/* The time at which the value passes the threshold between the parts j - 1 and j, by bisection. */
static double passing(BatchRun *run, int l, const Probe *probe, double sign, int j)
{
    double low = (j - 1.0) / PARTS, high = (double)j / PARTS;
    for (int i = 0; i < 45; i++) {
        const double middle = 0.5 * (low + high);
        if (sign * (inside(run, l, probe, middle) - probe->threshold) >= 0) high = middle;
        else low = middle;
    }
    return run->lanes.time[l] + high * run->lanes.h[l];
}

static double first_passing(BatchRun *run, int l, const Probe *probe, const double *f, double sign)
{
    for (int j = 0; j <= PARTS; j++)
        if (sign * (f[j] - probe->threshold) >= 0) return j ? passing(run, l, probe, sign, j) : run->lanes.time[l];
    return NAN;
}

/* What a step with the values `f` at the ends of its parts adds to a probe's result. */
static void collect(BatchRun *run, int l, const Probe *probe, const double *f, double *result)
{
    const double start = run->lanes.time[l], h = run->lanes.h[l], time = time_of(probe, &run->trips[l]);
    const Trip *trip = &run->trips[l];
    if (probe->kind == PROBE_AT) {
        const int at_end = run->lanes.last[l] > 0 && run->lanes.piece_end[l] >= trip->stop;
        if (time >= start && (time < start + h || at_end) && isnan(*result))
            *result = inside(run, l, probe, fmin(1, (time - start) / h));
        return;
    }
    if (start < time - trip->near) return;
    switch (probe->kind) {
    case PROBE_MINIMUM: *result = fmin(*result, extreme(run, l, probe, f, -1)); break;
    case PROBE_MAXIMUM: *result = fmax(*result, extreme(run, l, probe, f, 1)); break;
    case PROBE_MEAN: /* Boole's rule, as exact as the interpolation */
        *result = (isnan(*result) ? 0 : *result) + h * (7 * (f[0] + f[4]) + 32 * (f[1] + f[3]) + 12 * f[2]) / 90;
        break;
    case PROBE_RISE:
        if (isnan(*result)) *result = first_passing(run, l, probe, f, 1);
        break;
    case PROBE_FALL:
        if (isnan(*result)) *result = first_passing(run, l, probe, f, -1);
        break;
    default: break;
    }
}

static void look_inside(BatchRun *run, int l)
{
    const Batch *batch = run->batch;
    Instant now[PARTS + 1];
    double fold_load[PARTS + 1], fold_place[PARTS + 1];
    double *results = batch->results + run->trips[l].row * batch->n_probes;
    for (int j = 0; j <= PARTS; j++) {
        lanes_interpolate(&run->lanes, l, (double)j / PARTS, now[j].x);
        observe(run, l, run->lanes.time[l] + run->lanes.h[l] * j / PARTS, &now[j]);
        fold_load[j] = run->trips[l].fold.load;
        fold_place[j] = run->trips[l].fold.place;
    }
    for (long k = 0; k < batch->n_probes; k++) {
        const Probe *probe = &batch->probes[k];
        double f[PARTS + 1];
        if (probe->kind == PROBE_FINAL) continue;
        for (int j = 0; j <= PARTS; j++) {
            const Fold fold = {.load = fold_load[j], .place = fold_place[j]};
            f[j] = value_of(probe, now[j].time, now[j].x, now[j].u, now[j].y, &fold);
        }
        collect(run, l, probe, f, &results[k]);
    }
}

/* A trajectory's life ------------------------------------------------------------------------------------------------ */

/* Inputs from `time` on, and the end of the piece over which they run straight. */
static void set_piece(BatchRun *run, int l, double time)
{
    const Batch *batch = run->batch;
    Lanes *lanes = &run->lanes;
    Trip *trip = &run->trips[l];
    double end = trip->stop;
    int jumps = time <= trip->start;
    for (int i = 0; i < MODEL_NU; i++) {
        const BatchInput *input = &batch->inputs[i];
        const double *times = input->time + trip->row * input->time_stride;
        const double *values = input->value + trip->row * input->value_stride;
        long *k = &trip->segment[i];
        const long before = *k;
        while (*k < input->n && times[*k] <= time + trip->near) ++*k; /* the first breakpoint ahead */
        jumps |= *k > before + 1 && values[*k - 1] != values[before];
        const int level = *k == 0 || *k == input->n;
        const double slope = level ? 0 : (values[*k] - values[*k - 1]) / (times[*k] - times[*k - 1]);
        lanes->u[i][l] = *k == 0 ? values[0] : values[*k - 1] + slope * (time - times[*k - 1]);
        lanes->du[i][l] = slope;
        if (*k < input->n) end = fmin(end, times[*k]);
    }
    for (long k = 0; k < batch->n_probes; k++) {
        const double from = time_of(&batch->probes[k], trip);
        if (batch->probes[k].kind != PROBE_AT && from > time + trip->near) end = fmin(end, from);
    }
    lanes->piece_start[l] = time;
    lanes->piece_end[l] = trip->stop - end <= trip->near ? trip->stop : end;
    lanes->fresh[l] = jumps ? JUMPED : CORNER;
}

/* The initial states under the inputs of the first piece; 0 where there are none. */
static int set_start(BatchRun *run, int l)
{
    double x[NX], u[NU];
    for (int i = 0; i < MODEL_NU; i++) u[i] = run->lanes.u[i][l];
    if (!start_states(u, run->trips[l].p, x)) return 0;
    for (int i = 0; i < MODEL_NX; i++) run->lanes.x[i][l] = x[i];
    return 1;
}

static void finish(BatchRun *run, int l, int status)
{
    const Batch *batch = run->batch;
    Trip *trip = &run->trips[l];
    double *results = batch->results + trip->row * batch->n_probes;
    Instant now;
    if (!status) {
        for (int i = 0; i < MODEL_NX; i++) now.x[i] = run->lanes.x[i][l];
        observe(run, l, trip->stop, &now);
    }
    for (long k = 0; k < batch->n_probes; k++) {
        const Probe *probe = &batch->probes[k];
        if (status) results[k] = NAN;
        else if (probe->kind == PROBE_FINAL) results[k] = value_of(probe, now.time, now.x, now.u, now.y, &trip->fold);
        else if (probe->kind == PROBE_MEAN) results[k] /= trip->stop - fmax(trip->start, time_of(probe, trip));
    }
    batch->status[trip->row] = status;
    batch->reached[trip->row] = run->lanes.time[l];
    batch->steps[trip->row] = trip->steps;
    trip->row = -1;
}

/* Puts the next trajectory that can start into lane `l`; a lane without one keeps its last states and is not looked at. */
static void begin(BatchRun *run, int l)
{
    const Batch *batch = run->batch;
    Lanes *lanes = &run->lanes;
    Trip *trip = &run->trips[l];
    while (trip->row < 0 && run->next_row < batch->n) {
        double q[NQ];
        memset(trip, 0, sizeof *trip);
        trip->row = run->next_row++;
        trip->since_below = LATELY;
        trip->p = batch->p + trip->row * MODEL_NP;
        trip->start = batch->start;
        trip->stop = batch->stop[trip->row * batch->stop_stride];
        trip->near = 1e-12 * (trip->stop - trip->start);
        for (long k = 0; k < batch->n_probes; k++) batch->results[trip->row * batch->n_probes + k] = NAN;
        model_prepare(trip->p, q);
        for (int i = 0; i < MODEL_NQ; i++) lanes->q[i][l] = q[i];
        lanes->time[l] = trip->start;
        lanes->wanted[l] = INFINITY;
        lanes->corner[l] = lanes->cornered[l] = 0;
        lanes->rejected[l] = 0;
        set_piece(run, l, trip->start);
        if (!set_start(run, l)) finish(run, l, NO_REST_STATE);
        else if (!(trip->stop > trip->start)) finish(run, l, SOLVER_STEP_TOO_SMALL);
    }
}

/* After an attempt and the move that follows it: on to the next piece or trajectory where one has ended. */
static void carry_on(BatchRun *run, int l)
{
    const Lanes *lanes = &run->lanes;
    Trip *trip = &run->trips[l];
    if (lanes->accepted[l] > 0) {
        trip->steps++;
        if (lanes->last[l] > 0) {
            if (lanes->piece_end[l] >= trip->stop) finish(run, l, SOLVER_OK);
            else set_piece(run, l, lanes->time[l]);
        }
    }
    if (trip->row < 0) return;
    trip->since_below = lanes->below[l] > 0 ? 0 : trip->since_below + 1;
    if (++trip->tries >= run->batch->max_steps) finish(run, l, SOLVER_TOO_MANY_STEPS);
    else if (is_too_short(lanes->wanted[l], lanes->time[l]))
        finish(run, l, trip->since_below < LATELY ? SOLVER_BELOW_MINIMUM : SOLVER_STEP_TOO_SMALL);
}

static void survey(BatchRun *run)
{
    run->needs_fold = run->batch->with_fold;
    for (long k = 0; k < run->batch->n_probes; k++) {
        const Probe *probe = &run->batch->probes[k];
        run->looks_inside |= probe->kind != PROBE_FINAL;
        run->needs_outputs |= probe->source == SOURCE_OUTPUT;
        run->needs_fold |= probe->source == SOURCE_FOLD || probe->source == SOURCE_FOLD_PLACE ||
                           probe->source == SOURCE_BEYOND_FOLD;
    }
}

void batch_trajectories(const Batch *batch)
{
    BatchRun run;
    int busy = 1;
    memset(&run, 0, sizeof run);
    run.batch = batch;
    run.lanes.tolerance = batch->tolerance;
    survey(&run);
    for (int l = 0; l < WIDTH; l++) {
        run.trips[l].row = -1;
        for (int i = 0; i < MODEL_NX; i++) run.lanes.x[i][l] = 1;
        run.lanes.wanted[l] = run.lanes.piece_end[l] = 1;
    }
    while (busy) {
        busy = 0;
        for (int l = 0; l < WIDTH; l++) {
            if (run.trips[l].row < 0) begin(&run, l);
            busy |= run.trips[l].row >= 0;
        }
        if (!busy) break;
        lanes_attempt(&run.lanes, run.looks_inside);
        for (int l = 0; l < WIDTH; l++)
            if (run.looks_inside && run.trips[l].row >= 0 && run.lanes.accepted[l] > 0) look_inside(&run, l);
        lanes_move(&run.lanes);
        for (int l = 0; l < WIDTH; l++)
            if (run.trips[l].row >= 0) carry_on(&run, l);
    }
}

/* Rest states -------------------------------------------------------------------------------------------------------- */

void batch_rest(long n, const double *p, const double *u, long n_probes, const Probe *probes, double *results, int *status)
{
#if MODEL_HAS_CURVE
    const double du[NU] = {0};
    for (long row = 0; row < n; row++, p += MODEL_NP, u += MODEL_NU, results += n_probes) {
        double x[NX], y[NY], unknown;
        Fold fold = {0};
        fold_update(&fold, u, p);
        const int found = curve_rest(u, p, &unknown, x);
        if (found) model_outputs(0, x, u, du, p, &fold.load, y);
        for (long k = 0; k < n_probes; k++) {
            const int fold_only = probes[k].source == SOURCE_FOLD || probes[k].source == SOURCE_FOLD_PLACE;
            results[k] = found || fold_only ? value_of(&probes[k], 0, x, u, y, &fold) : NAN;
        }
        status[row] = found ? 0 : NO_REST_STATE;
    }
#else
    (void)p, (void)u, (void)probes;
    for (long i = 0; i < n * n_probes; i++) results[i] = NAN;
    for (long row = 0; row < n; row++) status[row] = NO_REST_STATE;
#endif
}

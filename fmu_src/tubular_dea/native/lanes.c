#define MODEL_SOLVER
#include "lanes.h"

typedef Lanes Source;

/* Inputs run straight from the start of a piece. */
static inline void source_inputs(const Lanes *lanes, int l, double time, double *u, double *du)
{
    const double since = time - lanes->piece_start[l];
    for (int i = 0; i < MODEL_NU; i++) {
        du[i] = lanes->du[i][l];
        u[i] = lanes->u[i][l] + since * du[i];
    }
}

#include "attempt.h"

/* Where inputs have jumped: a step that resolves the fastest motion. */
static void begin_piece(Lanes *lanes, const Start *start, int l)
{
    const double limit = lanes->wanted[l] < INFINITY ? lanes->wanted[l] : lanes->piece_end[l] - lanes->time[l];
    lanes->cornered[l] = lanes->fresh[l] == CORNER;
    lanes->wanted[l] = lanes->cornered[l] > 0 ? at_corner(limit, lanes->corner[l]) : resolving_step(start, l, limit);
    lanes->fresh[l] = NOTHING;
}

static void choose(Lanes *lanes)
{
    for (int l = 0; l < WIDTH; l++) {
        const double left = lanes->piece_end[l] - lanes->time[l];
        lanes->last[l] = is_last(lanes->wanted[l], left, lanes->time[l]);
        lanes->h[l] = lanes->last[l] > 0 ? left : lanes->wanted[l];
    }
}

static void judge(Lanes *lanes, const Lane error)
{
    for (int l = 0; l < WIDTH; l++) {
        lanes->wanted[l] = wanted_next(error[l], lanes->h[l], lanes->wanted[l], lanes->last[l] > 0, lanes->rejected[l] > 0);
        lanes->accepted[l] = is_accepted(error[l]);
        if (lanes->cornered[l] > 0 && lanes->accepted[l] > 0) {
            lanes->corner[l] = lanes->h[l] * growth(error[l]);
            lanes->cornered[l] = 0;
        }
        lanes->rejected[l] = !is_accepted(error[l]);
        lanes->below[l] = error[l] < 0;
    }
}

void lanes_attempt(Lanes *lanes, int with_bend)
{
    Start start;
    Work work;
    Lane error;
    const Tried trial = {lanes->time, lanes->h, (const Lane *)lanes->x, (const Lane *)lanes->q};
    linearise(lanes, &trial, lanes->tolerance, &start);
    for (int l = 0; l < WIDTH; l++)
        if (lanes->fresh[l] > 0) begin_piece(lanes, &start, l);
    choose(lanes);
    attempt(lanes, &trial, &start, &work, lanes->x_new, error);
    judge(lanes, error);
    if (with_bend) bends(&work, lanes->bend);
}

void lanes_move(Lanes *lanes)
{
    EVERY_LANE(l) {
        const int accepted = lanes->accepted[l] > 0;
        const double end = lanes->last[l] > 0 ? lanes->piece_end[l] : lanes->time[l] + lanes->h[l];
        lanes->time[l] = accepted ? end : lanes->time[l];
        for (int i = 0; i < MODEL_NX; i++) lanes->x[i][l] = accepted ? lanes->x_new[i][l] : lanes->x[i][l];
    }
}

void lanes_interpolate(const Lanes *lanes, int l, double f, double *x)
{
    for (int i = 0; i < MODEL_NX; i++)
        x[i] = within(f, lanes->x[i][l], lanes->x_new[i][l], lanes->bend[0][i][l], lanes->bend[1][i][l],
                      lanes->bend[2][i][l]);
}

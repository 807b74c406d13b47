/* A tubular DEA on a bench, written for blind trials: own equations of motion, own integrator, own effects.
 *
 * Forces are divided by the wall volume of one half tube (see tests/independent.py); effects are in other functional
 * forms than those of the package on purpose. Time is stepped by the three-stage Radau IIA method (order 5, L-stable)
 * with steps chosen by its error, and read anywhere by its collocation polynomial. */
#include <math.h>
#include <string.h>

enum { LAM, RATE, VIS1, VIS2, ELEC1, ELEC2, SLEWED, TRAP, HOOP1, HOOP2, EXTRA1, EXTRA2, GRIP, MOST, SET, WARMTH, LINE1,
       LINE2, SENSED, HELD, CRACKED, LEAKING, GAS, END, END_RATE, END_VIS1, END_VIS2,
       LEVEL, SLOSH, BLED, NX };
enum { R_O, L_O, H_O, H_AO, RHO, LAYERS, C_1, C_2, C_3, EPS_R, ETA_O, K_1, ETA_1, K_2, ETA_2, MONITOR_LAG, CLOCK };
/* Effect numbers and what their a, b, c are: see effects.py. */
enum { NOTHING, ELECTRODE, SLEW, TRAPPING, EPS_STRETCH, EPS_FIELD, THINNING, ETA_STRETCH, HOOP_VISCO, THIRD_BRANCH,
       MULLINS, FRICTION, PERMANENT_SET, PRESTRETCH, PASSIVE, STIFFENING, CLAMP, STOP, THERMAL, P_OFFSET, P_GAIN,
       P_DELAY, P_LINE, R_OFFSET, R_GAIN, R_LAG, R_DELAY, ADDED_MASS, C_DRIFT, EPS_DRIFT, R_DRIFT, ODD_MECHANICAL,
       ODD_ELECTRICAL, ODD_PRESSURE, AXIS, LEAK, COLUMN, OBLIQUE, CRACK, GAS_TEMPERATURE, SENSOR_AVERAGE,
       V_DELAY, BLEEDER, N_EFFECTS };

typedef struct { const double *tube; const double *on; /* N_EFFECTS x 4: switched on, a, b, c */ } Bench;
#define HAS(e) (b->on[4 * (e)] != 0)
#define A(e) (b->on[4 * (e) + 1])
#define B(e) (b->on[4 * (e) + 2])
#define C(e) (b->on[4 * (e) + 3])

static double softplus(double x) { return x > 30 ? x : log1p(exp(x)); }
/* Of something that creeps from the moment the clock starts: 0 before, towards 1. */
static double crept(double t, double constant) { return t > 0 ? 1 - exp(-t / constant) : 0; }

/* A tube with a shape along its axis: half of it in two elements instead of one, from the clamp to the node `end` and
 * from there to the middle. The middle's acceleration without its mass; the node's and its branches' rates in dx. */
static double shaped(const double *c, const double *x, double firm, double p, double maxwell, double *dx)
{
    const double lam[2] = {x[END], x[LAM]}, rate[2] = {x[END_RATE], x[RATE]}, part = c[R_O] / (0.5 * c[L_O]);
    const int branch[2][2] = {{END_VIS1, END_VIS2}, {VIS1, VIS2}};
    double hold[2], stretch[2], hoop[2];
    for (int k = 0; k < 2; k++) {
        const double s = part * (lam[k] - (k ? lam[0] : 1)), l1 = sqrt(1 + s * s), sine = s / l1;
        const double l1_rate = part * sine * (rate[k] - (k ? rate[0] : 0));
        const double a1 = l1 * l1, a2 = lam[k] * lam[k], a3 = 1 / (a1 * a2), j = a1 + a2 + a3 - 3;
        const double stiff = 2 * (k ? 1 : firm) * (c[C_1] + j * (2 * c[C_2] + 3 * c[C_3] * j));
        double axial = stiff * (a1 - a3) - maxwell + c[ETA_O] * l1_rate + x[branch[k][0]] + x[branch[k][1]];
        dx[branch[k][0]] = c[K_1] * (l1_rate - x[branch[k][0]] / c[ETA_1]);
        dx[branch[k][1]] = c[K_2] * (l1_rate - x[branch[k][1]] / c[ETA_2]);
        hold[k] = axial * sine / l1;
        hoop[k] = (stiff * (a2 - a3) - maxwell) / (c[R_O] * lam[k]);
        stretch[k] = l1;
    }
    dx[END] = rate[0];
    dx[END_RATE] = (p * (1 + 6 * lam[0] + lam[1]) / 4 * stretch[0] / c[H_O] - 2 * (hold[0] - hold[1]) / c[L_O] - hoop[0])
        / (2 * c[RHO] * c[R_O]);
    return p * (3 * lam[1] + lam[0]) / 2 * stretch[1] / c[H_O] - 4 * hold[1] / c[L_O] - hoop[1];
}

/* dx/dt, and the charge [C] that has gone into the tube. */
static double rates(const Bench *b, double t, const double *x, double p, double v, double *dx)
{
    const double *c = b->tube;
    const double clock = t + c[CLOCK];
    double lam = x[LAM], rate = x[RATE], r_l = c[R_O] / c[L_O];
    memset(dx, 0, NX * sizeof *dx);
    /* pressure path */
    if (HAS(P_GAIN)) p *= A(P_GAIN);
    if (HAS(P_OFFSET)) p += A(P_OFFSET);
    if (HAS(ODD_PRESSURE)) p += A(ODD_PRESSURE) * sin(p / B(ODD_PRESSURE));
    if (HAS(P_LINE)) { /* two compartments in a row */
        dx[LINE1] = (p - x[LINE1]) / A(P_LINE);
        dx[LINE2] = (x[LINE1] - x[LINE2]) / B(P_LINE);
        p = x[LINE2];
    }
    if (HAS(LEAK)) { /* an orifice before the tube, and a hole in it */
        double inside = x[LEAKING];
        dx[LEAKING] = (p - inside - A(LEAK) * inside / sqrt(fabs(inside) + 1e2)) / B(LEAK);
        p = inside;
    }
    if (HAS(GAS_TEMPERATURE)) { /* compressed gas is warm and pushes more than the cold line tells */
        dx[GAS] = (p - x[GAS]) / B(GAS_TEMPERATURE);
        p += A(GAS_TEMPERATURE) * (p - x[GAS]);
    }
    if (HAS(COLUMN)) { /* the level in the riser falls as the tube takes its liquid, and sloshes */
        double own = 2 * M_PI * B(COLUMN);
        dx[LEVEL] = x[SLOSH];
        dx[SLOSH] = own * own * (lam - 1 - x[LEVEL]) - 0.2 * own * x[SLOSH];
        p -= A(COLUMN) * x[LEVEL];
    }
    /* electrical path */
    double u = v;
    if (HAS(ELECTRODE)) { /* a ladder of two sections */
        dx[ELEC1] = (v - x[ELEC1]) / (A(ELECTRODE) * 0.75);
        dx[ELEC2] = (x[ELEC1] - x[ELEC2]) / (A(ELECTRODE) * 0.25);
        u = x[ELEC2];
    }
    if (HAS(SLEW)) {
        dx[SLEWED] = A(SLEW) * tanh((u - x[SLEWED]) / (A(SLEW) * 1.5e-3));
        u = x[SLEWED];
    }
    if (HAS(BLEEDER)) { /* a supply that a diode parts from the tube, which only a resistor then discharges */
        dx[BLED] = (u > x[BLED] ? (u - x[BLED]) / 5e-5 : 0) - x[BLED] / A(BLEEDER);
        u = x[BLED];
    }
    double taken = u;
    if (HAS(TRAPPING)) { /* charge creeps in, the faster the stronger the field */
        double weight = 1 + 0.3 * u * u / 25e6;
        dx[TRAP] = (A(TRAPPING) * u - x[TRAP]) / B(TRAPPING) * weight;
        taken += x[TRAP];
        u -= x[TRAP];
    }
    double eps = c[EPS_R];
    if (HAS(EPS_STRETCH)) eps *= exp(-A(EPS_STRETCH) * (lam * lam - 1) / 2);
    if (HAS(EPS_DRIFT)) eps *= 1 + A(EPS_DRIFT) * crept(clock, B(EPS_DRIFT));
    double s = (lam - 1) * r_l;
    if (HAS(CLAMP)) s /= 1 + A(CLAMP) * (lam - 1);
    double l1 = sqrt(1 + s * s), sine = s / l1, l1_rate = r_l * sine * rate;
    double field = u / c[H_AO] * l1 * lam;
    if (HAS(EPS_FIELD)) eps *= 1 + A(EPS_FIELD) * (1 - 1 / (1 + field * field / (B(EPS_FIELD) * B(EPS_FIELD))));
    if (HAS(CRACK)) { /* the electrode parts where it is stretched, and meets again a little below */
        dx[CRACKED] = (1 / (1 + exp(-(lam - B(CRACK) + 0.03 * x[CRACKED]) / 2e-3)) - x[CRACKED]) / 3e-3;
        eps *= 1 - A(CRACK) * x[CRACKED];
    }
    double maxwell = 8.854e-12 * eps * field * field;
    if (HAS(ODD_ELECTRICAL)) maxwell += A(ODD_ELECTRICAL) * sin(field / B(ODD_ELECTRICAL)) * field / 5e7;
    double farad = c[LAYERS] * 8.854e-12 * eps * 4 * M_PI * c[R_O] * c[L_O] * l1 * l1 * lam * lam / c[H_AO];
    double charge = farad * taken;
    /* elastic stresses */
    double e1 = l1, e2 = lam;
    if (HAS(PRESTRETCH)) { e1 *= A(PRESTRETCH); e2 /= sqrt(A(PRESTRETCH)); } /* free to narrow when it was mounted */
    if (HAS(PERMANENT_SET)) {
        double above = x[LAM] - 1 > x[SET] ? x[LAM] - 1 - x[SET] : 0;
        dx[SET] = above / B(PERMANENT_SET);
        e2 /= 1 + A(PERMANENT_SET) * x[SET];
    }
    double a1 = e1 * e1, a2 = e2 * e2, a3 = 1 / (a1 * a2), j = a1 + a2 + a3 - 3, c_1 = c[C_1];
    if (HAS(C_DRIFT)) c_1 *= 1 - A(C_DRIFT) * log1p(fmax(clock, 0) / B(C_DRIFT));
    double stiff = 2 * (c_1 + j * (2 * c[C_2] + 3 * c[C_3] * j));
    if (HAS(STIFFENING)) stiff += 2 * A(STIFFENING) * (exp(B(STIFFENING) * j * j) - 1);
    if (HAS(MULLINS)) {
        dx[MOST] = j > x[MOST] ? (j - x[MOST]) / 4e-3 : 0;
        double gap = x[MOST] - j > 0 ? x[MOST] - j : 0;
        stiff *= 1 - A(MULLINS) * erf(gap / (B(MULLINS) + 0.2 * x[MOST]));
    }
    if (HAS(THERMAL)) {
        dx[WARMTH] = (u * u / 25e6 - x[WARMTH]) / B(THERMAL);
        stiff *= 1 / (1 + A(THERMAL) * x[WARMTH]);
    }
    double axial = stiff * (a1 - a3) - maxwell, hoop = stiff * (a2 - a3) - maxwell;
    if (HAS(PASSIVE)) hoop += A(PASSIVE) * (a2 - 1 / (a2 * sqrt(a2)));
    if (HAS(ODD_MECHANICAL)) hoop += A(ODD_MECHANICAL) * sin((lam - 1) / B(ODD_MECHANICAL));
    /* losses */
    double eta = c[ETA_O], soft = 1;
    if (HAS(THINNING)) eta *= pow(1 + fabs(rate) / B(THINNING), A(THINNING));
    if (HAS(ETA_STRETCH)) soft = 1 + A(ETA_STRETCH) * (a2 - 1) / 2;
    axial += x[VIS1] + x[VIS2] + eta * soft * l1_rate;
    dx[VIS1] = c[K_1] * (l1_rate - x[VIS1] / c[ETA_1]);
    dx[VIS2] = c[K_2] * (l1_rate - x[VIS2] / c[ETA_2]);
    if (HAS(THIRD_BRANCH)) { /* two neighbours instead of one */
        dx[EXTRA1] = 0.6 * A(THIRD_BRANCH) * l1_rate - x[EXTRA1] / (0.7 * B(THIRD_BRANCH));
        dx[EXTRA2] = 0.4 * A(THIRD_BRANCH) * l1_rate - x[EXTRA2] / (1.6 * B(THIRD_BRANCH));
        axial += x[EXTRA1] + x[EXTRA2];
    }
    if (HAS(HOOP_VISCO)) { /* in the logarithmic strain */
        dx[HOOP1] = 0.6 * A(HOOP_VISCO) * rate / lam - x[HOOP1] / (0.6 * B(HOOP_VISCO));
        dx[HOOP2] = 0.4 * A(HOOP_VISCO) * rate / lam - x[HOOP2] / (2.0 * B(HOOP_VISCO));
        hoop += x[HOOP1] + x[HOOP2] + C(HOOP_VISCO) * rate;
    }
    if (HAS(FRICTION)) { /* Bouc and Wen, exponent 2 */
        double z = x[GRIP], n = z * fabs(z);
        dx[GRIP] = (rate - 0.5 * fabs(rate) * n - 0.5 * rate * z * z) / B(FRICTION);
        hoop += A(FRICTION) * z;
    }
    if (HAS(STOP)) p -= A(STOP) * B(STOP) * softplus((lam - C(STOP)) / B(STOP));
    double push = p * (1 + lam) * l1 / c[H_O];
    double pull = 2 * axial * sine / (c[L_O] * l1) + hoop / (c[R_O] * lam);
    double inertia = 2 * c[RHO] * c[R_O];
    double force = push - pull;
    if (HAS(AXIS)) force = shaped(c, x, A(AXIS), p, maxwell, dx);
    if (HAS(ADDED_MASS)) inertia *= 1 + A(ADDED_MASS) * lam * lam; /* a liquid that grows with the tube */
    dx[LAM] = rate;
    dx[RATE] = force / inertia;
    dx[SENSED] = HAS(R_LAG) ? (lam - x[SENSED]) / A(R_LAG) : 0;
    dx[HELD] = c[MONITOR_LAG] > 0 ? (charge - x[HELD]) / c[MONITOR_LAG] : 0;
    return charge;
}

/* The states that move, in `used`; their number. */
static int moving(const Bench *b, int *used)
{
    static const int own[N_EFFECTS][4] = {
        [ELECTRODE] = {ELEC1, ELEC2}, [SLEW] = {SLEWED}, [TRAPPING] = {TRAP}, [HOOP_VISCO] = {HOOP1, HOOP2},
        [THIRD_BRANCH] = {EXTRA1, EXTRA2}, [FRICTION] = {GRIP}, [MULLINS] = {MOST}, [PERMANENT_SET] = {SET},
        [THERMAL] = {WARMTH}, [P_LINE] = {LINE1, LINE2}, [R_LAG] = {SENSED}, [CRACK] = {CRACKED},
        [LEAK] = {LEAKING}, [GAS_TEMPERATURE] = {GAS}, [AXIS] = {END, END_RATE, END_VIS1, END_VIS2},
        [COLUMN] = {LEVEL, SLOSH}, [BLEEDER] = {BLED}};
    int n = 0;
    for (int i = LAM; i <= VIS2; i++) used[n++] = i;
    for (int e = 0; e < N_EFFECTS; e++)
        for (int i = 0; i < 4 && HAS(e) && own[e][i]; i++) used[n++] = own[e][i];
    if (b->tube[MONITOR_LAG] > 0) used[n++] = HELD;
    return n;
}

/* What a state is like at its usual: errors are relative to it. */
static const double SIZE[NX] = {[LAM] = 1, [RATE] = 10, [VIS1] = 1e5, [VIS2] = 1e5, [ELEC1] = 1e3, [ELEC2] = 1e3,
    [SLEWED] = 1e3, [TRAP] = 1e2, [HOOP1] = 1e4, [HOOP2] = 1e4, [EXTRA1] = 1e5, [EXTRA2] = 1e5, [GRIP] = 1, [MOST] = .1,
    [SET] = .1, [WARMTH] = .1, [LINE1] = 1e4, [LINE2] = 1e4, [SENSED] = 1, [HELD] = 1e-5, [CRACKED] = 1,
    [LEAKING] = 1e4, [GAS] = 1e4, [END] = 1, [END_RATE] = 10, [END_VIS1] = 1e5, [END_VIS2] = 1e5,
    [LEVEL] = .1, [SLOSH] = 1, [BLED] = 1e3};

/* Inputs in pieces: cubics in the time since the piece began. A step of time does not go over the end of a `hard` one,
 * where an input jumps or has a corner; over the other ends it may. */
typedef struct { long n; const double *start, *p, *v; const char *hard; long now; } Inputs;

static void inputs_at(Inputs *in, double t, double *p, double *v, long last)
{
    long k = in->now;
    while (k > 0 && t < in->start[k]) k--;
    while (k < last && t >= in->start[k + 1]) k++;
    in->now = k;
    const double s = t - in->start[k], *a = in->p + 4 * k, *e = in->v + 4 * k;
    *p = a[0] + s * (a[1] + s * (a[2] + s * a[3]));
    *v = e[0] + s * (e[1] + s * (e[2] + s * e[3]));
}

#include "radau.h"

/* What the sensors make of a state: the radial stretch, and the current into the tube [A]. */
static void read_out(const Bench *b, double t, const double *x, double p, double v, double *lambda_2, double *current)
{
    const double *c = b->tube;
    double nowhere[NX], seen = HAS(R_LAG) ? x[SENSED] : x[LAM];
    if (HAS(OBLIQUE)) seen += A(OBLIQUE) * (seen - 1) * (seen - 1) * (1 + B(OBLIQUE) * sin((seen - 1) * 12));
    if (HAS(R_GAIN)) seen = 1 + A(R_GAIN) * (seen - 1);
    if (HAS(R_OFFSET)) seen += A(R_OFFSET) / c[R_O];
    if (HAS(R_DRIFT)) seen += A(R_DRIFT) / c[R_O] * sqrt(crept(t + c[CLOCK], B(R_DRIFT)));
    *lambda_2 = seen;
    if (c[MONITOR_LAG] > 0) *current = (rates(b, t, x, p, v, nowhere) - x[HELD]) / c[MONITOR_LAG];
}

#define MOST_STEPS 400000 /* of a run, beside some for every piece; tubes as built take some thousands */

/* Radial stretch and current at the times asked for, which rise, from a rested tube at start[0]; 0 where it bursts, or
 * rings so fast that MOST_STEPS do not do. `n` pieces of input, the last one up to start[n]. */
__attribute__((visibility("default")))
int trajectory(const double *tube, const double *on, long n, const double *start, const double *p, const double *v,
               const char *hard, double tol, long n_times, const double *times, double *lambda_2, double *current)
{
    Bench bench = {tube, on};
    Inputs in = {n, start, p, v, hard, 0};
    double x[NX] = {[LAM] = 1, [SENSED] = 1, [END] = 1}, pp, vv, t = start[0], h = 1e-5, seen, amps = 0;
    int used[NX];
    const int moved = moving(&bench, used);
    long asked = 0, first = 0, next = 0;
    Step s;
    for (; asked < n_times && times[asked] <= t; asked++) {
        inputs_at(&in, t, &pp, &vv, 0);
        read_out(&bench, t, x, pp, vv, &lambda_2[asked], &current[asked]);
    }
    for (long tries = MOST_STEPS + 400 * n; asked < n_times;) {
        if (!tries--) return 0;
        if (next <= first) { /* on to the next hard end */
            for (next = first + 1; next < n && !hard[next]; next++) {}
            in.now = first;
            h = fmin(h, 1e-5);
        }
        const double left = start[next] - t;
        int final = h >= left * (1 - 1e-9);
        double take = final ? left : (2 * h > left ? left / 2 : h);
        memset(&s, 0, sizeof s);
        int good = take <= 0 || step(&bench, moved, used, &in, next - 1, t, take, x, tol, &s);
        if (take > 0 && (!good || s.error > 1)) {
            h = take * (good ? fmax(0.2, 0.9 * pow(s.error, -0.25)) : 0.25);
            if (h < 1e-12) return 0;
            continue;
        }
        double after = final ? start[next] : t + take;
        for (; asked < n_times && (times[asked] < after || (times[asked] <= after && next == n)); asked++) {
            double q = (times[asked] - t) / take, y[NX];
            memcpy(y, x, sizeof y);
            for (int i = 0; i < moved; i++)
                for (int k = 0; k < 3; k++)
                    y[used[i]] += s.z[k][i] * q * (DENSE[k][0] + q * (DENSE[k][1] + q * DENSE[k][2]));
            inputs_at(&in, times[asked], &pp, &vv, next - 1);
            read_out(&bench, times[asked], y, pp, vv, &seen, &amps);
            lambda_2[asked] = seen, current[asked] = amps;
        }
        if (take > 0) {
            for (int i = 0; i < moved; i++) x[used[i]] += s.z[2][i];
            h = take * fmin(6, 0.9 * pow(s.error, -0.25));
        }
        t = after;
        if (final) { first = next; if (first == n) break; }
        if (!(x[LAM] > 0.5 && x[LAM] < 3.5)) return 0;
    }
    return asked == n_times;
}

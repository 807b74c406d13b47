/* The peer "CVODE in C": the paper's tube by hand, solved by SUNDIALS over a whole protocol.
 *
 * The equations are those in the head of tests/independent.py, differentiated by hand. The tube's
 * parameters are compile-time constants (-DPAR_r_o=0.015 ...), which favours this peer. SUNDIALS is
 * taken from FMPy's wheel, which brings no headers: the dozen functions used are declared here as
 * SUNDIALS 7 has them (double, 64-bit index, no MPI).
 */
#include <math.h>
#include <stdint.h>

typedef struct Context_ *Context;
typedef struct Vector_ *Vector;
typedef struct Matrix_ *Matrix;
typedef struct Linear_ *Linear;
typedef int (*RightSide)(double, Vector, Vector, void *);
typedef int (*JacobianOf)(double, Vector, Vector, Matrix, void *, Vector, Vector, Vector);

int SUNContext_Create(int comm, Context *context);
int SUNContext_Free(Context *context);
Vector N_VNew_Serial(int64_t length, Context context);
double *N_VGetArrayPointer(Vector v);
void N_VDestroy(Vector v);
Matrix SUNDenseMatrix(int64_t rows, int64_t columns, Context context);
double *SUNDenseMatrix_Data(Matrix m);
void SUNMatDestroy(Matrix m);
Linear SUNLinSol_Dense(Vector y, Matrix m, Context context);
int SUNLinSolFree(Linear s);
void *CVodeCreate(int method, Context context);
int CVodeInit(void *cvode, RightSide f, double t, Vector y);
int CVodeReInit(void *cvode, double t, Vector y);
int CVodeSVtolerances(void *cvode, double rtol, Vector atol);
int CVodeSetUserData(void *cvode, void *data);
int CVodeSetLinearSolver(void *cvode, Linear s, Matrix m);
int CVodeSetJacFn(void *cvode, JacobianOf jacobian);
int CVodeSetMaxNumSteps(void *cvode, long steps);
int CVode(void *cvode, double t_out, Vector y, double *t_reached, int task);
void CVodeFree(void **cvode);

enum { BDF = 2, NORMAL = 1, STATES = 4 };

/* A stretch of protocol without a corner: each input is its value at `start` plus its slope. */
typedef struct {
    double start, stop;
    double pressure, pressure_slope; /* Pa, Pa/s */
    double voltage, voltage_slope;   /* V, V/s */
} SmoothPiece;

static const double RATIO = PAR_r_o / PAR_l_o;
static const double MAXWELL = PAR_phi * PAR_eps_o * PAR_eps_r / (PAR_h_ao * PAR_h_ao);
static const double INVERSE_INERTIA = 1 / (2 * PAR_rho * PAR_r_o);

/* dx/dt of x = (lambda_2, lambda_2_rate, sigma_vis1, sigma_vis2). */
void tube_rhs(const double *x, double pressure, double voltage, double *dx)
{
    const double u = RATIO * (x[0] - 1), a = 1 + u * u, b = x[0] * x[0], c = 1 / (a * b);
    const double lambda_1 = sqrt(a), rate_1 = RATIO * u / lambda_1 * x[1];
    const double j = a + b + c - 3;
    const double stiffness = 2 * (PAR_C_1 + j * (2 * PAR_C_2 + 3 * PAR_C_3 * j));
    const double maxwell = MAXWELL * voltage * voltage * a * b;
    const double axial = stiffness * (a - c) - maxwell + x[2] + x[3] + PAR_eta_o * rate_1;
    const double hoop = stiffness * (b - c) - maxwell;
    const double push = pressure * (1 + x[0]) * lambda_1 / PAR_h_o;
    const double pull = 2 / PAR_l_o * axial * u / a + hoop / (PAR_r_o * x[0]);

    dx[0] = x[1];
    dx[1] = (push - pull) * INVERSE_INERTIA;
    dx[2] = PAR_k_1 * (rate_1 - x[2] / PAR_eta_1);
    dx[3] = PAR_k_2 * (rate_1 - x[3] / PAR_eta_2);
}

/* d(dx/dt)/dx, column by column; a name ending in _d is a derivative by lambda_2. */
void tube_jacobian(const double *x, double pressure, double voltage, double *jacobian)
{
    const double u = RATIO * (x[0] - 1), a = 1 + u * u, b = x[0] * x[0], c = 1 / (a * b);
    const double a_d = 2 * u * RATIO, b_d = 2 * x[0], area_d = a_d / a + b_d / b, c_d = -c * area_d;
    const double lambda_1 = sqrt(a), q = RATIO * u / lambda_1, q_d = RATIO * RATIO / (a * lambda_1);
    const double j = a + b + c - 3;
    const double stiffness = 2 * (PAR_C_1 + j * (2 * PAR_C_2 + 3 * PAR_C_3 * j));
    const double stiffness_d = 4 * (PAR_C_2 + 3 * PAR_C_3 * j) * (a_d + b_d + c_d);
    const double maxwell = MAXWELL * voltage * voltage * a * b, maxwell_d = maxwell * area_d;
    const double axial = stiffness * (a - c) - maxwell + x[2] + x[3] + PAR_eta_o * q * x[1];
    const double axial_d = stiffness_d * (a - c) + stiffness * (a_d - c_d) - maxwell_d
                         + PAR_eta_o * q_d * x[1];
    const double hoop = stiffness * (b - c) - maxwell;
    const double hoop_d = stiffness_d * (b - c) + stiffness * (b_d - c_d) - maxwell_d;
    const double lever = 2 / PAR_l_o * u / a, lever_d = 2 / PAR_l_o * RATIO * (1 - u * u) / (a * a);
    const double push_d = pressure * (lambda_1 + (1 + x[0]) * q) / PAR_h_o;
    const double pull_d = axial_d * lever + axial * lever_d
                        + (hoop_d - hoop / x[0]) / (PAR_r_o * x[0]);
    const double by_branch = -lever * INVERSE_INERTIA;
    const double columns[STATES * STATES] = {
        0, (push_d - pull_d) * INVERSE_INERTIA, PAR_k_1 * q_d * x[1], PAR_k_2 * q_d * x[1],
        1, by_branch * PAR_eta_o * q, PAR_k_1 * q, PAR_k_2 * q,
        0, by_branch, -PAR_k_1 / PAR_eta_1, 0,
        0, by_branch, 0, -PAR_k_2 / PAR_eta_2,
    };
    for (int i = 0; i < STATES * STATES; i++)
        jacobian[i] = columns[i];
}

static double pressure_at(const SmoothPiece *piece, double t)
{
    return piece->pressure + piece->pressure_slope * (t - piece->start);
}

static double voltage_at(const SmoothPiece *piece, double t)
{
    return piece->voltage + piece->voltage_slope * (t - piece->start);
}

static int cvode_rhs(double t, Vector y, Vector dy, void *data)
{
    const SmoothPiece *piece = data;
    tube_rhs(N_VGetArrayPointer(y), pressure_at(piece, t), voltage_at(piece, t),
             N_VGetArrayPointer(dy));
    return 0;
}

static int cvode_jacobian(double t, Vector y, Vector dy, Matrix m, void *data, Vector v1, Vector v2,
                          Vector v3)
{
    const SmoothPiece *piece = data;
    (void)dy, (void)v1, (void)v2, (void)v3;
    tube_jacobian(N_VGetArrayPointer(y), pressure_at(piece, t), voltage_at(piece, t),
                  SUNDenseMatrix_Data(m));
    return 0;
}

/* One piece from y at its start to y at its end. Samples are (times[i], lambda_2[i]) from *next on;
 * one at the end of the piece belongs to the next. Returns CVODE's flag, negative on failure. */
static int solve_piece(void *cvode, Vector y, SmoothPiece *piece, const double *times, int count,
                       int *next, double *lambda_2)
{
    double reached;
    int flag = CVodeReInit(cvode, piece->start, y);
    CVodeSetUserData(cvode, piece);
    for (; flag >= 0 && *next < count && times[*next] < piece->stop; ++*next) {
        if (times[*next] > piece->start)
            flag = CVode(cvode, times[*next], y, &reached, NORMAL);
        lambda_2[*next] = N_VGetArrayPointer(y)[0];
    }
    return flag < 0 ? flag : CVode(cvode, piece->stop, y, &reached, NORMAL);
}

/* lambda_2 at the rising `times` from x = `start` at the first piece; 0, or CVODE's negative flag.
 * Between pieces CVODE starts afresh, as the inputs have a corner or a jump there. */
int tube_solve(SmoothPiece *pieces, int piece_count, const double *start, const double *times, int count,
               double rtol, const double *atol, double *lambda_2)
{
    Context context;
    int flag = SUNContext_Create(0, &context), next = 0;
    if (flag != 0)
        return -1;
    Vector y = N_VNew_Serial(STATES, context), absolute = N_VNew_Serial(STATES, context);
    for (int i = 0; i < STATES; i++) {
        N_VGetArrayPointer(y)[i] = start[i];
        N_VGetArrayPointer(absolute)[i] = atol[i];
    }
    Matrix matrix = SUNDenseMatrix(STATES, STATES, context);
    Linear linear = SUNLinSol_Dense(y, matrix, context);
    void *cvode = CVodeCreate(BDF, context);
    CVodeInit(cvode, cvode_rhs, pieces[0].start, y);
    CVodeSVtolerances(cvode, rtol, absolute);
    CVodeSetLinearSolver(cvode, linear, matrix);
    CVodeSetJacFn(cvode, cvode_jacobian);
    CVodeSetMaxNumSteps(cvode, 10000000);

    for (int i = 0; flag >= 0 && i < piece_count; i++)
        flag = solve_piece(cvode, y, &pieces[i], times, count, &next, lambda_2);
    for (; flag >= 0 && next < count; next++)
        lambda_2[next] = N_VGetArrayPointer(y)[0];

    CVodeFree(&cvode);
    SUNLinSolFree(linear);
    SUNMatDestroy(matrix);
    N_VDestroy(absolute);
    N_VDestroy(y);
    SUNContext_Free(&context);
    return flag < 0 ? flag : 0;
}

/* Compiled part of the emulated control box: all kinematic fields of the robot state in one call, inverse dynamics, and
 * the estimate of the external torque. The Python side is compiled_arm.py and compiled_fields.py; the latter repeats
 * the layout of the struct Fields. Python passes an arm as a buffer of the doubles of the struct Arm. */
#include "hric_core/python_numbers.h"

#include "franka_sim/model_library/arm.h"
#include <float.h>

#define N 6
#define SENSORS 6 /* accelerometers on each side, top and bottom: one at each of the links 0 to 5 */

/* Inputs and results for one robot state; members are named as in BoxState (state.py). Matrices are column-major. */
typedef struct {
    /* each cycle */
    double q[7], q_d[7], dq[7], dq_d[7], ddq_d[7], tau_J[7], tau_before[7], tau_J_d[7];
    double tau_ext_hat_filtered[7], joint_collision[7], cartesian_collision[6];
    double dq_before[7];
    double generated; /* not 0 with a Cartesian generator */
    /* configured; contact thresholds: nominal ones, and those that apply while the desired motion accelerates */
    double period, least_singular_value, elbow_flip;
    double torques[7], forces[6], torques_acceleration[7], forces_acceleration[6];
    double F_T_EE[16], EE_T_K[16], F_T_NE[16], NE_T_EE[16];
    double m_ee, F_x_Cee[3], I_ee[9], m_load, F_x_Cload[3], I_load[9], O_ddP_O[3];
    /* computed */
    double O_T_EE[16], O_F_ext_hat_K[6], K_F_ext_hat_K[6], joint_contact[7], cartesian_contact[6], dtau_J[7], elbow[2];
    /* computed unless a Cartesian motion generator commands them */
    double O_T_EE_d[16], O_T_EE_c[16], O_dP_EE_d[6], elbow_d[2], elbow_c[2];
    double O_dP_EE_c[6], O_ddP_EE_c[6], delbow_c[2], ddelbow_c[2];
    double wrench_noise[6];          /* added to O_F_ext_hat_K; zero for noiseless sensors */
    Pose accelerometers[2][SENSORS]; /* in their links; zero without accelerometers */
    double specific_force[2][SENSORS][3];
} Fields;

/* Cholesky factor L of A - shift I = L L' (Golub and Van Loan, Matrix Computations, 4th ed., sec. 4.2). Returns 0 if
 * that matrix is not positive definite, that is, if A has an eigenvalue at or below the shift. */
static int factor(const double A[N][N], double shift, double L[N][N])
{
    for (int j = 0; j < N; ++j)
        for (int i = j; i < N; ++i) {
            double sum = i == j ? A[i][i] - shift : A[i][j];
            for (int k = 0; k < j; ++k)
                sum -= L[i][k] * L[j][k];
            if (i > j)
                L[i][j] = sum / L[j][j];
            else if (sum > 0.0)
                L[j][j] = sqrt(sum);
            else
                return 0;
        }
    return 1;
}

/* Least-squares solution F of tau = J^T F, from (J J^T) F = J tau. J is column-major. If J has a singular value below
 * `min_singular`, F is set to zero and 0 is returned. */
static int wrench(const double J[42], const double tau[JOINTS], double min_singular, double F[N])
{
    double A[N][N], L[N][N];
    memset(F, 0, N * sizeof(double));
    for (int i = 0; i < N; ++i)
        for (int j = 0; j <= i; ++j) {
            A[i][j] = 0.0;
            for (int k = 0; k < JOINTS; ++k)
                A[i][j] += J[N * k + i] * J[N * k + j];
        }
    if (!factor(A, min_singular * min_singular, L) || !factor(A, 0.0, L))
        return 0;
    for (int i = 0; i < N; ++i) {
        for (int k = 0; k < JOINTS; ++k)
            F[i] += J[N * k + i] * tau[k];
        for (int k = 0; k < i; ++k)
            F[i] -= L[i][k] * F[k];
        F[i] /= L[i][i];
    }
    for (int i = N - 1; i >= 0; --i) {
        for (int k = i + 1; k < N; ++k)
            F[i] -= L[k][i] * F[k];
        F[i] /= L[i][i];
    }
    return 1;
}

static double side(const Fields *f, const double q[JOINTS]) { return q[3] > f->elbow_flip ? 1.0 : -1.0; }

/* Specific forces (acceleration minus gravity) at the accelerometers, in their axes. The joint acceleration is the mean
 * over the last cycle. */
static void accelerate(const Pose poses[JOINTS], Fields *f)
{
    Spatial v = {{0}, {0}}, a = {{0}, {0}};
    for (int k = 0; k < 3; k++)
        a.v[k] = -f->O_ddP_O[k];
    for (int i = 0; i < SENSORS; i++) {
        const Pose *link = i > 0 ? &poses[i - 1] : &WORLD;
        if (i > 0) {
            Spatial S = {{0}, {0}};
            joint_axis(link, S.w);
            add_cross(link->p, S.w, S.v);
            pass_joint(&S, f->dq[i - 1], (f->dq[i - 1] - f->dq_before[i - 1]) / f->period, &v, &a);
        }
        for (int side = 0; side < 2; side++) {
            const Pose *in_link = &f->accelerometers[side][i];
            Pose sensor;
            double velocity[3], force[3];
            compose(link, in_link->R, in_link->p, &sensor);
            memcpy(velocity, v.v, sizeof velocity);
            add_cross(v.w, sensor.p, velocity);
            memcpy(force, a.v, sizeof force);
            add_cross(a.w, sensor.p, force);
            add_cross(v.w, velocity, force);
            rotate_back(sensor.R, force, f->specific_force[side][i]);
        }
    }
}

static void measured(const Arm *arm, Fields *f)
{
    double J[42];
    Pose poses[JOINTS + 1], tool, stiffness;
    forward(arm, f->q, poses);
    if (dot(f->accelerometers[0][0].R, f->accelerometers[0][0].R) > 0.0)
        accelerate(poses, f);
    beyond(&poses[FLANGE], f->F_T_EE, &tool);
    write_pose(&tool, f->O_T_EE);
    beyond(&tool, f->EE_T_K, &stiffness);
    write_jacobian(poses, JOINTS, &stiffness, 0, J);
    if (wrench(J, f->tau_ext_hat_filtered, f->least_singular_value, f->O_F_ext_hat_K))
        for (int i = 0; i < N; ++i)
            f->O_F_ext_hat_K[i] += f->wrench_noise[i];
    rotate_back(stiffness.R, f->O_F_ext_hat_K, f->K_F_ext_hat_K);
    rotate_back(stiffness.R, f->O_F_ext_hat_K + 3, f->K_F_ext_hat_K + 3);
}

static void desired(const Arm *arm, Fields *f)
{
    double J[42];
    Pose poses[JOINTS + 1], tool;
    forward(arm, f->q_d, poses);
    beyond(&poses[FLANGE], f->F_T_EE, &tool);
    write_pose(&tool, f->O_T_EE_d);
    memcpy(f->O_T_EE_c, f->O_T_EE_d, sizeof f->O_T_EE_c);
    write_jacobian(poses, JOINTS, &tool, 0, J);
    for (int i = 0; i < N; ++i) {
        f->O_dP_EE_d[i] = 0.0;
        for (int k = 0; k < JOINTS; ++k)
            f->O_dP_EE_d[i] += J[N * k + i] * f->dq_d[k];
        f->O_dP_EE_c[i] = f->O_ddP_EE_c[i] = 0.0;
    }
    f->elbow_d[0] = f->elbow_c[0] = f->q_d[2];
    f->elbow_d[1] = f->elbow_c[1] = side(f, f->q_d);
    for (int i = 0; i < 2; ++i)
        f->delbow_c[i] = f->ddelbow_c[i] = 0.0;
}

static void fill(const Arm *arm, Fields *f)
{
    int accelerating = 0;
    measured(arm, f);
    f->elbow[0] = f->q[2];
    f->elbow[1] = side(f, f->q);
    if (f->generated == 0.0)
        desired(arm, f);
    for (int i = 0; i < JOINTS; i++)
        accelerating |= f->ddq_d[i] != 0.0;
    const double *torques = accelerating ? f->torques_acceleration : f->torques,
                 *forces = accelerating ? f->forces_acceleration : f->forces;
    for (int i = 0; i < JOINTS; i++) {
        f->joint_contact[i] = fabs(f->tau_ext_hat_filtered[i]) > torques[i];
        f->dtau_J[i] = (f->tau_J[i] - f->tau_before[i]) / f->period;
    }
    for (int i = 0; i < N; i++)
        f->cartesian_contact[i] = fabs(f->K_F_ext_hat_K[i]) > forces[i];
}

/* -- functions called from Python ---------------------------------------------------------------------------------- */

static int take_arm(PyObject *buffer, Arm *arm) { return copy_buffer(buffer, sizeof *arm, arm, "an arm"); }

/* Payload of the arm, and the gravity vector of its mounting. */
typedef struct {
    double gravity[3]; /* in the base frame */
    double inertia[9], mass, com[3];
} Mounting;

typedef struct {
    double q[JOINTS];
    Mounting mounting;
    Arm arm;
} Where;

typedef struct {
    Spatial S[JOINTS];
    Body bodies[JOINTS];
} Placed;

static int take_where(PyObject *arm, PyObject *mounting, PyObject *q, Where *where)
{
    return take_arm(arm, &where->arm) && copy_buffer(mounting, sizeof where->mounting, &where->mounting, "a mounting")
           && take(q, JOINTS, where->q);
}

static int same(const double *a, const double *b, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (a[i] != b[i])
            return 0;
    return 1;
}

/* Joint axes and body inertias of the arm in its present pose. The result of the last call is cached, because a cycle
 * begins in the pose in which the previous one ended. */
static const Placed *placed(const Where *where)
{
    static Where last;
    static Placed bodies;
    static int any = 0;
    if (!any || !same((const double *)&last, (const double *)where, sizeof last / sizeof(double))) {
        const Mounting *m = &where->mounting;
        place_bodies(&where->arm, &(Load){m->inertia, m->mass, m->com}, where->q, bodies.S, bodies.bodies);
        last = *where;
        any = 1;
    }
    return &bodies;
}

static void efforts(const Where *where, const double dq[JOINTS], const double ddq[JOINTS], double tau[JOINTS])
{
    const Placed *at = placed(where);
    newton_euler(at->S, at->bodies, where->mounting.gravity, dq, ddq, tau);
}

FUNCTION(inverse_dynamics)
{
    Where where;
    double dq[JOINTS], ddq[JOINTS], tau[JOINTS];
    if (!expect(count, 5, "inverse_dynamics(arm, mounting, q, dq, ddq)")
        || !take_where(given[0], given[1], given[2], &where) || !take(given[3], JOINTS, dq)
        || !take(given[4], JOINTS, ddq))
        return NULL;
    efforts(&where, dq, ddq, tau);
    return list(tau, JOINTS);
}

/* Replace the elements of a list of seven; return 0 with a Python error set on failure. */
static int put(const double values[JOINTS], PyObject *target)
{
    for (int i = 0; i < JOINTS; i++) {
        PyObject *value = PyFloat_FromDouble(values[i]);
        if (value == NULL || PyList_SetItem(target, i, value) < 0)
            return 0;
    }
    return 1;
}

FUNCTION(external_torque)
{
    enum { VALUE, DQ, Q_NOW, DQ_NOW, TAU, FRICTION, VECTORS };
    Where where;
    double constants[2], x[VECTORS][JOINTS], ddq[JOINTS], expected[JOINTS], gravity[JOINTS];
    if (!expect(count, 4 + VECTORS,
                "external_torque(arm, mounting, (rate, gain), q, value, dq, q_now, dq_now, tau, friction)")
        || !take_where(given[0], given[1], given[3], &where) || !take(given[2], 2, constants))
        return NULL;
    for (int k = 0; k < VECTORS; k++)
        if (!take(given[4 + k], JOINTS, x[k]))
            return NULL;
    for (int i = 0; i < JOINTS; i++)
        ddq[i] = constants[0] * (x[DQ_NOW][i] - x[DQ][i]);
    efforts(&where, x[DQ], ddq, expected);
    for (int i = 0; i < JOINTS; i++)
        x[VALUE][i] += constants[1] * (x[TAU][i] - expected[i] - x[FRICTION][i] - x[VALUE][i]);
    memcpy(where.q, x[Q_NOW], sizeof where.q);
    efforts(&where, STILL, STILL, gravity);
    return put(x[VALUE], given[4]) ? list(gravity, JOINTS) : NULL;
}

/* Bounds of the measured state beyond which reflexes.py checks it in detail. gate: bound of the squared norm of the
 * external torque [N^2 m^2]. */
typedef struct {
    double velocity[JOINTS], lower[JOINTS], upper[JOINTS], reach[JOINTS], gate;
} Bounds;

/* Upper bound of the speed of any point of the arm, sum |dq_i| reach_i [m/s]; -1 if a joint is too fast or out of its
 * range, the external torque is above the gate, or a value is not finite. */
FUNCTION(quiet_speed)
{
    Bounds bounds;
    double q[JOINTS], dq[JOINTS], tau[JOINTS], square = 0.0, speed = 0.0;
    if (!expect(count, 4, "quiet_speed(bounds, q, dq, tau)")
        || !copy_buffer(given[0], sizeof bounds, &bounds, "a set of bounds") || !take(given[1], JOINTS, q)
        || !take(given[2], JOINTS, dq) || !take(given[3], JOINTS, tau))
        return NULL;
    int quiet = 1;
    for (int i = 0; i < JOINTS; i++) {
        quiet = quiet && fabs(dq[i]) <= bounds.velocity[i] && bounds.lower[i] <= q[i] && q[i] <= bounds.upper[i];
        square += tau[i] * tau[i];
        speed += fabs(dq[i]) * bounds.reach[i];
    }
    return PyFloat_FromDouble(quiet && square <= bounds.gate ? speed : -1.0);
}

/* Open a view of a buffer of Fields and compute the results in it. On failure, return 0 with a Python error set. */
static int filled(PyObject *arm_buffer, PyObject *buffer, Py_buffer *view)
{
    Arm arm;
    if (!take_arm(arm_buffer, &arm) || PyObject_GetBuffer(buffer, view, PyBUF_WRITABLE) < 0)
        return 0;
    if (view->len == sizeof(Fields)) {
        fill(&arm, view->buf);
        return 1;
    }
    PyErr_Format(PyExc_ValueError, "the fields are %zu bytes, got %zd", sizeof(Fields), view->len);
    PyBuffer_Release(view);
    return 0;
}

FUNCTION(fields)
{
    Py_buffer view;
    if (!expect(count, 2, "fields(arm, values)") || !filled(given[0], given[1], &view))
        return NULL;
    PyBuffer_Release(&view);
    Py_RETURN_NONE;
}

/* Bytes of a datagram: the fields with the indices `places`, as doubles if `wide`, else as floats; a value beyond the
 * range of a float becomes the largest float. */
static PyObject *packed(const double *fields, const int *places, Py_ssize_t n, int wide)
{
    const size_t size = wide ? sizeof(double) : sizeof(float);
    PyObject *made = PyBytes_FromStringAndSize(NULL, n * (Py_ssize_t)size);
    char *out = made == NULL ? NULL : PyBytes_AS_STRING(made);
    for (Py_ssize_t i = 0; made != NULL && i < n; i++, out += size) {
        if (places[i] < 0 || (size_t)places[i] >= sizeof(Fields) / sizeof(double)) {
            PyErr_SetString(PyExc_IndexError, "an index is outside the struct Fields");
            Py_CLEAR(made);
            break;
        }
        const double x = fields[places[i]];
        const float narrow = x > FLT_MAX ? FLT_MAX : x < -FLT_MAX ? -FLT_MAX : (float)x;
        if (wide)
            memcpy(out, &x, sizeof x);
        else
            memcpy(out, &narrow, sizeof narrow);
    }
    return made;
}

/* Compute all fields, then pack those with the indices `places`, a buffer of ints. */
FUNCTION(numbers)
{
    Py_buffer view, places;
    if (!expect(count, 4, "numbers(arm, values, places, bits)") || !filled(given[0], given[1], &view))
        return NULL;
    const int wide = PyLong_AsLong(given[3]) == 64;
    PyObject *made = NULL;
    if (!PyErr_Occurred() && PyObject_GetBuffer(given[2], &places, PyBUF_SIMPLE) == 0) {
        made = packed(view.buf, places.buf, places.len / (Py_ssize_t)sizeof(int), wide);
        PyBuffer_Release(&places);
    }
    PyBuffer_Release(&view);
    return made;
}

static PyMethodDef methods[] = {
    METHOD(inverse_dynamics, "(arm, mounting, q, dq, ddq): joint torques"),
    METHOD(external_torque,
           "(arm, mounting, (rate, gain), q, value, dq, q_now, dq_now, tau, friction) -> gravity at q_now; the list "
           "value is written in place"),
    METHOD(quiet_speed, "(bounds, q, dq, tau): upper bound of any point's speed [m/s]; -1 if a value is out of bounds"),
    METHOD(fields, "(arm, values): compute the fields in place"),
    METHOD(numbers, "(arm, values, places, bits): compute the fields, return those with these indices as bytes"),
    {0},
};

MODULE(hric_arm, methods)

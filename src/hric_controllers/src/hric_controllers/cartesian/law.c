/* Compiled part of the Cartesian impedance law of an arm with up to seven joints; the formulas are in law.py.
 *
 * The order of the operations is part of the interface: runs are compared bit by bit. */
#include "hric_core/python_numbers.h"
#include "hric_dynamics/factors.h"
#include <math.h>

enum { AXES = 6, JOINTS = 7 }; /* JOINTS: most joints */

/* Regularisation of J (M+B)^-1 J^T, so that it can be inverted in singular poses [1/kg]. */
#define SINGULAR 1e-6

/* Subtract from tau_0 the torque J^T F that keeps it from accelerating the end effector, F = Lambda J (M+B)^-1 tau_0.
 * n: number of joints; J: row-major; M: mass matrix with rotor inertia. */
static void project(int n, const double *J, const double *M, double *tau_0)
{
    double factors[JOINTS * JOINTS], X[AXES][JOINTS], mobility[AXES * AXES], F[AXES]; /* X: rows of J (M+B)^-1 */
    memcpy(factors, M, n * n * sizeof *M);
    factor(n, factors);
    for (int i = 0; i < AXES; i++) {
        memcpy(X[i], J + n * i, n * sizeof *J);
        solve(n, factors, X[i]);
        F[i] = 0.0;
        for (int k = 0; k < n; k++)
            F[i] += X[i][k] * tau_0[k];
    }
    for (int i = 0; i < AXES; i++)
        for (int j = 0; j < AXES; j++) {
            mobility[AXES * i + j] = i == j ? SINGULAR : 0.0;
            for (int k = 0; k < n; k++)
                mobility[AXES * i + j] += J[n * i + k] * X[j][k];
        }
    factor(AXES, mobility);
    solve(AXES, mobility, F);
    for (int k = 0; k < n; k++)
        for (int i = 0; i < AXES; i++)
            tau_0[k] -= J[n * i + k] * F[i];
}

/* Compute the wrench of spring and damper of n joints; J: row-major. */
static void push(int n, const double K[AXES], const double D[AXES], const double error[AXES], double limit,
                 const double twist[AXES], const double *J, const double dq[JOINTS], double F[AXES])
{
    for (int i = 0; i < AXES; i++)
        F[i] = -K[i] * error[i];
    const double force = sqrt(F[0] * F[0] + F[1] * F[1] + F[2] * F[2]);
    for (int i = 0; force > limit && i < 3; i++)
        F[i] *= limit / fmax(force, 1e-9);
    for (int i = 0; i < AXES; i++) {
        double speed = -twist[i];
        for (int k = 0; k < n; k++)
            speed += J[n * i + k] * dq[k];
        F[i] -= D[i] * speed;
    }
}

/* Get the buffers of arrays of doubles of these lengths; return 0 with a Python error set on failure. */
static int arrays(PyObject *const *given, int count, const int *lengths, Py_buffer *views)
{
    Py_ssize_t bytes[3];
    for (int i = 0; i < count; i++)
        bytes[i] = lengths[i] * (Py_ssize_t)sizeof(double);
    if (!take_views(given, count, count, views))
        return 0;
    if (views_fit(views, count, bytes))
        return 1;
    release_views(views, count);
    return 0;
}

/* Return the number of joints, the length of a sequence of numbers; 0 with a Python error set on failure. */
static int joints(PyObject *values)
{
    const Py_ssize_t n = PySequence_Size(values);
    if (n >= 1 && n <= JOINTS)
        return (int)n;
    if (!PyErr_Occurred())
        PyErr_Format(PyExc_ValueError, "1 to %d joints are needed, got %zd", JOINTS, n);
    return 0;
}

FUNCTION(null_space)
{
    if (!expect(count, 3, "null_space(J, mass, tau_0)"))
        return NULL;
    const int n = joints(given[2]), lengths[] = {AXES * n, n * n};
    Py_buffer views[2];
    double tau[JOINTS];
    if (n == 0 || !take(given[2], n, tau) || !arrays(given, 2, lengths, views))
        return NULL;
    project(n, views[0].buf, views[1].buf, tau);
    release_views(views, 2);
    return list(tau, n);
}

FUNCTION(torque)
{
    enum {
        STIFFNESS,
        DAMPING,
        ERROR,
        TWIST,
        LIMIT,
        POSTURE_STIFFNESS,
        POSTURE,
        Q,
        DQ,
        JACOBIAN,
        MASS,
        CORIOLIS,
        COUNT
    };
    double of_axes[4][AXES], of_joints[3][JOINTS], F[AXES], tau[JOINTS], tau_0[JOINTS];
    if (!expect(count, COUNT,
                "torque(stiffness, damping, error, twist, force_limit, nullspace_stiffness, posture, q, dq, J, mass, "
                "coriolis)"))
        return NULL;
    const int n = joints(given[Q]), lengths[] = {AXES * n, n * n, n};
    if (n == 0)
        return NULL;
    const double limit = PyFloat_AsDouble(given[LIMIT]), k = PyFloat_AsDouble(given[POSTURE_STIFFNESS]);
    Py_buffer views[3];
    for (int i = 0; i < 4; i++)
        if (!take(given[STIFFNESS + i], AXES, of_axes[i]))
            return NULL;
    for (int i = 0; i < 3; i++)
        if (!take(given[POSTURE + i], n, of_joints[i]))
            return NULL;
    if (PyErr_Occurred() || !arrays(given + JACOBIAN, 3, lengths, views))
        return NULL;
    const double *J = views[0].buf, *coriolis = views[2].buf, *dq = of_joints[2];
    push(n, of_axes[STIFFNESS], of_axes[DAMPING], of_axes[ERROR], limit, of_axes[TWIST], J, dq, F);
    for (int j = 0; j < n; j++) {
        tau[j] = 0.0;
        for (int i = 0; i < AXES; i++)
            tau[j] += J[n * i + j] * F[i];
        tau[j] += coriolis[j];
        tau_0[j] = k * (of_joints[0][j] - of_joints[1][j]) - 2.0 * sqrt(k) * dq[j];
    }
    if (k > 0.0)
        project(n, J, views[1].buf, tau_0);
    for (int j = 0; k > 0.0 && j < n; j++)
        tau[j] += tau_0[j];
    release_views(views, 3);
    return Py_BuildValue("(NN)", list(tau, n), list(F, AXES));
}

static PyMethodDef methods[] = {
    METHOD(null_space, "(J, mass, tau_0) -> N tau_0"),
    METHOD(torque, "(stiffness, damping, error, twist, force_limit, nullspace_stiffness, posture, q, dq, J, mass, "
                   "coriolis) -> joint torques, wrench of spring and damper"),
    {0},
};

MODULE(hric_cartesian_law, methods)

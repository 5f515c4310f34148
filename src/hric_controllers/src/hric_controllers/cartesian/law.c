/* Compiled part of the Cartesian impedance law of an arm with seven joints; the formulas are in law.py.
 *
 * The order of the operations is part of the interface: runs are compared bit by bit. */
#include "hric_core/python_numbers.h"
#include "hric_dynamics/factors.h"
#include <math.h>

enum { AXES = 6, JOINTS = 7 };

/* Regularisation of J (M+B)^-1 J^T, so that it can be inverted in singular poses [1/kg]. */
#define SINGULAR 1e-6

/* Subtract from tau_0 the torque J^T F that keeps it from accelerating the end effector, F = Lambda J (M+B)^-1 tau_0.
 * J: row-major; M: mass matrix with rotor inertia. */
static void project(const double *J, const double *M, double *tau_0)
{
    double factors[JOINTS * JOINTS], X[AXES][JOINTS], mobility[AXES * AXES], F[AXES]; /* X: rows of J (M+B)^-1 */
    memcpy(factors, M, sizeof factors);
    factor(JOINTS, factors);
    for (int i = 0; i < AXES; i++) {
        memcpy(X[i], J + JOINTS * i, sizeof X[i]);
        solve(JOINTS, factors, X[i]);
        F[i] = 0.0;
        for (int k = 0; k < JOINTS; k++)
            F[i] += X[i][k] * tau_0[k];
    }
    for (int i = 0; i < AXES; i++)
        for (int j = 0; j < AXES; j++) {
            mobility[AXES * i + j] = i == j ? SINGULAR : 0.0;
            for (int k = 0; k < JOINTS; k++)
                mobility[AXES * i + j] += J[JOINTS * i + k] * X[j][k];
        }
    factor(AXES, mobility);
    solve(AXES, mobility, F);
    for (int k = 0; k < JOINTS; k++)
        for (int i = 0; i < AXES; i++)
            tau_0[k] -= J[JOINTS * i + k] * F[i];
}

/* Compute the wrench of spring and damper; J: row-major. */
static void push(const double K[AXES], const double D[AXES], const double error[AXES], double limit,
                 const double twist[AXES], const double *J, const double dq[JOINTS], double F[AXES])
{
    for (int i = 0; i < AXES; i++)
        F[i] = -K[i] * error[i];
    const double force = sqrt(F[0] * F[0] + F[1] * F[1] + F[2] * F[2]);
    for (int i = 0; force > limit && i < 3; i++)
        F[i] *= limit / fmax(force, 1e-9);
    for (int i = 0; i < AXES; i++) {
        double speed = -twist[i];
        for (int k = 0; k < JOINTS; k++)
            speed += J[JOINTS * i + k] * dq[k];
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

FUNCTION(null_space)
{
    const int lengths[] = {AXES * JOINTS, JOINTS * JOINTS};
    Py_buffer views[2];
    double tau[JOINTS];
    if (!expect(count, 3, "null_space(J, mass, tau_0)") || !take(given[2], JOINTS, tau)
        || !arrays(given, 2, lengths, views))
        return NULL;
    project(views[0].buf, views[1].buf, tau);
    release_views(views, 2);
    return list(tau, JOINTS);
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
    const int lengths[] = {AXES * JOINTS, JOINTS * JOINTS, JOINTS};
    double of_axes[4][AXES], of_joints[3][JOINTS], F[AXES], tau[JOINTS], tau_0[JOINTS];
    if (!expect(count, COUNT,
                "torque(stiffness, damping, error, twist, force_limit, nullspace_stiffness, posture, q, dq, J, mass, "
                "coriolis)"))
        return NULL;
    const double limit = PyFloat_AsDouble(given[LIMIT]), k = PyFloat_AsDouble(given[POSTURE_STIFFNESS]);
    Py_buffer views[3];
    for (int i = 0; i < 4; i++)
        if (!take(given[STIFFNESS + i], AXES, of_axes[i]))
            return NULL;
    for (int i = 0; i < 3; i++)
        if (!take(given[POSTURE + i], JOINTS, of_joints[i]))
            return NULL;
    if (PyErr_Occurred() || !arrays(given + JACOBIAN, 3, lengths, views))
        return NULL;
    const double *J = views[0].buf, *coriolis = views[2].buf, *dq = of_joints[2];
    push(of_axes[STIFFNESS], of_axes[DAMPING], of_axes[ERROR], limit, of_axes[TWIST], J, dq, F);
    for (int j = 0; j < JOINTS; j++) {
        tau[j] = 0.0;
        for (int i = 0; i < AXES; i++)
            tau[j] += J[JOINTS * i + j] * F[i];
        tau[j] += coriolis[j];
        tau_0[j] = k * (of_joints[0][j] - of_joints[1][j]) - 2.0 * sqrt(k) * dq[j];
    }
    if (k > 0.0)
        project(J, views[1].buf, tau_0);
    for (int j = 0; k > 0.0 && j < JOINTS; j++)
        tau[j] += tau_0[j];
    release_views(views, 3);
    return Py_BuildValue("(NN)", list(tau, JOINTS), list(F, AXES));
}

static PyMethodDef methods[] = {
    METHOD(null_space, "(J, mass, tau_0) -> N tau_0"),
    METHOD(torque, "(stiffness, damping, error, twist, force_limit, nullspace_stiffness, posture, q, dq, J, mass, "
                   "coriolis) -> joint torques, wrench of spring and damper"),
    {0},
};

MODULE(hric_cartesian_law, methods)

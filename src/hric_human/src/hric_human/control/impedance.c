/* Sums over the joints of the impedance law of a person, and of its reference between two knots; the formulas are in
 * impedance.py and references.py.
 *
 * The order of the operations is part of the interface: runs are compared bit by bit. */
#include "hric_core/python_numbers.h"
#include <math.h>

enum { MOST = 64 }; /* joints */

/* Stiffness between shoulder and elbow: without load, its growth with the elbow's gravity torque, and its limit. */
typedef struct {
    double relaxed, growth, limit;
} Cross;

/* Take `rows` sequences of n numbers; return 0 with a Python error set on failure. */
static int take_rows(PyObject *const *given, int rows, Py_ssize_t n, double (*out)[MOST])
{
    if (n < 0 || n > MOST) {
        if (!PyErr_Occurred())
            PyErr_Format(PyExc_ValueError, "0 to %d joints are possible", MOST);
        return 0;
    }
    for (int i = 0; i < rows; i++)
        if (!take(given[i], n, out[i]))
            return 0;
    return 1;
}

/* Add the torque of the muscles that span the shoulder and the elbow of an arm; `at`: indices of the flexion, abduction
 * and rotation of the shoulder, and of the elbow. */
static void couple(const double at[4], Cross c, const double *q, const double *weight, const double *K,
                   const double *behind, double *tau)
{
    const int f = (int)at[0], a = (int)at[1], r = (int)at[2], e = (int)at[3];
    const double own = (K[a] < K[f] ? K[a] : K[f]) * K[e];
    const double grown = c.relaxed + c.growth * fabs(weight[e]), most = c.limit * sqrt(own);
    const double cross = most < grown ? most : grown;
    /* components of the elbow's axis along the axes of flexion and abduction */
    const double flexion = cos(q[a]) * cos(q[r]), abduction = -sin(q[r]);
    tau[f] += cross * flexion * behind[e];
    tau[a] += cross * abduction * behind[e];
    tau[e] += cross * (flexion * behind[f] + abduction * behind[a]);
}

/* Add the torques of all arms; return 0 with a Python error set on failure. */
static int couple_all(PyObject *arms, PyObject *cross, Py_ssize_t n, const double *q, const double *weight,
                      const double *K, const double *behind, double *tau)
{
    Cross c;
    if (!PyList_Check(arms)) {
        PyErr_SetString(PyExc_TypeError, "the arms must be a list");
        return 0;
    }
    if (!take(cross, 3, (double *)&c))
        return 0;
    for (Py_ssize_t arm = 0; arm < PyList_GET_SIZE(arms); arm++) {
        double at[4];
        if (!take(PyList_GET_ITEM(arms, arm), 4, at))
            return 0;
        for (int k = 0; k < 4; k++)
            if (!(at[k] >= 0.0 && at[k] < (double)n)) {
                PyErr_Format(PyExc_IndexError, "there are %zd joints", n);
                return 0;
            }
        couple(at, c, q, weight, K, behind, tau);
    }
    return 1;
}

FUNCTION(torque)
{
    enum {
        RELAXED,
        GROWTH,
        DAMPING,
        Q_REF,
        DQ_REF,
        Q,
        DQ,
        LATE_Q,
        LATE_DQ,
        WEIGHT,
        ROWS,
        REFLEX = ROWS,
        LEAD,
        ARMS,
        CROSS,
        COUNT
    };
    double x[ROWS][MOST], tau[MOST], K[MOST], behind[MOST];
    if (!expect(count, COUNT,
                "torque(relaxed, growth, damping, q_ref, dq_ref, q, dq, late_q, late_dq, weight, reflex, lead, arms, "
                "cross)"))
        return NULL;
    const Py_ssize_t n = PySequence_Size(given[0]);
    const double reflex = PyFloat_AsDouble(given[REFLEX]), lead = PyFloat_AsDouble(given[LEAD]);
    if (PyErr_Occurred() || !take_rows(given, ROWS, n, x))
        return NULL;
    for (Py_ssize_t i = 0; i < n; i++) {
        const double q = x[Q][i] + reflex * (x[LATE_Q][i] - x[Q][i]);
        const double dq = x[DQ][i] + reflex * (x[LATE_DQ][i] - x[DQ][i]);
        K[i] = x[RELAXED][i] + x[GROWTH][i] * fabs(x[WEIGHT][i]);
        behind[i] = x[Q_REF][i] - q + lead * (x[DQ_REF][i] - dq);
        tau[i] = K[i] * behind[i] + x[DAMPING][i] * (x[DQ_REF][i] - dq) + x[WEIGHT][i];
    }
    if (!couple_all(given[ARMS], given[CROSS], n, x[LATE_Q], x[WEIGHT], K, behind, tau))
        return NULL;
    return list(tau, n);
}

FUNCTION(cubic)
{
    enum { A, B, C, D, ROWS, U = ROWS, RATE, COUNT };
    double x[ROWS][MOST], q[MOST], dq[MOST];
    if (!expect(count, COUNT, "cubic(a, b, c, d, u, rate)"))
        return NULL;
    const Py_ssize_t n = PySequence_Size(given[0]);
    const double u = PyFloat_AsDouble(given[U]), rate = PyFloat_AsDouble(given[RATE]);
    if (PyErr_Occurred() || !take_rows(given, ROWS, n, x))
        return NULL;
    for (Py_ssize_t i = 0; i < n; i++) {
        q[i] = x[A][i] + u * (x[B][i] + u * (x[C][i] + u * x[D][i]));
        dq[i] = rate * (x[B][i] + u * (2.0 * x[C][i] + 3.0 * u * x[D][i]));
    }
    return Py_BuildValue("(NN)", list(q, n), list(dq, n));
}

static PyMethodDef methods[] = {
    METHOD(torque, "(relaxed, growth, damping, q_ref, dq_ref, q, dq, late_q, late_dq, weight, reflex, lead, arms, "
                   "cross) -> torque"),
    METHOD(cubic, "(a, b, c, d, u, rate) -> values and their rates"),
    {0},
};

MODULE(hric_human_impedance, methods)

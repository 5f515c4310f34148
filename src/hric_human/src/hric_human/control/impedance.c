/* Sums over the joints of the impedance law of a person, and of its reference between two knots; the formulas are in
 * impedance.py and references.py.
 *
 * The order of the operations is part of the interface: runs are compared bit by bit. */
#include "hric_core/python_numbers.h"
#include <math.h>

enum { MOST = 64 }; /* joints */

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

FUNCTION(torque)
{
    enum { RELAXED, GROWTH, DAMPING, Q_REF, DQ_REF, Q, DQ, LATE_Q, LATE_DQ, WEIGHT, ROWS, REFLEX = ROWS, LEAD, COUNT };
    double x[ROWS][MOST], tau[MOST], K[MOST], behind[MOST];
    if (!expect(count, COUNT,
                "torque(relaxed, growth, damping, q_ref, dq_ref, q, dq, late_q, late_dq, weight, reflex, lead)"))
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
    return Py_BuildValue("(NNN)", list(tau, n), list(K, n), list(behind, n));
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
    METHOD(torque, "(relaxed, growth, damping, q_ref, dq_ref, q, dq, late_q, late_dq, weight, reflex, lead) -> "
                   "torque, stiffness, deviation"),
    METHOD(cubic, "(a, b, c, d, u, rate) -> values and their rates"),
    {0},
};

MODULE(hric_human_impedance, methods)

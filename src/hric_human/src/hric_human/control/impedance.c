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

/* Indices of the flexion, abduction and rotation of the shoulder, and of the elbow. */
typedef struct {
    int flexion, abduction, rotation, elbow;
} Coupling;

/* Impedance of n joints: stiffness without load and its growth, damping, share of reflexes, damping per stiffness. */
typedef struct {
    PyObject_HEAD
    int joints, arms;
    double relaxed[MOST], growth[MOST], damping[MOST], reflex, lead;
    Cross cross;
    Coupling *arm;
} Impedance;

/* Take `rows` sequences of n numbers; return 0 with a Python error set on failure. */
static int take_rows(PyObject *const *given, int rows, Py_ssize_t n, double (*out)[MOST])
{
    for (int i = 0; i < rows; i++)
        if (!take(given[i], n, out[i]))
            return 0;
    return 1;
}

/* Return the length of a sequence with at most MOST elements; -1 with a Python error set on failure. */
static Py_ssize_t length(PyObject *sequence)
{
    const Py_ssize_t n = PySequence_Size(sequence);
    if (n <= MOST)
        return n;
    PyErr_Format(PyExc_ValueError, "0 to %d joints are possible", MOST);
    return -1;
}

/* ---- the law ---- */

/* Add the torque of the muscles that span the shoulder and the elbow of an arm. */
static void couple(Coupling at, Cross c, const double *q, const double *weight, const double *K, const double *behind,
                   double *tau)
{
    const int f = at.flexion, a = at.abduction, e = at.elbow;
    const double own = (K[a] < K[f] ? K[a] : K[f]) * K[e];
    const double grown = c.relaxed + c.growth * fabs(weight[e]), most = c.limit * sqrt(own);
    const double cross = most < grown ? most : grown;
    /* components of the elbow's axis along the axes of flexion and abduction */
    const double flexion = cos(q[a]) * cos(q[at.rotation]), abduction = -sin(q[at.rotation]);
    tau[f] += cross * flexion * behind[e];
    tau[a] += cross * abduction * behind[e];
    tau[e] += cross * (flexion * behind[f] + abduction * behind[a]);
}

static PyObject *impedance_torque(Impedance *self, PyObject *const *given, Py_ssize_t count)
{
    enum { Q_REF, DQ_REF, Q, DQ, LATE_Q, LATE_DQ, WEIGHT, ROWS };
    double x[ROWS][MOST], tau[MOST], K[MOST], behind[MOST];
    const int n = self->joints;
    if (!expect(count, ROWS, "torque(q_ref, dq_ref, q, dq, late_q, late_dq, weight)") || !take_rows(given, ROWS, n, x))
        return NULL;
    for (int i = 0; i < n; i++) {
        const double q = x[Q][i] + self->reflex * (x[LATE_Q][i] - x[Q][i]);
        const double dq = x[DQ][i] + self->reflex * (x[LATE_DQ][i] - x[DQ][i]);
        K[i] = self->relaxed[i] + self->growth[i] * fabs(x[WEIGHT][i]);
        behind[i] = x[Q_REF][i] - q + self->lead * (x[DQ_REF][i] - dq);
        tau[i] = K[i] * behind[i] + self->damping[i] * (x[DQ_REF][i] - dq) + x[WEIGHT][i];
    }
    for (const Coupling *arm = self->arm; arm < self->arm + self->arms; arm++)
        couple(*arm, self->cross, x[LATE_Q], x[WEIGHT], K, behind, tau);
    return list(tau, n);
}

static int impedance_init(Impedance *self, PyObject *args)
{
    PyObject *rows[3], *arms;
    if (!PyArg_ParseTuple(args, "OOOddO!(ddd)", rows, rows + 1, rows + 2, &self->reflex, &self->lead, &PyList_Type,
                          &arms, &self->cross.relaxed, &self->cross.growth, &self->cross.limit))
        return -1;
    self->joints = (int)length(rows[0]);
    if (self->joints < 0 || !take(rows[0], self->joints, self->relaxed) || !take(rows[1], self->joints, self->growth)
        || !take(rows[2], self->joints, self->damping))
        return -1;
    self->arm = zeroed((size_t)PyList_GET_SIZE(arms), sizeof(Coupling));
    for (; self->arm != NULL && self->arms < PyList_GET_SIZE(arms); self->arms++) {
        int *at = &self->arm[self->arms].flexion;
        if (!PyArg_ParseTuple(PyList_GET_ITEM(arms, self->arms), "iiii", at, at + 1, at + 2, at + 3)
            || !below(at, 4, self->joints))
            return -1;
    }
    return self->arm == NULL ? -1 : 0;
}

static void impedance_clear(Impedance *self) { PyMem_Free(self->arm); }

static PyMethodDef impedance_methods[] = {
    {"torque", FAST(impedance_torque), "(q_ref, dq_ref, q, dq, late_q, late_dq, weight) -> torque"}, {0}};

/* ---- the reference ---- */

enum { A, B, C, D, TERMS };

FUNCTION(cubics)
{
    enum { BEFORE, START, GOAL, AFTER, ROWS };
    double x[ROWS][MOST];
    if (!expect(count, ROWS, "cubics(before, start, goal, after)"))
        return NULL;
    const Py_ssize_t n = length(given[0]);
    if (n < 0 || !take_rows(given, ROWS, n, x))
        return NULL;
    PyObject *made = PyBytes_FromStringAndSize(NULL, TERMS * n * (Py_ssize_t)sizeof(double));
    double (*term)[TERMS] = made == NULL ? NULL : (void *)PyBytes_AS_STRING(made);
    for (Py_ssize_t i = 0; made != NULL && i < n; i++) {
        const double a = x[START][i], b = x[GOAL][i], v = 0.5 * (b - x[BEFORE][i]), w = 0.5 * (x[AFTER][i] - a);
        term[i][A] = a;
        term[i][B] = v;
        term[i][C] = 3.0 * (b - a) - 2.0 * v - w;
        term[i][D] = 2.0 * (a - b) + v + w;
    }
    return made;
}

FUNCTION(cubic)
{
    enum { CUBICS, U, RATE, COUNT };
    double q[MOST], dq[MOST];
    if (!expect(count, COUNT, "cubic(cubics, u, rate)"))
        return NULL;
    const double u = PyFloat_AsDouble(given[U]), rate = PyFloat_AsDouble(given[RATE]);
    const Py_ssize_t each = TERMS * sizeof(double), bytes = PyBytes_Size(given[CUBICS]), n = bytes / each;
    if (PyErr_Occurred())
        return NULL;
    if (n > MOST || bytes % each != 0)
        return PyErr_Format(PyExc_ValueError, "%zd bytes are no result of cubics", bytes);
    const double (*x)[TERMS] = (const void *)PyBytes_AS_STRING(given[CUBICS]);
    for (Py_ssize_t i = 0; i < n; i++) {
        q[i] = x[i][A] + u * (x[i][B] + u * (x[i][C] + u * x[i][D]));
        dq[i] = rate * (x[i][B] + u * (2.0 * x[i][C] + 3.0 * u * x[i][D]));
    }
    return Py_BuildValue("(NN)", list(q, n), list(dq, n));
}

static PyMethodDef methods[] = {
    METHOD(cubics, "(before, start, goal, after) -> coefficients of each joint's cubic from start to goal, as bytes"),
    METHOD(cubic, "(cubics, u, rate) -> values and their rates"),
    {0},
};

TYPE_MODULE(hric_human_impedance, Impedance, impedance, methods)

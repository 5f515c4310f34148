/* The balance of joint efforts with rotor inertia, on Python's own lists: see rotor_inertia.py.

   (M + B) = L D L' with d_i = 1 / D_i and c_ij = l_ij D_j, then L y = t - h and D L' x = y. Only the lower triangle of M is read. The order of the
   operations is that of the function in Python, so that the results are the same bits. */
#define PY_SSIZE_T_CLEAN
#include <Python.h>

enum { MOST = 64 }; /* joints; more are for the function in Python */

static int numbers(PyObject *sequence, Py_ssize_t n, double *into)
{
    PyObject *fast = PySequence_Fast(sequence, "balance: a sequence of numbers is wanted");
    if (fast == NULL)
        return -1;
    if (PySequence_Fast_GET_SIZE(fast) < n) {
        Py_DECREF(fast);
        PyErr_SetString(PyExc_ValueError, "balance: too few numbers");
        return -1;
    }
    PyObject **items = PySequence_Fast_ITEMS(fast);
    for (Py_ssize_t i = 0; i < n; i++)
        into[i] = PyFloat_AsDouble(items[i]);
    Py_DECREF(fast);
    return PyErr_Occurred() ? -1 : 0;
}

/* m: rows of the lower triangle, overwritten by L; x: right side, overwritten by the solution. */
static void solve(Py_ssize_t n, double m[][MOST], const double *b, double *x)
{
    double c[MOST], d[MOST];
    for (Py_ssize_t i = 0; i < n; i++) {
        for (Py_ssize_t j = 0; j < i; j++) {
            double sum = m[i][j];
            for (Py_ssize_t k = 0; k < j; k++)
                sum = sum - c[k] * m[j][k];
            c[j] = sum;
            m[i][j] = sum * d[j];
        }
        double sum = m[i][i] + b[i];
        for (Py_ssize_t k = 0; k < i; k++)
            sum = sum - c[k] * m[i][k];
        d[i] = 1.0 / sum;
    }
    for (Py_ssize_t i = 0; i < n; i++)
        for (Py_ssize_t k = 0; k < i; k++)
            x[i] = x[i] - m[i][k] * x[k];
    for (Py_ssize_t i = n - 1; i >= 0; i--) {
        x[i] = x[i] * d[i];
        for (Py_ssize_t k = i + 1; k < n; k++)
            x[i] = x[i] - m[k][i] * x[k];
    }
}

static PyObject *list_of(Py_ssize_t n, const double *values)
{
    PyObject *list = PyList_New(n);
    for (Py_ssize_t i = 0; list != NULL && i < n; i++) {
        PyObject *number = PyFloat_FromDouble(values[i]);
        if (number == NULL)
            Py_CLEAR(list);
        else
            PyList_SET_ITEM(list, i, number);
    }
    return list;
}

static PyObject *balance(PyObject *module, PyObject *const *given, Py_ssize_t count)
{
    (void)module;
    if (count != 6) {
        PyErr_SetString(PyExc_TypeError, "balance(M, h, t, b, v, dt)");
        return NULL;
    }
    Py_ssize_t n = PySequence_Size(given[2]);
    if (n < 0 || n > MOST) {
        if (!PyErr_Occurred())
            PyErr_SetString(PyExc_ValueError, "balance: too many joints");
        return NULL;
    }
    double m[MOST][MOST], h[MOST], t[MOST], b[MOST], v[MOST], x[MOST], dt = PyFloat_AsDouble(given[5]);
    PyObject *rows = PySequence_Fast(given[0], "balance: M is a sequence of rows");
    if (rows == NULL)
        return NULL;
    int failed = PySequence_Fast_GET_SIZE(rows) < n;
    if (failed)
        PyErr_SetString(PyExc_ValueError, "balance: too few rows");
    for (Py_ssize_t i = 0; !failed && i < n; i++)
        failed = numbers(PySequence_Fast_GET_ITEM(rows, i), i + 1, m[i]) < 0;
    Py_DECREF(rows);
    if (failed || numbers(given[1], n, h) || numbers(given[2], n, t) || numbers(given[3], n, b) || numbers(given[4], n, v) || PyErr_Occurred())
        return NULL;
    for (Py_ssize_t i = 0; i < n; i++)
        x[i] = t[i] - h[i];
    solve(n, m, b, x);
    for (Py_ssize_t i = 0; i < n; i++) {
        t[i] = t[i] - b[i] * x[i];
        v[i] = v[i] + dt * x[i];
    }
    PyObject *torque = list_of(n, t), *velocity = list_of(n, v);
    PyObject *both = torque != NULL && velocity != NULL ? PyTuple_Pack(2, torque, velocity) : NULL;
    Py_XDECREF(torque);
    Py_XDECREF(velocity);
    return both;
}

static PyMethodDef methods[] = {{"balance", (PyCFunction)(void (*)(void))balance, METH_FASTCALL, "(M, h, t, b, v, dt) -> (t - b x, v + dt x)"}, {0}};
static struct PyModuleDef definition = {PyModuleDef_HEAD_INIT, "hric_balance", NULL, -1, methods, NULL, NULL, NULL, NULL};

__attribute__((visibility("default"))) PyObject *PyInit_hric_balance(void)
{
    return PyModule_Create(&definition);
}

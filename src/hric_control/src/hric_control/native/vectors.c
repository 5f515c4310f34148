/* Sums and tests over short lists of Python's floats, for what happens each millisecond: see vectors.py. A number that
 * is not finite is within nothing. */
#include "hric_control/python_numbers.h"

/* The items of a list or tuple, checked for its length; the reference is borrowed from the caller's. NULL with an error
 * set. */
static PyObject **items(PyObject *sequence, Py_ssize_t n)
{
    if (!PyList_Check(sequence) && !PyTuple_Check(sequence)) {
        PyErr_SetString(PyExc_TypeError, "a list or a tuple of numbers is needed");
        return NULL;
    }
    if (PySequence_Fast_GET_SIZE(sequence) != n) {
        PyErr_Format(PyExc_ValueError, "%zd numbers are needed, got %zd", n, PySequence_Fast_GET_SIZE(sequence));
        return NULL;
    }
    return PySequence_Fast_ITEMS(sequence);
}

/* The items of all arguments, which have one length; -1 with an error set. */
static Py_ssize_t rows(const char *usage, PyObject *const *given, Py_ssize_t count, Py_ssize_t expected,
                       PyObject ***row)
{
    if (count != expected) {
        PyErr_SetString(PyExc_TypeError, usage);
        return -1;
    }
    Py_ssize_t n = PySequence_Size(given[0]);
    for (Py_ssize_t i = 0; n >= 0 && i < expected; i++)
        if ((row[i] = items(given[i], n)) == NULL)
            return -1;
    return n;
}

static double number(PyObject *object)
{
    return PyFloat_CheckExact(object) ? PyFloat_AS_DOUBLE(object) : PyFloat_AsDouble(object);
}

FUNCTION(within)
{
    PyObject **row[3];
    Py_ssize_t n = rows("within(values, low, high)", given, count, 3, row);
    int all = n >= 0;
    for (Py_ssize_t i = 0; all && i < n; i++) {
        double x = number(row[0][i]);
        all = number(row[1][i]) <= x && x <= number(row[2][i]);
    }
    return PyErr_Occurred() ? NULL : PyBool_FromLong(all);
}

FUNCTION(near)
{
    PyObject **row[3];
    Py_ssize_t n = rows("near(a, b, bound)", given, count, 3, row);
    int all = n >= 0;
    for (Py_ssize_t i = 0; all && i < n; i++) {
        double change = number(row[0][i]) - number(row[1][i]), bound = number(row[2][i]);
        all = -bound <= change && change <= bound;
    }
    return PyErr_Occurred() ? NULL : PyBool_FromLong(all);
}

FUNCTION(smaller)
{
    PyObject **row[2];
    Py_ssize_t n = rows("smaller(values, bound)", given, count, 2, row);
    int all = n >= 0;
    for (Py_ssize_t i = 0; all && i < n; i++) {
        double x = number(row[0][i]), bound = number(row[1][i]);
        all = -bound <= x && x <= bound;
    }
    return PyErr_Occurred() ? NULL : PyBool_FromLong(all);
}

static PyObject *finished(PyObject *list)
{
    if (list != NULL && PyErr_Occurred())
        Py_CLEAR(list);
    return list;
}

static void set(PyObject *list, Py_ssize_t i, double value)
{
    PyObject *object = PyFloat_FromDouble(value);
    if (object != NULL)
        PyList_SET_ITEM(list, i, object);
}

FUNCTION(add)
{
    PyObject **row[2];
    Py_ssize_t n = rows("add(a, b)", given, count, 2, row);
    PyObject *list = n < 0 ? NULL : PyList_New(n);
    for (Py_ssize_t i = 0; list != NULL && i < n; i++)
        set(list, i, number(row[0][i]) + number(row[1][i]));
    return finished(list);
}

FUNCTION(spring_damper)
{
    PyObject **row[5];
    Py_ssize_t n = rows("spring_damper(k, d, x_d, x, v)", given, count, 5, row);
    PyObject *list = n < 0 ? NULL : PyList_New(n);
    for (Py_ssize_t i = 0; list != NULL && i < n; i++)
        set(list, i,
            number(row[0][i]) * (number(row[2][i]) - number(row[3][i])) - number(row[1][i]) * number(row[4][i]));
    return finished(list);
}

static PyMethodDef methods[] = {
    METHOD(within, "(values, low, high)"),      METHOD(near, "(a, b, bound)"),
    METHOD(smaller, "(values, bound)"),         METHOD(add, "(a, b)"),
    METHOD(spring_damper, "(k, d, x_d, x, v)"), {0},
};
static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "hric_vectors", NULL, -1, methods, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit_hric_vectors(void) { return PyModule_Create(&definition); }

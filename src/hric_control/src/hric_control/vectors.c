/* Sums and tests over short lists of Python's floats, for what happens each millisecond: see vectors.py. A number that is not finite is within nothing. */
#define PY_SSIZE_T_CLEAN
#include <Python.h>

#define FUNCTION(name) static PyObject *name(PyObject *module, PyObject *const *given, Py_ssize_t count)

/* The items of a list or tuple, checked for its length; the reference is borrowed from the caller's. NULL with an error set. */
static PyObject **items(PyObject *sequence, Py_ssize_t n)
{
    if (!PyList_Check(sequence) && !PyTuple_Check(sequence)) {
        PyErr_SetString(PyExc_TypeError, "a list or a tuple of numbers is wanted");
        return NULL;
    }
    if (PySequence_Fast_GET_SIZE(sequence) != n) {
        PyErr_Format(PyExc_ValueError, "%zd numbers are wanted, got %zd", n, PySequence_Fast_GET_SIZE(sequence));
        return NULL;
    }
    return PySequence_Fast_ITEMS(sequence);
}

/* The items of all arguments, which have one length; -1 with an error set. */
static Py_ssize_t rows(const char *usage, PyObject *const *given, Py_ssize_t count, Py_ssize_t wanted, PyObject ***row)
{
    if (count != wanted) {
        PyErr_SetString(PyExc_TypeError, usage);
        return -1;
    }
    Py_ssize_t n = PySequence_Size(given[0]);
    for (Py_ssize_t i = 0; n >= 0 && i < wanted; i++)
        if ((row[i] = items(given[i], n)) == NULL)
            return -1;
    return n;
}

static double number(PyObject *object) { return PyFloat_CheckExact(object) ? PyFloat_AS_DOUBLE(object) : PyFloat_AsDouble(object); }

FUNCTION(within)
{
    (void)module;
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
    (void)module;
    PyObject **row[3];
    Py_ssize_t n = rows("near(a, b, most)", given, count, 3, row);
    int all = n >= 0;
    for (Py_ssize_t i = 0; all && i < n; i++) {
        double change = number(row[0][i]) - number(row[1][i]), most = number(row[2][i]);
        all = -most <= change && change <= most;
    }
    return PyErr_Occurred() ? NULL : PyBool_FromLong(all);
}

FUNCTION(smaller)
{
    (void)module;
    PyObject **row[2];
    Py_ssize_t n = rows("smaller(values, most)", given, count, 2, row);
    int all = n >= 0;
    for (Py_ssize_t i = 0; all && i < n; i++) {
        double x = number(row[0][i]), most = number(row[1][i]);
        all = -most <= x && x <= most;
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
    (void)module;
    PyObject **row[2];
    Py_ssize_t n = rows("add(a, b)", given, count, 2, row);
    PyObject *list = n < 0 ? NULL : PyList_New(n);
    for (Py_ssize_t i = 0; list != NULL && i < n; i++)
        set(list, i, number(row[0][i]) + number(row[1][i]));
    return finished(list);
}

FUNCTION(spring_damper)
{
    (void)module;
    PyObject **row[5];
    Py_ssize_t n = rows("spring_damper(k, d, x_d, x, v)", given, count, 5, row);
    PyObject *list = n < 0 ? NULL : PyList_New(n);
    for (Py_ssize_t i = 0; list != NULL && i < n; i++)
        set(list, i, number(row[0][i]) * (number(row[2][i]) - number(row[3][i])) - number(row[1][i]) * number(row[4][i]));
    return finished(list);
}

FUNCTION(put)
{
    (void)module;
    Py_buffer buffer;
    if (count < 2) {
        PyErr_SetString(PyExc_TypeError, "put(buffer, place, *lists)");
        return NULL;
    }
    Py_ssize_t at = PyLong_AsSsize_t(given[1]);
    if (PyErr_Occurred() || PyObject_GetBuffer(given[0], &buffer, PyBUF_WRITABLE) < 0)
        return NULL;
    double *numbers = buffer.buf;
    Py_ssize_t room = buffer.len / (Py_ssize_t)sizeof(double);
    for (Py_ssize_t a = 2; !PyErr_Occurred() && a < count; a++) {
        Py_ssize_t n = PySequence_Size(given[a]);
        PyObject **from = n < 0 ? NULL : items(given[a], n);
        if (from != NULL && (at < 0 || n > room - at))
            PyErr_SetString(PyExc_ValueError, "put: the numbers do not fit into the buffer");
        for (Py_ssize_t i = 0; !PyErr_Occurred() && i < n; i++)
            numbers[at++] = number(from[i]);
    }
    PyBuffer_Release(&buffer);
    if (PyErr_Occurred())
        return NULL;
    Py_RETURN_NONE;
}

FUNCTION(take)
{
    (void)module;
    Py_buffer buffer;
    if (count != 3) {
        PyErr_SetString(PyExc_TypeError, "take(buffer, place, n)");
        return NULL;
    }
    Py_ssize_t at = PyLong_AsSsize_t(given[1]), n = PyLong_AsSsize_t(given[2]);
    if (PyErr_Occurred() || PyObject_GetBuffer(given[0], &buffer, PyBUF_SIMPLE) < 0)
        return NULL;
    const double *numbers = buffer.buf;
    PyObject *list = NULL;
    if (at < 0 || n < 0 || n > buffer.len / (Py_ssize_t)sizeof(double) - at)
        PyErr_SetString(PyExc_ValueError, "take: the buffer has fewer numbers");
    else
        list = PyList_New(n);
    for (Py_ssize_t i = 0; list != NULL && i < n; i++)
        set(list, i, numbers[at + i]);
    PyBuffer_Release(&buffer);
    return finished(list);
}

#define METHOD(name, text) {#name, (PyCFunction)(void (*)(void))name, METH_FASTCALL, text}
static PyMethodDef methods[] = {
    METHOD(within, "(values, low, high)"), METHOD(near, "(a, b, most)"), METHOD(smaller, "(values, most)"), METHOD(add, "(a, b)"),
    METHOD(spring_damper, "(k, d, x_d, x, v)"), METHOD(put, "(buffer, place, *lists)"), METHOD(take, "(buffer, place, n)"), {0},
};
static struct PyModuleDef definition = {PyModuleDef_HEAD_INIT, "hric_vectors", NULL, -1, methods, NULL, NULL, NULL, NULL};

__attribute__((visibility("default"))) PyObject *PyInit_hric_vectors(void) { return PyModule_Create(&definition); }

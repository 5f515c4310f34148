// clang-format Language: C
/* Lists of floats of Python as arrays of C, and back: what the extension modules share. */
#ifndef HRIC_CONTROL_PYTHON_NUMBERS_H
#define HRIC_CONTROL_PYTHON_NUMBERS_H

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <string.h>

/* Head of a function of a module, and its row in the module's table. */
#define FUNCTION(name) static PyObject *name(PyObject *Py_UNUSED(module), PyObject *const *given, Py_ssize_t count)
#define FAST(function) (PyCFunction)(void (*)(void)) function, METH_FASTCALL
#define METHOD(name, text) {#name, FAST(name), text}

/* Whether that many arguments came; 0 with an error set. */
static inline int expect(Py_ssize_t count, Py_ssize_t expected, const char *usage)
{
    if (count != expected)
        PyErr_SetString(PyExc_TypeError, usage);
    return count == expected;
}

/* The numbers of a sequence of a known length; 0 with an error set. */
static inline int take(PyObject *sequence, Py_ssize_t n, double *out)
{
    PyObject *fast = PySequence_Fast(sequence, "a sequence of numbers is needed");
    if (fast == NULL)
        return 0;
    if (PySequence_Fast_GET_SIZE(fast) != n)
        PyErr_Format(PyExc_ValueError, "%zd numbers are needed, got %zd", n, PySequence_Fast_GET_SIZE(fast));
    PyObject **items = PySequence_Fast_ITEMS(fast);
    for (Py_ssize_t i = 0; PyErr_Occurred() == NULL && i < n; i++)
        out[i] = PyFloat_AsDouble(items[i]);
    Py_DECREF(fast);
    return PyErr_Occurred() == NULL;
}

/* Copy a buffer of a known size in bytes; 0 with an error set. */
static inline int copy_buffer(PyObject *buffer, size_t size, void *out, const char *what)
{
    Py_buffer view;
    if (PyObject_GetBuffer(buffer, &view, PyBUF_SIMPLE) < 0)
        return 0;
    const int fits = view.len == (Py_ssize_t)size;
    if (fits)
        memcpy(out, view.buf, size);
    else
        PyErr_Format(PyExc_ValueError, "%s is %zu bytes, got %zd", what, size, view.len);
    PyBuffer_Release(&view);
    return fits;
}

/* A list of floats; NULL with an error set. */
static inline PyObject *list(const double *values, Py_ssize_t n)
{
    PyObject *made = PyList_New(n);
    for (Py_ssize_t i = 0; made != NULL && i < n; i++) {
        PyObject *value = PyFloat_FromDouble(values[i]);
        if (value == NULL)
            Py_CLEAR(made);
        else
            PyList_SET_ITEM(made, i, value);
    }
    return made;
}

#endif

// clang-format Language: C
/* Helpers for Python extension modules: method tables, types, and conversion between lists of floats and C arrays. */
#ifndef HRIC_CORE_PYTHON_NUMBERS_H
#define HRIC_CORE_PYTHON_NUMBERS_H

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <string.h>

/* Head of a module-level function, and its entry in the method table. */
#define FUNCTION(name) static PyObject *name(PyObject *Py_UNUSED(module), PyObject *const *given, Py_ssize_t count)
#define FAST(function) (PyCFunction)(void (*)(void)) function, METH_FASTCALL
#define METHOD(name, text) {#name, FAST(name), text}

/* Define the module `name` with these functions. */
#define MODULE(name, functions)                                                                                        \
    static struct PyModuleDef definition = {                                                                           \
        PyModuleDef_HEAD_INIT, #name, NULL, -1, functions, NULL, NULL, NULL, NULL};                                    \
    PyMODINIT_FUNC PyInit_##name(void) { return PyModule_Create(&definition); }

/* Define the module `name` with functions and one Python type, whose instances are C structures of type Object. The
 * including file defines `object_init(self, args)`, which fills a new, zeroed instance and returns -1 with a Python
 * error set on failure, `object_clear(self)`, and the method table `object_methods`. */
#define TYPE_MODULE(name, Object, object, functions)                                                                   \
    static PyObject *object##_new(PyTypeObject *type, PyObject *args, PyObject *Py_UNUSED(kwargs))                     \
    {                                                                                                                  \
        PyObject *self = type->tp_alloc(type, 0);                                                                      \
        if (self != NULL && object##_init((Object *)self, args) < 0)                                                   \
            Py_CLEAR(self);                                                                                            \
        return self;                                                                                                   \
    }                                                                                                                  \
    static void object##_free(PyObject *self)                                                                          \
    {                                                                                                                  \
        object##_clear((Object *)self);                                                                                \
        Py_TYPE(self)->tp_free(self);                                                                                  \
    }                                                                                                                  \
    static PyTypeObject object##_type = {                                                                              \
        PyVarObject_HEAD_INIT(NULL, 0).tp_name = #name "." #Object,                                                    \
        .tp_basicsize = sizeof(Object),                                                                                \
        .tp_flags = Py_TPFLAGS_DEFAULT,                                                                                \
        .tp_new = object##_new,                                                                                        \
        .tp_dealloc = object##_free,                                                                                   \
        .tp_methods = object##_methods,                                                                                \
    };                                                                                                                 \
    static struct PyModuleDef definition = {                                                                           \
        PyModuleDef_HEAD_INIT, #name, NULL, -1, functions, NULL, NULL, NULL, NULL};                                    \
    PyMODINIT_FUNC PyInit_##name(void)                                                                                 \
    {                                                                                                                  \
        PyObject *module = PyType_Ready(&object##_type) < 0 ? NULL : PyModule_Create(&definition);                     \
        if (module != NULL && PyModule_AddObjectRef(module, #Object, (PyObject *)&object##_type) < 0)                  \
            Py_CLEAR(module);                                                                                          \
        return module;                                                                                                 \
    }

/* Return 1 if the number of arguments is the expected one; else set a TypeError and return 0. */
static inline int expect(Py_ssize_t count, Py_ssize_t expected, const char *usage)
{
    if (count != expected)
        PyErr_SetString(PyExc_TypeError, usage);
    return count == expected;
}

/* Copy the numbers of a sequence of length n to `out`; return 0 with a Python error set on failure. */
static inline int take(PyObject *sequence, Py_ssize_t n, double *out)
{
    PyObject *fast = PySequence_Fast(sequence, "a sequence of numbers is needed");
    if (fast == NULL)
        return 0;
    int fits = PySequence_Fast_GET_SIZE(fast) == n;
    if (!fits)
        PyErr_Format(PyExc_ValueError, "%zd numbers are needed, got %zd", n, PySequence_Fast_GET_SIZE(fast));
    PyObject **items = PySequence_Fast_ITEMS(fast);
    for (Py_ssize_t i = 0; fits && i < n; i++) {
        out[i] = PyFloat_CheckExact(items[i]) ? PyFloat_AS_DOUBLE(items[i]) : PyFloat_AsDouble(items[i]);
        fits = out[i] != -1.0 || PyErr_Occurred() == NULL;
    }
    Py_DECREF(fast);
    return fits;
}

/* Copy a buffer of `size` bytes to `out`; return 0 with a Python error set on failure. */
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

/* Return 1 if all n values are from 0 to below a bound, else 0 with a Python error set. */
static inline int below(const int *values, int n, int bound)
{
    for (int i = 0; i < n; i++)
        if (values[i] < 0 || values[i] >= bound) {
            PyErr_Format(PyExc_ValueError, "index %d is outside 0 to %d", values[i], bound - 1);
            return 0;
        }
    return 1;
}

/* Allocate zeroed memory for n elements (at least one); return NULL with a Python error set on failure. */
static inline void *zeroed(size_t n, size_t each)
{
    void *memory = PyMem_Calloc(n + 1, each);
    return memory != NULL ? memory : (void *)PyErr_NoMemory();
}

/* Get buffer views of `count` arrays, writable ones after the first `inputs`. On failure release all views, set a
 * Python error and return 0. */
static inline int take_views(PyObject *const *arrays, int count, int inputs, Py_buffer *views)
{
    for (int i = 0; i < count; i++) {
        const int flags = i < inputs ? PyBUF_C_CONTIGUOUS : PyBUF_C_CONTIGUOUS | PyBUF_WRITABLE;
        if (PyObject_GetBuffer(arrays[i], views + i, flags) < 0) {
            while (i > 0)
                PyBuffer_Release(views + --i);
            return 0;
        }
    }
    return 1;
}

/* Return 1 if the views have these lengths [bytes]; else set a ValueError and return 0. */
static inline int views_fit(const Py_buffer *views, int count, const Py_ssize_t *bytes)
{
    for (int i = 0; i < count; i++)
        if (views[i].len != bytes[i]) {
            PyErr_SetString(PyExc_ValueError, "the arrays do not fit together");
            return 0;
        }
    return 1;
}

static inline void release_views(Py_buffer *views, int count)
{
    while (count > 0)
        PyBuffer_Release(views + --count);
}

/* Return a new Python list of n floats; NULL with a Python error set on failure. */
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

/* Serialises ROS messages: see message_bytes.py.
 *
 * A field is a tuple (name, code, length, fields). Code: a type of Python's module `struct`, or s for a string, T for a
 * time, D for a duration, m for a message with these fields. Length: SINGLE, VARIABLE, or that of a fixed array. */
#include "hric_core/python_numbers.h"
#include <stdint.h>

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "messages are little-endian");

enum { SINGLE = -1, VARIABLE = -2, LEAST = 1024 };

/* Bytes written so far. */
typedef struct {
    char *data;
    size_t size, capacity;
} Output;

static PyObject *secs, *nsecs;

/* Append bytes; return 0 with a Python error set on failure. */
static int append(Output *out, const void *bytes, size_t n)
{
    if (out->size + n > out->capacity) {
        const size_t capacity = 2 * (out->size + n) + LEAST;
        char *data = PyMem_Realloc(out->data, capacity);
        if (data == NULL) {
            PyErr_NoMemory();
            return 0;
        }
        out->data = data;
        out->capacity = capacity;
    }
    memcpy(out->data + out->size, bytes, n);
    out->size += n;
    return 1;
}

static int append_length(Output *out, Py_ssize_t n)
{
    const uint32_t length = (uint32_t)n;
    return append(out, &length, sizeof length);
}

static int append_float(Output *out, PyObject *value, int single)
{
    const double x = PyFloat_AsDouble(value);
    char narrow[4];
    if (x == -1.0 && PyErr_Occurred())
        return 0;
    if (!single)
        return append(out, &x, sizeof x);
    return PyFloat_Pack4(x, narrow, 1) == 0 && append(out, narrow, sizeof narrow);
}

static int append_integer(Output *out, PyObject *value, size_t bytes, int is_signed)
{
    PyObject *number = PyNumber_Index(value);
    if (number == NULL)
        return 0;
    const int64_t low = is_signed ? INT64_MIN >> (64 - 8 * bytes) : 0;
    const uint64_t high = UINT64_MAX >> (64 - 8 * bytes + (size_t)is_signed);
    int overflow = 0;
    const long long x = PyLong_AsLongLongAndOverflow(number, &overflow);
    uint64_t plain = (uint64_t)x;
    int fits = overflow == 0 && x >= low && (x < 0 || plain <= high);
    if (overflow > 0 && high > INT64_MAX) {
        plain = PyLong_AsUnsignedLongLong(number);
        fits = !PyErr_Occurred();
    }
    Py_DECREF(number);
    if (!fits && !PyErr_Occurred())
        PyErr_SetString(PyExc_OverflowError, "an integer is out of range");
    return fits && append(out, &plain, bytes);
}

static int append_string(Output *out, PyObject *value)
{
    Py_ssize_t n;
    const char *text = PyUnicode_AsUTF8AndSize(value, &n);
    return text != NULL && append_length(out, n) && append(out, text, (size_t)n);
}

static int append_part(Output *out, PyObject *value, PyObject *name, int is_signed)
{
    PyObject *part = PyObject_GetAttr(value, name);
    const int good = part != NULL && append_integer(out, part, 4, is_signed);
    Py_XDECREF(part);
    return good;
}

static int append_message(Output *out, PyObject *fields, PyObject *message);

static int append_value(Output *out, char code, PyObject *fields, PyObject *value)
{
    switch (code) {
    case 'd':
    case 'f':
        return append_float(out, value, code == 'f');
    case 's':
        return append_string(out, value);
    case 'm':
        return append_message(out, fields, value);
    case 'T':
    case 'D':
        return append_part(out, value, secs, code == 'D') && append_part(out, value, nsecs, code == 'D');
    case 'b':
    case 'B':
        return append_integer(out, value, 1, code == 'b');
    case 'h':
    case 'H':
        return append_integer(out, value, 2, code == 'h');
    case 'i':
    case 'I':
        return append_integer(out, value, 4, code == 'i');
    case 'q':
    case 'Q':
        return append_integer(out, value, 8, code == 'q');
    default:
        PyErr_SetString(PyExc_ValueError, "a field has an unknown code");
        return 0;
    }
}

static int append_array(Output *out, char code, PyObject *fields, Py_ssize_t length, PyObject *value)
{
    PyObject *items = PySequence_Fast(value, "a sequence is needed");
    if (items == NULL)
        return 0;
    const Py_ssize_t n = PySequence_Fast_GET_SIZE(items);
    int good = length == VARIABLE ? append_length(out, n) : n == length;
    if (!good && !PyErr_Occurred())
        PyErr_SetString(PyExc_ValueError, "an array has the wrong length");
    for (Py_ssize_t i = 0; good && i < n; i++)
        good = append_value(out, code, fields, PySequence_Fast_GET_ITEM(items, i));
    Py_DECREF(items);
    return good;
}

static int append_field(Output *out, PyObject *field, PyObject *message)
{
    PyObject *fields = PyTuple_GET_ITEM(field, 3), *value = PyObject_GetAttr(message, PyTuple_GET_ITEM(field, 0));
    if (value == NULL)
        return 0;
    const char code = (char)PyUnicode_READ_CHAR(PyTuple_GET_ITEM(field, 1), 0);
    const Py_ssize_t length = PyLong_AsSsize_t(PyTuple_GET_ITEM(field, 2));
    const int good =
        length == SINGLE ? append_value(out, code, fields, value) : append_array(out, code, fields, length, value);
    Py_DECREF(value);
    return good;
}

static int append_message(Output *out, PyObject *fields, PyObject *message)
{
    for (Py_ssize_t i = 0; i < PyTuple_GET_SIZE(fields); i++)
        if (!append_field(out, PyTuple_GET_ITEM(fields, i), message))
            return 0;
    return 1;
}

FUNCTION(serialised)
{
    Output out = {0};
    if (!expect(count, 2, "serialised(fields, message)"))
        return NULL;
    if ((secs == NULL && (secs = PyUnicode_InternFromString("secs")) == NULL)
        || (nsecs == NULL && (nsecs = PyUnicode_InternFromString("nsecs")) == NULL))
        return NULL;
    PyObject *made = NULL;
    if (append_message(&out, given[0], given[1]))
        made = PyBytes_FromStringAndSize(out.data, (Py_ssize_t)out.size);
    PyMem_Free(out.data);
    return made;
}

static PyMethodDef functions[] = {METHOD(serialised, "serialised(fields, message): return the bytes of a message"),
                                  {0}};

MODULE(hric_messages, functions)

/* Sums and comparisons over short lists of Python floats, for code that runs every millisecond: see vectors.py. NaN is
 * within no bound, infinity within no finite bound. */
#include "hric_core/python_numbers.h"
#include <math.h>

/* Return the items of a list or tuple of length n, as borrowed references; NULL with a Python error set on failure. */
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

/* Get the items of all arguments and return their common length; -1 with a Python error set on failure. */
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

/* Define a function of `size` lists that returns True if a condition on x, an element of each list, always holds. */
#define EVERY(name, usage, size, condition)                                                                            \
    FUNCTION(name)                                                                                                     \
    {                                                                                                                  \
        PyObject **row[size];                                                                                          \
        const Py_ssize_t n = rows(usage, given, count, size, row);                                                     \
        int all = n >= 0;                                                                                              \
        for (Py_ssize_t i = 0; all && i < n; i++) {                                                                    \
            double x[size];                                                                                            \
            for (int k = 0; k < (size); k++)                                                                           \
                x[k] = number(row[k][i]);                                                                              \
            all = (condition);                                                                                         \
        }                                                                                                              \
        return PyErr_Occurred() ? NULL : PyBool_FromLong(all);                                                         \
    }

EVERY(within, "within(values, low, high)", 3, x[1] <= x[0] && x[0] <= x[2])
EVERY(near, "near(a, b, bound)", 3, fabs(x[0] - x[1]) <= x[2])
EVERY(smaller, "smaller(values, bound)", 2, fabs(x[0]) <= x[1])

static PyObject *finished(PyObject *list)
{
    if (list != NULL && PyErr_Occurred())
        Py_CLEAR(list);
    return list;
}

/* Return the indices of the joints at a limit, and write the largest speeds to speed_max: see vectors.py. */
FUNCTION(touched)
{
    enum { POSITION, LOW, HIGH, VELOCITY, FASTEST, SOFTNESS, VALUE, BOUND, LAST, CHANGE, SPEED_MAX, ROWS };
    PyObject **row[ROWS];
    Py_ssize_t n =
        rows("touched(position, low, high, velocity, fastest, softness, value, bound, last, change, speed_max)", given,
             count, ROWS, row);
    if (n >= 0 && !PyList_Check(given[SPEED_MAX])) {
        PyErr_SetString(PyExc_TypeError, "speed_max is written in place: a list is needed");
        return NULL;
    }
    PyObject *found = n < 0 ? NULL : PyList_New(0);
    for (Py_ssize_t i = 0; found != NULL && i < n; i++) {
        const double x = number(row[POSITION][i]), speed = fabs(number(row[VELOCITY][i])),
                     fastest = number(row[FASTEST][i]), softness = number(row[SOFTNESS][i]),
                     value = number(row[VALUE][i]), bound = number(row[BOUND][i]), step = value - number(row[LAST][i]),
                     change = number(row[CHANGE][i]);
        const int is_free = number(row[LOW][i]) <= x && x <= number(row[HIGH][i]) && speed <= fastest && -bound <= value
                            && value <= bound && -change <= step && step <= change
                            && (softness == 0.0 || fabs(value) <= softness * (fastest - speed));
        PyObject *index = is_free ? NULL : PyLong_FromSsize_t(i);
        if (index != NULL)
            PyList_Append(found, index);
        Py_XDECREF(index);
        if (isfinite(speed) && speed > number(row[SPEED_MAX][i])) {
            PyObject *fresh = PyFloat_FromDouble(speed);
            if (fresh != NULL)
                PyList_SetItem(given[SPEED_MAX], i, fresh);
        }
    }
    return finished(found);
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

/* Return the force of a spring and damper plus an additional force, changed by at most `step` since the last call. */
FUNCTION(spring_damper)
{
    enum { K, D, X_D, X, V, LAST, ADDED, ROWS };
    PyObject **row[ROWS];
    if (!expect(count, ROWS + 1, "spring_damper(k, d, x_d, x, v, last, added, step)"))
        return NULL;
    const int alone = given[ADDED] == Py_None;
    const double step = PyFloat_AsDouble(given[ROWS]);
    Py_ssize_t n = PyErr_Occurred() ? -1
                                    : rows("spring_damper(k, d, x_d, x, v, last, added, step)", given,
                                           alone ? ADDED : ROWS, alone ? ADDED : ROWS, row);
    double force[n > 0 ? n : 1];
    int near_all = 1;
    for (Py_ssize_t i = 0; i < n; i++) {
        force[i] =
            number(row[K][i]) * (number(row[X_D][i]) - number(row[X][i])) - number(row[D][i]) * number(row[V][i]);
        if (!alone)
            force[i] = force[i] + number(row[ADDED][i]);
        const double change = force[i] - number(row[LAST][i]);
        near_all = near_all && -step <= change && change <= step;
    }
    for (Py_ssize_t i = 0; step > 0.0 && !near_all && i < n; i++) {
        const double before = number(row[LAST][i]), low = before - step, high = before + step;
        force[i] = force[i] < low ? low : force[i] > high ? high : force[i];
    }
    return n < 0 ? NULL : finished(list(force, n));
}

static PyMethodDef methods[] = {
    METHOD(within, "(values, low, high)"),
    METHOD(near, "(a, b, bound)"),
    METHOD(smaller, "(values, bound)"),
    METHOD(touched, "(position, low, high, velocity, fastest, softness, value, bound, last, change, speed_max)"),
    METHOD(add, "(a, b)"),
    METHOD(spring_damper, "(k, d, x_d, x, v, last, added, step)"),
    {0},
};

MODULE(hric_vectors, methods)

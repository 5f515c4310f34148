/* Python module of static_optimization.h. */
#include "static_optimization.h"

FUNCTION(solve)
{
    if (!expect(count, ARRAYS, "solve(arms, gain, least, torque, start, activation, shortfall)"))
        return NULL;
    Py_buffer view[ARRAYS];
    double *array[ARRAYS];
    if (!take_views(given, ARRAYS, START, view))
        return NULL;
    for (int i = 0; i < ARRAYS; i++)
        array[i] = view[i].buf;
    const Py_ssize_t size = sizeof(double), k = view[GAIN].len / size, m = view[TORQUE].len / size;
    const Py_ssize_t bytes[ARRAYS] = {size * k * m, size * k, size * k, size * m, size * m, size * k, size * m};
    int steps = -1;
    if (k < 1 || m < 1 || m > JOINTS)
        PyErr_Format(PyExc_ValueError, "solve got %zd muscles and %zd joints; valid: 1 or more muscles, 1 to %d joints",
                     k, m, JOINTS);
    else if (views_fit(view, ARRAYS, bytes))
        steps = optimise((int)k, (int)m, array);
    release_views(view, ARRAYS);
    return steps < 0 ? NULL : PyLong_FromLong(steps);
}

static PyMethodDef methods[] = {
    METHOD(solve, "(arms, gain, least, torque, start, activation, shortfall) -> number of steps; float64 arrays, the "
                  "last three are written"),
    {0},
};

MODULE(hric_static_optimization, methods)

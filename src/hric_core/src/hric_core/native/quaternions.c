/* Rotations and poses on plain floats, for code that runs every millisecond: see geometry/quaternions.py, poses.py. */
#include "hric_core/quaternions.h"
#include "hric_core/python_numbers.h"

/* Pose in the layout of poses.Pose: position, orientation. */
typedef struct {
    double p[3], q[4];
} Pose;

static PyObject *tuple(const double *values, Py_ssize_t n)
{
    PyObject *made = PyTuple_New(n);
    for (Py_ssize_t i = 0; made != NULL && i < n; i++) {
        PyObject *value = PyFloat_FromDouble(values[i]);
        if (value == NULL)
            Py_CLEAR(made);
        else
            PyTuple_SET_ITEM(made, i, value);
    }
    return made;
}

/* Copy a pose, a tuple of position and orientation; return 0 with a Python error set on failure. */
static int take_pose(PyObject *object, Pose *pose)
{
    if (PyTuple_Check(object) && PyTuple_GET_SIZE(object) == 2)
        return take(PyTuple_GET_ITEM(object, 0), 3, pose->p) && take(PyTuple_GET_ITEM(object, 1), 4, pose->q);
    PyErr_SetString(PyExc_TypeError, "a pose is a tuple of position and orientation");
    return 0;
}

static PyObject *pose_tuple(const Pose *pose) { return Py_BuildValue("(NN)", tuple(pose->p, 3), tuple(pose->q, 4)); }

/* Define a Python function of two sequences of m and n numbers that returns `size` numbers. */
#define OF_TWO(name, m, n, size)                                                                                       \
    static PyObject *python_##name(PyObject *Py_UNUSED(module), PyObject *const *given, Py_ssize_t count)              \
    {                                                                                                                  \
        double a[m], b[n], result[size];                                                                               \
        if (!expect(count, 2, #name " takes two arguments") || !take(given[0], m, a) || !take(given[1], n, b))         \
            return NULL;                                                                                               \
        name(a, b, result);                                                                                            \
        return tuple(result, size);                                                                                    \
    }

/* Define a Python function of a sequence of n numbers that returns `size` numbers. */
#define OF_ONE(name, n, size)                                                                                          \
    static PyObject *python_##name(PyObject *Py_UNUSED(module), PyObject *const *given, Py_ssize_t count)              \
    {                                                                                                                  \
        double a[n], result[size];                                                                                     \
        if (!expect(count, 1, #name " takes one argument") || !take(given[0], n, a))                                   \
            return NULL;                                                                                               \
        name(a, result);                                                                                               \
        return tuple(result, size);                                                                                    \
    }

OF_TWO(product, 4, 4, 4)
OF_TWO(rotated, 4, 3, 3)
OF_TWO(difference, 4, 4, 3)
OF_ONE(rotation_vector, 4, 3)
OF_ONE(from_rotation_vector, 3, 4)

FUNCTION(python_interpolated)
{
    double start[4], goal[4], q[4];
    if (!expect(count, 3, "interpolated(start, goal, share)") || !take(given[0], 4, start) || !take(given[1], 4, goal))
        return NULL;
    const double share = PyFloat_AsDouble(given[2]);
    if (PyErr_Occurred())
        return NULL;
    interpolated(start, goal, share, q);
    return tuple(q, 4);
}

FUNCTION(python_from_elements)
{
    double R[9], q[4];
    if (!expect(count, 9, "from_elements takes nine numbers"))
        return NULL;
    for (int i = 0; i < 9; i++)
        R[i] = PyFloat_AsDouble(given[i]);
    if (PyErr_Occurred())
        return NULL;
    from_elements(R, q);
    return tuple(q, 4);
}

FUNCTION(pose_of_column_major)
{
    double T[16];
    Pose pose;
    if (!expect(count, 1, "pose_of_column_major(T)") || !take(given[0], 16, T))
        return NULL;
    const double R[9] = {T[0], T[4], T[8], T[1], T[5], T[9], T[2], T[6], T[10]};
    from_elements(R, pose.q);
    memcpy(pose.p, T + 12, sizeof pose.p);
    return pose_tuple(&pose);
}

FUNCTION(pose_difference)
{
    Pose a, b;
    double error[6];
    if (!expect(count, 2, "pose_difference(a, b)") || !take_pose(given[0], &a) || !take_pose(given[1], &b))
        return NULL;
    for (int i = 0; i < 3; i++)
        error[i] = a.p[i] - b.p[i];
    difference(a.q, b.q, error + 3);
    return list(error, 6);
}

FUNCTION(pose_interpolated)
{
    Pose start, goal, pose;
    if (!expect(count, 3, "pose_interpolated(start, goal, share)") || !take_pose(given[0], &start)
        || !take_pose(given[1], &goal))
        return NULL;
    const double share = PyFloat_AsDouble(given[2]);
    if (PyErr_Occurred())
        return NULL;
    for (int i = 0; i < 3; i++)
        pose.p[i] = start.p[i] + share * (goal.p[i] - start.p[i]);
    interpolated(start.q, goal.q, share, pose.q);
    return pose_tuple(&pose);
}

#define NAMED(name, text) {#name, FAST(python_##name), text}

static PyMethodDef methods[] = {
    NAMED(product, "(a, b)"),
    NAMED(rotated, "(q, v)"),
    NAMED(difference, "(a, b)"),
    NAMED(rotation_vector, "(q)"),
    NAMED(from_rotation_vector, "(v)"),
    NAMED(interpolated, "(start, goal, share)"),
    NAMED(from_elements, "(nine elements of a rotation matrix, row by row)"),
    METHOD(pose_of_column_major, "(16 numbers) -> position, orientation"),
    METHOD(pose_difference, "(a, b) -> six numbers"),
    METHOD(pose_interpolated, "(start, goal, share) -> position, orientation"),
    {0},
};

MODULE(hric_quaternions, methods)

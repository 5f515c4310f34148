/* Approach speeds of capsules, and the protective separation distance; the formulas are in protective.py.
 *
 * The order of the operations is part of the interface: runs are compared bit by bit. */
#include "hric_core/python_numbers.h"
#include <math.h>

/* Return the larger number; NAN if one of them is. */
static double larger(double a, double b) { return a >= b || isnan(a) ? a : b; }

/* -- approach ------------------------------------------------------------------------------------------------------ */

/* Capsule of a person and the nearest one of the arm, as `nearest` of hric_dynamics writes it, and their approach. */
typedef struct {
    double distance, arm, robot_point[3], person_point[3];
} Nearest;

typedef struct {
    double direction[3], robot_speed, person_speed;
} Approach;

/* Velocities of both ends of a capsule's axis. */
typedef double Ends[2][3];

static double norm(const double v[3]) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

/* Return the speed of the faster end along a unit vector (NULL: in any direction) times a sign, at least 0. */
static double speed_along(const Ends ends, const double *d, double sign)
{
    double along[2];
    for (int end = 0; end < 2; end++) {
        const double *v = ends[end];
        along[end] = d != NULL ? sign * (v[0] * d[0] + v[2] * d[2] + v[1] * d[1]) : norm(v);
    }
    return larger(0.0, larger(along[0], along[1]));
}

/* Set direction and speeds. If the axes cross, there is no direction from arm to person, and the full speeds count. */
static void approach_of(const Nearest *nearest, const Ends arm, const Ends person, Approach *out)
{
    double offset[3];
    for (int k = 0; k < 3; k++)
        offset[k] = nearest->person_point[k] - nearest->robot_point[k];
    const double length = norm(offset);
    for (int k = 0; k < 3; k++)
        out->direction[k] = offset[k] / larger(length, 1e-9);
    const double *direction = length < 1e-6 ? NULL : out->direction;
    out->robot_speed = speed_along(arm, direction, 1.0);
    out->person_speed = speed_along(person, direction, -1.0);
}

FUNCTION(approach)
{
    enum { NEAREST, ARM, PERSON, OUT, VIEWS };
    Py_buffer view[VIEWS];
    if (!expect(count, VIEWS, "approach(nearest, arm, person, out)") || !take_views(given, VIEWS, OUT, view))
        return NULL;
    const Py_ssize_t n = view[OUT].len / (Py_ssize_t)sizeof(Approach), arms = view[ARM].len / (Py_ssize_t)sizeof(Ends);
    const Py_ssize_t bytes[VIEWS] = {n * (Py_ssize_t)sizeof(Nearest), arms * (Py_ssize_t)sizeof(Ends),
                                     n * (Py_ssize_t)sizeof(Ends), n * (Py_ssize_t)sizeof(Approach)};
    const Nearest *nearest = view[NEAREST].buf;
    const Ends *arm = view[ARM].buf, *person = view[PERSON].buf;
    int fits = views_fit(view, VIEWS, bytes);
    for (Py_ssize_t i = 0; fits && i < n; i++) {
        if (nearest[i].arm >= 0.0 && nearest[i].arm < (double)arms)
            approach_of(nearest + i, arm[(Py_ssize_t)nearest[i].arm], person[i], (Approach *)view[OUT].buf + i);
        else
            fits = PyErr_Format(PyExc_IndexError, "the arm has %zd capsules", arms) != NULL;
    }
    release_views(view, VIEWS);
    return fits ? Py_NewRef(Py_None) : NULL;
}

FUNCTION(fastest)
{
    Py_buffer view;
    if (!expect(count, 1, "fastest(velocities)") || !take_views(given, 1, 1, &view))
        return NULL;
    double most = 0.0;
    for (Py_ssize_t i = 0; i + 3 <= view.len / (Py_ssize_t)sizeof(double); i += 3)
        most = larger(most, norm((const double *)view.buf + i));
    release_views(&view, 1);
    return PyFloat_FromDouble(most);
}

/* -- protective distance ------------------------------------------------------------------------------------------- */

enum { ROBOT_SPEED, PERSON_SPEED, INTRUSION, PERSON_Z, ROBOT_Z, REACTION, TIME, DISTANCE, TERMS };
enum { NEAR, WALKING, HAND, ASSUMED };
enum { HUMAN, S_H, S_R, S_S, RESULTS };

/* Argument of the distance: numbers that are `step` apart; 0: one for all distances. */
typedef struct {
    const double *values;
    Py_ssize_t step;
    double constant;
    Py_buffer view;
} Argument;

/* Get an argument from a number or an array of n numbers; return 0 with a Python error set on failure. */
static int take_argument(PyObject *object, Py_ssize_t n, Argument *argument)
{
    *argument = (Argument){.values = &argument->constant};
    if (!PyObject_CheckBuffer(object) || PyFloat_Check(object)) {
        argument->constant = PyFloat_AsDouble(object);
        return PyErr_Occurred() == NULL;
    }
    Py_buffer *view = &argument->view;
    if (PyObject_GetBuffer(object, view, PyBUF_STRIDES | PyBUF_FORMAT) < 0)
        return 0;
    const int row = view->ndim == 1;
    if (strcmp(view->format, "d") != 0 || view->len != n * view->itemsize
        || !(row || PyBuffer_IsContiguous(view, 'C'))) {
        PyErr_SetString(PyExc_ValueError, "numbers are needed, or contiguous float64 arrays of one shape");
        return 0;
    }
    argument->values = view->buf;
    argument->step = row ? view->strides[0] / view->itemsize : 1;
    return 1;
}

/* Return the number of the first argument with a value that is not finite, or below 0; TERMS: there is none. */
static int first_impossible(const Argument *arguments, Py_ssize_t n)
{
    for (int k = 0; k < TERMS; k++)
        for (Py_ssize_t i = 0; i < n; i++)
            if (!(arguments[k].values[i * arguments[k].step] >= 0.0)
                || isinf(arguments[k].values[i * arguments[k].step]))
                return k;
    return TERMS;
}

/* Compute the speed of the person, at least the one that counts as measured, and the terms of n distances. */
static void compute(const Argument *arguments, const double assumed[ASSUMED], Py_ssize_t n, double *out)
{
    for (Py_ssize_t i = 0; i < n; i++) {
        double x[TERMS];
        for (int k = 0; k < TERMS; k++)
            x[k] = arguments[k].values[i * arguments[k].step];
        const double time = x[REACTION] + x[TIME], approach = x[ROBOT_SPEED] * x[REACTION];
        const double still = approach + x[DISTANCE] + x[INTRUSION] + x[PERSON_Z] + x[ROBOT_Z];
        const double at_near = (assumed[NEAR] - still) / fmax(time, 1e-9);
        const double human = fmax(fmin(fmax(at_near, assumed[WALKING]), assumed[HAND]), x[PERSON_SPEED]);
        out[HUMAN * n + i] = human;
        out[S_H * n + i] = human * time;
        out[S_R * n + i] = approach;
        out[S_S * n + i] = x[DISTANCE];
    }
}

FUNCTION(protective)
{
    enum { SPEEDS = TERMS, OUT, COUNT };
    Argument arguments[TERMS];
    double assumed[ASSUMED];
    Py_buffer view;
    if (!expect(count, COUNT,
                "protective(robot_speed, person_speed, intrusion, person_uncertainty, robot_uncertainty, "
                "reaction_time, time, distance, assumed, out)")
        || !take(given[SPEEDS], ASSUMED, assumed) || !take_views(given + OUT, 1, 0, &view))
        return NULL;
    const Py_ssize_t n = view.len / (RESULTS * (Py_ssize_t)sizeof(double));
    int taken = 0, wrong = TERMS;
    while (taken < TERMS && take_argument(given[taken], n, arguments + taken))
        taken++;
    if (taken == TERMS && (wrong = first_impossible(arguments, n)) == TERMS)
        compute(arguments, assumed, n, view.buf);
    for (int k = 0; k < TERMS && k <= taken; k++)
        PyBuffer_Release(&arguments[k].view);
    PyBuffer_Release(&view);
    return PyErr_Occurred() ? NULL : PyLong_FromLong(wrong);
}

static PyMethodDef methods[] = {
    METHOD(approach, "(nearest, arm, person, out): write direction and approach speeds of each capsule of a person"),
    METHOD(fastest, "(velocities): return the largest of the speeds"),
    METHOD(protective,
           "(robot_speed, person_speed, intrusion, person_uncertainty, robot_uncertainty, reaction_time, time, "
           "distance, assumed, out): write speed of the person and terms; return the number of the first argument that "
           "is not possible, 8: there is none"),
    {0},
};

MODULE(hric_separation, methods)

/* Angles of an arm from its joint positions, and the thresholds that the angles of a posture exceed; see posture.py and
 * instant.py. */
#include "hric_core/python_numbers.h"
#include <math.h>

enum { MOST = 128 }; /* joints of a body */

/* Joint positions of an arm, and the angles that follow from them. */
typedef struct {
    double flexion, abduction, rotation, elbow;
} Arm;

enum { JOINT, ELEVATION, ABDUCTION, INWARD, KINDS };

static double elevation(const Arm *arm)
{
    const double aside = fabs(sin(arm->abduction)), forward = cos(arm->abduction) * sin(arm->flexion);
    const double down = cos(arm->abduction) * cos(arm->flexion), angle = atan2(hypot(aside, forward), down);
    return down > 0.0 && -forward > aside ? -angle : angle;
}

static double inward(const Arm *arm)
{
    const double across =
        cos(arm->abduction) * sin(arm->elbow) * sin(arm->rotation) - sin(arm->abduction) * cos(arm->elbow);
    return asin(across > 1.0 ? 1.0 : across < -1.0 ? -1.0 : across);
}

static double angle_of(const Arm *arm, int kind)
{
    return kind == ELEVATION ? elevation(arm) : kind == ABDUCTION ? asin(sin(arm->abduction)) : inward(arm);
}

FUNCTION(arm_angles)
{
    enum { ARMS, ANGLES, VIEWS, EACH = KINDS - ELEVATION };
    Py_buffer view[VIEWS];
    if (!expect(count, VIEWS, "arm_angles(arms, angles)") || !take_views(given, VIEWS, ANGLES, view))
        return NULL;
    const Py_ssize_t n = view[ARMS].len / (Py_ssize_t)sizeof(Arm);
    const Py_ssize_t bytes[VIEWS] = {n * (Py_ssize_t)sizeof(Arm), n * EACH * (Py_ssize_t)sizeof(double)};
    const int fits = views_fit(view, VIEWS, bytes);
    for (Py_ssize_t i = 0; fits && i < n; i++)
        for (int k = 0; k < EACH; k++)
            ((double *)view[ANGLES].buf)[i * EACH + k] = angle_of((Arm *)view[ARMS].buf + i, ELEVATION + k);
    release_views(view, VIEWS);
    return fits ? Py_NewRef(Py_None) : NULL;
}

/* Origin of an angle: its kind, and the joints of the arm, or two joints of which the larger position counts. */
typedef struct {
    int kind, joints[4];
} Source;

static double value_of(const Source *source, const double *q)
{
    const int *at = source->joints;
    const Arm arm = {q[at[0]], q[at[1]], q[at[2]], q[at[3]]};
    return source->kind == JOINT ? fmax(q[at[0]], q[at[1]]) : angle_of(&arm, source->kind);
}

/* Count for each of n angles its bounds that are not above it. */
static PyObject *counts(const Source *sources, const double *bounds, Py_ssize_t n, Py_ssize_t each, const double *q)
{
    PyObject *key = PyBytes_FromStringAndSize(NULL, n);
    for (Py_ssize_t i = 0; key != NULL && i < n; i++) {
        const double value = value_of(sources + i, q);
        char *below = PyBytes_AS_STRING(key) + i;
        *below = 0;
        for (Py_ssize_t k = 0; k < each; k++)
            *below += bounds[i * each + k] <= value;
    }
    return key;
}

FUNCTION(exceeded)
{
    enum { Q, SOURCES, BOUNDS, COUNT };
    double q[MOST];
    Py_buffer view[2];
    if (!expect(count, COUNT, "exceeded(q, sources, bounds)"))
        return NULL;
    const Py_ssize_t joints = PySequence_Size(given[Q]);
    if (joints > MOST)
        PyErr_Format(PyExc_ValueError, "0 to %d joints are possible", MOST);
    if (joints < 0 || joints > MOST || !take(given[Q], joints, q) || !take_views(given + SOURCES, 2, 2, view))
        return NULL;
    const Py_ssize_t n = view[0].len / (Py_ssize_t)sizeof(Source);
    const Py_ssize_t each = n > 0 ? view[1].len / (n * (Py_ssize_t)sizeof(double)) : 0;
    const Py_ssize_t bytes[2] = {n * (Py_ssize_t)sizeof(Source), n * each * (Py_ssize_t)sizeof(double)};
    const Source *sources = view[0].buf;
    int fits = views_fit(view, 2, bytes);
    for (Py_ssize_t i = 0; fits && i < n; i++)
        fits = below(&sources[i].kind, 1, KINDS) && below(sources[i].joints, 4, (int)joints);
    PyObject *key = fits ? counts(sources, view[1].buf, n, each, q) : NULL;
    release_views(view, 2);
    return key;
}

static PyMethodDef methods[] = {
    METHOD(arm_angles, "(arms, angles): write elevation and abduction of the upper arm, and angle of the forearm"),
    METHOD(exceeded, "(q, sources, bounds): return the number of bounds that each angle reaches, as bytes"),
    {0},
};

MODULE(hric_posture, methods)

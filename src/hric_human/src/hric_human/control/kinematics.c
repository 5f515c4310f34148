/* Position of a hand, and its velocity for unit speed of each joint of the arm; the formulas are in kinematics.py.
 *
 * The order of the operations is part of the interface: runs are compared bit by bit. */
#include "hric_core/python_numbers.h"
#include "hric_core/quaternions.h"

enum { MOST = 64 }; /* joints */

/* Place of a joint in the frame of the one before, and its axis. */
typedef struct {
    double offset[3], axis[3];
} Joint;

/* Chain of an arm: frame in which it begins, vectors from the last joint to the last link's origin and from there to
 * the hand's frame, joints. */
typedef struct {
    double p[3], orientation[4], after[3], p_link_hand[3];
    Joint joints[];
} Chain;

static void cross(const double *a, const double *b, double *out)
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Add the vector v of the frame with orientation q to the point p. */
static void add_rotated(const double *q, const double *v, double *p)
{
    double d[3];
    rotated(q, v, d);
    for (int i = 0; i < 3; i++)
        p[i] = p[i] + d[i];
}

/* Turn the orientation q by an angle about an axis of its frame. */
static void turn(const double *axis, double angle, double *orientation)
{
    const double v[3] = {axis[0] * angle, axis[1] * angle, axis[2] * angle};
    double turned[4], rotation[4];
    from_rotation_vector(v, rotation);
    product(orientation, rotation, turned);
    memcpy(orientation, turned, sizeof turned);
}

/* Compute the pose of the hand, and the origin and axis of each of n joints at the angles q. */
static void reach(const Chain *chain, const double *q, Py_ssize_t n, double *pose, double (*origins)[3], double *axes)
{
    double *p = pose, *orientation = pose + 3;
    memcpy(pose, chain, 7 * sizeof(double));
    for (Py_ssize_t i = 0; i < n; i++) {
        add_rotated(orientation, chain->joints[i].offset, p);
        memcpy(origins[i], p, sizeof origins[i]);
        rotated(orientation, chain->joints[i].axis, axes + 3 * i);
        turn(chain->joints[i].axis, q[i], orientation);
    }
    add_rotated(orientation, chain->after, p);
    add_rotated(orientation, chain->p_link_hand, p);
}

/* Compute the pose of the hand, and the axis and velocity of each of n joints at the angles q. */
static void place(const Chain *chain, const double *q, Py_ssize_t n, double *pose, double *linear, double *axes)
{
    double origins[MOST][3], *p = pose;
    reach(chain, q, n, pose, origins, axes);
    for (Py_ssize_t i = 0; i < n; i++) {
        const double lever[3] = {p[0] - origins[i][0], p[1] - origins[i][1], p[2] - origins[i][2]};
        cross(axes + 3 * i, lever, linear + 3 * i);
    }
}

/* Copy up to MOST joint angles, and set the size that the chain of their joints has; return their number, -1 with a
 * Python error set on failure. */
static Py_ssize_t take_angles(PyObject *angles, double *q, Py_ssize_t *chain_bytes)
{
    const Py_ssize_t n = PySequence_Size(angles);
    if (n > MOST)
        PyErr_Format(PyExc_ValueError, "0 to %d joints are possible", MOST);
    *chain_bytes = (Py_ssize_t)(sizeof(Chain) + (size_t)n * sizeof(Joint));
    return n >= 0 && n <= MOST && take(angles, n, q) ? n : -1;
}

FUNCTION(hand)
{
    enum { CHAIN, POSE, LINEAR, AXES, VIEWS, Q = VIEWS, COUNT };
    Py_buffer views[VIEWS];
    Py_ssize_t bytes[VIEWS];
    double q[MOST];
    if (!expect(count, COUNT, "hand(chain, pose, linear, axes, q)"))
        return NULL;
    const Py_ssize_t n = take_angles(given[Q], q, bytes + CHAIN);
    if (n < 0 || !take_views(given, VIEWS, 1, views))
        return NULL;
    bytes[POSE] = 7 * sizeof(double);
    bytes[LINEAR] = bytes[AXES] = 3 * n * (Py_ssize_t)sizeof(double);
    const int fit = views_fit(views, VIEWS, bytes);
    if (fit)
        place(views[CHAIN].buf, q, n, views[POSE].buf, views[LINEAR].buf, views[AXES].buf);
    release_views(views, VIEWS);
    return fit ? Py_NewRef(Py_None) : NULL;
}

/* Compute the pose of the hand of a chain (an object with a buffer) at the joint angles q; return 0 with a Python error
 * set on failure. */
static int pose_of(PyObject *chain, PyObject *angles, double pose[7])
{
    Py_buffer view;
    Py_ssize_t bytes;
    double q[MOST], origins[MOST][3], axes[3 * MOST];
    const Py_ssize_t n = take_angles(angles, q, &bytes);
    if (n < 0 || !take_views(&chain, 1, 1, &view))
        return 0;
    const int fit = views_fit(&view, 1, &bytes);
    if (fit)
        reach(view.buf, q, n, pose, origins, axes);
    release_views(&view, 1);
    return fit;
}

FUNCTION(pose)
{
    double pose[7];
    return expect(count, 2, "pose(chain, q)") && pose_of(given[0], given[1], pose) ? list(pose, 7) : NULL;
}

/* Compute T_a_c = T_a_b T_b_c; products are added as by NumPy on a processor with fused multiply-add. */
static void compose(const double a[4][4], const double b[4][4], double product[4][4])
{
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) {
            double sum = 0.0;
            for (int k = 0; k < 4; k++)
                sum = fma(a[i][k], b[k][j], sum);
            product[i][j] = sum;
        }
}

FUNCTION(placed)
{
    enum { CHAIN, Q, ROOT, COUNT };
    double pose[7], R[9], T_world_root[4][4], T_root_hand[4][4] = {[3][3] = 1.0}, T_world_hand[4][4];
    if (!expect(count, COUNT, "placed(chain, q, T_world_root)") || !pose_of(given[CHAIN], given[Q], pose)
        || !copy_buffer(given[ROOT], sizeof T_world_root, T_world_root, "a transform"))
        return NULL;
    rotation_matrix(pose + 3, R);
    for (int i = 0; i < 3; i++) {
        memcpy(T_root_hand[i], R + 3 * i, 3 * sizeof(double));
        T_root_hand[i][3] = pose[i];
    }
    compose(T_world_root, T_root_hand, T_world_hand);
    return list(T_world_hand[0], 16);
}

static PyMethodDef methods[] = {
    METHOD(hand, "(chain, pose, linear, axes, q): fill the arrays for the joint angles q"),
    METHOD(pose, "(chain, q): return position and orientation of the hand for the joint angles q, 7 floats"),
    METHOD(placed, "(chain, q, T_world_root): return the transform of the hand for the joint angles q, 16 floats"),
    {0},
};

MODULE(hric_human_kinematics, methods)

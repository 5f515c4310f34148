/* Forward and inverse kinematics of the arm, fast enough for every millisecond; Python side: kinematics.py and
 * inverse_kinematics.py. Poses are lists of 16 floats, column-major, as arguments and results. An arm is a buffer of
 * doubles: for each of the seven joint frames, then for the frame at the tip, the three columns of its rotation and its
 * translation relative to the previous frame. */
#include "hric_core/python_numbers.h"
#include <math.h>
#include <string.h>

#define JOINTS 7

typedef struct {
    double x[3], y[3], z[3], p[3];
} Frame;
typedef struct {
    double axes[JOINTS][3], origins[JOINTS][3], T[16];
} Placement;

/* -- forward ------------------------------------------------------------------------------------------------------- */

/* Replace the frame `at` by at * fixed. */
static void carry(Frame *at, const Frame *fixed)
{
    Frame next;
    for (int i = 0; i < 3; i++) {
        const double x = at->x[i], y = at->y[i], z = at->z[i];
        next.x[i] = fixed->x[0] * x + fixed->x[1] * y + fixed->x[2] * z;
        next.y[i] = fixed->y[0] * x + fixed->y[1] * y + fixed->y[2] * z;
        next.z[i] = fixed->z[0] * x + fixed->z[1] * y + fixed->z[2] * z;
        next.p[i] = at->p[i] + fixed->p[0] * x + fixed->p[1] * y + fixed->p[2] * z;
    }
    *at = next;
}

static void forward(const Frame arm[JOINTS + 1], const double q[JOINTS], Placement *out)
{
    Frame at = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}, {0.0, 0.0, 0.0}};
    for (int j = 0; j < JOINTS; j++) {
        const double c = cos(q[j]), s = sin(q[j]);
        carry(&at, &arm[j]);
        for (int i = 0; i < 3; i++) {
            const double x = at.x[i], y = at.y[i];
            at.x[i] = c * x + s * y;
            at.y[i] = c * y - s * x;
        }
        memcpy(out->axes[j], at.z, sizeof at.z);
        memcpy(out->origins[j], at.p, sizeof at.p);
    }
    carry(&at, &arm[JOINTS]);
    memset(out->T, 0, sizeof out->T);
    memcpy(out->T, at.x, sizeof at.x);
    memcpy(out->T + 4, at.y, sizeof at.y);
    memcpy(out->T + 8, at.z, sizeof at.z);
    memcpy(out->T + 12, at.p, sizeof at.p);
    out->T[15] = 1.0;
}

/* One joint's column of the Jacobian of the tip, linear above angular, in the base frame. */
static void column(const Placement *at, int joint, double out[6])
{
    const double *a = at->axes[joint], *o = at->origins[joint], u = at->T[12] - o[0], v = at->T[13] - o[1],
                 w = at->T[14] - o[2];
    out[0] = a[1] * w - a[2] * v;
    out[1] = a[2] * u - a[0] * w;
    out[2] = a[0] * v - a[1] * u;
    memcpy(out + 3, a, 3 * sizeof(double));
}

/* Constant twist that leads from pose a to pose b within `time` [s]. */
static void between(const double *a, const double *b, double time, double twist[6])
{
    double s[3] = {0.0, 0.0, 0.0}, trace = 0.0;
    for (int k = 0; k < 12; k += 4) {
        s[0] += a[k + 1] * b[k + 2] - a[k + 2] * b[k + 1];
        s[1] += a[k + 2] * b[k] - a[k] * b[k + 2];
        s[2] += a[k] * b[k + 1] - a[k + 1] * b[k];
        trace += a[k] * b[k] + a[k + 1] * b[k + 1] + a[k + 2] * b[k + 2];
    }
    const double sine = 0.5 * sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2]), cosine = 0.5 * (trace - 1.0),
                 angle = atan2(sine, cosine);
    const double factor = 0.5 * (sine > 0.0 ? angle / sine : 1.0) / time;
    for (int i = 0; i < 3; i++) {
        twist[i] = (b[12 + i] - a[12 + i]) / time;
        twist[3 + i] = s[i] * factor;
    }
    if (cosine < 0.0) {
        twist[3] = angle / time;
        twist[4] = twist[5] = 0.0;
    }
}

/* -- inverse ------------------------------------------------------------------------------------------------------- */

typedef struct {
    double tolerance, largest;
    int steps, elbow;
} Newton;

/* Solve [J; row] x = right for `columns` right-hand sides by elimination with partial pivoting. Returns 0 if the matrix
 * is singular or an element of the first solution exceeds `largest`. */
static int solve(const Placement *at, const double row[JOINTS], double right[JOINTS][2], int columns, double largest)
{
    double A[JOINTS][JOINTS];
    for (int j = 0; j < JOINTS; j++) {
        double J[6];
        column(at, j, J);
        for (int i = 0; i < 6; i++)
            A[i][j] = J[i];
        A[6][j] = row[j];
    }
    for (int k = 0; k < JOINTS; k++) {
        int pivot = k;
        for (int i = k + 1; i < JOINTS; i++)
            if (fabs(A[i][k]) > fabs(A[pivot][k]))
                pivot = i;
        if (!(fabs(A[pivot][k]) > 0.0))
            return 0;
        for (int j = 0; pivot != k && j < JOINTS; j++) {
            const double kept = A[k][j];
            A[k][j] = A[pivot][j];
            A[pivot][j] = kept;
        }
        for (int c = 0; pivot != k && c < columns; c++) {
            const double kept = right[k][c];
            right[k][c] = right[pivot][c];
            right[pivot][c] = kept;
        }
        for (int i = k + 1; i < JOINTS; i++) {
            const double factor = A[i][k] / A[k][k];
            for (int j = k + 1; j < JOINTS; j++)
                A[i][j] -= factor * A[k][j];
            for (int c = 0; c < columns; c++)
                right[i][c] -= factor * right[k][c];
        }
    }
    for (int c = 0; c < columns; c++)
        for (int k = JOINTS - 1; k >= 0; k--) {
            for (int j = k + 1; j < JOINTS; j++)
                right[k][c] -= A[k][j] * right[j][c];
            right[k][c] /= A[k][k];
        }
    for (int i = 0; i < JOINTS; i++)
        if (!(fabs(right[i][0]) <= largest))
            return 0;
    return 1;
}

/* Newton steps from q until the errors of pose and elbow are within the tolerance; 0 if that fails. options->elbow is
 * the index of the joint whose desired position is q3; if it is negative, q3 is ignored. */
static int newton(const Frame *arm, const double T[16], const double row[JOINTS], double q3, const Newton *options,
                  double q[JOINTS])
{
    for (int step = 0; step <= options->steps; step++) {
        Placement at;
        double error[JOINTS], right[JOINTS][2], largest = 0.0;
        forward(arm, q, &at);
        between(at.T, T, 1.0, error);
        error[6] = options->elbow < 0 ? 0.0 : q3 - q[options->elbow];
        for (int i = 0; i < JOINTS; i++) {
            largest = fabs(error[i]) <= largest ? largest : fabs(error[i]);
            right[i][0] = error[i];
        }
        if (largest <= options->tolerance)
            return 1;
        if (!solve(&at, row, right, 1, options->largest))
            return 0;
        for (int i = 0; i < JOINTS; i++)
            q[i] += right[i][0];
    }
    return 0;
}

/* -- functions called from Python ---------------------------------------------------------------------------------- */

static int take_arm(PyObject *buffer, Frame arm[JOINTS + 1])
{
    return copy_buffer(buffer, (JOINTS + 1) * sizeof(Frame), arm, "an arm");
}

FUNCTION(end_effector)
{
    Frame arm[JOINTS + 1];
    double q[JOINTS];
    Placement at;
    if (!expect(count, 2, "end_effector(arm, q)") || !take_arm(given[0], arm) || !take(given[1], JOINTS, q))
        return NULL;
    forward(arm, q, &at);
    return list(at.T, 16);
}

FUNCTION(place)
{
    Frame arm[JOINTS + 1];
    double q[JOINTS], J[6 * JOINTS];
    Placement at;
    if (!expect(count, 2, "place(arm, q)") || !take_arm(given[0], arm) || !take(given[1], JOINTS, q))
        return NULL;
    forward(arm, q, &at);
    for (int j = 0; j < JOINTS; j++)
        column(&at, j, J + 6 * j);
    return Py_BuildValue("(NN)", list(at.T, 16), list(J, 6 * JOINTS));
}

FUNCTION(twist_between)
{
    double a[16], b[16], twist[6];
    if (!expect(count, 3, "twist_between(T_from, T_to, time_step)") || !take(given[0], 16, a) || !take(given[1], 16, b))
        return NULL;
    const double time = PyFloat_AsDouble(given[2]);
    if (PyErr_Occurred())
        return NULL;
    between(a, b, time, twist);
    return list(twist, 6);
}

/* options: (tolerance, largest step, steps, elbow joint or -1) */
static int take_options(PyObject *sequence, Newton *options)
{
    double values[4];
    if (!take(sequence, 4, values))
        return 0;
    options->tolerance = values[0];
    options->largest = values[1];
    options->steps = (int)values[2];
    options->elbow = (int)values[3];
    if (options->elbow < JOINTS)
        return 1;
    PyErr_SetString(PyExc_ValueError, "the index of the elbow joint must be below 7; -1: none");
    return 0;
}

FUNCTION(solve_pose)
{
    Frame arm[JOINTS + 1];
    double T[16], row[JOINTS], q[JOINTS];
    Newton options;
    if (!expect(count, 6, "solve_pose(arm, T, row, q3, options, guess)") || !take_arm(given[0], arm)
        || !take(given[1], 16, T) || !take(given[2], JOINTS, row) || !take_options(given[4], &options)
        || !take(given[5], JOINTS, q))
        return NULL;
    const double q3 = PyFloat_AsDouble(given[3]);
    if (PyErr_Occurred())
        return NULL;
    if (!newton(arm, T, row, q3, &options, q))
        Py_RETURN_NONE;
    return list(q, JOINTS);
}

FUNCTION(first_step)
{
    Frame arm[JOINTS + 1];
    double T[16], row[JOINTS], q[JOINTS], error[6], right[JOINTS][2], null[JOINTS], square = 0.0;
    Newton options;
    Placement at;
    if (!expect(count, 5, "first_step(arm, T, row, options, guess)") || !take_arm(given[0], arm)
        || !take(given[1], 16, T) || !take(given[2], JOINTS, row) || !take_options(given[3], &options)
        || !take(given[4], JOINTS, q))
        return NULL;
    forward(arm, q, &at);
    between(at.T, T, 1.0, error);
    for (int i = 0; i < JOINTS; i++) {
        right[i][0] = i < 6 ? error[i] : 0.0;
        right[i][1] = i < 6 ? 0.0 : 1.0;
    }
    if (!solve(&at, row, right, 2, options.largest))
        Py_RETURN_NONE;
    for (int i = 0; i < JOINTS; i++) {
        q[i] += right[i][0];
        square += right[i][1] * right[i][1];
    }
    for (int i = 0; i < JOINTS; i++)
        null[i] = right[i][1] / sqrt(square);
    return Py_BuildValue("(NN)", list(q, JOINTS), list(null, JOINTS));
}

static PyMethodDef methods[] = {
    METHOD(end_effector, "(arm, q): pose of the tip"),
    METHOD(place, "(arm, q): (pose of the tip, its Jacobian column by column)"),
    METHOD(twist_between, "(T_from, T_to, time_step)"),
    METHOD(solve_pose, "(arm, T, row, q3, options, guess): joint positions or None"),
    METHOD(first_step, "(arm, T, row, options, guess): (joint positions, null vector) or None"),
    {0},
};

MODULE(hric_kinematics, methods)

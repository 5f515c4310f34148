/* Muscle forces and joint torques of one cycle, and the activations of the next cycle; explained in drive.py. */
#include "hric_core/python_numbers.h"

#include <math.h>

enum { COLUMNS, LAW, STATE, ACTIVATION, DECIDED, OUT, ARRAYS };

/* Parameters: time constants of activation and deactivation [s], smoothing between both [1], damping per stiffness [s],
   duration of a cycle [s]. */
typedef struct {
    double rise, fall, smoothing, damping, cycle;
} Law;

static double next_activation(const Law *law, double activation, double excitation)
{
    const double rising = 0.5 * tanh(law->smoothing * (excitation - activation)) + 0.5, slowed = 0.5 + 1.5 * activation,
                 speed = rising / (law->rise * slowed) + (1.0 - rising) * slowed / law->fall;
    return excitation + (activation - excitation) * exp(-law->cycle * speed);
}

/* decided: excitations, then joint positions, velocities and stiffness at the last decision; ahead: time since it [s].
   out: force of k muscles, their activation in the next cycle, torque of m joints. */
static void step(const Law *law, int k, int m, const double *state, const double *activation, const double *decided,
                 double ahead, const double *q, const double *dq, double *out)
{
    const double *gain = state + 2 * k, *passive = gain + k, *arms = passive + k;
    const double *at = decided + k, *speed = at + m, *stiffness = speed + m;
    double *torque = out + 2 * k, missed[m + 1];
    for (int r = 0; r < m; r++) {
        missed[r] = at[r] + ahead * speed[r] - q[r] + law->damping * (speed[r] - dq[r]);
        torque[r] = 0.0;
    }
    for (int i = 0; i < k; i++) {
        out[i] = gain[i] * activation[i] + passive[i];
        out[k + i] = next_activation(law, activation[i], decided[i]);
        for (int r = 0; r < m; r++)
            torque[r] += out[i] * arms[i * m + r];
    }
    for (int r = 0; r < m; r++)
        for (int c = 0; c < m; c++)
            torque[r] += stiffness[r * m + c] * missed[c];
}

static int fits(const Py_buffer *view, Py_ssize_t k, Py_ssize_t m)
{
    const Py_ssize_t number = sizeof(double);
    const Py_ssize_t bytes[ARRAYS] = {m * (Py_ssize_t)sizeof(int),  sizeof(Law),
                                      number * k * (4 + m),         number * k,
                                      number * (k + 2 * m + m * m), number * (2 * k + m)};
    return views_fit(view, ARRAYS, bytes);
}

/* Copy the values of the joints `columns` from a sequence with one value for each joint of the body. Returns 1, or 0
   with a Python error set. */
static int choose(PyObject *sequence, const int *columns, int m, double *out)
{
    const Py_ssize_t n = PySequence_Size(sequence);
    if (n < 0)
        return 0;
    double all[n + 1];
    if (!take(sequence, n, all) || !below(columns, m, (int)n))
        return 0;
    for (int r = 0; r < m; r++)
        out[r] = all[columns[r]];
    return 1;
}

/* Return a list of the numbers of a sequence, with those of the joints `columns` replaced. */
static PyObject *replaced(PyObject *sequence, const int *columns, int m, const double *values)
{
    const Py_ssize_t n = PySequence_Size(sequence);
    if (n < 0)
        return NULL;
    double all[n + 1];
    if (!take(sequence, n, all) || !below(columns, m, (int)n))
        return NULL;
    for (int r = 0; r < m; r++)
        all[columns[r]] = values[r];
    return list(all, n);
}

FUNCTION(give)
{
    if (!expect(count, ARRAYS + 4, "give(columns, law, state, activation, decided, out, q, dq, tau, ahead)"))
        return NULL;
    PyObject *const *joints = given + ARRAYS, *torque = NULL;
    const double ahead = PyFloat_AsDouble(joints[3]);
    Py_buffer view[ARRAYS];
    if (PyErr_Occurred() || !take_views(given, ARRAYS, OUT, view))
        return NULL;
    const Py_ssize_t k = view[ACTIVATION].len / (Py_ssize_t)sizeof(double),
                     m = view[COLUMNS].len / (Py_ssize_t)sizeof(int);
    double q[m + 1], dq[m + 1];
    if (fits(view, k, m) && choose(joints[0], view[COLUMNS].buf, (int)m, q)
        && choose(joints[1], view[COLUMNS].buf, (int)m, dq)) {
        double *out = view[OUT].buf;
        step(view[LAW].buf, (int)k, (int)m, view[STATE].buf, view[ACTIVATION].buf, view[DECIDED].buf, ahead, q, dq,
             out);
        torque = replaced(joints[2], view[COLUMNS].buf, (int)m, out + 2 * k);
    }
    release_views(view, ARRAYS);
    return torque;
}

static PyMethodDef methods[] = {
    METHOD(give, "(columns, law, state, activation, decided, out, q, dq, tau, ahead) -> tau with the torque of the "
                 "muscles; writes force, next activation and torque into out; ahead: time since the decision [s]"),
    {0},
};

MODULE(hric_muscle_drive, methods)

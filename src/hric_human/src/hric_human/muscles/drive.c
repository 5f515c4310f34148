/* Muscle forces and joint torques of one cycle, the activations of the next cycle, and decisions; explained in
 * drive.py.
 *
 * The order of the operations is part of the interface: runs are compared bit by bit. */
#include "hric_core/python_numbers.h"

#include <math.h>

enum { MOST = 64 }; /* joints */

/* Drive of k muscles on m joints of a body. */
typedef struct {
    PyObject_HEAD
    int k, m, column[MOST];                             /* column: index of each joint among those of the body */
    double rise, fall, smoothing, damping, cycle;       /* see `_constants` in drive.py */
    double *excitation, *stiffness, at[MOST], to[MOST]; /* of the last decision: at, to: positions and velocities */
} Drive;

/* Values of a cycle: the state of the muscles (MuscleState.numbers), activation, force, activation in the next cycle.
 */
typedef struct {
    const double *gain, *passive, *arms;
    double *activation, *force, *next;
} Cycle;

static Cycle cycle_of(const Drive *self, double *values)
{
    double *state = values + 4 * self->k, *activation = state + self->k * self->m;
    return (Cycle){state - 2 * self->k, state - self->k,      state,
                   activation,          activation + self->k, activation + 2 * self->k};
}

/* Rate of activation per difference between excitation and activation [1/s]. */
static double approach_speed(const Drive *self, double activation, double excitation)
{
    const double rising = 0.5 * tanh(self->smoothing * (excitation - activation)) + 0.5,
                 slowed = 0.5 + 1.5 * activation;
    return rising / (self->rise * slowed) + (1.0 - rising) * slowed / self->fall;
}

static double next_activation(const Drive *self, double activation, double excitation)
{
    if (activation == excitation)
        return excitation;
    const double speed = approach_speed(self, activation, excitation);
    return excitation + (activation - excitation) * exp(-self->cycle * speed);
}

/* Compute the values of this cycle from those of the cycle before, and the torque of the joints; ahead: time since the
   decision [s]. q, dq, torque: of all joints of the body. */
static void step(const Drive *self, const Cycle *before, Cycle *now, double ahead, const double *q, const double *dq,
                 double *torque)
{
    const int k = self->k, m = self->m, *column = self->column;
    double missed[MOST], sum[MOST] = {0.0};
    for (int r = 0; r < m; r++)
        missed[r] = self->at[r] + ahead * self->to[r] - q[column[r]] + self->damping * (self->to[r] - dq[column[r]]);
    for (int i = 0; i < k; i++) {
        const double activation = before->next[i], force = now->gain[i] * activation + now->passive[i];
        now->activation[i] = activation;
        now->force[i] = force;
        now->next[i] = next_activation(self, activation, self->excitation[i]);
        for (int r = 0; r < m; r++)
            sum[r] += force * now->arms[i * m + r];
    }
    for (int r = 0; r < m; r++)
        for (int c = 0; c < m; c++)
            sum[r] += self->stiffness[r * m + c] * missed[c];
    for (int r = 0; r < m; r++)
        torque[column[r]] = sum[r];
}

/* ---- Python ---- */

/* Copy a sequence with one number for each joint of the body; return its length, or -1 with a Python error set. */
static Py_ssize_t take_body(const Drive *self, PyObject *sequence, double *out)
{
    const Py_ssize_t n = PySequence_Size(sequence);
    if (n > MOST)
        PyErr_Format(PyExc_ValueError, "0 to %d joints are possible", MOST);
    return n >= 0 && n <= MOST && take(sequence, n, out) && below(self->column, self->m, (int)n) ? n : -1;
}

static Py_ssize_t cycle_bytes(const Drive *self) { return (Py_ssize_t)sizeof(double) * self->k * (7 + self->m); }

static PyObject *drive_give(Drive *self, PyObject *const *given, Py_ssize_t count)
{
    enum { BEFORE, NOW, ARRAYS, Q = ARRAYS, DQ, TAU, AHEAD, COUNT };
    double q[MOST], dq[MOST], tau[MOST];
    Py_buffer view[ARRAYS];
    if (!expect(count, COUNT, "give(before, now, q, dq, tau, ahead)"))
        return NULL;
    const double ahead = PyFloat_AsDouble(given[AHEAD]);
    const Py_ssize_t n = PyErr_Occurred() ? -1 : take_body(self, given[TAU], tau);
    const Py_ssize_t bytes[ARRAYS] = {cycle_bytes(self), cycle_bytes(self)};
    if (n < 0 || take_body(self, given[Q], q) < 0 || take_body(self, given[DQ], dq) < 0
        || !take_views(given, ARRAYS, NOW, view))
        return NULL;
    const int fit = views_fit(view, ARRAYS, bytes);
    if (fit) {
        const Cycle before = cycle_of(self, view[BEFORE].buf);
        Cycle now = cycle_of(self, view[NOW].buf);
        step(self, &before, &now, ahead, q, dq, tau);
    }
    release_views(view, ARRAYS);
    return fit ? list(tau, n) : NULL;
}

static PyObject *drive_required(Drive *self, PyObject *const *given, Py_ssize_t count)
{
    enum { NOW, OUT, ARRAYS, TAU = ARRAYS, COUNT };
    double tau[MOST];
    Py_buffer view[ARRAYS];
    if (!expect(count, COUNT, "required(now, out, tau)") || take_body(self, given[TAU], tau) < 0
        || !take_views(given, ARRAYS, OUT, view))
        return NULL;
    const Py_ssize_t bytes[ARRAYS] = {cycle_bytes(self), (Py_ssize_t)sizeof(double) * self->m};
    const int fit = views_fit(view, ARRAYS, bytes);
    for (int r = 0; fit && r < self->m; r++) {
        const Cycle now = cycle_of(self, view[NOW].buf);
        double *out = (double *)view[OUT].buf + r, sum = 0.0;
        for (int i = 0; i < self->k; i++)
            sum += now.passive[i] * now.arms[i * self->m + r];
        *out = tau[self->column[r]] - sum;
    }
    release_views(view, ARRAYS);
    return fit ? Py_NewRef(Py_None) : NULL;
}

static PyObject *drive_decide(Drive *self, PyObject *const *given, Py_ssize_t count)
{
    enum { ACTIVATION, AIM, STIFFNESS, EXCITATION, ARRAYS, Q = ARRAYS, DQ, AHEAD, COUNT };
    double q[MOST], dq[MOST];
    Py_buffer view[ARRAYS];
    if (!expect(count, COUNT, "decide(activation, aim, stiffness, excitation, q, dq, ahead)"))
        return NULL;
    const double ahead = PyFloat_AsDouble(given[AHEAD]);
    if (PyErr_Occurred() || take_body(self, given[Q], q) < 0 || take_body(self, given[DQ], dq) < 0
        || !take_views(given, ARRAYS, EXCITATION, view))
        return NULL;
    const Py_ssize_t row = (Py_ssize_t)sizeof(double) * self->k,
                     square = (Py_ssize_t)sizeof(double) * self->m * self->m;
    const Py_ssize_t bytes[ARRAYS] = {row, row, square, row};
    const double *activation = view[ACTIVATION].buf, *aim = view[AIM].buf;
    const int fit = views_fit(view, ARRAYS, bytes);
    for (int i = 0; fit && i < self->k; i++) {
        const double reached = -expm1(-ahead * approach_speed(self, activation[i], aim[i]));
        const double excitation = activation[i] + (aim[i] - activation[i]) / reached;
        self->excitation[i] = excitation < 0.0 ? 0.0 : excitation > 1.0 ? 1.0 : excitation;
    }
    for (int r = 0; fit && r < self->m; r++) {
        self->at[r] = q[self->column[r]];
        self->to[r] = dq[self->column[r]];
    }
    if (fit) {
        memcpy(self->stiffness, view[STIFFNESS].buf, (size_t)square);
        memcpy(view[EXCITATION].buf, self->excitation, (size_t)row);
    }
    release_views(view, ARRAYS);
    return fit ? Py_NewRef(Py_None) : NULL;
}

static int drive_init(Drive *self, PyObject *args)
{
    PyObject *columns;
    if (!PyArg_ParseTuple(args, "iO!ddddd", &self->k, &PyTuple_Type, &columns, &self->rise, &self->fall,
                          &self->smoothing, &self->damping, &self->cycle))
        return -1;
    const Py_ssize_t m = PyTuple_GET_SIZE(columns);
    if (self->k < 0 || m > MOST) {
        PyErr_Format(PyExc_ValueError, "%d muscles on %zd joints; valid: 0 to %d joints", self->k, m, MOST);
        return -1;
    }
    for (; self->m < m; self->m++)
        self->column[self->m] = (int)PyLong_AsLong(PyTuple_GET_ITEM(columns, self->m));
    self->excitation = PyErr_Occurred() ? NULL : zeroed((size_t)(self->k + self->m * self->m), sizeof(double));
    self->stiffness = self->excitation + self->k;
    return self->excitation == NULL ? -1 : 0;
}

static void drive_clear(Drive *self) { PyMem_Free(self->excitation); }

static PyMethodDef drive_methods[] = {
    {"give", FAST(drive_give),
     "(before, now, q, dq, tau, ahead) -> tau with the torque of the muscles; the arrays are the values of the cycle "
     "before and of this one, which has the state and gets the rest; ahead: time since the decision [s]"},
    {"required", FAST(drive_required), "(now, out, tau): write tau without the torque of the passive forces into out"},
    {"decide", FAST(drive_decide),
     "(activation, aim, stiffness, excitation, q, dq, ahead): set, and write, the excitations with which the muscles "
     "reach the activations `aim` in the time `ahead` [s]"},
    {0}};

TYPE_MODULE(hric_muscle_drive, Drive, drive, NULL)

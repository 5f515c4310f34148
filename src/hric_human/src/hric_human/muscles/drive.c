/* Muscle forces and joint torques of one cycle, the activations of the next cycle, and decisions; explained in
 * drive.py.
 *
 * The order of the operations is part of the interface: runs are compared bit by bit. */
#include "static_optimization.h"

enum { MOST = 64 }; /* joints of the body */

/* Drive of k muscles on m joints of a body. */
typedef struct {
    PyObject_HEAD
    int k, m, column[JOINTS];                           /* column: index of each joint among those of the body */
    double rise, fall, smoothing, damping, cycle, full; /* see MuscleDrive.__init__ */
    double at[JOINTS], to[JOINTS], start[JOINTS];       /* at, to: positions and velocities at the last decision */
    double *minimum, *excitation;                       /* (k): minimum activation; excitation of the last decision */
    Py_buffer stiffness;                                /* (m, m), of the last decision */
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
    const double *stiffness = self->stiffness.buf;
    double missed[JOINTS], sum[JOINTS] = {0.0};
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
            sum[r] += stiffness[r * m + c] * missed[c];
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

/* Return a list that says of each muscle whether its activation is full. */
static PyObject *saturated(const Drive *self, const double *activation)
{
    PyObject *made = PyList_New(self->k);
    for (int i = 0; made != NULL && i < self->k; i++)
        PyList_SET_ITEM(made, i, PyBool_FromLong(activation[i] >= self->full));
    return made;
}

/* Compute the torque of active forces that is required, the activations for it, and the excitations with which they are
   reached in the time `ahead` [s]; tau: torque of all joints of the body. Returns 0 with a Python error set on failure.
 */
static int decide(Drive *self, const Cycle *before, const Cycle *now, double ahead, int at_rest, const double *tau,
                  double *aim, double *shortfall)
{
    double required[JOINTS], passive[JOINTS] = {0.0};
    for (int i = 0; i < self->k; i++)
        for (int r = 0; r < self->m; r++)
            passive[r] += now->passive[i] * now->arms[i * self->m + r];
    for (int r = 0; r < self->m; r++)
        required[r] = tau[self->column[r]] - passive[r];
    double *const array[ARRAYS] = {
        (double *)now->arms, (double *)now->gain, self->minimum, required, self->start, aim, shortfall};
    if (optimise(self->k, self->m, array) < 0)
        return 0;
    if (at_rest)
        memcpy(before->next, aim, sizeof(double) * (size_t)self->k);
    for (int i = 0; i < self->k; i++) {
        const double a = before->next[i], reached = -expm1(-ahead * approach_speed(self, a, aim[i]));
        const double excitation = a + (aim[i] - a) / reached;
        self->excitation[i] = excitation < 0.0 ? 0.0 : excitation > 1.0 ? 1.0 : excitation;
    }
    return 1;
}

static PyObject *drive_decide(Drive *self, PyObject *const *given, Py_ssize_t count)
{
    enum { BEFORE, NOW, DECIDED, VIEWS, Q = VIEWS, DQ, TAU, AHEAD, AT_REST, COUNT };
    double q[MOST], dq[MOST], tau[MOST];
    Py_buffer view[VIEWS];
    if (!expect(count, COUNT, "decide(before, now, decided, q, dq, tau, ahead, at_rest)"))
        return NULL;
    const double ahead = PyFloat_AsDouble(given[AHEAD]);
    const int at_rest = PyObject_IsTrue(given[AT_REST]);
    if (PyErr_Occurred() || take_body(self, given[Q], q) < 0 || take_body(self, given[DQ], dq) < 0
        || take_body(self, given[TAU], tau) < 0 || !take_views(given, VIEWS, BEFORE, view))
        return NULL;
    const int k = self->k, m = self->m;
    const Py_ssize_t bytes[VIEWS] = {cycle_bytes(self), cycle_bytes(self), (Py_ssize_t)sizeof(double) * (2 * k + m)};
    PyObject *made = NULL;
    if (views_fit(view, VIEWS, bytes)) {
        const Cycle before = cycle_of(self, view[BEFORE].buf), now = cycle_of(self, view[NOW].buf);
        double *aim = view[DECIDED].buf, *excitation = aim + k;
        if (decide(self, &before, &now, ahead, at_rest, tau, aim, excitation + k))
            made = saturated(self, aim);
        memcpy(excitation, self->excitation, sizeof(double) * (size_t)k);
        for (int r = 0; r < m; r++) {
            self->at[r] = q[self->column[r]];
            self->to[r] = dq[self->column[r]];
        }
    }
    release_views(view, VIEWS);
    return made;
}

static PyObject *drive_approach_speed(Drive *self, PyObject *const *given, Py_ssize_t count)
{
    if (!expect(count, 2, "approach_speed(activation, excitation)"))
        return NULL;
    const double activation = PyFloat_AsDouble(given[0]), excitation = PyFloat_AsDouble(given[1]);
    return PyErr_Occurred() ? NULL : PyFloat_FromDouble(approach_speed(self, activation, excitation));
}

static int drive_init(Drive *self, PyObject *args)
{
    PyObject *columns, *minimum, *stiffness;
    if (!PyArg_ParseTuple(args, "O!OO(dddddd)", &PyTuple_Type, &columns, &minimum, &stiffness, &self->rise, &self->fall,
                          &self->smoothing, &self->damping, &self->cycle, &self->full))
        return -1;
    const Py_ssize_t m = PyTuple_GET_SIZE(columns), k = PySequence_Size(minimum);
    if (k < 1 || m < 1 || m > JOINTS) {
        PyErr_Format(PyExc_ValueError, "a drive of %zd muscles on %zd joints; valid: 1 or more, 1 to %d", k, m, JOINTS);
        return -1;
    }
    for (; self->m < m; self->m++)
        self->column[self->m] = (int)PyLong_AsLong(PyTuple_GET_ITEM(columns, self->m));
    self->k = (int)k;
    self->minimum = PyErr_Occurred() ? NULL : zeroed(2 * (size_t)k, sizeof(double));
    if (self->minimum == NULL || !take(minimum, k, self->minimum)
        || PyObject_GetBuffer(stiffness, &self->stiffness, PyBUF_C_CONTIGUOUS) < 0)
        return -1;
    self->excitation = self->minimum + k;
    const Py_ssize_t bytes = (Py_ssize_t)sizeof(double) * m * m;
    return views_fit(&self->stiffness, 1, &bytes) ? 0 : -1;
}

static void drive_clear(Drive *self)
{
    PyMem_Free(self->minimum);
    PyBuffer_Release(&self->stiffness);
}

static PyMethodDef drive_methods[] = {
    {"give", FAST(drive_give),
     "(before, now, q, dq, tau, ahead) -> tau with the torque of the muscles; the arrays are the values of the cycle "
     "before and of this one, which has the state and gets the rest; ahead: time since the decision [s]"},
    {"decide", FAST(drive_decide),
     "(before, now, decided, q, dq, tau, ahead, at_rest) -> list that says of each muscle whether its activation is to "
     "be full; writes the activations that the torque tau needs, the excitations that reach them in the time `ahead` "
     "[s], and the shortfall into `decided`; at_rest: the activations of this cycle are those, and are written"},
    {"approach_speed", FAST(drive_approach_speed), "(activation, excitation) -> rate per difference of both [1/s]"},
    {0}};

TYPE_MODULE(hric_muscle_drive, Drive, drive, NULL)

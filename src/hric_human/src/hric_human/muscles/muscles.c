/* Lengths, moment arms and forces of muscles from polynomials of joint angles; explained in muscle_set.py. */
#include "hric_core/python_numbers.h"

#include <math.h>

enum { BELLS = 3, LENGTHS = 91, SPEEDS = 201, OWN = 1 + 3 * LENGTHS + SPEEDS, PAIRS = 4, WIDTH = 2 * PAIRS };

/* Two numbers, with which a processor computes at once. */
typedef double Pair __attribute__((vector_size(2 * sizeof(double)), aligned(sizeof(double))));

typedef struct {
    double bell[BELLS][4], passive_shape, passive_strain, shortest, velocity[4], max_velocity;
} Curves;

/* Muscles of one arm. Monomial 0 is 1; each other is an earlier monomial (factor) times an angle. The sparse matrix has
   for each muscle a row for its length, followed by a row for its derivative by each angle. WIDTH rows with the same
   monomials are a tile, so that several of them are added up at once. */
typedef struct {
    int joints, monomials, muscles, row, column; /* row, column: index of the arm's first muscle and first joint */
    int tiles, *place, *factor, *angle;          /* place: index of each angle in q */
    int *size, *term, (*target)[WIDTH]; /* of each tile: number and indices of its monomials, its rows, one past the
                                           last row for none */
    double *lower, *upper;
    Pair (*coefficient)[PAIRS];              /* of each monomial of each tile in its rows */
    double *force, *optimal, *slack, *scale; /* scale: subject's lengths per model's */
    double *own; /* SampledCurves.numbers() of each muscle, or NULL if the muscles have the built-in curves */
    double *x, *value, *product; /* angles clipped to the range, monomials, rows of the matrix times the monomials */
} Arm;

typedef struct {
    PyObject_HEAD
    Curves curves;
    double lowest, range; /* of passive forces: at the shortest length, and from there to the optimal length */
    int muscles, columns, angles, arms; /* totals over all arms, and number of arms */
    double *constant;                   /* state with the values of the actuators, and 0 for muscles */
    Arm *arm;
} Muscles;

/* ---- arithmetic ---- */

static double active(const Curves *c, double l)
{
    double sum = 0.0;
    for (int i = 0; i < BELLS; i++) {
        const double *b = c->bell[i], x = (l - b[1]) / (b[2] + b[3] * l);
        sum += b[0] * exp(-0.5 * x * x);
    }
    return sum;
}

/* Passive force before it is shifted and scaled to be 0 at the shortest and 1 at the optimal length. */
static double passive(const Curves *c, double l) { return exp(c->passive_shape * (l - 1.0) / c->passive_strain); }

static double velocity_factor(const Curves *c, double v)
{
    const double *d = c->velocity;
    return d[0] * asinh(d[1] * v + d[2]) + d[3];
}

/* Interpolate between samples at equal steps from low to high; beyond them the value is constant. */
static double sampled(const double *value, int count, double low, double high, double x)
{
    const double at = (x - low) / (high - low) * (count - 1);
    if (isnan(at))
        return at;
    if (at <= 0.0)
        return value[0];
    if (at >= count - 1)
        return value[count - 1];
    const int i = (int)at;
    return value[i] + (at - i) * (value[i + 1] - value[i]);
}

static double at_length(const double *value, double l) { return sampled(value, LENGTHS, 0.2, 2.0, l); }

/* Compute the monomials at the angles, clipped to the range of the fit. Returns 1 if an angle was clipped, else 0. */
static int prepare(const Arm *arm, const double *q)
{
    int outside = 0;
    for (int j = 0; j < arm->joints; j++) {
        const double angle = q[arm->place[j]];
        arm->x[j] = angle < arm->lower[j] ? arm->lower[j] : angle > arm->upper[j] ? arm->upper[j] : angle;
        outside |= arm->x[j] != angle;
    }
    arm->value[0] = 1.0;
    for (int t = 1; t < arm->monomials; t++)
        arm->value[t] = arm->value[arm->factor[t]] * arm->x[arm->angle[t]];
    return outside;
}

/* Multiply the sparse matrix by the monomials; the terms of each row are added in the order of its monomials. */
static void multiply(const Arm *arm)
{
    const int *term = arm->term;
    const Pair(*coefficient)[PAIRS] = (const Pair(*)[PAIRS])arm->coefficient;
    for (int n = 0; n < arm->tiles; n++) {
        Pair sum[PAIRS] = {0};
        for (const int *end = term + arm->size[n]; term < end; term++, coefficient++)
            for (int p = 0; p < PAIRS; p++)
                sum[p] += (*coefficient)[p] * arm->value[*term];
        for (int r = 0; r < WIDTH; r++)
            arm->product[arm->target[n][r]] = sum[r / 2][r % 2];
    }
}

static void muscle(const Muscles *self, const Arm *arm, int i, const double *dq, double *out)
{
    const Curves *c = &self->curves;
    const int k = arm->row + i, first = i * (1 + arm->joints);
    const double *row = arm->product + first;
    double *arms = out + 4 * self->muscles + k * self->columns + arm->column, speed = 0.0;
    for (int j = 0; j < arm->joints; j++) {
        arms[j] = -arm->scale[i] * row[1 + j];
        speed -= arms[j] * dq[arm->place[j]];
    }
    const double length = (row[0] - arm->slack[i]) / arm->optimal[i],
                 velocity = speed / (arm->scale[i] * arm->optimal[i]);
    out[k] = length;
    out[self->muscles + k] = velocity;
    if (arm->own != NULL) {
        const double *own = arm->own + i * OWN, *forces = own + 1, *speeds = forces + 2 * LENGTHS;
        const double fibre = velocity * at_length(speeds, length) / own[0];
        out[2 * self->muscles + k] =
            arm->force[i] * at_length(forces, length) * sampled(speeds + LENGTHS, SPEEDS, -1.0, 1.0, fibre);
        out[3 * self->muscles + k] = arm->force[i] * at_length(forces + LENGTHS, length);
        return;
    }
    out[2 * self->muscles + k] = arm->force[i] * active(c, length) * velocity_factor(c, velocity / c->max_velocity);
    out[3 * self->muscles + k] = arm->force[i] * ((passive(c, length) - self->lowest) / self->range);
}

static PyObject *muscles_at(Muscles *self, PyObject *const *given, Py_ssize_t count)
{
    Py_buffer view;
    double q[self->angles + 1], dq[self->angles + 1];
    if (!expect(count, 3, "at(q, dq, out)") || !take(given[0], self->angles, q) || !take(given[1], self->angles, dq)
        || PyObject_GetBuffer(given[2], &view, PyBUF_WRITABLE) < 0)
        return NULL;
    const size_t size = (size_t)self->muscles * (size_t)(4 + self->columns) * sizeof(double);
    int outside = 0;
    if (view.len >= (Py_ssize_t)size) {
        memcpy(view.buf, self->constant, size);
        for (const Arm *arm = self->arm; arm < self->arm + self->arms; arm++) {
            outside |= prepare(arm, q);
            multiply(arm);
            for (int i = 0; i < arm->muscles; i++)
                muscle(self, arm, i, dq, view.buf);
        }
    } else
        PyErr_Format(PyExc_ValueError, "out is at least %zu bytes, got %zd", size, view.len);
    PyBuffer_Release(&view);
    return PyErr_Occurred() ? NULL : PyBool_FromLong(outside);
}

/* Write the stiffness that the forces of the muscles give to the joints; per_force: stiffness of a muscle along its
   line of action per force [1/m]. */
static PyObject *muscles_stiffness(Muscles *self, PyObject *const *given, Py_ssize_t count)
{
    enum { STATE, ACTIVATION, OUT, ARRAYS, PER_FORCE = ARRAYS, COUNT };
    Py_buffer view[ARRAYS];
    if (!expect(count, COUNT, "stiffness(state, activation, out, per_force)"))
        return NULL;
    const double per_force = PyFloat_AsDouble(given[PER_FORCE]);
    if (PyErr_Occurred() || !take_views(given, ARRAYS, OUT, view))
        return NULL;
    const int k = self->muscles, m = self->columns;
    const Py_ssize_t number = sizeof(double), bytes[ARRAYS] = {number * k * (4 + m), number * k, number * m * m};
    const double *gain = (const double *)view[STATE].buf + 2 * k, *passive = gain + k,
                 *activation = view[ACTIVATION].buf;
    const int fit = views_fit(view, ARRAYS, bytes);
    if (fit)
        memset(view[OUT].buf, 0, (size_t)bytes[OUT]);
    for (const Arm *arm = self->arm; fit && arm < self->arm + self->arms; arm++)
        for (int i = arm->row; i < arm->row + arm->muscles; i++) {
            const double spring = per_force * (gain[i] * activation[i] + passive[i]);
            const double *arms = passive + k + i * m + arm->column;
            double *out = (double *)view[OUT].buf + arm->column * (m + 1);
            for (int r = 0; r < arm->joints; r++)
                for (int c = 0; c < arm->joints; c++)
                    out[r * m + c] += arms[r] * spring * arms[c];
        }
    release_views(view, ARRAYS);
    return fit ? Py_NewRef(Py_None) : NULL;
}

/* ---- the type ---- */

/* Return a copy of a buffer of n elements of `each` bytes, or NULL with a Python error set. */
static void *copied(PyObject *buffer, size_t n, size_t each, const char *what)
{
    void *memory = PyMem_Malloc(n * each + 1);
    if (memory == NULL)
        PyErr_NoMemory();
    else if (!copy_buffer(buffer, n * each, memory, what)) {
        PyMem_Free(memory);
        memory = NULL;
    }
    return memory;
}

static int valid(const Muscles *self, const Arm *arm, int entries)
{
    for (int t = 1; t < arm->monomials; t++)
        if (!below(arm->factor + t, 1, t))
            return 0;
    int left = entries;
    for (int n = 0; n < arm->tiles && left >= 0; n++)
        left = arm->size[n] < 0 ? -1 : left - arm->size[n];
    if (left != 0 || arm->row < 0 || arm->row + arm->muscles > self->muscles || arm->column < 0
        || arm->column + arm->joints > self->columns) {
        PyErr_SetString(PyExc_ValueError, "an arm's tiles, rows or columns exceed their totals");
        return 0;
    }
    return below(arm->place, arm->joints, self->angles) && below(arm->angle, arm->monomials, arm->joints)
           && below(arm->target[0], WIDTH * arm->tiles, arm->muscles * (1 + arm->joints) + 1)
           && below(arm->term, entries, arm->monomials);
}

/* Read an arm from the tuple (sizes, integers, numbers). sizes: joints, monomials, muscles, tiles, monomials of all
   tiles, first row, first column, 1 if the muscles have curves of their own; integers and numbers: the arrays of Arm in
   their order. */
static int take_arm(const Muscles *self, PyObject *given, Arm *arm)
{
    PyObject *integers, *numbers;
    int entries, own;
    if (!PyArg_ParseTuple(given, "(iiiiiiii)OO", &arm->joints, &arm->monomials, &arm->muscles, &arm->tiles, &entries,
                          &arm->row, &arm->column, &own, &integers, &numbers))
        return 0;
    if (arm->joints < 1 || arm->monomials < 1 || arm->muscles < 0 || arm->tiles < 0 || entries < 0) {
        PyErr_SetString(PyExc_ValueError, "an arm has no joints or no monomials");
        return 0;
    }
    const size_t m = (size_t)arm->joints, t = (size_t)arm->monomials, k = (size_t)arm->muscles, n = (size_t)arm->tiles,
                 e = (size_t)entries;
    arm->place = copied(integers, m + 2 * t + n + e + WIDTH * n, sizeof(int), "the integers of an arm");
    arm->lower = arm->place == NULL ? NULL
                                    : copied(numbers, 2 * m + WIDTH * e + (own ? 4 + OWN : 4) * k, sizeof(double),
                                             "the numbers of an arm");
    arm->x = arm->lower == NULL ? NULL : zeroed(m + t + k * (1 + m) + 1, sizeof(double));
    if (arm->x == NULL)
        return 0;
    arm->factor = arm->place + m, arm->angle = arm->factor + t, arm->size = arm->angle + t;
    arm->term = arm->size + n, arm->target = (int (*)[WIDTH])(arm->term + e);
    arm->upper = arm->lower + m, arm->coefficient = (Pair(*)[PAIRS])(arm->upper + m);
    arm->force = arm->upper + m + WIDTH * e, arm->optimal = arm->force + k, arm->slack = arm->optimal + k;
    arm->scale = arm->slack + k, arm->own = own ? arm->scale + k : NULL;
    arm->value = arm->x + m, arm->product = arm->value + t;
    return valid(self, arm, entries);
}

static int muscles_init(Muscles *self, PyObject *args)
{
    PyObject *curves, *constant, *arms;
    if (!PyArg_ParseTuple(args, "OO(iii)O!", &curves, &constant, &self->muscles, &self->columns, &self->angles,
                          &PyList_Type, &arms)
        || !copy_buffer(curves, sizeof self->curves, &self->curves, "the curves"))
        return -1;
    if (self->muscles < 0 || self->columns < 0 || self->angles < 0) {
        PyErr_SetString(PyExc_ValueError, "a count is below 0");
        return -1;
    }
    self->lowest = passive(&self->curves, self->curves.shortest);
    self->range = exp(self->curves.passive_shape) - self->lowest;
    const Py_ssize_t count = PyList_GET_SIZE(arms);
    self->constant =
        copied(constant, (size_t)self->muscles * (size_t)(4 + self->columns), sizeof(double), "the constants");
    self->arm = self->constant == NULL ? NULL : zeroed((size_t)count, sizeof(Arm));
    if (self->arm == NULL)
        return -1;
    for (; self->arms < count; self->arms++)
        if (!take_arm(self, PyList_GET_ITEM(arms, self->arms), self->arm + self->arms)) {
            self->arms++; /* so that muscles_clear also frees the memory of this incomplete arm */
            return -1;
        }
    return 0;
}

static void muscles_clear(Muscles *self)
{
    for (int i = 0; i < self->arms; i++) {
        PyMem_Free(self->arm[i].place);
        PyMem_Free(self->arm[i].lower);
        PyMem_Free(self->arm[i].x);
    }
    PyMem_Free(self->arm);
    PyMem_Free(self->constant);
}

static PyMethodDef muscles_methods[] = {
    {"at", FAST(muscles_at),
     "(q, dq, out) -> True if an angle is outside the range; writes length, velocity, gain and passive force of all "
     "muscles into out, then their moment arms"},
    {"stiffness", FAST(muscles_stiffness), "(state, activation, out, per_force): write the stiffness of the joints"},
    {0}};

TYPE_MODULE(hric_muscles, Muscles, muscles, NULL)

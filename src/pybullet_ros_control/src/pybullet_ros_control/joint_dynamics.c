/* Forward dynamics of one robot with a fixed base, on Python's own lists: what joint_dynamics.py explains.

   All in the frame of the world. Spatial vectors are taken about its origin: a motion is (angular velocity w, velocity v of the point of the body at
   the origin), a force is (moment n about the origin, force f). Composite-rigid-body and Newton-Euler algorithms as in Featherstone, Rigid Body
   Dynamics Algorithms (2008), ch. 5 and 6. */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>
#include <string.h>

#define LOCKED 1e9             /* added to the inertia of a joint whose acceleration is prescribed [kg m^2] */
#define NOTICEABLE 1e-9        /* below this a difference between predicted and engine velocity is rounding [rad/s] */
#define NEGLIGIBLE 1e-7        /* below this, with no difference left, the engine is taken to add nothing [N m] */
#define FRICTION_SWEEPS 50
#define FRICTION_TOLERANCE 1e-12 /* relative change of the friction at which its iteration ends */

typedef double Vec[3];
typedef double Mat[3][3];

typedef struct {
    /* constants, in the order of a row that Python gives */
    double parent, slides;
    Mat R_parent_joint;
    Vec p_parent_joint, axis;
    double mass;
    Vec com;
    Mat inertia;
    double rotor, coulomb, damping, sigmoid[3], rest; /* sigmoid: a (tanh(b (v + c)) - rest) */
} Constants;

enum { ROW = sizeof(Constants) / sizeof(double) };

typedef struct {
    Mat R;
    Vec o, w, v;   /* frame, and motion of a unit joint velocity */
    double m;      /* of this body: mass, first moment, inertia about the origin */
    Vec h;
    Mat I;
    double cm;     /* of this body and all that it carries */
    Vec ch;
    Mat cI;
    Vec V_w, V_v, A_w, A_v, F_n, F_f;
} Body;

typedef struct {
    PyObject_HEAD
    Py_ssize_t n;
    double dt, gravity[3];
    int passes, predicting, adding, sticking, lossy;
    Constants *constants;
    Body *bodies;
    double *block;
    /* n numbers each */
    double *q, *dq, *tau, *external, *prescribed, *bias, *bias0, *w, *x, *loss, *slope, *predicted, *engine, *friction, *velocity, *inertia;
    int *driven;
    /* n x n numbers each */
    double *M, *A, *gain;
} Dynamics;

/* -- vectors ---------------------------------------------------------------------------------------------------------------------------- */

static double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void cross(const double *a, const double *b, double *c)
{
    Vec r = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    memcpy(c, r, sizeof r);
}

static void add_cross(const double *a, const double *b, double *c)
{
    Vec r;
    cross(a, b, r);
    for (int i = 0; i < 3; i++)
        c[i] += r[i];
}

static void turn(const Mat R, const double *a, double *b)
{
    Vec r = {dot(R[0], a), dot(R[1], a), dot(R[2], a)};
    memcpy(b, r, sizeof r);
}

static void multiply(const Mat A, const Mat B, Mat C)
{
    Mat r;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            r[i][j] = A[i][0] * B[0][j] + A[i][1] * B[1][j] + A[i][2] * B[2][j];
    memcpy(C, r, sizeof r);
}

/* Rotation by an angle about a unit axis (Rodrigues). */
static void rotation(const double *a, double angle, Mat R)
{
    double s = sin(angle), c = cos(angle), k = 1.0 - c;
    Mat r = {{c + k * a[0] * a[0], k * a[0] * a[1] - s * a[2], k * a[0] * a[2] + s * a[1]},
             {k * a[0] * a[1] + s * a[2], c + k * a[1] * a[1], k * a[1] * a[2] - s * a[0]},
             {k * a[0] * a[2] - s * a[1], k * a[1] * a[2] + s * a[0], c + k * a[2] * a[2]}};
    memcpy(R, r, sizeof r);
}

/* -- the robot -------------------------------------------------------------------------------------------------------------------------- */

static void place(Dynamics *self)
{
    static const Mat identity = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    static const Vec zero = {0, 0, 0};
    for (Py_ssize_t i = 0; i < self->n; i++) {
        const Constants *c = &self->constants[i];
        Body *b = &self->bodies[i];
        const Body *parent = c->parent < 0 ? NULL : &self->bodies[(Py_ssize_t)c->parent];
        const double(*R)[3] = parent == NULL ? identity : parent->R;
        const double *o = parent == NULL ? zero : parent->o;
        Mat turned;
        Vec axis, com;
        turn(R, c->p_parent_joint, b->o);
        for (int k = 0; k < 3; k++)
            b->o[k] += o[k];
        multiply(R, c->R_parent_joint, b->R);
        turn(b->R, c->axis, axis);
        if (c->slides != 0.0) {
            for (int k = 0; k < 3; k++) {
                b->o[k] += axis[k] * self->q[i];
                b->w[k] = 0.0;
                b->v[k] = axis[k];
            }
        } else {
            rotation(c->axis, self->q[i], turned);
            multiply(b->R, turned, b->R);
            memcpy(b->w, axis, sizeof axis);
            cross(b->o, axis, b->v);
        }
        turn(b->R, c->com, com);
        for (int k = 0; k < 3; k++)
            com[k] += b->o[k];
        Mat half;
        multiply(b->R, c->inertia, half);
        double square = dot(com, com);
        b->m = c->mass;
        for (int k = 0; k < 3; k++) {
            b->h[k] = c->mass * com[k];
            for (int l = 0; l < 3; l++)
                b->I[k][l] = dot(half[k], b->R[l]) + c->mass * ((k == l ? square : 0.0) - com[k] * com[l]);
        }
    }
}

/* Force (n, f) of a body with inertia (m, h, I) that a motion (w, v) goes with. */
static void momentum(double m, const double *h, const Mat I, const double *w, const double *v, double *n, double *f)
{
    turn(I, w, n);
    add_cross(h, v, n);
    cross(w, h, f);
    for (int k = 0; k < 3; k++)
        f[k] += m * v[k];
}

/* The joint-space mass matrix of the links, row-major. */
static void mass_matrix(Dynamics *self)
{
    Py_ssize_t n = self->n;
    Body *bodies = self->bodies;
    memset(self->M, 0, sizeof(double) * (size_t)(n * n));
    for (Py_ssize_t i = 0; i < n; i++) {
        Body *b = &bodies[i];
        b->cm = b->m;
        memcpy(b->ch, b->h, sizeof b->h);
        memcpy(b->cI, b->I, sizeof b->I);
    }
    for (Py_ssize_t i = n - 1; i >= 0; i--) {
        Body *b = &bodies[i];
        Vec moment, force;
        momentum(b->cm, b->ch, b->cI, b->w, b->v, moment, force);
        for (Py_ssize_t j = i; j >= 0; j = (Py_ssize_t)self->constants[j].parent)
            self->M[i * n + j] = self->M[j * n + i] = dot(bodies[j].w, moment) + dot(bodies[j].v, force);
        Py_ssize_t parent = (Py_ssize_t)self->constants[i].parent;
        if (parent >= 0) {
            Body *p = &bodies[parent];
            p->cm += b->cm;
            for (int k = 0; k < 3; k++) {
                p->ch[k] += b->ch[k];
                for (int l = 0; l < 3; l++)
                    p->cI[k][l] += b->cI[k][l];
            }
        }
    }
}

/* Efforts that hold the joint velocities u as they are: Coriolis, centrifugal, gravity. */
static void bias(Dynamics *self, const double *u, double *result)
{
    for (Py_ssize_t i = 0; i < self->n; i++) {
        Body *b = &self->bodies[i];
        const Body *parent = self->constants[i].parent < 0 ? NULL : &self->bodies[(Py_ssize_t)self->constants[i].parent];
        Vec jw, jv, n, f;
        for (int k = 0; k < 3; k++) {
            jw[k] = b->w[k] * u[i];
            jv[k] = b->v[k] * u[i];
            b->V_w[k] = (parent == NULL ? 0.0 : parent->V_w[k]) + jw[k];
            b->V_v[k] = (parent == NULL ? 0.0 : parent->V_v[k]) + jv[k];
            b->A_w[k] = parent == NULL ? 0.0 : parent->A_w[k];
            b->A_v[k] = parent == NULL ? -self->gravity[k] : parent->A_v[k];
        }
        add_cross(b->V_w, jw, b->A_w);
        add_cross(b->V_w, jv, b->A_v);
        add_cross(b->V_v, jw, b->A_v);
        momentum(b->m, b->h, b->I, b->A_w, b->A_v, b->F_n, b->F_f);
        momentum(b->m, b->h, b->I, b->V_w, b->V_v, n, f);
        add_cross(b->V_w, n, b->F_n);
        add_cross(b->V_v, f, b->F_n);
        add_cross(b->V_w, f, b->F_f);
    }
    for (Py_ssize_t i = self->n - 1; i >= 0; i--) {
        Body *b = &self->bodies[i];
        result[i] = dot(b->w, b->F_n) + dot(b->v, b->F_f);
        if (self->constants[i].parent >= 0) {
            Body *p = &self->bodies[(Py_ssize_t)self->constants[i].parent];
            for (int k = 0; k < 3; k++) {
                p->F_n[k] += b->F_n[k];
                p->F_f[k] += b->F_f[k];
            }
        }
    }
}

/* -- the equations ---------------------------------------------------------------------------------------------------------------------- */

/* A = L D L' in place: L below the diagonal, 1 / D on it (square-root-free Cholesky). */
static void factor(Py_ssize_t n, double *A)
{
    for (Py_ssize_t i = 0; i < n; i++) {
        for (Py_ssize_t j = 0; j < i; j++)
            for (Py_ssize_t k = 0; k < j; k++)
                A[i * n + j] -= A[i * n + k] * A[j * n + k];
        for (Py_ssize_t j = 0; j < i; j++) {
            double c = A[i * n + j];
            A[i * n + j] = c * A[j * n + j];
            A[i * n + i] -= c * A[i * n + j];
        }
        A[i * n + i] = 1.0 / A[i * n + i];
    }
}

static void solve(Py_ssize_t n, const double *A, double *x)
{
    for (Py_ssize_t i = 0; i < n; i++)
        for (Py_ssize_t k = 0; k < i; k++)
            x[i] -= A[i * n + k] * x[k];
    for (Py_ssize_t i = n - 1; i >= 0; i--) {
        x[i] *= A[i * n + i];
        for (Py_ssize_t k = i + 1; k < n; k++)
            x[i] -= A[k * n + i] * x[k];
    }
}

/* What damping and the sigmoid take away at velocity u, and its slope. */
static void losses(Dynamics *self, const double *u)
{
    for (Py_ssize_t i = 0; i < self->n; i++) {
        const Constants *c = &self->constants[i];
        self->loss[i] = c->damping * u[i];
        self->slope[i] = c->damping;
        if (c->sigmoid[0] != 0.0) {
            double t = tanh(c->sigmoid[1] * (u[i] + c->sigmoid[2]));
            self->loss[i] += c->sigmoid[0] * (t - c->rest);
            self->slope[i] += c->sigmoid[0] * c->sigmoid[1] * (1.0 - t * t);
        }
    }
}

/* Coulomb friction f with |f_i| <= F_i that brings v + dt x to zero where it can (projected Gauss-Seidel); x is changed by what it does. */
static void stick(Dynamics *self)
{
    Py_ssize_t n = self->n;
    double largest = 0.0, *f = self->friction, *end = self->w;
    for (Py_ssize_t i = 0; i < n; i++) {
        double *column = self->gain + i * n;
        memset(column, 0, sizeof(double) * (size_t)n);
        column[i] = self->dt;
        solve(n, self->A, column);
        end[i] = self->dq[i] + self->dt * self->x[i];
        largest = fmax(largest, self->constants[i].coulomb);
    }
    for (Py_ssize_t i = 0; i < n; i++) {
        double F = self->driven[i] ? 0.0 : self->constants[i].coulomb;
        f[i] = fmin(fmax(f[i], -F), F);
        for (Py_ssize_t k = 0; k < n; k++)
            end[k] += self->gain[i * n + k] * f[i];
    }
    for (int sweep = 0; sweep < FRICTION_SWEEPS; sweep++) {
        double change = 0.0;
        for (Py_ssize_t i = 0; i < n; i++) {
            double F = self->driven[i] ? 0.0 : self->constants[i].coulomb;
            double new = fmin(fmax(f[i] - end[i] / self->gain[i * n + i], -F), F);
            for (Py_ssize_t k = 0; k < n; k++)
                end[k] += (new - f[i]) * self->gain[i * n + k];
            change = fmax(change, fabs(new - f[i]));
            f[i] = new;
        }
        if (change <= FRICTION_TOLERANCE * largest)
            break;
    }
    for (Py_ssize_t i = 0; i < n; i++)
        self->x[i] = (end[i] - self->dq[i]) / self->dt;
}

/* What the engine added by itself in the last step, from the velocity that it ended with and the one that was predicted. */
static void update_engine_effort(Dynamics *self)
{
    Py_ssize_t n = self->n;
    double square = 0.0;
    for (Py_ssize_t i = 0; i < n; i++)
        square += (self->dq[i] - self->predicted[i]) * (self->dq[i] - self->predicted[i]);
    int quiet = square < NOTICEABLE * NOTICEABLE, gone = quiet;
    if (quiet && !self->adding)
        return;
    for (Py_ssize_t i = 0; i < n; i++) {
        double effort = self->adding ? self->engine[i] : 0.0;
        for (Py_ssize_t k = 0; k < n; k++)
            effort += self->M[i * n + k] * (self->dq[k] - self->predicted[k]) / self->dt;
        self->engine[i] = self->driven[i] ? 0.0 : effort; /* what it added there was its motor */
        gone = gone && fabs(self->engine[i]) < NEGLIGIBLE;
    }
    self->adding = !gone;
}

/* One evaluation: acceleration x with bias and losses at self->w, which is v in the first pass and v + dt/2 x in those that follow. */
static void accelerate(Dynamics *self, int first)
{
    Py_ssize_t n = self->n;
    double half = first ? 0.0 : 0.5 * self->dt;
    double lean = self->passes > 0 ? 0.5 * self->dt : 0.0; /* losses follow the velocity in the middle of the step */
    int fresh = first || self->lossy; /* the matrix of the first pass serves all, unless a slope is in it */
    bias(self, self->w, self->bias);
    if (self->lossy)
        losses(self, self->w);
    else
        memset(self->loss, 0, sizeof(double) * (size_t)n);
    if (fresh)
        memcpy(self->A, self->M, sizeof(double) * (size_t)(n * n));
    for (Py_ssize_t i = 0; i < n; i++) {
        if (fresh)
            self->A[i * n + i] += self->inertia[i] + lean * self->slope[i];
        if (self->driven[i]) {
            self->x[i] = LOCKED * self->prescribed[i];
            continue;
        }
        self->loss[i] -= half * self->slope[i] * self->x[i]; /* linear in x: loss(w) + slope (v + dt/2 x - w) */
        double drive = self->tau[i] - self->loss[i] - self->bias[i];
        if (self->external != NULL)
            drive += self->external[i];
        if (self->adding)
            drive += self->engine[i];
        self->x[i] = drive;
    }
    if (fresh)
        factor(n, self->A);
    solve(n, self->A, self->x);
    if (self->sticking)
        stick(self);
    for (Py_ssize_t i = 0; i < n; i++)
        self->loss[i] += lean * self->slope[i] * self->x[i];
}

/* -- Python ----------------------------------------------------------------------------------------------------------------------------- */

static int numbers(PyObject *sequence, Py_ssize_t n, double *into)
{
    PyObject *fast = PySequence_Fast(sequence, "a sequence of numbers is wanted");
    if (fast == NULL)
        return -1;
    if (PySequence_Fast_GET_SIZE(fast) != n) {
        PyErr_Format(PyExc_ValueError, "%zd numbers are wanted, got %zd", n, PySequence_Fast_GET_SIZE(fast));
        Py_DECREF(fast);
        return -1;
    }
    PyObject **items = PySequence_Fast_ITEMS(fast);
    for (Py_ssize_t i = 0; i < n; i++)
        into[i] = PyFloat_AsDouble(items[i]);
    Py_DECREF(fast);
    return PyErr_Occurred() ? -1 : 0;
}

static PyObject *list_of(Py_ssize_t n, const double *values)
{
    PyObject *list = PyList_New(n);
    for (Py_ssize_t i = 0; list != NULL && i < n; i++) {
        PyObject *number = PyFloat_FromDouble(values[i]);
        if (number == NULL)
            Py_CLEAR(list);
        else
            PyList_SET_ITEM(list, i, number);
    }
    return list;
}

static int take_prescribed(Dynamics *self, PyObject *sequence)
{
    PyObject *fast = PySequence_Fast(sequence, "a sequence of numbers or None is wanted");
    if (fast == NULL)
        return -1;
    int failed = PySequence_Fast_GET_SIZE(fast) != self->n;
    if (failed)
        PyErr_Format(PyExc_ValueError, "%zd values are wanted, got %zd", self->n, PySequence_Fast_GET_SIZE(fast));
    for (Py_ssize_t i = 0; !failed && i < self->n; i++) {
        PyObject *item = PySequence_Fast_GET_ITEM(fast, i);
        self->driven[i] = item != Py_None;
        if (self->driven[i]) {
            self->prescribed[i] = PyFloat_AsDouble(item);
            self->inertia[i] = LOCKED;
        }
    }
    Py_DECREF(fast);
    return failed || PyErr_Occurred() ? -1 : 0;
}

static PyObject *dynamics_torque(Dynamics *self, PyObject *const *given, Py_ssize_t count)
{
    Py_ssize_t n = self->n;
    double external[n > 0 ? n : 1];
    if (count != 5) {
        PyErr_SetString(PyExc_TypeError, "torque(q, dq, tau, external, prescribed)");
        return NULL;
    }
    if (numbers(given[0], n, self->q) || numbers(given[1], n, self->dq) || numbers(given[2], n, self->tau))
        return NULL;
    self->external = given[3] == Py_None ? NULL : external;
    if (self->external != NULL && numbers(given[3], n, external))
        return NULL;
    if (self->predicting)
        update_engine_effort(self);
    for (Py_ssize_t i = 0; i < n; i++) {
        self->inertia[i] = self->constants[i].rotor;
        self->driven[i] = 0;
        self->w[i] = self->dq[i];
    }
    if (given[4] != Py_None && take_prescribed(self, given[4]) < 0)
        return NULL;
    place(self);
    mass_matrix(self);
    accelerate(self, 1);
    memcpy(self->bias0, self->bias, sizeof(double) * (size_t)n);
    for (int pass = 0; pass < self->passes; pass++) {
        for (Py_ssize_t i = 0; i < n; i++)
            self->w[i] = self->dq[i] + 0.5 * self->dt * self->x[i];
        accelerate(self, 0);
    }
    double effort[n > 0 ? n : 1];
    for (Py_ssize_t i = 0; i < n; i++) {
        self->velocity[i] = self->dq[i];
        self->predicted[i] = self->dq[i] + self->dt * self->x[i];
        effort[i] = self->tau[i] - self->constants[i].rotor * self->x[i] - self->loss[i] + (self->bias0[i] - self->bias[i]);
        if (self->sticking)
            effort[i] += self->friction[i];
    }
    self->predicting = 1;
    self->external = NULL;
    return list_of(n, effort);
}

static PyObject *dynamics_forget(Dynamics *self, PyObject *Py_UNUSED(none))
{
    self->predicting = self->adding = 0;
    memset(self->friction, 0, sizeof(double) * (size_t)self->n);
    memset(self->driven, 0, sizeof(int) * (size_t)self->n);
    Py_RETURN_NONE;
}

static PyObject *dynamics_rotor_efforts(Dynamics *self, PyObject *dq)
{
    Py_ssize_t n = self->n;
    double effort[n > 0 ? n : 1];
    if (numbers(dq, n, effort))
        return NULL;
    for (Py_ssize_t i = 0; i < n; i++)
        effort[i] = self->predicting ? self->constants[i].rotor * (effort[i] - self->velocity[i]) / self->dt : 0.0;
    return list_of(n, effort);
}

static PyObject *dynamics_mass_matrix(Dynamics *self, PyObject *q)
{
    if (numbers(q, self->n, self->q))
        return NULL;
    double *kept = self->M, own[self->n > 0 ? self->n * self->n : 1];
    self->M = own; /* that of the last step stays */
    place(self);
    mass_matrix(self);
    self->M = kept;
    return list_of(self->n * self->n, own);
}

static PyObject *dynamics_bias(Dynamics *self, PyObject *const *given, Py_ssize_t count)
{
    double u[self->n > 0 ? self->n : 1], result[self->n > 0 ? self->n : 1];
    if (count != 2) {
        PyErr_SetString(PyExc_TypeError, "bias(q, dq)");
        return NULL;
    }
    if (numbers(given[0], self->n, self->q) || numbers(given[1], self->n, u))
        return NULL;
    place(self);
    bias(self, u, result);
    return list_of(self->n, result);
}

static int take_rows(Dynamics *self, PyObject *rows)
{
    for (Py_ssize_t i = 0; i < self->n; i++) {
        PyObject *row = PySequence_GetItem(rows, i);
        int failed = row == NULL || numbers(row, ROW, (double *)&self->constants[i]) < 0;
        Py_XDECREF(row);
        if (failed)
            return -1;
        if (!(self->constants[i].parent < (double)i)) {
            PyErr_Format(PyExc_ValueError, "joint %zd must come after its parent", i);
            return -1;
        }
        self->sticking = self->sticking || self->constants[i].coulomb > 0.0;
        self->lossy = self->lossy || self->constants[i].damping != 0.0 || self->constants[i].sigmoid[0] != 0.0;
    }
    return 0;
}

static int dynamics_init(Dynamics *self, PyObject *args, PyObject *Py_UNUSED(kwargs))
{
    PyObject *gravity, *rows;
    if (self->block != NULL) {
        PyErr_SetString(PyExc_TypeError, "it is made once");
        return -1;
    }
    if (!PyArg_ParseTuple(args, "diOO", &self->dt, &self->passes, &gravity, &rows) || numbers(gravity, 3, self->gravity))
        return -1;
    Py_ssize_t n = self->n = PySequence_Size(rows);
    if (n < 0)
        return -1;
    size_t vectors = 15, size = (size_t)n;
    self->constants = PyMem_Calloc(size + 1, sizeof(Constants));
    self->bodies = PyMem_Calloc(size + 1, sizeof(Body));
    self->driven = PyMem_Calloc(size + 1, sizeof(int));
    self->block = PyMem_Calloc(vectors * size + 3 * size * size + 1, sizeof(double));
    if (self->constants == NULL || self->bodies == NULL || self->driven == NULL || self->block == NULL) {
        PyErr_NoMemory();
        return -1;
    }
    double **places[] = {&self->q,    &self->dq,    &self->tau,       &self->prescribed, &self->bias,     &self->bias0,   &self->w,        &self->x,
                         &self->loss, &self->slope, &self->predicted, &self->engine,     &self->friction, &self->velocity, &self->inertia};
    for (size_t k = 0; k < vectors; k++)
        *places[k] = self->block + k * size;
    self->M = self->block + vectors * size;
    self->A = self->M + size * size;
    self->gain = self->A + size * size;
    return take_rows(self, rows);
}

static void dynamics_free(Dynamics *self)
{
    PyMem_Free(self->constants);
    PyMem_Free(self->bodies);
    PyMem_Free(self->driven);
    PyMem_Free(self->block);
    Py_TYPE(self)->tp_free((PyObject *)self);
}

#define FAST(function) (PyCFunction)(void (*)(void))function, METH_FASTCALL

static PyMethodDef methods[] = {
    {"torque", FAST(dynamics_torque), "(q, dq, tau, external or None, prescribed or None) -> efforts for the engine"},
    {"forget", (PyCFunction)dynamics_forget, METH_NOARGS, "the state was set from outside"},
    {"rotor_efforts", (PyCFunction)dynamics_rotor_efforts, METH_O, "(dq at the end of the step) -> what the rotors took up in it"},
    {"mass_matrix", (PyCFunction)dynamics_mass_matrix, METH_O, "(q) -> M of the links, row-major"},
    {"bias", FAST(dynamics_bias), "(q, dq) -> h"},
    {0}};

static PyTypeObject type = {
    PyVarObject_HEAD_INIT(NULL, 0).tp_name = "hric_joint_dynamics.Dynamics",
    .tp_basicsize = sizeof(Dynamics),
    .tp_flags = Py_TPFLAGS_DEFAULT,
    .tp_new = PyType_GenericNew,
    .tp_init = (initproc)dynamics_init,
    .tp_dealloc = (destructor)dynamics_free,
    .tp_methods = methods,
};

static struct PyModuleDef definition = {PyModuleDef_HEAD_INIT, "hric_joint_dynamics", NULL, -1, NULL, NULL, NULL, NULL, NULL};

__attribute__((visibility("default"))) PyObject *PyInit_hric_joint_dynamics(void)
{
    PyObject *module = PyType_Ready(&type) < 0 ? NULL : PyModule_Create(&definition);
    if (module != NULL && PyModule_AddObjectRef(module, "Dynamics", (PyObject *)&type) < 0)
        Py_CLEAR(module);
    return module;
}

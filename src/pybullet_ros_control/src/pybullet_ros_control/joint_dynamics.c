/* Compiled part of joint_dynamics.py, which explains the equations: forward dynamics of one robot, on Python lists. */
#include "hric_core/quaternions.h"
#include "hric_dynamics/factors.h"
#include "hric_dynamics/friction.h"
#include "hric_dynamics/tree.h"

#define LOCKED 1e9      /* added to the inertia of a joint whose acceleration is prescribed [kg m^2] */
#define NOTICEABLE 1e-9 /* smaller differences between predicted and engine velocity are rounding errors [rad/s] */
#define NEGLIGIBLE 1e-7 /* smaller efforts that the engine adds are set to zero if velocities agree [N m] */
#define FRICTION_SWEEPS 50
#define FRICTION_TOLERANCE 1e-12 /* relative change of the friction at which its iteration ends */

typedef struct {
    /* constants of a joint, in the order of a row from Python */
    Link link;
    double rotor, coulomb, damping, sigmoid[FRICTION_ROW], bristle[BRISTLE_ROW];
    double leader, multiplier; /* mimic joint: index of the joint that it follows, and ratio; other joints: leader -1 */
} Constants;

enum { ROW = sizeof(Constants) / sizeof(double) };

typedef struct {
    PyObject_HEAD
    int n;
    double dt, gravity[3];
    double half,
        quiet; /* lead of engine positions over velocities [s]; speed that no joint reaches unless it diverges */
    int passes, predicting, adding, sticking, lossy, coupled;
    Constants *constants;
    Tree tree;
    double *block;
    /* n numbers each */
    double *q, *dq, *tau, *external, *prescribed, *bias, *bias0, *w;
    double *x, *loss, *slope, *predicted, *engine, *friction, *velocity, *inertia, *keep;
    double *bend, *grip; /* deflection of the friction bristles, and their effort per speed at the end of the step */
    int *driven, *leader;
    /* n x n numbers each */
    double *M, *A, *gain;
} Dynamics;

/* -- the equations ------------------------------------------------------------------------------------------------- */

/* Laws of joints that mimic others: x_i = m x_leader. With x = J z, A x = b becomes J'A J z = J'b; joints that mimic
 * keep an equation of their own, z_i = 0. */
static void fold_matrix(const Dynamics *self, double *A)
{
    const int n = self->n;
    for (int i = 0; i < n; i++) {
        const int leader = self->leader[i];
        if (leader < 0)
            continue;
        const double m = self->constants[i].multiplier;
        for (int k = 0; k < n; k++)
            A[leader * n + k] += m * A[i * n + k];
        for (int k = 0; k < n; k++)
            A[k * n + leader] += m * A[k * n + i];
        for (int k = 0; k < n; k++)
            A[i * n + k] = A[k * n + i] = 0.0;
        A[i * n + i] = 1.0;
    }
}

/* Solve A x = b on the mimic laws, apart from the efforts that keep joints on these laws. x: b on entry, solution on
 * return; A: from fold_matrix, factored. */
static void solve_on_laws(const Dynamics *self, const double *A, double *x)
{
    const int n = self->n;
    for (int i = 0; self->coupled && i < n; i++)
        if (self->leader[i] >= 0) {
            x[self->leader[i]] += self->constants[i].multiplier * x[i];
            x[i] = 0.0;
        }
    solve(n, A, x);
    for (int i = 0; self->coupled && i < n; i++)
        if (self->leader[i] >= 0)
            x[i] = self->constants[i].multiplier * x[self->leader[i]];
}

/* Efforts of damping and sigmoid friction at velocity u, and their derivatives by velocity. */
static void losses(Dynamics *self, const double *u)
{
    for (int i = 0; i < self->n; i++) {
        const Constants *c = &self->constants[i];
        self->loss[i] = c->damping * u[i];
        self->slope[i] = c->damping;
        if (c->sigmoid[0] != 0.0) {
            double t = tanh(c->sigmoid[FRICTION_SLOPE] * (u[i] + c->sigmoid[FRICTION_OFFSET]));
            self->loss[i] += c->sigmoid[FRICTION_SIZE] * (t - c->sigmoid[FRICTION_REST]);
            self->slope[i] += c->sigmoid[FRICTION_SIZE] * c->sigmoid[FRICTION_SLOPE] * (1.0 - t * t);
        }
    }
}

/* Add the efforts of the friction bristles, without the part that is proportional to the acceleration x of this pass;
   that part goes into self->grip. The velocity at the end of the step is the one of the previous pass. */
static void grip(Dynamics *self, int first)
{
    for (int i = 0; i < self->n; i++) {
        const Constants *c = &self->constants[i];
        self->grip[i] = 0.0;
        if (c->bristle[BRISTLE_BREAKAWAY] == 0.0 || self->driven[i])
            continue;
        const double end = self->dq[i] + (first ? 0.0 : self->dt * self->x[i]);
        self->loss[i] += bristle(c->bristle, self->dt, self->bend[i], end, &self->grip[i]);
        self->loss[i] += self->grip[i] * self->dq[i];
        self->grip[i] *= self->dt;
    }
}

/* Coulomb friction f with |f_i| <= F_i that brings v + dt x to zero, or as near to it as possible (projected
 * Gauss-Seidel); its effect is added to x. */
static void stick(Dynamics *self)
{
    const int n = self->n;
    double largest = 0.0, *f = self->friction, *end = self->w;
    for (int i = 0; i < n; i++) {
        double *column = self->gain + i * n;
        memset(column, 0, sizeof(double) * (size_t)n);
        column[i] = self->dt;
        solve_on_laws(self, self->A, column);
        end[i] = self->dq[i] + self->dt * self->x[i];
        largest = fmax(largest, self->constants[i].coulomb);
    }
    for (int i = 0; i < n; i++) {
        double F = self->driven[i] ? 0.0 : self->constants[i].coulomb;
        f[i] = fmin(fmax(f[i], -F), F);
        for (int k = 0; k < n; k++)
            end[k] += self->gain[i * n + k] * f[i];
    }
    for (int sweep = 0; sweep < FRICTION_SWEEPS; sweep++) {
        double change = 0.0;
        for (int i = 0; i < n; i++) {
            double F = self->driven[i] ? 0.0 : self->constants[i].coulomb;
            if (self->gain[i * n + i] <= 0.0)
                continue; /* a mimic joint that its law keeps at rest */
            double new = fmin(fmax(f[i] - end[i] / self->gain[i * n + i], -F), F);
            for (int k = 0; k < n; k++)
                end[k] += (new - f[i]) * self->gain[i * n + k];
            change = fmax(change, fabs(new - f[i]));
            f[i] = new;
        }
        if (change <= FRICTION_TOLERANCE * largest)
            break;
    }
    for (int i = 0; i < n; i++)
        self->x[i] = (end[i] - self->dq[i]) / self->dt;
}

/* Update the efforts that the engine itself added in the last step (contact, stops), from the difference between its
 * final velocity and the predicted one. */
static void update_engine_effort(Dynamics *self)
{
    const int n = self->n;
    double square = 0.0;
    for (int i = 0; i < n; i++)
        square += (self->dq[i] - self->predicted[i]) * (self->dq[i] - self->predicted[i]);
    int quiet = square < NOTICEABLE * NOTICEABLE, gone = quiet;
    if (quiet && !self->adding)
        return;
    for (int i = 0; i < n; i++) {
        double effort = self->adding ? self->engine[i] : 0.0;
        for (int k = 0; k < n; k++)
            effort += self->M[i * n + k] * (self->dq[k] - self->predicted[k]) / self->dt;
        self->engine[i] = self->driven[i] ? 0.0 : effort; /* at a driven joint it is the effort of the motor */
        gone = gone && fabs(self->engine[i]) < NEGLIGIBLE;
    }
    self->adding = !gone;
}

/* Efforts that keep mimic joints on their laws: those of the mimic joints and the reactions on the joints that they
 * follow. self->keep: all other efforts on entry, result on return. */
static void find_keep(Dynamics *self, double lean)
{
    const int n = self->n;
    double *keep = self->keep;
    for (int i = 0; i < n; i++) {
        if (self->leader[i] < 0)
            continue;
        keep[i] = (self->inertia[i] + lean * self->slope[i] + self->grip[i]) * self->x[i] - keep[i];
        for (int k = 0; k < n; k++)
            keep[i] += self->M[i * n + k] * self->x[k];
        if (self->sticking)
            keep[i] -= self->friction[i];
    }
    for (int i = 0; i < n; i++)
        if (self->leader[i] < 0)
            keep[i] = 0.0;
    for (int i = 0; i < n; i++)
        if (self->leader[i] >= 0)
            keep[self->leader[i]] -= self->constants[i].multiplier * keep[i];
}

/* One pass: acceleration x with bias, damping and friction at velocity self->w, which is v in the first pass and
 * v + dt/2 x in the following ones. */
static void accelerate(Dynamics *self, int first)
{
    const int n = self->n;
    double half = first ? 0.0 : 0.5 * self->dt;
    double lean = self->passes > 0 ? 0.5 * self->dt : 0.0; /* losses follow the velocity in the middle of the step */
    int fresh = first || self->lossy; /* without damping and friction all passes have the same matrix */
    tree_efforts(&self->tree, self->gravity, self->w, NULL, self->bias);
    if (self->lossy) {
        losses(self, self->w);
        grip(self, first);
    } else
        memset(self->loss, 0, sizeof(double) * (size_t)n);
    if (fresh)
        memcpy(self->A, self->M, sizeof(double) * (size_t)(n * n));
    for (int i = 0; i < n; i++) {
        if (fresh)
            self->A[i * n + i] += self->inertia[i] + lean * self->slope[i] + self->grip[i];
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
    memcpy(self->keep, self->x, sizeof(double) * (size_t)n);
    if (fresh && self->coupled)
        fold_matrix(self, self->A);
    if (fresh)
        factor(n, self->A);
    solve_on_laws(self, self->A, self->x);
    if (self->sticking)
        stick(self);
    if (self->coupled)
        find_keep(self, lean);
    for (int i = 0; i < n; i++)
        self->loss[i] += (lean * self->slope[i] + self->grip[i]) * self->x[i];
}

/* -- Python -------------------------------------------------------------------------------------------------------- */

static int take_prescribed(Dynamics *self, PyObject *sequence)
{
    PyObject *fast = PySequence_Fast(sequence, "a sequence of numbers or None is needed");
    if (fast == NULL)
        return -1;
    int failed = PySequence_Fast_GET_SIZE(fast) != self->n;
    if (failed)
        PyErr_Format(PyExc_ValueError, "%d values are needed, got %zd", self->n, PySequence_Fast_GET_SIZE(fast));
    for (int i = 0; !failed && i < self->n; i++) {
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
    const int n = self->n;
    double external[n > 0 ? n : 1];
    if (!expect(count, 5, "torque(q, dq, tau, external, prescribed)"))
        return NULL;
    if (!take(given[0], n, self->q) || !take(given[1], n, self->dq) || !take(given[2], n, self->tau))
        return NULL;
    self->external = given[3] == Py_None ? NULL : external;
    if (self->external != NULL && !take(given[3], n, external))
        return NULL;
    if (self->predicting)
        update_engine_effort(self);
    for (int i = 0; i < n; i++) {
        if (self->predicting && self->constants[i].bristle[BRISTLE_BREAKAWAY] != 0.0)
            self->bend[i] = bristle_bent(self->constants[i].bristle, self->dt, self->bend[i], self->dq[i]);
        self->inertia[i] = self->constants[i].rotor;
        self->driven[i] = 0;
        self->w[i] = self->dq[i];
    }
    if (given[4] != Py_None && take_prescribed(self, given[4]) < 0)
        return NULL;
    place_tree(&self->tree, self->q);
    tree_mass_matrix(&self->tree, self->M);
    accelerate(self, 1);
    memcpy(self->bias0, self->bias, sizeof(double) * (size_t)n);
    for (int pass = 0; pass < self->passes; pass++) {
        for (int i = 0; i < n; i++)
            self->w[i] = self->dq[i] + 0.5 * self->dt * self->x[i];
        accelerate(self, 0);
    }
    double effort[n > 0 ? n : 1];
    for (int i = 0; i < n; i++) {
        self->velocity[i] = self->dq[i];
        self->predicted[i] = self->dq[i] + self->dt * self->x[i];
        effort[i] =
            self->tau[i] - self->constants[i].rotor * self->x[i] - self->loss[i] + (self->bias0[i] - self->bias[i]);
        if (self->sticking)
            effort[i] += self->friction[i];
        if (self->driven[i])
            effort[i] = 0.0; /* the engine's motor supplies it */
        if (self->coupled)
            effort[i] += self->keep[i];
    }
    self->predicting = 1;
    self->external = NULL;
    return list(effort, n);
}

static PyObject *dynamics_forget(Dynamics *self, PyObject *Py_UNUSED(none))
{
    self->predicting = self->adding = 0;
    memset(self->friction, 0, sizeof(double) * (size_t)self->n);
    memset(self->bend, 0, sizeof(double) * (size_t)self->n);
    memset(self->driven, 0, sizeof(int) * (size_t)self->n);
    Py_RETURN_NONE;
}

/* Read positions and velocities from the result of PyBullet's getJointStates. */
static int take_states(Dynamics *self, PyObject *states, double *q, double *dq)
{
    if (!PyTuple_Check(states) || PyTuple_GET_SIZE(states) != self->n) {
        PyErr_Format(PyExc_ValueError, "a tuple of %d joint states is needed", self->n);
        return 0;
    }
    for (int i = 0; i < self->n; i++) {
        PyObject *state = PyTuple_GET_ITEM(states, i);
        if (!PyTuple_Check(state) || PyTuple_GET_SIZE(state) < 2) {
            PyErr_SetString(PyExc_ValueError, "a joint state is a tuple that begins with position and velocity");
            return 0;
        }
        q[i] = PyFloat_AsDouble(PyTuple_GET_ITEM(state, 0));
        dq[i] = PyFloat_AsDouble(PyTuple_GET_ITEM(state, 1));
    }
    return PyErr_Occurred() == NULL;
}

static double rotor_effort(const Dynamics *self, int i, double dq)
{
    return self->predicting ? self->constants[i].rotor * (dq - self->velocity[i]) / self->dt : 0.0;
}

static PyObject *dynamics_read(Dynamics *self, PyObject *const *given, Py_ssize_t count)
{
    const int n = self->n;
    double q[n > 0 ? n : 1], dq[n > 0 ? n : 1], at[n > 0 ? n : 1], effort[n > 0 ? n : 1];
    double distance = 0.0, speed = 0.0;
    if (!expect(count, 2, "read(states, tau)") || !take_states(self, given[0], q, dq) || !take(given[1], n, effort))
        return NULL;
    for (int i = 0; i < n; i++) {
        at[i] = q[i] - self->half * dq[i];
        effort[i] -= rotor_effort(self, i, dq[i]);
        distance += q[i] * q[i];
        speed += dq[i] * dq[i];
    }
    const int quiet = isfinite(distance) && speed <= self->quiet * self->quiet;
    return Py_BuildValue("NNNNO", list(q, n), list(dq, n), list(at, n), list(effort, n), quiet ? Py_True : Py_False);
}

static PyObject *dynamics_rotor_efforts(Dynamics *self, PyObject *dq)
{
    const int n = self->n;
    double effort[n > 0 ? n : 1];
    if (!take(dq, n, effort))
        return NULL;
    for (int i = 0; i < n; i++)
        effort[i] = rotor_effort(self, i, effort[i]);
    return list(effort, n);
}

static PyObject *dynamics_mass_matrix(Dynamics *self, PyObject *q)
{
    const int n = self->n;
    double M[n > 0 ? n * n : 1];
    if (!take(q, n, self->q))
        return NULL;
    place_tree(&self->tree, self->q);
    tree_mass_matrix(&self->tree, M);
    return list(M, (Py_ssize_t)n * n);
}

static PyObject *dynamics_mobility(Dynamics *self, PyObject *q)
{
    const int n = self->n;
    /* M is local, since self->M must keep the matrix of the last step. */
    double M[n > 0 ? n * n : 1], inverse[n > 0 ? n * n : 1];
    if (!take(q, n, self->q))
        return NULL;
    place_tree(&self->tree, self->q);
    tree_mass_matrix(&self->tree, M);
    if (self->coupled)
        fold_matrix(self, M);
    factor(n, M);
    memset(inverse, 0, sizeof inverse);
    for (int i = 0; i < n; i++) {
        inverse[i * n + i] = 1.0;
        solve_on_laws(self, M, inverse + i * n);
    }
    return list(inverse, (Py_ssize_t)n * n);
}

/* Index of a joint, or -1 for the base; -2 with a Python error set. */
static int take_joint(const Dynamics *self, PyObject *given)
{
    const long joint = PyLong_AsLong(given);
    if (joint == -1 && PyErr_Occurred() != NULL)
        return -2;
    if (joint >= -1 && joint < self->n)
        return (int)joint;
    PyErr_Format(PyExc_ValueError, "a joint from -1 to %d is needed, got %ld", self->n - 1, joint);
    return -2;
}

static PyObject *dynamics_motion(Dynamics *self, PyObject *const *given, Py_ssize_t count)
{
    double dq[self->n > 0 ? self->n : 1], o[4];
    Pose frame, link;
    Spatial v = {{0}, {0}};
    if (!expect(count, 4, "motion(q, dq, joint, frame)") || !take(given[0], self->n, self->q)
        || !take(given[1], self->n, dq) || !take(given[3], sizeof frame / sizeof(double), (double *)&frame))
        return NULL;
    const int joint = take_joint(self, given[2]);
    if (joint < -1)
        return NULL;
    place_joints(&self->tree, self->q, joint + 1);
    link = frame;
    if (joint >= 0)
        compose(&self->tree.poses[joint], frame.R, frame.p, &link);
    for (int i = joint; i >= 0; i = self->tree.parent[i])
        for (int k = 0; k < 3; k++) {
            v.w[k] += self->tree.S[i].w[k] * dq[i];
            v.v[k] += self->tree.S[i].v[k] * dq[i];
        }
    add_cross(v.w, link.p, v.v); /* from the velocity at the world's origin to that at the frame's origin */
    from_elements(link.R, o);
    return Py_BuildValue("(ddd)(dddd)(ddd)(ddd)", link.p[0], link.p[1], link.p[2], o[0], o[1], o[2], o[3], v.v[0],
                         v.v[1], v.v[2], v.w[0], v.w[1], v.w[2]);
}

static PyObject *dynamics_efforts(Dynamics *self, PyObject *const *given, Py_ssize_t count)
{
    const int n = self->n;
    double point[3], efforts[n > 0 ? n : 1];
    Spatial force;
    if (!expect(count, 5, "efforts(q, joint, force, torque, point)") || !take(given[0], n, self->q)
        || !take(given[2], 3, force.v) || !take(given[3], 3, force.w) || !take(given[4], 3, point))
        return NULL;
    const int joint = take_joint(self, given[1]);
    if (joint < -1)
        return NULL;
    place_joints(&self->tree, self->q, joint + 1);
    add_cross(point, force.v, force.w);
    memset(efforts, 0, sizeof efforts);
    for (int i = joint; i >= 0; i = self->tree.parent[i])
        efforts[i] = power(&self->tree.S[i], &force);
    return list(efforts, n);
}

static int take_rows(Dynamics *self, PyObject *rows)
{
    for (int i = 0; i < self->n; i++) {
        PyObject *row = PySequence_GetItem(rows, i);
        int failed = row == NULL || !take(row, ROW, (double *)&self->constants[i]);
        Py_XDECREF(row);
        if (failed)
            return -1;
        if (!set_link(&self->tree, i, &self->constants[i].link))
            return -1;
        if (!(self->constants[i].leader < (double)self->n)) {
            PyErr_Format(PyExc_ValueError, "mimic joint %d follows a joint that is not among the %d", i, self->n);
            return -1;
        }
        self->leader[i] = self->constants[i].leader < 0.0 ? -1 : (int)self->constants[i].leader;
        self->coupled = self->coupled || self->leader[i] >= 0;
        self->sticking = self->sticking || self->constants[i].coulomb > 0.0;
        self->lossy = self->lossy || self->constants[i].damping != 0.0
                      || self->constants[i].sigmoid[FRICTION_SIZE] != 0.0
                      || self->constants[i].bristle[BRISTLE_BREAKAWAY] != 0.0;
    }
    return 0;
}

static int dynamics_init(Dynamics *self, PyObject *args)
{
    PyObject *gravity, *rows;
    if (!PyArg_ParseTuple(args, "diddOO", &self->dt, &self->passes, &self->half, &self->quiet, &gravity, &rows)
        || !take(gravity, 3, self->gravity))
        return -1;
    const Py_ssize_t count = PySequence_Size(rows);
    if (count < 0)
        return -1;
    self->n = (int)count;
    const size_t vectors = 18, size = (size_t)count;
    self->constants = zeroed(size, sizeof(Constants));
    self->driven = zeroed(2 * size, sizeof(int));
    self->block = zeroed(vectors * size + 3 * size * size, sizeof(double));
    if (!make_tree(&self->tree, self->n))
        return -1;
    self->leader = self->driven + size;
    double **places[] = {&self->q,         &self->dq,     &self->tau,      &self->prescribed, &self->bias,
                         &self->bias0,     &self->w,      &self->x,        &self->loss,       &self->slope,
                         &self->predicted, &self->engine, &self->friction, &self->velocity,   &self->inertia,
                         &self->keep,      &self->bend,   &self->grip};
    for (size_t k = 0; k < vectors; k++)
        *places[k] = self->block + k * size;
    self->M = self->block + vectors * size;
    self->A = self->M + size * size;
    self->gain = self->A + size * size;
    return take_rows(self, rows);
}

static void dynamics_clear(Dynamics *self)
{
    clear_tree(&self->tree);
    PyMem_Free(self->constants);
    PyMem_Free(self->driven);
    PyMem_Free(self->block);
}

static PyMethodDef dynamics_methods[] = {
    {"torque", FAST(dynamics_torque), "(q, dq, tau, external or None, prescribed or None) -> efforts for the engine"},
    {"read", FAST(dynamics_read),
     "(states of getJointStates, tau) -> q, dq, q at the measuring instant, link-side tau, True if all is finite and "
     "slow"},
    {"forget", (PyCFunction)dynamics_forget, METH_NOARGS, "clear the memory of the previous step"},
    {"rotor_efforts", (PyCFunction)dynamics_rotor_efforts, METH_O,
     "(dq at the end of the step) -> efforts that accelerated the rotors in it"},
    {"mass_matrix", (PyCFunction)dynamics_mass_matrix, METH_O, "(q) -> mass matrix of the links, row-major"},
    {"mobility", (PyCFunction)dynamics_mobility, METH_O, "(q) -> inverse mass matrix of the links, row-major"},
    {"motion", FAST(dynamics_motion),
     "(q, dq, joint, frame) -> position, quaternion, linear, angular velocity of a frame on the link behind a joint"},
    {"efforts", FAST(dynamics_efforts),
     "(q, joint, force, torque, point) -> joint efforts of a force and torque on the link behind a joint"},
    {0}};

TYPE_MODULE(hric_joint_dynamics, Dynamics, dynamics, NULL)

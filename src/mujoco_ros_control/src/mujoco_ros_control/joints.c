/* Compiled part of joints.py: one step of MuJoCo with the joint state as Python lists, and the friction identified on
   the Panda and mimic joints within each stage of the step. MuJoCo's headers are used for the layout of its structures
   only; the addresses of its functions come from Python. */
#include "hric_core/python_numbers.h"
#include "hric_dynamics/friction.h"

#include "clearance.h"
#include "mimic.h"

/* Indices of MuJoCo's functions, in the order in which make_joints passes them. */
enum { POSITION, VELOCITY, ACTUATION, ACCELERATION, CONSTRAINT, IMPLICIT, RUNGE_KUTTA, LOADS, MASS, MOVE, FUNCTIONS };

/* Address of a MuJoCo function, as ctypes passes it, with the signatures that are needed. */
typedef union {
    mjfGeneric plain;
    void (*of_order)(const mjModel *, mjData *, int);
    void (*of_matrix)(const mjModel *, const mjData *, mjtNum *);
    void (*of_positions)(const mjModel *, mjtNum *, const mjtNum *, mjtNum);
    void *data;
} Address;

static Address mujoco[FUNCTIONS]; /* shared by all objects of this module */

typedef struct {
    PyObject_HEAD
    mjModel *model;
    mjData *data;
    PyObject *owners; /* Python objects that own the model and the data */
    int n, *dof, *position;
    double half, quiet, held; /* lead of positions [s], speed bound, rotor inertia of held joints; see make_joints */
    int bristly;
    double *rotor, *effort, *before, *q, *dq, *bend, *hold, *bristle;
    Clearance clearance;
} Joints;

/* ---- friction ---- */

/* MuJoCo's callback mjcb_passive, one for all models of the process; the friction parameters of a joint are in its user
   data. */
static void add_friction(const mjModel *m, mjData *d)
{
    if (m->nuser_jnt < FRICTION_ROW)
        return;
    for (int joint = 0; joint < m->njnt; joint++) {
        const mjtNum *row = m->jnt_user + (size_t)joint * (size_t)m->nuser_jnt;
        const int dof = m->jnt_dofadr[joint];
        if (row[FRICTION_SIZE] != 0.0)
            d->qfrc_passive[dof] -= friction(row, d->qvel[dof]);
    }
}

static PyObject *friction_address(PyObject *Py_UNUSED(module), PyObject *Py_UNUSED(nothing))
{
    return PyLong_FromVoidPtr(((Address){.plain = add_friction}).data);
}

/* ---- joints that mimic others ---- */

/* Factors of the mass matrix plus step * damping, as the implicit integrator has it; step 0: without damping. */
static void factor_masses(const mjModel *m, const mjData *d, double step, double *A)
{
    mujoco[MASS].of_matrix(m, d, A);
    for (int k = 0; k < m->nv; k++)
        A[k * m->nv + k] += step * m->dof_damping[k];
    factor(m->nv, A);
}

/* MuJoCo's callback mjcb_control, one for all models of the process. MuJoCo calls it in each stage of a step before it
   computes accelerations; it adds the efforts that keep mimic joints on their laws. */
static void keep_laws(const mjModel *m, mjData *d)
{
    Law laws[m->neq > 0 ? m->neq : 1];
    const int count = take_laws(m, laws), n = m->nv;
    if (count == 0)
        return;
    double A[n * n], acceleration[n];
    mujoco[ACTUATION].plain(m, d);
    mujoco[ACCELERATION].plain(m, d);
    memcpy(acceleration, d->qacc_smooth, sizeof acceleration);
    factor_masses(m, d, 0.0, A);
    constrain(m, count, laws, A, acceleration, d->qfrc_passive);
}

static PyObject *laws_address(PyObject *Py_UNUSED(module), PyObject *Py_UNUSED(nothing))
{
    return PyLong_FromVoidPtr(((Address){.plain = keep_laws}).data);
}

static void settle_laws(const mjModel *m, mjData *d)
{
    Law laws[m->neq > 0 ? m->neq : 1];
    const int count = take_laws(m, laws), explicit = m->opt.integrator == mjINT_RK4;
    if (count == 0)
        return;
    double A[m->nv * m->nv];
    const double step = m->opt.timestep;
    factor_masses(m, d, explicit ? 0.0 : step, A);
    settle(m, d, count, laws, A, explicit ? 0.5 * step : step, mujoco[MOVE].of_positions);
}

/* Friction at rest (bristle model) in the coming step: a constant effort, plus a part proportional to the speed at the
   end of the step, which is added as inertia. Braked and driven joints are left out. */
static void grip(Joints *self)
{
    const double step = self->model->opt.timestep;
    for (int i = 0; self->bristly && i < self->n; i++) {
        const double *row = self->bristle + i * BRISTLE_ROW, speed = self->data->qvel[self->dof[i]];
        mjtNum *inertia = self->model->dof_armature + self->dof[i];
        double slope;
        self->hold[i] = 0.0;
        if (row[BRISTLE_BREAKAWAY] == 0.0 || *inertia >= self->held)
            continue;
        self->hold[i] = bristle(row, step, self->bend[i], speed, &slope);
        self->hold[i] += slope * speed;
        *inertia = self->rotor[i] + step * slope;
    }
}

static void bend(Joints *self)
{
    for (int i = 0; self->bristly && i < self->n; i++) {
        const double *row = self->bristle + i * BRISTLE_ROW;
        if (row[BRISTLE_BREAKAWAY] != 0.0)
            self->bend[i] = bristle_bent(row, self->model->opt.timestep, self->bend[i], self->data->qvel[self->dof[i]]);
    }
}

/* ---- a step ---- */

static void gather(const double *from, const int *at, int n, double *to)
{
    for (int i = 0; i < n; i++)
        to[i] = from[at[i]];
}

/* Positions at the measuring instant, to which the velocities belong; the engine's own if they belong to it already. */
static PyObject *measured(const Joints *self, PyObject *q)
{
    double at[self->n > 0 ? self->n : 1];
    if (self->half == 0.0)
        return Py_XNewRef(q);
    for (int i = 0; i < self->n; i++)
        at[i] = self->q[i] - self->half * self->dq[i];
    return list(at, self->n);
}

static PyObject *joints_read(Joints *self, PyObject *Py_UNUSED(nothing))
{
    gather(self->data->qpos, self->position, self->n, self->q);
    gather(self->data->qvel, self->dof, self->n, self->dq);
    PyObject *q = list(self->q, self->n);
    return Py_BuildValue("NNN", q, list(self->dq, self->n), measured(self, q));
}

/* Set positions that are given at the measuring instant; the engine's positions are ahead of it by `half`. */
static PyObject *joints_put(Joints *self, PyObject *args)
{
    PyObject *q, *dq;
    if (!PyArg_ParseTuple(args, "OO", &q, &dq) || !take(q, self->n, self->q) || !take(dq, self->n, self->dq))
        return NULL;
    for (int i = 0; i < self->n; i++) {
        self->data->qpos[self->position[i]] = self->q[i] + self->half * self->dq[i];
        self->data->qvel[self->dof[i]] = self->dq[i];
        self->bend[i] = 0.0;
    }
    Py_RETURN_NONE;
}

/* Apply the efforts of the motors in the coming step. */
static void apply(Joints *self)
{
    for (int i = 0; i < self->n; i++)
        self->data->qfrc_applied[self->dof[i]] = self->effort[i] - self->hold[i];
    gather(self->data->qvel, self->dof, self->n, self->before);
}

static PyObject *joints_write(Joints *self, PyObject *efforts)
{
    if (!take(efforts, self->n, self->effort))
        return NULL;
    apply(self);
    Py_RETURN_NONE;
}

static PyObject *joints_write_within(Joints *self, PyObject *const *given, Py_ssize_t count)
{
    double low[self->n > 0 ? self->n : 1], high[self->n > 0 ? self->n : 1];
    if (!expect(count, 3, "write_within(efforts, low, high)") || !take(given[1], self->n, low)
        || !take(given[2], self->n, high))
        return NULL;
    for (int i = 0; i < self->n; i++) {
        const double q = self->data->qpos[self->position[i]];
        if (!(low[i] <= q && q <= high[i]))
            Py_RETURN_FALSE;
    }
    if (!take(given[0], self->n, self->effort))
        return NULL;
    apply(self);
    Py_RETURN_TRUE;
}

/* Efforts on the link side of the rotors: motor efforts less those that accelerated the rotors since `write`. */
static PyObject *joints_passed(Joints *self, PyObject *motors)
{
    if (!take(motors, self->n, self->effort))
        return NULL;
    const double rate = 1.0 / self->model->opt.timestep;
    bend(self);
    for (int i = 0; i < self->n; i++)
        self->effort[i] -= self->rotor[i] * (rate * (self->data->qvel[self->dof[i]] - self->before[i]));
    return list(self->effort, self->n);
}

/* 1 if the state is finite and no joint is faster than the bound. Checked by norms, which NaN and infinity spoil. */
static int is_quiet(const Joints *self)
{
    double q = 0.0, dq = 0.0;
    for (int i = 0; i < self->n; i++) {
        q += self->q[i] * self->q[i];
        dq += self->dq[i] * self->dq[i];
    }
    return isfinite(q) && dq <= self->quiet * self->quiet;
}

static void call(const Joints *self, int function) { mujoco[function].plain(self->model, self->data); }

/* Switch MuJoCo's search for contacts off or on; return the flags before. */
static int search(const Joints *self, int off)
{
    const int flags = self->model->opt.disableflags;
    self->model->opt.disableflags = off ? flags | mjDSBL_CONTACT : flags;
    return flags;
}

/* First part of mj_step: positions and velocities of all bodies. Afterwards forces may be applied to the bodies. */
static void prepare(Joints *self)
{
    grip(self);
    const int clear = begins_clear(&self->clearance, self->model, self->data), flags = search(self, clear);
    call(self, POSITION);
    call(self, VELOCITY);
    self->model->opt.disableflags = flags;
    if (!clear)
        renew_clearance(&self->clearance, self->model, self->data);
}

static PyObject *joints_prepare(Joints *self, PyObject *Py_UNUSED(nothing))
{
    PyThreadState *interpreter = PyEval_SaveThread();
    prepare(self);
    PyEval_RestoreThread(interpreter);
    Py_RETURN_NONE;
}

/* Second part of mj_step: accelerations from all forces. */
static void accelerate(const Joints *self)
{
    keep_laws(self->model, self->data);
    call(self, ACTUATION);
    call(self, ACCELERATION);
    call(self, CONSTRAINT);
}

static PyObject *joints_accelerate(Joints *self, PyObject *Py_UNUSED(nothing))
{
    accelerate(self);
    Py_RETURN_NONE;
}

static void integrate(Joints *self)
{
    if (self->model->opt.integrator == mjINT_RK4) {
        const int flags = search(self, clear_ahead(&self->clearance));
        mujoco[RUNGE_KUTTA].of_order(self->model, self->data, 4);
        self->model->opt.disableflags = flags;
    } else {
        call(self, IMPLICIT);
    }
    settle_laws(self->model, self->data);
    end_clearance(&self->clearance, self->model, self->data);
}

static PyObject *joints_integrate(Joints *self, PyObject *Py_UNUSED(nothing))
{
    integrate(self);
    Py_RETURN_NONE;
}

static PyObject *joints_finish(Joints *self, PyObject *const *given, Py_ssize_t count)
{
    if (!expect(count, 2, "finish(efforts, prepared)") || !take(given[0], self->n, self->effort))
        return NULL;
    const int prepared = given[1] == Py_True;
    PyThreadState *interpreter = PyEval_SaveThread();
    if (!prepared)
        prepare(self);
    apply(self);
    accelerate(self);
    integrate(self);
    PyEval_RestoreThread(interpreter);
    gather(self->data->qpos, self->position, self->n, self->q);
    gather(self->data->qvel, self->dof, self->n, self->dq);
    PyObject *q = list(self->q, self->n);
    return Py_BuildValue("NNNNO", q, list(self->dq, self->n), measured(self, q), joints_passed(self, given[0]),
                         is_quiet(self) ? Py_True : Py_False);
}

/* ---- loads ---- */

static PyObject *triple(const mjtNum v[3]) { return Py_BuildValue("ddd", v[0], v[1], v[2]); }

/* Load that the parent exerts on the child through each joint, at the child's origin. With the semi-implicit
   integrator, MuJoCo's derived data belong to the start of the step, and its acceleration lacks the implicit damping;
   so the acceleration is computed from the change of velocity here. */
static void compute_loads(Joints *self)
{
    mjData *d = self->data;
    if (self->model->opt.integrator != mjINT_RK4) {
        for (int i = 0; i < self->n; i++) {
            const int dof = self->dof[i];
            d->qacc[dof] = (d->qvel[dof] - self->before[i]) / self->model->opt.timestep;
            d->qvel[dof] = self->before[i];
        }
    }
    call(self, LOADS);
    for (int i = 0; i < self->n; i++)
        d->qvel[self->dof[i]] = self->dq[i];
}

static PyObject *joints_loads(Joints *self, PyObject *Py_UNUSED(nothing))
{
    PyObject *loads = PyList_New(self->n);
    if (loads == NULL)
        return NULL;
    compute_loads(self);
    for (int i = 0; i < self->n; i++) {
        const int body = self->model->dof_bodyid[self->dof[i]];
        const mjtNum *origin = self->data->xpos + 3 * body;
        const mjtNum *centre = self->data->subtree_com + 3 * self->model->body_rootid[body];
        const mjtNum *wrench = self->data->cfrc_int + 6 * body; /* torque about the mass centre of the tree, force */
        const mjtNum *force = wrench + 3;
        const mjtNum lever[3] = {centre[0] - origin[0], centre[1] - origin[1], centre[2] - origin[2]};
        const mjtNum torque[3] = {wrench[0] + lever[1] * force[2] - lever[2] * force[1],
                                  wrench[1] + lever[2] * force[0] - lever[0] * force[2],
                                  wrench[2] + lever[0] * force[1] - lever[1] * force[0]};
        PyObject *load = Py_BuildValue("NNN", triple(origin), triple(force), triple(torque));
        if (load == NULL) {
            Py_DECREF(loads);
            return NULL;
        }
        PyList_SET_ITEM(loads, i, load);
    }
    return loads;
}

/* ---- the type ---- */

/* Read indices of velocities or positions, which must be below `bound`; 0 with a Python error set. */
static int take_indices(PyObject *sequence, int n, Py_ssize_t bound, int *out)
{
    double values[n > 0 ? n : 1];
    if (!take(sequence, n, values))
        return 0;
    for (int i = 0; i < n; i++) {
        if (!(values[i] >= 0.0 && values[i] < (double)bound)) {
            PyErr_Format(PyExc_ValueError, "entry %d of the indices is not below %zd", i, bound);
            return 0;
        }
        out[i] = (int)values[i];
    }
    return 1;
}

static int joints_init(Joints *self, PyObject *args)
{
    double half, quiet, held;
    PyObject *model, *data, *functions, *dofs, *positions, *rotors, *bristles, *owners;
    if (!PyArg_ParseTuple(args, "OOO!OOOOdddO", &model, &data, &PyTuple_Type, &functions, &dofs, &positions, &rotors,
                          &bristles, &half, &quiet, &held, &owners))
        return -1;
    if (PyTuple_GET_SIZE(functions) != FUNCTIONS) {
        PyErr_Format(PyExc_ValueError, "%d functions are needed", FUNCTIONS);
        return -1;
    }
    const Py_ssize_t count = PySequence_Size(rotors);
    if (count < 0)
        return -1;
    self->model = PyLong_AsVoidPtr(model);
    self->data = PyLong_AsVoidPtr(data);
    for (int i = 0; i < FUNCTIONS; i++)
        mujoco[i].data = PyLong_AsVoidPtr(PyTuple_GET_ITEM(functions, i));
    if (PyErr_Occurred() != NULL)
        return -1;
    self->n = (int)count;
    self->half = half;
    self->quiet = quiet;
    self->held = held;
    self->owners = Py_NewRef(owners);
    self->dof = zeroed(2 * (size_t)count, sizeof(int));
    self->rotor = zeroed((7 + BRISTLE_ROW) * (size_t)count, sizeof(double));
    const size_t nv = (size_t)self->model->nv, nq = (size_t)self->model->nq, bodies = (size_t)self->model->nbody;
    double *levers = zeroed(nv + nq + bodies, sizeof(double));
    if (PyErr_Occurred() != NULL)
        return -1;
    begin_clearance(&self->clearance, self->model, levers, levers + nv, levers + nv + nq);
    self->position = self->dof + count;
    self->effort = self->rotor + count;
    self->before = self->effort + count;
    self->q = self->before + count;
    self->dq = self->q + count;
    self->bend = self->dq + count;
    self->hold = self->bend + count;
    self->bristle = self->hold + count;
    const int taken = take_indices(dofs, self->n, self->model->nv, self->dof)
                      && take_indices(positions, self->n, self->model->nq, self->position)
                      && take(rotors, self->n, self->rotor) && take(bristles, self->n * BRISTLE_ROW, self->bristle);
    for (int i = 0; i < self->n; i++)
        self->bristly = self->bristly || self->bristle[i * BRISTLE_ROW + BRISTLE_BREAKAWAY] != 0.0;
    return taken ? 0 : -1;
}

static void joints_clear(Joints *self)
{
    PyMem_Free(self->dof);
    PyMem_Free(self->rotor);
    PyMem_Free(self->clearance.lever);
    Py_XDECREF(self->owners);
}

static PyMethodDef joints_methods[] = {
    {"read", (PyCFunction)joints_read, METH_NOARGS, "() -> q, dq, q at the measuring instant"},
    {"put", (PyCFunction)joints_put, METH_VARARGS, "(q, dq): set the state at the measuring instant"},
    {"write", (PyCFunction)joints_write, METH_O, "(efforts): set the motor efforts of the coming step"},
    {"write_within", FAST(joints_write_within),
     "(efforts, low, high) -> True if all positions are within these limits; only then the efforts are set"},
    {"passed", (PyCFunction)joints_passed, METH_O, "(motor efforts) -> efforts on the rotors' link side since `write`"},
    {"loads", (PyCFunction)joints_loads, METH_NOARGS, "() -> (origin, force, torque) in each joint, in the last step"},
    {"accelerate", (PyCFunction)joints_accelerate, METH_NOARGS, "(): compute accelerations, after `prepare`"},
    {"integrate", (PyCFunction)joints_integrate, METH_NOARGS, "(): complete the step, after `accelerate`"},
    {"prepare", (PyCFunction)joints_prepare, METH_NOARGS, "(): begin a step, update positions and velocities"},
    {"finish", FAST(joints_finish),
     "(efforts, prepared): make a step, or complete a prepared one -> q, dq, q at the measuring instant, link-side "
     "efforts, True if all is "
     "finite and slow"},
    {0}};

static PyMethodDef functions[] = {
    {"friction_address", friction_address, METH_NOARGS, "() -> address of the friction callback, for mjcb_passive"},
    {"laws_address", laws_address, METH_NOARGS, "() -> address of the callback for mimic joints, for mjcb_control"},
    {0}};

TYPE_MODULE(hric_mujoco, Joints, joints, functions)

/* Inverse dynamics of a tree of links by Newton and Euler, over many instants in one call: what whole_body.py explains.
   All vectors are in axes of the world. */
#include "hric_core/python_numbers.h"

#include <math.h>

enum { NUMBERS = 18 }; /* parent, joint, offset, axis, mass, com, inertia by its upper triangle (see take_link) */
enum { MOTION = 16, LOAD = 9 }; /* of the root: pose (7), omega, alpha, acceleration */

typedef struct {
    int parent, joint; /* -1: the root, and fixed */
    double offset[3], axis[3], mass, com[3], inertia[9];
} Link;

typedef struct {
    double R[9], p[3], a[3], omega[3], alpha[3]; /* of the origin, and of the link */
    double axis[3], f[3], n[3];                  /* of its joint; what the parent does to it, about the origin */
} Moving;

typedef struct {
    PyObject_HEAD
    int links, joints;
    Link *link;
    Moving *moving; /* the root is the last one */
} Tree;

static void times(const double R[9], const double v[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = R[3 * i] * v[0] + R[3 * i + 1] * v[1] + R[3 * i + 2] * v[2];
}

static void times_transposed(const double R[9], const double v[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = R[i] * v[0] + R[3 + i] * v[1] + R[6 + i] * v[2];
}

static void add(const double v[3], double sign, double *sum)
{
    for (int i = 0; i < 3; i++)
        sum[i] += sign * v[i];
}

static void cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static void add_cross(const double a[3], const double b[3], double sign, double *sum)
{
    double c[3];
    cross(a, b, c);
    add(c, sign, sum);
}

/* R = parent's R, turned about an axis of unit length: Rodrigues' formula; a zero axis turns nothing. */
static void turn(const double parent[9], const double axis[3], double angle, double R[9])
{
    const double s = sin(angle), c = 1.0 - cos(angle), x = axis[0], y = axis[1], z = axis[2];
    const double own[9] = {1.0 - c * (y * y + z * z), c * x * y - s * z,         c * x * z + s * y,
                           c * x * y + s * z,         1.0 - c * (x * x + z * z), c * y * z - s * x,
                           c * x * z - s * y,         c * y * z + s * x,         1.0 - c * (x * x + y * y)};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            R[3 * i + j] = parent[3 * i] * own[j] + parent[3 * i + 1] * own[3 + j] + parent[3 * i + 2] * own[6 + j];
}

/* Acceleration of the point at r from the origin: a + alpha x r + omega x (omega x r). */
static void accelerated(const Moving *moving, const double r[3], double out[3])
{
    double speed[3];
    memcpy(out, moving->a, 3 * sizeof(double));
    add_cross(moving->alpha, r, 1.0, out);
    cross(moving->omega, r, speed);
    add_cross(moving->omega, speed, 1.0, out);
}

/* Motion of a link behind its joint. */
static void move(const Link *link, const Moving *parent, double q, double dq, double ddq, Moving *out)
{
    double r[3], rate[3];
    times(parent->R, link->offset, r);
    times(parent->R, link->axis, out->axis);
    turn(parent->R, link->axis, q, out->R);
    for (int i = 0; i < 3; i++) {
        rate[i] = dq * out->axis[i];
        out->p[i] = parent->p[i] + r[i];
        out->omega[i] = parent->omega[i] + rate[i];
        out->alpha[i] = parent->alpha[i] + ddq * out->axis[i];
    }
    add_cross(parent->omega, rate, 1.0, out->alpha);
    accelerated(parent, r, out->a);
}

/* What moves a link alone: m (a - g) at its centre of mass, and the rate of its angular momentum about it. */
static void need(const Link *link, const double gravity[3], Moving *moving)
{
    double c[3], omega[3], alpha[3], momentum[3], rate[3];
    times(moving->R, link->com, c);
    accelerated(moving, c, moving->f);
    add(gravity, -1.0, moving->f);
    for (int i = 0; i < 3; i++)
        moving->f[i] *= link->mass;
    times_transposed(moving->R, moving->omega, omega);
    times_transposed(moving->R, moving->alpha, alpha);
    times(link->inertia, omega, momentum);
    times(link->inertia, alpha, rate);
    add_cross(omega, momentum, 1.0, rate);
    times(moving->R, rate, moving->n);
    add_cross(c, moving->f, 1.0, moving->n);
}

/* A force, torque and point: they act on the link beside its parent. */
static void relieve(const double load[LOAD], Moving *moving)
{
    double r[3] = {load[6], load[7], load[8]};
    add(moving->p, -1.0, r);
    add(load, -1.0, moving->f);
    add(load + 3, -1.0, moving->n);
    add_cross(r, load, -1.0, moving->n);
}

static void solve_instant(Tree *tree, const double *q, const double *dq, const double *ddq, const double gravity[3],
                          const int *loaded, const double *load, int loads, double *torque)
{
    Moving *root = tree->moving + tree->links;
    for (int i = 0; i < tree->links; i++) {
        const Link *link = tree->link + i;
        const Moving *parent = link->parent < 0 ? root : tree->moving + link->parent;
        const int j = link->joint;
        move(link, parent, j < 0 ? 0.0 : q[j], j < 0 ? 0.0 : dq[j], j < 0 ? 0.0 : ddq[j], tree->moving + i);
        need(link, gravity, tree->moving + i);
    }
    for (int i = 0; i < loads; i++)
        relieve(load + i * LOAD, tree->moving + loaded[i]);
    for (int i = tree->links - 1; i >= 0; i--) {
        const Moving *moving = tree->moving + i;
        const int j = tree->link[i].joint, parent = tree->link[i].parent;
        if (j >= 0)
            torque[j] =
                moving->axis[0] * moving->n[0] + moving->axis[1] * moving->n[1] + moving->axis[2] * moving->n[2];
        if (parent >= 0) {
            Moving *before = tree->moving + parent;
            double r[3] = {moving->p[0], moving->p[1], moving->p[2]};
            add(before->p, -1.0, r);
            add(moving->f, 1.0, before->f);
            add(moving->n, 1.0, before->n);
            add_cross(r, moving->f, 1.0, before->n);
        }
    }
}

/* ---- Python ---- */

enum { ROOT, Q, DQ, DDQ, LOADS, TORQUE, FORCE, MOMENT, POSITION, ROTATION, ARRAYS };

static void place_root(Tree *tree, const double motion[MOTION])
{
    Moving *root = tree->moving + tree->links;
    const double x = motion[3], y = motion[4], z = motion[5], w = motion[6];
    const double R[9] = {1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z),       2.0 * (x * z + w * y),
                         2.0 * (x * y + w * z),       1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x),
                         2.0 * (x * z - w * y),       2.0 * (y * z + w * x),       1.0 - 2.0 * (x * x + y * y)};
    memcpy(root->R, R, sizeof R);
    memcpy(root->p, motion, sizeof root->p);
    memcpy(root->omega, motion + 7, sizeof root->omega);
    memcpy(root->alpha, motion + 10, sizeof root->alpha);
    memcpy(root->a, motion + 13, sizeof root->a);
}

static void solve_all(Tree *tree, const double gravity[3], const int *loaded, int loads, int instants,
                      double *const *array)
{
    const int j = tree->joints;
    for (int t = 0; t < instants; t++) {
        place_root(tree, array[ROOT] + t * MOTION);
        solve_instant(tree, array[Q] + t * j, array[DQ] + t * j, array[DDQ] + t * j, gravity, loaded,
                      array[LOADS] + t * loads * LOAD, loads, array[TORQUE] + t * j);
        for (int i = 0; i < tree->links; i++) {
            const Moving *moving = tree->moving + i;
            const int row = t * tree->links + i;
            memcpy(array[FORCE] + 3 * row, moving->f, sizeof moving->f);
            memcpy(array[MOMENT] + 3 * row, moving->n, sizeof moving->n);
            memcpy(array[POSITION] + 3 * row, moving->p, sizeof moving->p);
            memcpy(array[ROTATION] + 9 * row, moving->R, sizeof moving->R);
        }
    }
}

/* Indices of the links that loads act on; NULL with an error set. */
static int *take_loaded(const Tree *tree, PyObject *indices, Py_ssize_t loads)
{
    int *loaded = PyMem_Calloc((size_t)loads + 1, sizeof(int));
    if (loaded == NULL)
        return (int *)PyErr_NoMemory();
    for (Py_ssize_t i = 0; i < loads; i++) {
        const long index = PyLong_AsLong(PyList_GET_ITEM(indices, i));
        if (!(index >= 0 && index < tree->links)) {
            PyErr_Format(PyExc_IndexError, "there are %d links", tree->links);
            PyMem_Free(loaded);
            return NULL;
        }
        loaded[i] = (int)index;
    }
    return loaded;
}

static PyObject *solve_buffers(Tree *tree, const double *gravity, PyObject *indices, const Py_buffer *view)
{
    const Py_ssize_t loads = PyList_GET_SIZE(indices), j = tree->joints, l = tree->links;
    const Py_ssize_t size = sizeof(double), n = j > 0 ? view[Q].len / (size * j) : 0;
    const Py_ssize_t length[ARRAYS] = {n * MOTION, n * j,     n * j,     n * j,     n * loads * LOAD,
                                       n * j,      3 * n * l, 3 * n * l, 3 * n * l, 9 * n * l};
    double *array[ARRAYS];
    for (int i = 0; i < ARRAYS; i++) {
        array[i] = view[i].buf;
        if (view[i].len != size * length[i]) {
            PyErr_SetString(PyExc_ValueError, "the arrays do not fit together");
            return NULL;
        }
    }
    int *loaded = take_loaded(tree, indices, loads);
    if (loaded == NULL)
        return NULL;
    solve_all(tree, gravity, loaded, (int)loads, (int)n, array);
    PyMem_Free(loaded);
    Py_RETURN_NONE;
}

static PyObject *tree_solve(Tree *tree, PyObject *const *given, Py_ssize_t count)
{
    double gravity[3];
    if (!expect(count, 2 + ARRAYS,
                "solve(gravity, links, root, q, dq, ddq, loads, torque, force, moment, position, "
                "rotation)"))
        return NULL;
    if (!take(given[0], 3, gravity))
        return NULL;
    if (!PyList_Check(given[1])) {
        PyErr_SetString(PyExc_TypeError, "the links of the loads must be a list");
        return NULL;
    }
    Py_buffer view[ARRAYS];
    int taken = 0;
    for (; taken < ARRAYS; taken++) {
        const int flags = taken < TORQUE ? PyBUF_C_CONTIGUOUS : PyBUF_C_CONTIGUOUS | PyBUF_WRITABLE;
        if (PyObject_GetBuffer(given[2 + taken], view + taken, flags) < 0)
            break;
    }
    PyObject *done = taken == ARRAYS ? solve_buffers(tree, gravity, given[1], view) : NULL;
    while (taken > 0)
        PyBuffer_Release(view + --taken);
    return done;
}

static int take_link(PyObject *row, int before, int joints, Link *out)
{
    double v[NUMBERS];
    if (!take(row, NUMBERS, v))
        return 0;
    out->parent = (int)v[0], out->joint = (int)v[1];
    if (out->parent < -1 || out->parent >= before || out->joint < -1 || out->joint >= joints) {
        PyErr_SetString(PyExc_ValueError, "a link hangs on one that comes after it, or on a joint that is not there");
        return 0;
    }
    memcpy(out->offset, v + 2, sizeof out->offset);
    memcpy(out->axis, v + 5, sizeof out->axis);
    out->mass = v[8];
    memcpy(out->com, v + 9, sizeof out->com);
    const double inertia[9] = {v[12], v[13], v[14], v[13], v[15], v[16], v[14], v[16], v[17]};
    memcpy(out->inertia, inertia, sizeof inertia);
    return 1;
}

static int tree_init(Tree *tree, PyObject *args, PyObject *Py_UNUSED(kwargs))
{
    PyObject *rows;
    if (tree->link != NULL) {
        PyErr_SetString(PyExc_TypeError, "it is made once");
        return -1;
    }
    if (!PyArg_ParseTuple(args, "iO!", &tree->joints, &PyList_Type, &rows))
        return -1;
    const Py_ssize_t links = PyList_GET_SIZE(rows);
    tree->link = PyMem_Calloc((size_t)links + 1, sizeof(Link));
    tree->moving = PyMem_Calloc((size_t)links + 1, sizeof(Moving));
    if (tree->link == NULL || tree->moving == NULL) {
        PyErr_NoMemory();
        return -1;
    }
    for (; tree->links < links; tree->links++)
        if (!take_link(PyList_GET_ITEM(rows, tree->links), tree->links, tree->joints, tree->link + tree->links))
            return -1;
    return 0;
}

static void tree_free(Tree *tree)
{
    PyMem_Free(tree->link);
    PyMem_Free(tree->moving);
    Py_TYPE(tree)->tp_free((PyObject *)tree);
}

static PyMethodDef methods[] = {
    {"solve", FAST(tree_solve),
     "(gravity, links, root, q, dq, ddq, loads, torque, force, moment, position, rotation): the last five are written"},
    {0}};

static PyTypeObject type = {
    PyVarObject_HEAD_INIT(NULL, 0).tp_name = "hric_newton_euler.Tree",
    .tp_basicsize = sizeof(Tree),
    .tp_flags = Py_TPFLAGS_DEFAULT,
    .tp_new = PyType_GenericNew,
    .tp_init = (initproc)tree_init,
    .tp_dealloc = (destructor)tree_free,
    .tp_methods = methods,
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "hric_newton_euler", NULL, -1, NULL, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit_hric_newton_euler(void)
{
    PyObject *module = PyType_Ready(&type) < 0 ? NULL : PyModule_Create(&definition);
    if (module != NULL && PyModule_AddObjectRef(module, "Tree", (PyObject *)&type) < 0)
        Py_CLEAR(module);
    return module;
}

/* Links in OpenSim's memory: how they move, and forces between two of them. What bushings.py explains. */
#include "hric_control/python_numbers.h"
#include "hric_control/rigid_body.h"

enum { NUMBERS = 12 }; /* rotation, row-major, and origin of a link in its body */

/* OpenSim's own of the body that carries a link, in the ground frame. */
typedef struct {
    const double *pose; /* rotation by columns, then the origin */
    const double *rate; /* angular velocity, then that of the origin */
    double *force;      /* moment about the origin, then force */
    double at[NUMBERS];
} Link;

typedef struct {
    PyObject_HEAD
    PyObject *owners; /* whose memory this is */
    double R_world_ground[9];
    int n;
    Link *links;
} Links;

static void transpose(const double A[9], double B[9])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            B[3 * i + j] = A[3 * j + i];
}

static PyObject *motion(const Links *self, const Link *link)
{
    double R_ground_body[9], R_world_body[9], R[9], lever[3], origin[3], linear[3];
    double p[3], q[4], v[3], w[3]; /* of the link in the world */
    transpose(link->pose, R_ground_body);
    rotate(R_ground_body, link->at + 9, lever);
    for (int i = 0; i < 3; i++) {
        origin[i] = link->pose[9 + i] + lever[i];
        linear[i] = link->rate[3 + i];
    }
    add_cross(link->rate, lever, linear);
    multiply(self->R_world_ground, R_ground_body, R_world_body);
    multiply(R_world_body, link->at, R);
    quaternion(R, q);
    rotate(self->R_world_ground, origin, p);
    rotate(self->R_world_ground, linear, v);
    rotate(self->R_world_ground, link->rate, w);
    return Py_BuildValue("(ddd)(dddd)(ddd)(ddd)", p[0], p[1], p[2], q[0], q[1], q[2], q[3], v[0], v[1], v[2], w[0],
                         w[1], w[2]);
}

static PyObject *links_motions(Links *self, PyObject *Py_UNUSED(nothing))
{
    PyObject *motions = PyList_New(self->n);
    for (int i = 0; motions != NULL && i < self->n; i++) {
        memset(self->links[i].force, 0, sizeof(double) * 6);
        PyObject *one = motion(self, self->links + i);
        if (one == NULL)
            Py_CLEAR(motions);
        else
            PyList_SET_ITEM(motions, i, one);
    }
    return motions;
}

/* All in the ground frame. */
static void push(const Link *link, double sign, const double force[3], const double torque[3], const double point[3])
{
    const double *origin = link->pose + 9;
    const double lever[3] = {point[0] - origin[0], point[1] - origin[1], point[2] - origin[2]};
    double moment[3] = {torque[0], torque[1], torque[2]};
    add_cross(lever, force, moment);
    for (int i = 0; i < 3; i++) {
        link->force[i] += sign * moment[i];
        link->force[3 + i] += sign * force[i];
    }
}

static PyObject *links_push(Links *self, PyObject *const *given, Py_ssize_t count)
{
    double world[3][3], ground[3][3], R_ground_world[9];
    if (!expect(count, 4, "push(pair, force, torque, point)"))
        return NULL;
    const long pair = PyLong_AsLong(given[0]);
    if (pair == -1 && PyErr_Occurred() != NULL)
        return NULL;
    if (pair < 0 || pair >= self->n / 2) {
        PyErr_Format(PyExc_IndexError, "there are %d pairs", self->n / 2);
        return NULL;
    }
    transpose(self->R_world_ground, R_ground_world);
    for (int i = 0; i < 3; i++) {
        if (!take(given[1 + i], 3, world[i]))
            return NULL;
        rotate(R_ground_world, world[i], ground[i]);
    }
    push(self->links + 2 * pair, 1.0, ground[0], ground[1], ground[2]);
    push(self->links + 2 * pair + 1, -1.0, ground[0], ground[1], ground[2]);
    Py_RETURN_NONE;
}

/* ---- the type ---- */

static int take_link(PyObject *row, Link *out)
{
    PyObject *address[3], *at;
    if (!PyArg_ParseTuple(row, "OOOO", address, address + 1, address + 2, &at))
        return 0;
    void *memory[3];
    for (int i = 0; i < 3; i++)
        if ((memory[i] = PyLong_AsVoidPtr(address[i])) == NULL) {
            if (PyErr_Occurred() == NULL)
                PyErr_SetString(PyExc_ValueError, "a link has no memory");
            return 0;
        }
    out->pose = memory[0];
    out->rate = memory[1];
    out->force = memory[2];
    return take(at, NUMBERS, out->at);
}

static int links_init(Links *self, PyObject *args, PyObject *Py_UNUSED(kwargs))
{
    PyObject *rows, *rotation, *owners;
    if (self->owners != NULL) {
        PyErr_SetString(PyExc_TypeError, "it is made once");
        return -1;
    }
    if (!PyArg_ParseTuple(args, "O!OO", &PyList_Type, &rows, &rotation, &owners)
        || !take(rotation, 9, self->R_world_ground))
        return -1;
    self->owners = Py_NewRef(owners);
    const Py_ssize_t count = PyList_GET_SIZE(rows);
    self->links = PyMem_Calloc((size_t)count + 1, sizeof(Link));
    if (self->links == NULL) {
        PyErr_NoMemory();
        return -1;
    }
    for (; self->n < count; self->n++)
        if (!take_link(PyList_GET_ITEM(rows, self->n), self->links + self->n))
            return -1;
    return 0;
}

static void links_free(Links *self)
{
    PyMem_Free(self->links);
    Py_XDECREF(self->owners);
    Py_TYPE(self)->tp_free((PyObject *)self);
}

static PyMethodDef methods[] = {
    {"motions", (PyCFunction)links_motions, METH_NOARGS,
     "() -> (position, orientation, linear and angular velocity) of each link in the world frame; forgets all forces"},
    {"push", FAST(links_push),
     "(pair, force, torque, point) in the world frame, on link 2 pair; the opposite on the next"},
    {0}};

static PyTypeObject type = {
    PyVarObject_HEAD_INIT(NULL, 0).tp_name = "hric_opensim_links.Links",
    .tp_basicsize = sizeof(Links),
    .tp_flags = Py_TPFLAGS_DEFAULT,
    .tp_new = PyType_GenericNew,
    .tp_init = (initproc)links_init,
    .tp_dealloc = (destructor)links_free,
    .tp_methods = methods,
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "hric_opensim_links", NULL, -1, NULL, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit_hric_opensim_links(void)
{
    PyObject *module = PyType_Ready(&type) < 0 ? NULL : PyModule_Create(&definition);
    if (module != NULL && PyModule_AddObjectRef(module, "Links", (PyObject *)&type) < 0)
        Py_CLEAR(module);
    return module;
}

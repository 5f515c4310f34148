/* Links in MuJoCo's data: how they move, and forces between two of them. What bushings.py explains. Of MuJoCo only the
   layout of its structures is needed here. */
#include "hric_control/python_numbers.h"

#include <mujoco/mjdata.h>
#include <mujoco/mjmodel.h>

enum { NUMBERS = 7 }; /* position and orientation (x, y, z, w) of a link in its body */

typedef struct {
    int body;
    double at[NUMBERS];
} Link;

typedef struct {
    PyObject_HEAD
    const mjModel *model;
    mjData *data;
    PyObject *owners; /* whose memory this is */
    int n;
    Link *links;
} Links;

static PyObject *triple(const double v[3]) { return Py_BuildValue("ddd", v[0], v[1], v[2]); }

static void add_cross(const double a[3], const double b[3], double *sum)
{
    sum[0] += a[1] * b[2] - a[2] * b[1];
    sum[1] += a[2] * b[0] - a[0] * b[2];
    sum[2] += a[0] * b[1] - a[1] * b[0];
}

/* Orientation (x, y, z, w) of a link; MuJoCo's has w first. */
static PyObject *orientation(const mjtNum *b, const double *l)
{
    return Py_BuildValue("dddd", b[0] * l[0] + b[1] * l[3] + b[2] * l[2] - b[3] * l[1],
                         b[0] * l[1] - b[1] * l[2] + b[2] * l[3] + b[3] * l[0],
                         b[0] * l[2] + b[1] * l[1] - b[2] * l[0] + b[3] * l[3],
                         b[0] * l[3] - b[1] * l[0] - b[2] * l[1] - b[3] * l[2]);
}

static PyObject *motion(const Links *self, const Link *link)
{
    const mjData *d = self->data;
    const mjtNum *R = d->xmat + 9 * link->body, *from = d->xpos + 3 * link->body;
    const mjtNum *angular = d->cvel + 6 * link->body; /* then linear, about the mass centre of the tree */
    const mjtNum *centre = d->subtree_com + 3 * self->model->body_rootid[link->body];
    double position[3], lever[3], linear[3];
    for (int i = 0; i < 3; i++) {
        position[i] = from[i] + R[3 * i] * link->at[0] + R[3 * i + 1] * link->at[1] + R[3 * i + 2] * link->at[2];
        lever[i] = position[i] - centre[i];
        linear[i] = angular[3 + i];
    }
    add_cross(angular, lever, linear);
    return Py_BuildValue("NNNN", triple(position), orientation(d->xquat + 4 * link->body, link->at + 3), triple(linear),
                         triple(angular));
}

static PyObject *links_motions(Links *self, PyObject *Py_UNUSED(nothing))
{
    PyObject *motions = PyList_New(self->n);
    for (int i = 0; motions != NULL && i < self->n; i++) {
        PyObject *one = motion(self, self->links + i);
        if (one == NULL)
            Py_CLEAR(motions);
        else
            PyList_SET_ITEM(motions, i, one);
    }
    return motions;
}

/* MuJoCo has the forces on a body at its centre of mass. */
static void push(Links *self, int number, double sign, const double force[3], const double torque[3],
                 const double point[3])
{
    const int body = self->links[number].body;
    const mjtNum *centre = self->data->xipos + 3 * body;
    const double lever[3] = {point[0] - centre[0], point[1] - centre[1], point[2] - centre[2]};
    double moment[3] = {torque[0], torque[1], torque[2]};
    add_cross(lever, force, moment);
    mjtNum *applied = self->data->xfrc_applied + 6 * body;
    for (int i = 0; i < 3; i++) {
        applied[i] += sign * force[i];
        applied[3 + i] += sign * moment[i];
    }
}

static PyObject *links_push(Links *self, PyObject *args)
{
    int pair;
    double f[3], t[3], p[3];
    if (!PyArg_ParseTuple(args, "i(ddd)(ddd)(ddd)", &pair, f, f + 1, f + 2, t, t + 1, t + 2, p, p + 1, p + 2))
        return NULL;
    if (pair < 0 || pair >= self->n / 2) {
        PyErr_Format(PyExc_IndexError, "there are %d pairs", self->n / 2);
        return NULL;
    }
    push(self, 2 * pair, 1.0, f, t, p);
    push(self, 2 * pair + 1, -1.0, f, t, p);
    Py_RETURN_NONE;
}

/* ---- the type ---- */

static int take_link(PyObject *row, int bodies, Link *out)
{
    double numbers[1 + NUMBERS];
    if (!take(row, 1 + NUMBERS, numbers))
        return 0;
    if (!(numbers[0] >= 0.0 && numbers[0] < (double)bodies)) {
        PyErr_Format(PyExc_ValueError, "a body is not among %d", bodies);
        return 0;
    }
    out->body = (int)numbers[0];
    memcpy(out->at, numbers + 1, sizeof out->at);
    return 1;
}

static int links_init(Links *self, PyObject *args, PyObject *Py_UNUSED(kwargs))
{
    PyObject *model, *data, *rows, *owners;
    if (self->owners != NULL) {
        PyErr_SetString(PyExc_TypeError, "it is made once");
        return -1;
    }
    if (!PyArg_ParseTuple(args, "OOO!O", &model, &data, &PyList_Type, &rows, &owners))
        return -1;
    self->model = PyLong_AsVoidPtr(model);
    self->data = PyLong_AsVoidPtr(data);
    if (PyErr_Occurred() != NULL)
        return -1;
    self->owners = Py_NewRef(owners);
    const Py_ssize_t count = PyList_GET_SIZE(rows);
    self->links = PyMem_Calloc((size_t)count + 1, sizeof(Link));
    if (self->links == NULL) {
        PyErr_NoMemory();
        return -1;
    }
    for (; self->n < count; self->n++)
        if (!take_link(PyList_GET_ITEM(rows, self->n), (int)self->model->nbody, self->links + self->n))
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
     "() -> (position, orientation, linear and angular velocity) of each link in the world frame"},
    {"push", (PyCFunction)links_push, METH_VARARGS,
     "(pair, force, torque, point) in the world frame, on link 2 pair; the opposite on the next one"},
    {0}};

static PyTypeObject type = {
    PyVarObject_HEAD_INIT(NULL, 0).tp_name = "hric_mujoco_links.Links",
    .tp_basicsize = sizeof(Links),
    .tp_flags = Py_TPFLAGS_DEFAULT,
    .tp_new = PyType_GenericNew,
    .tp_init = (initproc)links_init,
    .tp_dealloc = (destructor)links_free,
    .tp_methods = methods,
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "hric_mujoco_links", NULL, -1, NULL, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit_hric_mujoco_links(void)
{
    PyObject *module = PyType_Ready(&type) < 0 ? NULL : PyModule_Create(&definition);
    if (module != NULL && PyModule_AddObjectRef(module, "Links", (PyObject *)&type) < 0)
        Py_CLEAR(module);
    return module;
}

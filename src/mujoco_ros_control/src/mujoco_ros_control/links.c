/* Compiled part of bushings.py: motion of links in MuJoCo's data, and forces between two of them. MuJoCo's headers are
   used for the layout of its structures only. */
#include "hric_core/python_numbers.h"

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
    PyObject *owners; /* Python objects that own the model and the data */
    int n;
    Link *links;
} Links;

#include "hric_dynamics/python_links.h"

/* Orientation q (x, y, z, w) of a link l in the world, from its body's b in MuJoCo's order (w, x, y, z). */
static void orientation(const mjtNum *b, const double *l, double q[4])
{
    q[0] = b[0] * l[0] + b[1] * l[3] + b[2] * l[2] - b[3] * l[1];
    q[1] = b[0] * l[1] - b[1] * l[2] + b[2] * l[3] + b[3] * l[0];
    q[2] = b[0] * l[2] + b[1] * l[1] - b[2] * l[0] + b[3] * l[3];
    q[3] = b[0] * l[3] - b[1] * l[0] - b[2] * l[1] - b[3] * l[2];
}

static PyObject *motion(const Links *self, const Link *link)
{
    const mjData *d = self->data;
    const mjtNum *R = d->xmat + 9 * link->body, *from = d->xpos + 3 * link->body;
    const mjtNum *angular = d->cvel + 6 * link->body; /* followed by linear, at the centre of mass of the tree */
    const mjtNum *centre = d->subtree_com + 3 * self->model->body_rootid[link->body];
    double position[3], turned[4], lever[3], linear[3];
    for (int i = 0; i < 3; i++) {
        position[i] = from[i] + R[3 * i] * link->at[0] + R[3 * i + 1] * link->at[1] + R[3 * i + 2] * link->at[2];
        lever[i] = position[i] - centre[i];
        linear[i] = angular[3 + i];
    }
    add_cross(angular, lever, linear);
    orientation(d->xquat + 4 * link->body, link->at + 3, turned);
    return pack_motion(position, turned, linear, angular);
}

/* Apply a load to a body. MuJoCo refers loads to the body's centre of mass. */
static void push_one(Links *self, int body, double sign, const double force[3], const double torque[3],
                     const double point[3])
{
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

static void push(Links *self, const Link pair[2], const double force[3], const double torque[3], const double point[3])
{
    push_one(self, pair[0].body, 1.0, force, torque, point);
    push_one(self, pair[1].body, -1.0, force, torque, point);
}

static int take_link(const Links *self, PyObject *row, Link *out)
{
    double numbers[1 + NUMBERS] = {0};
    if (!take(row, 1 + NUMBERS, numbers))
        return 0;
    if (!(numbers[0] >= 0.0 && numbers[0] < (double)self->model->nbody)) {
        PyErr_Format(PyExc_ValueError, "the number of a body is not below %d", (int)self->model->nbody);
        return 0;
    }
    out->body = (int)numbers[0];
    memcpy(out->at, numbers + 1, sizeof out->at);
    return 1;
}

static int links_init(Links *self, PyObject *args)
{
    PyObject *model, *data, *rows, *owners;
    return PyArg_ParseTuple(args, "OOO!O", &model, &data, &PyList_Type, &rows, &owners)
                   && (self->model = take_address(model)) != NULL && (self->data = take_address(data)) != NULL
                   && take_links(self, rows, owners)
               ? 0
               : -1;
}

LINKS_MODULE(hric_mujoco_links)

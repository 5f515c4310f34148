// clang-format Language: C
/* Pairs of links in an engine's memory as a type of Python, `Links`: how they move, and forces between both of a pair.
 *
 * Before it includes this, a module defines `Link`, what is needed of one, and `Links`, an object of Python with
 * `owners`, `n` and `links` among its members; afterwards the functions that are only declared here, and LINKS_MODULE.
 */
#ifndef HRIC_DYNAMICS_PYTHON_LINKS_H
#define HRIC_DYNAMICS_PYTHON_LINKS_H

#include "hric_core/python_numbers.h"
#include "hric_dynamics/rigid_body.h"

/* Fill a new object from what Python gives; take_links reads the rows. */
static int links_init(Links *self, PyObject *args);

/* A link from its row; 0 with an error set. */
static int take_link(const Links *self, PyObject *row, Link *out);

/* How a link moves, by pack_motion. */
static PyObject *motion(const Links *self, const Link *link);

/* A force at a point and a torque in the world frame on the first of two links, and the opposite ones on the second. */
static void push(Links *self, const Link pair[2], const double force[3], const double torque[3], const double point[3]);

/* A pointer from its number; NULL with an error set. */
static inline void *take_address(PyObject *number)
{
    void *address = PyLong_AsVoidPtr(number);
    if (address == NULL && PyErr_Occurred() == NULL)
        PyErr_SetString(PyExc_ValueError, "an address is zero");
    return address;
}

/* Position, orientation (x, y, z, w), velocity and angular velocity in the world frame. */
static inline PyObject *pack_motion(const double p[3], const double q[4], const double v[3], const double w[3])
{
    return Py_BuildValue("(ddd)(dddd)(ddd)(ddd)", p[0], p[1], p[2], q[0], q[1], q[2], q[3], v[0], v[1], v[2], w[0],
                         w[1], w[2]);
}

/* Fill a new object; owners: whose memory the links are in. 0 with an error set. */
static int take_links(Links *self, PyObject *rows, PyObject *owners)
{
    self->owners = Py_NewRef(owners);
    const Py_ssize_t count = PyList_GET_SIZE(rows);
    self->links = zeroed((size_t)count, sizeof(Link));
    if (self->links == NULL)
        return 0;
    for (; self->n < count; self->n++)
        if (!take_link(self, PyList_GET_ITEM(rows, self->n), self->links + self->n))
            return 0;
    return 1;
}

static void links_clear(Links *self)
{
    PyMem_Free(self->links);
    Py_XDECREF(self->owners);
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

static PyObject *links_push(Links *self, PyObject *const *given, Py_ssize_t count)
{
    double force[3], torque[3], point[3];
    if (!expect(count, 4, "push(pair, force, torque, point)"))
        return NULL;
    const long pair = PyLong_AsLong(given[0]);
    if (pair == -1 && PyErr_Occurred() != NULL)
        return NULL;
    if (pair < 0 || pair >= self->n / 2) {
        PyErr_Format(PyExc_IndexError, "there are %d pairs", self->n / 2);
        return NULL;
    }
    if (!take(given[1], 3, force) || !take(given[2], 3, torque) || !take(given[3], 3, point))
        return NULL;
    push(self, self->links + 2 * pair, force, torque, point);
    Py_RETURN_NONE;
}

static PyMethodDef links_methods[] = {
    {"motions", (PyCFunction)links_motions, METH_NOARGS,
     "() -> (position, orientation, linear and angular velocity) of each link in the world frame"},
    {"push", FAST(links_push),
     "(pair, force, torque, point) in the world frame, on link 2 pair; the opposite on the next one"},
    {0}};

/* The module of that name, with the type in it. */
#define LINKS_MODULE(name) TYPE_MODULE(name, Links, links, NULL)

#endif

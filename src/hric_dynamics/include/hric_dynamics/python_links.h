// clang-format Language: C
/* Python type `Links`: pairs of links in an engine's memory, to read their motion and apply forces between the two.
 *
 * Before including this file, a module defines two structures: `Link`, the data of one link, and `Links`, a Python
 * object with the members `owners`, `n` and `links`. After it, the module defines the functions that are only declared
 * here, and uses LINKS_MODULE. */
#ifndef HRIC_DYNAMICS_PYTHON_LINKS_H
#define HRIC_DYNAMICS_PYTHON_LINKS_H

#include "hric_core/python_numbers.h"
#include "hric_dynamics/rigid_body.h"

/* Initialise a new object from its Python arguments; take_links reads the rows of links. */
static int links_init(Links *self, PyObject *args);

/* Read a link from its row; return 0 with a Python error set on failure. */
static int take_link(const Links *self, PyObject *row, Link *out);

/* Return the motion of a link, as packed by pack_motion. */
static PyObject *motion(const Links *self, const Link *link);

/* Apply a force at a point and a torque, in the world frame, to the first link of a pair; the opposite to the other. */
static void push(Links *self, const Link pair[2], const double force[3], const double torque[3], const double point[3]);

/* Return a pointer from a Python integer; NULL with a Python error set on failure. */
static inline void *take_address(PyObject *number)
{
    void *address = PyLong_AsVoidPtr(number);
    if (address == NULL && PyErr_Occurred() == NULL)
        PyErr_SetString(PyExc_ValueError, "an address is zero");
    return address;
}

/* Return the tuples position, orientation (x, y, z, w), velocity and angular velocity, in the world frame. */
static inline PyObject *pack_motion(const double p[3], const double q[4], const double v[3], const double w[3])
{
    return Py_BuildValue("(ddd)(dddd)(ddd)(ddd)", p[0], p[1], p[2], q[0], q[1], q[2], q[3], v[0], v[1], v[2], w[0],
                         w[1], w[2]);
}

/* Read the links of a new object; owners: Python objects that own the links' memory. Return 0 with a Python error set
 * on failure. */
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
     "motions(): return (position, orientation, linear velocity, angular velocity) of each link in the world frame"},
    {"push", FAST(links_push),
     "push(pair, force, torque, point): apply a wrench in the world frame to the first link of a pair, the opposite "
     "one to the second"},
    {0}};

/* Define the module `name` with the type `Links`. */
#define LINKS_MODULE(name) TYPE_MODULE(name, Links, links, NULL)

#endif

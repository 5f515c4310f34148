/* Compiled part of bushings.py: motion of links in OpenSim's memory, and forces between two of them. */
#include "hric_core/python_numbers.h"
#include "hric_core/quaternions.h"

enum { NUMBERS = 12 }; /* rotation, row-major, and origin of a link in its body */

/* OpenSim's memory of the body to which a link belongs, in the ground frame, and the pose of the link in the body. */
typedef struct {
    const double *pose; /* rotation by columns, then the origin */
    const double *rate; /* angular velocity, then velocity of the origin */
    double *force;      /* moment about the origin, then force */
    double at[NUMBERS];
} Link;

typedef struct {
    PyObject_HEAD
    PyObject *owners; /* Python objects that own the memory */
    double R_world_ground[9];
    int n;
    Link *links;
} Links;

#include "hric_dynamics/python_links.h"

static void transpose(const double A[9], double B[9])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            B[3 * i + j] = A[3 * j + i];
}

/* Return the motion of a link in the world, and set the load on its body to zero. */
static PyObject *motion(const Links *self, const Link *link)
{
    double R_ground_body[9], R_world_body[9], R[9], lever[3], origin[3], linear[3];
    double p[3], q[4], v[3], w[3]; /* position, orientation and velocities of the link in the world */
    memset(link->force, 0, sizeof(double) * 6);
    transpose(link->pose, R_ground_body);
    rotate(R_ground_body, link->at + 9, lever);
    for (int i = 0; i < 3; i++) {
        origin[i] = link->pose[9 + i] + lever[i];
        linear[i] = link->rate[3 + i];
    }
    add_cross(link->rate, lever, linear);
    multiply(self->R_world_ground, R_ground_body, R_world_body);
    multiply(R_world_body, link->at, R);
    from_elements(R, q);
    rotate(self->R_world_ground, origin, p);
    rotate(self->R_world_ground, linear, v);
    rotate(self->R_world_ground, link->rate, w);
    return pack_motion(p, q, v, w);
}

/* Add a load to the body of a link, all in the ground frame. */
static void push_one(const Link *link, double sign, const double force[3], const double torque[3],
                     const double point[3])
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

static void push(Links *self, const Link pair[2], const double force[3], const double torque[3], const double point[3])
{
    double R_ground_world[9], f[3], t[3], p[3]; /* force, torque and point in the ground frame */
    transpose(self->R_world_ground, R_ground_world);
    rotate(R_ground_world, force, f);
    rotate(R_ground_world, torque, t);
    rotate(R_ground_world, point, p);
    push_one(pair, 1.0, f, t, p);
    push_one(pair + 1, -1.0, f, t, p);
}

static int take_link(const Links *Py_UNUSED(self), PyObject *row, Link *out)
{
    PyObject *pose, *rate, *force, *at;
    return PyArg_ParseTuple(row, "OOOO", &pose, &rate, &force, &at) && (out->pose = take_address(pose)) != NULL
           && (out->rate = take_address(rate)) != NULL && (out->force = take_address(force)) != NULL
           && take(at, NUMBERS, out->at);
}

static int links_init(Links *self, PyObject *args)
{
    PyObject *rows, *rotation, *owners;
    return PyArg_ParseTuple(args, "O!OO", &PyList_Type, &rows, &rotation, &owners)
                   && take(rotation, 9, self->R_world_ground) && take_links(self, rows, owners)
               ? 0
               : -1;
}

LINKS_MODULE(hric_opensim_links)

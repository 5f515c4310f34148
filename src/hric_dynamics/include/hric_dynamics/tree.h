// clang-format Language: C
/* Trees of rigid links with one-coordinate joints: poses, mass matrix, recursive Newton-Euler algorithm, gravity. All
 * quantities are in the world frame, about its origin. Algorithms after Featherstone, Rigid Body Dynamics Algorithms
 * (2008), ch. 5 and 6.
 *
 * The order of the operations is part of the interface: runs are compared bit by bit. */
#ifndef HRIC_DYNAMICS_TREE_H
#define HRIC_DYNAMICS_TREE_H

#include "hric_core/python_numbers.h"
#include "hric_dynamics/rigid_body.h"

/* Link and its parent joint, in the layout of `tree.link_row`: index of the parent link, smaller than the link's own,
 * or -1 for the base; 0 for a revolute joint, else prismatic; pose of the joint at position 0 in the parent, and its
 * unit axis; mass, centre of mass, and inertia about the centre of mass. A prismatic joint with zero axis is fixed. */
typedef struct {
    double parent, slides;
    double R_parent_joint[9], p_parent_joint[3], axis[3];
    double mass, com[3], inertia[9];
} Link;

enum { LINK_NUMBERS = sizeof(Link) / sizeof(double) };

typedef struct {
    int n, *parent;
    Link *links;
    Pose base, *poses;           /* poses of the base and of the links in the world */
    Spatial *S, *v, *a, *forces; /* unit motions of the joints; velocity, acceleration and force of the links */
    Body *bodies, *composites;   /* single links, and links with all their descendants */
} Tree;

/* Allocate a tree of n links without data; return 0 with a Python error set on failure. */
static inline int make_tree(Tree *tree, int n)
{
    const size_t size = (size_t)n;
    tree->n = n;
    tree->base = WORLD;
    tree->parent = zeroed(size, sizeof(int));
    tree->links = zeroed(size, sizeof(Link));
    tree->poses = zeroed(size, sizeof(Pose));
    tree->S = zeroed(4 * size, sizeof(Spatial));
    tree->bodies = zeroed(2 * size, sizeof(Body));
    if (PyErr_Occurred())
        return 0;
    tree->v = tree->S + size;
    tree->a = tree->v + size;
    tree->forces = tree->a + size;
    tree->composites = tree->bodies + size;
    return 1;
}

static inline void clear_tree(Tree *tree)
{
    PyMem_Free(tree->parent);
    PyMem_Free(tree->links);
    PyMem_Free(tree->poses);
    PyMem_Free(tree->S);
    PyMem_Free(tree->bodies);
}

/* Set the data of link i; return 0 with a Python error set on failure. */
static inline int set_link(Tree *tree, int i, const Link *link)
{
    if (!(link->parent < (double)i)) {
        PyErr_Format(PyExc_ValueError, "link %d must come after its parent", i);
        return 0;
    }
    tree->links[i] = *link;
    tree->parent[i] = link->parent < 0.0 ? -1 : (int)link->parent;
    return 1;
}

/* Compute the rotation matrix R of a rotation by an angle about a unit axis a (Rodrigues). */
static inline void rotation(const double *a, double angle, double R[9])
{
    const double s = sin(angle), c = cos(angle), k = 1.0 - c;
    const double r[9] = {c + k * a[0] * a[0],        k * a[0] * a[1] - s * a[2], k * a[0] * a[2] + s * a[1],
                         k * a[0] * a[1] + s * a[2], c + k * a[1] * a[1],        k * a[1] * a[2] - s * a[0],
                         k * a[0] * a[2] - s * a[1], k * a[1] * a[2] + s * a[0], c + k * a[2] * a[2]};
    memcpy(R, r, sizeof r);
}

/* Compute poses and joint unit motions of the first `count` links at joint positions q. */
static inline void place_joints(Tree *tree, const double *q, int count)
{
    memset(tree->S, 0, sizeof(Spatial) * (size_t)count);
    for (int i = 0; i < count; i++) {
        const Link *link = &tree->links[i];
        Pose joint, *pose = &tree->poses[i];
        Spatial *S = &tree->S[i];
        double turned[9], axis[3];
        compose(tree->parent[i] < 0 ? &tree->base : &tree->poses[tree->parent[i]], link->R_parent_joint,
                link->p_parent_joint, &joint);
        rotate(joint.R, link->axis, axis);
        *pose = joint;
        if (link->slides != 0.0) {
            for (int k = 0; k < 3; k++)
                pose->p[k] += axis[k] * q[i];
            memcpy(S->v, axis, sizeof axis);
        } else {
            rotation(link->axis, q[i], turned);
            multiply(joint.R, turned, pose->R);
            memcpy(S->w, axis, sizeof axis);
            add_cross(pose->p, axis, S->v);
        }
    }
}

/* Compute poses, joint unit motions and body inertias of all links at joint positions q ("place" the tree). */
static inline void place_tree(Tree *tree, const double *q)
{
    place_joints(tree, q, tree->n);
    memset(tree->bodies, 0, sizeof(Body) * (size_t)tree->n);
    for (int i = 0; i < tree->n; i++) {
        const Link *link = &tree->links[i];
        add_body(tree->poses[i].R, tree->poses[i].p, link->mass, link->com, link->inertia, &tree->bodies[i]);
    }
}

/* Compute the mass matrix of a placed tree, n x n. */
static inline void tree_mass_matrix(Tree *tree, double *M)
{
    memcpy(tree->composites, tree->bodies, sizeof(Body) * (size_t)tree->n);
    mass_matrix(tree->n, tree->parent, tree->S, tree->composites, M);
}

/* Compute the forces on the links of a placed tree that produce a motion, for `joint_efforts`. v0: velocity of the
 * base; a0: acceleration of the base minus gravity; dq, ddq: joint velocities and accelerations, ddq NULL for zero. */
static inline void link_forces(Tree *tree, const Spatial *v0, const Spatial *a0, const double *dq, const double *ddq)
{
    for (int i = 0; i < tree->n; i++) {
        const int parent = tree->parent[i];
        const Spatial *S = &tree->S[i];
        Spatial step, *v = &tree->v[i], *a = &tree->a[i];
        *v = parent < 0 ? *v0 : tree->v[parent];
        *a = parent < 0 ? *a0 : tree->a[parent];
        for (int k = 0; k < 3; k++) {
            step.w[k] = S->w[k] * dq[i];
            step.v[k] = S->v[k] * dq[i];
            v->w[k] += step.w[k];
            v->v[k] += step.v[k];
        }
        for (int k = 0; ddq != NULL && k < 3; k++) {
            a->w[k] += S->w[k] * ddq[i];
            a->v[k] += S->v[k] * ddq[i];
        }
        add_cross(v->w, step.w, a->w);
        add_cross(v->w, step.v, a->v);
        add_cross(v->v, step.w, a->v);
        motion_force(&tree->bodies[i], v, a, &tree->forces[i]);
    }
}

/* Compute the joint efforts that produce a motion of a placed tree with its base at rest; gravity: in the world frame
 * [m/s^2]. */
static inline void tree_efforts(Tree *tree, const double gravity[3], const double *dq, const double *ddq,
                                double *efforts)
{
    const Spatial still = {{0}, {0}}, base = {{0}, {-gravity[0], -gravity[1], -gravity[2]}};
    link_forces(tree, &still, &base, dq, ddq);
    joint_efforts(tree->n, tree->parent, tree->S, tree->forces, efforts);
}

#endif

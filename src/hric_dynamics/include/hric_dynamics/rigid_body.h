// clang-format Language: C
/* Spatial algebra of rigid bodies for the compiled models, after Featherstone, Rigid Body Dynamics Algorithms (2008),
 * ch. 5 and 6. All quantities are in the world frame, about its origin. Rotations and tensors are row-major; SI units.
 *
 * The order of the operations is part of the interface: runs are compared bit by bit. */
#ifndef HRIC_DYNAMICS_RIGID_BODY_H
#define HRIC_DYNAMICS_RIGID_BODY_H

#include <math.h>
#include <string.h>

/* Spatial motion (angular velocity w, velocity v of the body-fixed point at the origin) or spatial force (w: moment
 * about the origin, v: force). */
typedef struct {
    double w[3], v[3];
} Spatial;

/* Mass m, first moment of mass h, and inertia I about the origin, of a rigid body. */
typedef struct {
    double m, h[3], I[9];
} Body;

/* Pose of a frame in another: rotation R and origin p. */
typedef struct {
    double R[9], p[3];
} Pose;

static const Pose WORLD = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 0}};

static inline double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static inline void add_cross(const double a[3], const double b[3], double sum[3])
{
    sum[0] += a[1] * b[2] - a[2] * b[1];
    sum[1] += a[2] * b[0] - a[0] * b[2];
    sum[2] += a[0] * b[1] - a[1] * b[0];
}

static inline void rotate(const double R[9], const double x[3], double y[3])
{
    for (int i = 0; i < 3; i++)
        y[i] = dot(R + 3 * i, x);
}

static inline void multiply(const double A[9], const double B[9], double AB[9])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            AB[3 * i + j] = A[3 * i] * B[j] + A[3 * i + 1] * B[3 + j] + A[3 * i + 2] * B[6 + j];
}

/* Compute the pose of a child frame, whose pose in the parent is (R, p). */
static inline void compose(const Pose *parent, const double R[9], const double p[3], Pose *child)
{
    multiply(parent->R, R, child->R);
    rotate(parent->R, p, child->p);
    for (int i = 0; i < 3; i++)
        child->p[i] += parent->p[i];
}

/* Add a rigid body to `sum`, by the parallel-axis theorem. (R, p) is the pose of the body's frame in the world; com is
 * the centre of mass in that frame, I the inertia about the centre of mass in the axes of that frame. */
static inline void add_body(const double R[9], const double p[3], double m, const double com[3], const double I[9],
                            Body *sum)
{
    double c[3], RI[9];
    rotate(R, com, c);
    for (int i = 0; i < 3; i++)
        c[i] += p[i];
    multiply(R, I, RI);
    const double square = dot(c, c);
    sum->m += m;
    for (int i = 0; i < 3; i++) {
        sum->h[i] += m * c[i];
        for (int j = 0; j < 3; j++)
            sum->I[3 * i + j] += dot(RI + 3 * i, R + 3 * j) + m * ((i == j ? square : 0.0) - c[i] * c[j]);
    }
}

/* Compute I x motion: the momentum of a body with a velocity, or the force that gives it an acceleration. */
static inline void apply_inertia(const Body *body, const Spatial *motion, Spatial *force)
{
    rotate(body->I, motion->w, force->w);
    add_cross(body->h, motion->v, force->w);
    for (int i = 0; i < 3; i++)
        force->v[i] = body->m * motion->v[i];
    add_cross(motion->w, body->h, force->v);
}

/* Compute the force on a body with velocity v and acceleration a: I a + v x* I v. */
static inline void motion_force(const Body *body, const Spatial *v, const Spatial *a, Spatial *force)
{
    Spatial momentum;
    apply_inertia(body, a, force);
    apply_inertia(body, v, &momentum);
    add_cross(v->w, momentum.w, force->w);
    add_cross(v->v, momentum.v, force->w);
    add_cross(v->w, momentum.v, force->v);
}

static inline double power(const Spatial *motion, const Spatial *force)
{
    return dot(motion->w, force->w) + dot(motion->v, force->v);
}

/* Replace each body by the composite of itself and all its descendants in the tree. parent: index of the parent body,
 * smaller than the body's own, or -1. */
static inline void accumulate(int n, const int *parent, Body *bodies)
{
    for (int i = n - 1; i >= 0; i--) {
        if (parent[i] < 0)
            continue;
        Body *to = &bodies[parent[i]];
        to->m += bodies[i].m;
        for (int k = 0; k < 3; k++)
            to->h[k] += bodies[i].h[k];
        for (int k = 0; k < 9; k++)
            to->I[k] += bodies[i].I[k];
    }
}

/* Compute the joint-space mass matrix M_ij = S_i . (I_c S_j), n x n, by the composite rigid body algorithm. S: unit
 * motions of the joints; `bodies` is replaced by the composites. */
static inline void mass_matrix(int n, const int *parent, const Spatial *S, Body *bodies, double *M)
{
    memset(M, 0, sizeof(double) * (size_t)n * (size_t)n);
    accumulate(n, parent, bodies);
    for (int i = 0; i < n; i++) {
        Spatial momentum;
        apply_inertia(&bodies[i], &S[i], &momentum);
        for (int j = i; j >= 0; j = parent[j])
            M[i * n + j] = M[j * n + i] = power(&S[j], &momentum);
    }
}

/* Return the effort with which a joint holds a composite body (a link and its descendants) against gravity. */
static inline double holding_effort(const Spatial *S, const Body *body, const double gravity[3])
{
    Spatial weight = {{0}, {0}};
    for (int k = 0; k < 3; k++)
        weight.v[k] = body->m * gravity[k];
    add_cross(body->h, gravity, weight.w);
    return -power(S, &weight);
}

/* Compute the joint efforts that exert given forces on the bodies; `forces` becomes the sums over all descendants. */
static inline void joint_efforts(int n, const int *parent, const Spatial *S, Spatial *forces, double *efforts)
{
    for (int i = n - 1; i >= 0; i--) {
        efforts[i] = power(&S[i], &forces[i]);
        if (parent[i] < 0)
            continue;
        for (int k = 0; k < 3; k++) {
            forces[parent[i]].w[k] += forces[i].w[k];
            forces[parent[i]].v[k] += forces[i].v[k];
        }
    }
}

#endif

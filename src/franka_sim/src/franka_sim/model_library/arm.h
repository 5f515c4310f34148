// clang-format Language: C
/* Kinematics and dynamics of a Franka arm: seven joints that rotate about z, a flange, and the load mounted there.
 *
 * Poses are 16 numbers, Jacobians 42 (6 x 7, linear above angular), mass matrices 49, all column-major; m, rad, kg, N
 * m, s. */
#ifndef FRANKA_SIM_ARM_H
#define FRANKA_SIM_ARM_H

#include "hric_dynamics/rigid_body.h"

#define JOINTS 7
#define FLANGE 7 /* index of the flange, after the links */

/* Parameters of the arm without the load at its flange; parameters.py writes them in this order. Each pose is relative
 * to the previous frame; each inertia is about the centre of mass, in the link's axes. */
typedef struct {
    double joint_R[JOINTS][9], joint_p[JOINTS][3];
    double mass[JOINTS], com[JOINTS][3], inertia[JOINTS][9];
    double flange_R[9], flange_p[3];
} Arm;

/* Everything mounted at the flange, in the flange frame; inertia: symmetric matrix about the centre of mass. */
typedef struct {
    const double *inertia;
    double mass;
    const double *com;
} Load;

static const int PARENT[JOINTS] = {-1, 0, 1, 2, 3, 4, 5};
static const double STILL[JOINTS];

static inline void rotate_back(const double R[9], const double x[3], double y[3])
{
    for (int i = 0; i < 3; i++)
        y[i] = R[i] * x[0] + R[3 + i] * x[1] + R[6 + i] * x[2];
}

/* Poses of the seven links and of the flange in the base frame. */
static inline void forward(const Arm *arm, const double q[JOINTS], Pose poses[JOINTS + 1])
{
    Pose before = WORLD;
    for (int i = 0; i < JOINTS; i++) {
        const double c = cos(q[i]), s = sin(q[i]), turn[9] = {c, -s, 0, s, c, 0, 0, 0, 1};
        double R[9];
        multiply(arm->joint_R[i], turn, R);
        compose(&before, R, arm->joint_p[i], &poses[i]);
        before = poses[i];
    }
    compose(&before, arm->flange_R, arm->flange_p, &poses[FLANGE]);
}

/* Pose of a child frame, given relative to its parent as 16 column-major numbers. */
static inline void beyond(const Pose *parent, const double T[16], Pose *pose)
{
    double R[9];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            R[3 * i + j] = T[4 * j + i];
    compose(parent, R, T + 12, pose);
}

static inline void joint_axis(const Pose *link, double z[3])
{
    for (int i = 0; i < 3; i++)
        z[i] = link->R[3 * i + 2];
}

static inline void write_pose(const Pose *pose, double out[16])
{
    for (int j = 0; j < 3; j++) {
        for (int i = 0; i < 3; i++)
            out[4 * j + i] = pose->R[3 * i + j];
        out[4 * j + 3] = 0.0;
        out[12 + j] = pose->p[j];
    }
    out[15] = 1.0;
}

/* Jacobian of the origin of `frame`, which the first `moving` joints move; in the frame's own axes if `body`, else in
 * base axes. */
static inline void write_jacobian(const Pose links[JOINTS], int moving, const Pose *frame, int body, double out[42])
{
    memset(out, 0, 42 * sizeof(double));
    for (int j = 0; j < moving; j++) {
        double z[3], lever[3], linear[3] = {0, 0, 0};
        joint_axis(&links[j], z);
        for (int i = 0; i < 3; i++)
            lever[i] = frame->p[i] - links[j].p[i];
        add_cross(z, lever, linear);
        if (body) {
            rotate_back(frame->R, linear, out + 6 * j);
            rotate_back(frame->R, z, out + 6 * j + 3);
        } else {
            memcpy(out + 6 * j, linear, sizeof linear);
            memcpy(out + 6 * j + 3, z, sizeof z);
        }
    }
}

/* Unit twists S of the joints, and the bodies that they move; the load at the flange belongs to the last body. */
static inline void place_bodies(const Arm *arm, const Load *load, const double q[JOINTS], Spatial S[JOINTS],
                                Body bodies[JOINTS])
{
    Pose poses[JOINTS + 1];
    forward(arm, q, poses);
    memset(S, 0, JOINTS * sizeof(Spatial));
    memset(bodies, 0, JOINTS * sizeof(Body));
    for (int i = 0; i < JOINTS; i++) {
        joint_axis(&poses[i], S[i].w);
        add_cross(poses[i].p, S[i].w, S[i].v);
        add_body(poses[i].R, poses[i].p, arm->mass[i], arm->com[i], arm->inertia[i], &bodies[i]);
    }
    add_body(poses[FLANGE].R, poses[FLANGE].p, load->mass, load->com, load->inertia, &bodies[JOINTS - 1]);
}

/* Velocity and acceleration of the body behind a joint with unit twist S, from those of the body before it. */
static inline void pass_joint(const Spatial *S, double dq, double ddq, Spatial *v, Spatial *a)
{
    Spatial step;
    for (int k = 0; k < 3; k++) {
        step.w[k] = S->w[k] * dq;
        step.v[k] = S->v[k] * dq;
        v->w[k] += step.w[k];
        v->v[k] += step.v[k];
        a->w[k] += S->w[k] * ddq;
        a->v[k] += S->v[k] * ddq;
    }
    add_cross(v->w, step.w, a->w);
    add_cross(v->v, step.w, a->v);
    add_cross(v->w, step.v, a->v);
}

/* Joint torques M ddq + C dq + g by recursive Newton-Euler, for joints and bodies from `place_bodies`. gravity [m/s^2],
 * in the base frame, enters as an acceleration of the base. */
static inline void newton_euler(const Spatial S[JOINTS], const Body bodies[JOINTS], const double gravity[3],
                                const double dq[JOINTS], const double ddq[JOINTS], double efforts[JOINTS])
{
    Spatial forces[JOINTS], v = {{0}, {0}}, a = {{0}, {0}};
    for (int k = 0; k < 3; k++)
        a.v[k] = -gravity[k];
    for (int i = 0; i < JOINTS; i++) {
        pass_joint(&S[i], dq[i], ddq[i], &v, &a);
        motion_force(&bodies[i], &v, &a, &forces[i]);
    }
    joint_efforts(JOINTS, PARENT, S, forces, efforts);
}

#endif

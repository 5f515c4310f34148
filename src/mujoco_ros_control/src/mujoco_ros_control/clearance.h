// clang-format Language: C
/* Free space around the shapes of a scene, so that MuJoCo looks for contacts only while there may be one.

   The smallest distance of all pairs is computed once; as long as less than that has been travelled since, no pair can
   touch. A step without a search gives the same state as one whose search finds nothing. */
#ifndef MUJOCO_ROS_CONTROL_CLEARANCE_H
#define MUJOCO_ROS_CONTROL_CLEARANCE_H

#include "hric_dynamics/capsules.h"

#include <mujoco/mjdata.h>
#include <mujoco/mjmodel.h>
#include <string.h>

/* Steps in which contacts are searched after free space was too small, before it is computed again. */
enum { CLEARANCE_PAUSE = 50 };

/* Free space that must remain after a step [m]: covers velocities within a step that exceed twice those before it. */
static const double CLEARANCE_RESERVE = 2e-3;
/* Free space that each step takes at least [m]. */
static const double CLEARANCE_STEP = 1e-5;

typedef struct {
    double reach;        /* largest distance at which MuJoCo reports a contact [m] */
    double *lever;       /* largest speed of a point per speed of each coordinate [m/rad] or [1] */
    double *q;           /* positions at the end of the last step */
    double free, travel; /* free space [m]; distance travelled in a step at the velocities before it [m] */
    int pause;
} Clearance;

static inline double norm3(const mjtNum *v) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

/* Bound of the distance of the shapes of a body and of all bodies that it carries from its origin [m]. Children come
   after their parents. A carried body that slides without limits has no bound. */
static void extents(const mjModel *m, double *extent)
{
    memset(extent, 0, sizeof(double) * (size_t)m->nbody);
    for (int geom = 0; geom < m->ngeom; geom++) {
        double *of = extent + m->geom_bodyid[geom];
        *of = fmax(*of, norm3(m->geom_pos + 3 * geom) + m->geom_rbound[geom]);
    }
    for (int body = m->nbody - 1; body > 0; body--) {
        double along = norm3(m->body_pos + 3 * body);
        for (int joint = m->body_jntadr[body], k = 0; k < m->body_jntnum[body]; k++, joint++) {
            const mjtNum *range = m->jnt_range + 2 * joint;
            along += 2.0 * norm3(m->jnt_pos + 3 * joint);
            if (m->jnt_type[joint] == mjJNT_SLIDE)
                along += m->jnt_limited[joint] ? fmax(fabs(range[0]), fabs(range[1])) : INFINITY;
        }
        double *carrier = extent + m->body_parentid[body];
        *carrier = fmax(*carrier, along + extent[body]);
    }
}

/* Prepare for a model; `lever` and `q` have room for its nv velocities, nbody bodies, and nq positions. */
static void begin_clearance(Clearance *c, const mjModel *m, double *lever, double *q, double *extent)
{
    *c = (Clearance){.lever = lever, .q = q};
    for (int pair = 0; pair < m->npair; pair++)
        c->reach = fmax(c->reach, fmax(m->pair_margin[pair], m->pair_margin[pair] + m->pair_gap[pair]));
    extents(m, extent);
    for (int dof = 0; dof < m->nv; dof++) {
        const int joint = m->dof_jntid[dof], type = m->jnt_type[joint];
        const int slides = type == mjJNT_SLIDE || (type == mjJNT_FREE && dof < m->jnt_dofadr[joint] + 3);
        lever[dof] = slides ? 1.0 : extent[m->dof_bodyid[dof]] + norm3(m->jnt_pos + 3 * joint);
    }
}

/* Distance that two shapes may approach each other in a step at the present velocities [m]. */
static double travelled(const Clearance *c, const mjModel *m, const mjData *d)
{
    double speed = 0.0;
    for (int dof = 0; dof < m->nv; dof++)
        speed += c->lever[dof] * fabs(d->qvel[dof]);
    return m->opt.timestep * speed;
}

/* Lower bound of the distance of two shapes [m]: exact for capsules and spheres, of enclosing spheres for others. */
static double apart(const mjModel *m, const mjData *d, int a, int b, double enough)
{
    const int geom[2] = {a, b};
    double w[3], axis[2][3], radius[2];
    for (int k = 0; k < 2; k++)
        if (m->geom_type[geom[k]] == mjGEOM_PLANE) {
            const mjtNum *R = d->geom_xmat + 9 * geom[k], *at = d->geom_xpos + 3 * geom[k];
            const mjtNum *of = d->geom_xpos + 3 * geom[1 - k];
            return (of[0] - at[0]) * R[2] + (of[1] - at[1]) * R[5] + (of[2] - at[2]) * R[8]
                   - m->geom_rbound[geom[1 - k]];
        } else if (m->geom_rbound[geom[k]] <= 0.0) {
            return -INFINITY;
        }
    for (int i = 0; i < 3; i++)
        w[i] = d->geom_xpos[3 * a + i] - d->geom_xpos[3 * b + i];
    const double spheres = norm3(w) - m->geom_rbound[a] - m->geom_rbound[b];
    if (spheres >= enough)
        return spheres;
    for (int k = 0; k < 2; k++) {
        const int type = m->geom_type[geom[k]];
        if (type != mjGEOM_CAPSULE && type != mjGEOM_SPHERE)
            return spheres;
        const double half = type == mjGEOM_CAPSULE ? m->geom_size[3 * geom[k] + 1] : 0.0;
        radius[k] = m->geom_size[3 * geom[k]];
        for (int i = 0; i < 3; i++) {
            axis[k][i] = 2.0 * half * d->geom_xmat[9 * geom[k] + 3 * i + 2];
            w[i] += (k == 0 ? -0.5 : 0.5) * axis[k][i];
        }
    }
    double at[2];
    return sqrt(segments_apart(w, axis[0], axis[1], at)) - radius[0] - radius[1];
}

/* Compute the free space from the present places of the shapes, after a search that found no contact. */
static void measure_clearance(Clearance *c, const mjModel *m, const mjData *d)
{
    double least = 1.0;
    for (int pair = 0; pair < m->npair && least > c->reach; pair++)
        least = fmin(least, apart(m, d, m->pair_geom1[pair], m->pair_geom2[pair], least));
    c->free = least - c->reach;
}

/* Return 1 if no pair of shapes can touch in the coming step. */
static int clear_ahead(const Clearance *c) { return c->free - 2.0 * c->travel > CLEARANCE_RESERVE; }

/* Return 1 if MuJoCo need not search contacts at the start of a step; `travel` is set. */
static int begins_clear(Clearance *c, const mjModel *m, const mjData *d)
{
    c->travel = travelled(c, m, d);
    if (memcmp(c->q, d->qpos, sizeof(double) * (size_t)m->nq) != 0)
        c->free = 0.0; /* somebody moved a joint */
    return clear_ahead(c);
}

/* Search again after a step that began without free space, at most once in a while. */
static void renew_clearance(Clearance *c, const mjModel *m, const mjData *d)
{
    if (d->ncon > 0 || c->pause > 0) {
        c->pause -= c->pause > 0;
        return;
    }
    measure_clearance(c, m, d);
    c->pause = clear_ahead(c) ? 0 : CLEARANCE_PAUSE;
}

/* Take the way of a completed step from the free space. */
static void end_clearance(Clearance *c, const mjModel *m, const mjData *d)
{
    c->free -= fmax(c->travel, travelled(c, m, d)) + CLEARANCE_STEP;
    memcpy(c->q, d->qpos, sizeof(double) * (size_t)m->nq);
}

#endif

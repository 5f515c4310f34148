/* Mimic joints. MuJoCo's equality constraint is soft: its error is a ten-thousandth of the acceleration. It is used, so
   that contact and joint stops act on both joints. The law becomes exact by an effort within each stage of a step; the
   remaining error by contact and stops is removed from the velocities at the end of the step.

   G has a row for each mimic joint: 1 at the joint, -multiplier at the joint that it follows. Velocities on the law
   satisfy G v = 0, and efforts G' l keep them there: A dv = f + G' l, with A the mass matrix. */
#ifndef MUJOCO_ROS_CONTROL_MIMIC_H
#define MUJOCO_ROS_CONTROL_MIMIC_H

#include "hric_dynamics/factors.h"

#include <math.h>
#include <mujoco/mjdata.h>
#include <mujoco/mjmodel.h>
#include <string.h>

/* Entries in the data of an equality constraint: coefficients of its polynomial, and the mark of a mimic law. */
enum
{
  OFFSET,
  MULTIPLIER,
  MARK = mjNEQDATA - 1
};

typedef struct
{
  int follower, leader; /* MuJoCo's numbers of the mimic joint and of the joint that it follows */
  double offset, multiplier;
} Law;

/* Read the mimic law of an equality constraint; 0 if the constraint is no mimic law. */
static int take_law(const mjModel* m, int constraint, Law* law)
{
  const mjtNum* data = m->eq_data + (size_t)mjNEQDATA * (size_t)constraint;
  if (m->eq_type[constraint] != mjEQ_JOINT || data[MARK] != 1.0)
    return 0;
  *law = (Law){ m->eq_obj1id[constraint], m->eq_obj2id[constraint], data[OFFSET], data[MULTIPLIER] };
  return 1;
}

/* Read all mimic laws and return their count. No leader is itself a mimic joint. */
static int take_laws(const mjModel* m, Law* laws)
{
  int count = 0;
  for (int i = 0; i < m->neq; i++)
    count += take_law(m, i, laws + count);
  return count;
}

static double violation(const mjModel* m, const Law* law, const double* v)
{
  return v[m->jnt_dofadr[law->follower]] - law->multiplier * v[m->jnt_dofadr[law->leader]];
}

static void add_row(const mjModel* m, const Law* law, double size, double* efforts)
{
  efforts[m->jnt_dofadr[law->follower]] += size;
  efforts[m->jnt_dofadr[law->leader]] -= law->multiplier * size;
}

/* Bring velocities or accelerations v onto the laws by efforts G' l, which are added to `efforts`; A is factored. */
static void constrain(const mjModel* m, int count, const Law* laws, const double* A, double* v, double* efforts)
{
  const int n = m->nv;
  if (count < 1 || n < 1)
    return;
  double W[count * n], S[count * count], l[count];
  memset(W, 0, sizeof W);
  for (int i = 0; i < count; i++)
  {
    add_row(m, &laws[i], 1.0, W + i * n);
    solve(n, A, W + i * n);
    l[i] = -violation(m, &laws[i], v);
    for (int j = 0; j <= i; j++)
      S[i * count + j] = S[j * count + i] = violation(m, &laws[j], W + i * n);
  }
  factor(count, S);
  solve(count, S, l);
  for (int i = 0; i < count; i++)
  {
    add_row(m, &laws[i], l[i], efforts);
    for (int k = 0; k < n; k++)
      v[k] += l[i] * W[i * n + k];
  }
}

/* Bring the state onto the laws at the end of a step, by the impulse that changes the velocities least in terms of
   kinetic energy. n: number of velocities; ahead: time for which the change of velocity also moves the positions [s].
 */
static void settle(const mjModel* m, mjData* d, int n, int count, const Law* laws, const double* A, double ahead,
                   void (*move)(const mjModel*, mjtNum*, const mjtNum*, mjtNum))
{
  double v[n], ignored[n];
  memcpy(v, d->qvel, sizeof v);
  memset(ignored, 0, sizeof ignored);
  constrain(m, count, laws, A, v, ignored);
  for (int k = 0; k < n; k++)
  {
    const double change = v[k] - d->qvel[k];
    d->qvel[k] = v[k];
    v[k] = change;
  }
  move(m, d->qpos, v, ahead);
  for (int i = 0; i < count; i++)
  {
    const Law* law = &laws[i];
    d->qpos[m->jnt_qposadr[law->follower]] = law->offset + law->multiplier * d->qpos[m->jnt_qposadr[law->leader]];
    d->qvel[m->jnt_dofadr[law->follower]] = law->multiplier * d->qvel[m->jnt_dofadr[law->leader]];
  }
}

#endif

/* Joints that mimic others. MuJoCo's equality constraint is a spring beside others: it leaves the law by a
   ten-thousandth of the acceleration. It stays, so that contact and stops meet both joints; what makes the law exact is
   a force within each stage of a step, and what is left by contact and stops is taken out of the speeds at its end.

   With a row of G for each of them, G = [1 at the joint, -multiplier at the one it mimics], speeds on the law have
   G v = 0, and efforts G' l keep them there: A dv = f + G' l with A the mass matrix. */
#ifndef MUJOCO_ROS_CONTROL_MIMIC_H
#define MUJOCO_ROS_CONTROL_MIMIC_H

#include "hric_dynamics/factors.h"

#include <math.h>
#include <mujoco/mjdata.h>
#include <mujoco/mjmodel.h>
#include <string.h>

/* In the data of an equality constraint, its law: multipliers of the powers of a position; and the sign that it is one
 * of ours. */
enum
{
  OFFSET,
  MULTIPLIER,
  MARK = mjNEQDATA - 1
};

typedef struct
{
  int follower, leader; /* numbers of the joints */
  double offset, multiplier;
} Law;

/* The law of an equality constraint; 0 if it is none. */
static int take_law(const mjModel* m, int constraint, Law* law)
{
  const mjtNum* data = m->eq_data + (size_t)mjNEQDATA * (size_t)constraint;
  if (m->eq_type[constraint] != mjEQ_JOINT || data[MARK] != 1.0)
    return 0;
  *law = (Law){ m->eq_obj1id[constraint], m->eq_obj2id[constraint], data[OFFSET], data[MULTIPLIER] };
  return 1;
}

/* All laws; their number. None has a joint as its leader that follows another. */
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

/* Bring speeds or accelerations v on the laws by efforts G' l, which are added to `efforts`; A is factored. */
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

/* State on the laws at the end of a step, by the impulse that takes the least work of it; `ahead`: how long its change
   of the speeds has already moved the positions [s]. */
static void settle(const mjModel* m, mjData* d, int count, const Law* laws, const double* A, double ahead,
                   void (*move)(const mjModel*, mjtNum*, const mjtNum*, mjtNum))
{
  const int n = m->nv;
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

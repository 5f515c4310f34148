// clang-format Language: C
/* Friction of a joint in all compiled plants: a sigmoid of the velocity for sliding, with parameters from
   `Losses.sigmoid_row`, and a bristle that holds a joint at rest, with parameters from `Losses.bristle_row`. The module
   hric_control.plants.friction explains the law. */
#ifndef HRIC_DYNAMICS_FRICTION_H
#define HRIC_DYNAMICS_FRICTION_H

#include <math.h>

enum { FRICTION_SIZE, FRICTION_SLOPE, FRICTION_OFFSET, FRICTION_REST, FRICTION_ROW };

/* Sigmoid friction at a speed, which is subtracted from the effort: a (tanh(b (speed + c)) - d), row: a, b, c, d. */
static inline double friction(const double row[FRICTION_ROW], double speed)
{
    return row[FRICTION_SIZE] * (tanh(row[FRICTION_SLOPE] * (speed + row[FRICTION_OFFSET])) - row[FRICTION_REST]);
}

enum { BRISTLE_BREAKAWAY, BRISTLE_GIVE, BRISTLE_FADE, BRISTLE_ROW };

/* Largest deflection of a bristle at a speed, relative to that at rest. */
static inline double bristle_bound(const double row[BRISTLE_ROW], double speed)
{
    const double ratio = speed / row[BRISTLE_FADE], rest = 1.0 - ratio * ratio;
    return rest > 0.0 ? rest * rest : 0.0;
}

/* Deflection of a bristle, relative to the largest one at rest, after a step that ended with `speed`. */
static inline double bristle_bent(const double row[BRISTLE_ROW], double step, double bend, double speed)
{
    const double bound = bristle_bound(row, speed), trial = bend + step * speed / row[BRISTLE_GIVE];
    return trial < -bound ? -bound : trial > bound ? bound : trial;
}

/* Friction of a bristle in a step that ends with speed v, subtracted from the effort: the result + slope v. The bristle
   sticks and is deflected by the motion in the step, unless the deflection that results from the expected speed exceeds
   its bound: then it slips. The method is implicit, so that it is stable with any stiffness. */
static inline double bristle(const double row[BRISTLE_ROW], double step, double bend, double expected, double *slope)
{
    const double bound = bristle_bound(row, expected), trial = bend + step * expected / row[BRISTLE_GIVE];
    const int slips = fabs(trial) > bound;
    *slope = slips ? 0.0 : row[BRISTLE_BREAKAWAY] * step / row[BRISTLE_GIVE];
    return row[BRISTLE_BREAKAWAY] * (slips ? copysign(bound, trial) : bend);
}

#endif

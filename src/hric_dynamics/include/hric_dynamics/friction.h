// clang-format Language: C
/* The identified friction of a joint, as all compiled plants take it: the sliding part by `sigmoid_row`, what holds a
   joint that hardly moves by `bristle_row`, both in hric_control.plants, whose module friction.py explains the law. */
#ifndef HRIC_DYNAMICS_FRICTION_H
#define HRIC_DYNAMICS_FRICTION_H

#include <math.h>

enum { FRICTION_SIZE, FRICTION_SLOPE, FRICTION_OFFSET, FRICTION_REST, FRICTION_ROW };

/* What it takes away at a speed: a (tanh(b (speed + c)) - d) with the row a, b, c, d. */
static inline double friction(const double row[FRICTION_ROW], double speed)
{
    return row[FRICTION_SIZE] * (tanh(row[FRICTION_SLOPE] * (speed + row[FRICTION_OFFSET])) - row[FRICTION_REST]);
}

enum { BRISTLE_BREAKAWAY, BRISTLE_GIVE, BRISTLE_FADE, BRISTLE_ROW };

/* Largest bend of a bristle at a speed, as a share of that at rest. */
static inline double bristle_bound(const double row[BRISTLE_ROW], double speed)
{
    const double ratio = speed / row[BRISTLE_FADE], rest = 1.0 - ratio * ratio;
    return rest > 0.0 ? rest * rest : 0.0;
}

/* The bend after a step that ended with a speed. */
static inline double bristle_bent(const double row[BRISTLE_ROW], double step, double bend, double speed)
{
    const double bound = bristle_bound(row, speed), trial = bend + step * speed / row[BRISTLE_GIVE];
    return trial < -bound ? -bound : trial > bound ? bound : trial;
}

/* What the bristle takes away in a step that ends with speed v: the result + slope v. It sticks, and bends by the way
   of the step, unless the speed that is expected at the end is too much for it: implicit, so that any stiffness is
   stable. */
static inline double bristle(const double row[BRISTLE_ROW], double step, double bend, double expected, double *slope)
{
    const double bound = bristle_bound(row, expected), trial = bend + step * expected / row[BRISTLE_GIVE];
    const int slips = fabs(trial) > bound;
    *slope = slips ? 0.0 : row[BRISTLE_BREAKAWAY] * step / row[BRISTLE_GIVE];
    return row[BRISTLE_BREAKAWAY] * (slips ? copysign(bound, trial) : bend);
}

#endif

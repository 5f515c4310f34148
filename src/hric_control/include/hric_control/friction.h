// clang-format Language: C
/* The identified friction of a joint, as all compiled plants take it: `sigmoid_row` in hric_control.plants. */
#ifndef HRIC_CONTROL_FRICTION_H
#define HRIC_CONTROL_FRICTION_H

#include <math.h>

enum { FRICTION_SIZE, FRICTION_SLOPE, FRICTION_OFFSET, FRICTION_REST, FRICTION_ROW };

/* What it takes away at a speed: a (tanh(b (speed + c)) - d) with the row a, b, c, d. */
static inline double friction(const double row[FRICTION_ROW], double speed)
{
    return row[FRICTION_SIZE] * (tanh(row[FRICTION_SLOPE] * (speed + row[FRICTION_OFFSET])) - row[FRICTION_REST]);
}

#endif

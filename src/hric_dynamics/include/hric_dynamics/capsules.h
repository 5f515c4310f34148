// clang-format Language: C
/* Distances of capsules. */
#ifndef HRIC_DYNAMICS_CAPSULES_H
#define HRIC_DYNAMICS_CAPSULES_H

#include "hric_dynamics/rigid_body.h"

#include <math.h>

/* Return x within 0 to `most`. */
static inline double within(double x, double most) { return fmin(fmax(x, 0.0), most); }

/* Return the squared distance of two segments [m^2], NAN if a number is not finite. w: from the begin of the second to
 * that of the first; u, v: the segments; at: result, positions of the nearest points along both, 0 to 1. The minimum in
 * the plane, clamped to the square one coordinate after the other, is that in the square; for parallel segments one of
 * the ends of the first gives it (Ericson, Real-Time Collision Detection, 5.1.9). */
static inline double segments_apart(const double w[3], const double u[3], const double v[3], double at[2])
{
    const double uu = dot(u, u), vv = dot(v, v), uv = dot(u, v), uw = dot(u, w), vw = dot(v, w);
    const double determinant = uu * vv - uv * uv;
    const double starts[3] = {determinant > 0.0 ? within((uv * vw - vv * uw) / determinant, 1.0) : 0.0, 0.0, 1.0};
    double best = INFINITY;
    at[0] = at[1] = 0.0;
    for (int k = 0; k < 3; k++) {
        const double t = vv > 0.0 ? within((uv * starts[k] + vw) / vv, 1.0) : 0.0;
        const double s = uu > 0.0 ? within((uv * t - uw) / uu, 1.0) : 0.0;
        double square = 0.0;
        for (int i = 0; i < 3; i++) {
            const double across = w[i] + s * u[i] - t * v[i];
            square += across * across;
        }
        if (square < best) {
            best = square;
            at[0] = s;
            at[1] = t;
        }
    }
    return isfinite(uu + vv + dot(w, w)) ? best : NAN;
}

#endif

// clang-format Language: C
/* Rotations as unit quaternions (x, y, z, w), and vectors; what the functions return is in geometry/quaternions.py. An
 * output must not be an input.
 *
 * The order of the operations is part of the interface: runs are compared bit by bit. */
#ifndef HRIC_CORE_QUATERNIONS_H
#define HRIC_CORE_QUATERNIONS_H

#include <math.h>

static inline void product(const double a[4], const double b[4], double ab[4])
{
    ab[0] = a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1];
    ab[1] = a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0];
    ab[2] = a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3];
    ab[3] = a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2];
}

static inline void rotated(const double q[4], const double v[3], double out[3])
{
    const double x = q[0], y = q[1], z = q[2], w = q[3], a = v[0], b = v[1], c = v[2];
    const double u0 = 2.0 * (y * c - z * b), u1 = 2.0 * (z * a - x * c), u2 = 2.0 * (x * b - y * a);
    out[0] = a + w * u0 + y * u2 - z * u1;
    out[1] = b + w * u1 + z * u0 - x * u2;
    out[2] = c + w * u2 + x * u1 - y * u0;
}

static inline void rotation_vector(const double q[4], double v[3])
{
    const double sign = q[3] >= 0.0 ? 1.0 : -1.0, x = sign * q[0], y = sign * q[1], z = sign * q[2];
    const double sine = sqrt(x * x + y * y + z * z);
    const double scale = sine < 1e-9 ? 2.0 : 2.0 * atan2(sine, sign * q[3]) / sine;
    v[0] = scale * x;
    v[1] = scale * y;
    v[2] = scale * z;
}

static inline void from_rotation_vector(const double v[3], double q[4])
{
    const double angle = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    const double scale = angle < 1e-9 ? 0.5 : sin(0.5 * angle) / angle;
    for (int i = 0; i < 3; i++)
        q[i] = scale * v[i];
    q[3] = cos(0.5 * angle);
}

static inline void difference(const double a[4], const double b[4], double v[3])
{
    const double back[4] = {-b[0], -b[1], -b[2], b[3]};
    double turn[4];
    product(a, back, turn);
    rotation_vector(turn, v);
}

static inline void interpolated(const double start[4], const double goal[4], double share, double q[4])
{
    double v[3], turn[4];
    difference(goal, start, v);
    for (int i = 0; i < 3; i++)
        v[i] = share * v[i];
    from_rotation_vector(v, turn);
    product(turn, start, q);
}

/* Compute the rotation matrix of a unit quaternion, row by row. */
static inline void rotation_matrix(const double q[4], double R[9])
{
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    const double rows[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - z * w),     2 * (x * z + y * w),
                            2 * (x * y + z * w),     1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
                            2 * (x * z - y * w),     2 * (y * z + x * w),     1 - 2 * (x * x + y * y)};
    for (int i = 0; i < 9; i++)
        R[i] = rows[i];
}

/* R: row by row. */
static inline void from_elements(const double R[9], double q[4])
{
    const double rows[4][4] = {{1.0 + R[0] - R[4] - R[8], R[3] + R[1], R[2] + R[6], R[7] - R[5]},
                               {R[3] + R[1], 1.0 - R[0] + R[4] - R[8], R[7] + R[5], R[2] - R[6]},
                               {R[2] + R[6], R[7] + R[5], 1.0 - R[0] - R[4] + R[8], R[3] - R[1]},
                               {R[7] - R[5], R[2] - R[6], R[3] - R[1], 1.0 + R[0] + R[4] + R[8]}};
    int k = 0;
    for (int i = 1; i < 4; i++)
        if (rows[i][i] > rows[k][k])
            k = i;
    const double *row = rows[k];
    const double norm = sqrt(row[0] * row[0] + row[1] * row[1] + row[2] * row[2] + row[3] * row[3]);
    for (int i = 0; i < 4; i++)
        q[i] = row[i] / norm;
}

#endif

/* Model library of a Franka arm, which libfranka up to 0.17 downloads from the control box: 30 functions under
 * libfranka's names.
 *
 * The built library has no parameters. `library_for` copies the file and writes an arm's parameters behind the
 * marker. */
#include "franka_sim/model_library/arm.h"

#define EXPORT __attribute__((visibility("default")))

/* Not static, not const: the compiler must not assume that the numbers are those of the source. */
extern struct Parameters {
    char marker[16];
    Arm arm;
} parameters;
struct Parameters parameters = {.marker = "HRIC arm 187 f64"};

static const Arm *const ARM = &parameters.arm;
static const double NO_GRAVITY[3], NO_INERTIA[9];

static void frame_pose(const double *q, int frame, const double *F_T_EE, double *out)
{
    Pose poses[JOINTS + 1], tool;
    forward(ARM, q, poses);
    if (F_T_EE)
        beyond(&poses[FLANGE], F_T_EE, &tool);
    write_pose(F_T_EE ? &tool : &poses[frame], out);
}

static void frame_jacobian(const double *q, int frame, const double *F_T_EE, int body, double *out)
{
    Pose poses[JOINTS + 1], tool;
    forward(ARM, q, poses);
    if (F_T_EE)
        beyond(&poses[FLANGE], F_T_EE, &tool);
    write_jacobian(poses, frame < JOINTS ? frame + 1 : JOINTS, F_T_EE ? &tool : &poses[frame], body, out);
}

#define POSE(n)                                                                                                        \
    EXPORT void O_T_J##n(const double *q, double *out) { frame_pose(q, n - 1, NULL, out); }
#define JACOBIANS(n)                                                                                                   \
    EXPORT void O_J_J##n(const double *q, double *out) { frame_jacobian(q, n - 1, NULL, 0, out); }                     \
    EXPORT void Ji_J_J##n(const double *q, double *out) { frame_jacobian(q, n - 1, NULL, 1, out); }

POSE(1)
POSE(2)
POSE(3)
POSE(4)
POSE(5)
POSE(6)
POSE(7)
POSE(8)
JACOBIANS(2)
JACOBIANS(3)
JACOBIANS(4)
JACOBIANS(5)
JACOBIANS(6)
JACOBIANS(7)
JACOBIANS(8)

EXPORT void O_T_J9(const double *q, const double *F_T_EE, double *out) { frame_pose(q, FLANGE, F_T_EE, out); }
EXPORT void O_J_J9(const double *q, const double *F_T_EE, double *out) { frame_jacobian(q, FLANGE, F_T_EE, 0, out); }
EXPORT void Ji_J_J9(const double *q, const double *F_T_EE, double *out) { frame_jacobian(q, FLANGE, F_T_EE, 1, out); }

/* The first joint's own Jacobian does not depend on its position. */
EXPORT void O_J_J1(double *out) { frame_jacobian(STILL, 0, NULL, 0, out); }
EXPORT void Ji_J_J1(double *out) { frame_jacobian(STILL, 0, NULL, 1, out); }

EXPORT void M_NE(const double *q, const double *I_total, double m_total, const double *F_x_Ctotal, double *out)
{
    const Load load = {I_total, m_total, F_x_Ctotal};
    Spatial S[JOINTS];
    Body bodies[JOINTS];
    place_bodies(ARM, &load, q, S, bodies);
    mass_matrix(JOINTS, PARENT, S, bodies, out);
}

/* Coriolis torque C(q, dq) dq. */
EXPORT void c_NE(const double *q, const double *dq, const double *I_total, double m_total, const double *F_x_Ctotal,
                 double *out)
{
    const Load load = {I_total, m_total, F_x_Ctotal};
    Spatial S[JOINTS];
    Body bodies[JOINTS];
    place_bodies(ARM, &load, q, S, bodies);
    newton_euler(S, bodies, NO_GRAVITY, dq, STILL, out);
}

/* Torque that holds the arm against gravity; gravity: in the base frame [m/s^2]. */
EXPORT void g_NE(const double *q, const double *gravity, double m_total, const double *F_x_Ctotal, double *out)
{
    const Load load = {NO_INERTIA, m_total, F_x_Ctotal};
    Spatial S[JOINTS];
    Body bodies[JOINTS];
    place_bodies(ARM, &load, q, S, bodies);
    accumulate(JOINTS, PARENT, bodies);
    for (int i = 0; i < JOINTS; i++)
        out[i] = holding_effort(&S[i], &bodies[i], gravity);
}

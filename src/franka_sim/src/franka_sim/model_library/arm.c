/* The model library of a Franka arm, as libfranka up to 0.17 downloads it from the control box: 30 functions under libfranka's names.
 *
 * The generated constants JOINT_R, JOINT_P, LINK_MASS, LINK_COM, LINK_INERTIA, FLANGE_R, FLANGE_P stand above this text when it is compiled.
 *
 * Interface: poses are 16 numbers, Jacobians 42 (6 x 7, linear above angular), mass matrices 49, all column-major; m, rad, kg, N m, s.
 * Inside: rotations are row-major; spatial quantities are expressed at the base origin in base axes, as in Featherstone,
 * Rigid Body Dynamics Algorithms (2008), ch. 5 and 6. */
#include <math.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))
#define JOINTS 7
#define FLANGE 7 /* index behind the links */

typedef struct {
  double R[9], p[3];
} Pose;

/* A twist (angular w, velocity v of the point at the base origin) or a wrench (moment n about the base origin in w, force f in v). */
typedef struct {
  double w[3], v[3];
} Spatial;

/* Mass, first moment of mass and inertia about the base origin. */
typedef struct {
  double m, h[3], I[9];
} Body;

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void add_cross(const double a[3], const double b[3], double sum[3]) {
  sum[0] += a[1] * b[2] - a[2] * b[1];
  sum[1] += a[2] * b[0] - a[0] * b[2];
  sum[2] += a[0] * b[1] - a[1] * b[0];
}

static void rotate(const double R[9], const double x[3], double y[3]) {
  for (int i = 0; i < 3; ++i) y[i] = dot(R + 3 * i, x);
}

static void rotate_back(const double R[9], const double x[3], double y[3]) {
  for (int i = 0; i < 3; ++i) y[i] = R[i] * x[0] + R[3 + i] * x[1] + R[6 + i] * x[2];
}

static void multiply(const double A[9], const double B[9], double AB[9]) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) AB[3 * i + j] = A[3 * i] * B[j] + A[3 * i + 1] * B[3 + j] + A[3 * i + 2] * B[6 + j];
}

static void compose(const Pose *parent, const double R[9], const double p[3], Pose *child) {
  multiply(parent->R, R, child->R);
  rotate(parent->R, p, child->p);
  for (int i = 0; i < 3; ++i) child->p[i] += parent->p[i];
}

/* Poses of the seven links and of the flange in the base frame; every joint turns about its z axis. */
static void forward(const double q[JOINTS], Pose poses[JOINTS + 1]) {
  Pose before = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 0}};
  for (int i = 0; i < JOINTS; ++i) {
    const double c = cos(q[i]), s = sin(q[i]), turn[9] = {c, -s, 0, s, c, 0, 0, 0, 1};
    double R[9];
    multiply(JOINT_R[i], turn, R);
    compose(&before, R, JOINT_P[i], &poses[i]);
    before = poses[i];
  }
  compose(&before, FLANGE_R, FLANGE_P, &poses[FLANGE]);
}

/* Pose of a frame beyond the flange, given as 16 column-major numbers in the flange frame. */
static void beyond_flange(const Pose *flange, const double F_T_X[16], Pose *pose) {
  double R[9], p[3];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) R[3 * i + j] = F_T_X[4 * j + i];
    p[i] = F_T_X[12 + i];
  }
  compose(flange, R, p, pose);
}

static void joint_axis(const Pose *link, double z[3]) {
  for (int i = 0; i < 3; ++i) z[i] = link->R[3 * i + 2];
}

static void write_pose(const Pose *pose, double out[16]) {
  for (int j = 0; j < 3; ++j) {
    for (int i = 0; i < 3; ++i) out[4 * j + i] = pose->R[3 * i + j];
    out[4 * j + 3] = 0.0;
    out[12 + j] = pose->p[j];
  }
  out[15] = 1.0;
}

/* Jacobian of the origin of `frame`, which the first `moving` joints carry; in the frame's own axes if `body`, else in base axes. */
static void write_jacobian(const Pose links[JOINTS], int moving, const Pose *frame, int body, double out[42]) {
  memset(out, 0, 42 * sizeof(double));
  for (int j = 0; j < moving; ++j) {
    double z[3], arm[3], linear[3] = {0, 0, 0};
    joint_axis(&links[j], z);
    for (int i = 0; i < 3; ++i) arm[i] = frame->p[i] - links[j].p[i];
    add_cross(z, arm, linear);
    if (body) {
      rotate_back(frame->R, linear, out + 6 * j);
      rotate_back(frame->R, z, out + 6 * j + 3);
    } else {
      memcpy(out + 6 * j, linear, sizeof linear);
      memcpy(out + 6 * j + 3, z, sizeof z);
    }
  }
}

static void frame_pose(const double *q, int frame, const double *F_T_EE, double *out) {
  Pose poses[JOINTS + 1], tool;
  forward(q, poses);
  if (F_T_EE) beyond_flange(&poses[FLANGE], F_T_EE, &tool);
  write_pose(F_T_EE ? &tool : &poses[frame], out);
}

static void frame_jacobian(const double *q, int frame, const double *F_T_EE, int body, double *out) {
  Pose poses[JOINTS + 1], tool;
  forward(q, poses);
  if (F_T_EE) beyond_flange(&poses[FLANGE], F_T_EE, &tool);
  write_jacobian(poses, frame < JOINTS ? frame + 1 : JOINTS, F_T_EE ? &tool : &poses[frame], body, out);
}

/* Add a rigid body, given in the frame `pose`: inertia about the centre of mass, axes of that frame; Steiner's theorem to the base origin. */
static void add_body(const Pose *pose, double m, const double com[3], const double I[9], Body *sum) {
  double c[3], RI[9], transposed[9], turned[9];
  rotate(pose->R, com, c);
  for (int i = 0; i < 3; ++i) c[i] += pose->p[i];
  multiply(pose->R, I, RI);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) transposed[3 * i + j] = pose->R[3 * j + i];
  multiply(RI, transposed, turned);
  sum->m += m;
  for (int i = 0; i < 3; ++i) {
    sum->h[i] += m * c[i];
    for (int j = 0; j < 3; ++j) sum->I[3 * i + j] += turned[3 * i + j] + m * ((i == j ? dot(c, c) : 0.0) - c[i] * c[j]);
  }
}

/* The seven moving bodies; what is mounted at the flange and the payload come together as `total`, in the flange frame, on the last. */
static void moving_bodies(const Pose poses[JOINTS + 1], const double I_total[9], double m_total, const double com_total[3], Body bodies[JOINTS]) {
  memset(bodies, 0, JOINTS * sizeof(Body));
  for (int i = 0; i < JOINTS; ++i) add_body(&poses[i], LINK_MASS[i], LINK_COM[i], LINK_INERTIA[i], &bodies[i]);
  add_body(&poses[FLANGE], m_total, com_total, I_total, &bodies[JOINTS - 1]);
}

/* Turns each body into itself plus all bodies further out. */
static void accumulate_outward(Body bodies[JOINTS]) {
  for (int i = JOINTS - 2; i >= 0; --i) {
    bodies[i].m += bodies[i + 1].m;
    for (int k = 0; k < 3; ++k) bodies[i].h[k] += bodies[i + 1].h[k];
    for (int k = 0; k < 9; ++k) bodies[i].I[k] += bodies[i + 1].I[k];
  }
}

/* Unit twists of the joints. */
static void joint_twists(const Pose links[JOINTS], Spatial S[JOINTS]) {
  memset(S, 0, JOINTS * sizeof(Spatial));
  for (int i = 0; i < JOINTS; ++i) {
    joint_axis(&links[i], S[i].w);
    add_cross(links[i].p, S[i].w, S[i].v);
  }
}

/* Momentum of a body in a twist, or force for an acceleration. */
static void apply_inertia(const Body *body, const Spatial *twist, Spatial *wrench) {
  rotate(body->I, twist->w, wrench->w);
  add_cross(body->h, twist->v, wrench->w);
  for (int i = 0; i < 3; ++i) wrench->v[i] = body->m * twist->v[i];
  add_cross(twist->w, body->h, wrench->v);
}

static double power(const Spatial *twist, const Spatial *wrench) { return dot(twist->w, wrench->w) + dot(twist->v, wrench->v); }

#define POSE(n) \
  EXPORT void O_T_J##n(const double *q, double *out) { frame_pose(q, n - 1, 0, out); }
#define JACOBIANS(n) \
  EXPORT void O_J_J##n(const double *q, double *out) { frame_jacobian(q, n - 1, 0, 0, out); } \
  EXPORT void Ji_J_J##n(const double *q, double *out) { frame_jacobian(q, n - 1, 0, 1, out); }

POSE(1) POSE(2) POSE(3) POSE(4) POSE(5) POSE(6) POSE(7) POSE(8)
JACOBIANS(2) JACOBIANS(3) JACOBIANS(4) JACOBIANS(5) JACOBIANS(6) JACOBIANS(7) JACOBIANS(8)

EXPORT void O_T_J9(const double *q, const double *F_T_EE, double *out) { frame_pose(q, FLANGE, F_T_EE, out); }
EXPORT void O_J_J9(const double *q, const double *F_T_EE, double *out) { frame_jacobian(q, FLANGE, F_T_EE, 0, out); }
EXPORT void Ji_J_J9(const double *q, const double *F_T_EE, double *out) { frame_jacobian(q, FLANGE, F_T_EE, 1, out); }

/* The first joint's own Jacobian does not depend on where the joint stands. */
static const double ZERO[JOINTS];
EXPORT void O_J_J1(double *out) { frame_jacobian(ZERO, 0, 0, 0, out); }
EXPORT void Ji_J_J1(double *out) { frame_jacobian(ZERO, 0, 0, 1, out); }

/* Mass matrix: composite bodies, M_ij = S_i . (I_c(max(i, j)) S_j). */
EXPORT void M_NE(const double *q, const double *I_total, double m_total, const double *F_x_Ctotal, double *out) {
  Pose poses[JOINTS + 1];
  Body bodies[JOINTS];
  Spatial S[JOINTS], momentum;
  forward(q, poses);
  joint_twists(poses, S);
  moving_bodies(poses, I_total, m_total, F_x_Ctotal, bodies);
  accumulate_outward(bodies);
  for (int j = 0; j < JOINTS; ++j) {
    apply_inertia(&bodies[j], &S[j], &momentum);
    for (int i = 0; i <= j; ++i) out[JOINTS * j + i] = out[JOINTS * i + j] = power(&S[i], &momentum);
  }
}

/* Wrench that the velocities ask of a body: I a + v x* I v. */
static void velocity_wrench(const Body *body, const Spatial *v, const Spatial *a, Spatial *wrench) {
  Spatial momentum;
  apply_inertia(body, a, wrench);
  apply_inertia(body, v, &momentum);
  add_cross(v->w, momentum.w, wrench->w);
  add_cross(v->v, momentum.v, wrench->w);
  add_cross(v->w, momentum.v, wrench->v);
}

/* C(q, dq) dq: inverse dynamics (recursive Newton-Euler) without gravity and joint acceleration. */
EXPORT void c_NE(const double *q, const double *dq, const double *I_total, double m_total, const double *F_x_Ctotal, double *out) {
  Pose poses[JOINTS + 1];
  Body bodies[JOINTS];
  Spatial S[JOINTS], v = {{0}, {0}}, a = {{0}, {0}}, wrench[JOINTS], sum = {{0}, {0}};
  forward(q, poses);
  joint_twists(poses, S);
  moving_bodies(poses, I_total, m_total, F_x_Ctotal, bodies);
  for (int i = 0; i < JOINTS; ++i) {
    Spatial step;
    for (int k = 0; k < 3; ++k) {
      step.w[k] = S[i].w[k] * dq[i];
      step.v[k] = S[i].v[k] * dq[i];
      v.w[k] += step.w[k];
      v.v[k] += step.v[k];
    }
    add_cross(v.w, step.w, a.w);
    add_cross(v.v, step.w, a.v);
    add_cross(v.w, step.v, a.v);
    velocity_wrench(&bodies[i], &v, &a, &wrench[i]);
  }
  for (int i = JOINTS - 1; i >= 0; --i) {
    for (int k = 0; k < 3; ++k) {
      sum.w[k] += wrench[i].w[k];
      sum.v[k] += wrench[i].v[k];
    }
    out[i] = power(&S[i], &sum);
  }
}

/* Torque that holds the arm against gravity, given in the base frame [m/s^2]. */
EXPORT void g_NE(const double *q, const double *gravity, double m_total, const double *F_x_Ctotal, double *out) {
  static const double none[9];
  Pose poses[JOINTS + 1];
  Body bodies[JOINTS];
  Spatial S[JOINTS];
  forward(q, poses);
  joint_twists(poses, S);
  moving_bodies(poses, none, m_total, F_x_Ctotal, bodies);
  accumulate_outward(bodies);
  for (int i = 0; i < JOINTS; ++i) {
    Spatial weight = {{0}, {0}};
    for (int k = 0; k < 3; ++k) weight.v[k] = bodies[i].m * gravity[k];
    add_cross(bodies[i].h, gravity, weight.w);
    out[i] = -power(&S[i], &weight);
  }
}

/* The kinematic fields of the state at once, inverse dynamics, and the estimate of the external torque; compiled behind model_library/arm.c, whose
 * functions it uses. compiled_arm.py and compiled_fields.py have the same layouts. */
#include <float.h>

#define N 6

/* What one state is made of; members named as in the state. Column-major. */
typedef struct {
  /* each cycle */
  double q[7], q_d[7], dq[7], dq_d[7], ddq_d[7], tau_J[7], tau_before[7], tau_J_d[7];
  double tau_ext_hat_filtered[7], joint_collision[7], cartesian_collision[6], generated; /* generated: not 0 with a Cartesian generator */
  /* told; thresholds of contact: nominal, and while the desired motion accelerates */
  double period, least_singular_value, elbow_flip, torques[7], forces[6], torques_acceleration[7], forces_acceleration[6];
  double F_T_EE[16], EE_T_K[16], F_T_NE[16], NE_T_EE[16], m_ee, F_x_Cee[3], I_ee[9], m_load, F_x_Cload[3], I_load[9], O_ddP_O[3];
  /* computed */
  double O_T_EE[16], O_F_ext_hat_K[6], K_F_ext_hat_K[6], joint_contact[7], cartesian_contact[6], dtau_J[7], elbow[2];
  /* computed, where no Cartesian generator writes them */
  double O_T_EE_d[16], O_T_EE_c[16], O_dP_EE_d[6], elbow_d[2], elbow_c[2], O_dP_EE_c[6], O_ddP_EE_c[6], delbow_c[2], ddelbow_c[2];
  double wrench_noise[6]; /* added to O_F_ext_hat_K; zero where nothing is noisy */
} Fields;

/* A - shift 1 = L L' (Cholesky; Golub and Van Loan, Matrix Computations, 4th ed., sec. 4.2); 0 if that is not positive definite: A has an
 * eigenvalue that is not above the shift. */
static int factor(const double A[N][N], double shift, double L[N][N]) {
  for (int j = 0; j < N; ++j)
    for (int i = j; i < N; ++i) {
      double sum = i == j ? A[i][i] - shift : A[i][j];
      for (int k = 0; k < j; ++k) sum -= L[i][k] * L[j][k];
      if (i > j)
        L[i][j] = sum / L[j][j];
      else if (sum > 0.0)
        L[j][j] = sqrt(sum);
      else
        return 0;
    }
  return 1;
}

/* The wrench F of least squares in tau = J^T F, that is (J J^T) F = J tau; zero, and 0 returned, where J has a singular value below `least`.
 * J: column-major. */
static int wrench(const double J[42], const double tau[JOINTS], double least, double F[N]) {
  double A[N][N], L[N][N];
  memset(F, 0, N * sizeof(double));
  for (int i = 0; i < N; ++i)
    for (int j = 0; j <= i; ++j) {
      A[i][j] = 0.0;
      for (int k = 0; k < JOINTS; ++k) A[i][j] += J[N * k + i] * J[N * k + j];
    }
  if (!factor(A, least * least, L) || !factor(A, 0.0, L)) return 0;
  for (int i = 0; i < N; ++i) {
    for (int k = 0; k < JOINTS; ++k) F[i] += J[N * k + i] * tau[k];
    for (int k = 0; k < i; ++k) F[i] -= L[i][k] * F[k];
    F[i] /= L[i][i];
  }
  for (int i = N - 1; i >= 0; --i) {
    for (int k = i + 1; k < N; ++k) F[i] -= L[k][i] * F[k];
    F[i] /= L[i][i];
  }
  return 1;
}

static double side(const Fields *f, const double q[JOINTS]) { return q[3] > f->elbow_flip ? 1.0 : -1.0; }

static void measured(Fields *f) {
  double J[42];
  Pose poses[JOINTS + 1], tool, stiffness;
  forward(f->q, poses);
  beyond_flange(&poses[FLANGE], f->F_T_EE, &tool);
  write_pose(&tool, f->O_T_EE);
  beyond_flange(&tool, f->EE_T_K, &stiffness);
  write_jacobian(poses, JOINTS, &stiffness, 0, J);
  if (wrench(J, f->tau_ext_hat_filtered, f->least_singular_value, f->O_F_ext_hat_K))
    for (int i = 0; i < N; ++i) f->O_F_ext_hat_K[i] += f->wrench_noise[i];
  rotate_back(stiffness.R, f->O_F_ext_hat_K, f->K_F_ext_hat_K);
  rotate_back(stiffness.R, f->O_F_ext_hat_K + 3, f->K_F_ext_hat_K + 3);
}

static void desired(Fields *f) {
  double J[42];
  Pose poses[JOINTS + 1], tool;
  forward(f->q_d, poses);
  beyond_flange(&poses[FLANGE], f->F_T_EE, &tool);
  write_pose(&tool, f->O_T_EE_d);
  memcpy(f->O_T_EE_c, f->O_T_EE_d, sizeof f->O_T_EE_c);
  write_jacobian(poses, JOINTS, &tool, 0, J);
  for (int i = 0; i < N; ++i) {
    f->O_dP_EE_d[i] = 0.0;
    for (int k = 0; k < JOINTS; ++k) f->O_dP_EE_d[i] += J[N * k + i] * f->dq_d[k];
    f->O_dP_EE_c[i] = f->O_ddP_EE_c[i] = 0.0;
  }
  f->elbow_d[0] = f->elbow_c[0] = f->q_d[2];
  f->elbow_d[1] = f->elbow_c[1] = side(f, f->q_d);
  for (int i = 0; i < 2; ++i) f->delbow_c[i] = f->ddelbow_c[i] = 0.0;
}

EXPORT void fields(Fields *f) {
  int accelerating = 0;
  measured(f);
  f->elbow[0] = f->q[2];
  f->elbow[1] = side(f, f->q);
  if (f->generated == 0.0) desired(f);
  for (int i = 0; i < JOINTS; ++i) accelerating |= f->ddq_d[i] != 0.0;
  const double *torques = accelerating ? f->torques_acceleration : f->torques, *forces = accelerating ? f->forces_acceleration : f->forces;
  for (int i = 0; i < JOINTS; ++i) {
    f->joint_contact[i] = fabs(f->tau_ext_hat_filtered[i]) > torques[i];
    f->dtau_J[i] = (f->tau_J[i] - f->tau_before[i]) / f->period;
  }
  for (int i = 0; i < N; ++i) f->cartesian_contact[i] = fabs(f->K_F_ext_hat_K[i]) > forces[i];
}

/* Compute the fields, then the numbers of a datagram, each from its place in them. */
EXPORT void numbers_d(Fields *f, const int *places, int n, double *out) {
  fields(f);
  for (int i = 0; i < n; ++i) out[i] = ((const double *)f)[places[i]];
}

/* The same in 32 bits; what is too large becomes the largest number. */
EXPORT void numbers_f(Fields *f, const int *places, int n, float *out) {
  fields(f);
  for (int i = 0; i < n; ++i) {
    const double x = ((const double *)f)[places[i]];
    out[i] = x > FLT_MAX ? FLT_MAX : x < -FLT_MAX ? -FLT_MAX : (float)x;
  }
}

typedef struct {
  double gravity[3]; /* in the base frame */
  double inertia[9], mass, com[3]; /* of all that is mounted at the flange, in its frame, inertia about the centre of mass */
} Told;

static const double STILL[JOINTS];

/* M(q) ddq + C(q, dq) dq + g(q): inverse dynamics (recursive Newton-Euler), gravity as an acceleration of the base. */
static void newton_euler(const Told *told, const double q[JOINTS], const double dq[JOINTS], const double ddq[JOINTS], double out[JOINTS]) {
  Pose poses[JOINTS + 1];
  Body bodies[JOINTS];
  Spatial S[JOINTS], v = {{0}, {0}}, a = {{0}, {0}}, wrench[JOINTS], sum = {{0}, {0}};
  for (int k = 0; k < 3; ++k) a.v[k] = -told->gravity[k];
  forward(q, poses);
  joint_twists(poses, S);
  moving_bodies(poses, told->inertia, told->mass, told->com, bodies);
  for (int i = 0; i < JOINTS; ++i) {
    Spatial step;
    for (int k = 0; k < 3; ++k) {
      step.w[k] = S[i].w[k] * dq[i];
      step.v[k] = S[i].v[k] * dq[i];
      v.w[k] += step.w[k];
      v.v[k] += step.v[k];
      a.w[k] += S[i].w[k] * ddq[i];
      a.v[k] += S[i].v[k] * ddq[i];
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

/* in: q, dq, ddq */
EXPORT void inverse_dynamics(const Told *told, const double in[3 * JOINTS], double out[JOINTS]) {
  newton_euler(told, in, in + JOINTS, in + 2 * JOINTS, out);
}

typedef struct {
  double q[7], dq[7], q_now[7], dq_now[7], tau[7], friction[7], value[7]; /* each cycle */
  double gravity[7]; /* at q_now */
  double rate, gain; /* told once */
} Estimate;

/* One cycle of estimates.ExternalTorque, and the gravity of the next one. */
EXPORT void external_torque(const Told *told, Estimate *e) {
  double ddq[JOINTS], expected[JOINTS];
  for (int i = 0; i < JOINTS; ++i) ddq[i] = e->rate * (e->dq_now[i] - e->dq[i]);
  newton_euler(told, e->q, e->dq, ddq, expected);
  for (int i = 0; i < JOINTS; ++i) e->value[i] += e->gain * (e->tau[i] - expected[i] - e->friction[i] - e->value[i]);
  newton_euler(told, e->q_now, STILL, STILL, e->gravity);
}

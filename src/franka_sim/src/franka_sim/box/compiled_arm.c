/* The kinematic fields of the state at once, and inverse dynamics; compiled behind model_library/arm.c, whose functions it uses.
 *
 * fields:
 *
 * in:  q 7, q_d 7, dq_d 7, tau_ext 7, thresholds of contact: torques 7, wrench on K 6, F_T_EE 16, F_T_K 16, the least singular value 1
 * out: O_T_EE 16, O_T_EE_d 16, O_dP_EE_d 6, O_F_ext 6, K_F_ext 6, joint_contact 7, cartesian_contact 6 */
#define N 6
#define SWEEPS 30
#define ROUNDING 1e-30

/* Eigenvalues (on the diagonal of A) and eigenvectors (columns of V) of a symmetric matrix by cyclic Jacobi rotations
 * (Golub and Van Loan, Matrix Computations, 4th ed., sec. 8.5). */
static void eigen(double A[N][N], double V[N][N]) {
  for (int i = 0; i < N; ++i)
    for (int j = 0; j < N; ++j) V[i][j] = i == j;
  for (int sweep = 0; sweep < SWEEPS; ++sweep) {
    double off = 0.0, diagonal = 0.0;
    for (int i = 0; i < N; ++i) {
      diagonal += A[i][i] * A[i][i];
      for (int j = 0; j < i; ++j) off += A[i][j] * A[i][j];
    }
    if (!(off > ROUNDING * diagonal)) return;
    for (int p = 0; p < N; ++p)
      for (int q = p + 1; q < N; ++q) {
        if (A[p][q] == 0.0) continue;
        const double tau = (A[q][q] - A[p][p]) / (2.0 * A[p][q]);
        const double t = (tau >= 0.0 ? 1.0 : -1.0) / (fabs(tau) + sqrt(1.0 + tau * tau)), c = 1.0 / sqrt(1.0 + t * t), s = t * c;
        for (int k = 0; k < N; ++k) {
          const double a = A[k][p], b = A[k][q], v = V[k][p], w = V[k][q];
          A[k][p] = c * a - s * b;
          A[k][q] = s * a + c * b;
          V[k][p] = c * v - s * w;
          V[k][q] = s * v + c * w;
        }
        for (int k = 0; k < N; ++k) {
          const double a = A[p][k], b = A[q][k];
          A[p][k] = c * a - s * b;
          A[q][k] = s * a + c * b;
        }
      }
  }
}

/* The wrench F of least squares in tau = J^T F, that is (J J^T) F = J tau; zero where J has a singular value below `least`. J: column-major. */
static void wrench(const double J[42], const double tau[JOINTS], double least, double F[N]) {
  double A[N][N], V[N][N], Jtau[N];
  memset(F, 0, N * sizeof(double));
  for (int i = 0; i < N; ++i) {
    Jtau[i] = 0.0;
    for (int k = 0; k < JOINTS; ++k) Jtau[i] += J[N * k + i] * tau[k];
    for (int j = 0; j < N; ++j) {
      A[i][j] = 0.0;
      for (int k = 0; k < JOINTS; ++k) A[i][j] += J[N * k + i] * J[N * k + j];
    }
  }
  eigen(A, V);
  for (int k = 0; k < N; ++k)
    if (!(A[k][k] >= least * least)) return;
  for (int k = 0; k < N; ++k) {
    double along = 0.0;
    for (int i = 0; i < N; ++i) along += V[i][k] * Jtau[i];
    for (int i = 0; i < N; ++i) F[i] += V[i][k] * along / A[k][k];
  }
}

EXPORT void fields(const double *in, double *out) {
  const double *q = in, *q_d = in + 7, *dq_d = in + 14, *tau = in + 21, *torques = in + 28, *forces = in + 35;
  const double *F_T_EE = in + 41, *F_T_K = in + 57, least = in[73];
  double J[42], *twist = out + 32, *O_F = out + 38, *K_F = out + 44, *joint_contact = out + 50, *cartesian_contact = out + 57;
  Pose poses[JOINTS + 1], tool;
  forward(q_d, poses);
  beyond_flange(&poses[FLANGE], F_T_EE, &tool);
  write_pose(&tool, out + 16);
  write_jacobian(poses, JOINTS, &tool, 0, J);
  for (int i = 0; i < N; ++i) {
    twist[i] = 0.0;
    for (int k = 0; k < JOINTS; ++k) twist[i] += J[N * k + i] * dq_d[k];
  }
  forward(q, poses);
  beyond_flange(&poses[FLANGE], F_T_EE, &tool);
  write_pose(&tool, out);
  beyond_flange(&poses[FLANGE], F_T_K, &tool);
  write_jacobian(poses, JOINTS, &tool, 0, J);
  wrench(J, tau, least, O_F);
  rotate_back(tool.R, O_F, K_F);
  rotate_back(tool.R, O_F + 3, K_F + 3);
  for (int i = 0; i < JOINTS; ++i) joint_contact[i] = fabs(tau[i]) > torques[i];
  for (int i = 0; i < N; ++i) cartesian_contact[i] = fabs(K_F[i]) > forces[i];
}

/* M(q) ddq + C(q, dq) dq + g(q): inverse dynamics (recursive Newton-Euler), gravity as an acceleration of the base.
 *
 * in: q 7, dq 7, ddq 7, gravity in the base frame 3, then of all that is mounted at the flange, in its frame: inertia about the centre of mass 9, mass 1,
 * centre of mass 3;  out: torque 7 */
EXPORT void inverse_dynamics(const double *in, double *out) {
  const double *q = in, *dq = in + 7, *ddq = in + 14, *gravity = in + 21, *I_total = in + 24, m_total = in[33], *com_total = in + 34;
  Pose poses[JOINTS + 1];
  Body bodies[JOINTS];
  Spatial S[JOINTS], v = {{0}, {0}}, a = {{0}, {0}}, wrench[JOINTS], sum = {{0}, {0}};
  for (int k = 0; k < 3; ++k) a.v[k] = -gravity[k];
  forward(q, poses);
  joint_twists(poses, S);
  moving_bodies(poses, I_total, m_total, com_total, bodies);
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

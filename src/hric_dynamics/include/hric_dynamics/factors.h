// clang-format Language: C
/* Linear equations with a symmetric positive definite matrix, row-major, for the compiled models.
 *
 * The order of the operations is part of the interface: runs are compared bit by bit. */
#ifndef HRIC_DYNAMICS_FACTORS_H
#define HRIC_DYNAMICS_FACTORS_H

/* Factorise A = L D L' in place (square-root-free Cholesky): L is stored below the diagonal, 1 / D on it. */
static inline void factor(int n, double *A)
{
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < i; j++)
            for (int k = 0; k < j; k++)
                A[i * n + j] -= A[i * n + k] * A[j * n + k];
        for (int j = 0; j < i; j++) {
            double c = A[i * n + j];
            A[i * n + j] = c * A[j * n + j];
            A[i * n + i] -= c * A[i * n + j];
        }
        A[i * n + i] = 1.0 / A[i * n + i];
    }
}

/* Solve A x = b in place: x contains b before and the solution afterwards; A: its factors, by `factor`. */
static inline void solve(int n, const double *A, double *x)
{
    for (int i = 0; i < n; i++)
        for (int k = 0; k < i; k++)
            x[i] -= A[i * n + k] * x[k];
    for (int i = n - 1; i >= 0; i--) {
        x[i] *= A[i * n + i];
        for (int k = i + 1; k < n; k++)
            x[i] -= A[k * n + i] * x[k];
    }
}

#endif

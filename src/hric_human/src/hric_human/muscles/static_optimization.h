// clang-format Language: C
/* Least-squares activations that produce a required joint torque; the problem is explained in static_optimization.py.

   The dual problem has a closed form: activation i is b_i . x clipped to its bounds, where b_i is the torque of muscle
   i at full activation and x has one number per joint. x minimises a convex function that is quadratic between the
   points at which a muscle reaches a bound; its gradient is the produced torque minus the required torque. Newton's
   method with an exact line search needs a few steps. A small multiple of the squared distance from the last x is added
   to the function (proximal point method), so that every step exists, even if all muscles of a joint are at their
   bounds; the centre of this term follows x until the term has no effect. If the torque is out of reach, the residual
   converges to the shortest possible one, and x goes to infinity along the residual. */
#ifndef HRIC_HUMAN_STATIC_OPTIMIZATION_H
#define HRIC_HUMAN_STATIC_OPTIMIZATION_H

#include "hric_core/python_numbers.h"

#include <float.h>
#include <math.h>

/* Weight of the proximal term, in units of the strongest muscle's torque: initial value, factor at each move of the
   centre (not if the torque is out of reach), and minimum, which is also the smallest accepted pivot. */
#define DISTANCE 1e-6
#define NEARER 0.1
#define SMALLEST 1e-12
#define ROUNDING 1e-13   /* relative rounding error of sums over all muscles */
#define SAME 1e-9        /* difference up to which two activations count as equal */
#define ON_FACE 1e-7     /* cosine up to which a muscle's torque counts as orthogonal to the missing torque */
#define INDEPENDENT 1e-9 /* share of a vector that must be orthogonal to the basis to extend it */

enum { STEPS = 200, SEARCHES = 60, MOVES = 60, REFINEMENTS = 3, JOINTS = 32 };

/* A problem of k muscles and m joints, in units of the strongest muscle's torque. */
typedef struct {
    int k, m;
    double size;                     /* magnitude of the summed terms: required torque plus torques of all muscles */
    double distance;                 /* weight of the proximal term */
    double *b, *low, *wanted;        /* (k, m), (k), (m): wanted is the torque required of muscles not settled */
    int (*moved)[2];                 /* (k): first joint that a muscle moves, and one past the last one */
    double *activation, *x, *centre; /* (k), (m), (m): centre of the proximal term */
    double *gradient, *step, *H;     /* (m), (m), (m, m) */
    double *along, *at;              /* (k): b . step, b . x */
    unsigned char *settled;          /* (k): 1 if the muscle is fixed at the bound stored in `activation` */
} Task;

static size_t row(const Task *t) { return sizeof(double) * (size_t)t->m; }

static double dot(const double *a, const double *b, int n)
{
    double sum = 0.0;
    for (int i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

/* Return the product of b of muscle i and a vector; the joints that it does not move would add zeros. */
static double projected(const Task *t, int i, const double *x)
{
    const int first = t->moved[i][0];
    return dot(t->b + i * t->m + first, x + first, t->moved[i][1] - first);
}

/* Add a multiple of b of muscle i to a vector. */
static void add(const Task *t, int i, double factor, double *out)
{
    for (int r = t->moved[i][0]; r < t->moved[i][1]; r++)
        out[r] += factor * t->b[i * t->m + r];
}

static double within(double value, double low) { return value < low ? low : value > 1.0 ? 1.0 : value; }

static int is_free(const Task *t, int i, double value) { return !t->settled[i] && value > t->low[i] && value < 1.0; }

/* Cholesky factorisation H = L L^T of a positive semidefinite H, in place. A pivot that is not larger than `least`
   becomes infinite, so that its unknown becomes 0 (a joint that no free muscle moves). Returns 0 if there was one. */
static int factor(double *H, int m, double least)
{
    int regular = 1;
    for (int i = 0; i < m; i++)
        for (int j = 0; j <= i; j++) {
            const double left = H[i * m + j] - dot(H + i * m, H + j * m, j);
            if (i != j)
                H[i * m + j] = left / H[j * m + j];
            else if (left > least)
                H[i * m + i] = sqrt(left);
            else {
                H[i * m + i] = INFINITY;
                regular = 0;
            }
        }
    return regular;
}

static void back_substitute(const double *L, int m, double *v)
{
    for (int i = 0; i < m; i++)
        v[i] = (v[i] - dot(L + i * m, v, i)) / L[i * m + i];
    for (int i = m - 1; i >= 0; i--) {
        for (int j = i + 1; j < m; j++)
            v[i] -= L[j * m + i] * v[j];
        v[i] /= L[i * m + i];
    }
}

/* Compute H, the lower triangle of the sum of b b^T over the muscles between their bounds, plus distance times I. */
static void curvature(Task *t, double distance)
{
    memset(t->H, 0, sizeof(double) * (size_t)(t->m * t->m));
    for (int i = 0; i < t->k; i++) {
        const double *b = t->b + i * t->m;
        if (is_free(t, i, t->at[i]))
            for (int r = t->moved[i][0]; r < t->moved[i][1]; r++)
                for (int c = t->moved[i][0]; c <= r; c++)
                    t->H[r * t->m + c] += b[r] * b[c];
    }
    for (int r = 0; r < t->m; r++)
        t->H[r * t->m + r] += distance;
}

/* Compute the torque of the muscles that are not settled, minus the torque required of them. */
static void excess(const Task *t, const double *activation, double *out)
{
    for (int r = 0; r < t->m; r++)
        out[r] = -t->wanted[r];
    for (int i = 0; i < t->k; i++)
        if (!t->settled[i])
            add(t, i, activation[i], out);
}

/* ---- a step ---- */

static void evaluate(Task *t)
{
    for (int i = 0; i < t->k; i++)
        if (!t->settled[i]) {
            t->at[i] = projected(t, i, t->x);
            t->activation[i] = within(t->at[i], t->low[i]);
        }
    excess(t, t->activation, t->gradient);
    for (int r = 0; r < t->m; r++)
        t->gradient[r] += t->distance * (t->x[r] - t->centre[r]);
}

/* Return the directional derivative of the function along the step, after a share of it; *slope: second derivative. */
static double derivative(const Task *t, double share, double constant, double distance, double *slope)
{
    double sum = constant + share * distance;
    *slope = distance;
    for (int i = 0; i < t->k; i++) {
        const double value = t->at[i] + share * t->along[i];
        if (t->settled[i])
            continue;
        sum += t->along[i] * within(value, t->low[i]);
        if (is_free(t, i, value))
            *slope += t->along[i] * t->along[i];
    }
    return sum;
}

/* Return the share of the step that minimises the function along it: root of a rising, piecewise linear function. */
static double search(Task *t)
{
    double constant = -dot(t->wanted, t->step, t->m), slope, low = 0.0, high = INFINITY, share = 1.0;
    const double distance = t->distance * dot(t->step, t->step, t->m), first = dot(t->gradient, t->step, t->m);
    for (int r = 0; r < t->m; r++)
        constant += t->distance * (t->x[r] - t->centre[r]) * t->step[r];
    for (int i = 0; i < t->k; i++)
        t->along[i] = t->settled[i] ? 0.0 : projected(t, i, t->step);
    for (int n = 0; n < SEARCHES; n++) {
        const double value = derivative(t, share, constant, distance, &slope);
        if (fabs(value) <= 1e-12 * fabs(first))
            break;
        if (value < 0.0)
            low = share;
        else
            high = share;
        share -= value / slope;
        if (!(share > low && share < high))
            share = 0.5 * (low + high);
    }
    return share;
}

/* Minimise the function by Newton's method; return the number of steps. */
static int minimise(Task *t)
{
    int steps = 0;
    for (evaluate(t); steps < STEPS; steps++, evaluate(t)) {
        const double before = sqrt(dot(t->x, t->x, t->m)), noise = (ROUNDING + DBL_EPSILON * before) * t->size;
        if (dot(t->gradient, t->gradient, t->m) <= noise * noise)
            break;
        curvature(t, t->distance);
        factor(t->H, t->m, 0.0);
        for (int r = 0; r < t->m; r++)
            t->step[r] = -t->gradient[r];
        back_substitute(t->H, t->m, t->step);
        const double share = search(t);
        for (int r = 0; r < t->m; r++)
            t->x[r] += share * t->step[r];
    }
    return steps;
}

/* ---- the end ---- */

/* Compute the torque required of the muscles between their bounds, minus the torque that they produce at x. */
static void left_to_free(const Task *t, const double *x, double *out)
{
    memcpy(out, t->wanted, row(t));
    for (int i = 0; i < t->k; i++) {
        if (!t->settled[i])
            add(t, i, -(is_free(t, i, t->at[i]) ? projected(t, i, x) : t->activation[i]), out);
    }
}

/* Return 1 if at x the same muscles are at the same bounds as now, and the others between their bounds. */
static int same_muscles(const Task *t, const double *x)
{
    for (int i = 0; i < t->k; i++) {
        const double value = projected(t, i, x), kept = within(value, t->low[i]);
        const double error = kept - (is_free(t, i, t->at[i]) ? value : t->activation[i]);
        if (!t->settled[i] && fabs(error) > 10.0 * ROUNDING)
            return 0;
    }
    return 1;
}

/* Return 1 if the activations at x equal the current ones up to rounding. */
static int same_activations(const Task *t, const double *x)
{
    for (int i = 0; i < t->k; i++)
        if (is_free(t, i, t->at[i]) && fabs(within(projected(t, i, x), t->low[i]) - t->activation[i]) > SAME)
            return 0;
    return 1;
}

/* Solve for x with the muscles that are now between their bounds, so that the result does not depend on the start.
   Returns 0 if x would move other muscles off their bounds, or if these muscles do not determine x. given: 1 if the
   activations already produce the required torque; then it is enough that x does not change them. */
static int settle(Task *t, int given)
{
    double x[JOINTS], left[JOINTS];
    memset(x, 0, row(t));
    curvature(t, 0.0);
    const int regular = factor(t->H, t->m, SMALLEST);
    if (!regular && !given)
        return 0;
    for (int n = 0; n < REFINEMENTS; n++) {
        left_to_free(t, x, left);
        back_substitute(t->H, t->m, left);
        for (int r = 0; r < t->m; r++)
            x[r] += left[r];
    }
    left_to_free(t, x, left);
    if (!(sqrt(dot(left, left, t->m)) <= 10.0 * ROUNDING * t->size))
        return 0;
    if (given ? !same_activations(t, x) : !same_muscles(t, x))
        return 0;
    for (int i = 0; i < t->k; i++)
        if (is_free(t, i, t->at[i]))
            t->activation[i] = within(projected(t, i, x), t->low[i]);
    if (regular)
        memcpy(t->x, x, row(t));
    return 1;
}

/* Return 1 if no activations within the bounds produce the required torque: in the direction of the missing torque,
   even the largest torque of all muscles together is too small. */
static int out_of_reach(const Task *t, const double *missing)
{
    double most = 0.0;
    for (int i = 0; i < t->k; i++) {
        const double pull = projected(t, i, missing);
        most += t->settled[i] ? 0.0 : pull > 0.0 ? pull : t->low[i] * pull;
    }
    const double length = sqrt(dot(missing, missing, t->m));
    return dot(t->wanted, missing, t->m) - most > 10.0 * ROUNDING * t->size * length;
}

/* Return 1 if all muscles whose torque has a component along the missing torque are at their bounds: then no reachable
   torque is nearer to the required one. */
static int is_nearest(const Task *t, const double *missing)
{
    const double length = sqrt(dot(missing, missing, t->m));
    for (int i = 0; i < t->k; i++) {
        const double *b = t->b + i * t->m, pull = projected(t, i, missing);
        if (!t->settled[i] && fabs(pull) > ON_FACE * sqrt(dot(b, b, t->m)) * length
            && t->activation[i] != (pull > 0.0 ? 1.0 : t->low[i]))
            return 0;
    }
    return 1;
}

/* Subtract from v its components along the rows of an orthonormal basis. */
static void reduce(const double *basis, int rows, int m, double *v)
{
    for (int twice = 0; twice < 2; twice++)
        for (int n = 0; n < rows; n++) {
            const double part = dot(basis + n * m, v, m);
            for (int r = 0; r < m; r++)
                v[r] -= part * basis[n * m + r];
        }
}

/* For a torque out of reach, restrict the problem to the face of the reachable set that is nearest to it. Muscles with
   a torque component along the missing torque are at their bounds there, and become settled. The required torque of the
   other muscles is projected onto the space that they span; the rest is added to the shortfall. Returns the number of
   the other muscles. */
static int go_to_face(Task *t, const double *missing, double *shortfall)
{
    double basis[JOINTS * JOINTS], left[JOINTS];
    const double length = sqrt(dot(missing, missing, t->m));
    int rows = 0, others = 0;
    for (int i = 0; i < t->k; i++) {
        double *b = t->b + i * t->m, pull = projected(t, i, missing), strength = sqrt(dot(b, b, t->m));
        if (t->settled[i])
            continue;
        if (fabs(pull) > ON_FACE * strength * length) {
            t->settled[i] = 1;
            t->activation[i] = pull > 0.0 ? 1.0 : t->low[i];
            add(t, i, -t->activation[i], t->wanted);
            continue;
        }
        others++;
        memcpy(left, b, row(t));
        reduce(basis, rows, t->m, left);
        const double fresh = sqrt(dot(left, left, t->m));
        if (rows < t->m && fresh > INDEPENDENT * strength && strength > 0.0) {
            for (int r = 0; r < t->m; r++)
                basis[rows * t->m + r] = left[r] / fresh;
            rows++;
        }
    }
    memcpy(left, t->wanted, row(t));
    reduce(basis, rows, t->m, left);
    for (int r = 0; r < t->m; r++) {
        shortfall[r] += left[r];
        t->wanted[r] -= left[r];
    }
    return others;
}

/* Compute the missing torque: required of the muscles not settled, minus produced by them. Returns its norm. */
static double miss(const Task *t, double *missing)
{
    excess(t, t->activation, missing);
    for (int r = 0; r < t->m; r++)
        missing[r] = -missing[r];
    return sqrt(dot(missing, missing, t->m));
}

/* Restart at x = 0, so that the result does not depend on the caller's start value. */
static void restart(Task *t)
{
    memset(t->x, 0, row(t));
    t->distance = DISTANCE;
}

/* Compute the activations of the muscles that are not settled. Returns 1 if they produce the required torque up to
   rounding, 0 if it is out of reach; the missing torque is then the shortest possible. */
static int reach(Task *t, double *missing, int *steps)
{
    double before[JOINTS];
    int beyond = 0;
    t->distance = DISTANCE;
    memset(missing, 0, row(t));
    for (int n = 0; n < MOVES; n++) {
        memcpy(t->centre, t->x, row(t));
        memcpy(before, missing, row(t));
        *steps += minimise(t);
        if (!beyond && settle(t, 0))
            return 1;
        const double length = miss(t, missing);
        if (length <= ROUNDING * t->size) {
            settle(t, 1);
            return 1;
        }
        if (!beyond && out_of_reach(t, missing)) {
            beyond = 1;
            restart(t);
        } else if (!beyond)
            t->distance = fmax(SMALLEST, NEARER * t->distance);
        else {
            for (int r = 0; r < t->m; r++)
                before[r] -= missing[r];
            if (sqrt(dot(before, before, t->m)) <= 0.1 * ON_FACE * length && is_nearest(t, missing))
                return 0;
        }
    }
    return !beyond;
}

/* Solve the whole problem; return the number of steps. x: start value, replaced by the start value of the next call. */
static int solve_task(Task *t, double *x, double *shortfall)
{
    double missing[JOINTS];
    int steps = 0;
    memset(shortfall, 0, row(t));
    memcpy(t->x, x, row(t));
    for (int face = 0; face <= t->m && !reach(t, missing, &steps); face++) {
        restart(t);
        if (go_to_face(t, missing, shortfall) == 0)
            break;
    }
    memcpy(x, t->x, row(t));
    for (int i = 0; i < t->k; i++) {
        double *a = t->activation + i;
        *a = *a - t->low[i] < ROUNDING ? t->low[i] : 1.0 - *a < ROUNDING ? 1.0 : *a;
    }
    return steps;
}

/* ---- the problem in the units of the caller ---- */

enum { ARMS, GAIN, LEAST, TORQUE, START, ACTIVATION, SHORTFALL, ARRAYS };

/* Compute the torque of all muscles at full activation, in units of the strongest muscle's torque. Returns that unit: 0
   if no muscle has a torque, NaN if an input is not finite. */
static double scale(Task *t, const double *arms, const double *gain)
{
    double strongest = 0.0, finite = 0.0;
    for (int i = 0; i < t->k; i++) {
        t->moved[i][0] = t->moved[i][1] = 0;
        for (int r = 0; r < t->m; r++) {
            const double torque = t->b[i * t->m + r] = gain[i] * arms[i * t->m + r];
            if (torque != 0.0 && t->moved[i][1] == 0)
                t->moved[i][0] = r;
            if (torque != 0.0)
                t->moved[i][1] = r + 1;
        }
        const double square = projected(t, i, t->b + i * t->m);
        strongest = square > strongest ? square : strongest;
        finite += 0.0 * (square + t->low[i]);
    }
    strongest = sqrt(strongest) + finite;
    for (int i = 0; strongest > 0.0 && i < t->k; i++)
        for (int r = t->moved[i][0]; r < t->moved[i][1]; r++)
            t->b[i * t->m + r] /= strongest;
    return strongest;
}

/* Solve the problem of these arrays; the last three are written: the start value of the next call, the activations, and
   the shortfall. Returns the number of steps, or -1 with a Python error set. */
static int optimise(int k, int m, double *const *array)
{
    const size_t K = (size_t)k, M = (size_t)m;
    double *memory = zeroed(K * M + 2 * K + 5 * M + M * M + 2 * K, sizeof(double)); /* the last ones: moved, settled */
    if (memory == NULL)
        return -1;
    Task t = {.k = k, .m = m, .low = array[LEAST], .activation = array[ACTIVATION], .b = memory};
    t.along = t.b + K * M, t.at = t.along + K, t.wanted = t.at + K, t.x = t.wanted + M, t.centre = t.x + M;
    t.gradient = t.centre + M, t.step = t.gradient + M, t.H = t.step + M;
    t.moved = (int (*)[2])(t.H + M * M), t.settled = (unsigned char *)(t.moved + K);
    const double unit = scale(&t, array[ARMS], array[GAIN]), by = unit > 0.0 ? unit : 1.0;
    double finite = unit;
    for (int r = 0; r < m; r++) {
        t.wanted[r] = array[TORQUE][r] / by;
        finite += 0.0 * t.wanted[r];
    }
    int steps = -1;
    if (isfinite(finite)) {
        t.size = sqrt(dot(t.wanted, t.wanted, m));
        for (int i = 0; i < k; i++)
            t.size += sqrt(projected(&t, i, t.b + i * m));
        if (t.size == 0.0)
            t.size = 1.0;
        for (int r = 0; r < m; r++)
            array[START][r] *= by;
        steps = solve_task(&t, array[START], array[SHORTFALL]);
        for (int r = 0; r < m; r++) {
            array[START][r] /= by;
            array[SHORTFALL][r] *= by;
        }
    } else
        PyErr_SetString(PyExc_ValueError, "an input is not finite");
    PyMem_Free(memory);
    return steps;
}

#endif

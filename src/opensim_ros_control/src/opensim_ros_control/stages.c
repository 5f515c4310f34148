/* Compiled part of stages.py: arithmetic of a step on numpy arrays. Matrices are multiplied and solved by scipy's BLAS
   and LAPACK, through the function pointers that scipy offers to compiled code. */
#include "hric_core/python_numbers.h"
#include "hric_dynamics/friction.h"

#define NPY_NO_DEPRECATED_API NPY_1_7_API_VERSION
#include <numpy/arrayobject.h>

typedef void Multiply(const char *trans, const int *m, const int *n, const double *alpha, const double *A,
                      const int *lda, const double *x, const int *incx, const double *beta, double *y, const int *incy);
typedef void Solve(const char *uplo, const int *n, const int *nrhs, double *A, const int *lda, double *b,
                   const int *ldb, int *info);

/* Address of a function from a Python capsule, with the signatures that are needed. */
typedef union {
    void *data;
    Multiply *multiply;
    Solve *solve;
} Address;

static Multiply *dgemv;
static Solve *dposv;

/* Data of an array that must have a given size; NULL with a Python error set. */
static double *numbers(PyObject *object, npy_intp size)
{
    PyArrayObject *array = (PyArrayObject *)object;
    if (!PyArray_Check(object) || PyArray_TYPE(array) != NPY_DOUBLE || !PyArray_IS_C_CONTIGUOUS(array)) {
        PyErr_SetString(PyExc_TypeError, "a contiguous array of float64 is needed");
        return NULL;
    }
    if (PyArray_SIZE(array) != size) {
        PyErr_Format(PyExc_ValueError, "%zd numbers are needed, got %zd", (Py_ssize_t)size,
                     (Py_ssize_t)PyArray_SIZE(array));
        return NULL;
    }
    return PyArray_DATA(array);
}

/* Data of arrays that must have these sizes; 0 with a Python error set. A negative size means that an error is set. */
static int take_arrays(PyObject *const *given, int count, const npy_intp *sizes, double **values)
{
    for (int i = 0; i < count; i++)
        if (sizes[i] < 0 || (values[i] = numbers(given[i], sizes[i])) == NULL)
            return 0;
    return 1;
}

/* Number of elements of an array; -1 with a Python error set. */
static npy_intp length(PyObject *object)
{
    if (PyArray_Check(object))
        return PyArray_SIZE((PyArrayObject *)object);
    PyErr_SetString(PyExc_TypeError, "an array is needed");
    return -1;
}

/* New array of shape (n,) or (n, n), and its data; NULL with a Python error set. */
static PyObject *make(int dimensions, npy_intp n, double **values)
{
    npy_intp shape[2] = {n, n};
    PyObject *made = PyArray_SimpleNew(dimensions, shape, NPY_DOUBLE);
    *values = made == NULL ? NULL : PyArray_DATA((PyArrayObject *)made);
    return made;
}

/* ---- input ---- */

/* Array over foreign memory, given the addresses of its first and last number. */
FUNCTION(memory)
{
    if (!expect(count, 3, "memory(first, last, size)"))
        return NULL;
    double *first = PyLong_AsVoidPtr(given[0]), *last = PyErr_Occurred() ? NULL : PyLong_AsVoidPtr(given[1]);
    const npy_intp size = PyErr_Occurred() ? 0 : PyLong_AsSsize_t(given[2]);
    if (PyErr_Occurred())
        return NULL;
    if (first == NULL || last - first != size - 1) {
        PyErr_Format(PyExc_ValueError, "%zd numbers are not in a row", (Py_ssize_t)size);
        return NULL;
    }
    return PyArray_SimpleNewFromData(1, &size, NPY_DOUBLE, first);
}

FUNCTION(cut)
{
    if (!expect(count, 3, "cut(values, low, high)"))
        return NULL;
    const Py_ssize_t n = PySequence_Size(given[0]);
    double low[n > 0 ? n : 1], high[n > 0 ? n : 1], *value;
    if (n < 0 || !take(given[1], n, low) || !take(given[2], n, high))
        return NULL;
    PyObject *made = make(1, n, &value);
    if (made == NULL || !take(given[0], n, value)) {
        Py_XDECREF(made);
        return NULL;
    }
    for (Py_ssize_t i = 0; i < n; i++)
        value[i] = value[i] < low[i] ? low[i] : value[i] > high[i] ? high[i] : value[i];
    return Py_BuildValue("NN", list(value, n), made);
}

/* ---- equations of motion ---- */

FUNCTION(rubbed)
{
    if (!expect(count, 3, "rubbed(tau, u, rows)"))
        return NULL;
    enum { TAU, U, ROWS, VECTORS };
    const npy_intp n = length(given[0]);
    double *x[VECTORS], *left;
    if (!take_arrays(given, VECTORS, (npy_intp[]){n, n, n * FRICTION_ROW}, x))
        return NULL;
    PyObject *made = make(1, n, &left);
    for (npy_intp i = 0; made != NULL && i < n; i++)
        left[i] = x[TAU][i] - friction(x[ROWS] + i * FRICTION_ROW, x[U][i]);
    return made;
}

FUNCTION(gripped)
{
    enum { TAU, ROTORS, U, BEND, ROWS, VECTORS };
    if (!expect(count, 7, "gripped(tau, rotors, u, bend, rows, before, step)"))
        return NULL;
    const double before = PyFloat_AsDouble(given[5]), step = PyFloat_AsDouble(given[6]);
    const npy_intp n = PyErr_Occurred() ? -1 : length(given[0]);
    double *x[VECTORS], *left, *inertia;
    if (!take_arrays(given, VECTORS, (npy_intp[]){n, n, n, n, n * BRISTLE_ROW}, x))
        return NULL;
    PyObject *leaving = make(1, n, &left);
    PyObject *leaning = leaving == NULL ? NULL : make(1, n, &inertia);
    if (leaning == NULL) {
        Py_XDECREF(leaving);
        return NULL;
    }
    for (npy_intp i = 0; i < n; i++) {
        const double *row = x[ROWS] + i * BRISTLE_ROW, u = x[U][i];
        double slope = 0.0, hold = 0.0;
        if (row[BRISTLE_BREAKAWAY] != 0.0) {
            x[BEND][i] = bristle_bent(row, before, x[BEND][i], u);
            hold = bristle(row, step, x[BEND][i], u, &slope);
        }
        left[i] = x[TAU][i] - hold - slope * u;
        inertia[i] = x[ROTORS][i] + step * slope;
    }
    return Py_BuildValue("NN", leaving, leaning);
}

FUNCTION(balance)
{
    enum { MASSES, ROTORS, ACCELERATION, TAU, VECTORS };
    if (!expect(count, VECTORS, "balance(M, rotors, a, tau)"))
        return NULL;
    const npy_intp n = length(given[1]);
    double *x[VECTORS], *A, *drive;
    if (!take_arrays(given, VECTORS, (npy_intp[]){n < 0 ? n : n * n, n, n, n}, x))
        return NULL;
    PyObject *inertia = make(2, n, &A);
    PyObject *driving = inertia == NULL ? NULL : make(1, n, &drive);
    if (driving == NULL) {
        Py_XDECREF(inertia);
        return NULL;
    }
    const int size = (int)n, one = 1;
    const double unit = 1.0, nothing = 0.0;
    dgemv("T", &size, &size, &unit, x[MASSES], &size, x[ACCELERATION], &one, &nothing, drive, &one);
    memcpy(A, x[MASSES], (size_t)(n * n) * sizeof(double));
    for (npy_intp i = 0; i < n; i++) {
        A[i * n + i] += x[ROTORS][i];
        drive[i] += x[TAU][i];
    }
    return Py_BuildValue("NN", inertia, driving);
}

/* Copy a row-major matrix in LAPACK's column-major order. */
static void turn(const double *from, npy_intp rows, npy_intp columns, double *to)
{
    for (npy_intp i = 0; i < rows; i++)
        for (npy_intp j = 0; j < columns; j++)
            to[j * rows + i] = from[i * columns + j];
}

/* Solve A x = b for k columns in place: x has b on entry and the solution on return, shape (k, n). Returns 1 if A is
   positive definite. */
static int solved(const double *A, npy_intp n, npy_intp k, double *factor, double *x)
{
    const int size = (int)n, columns = (int)k;
    int info = 0;
    turn(A, n, n, factor);
    dposv("U", &size, &columns, factor, &size, x, &size, &info);
    return info == 0;
}

FUNCTION(solve)
{
    if (!expect(count, 2, "solve(A, b)"))
        return NULL;
    const npy_intp size = length(given[1]);
    const npy_intp n = size <= 0 ? 0 : PyArray_DIM((PyArrayObject *)given[1], 0), k = n == 0 ? 0 : size / n;
    const double *A = size < 0 ? NULL : numbers(given[0], n * n);
    const double *b = A == NULL ? NULL : numbers(given[1], size);
    if (b == NULL)
        return NULL;
    PyArrayObject *shape = (PyArrayObject *)given[1];
    PyObject *made = PyArray_SimpleNew(PyArray_NDIM(shape), PyArray_DIMS(shape), NPY_DOUBLE);
    double *work = PyMem_Malloc((size_t)(n * n + size + 1) * sizeof(double));
    if (made == NULL || work == NULL) {
        Py_XDECREF(made);
        PyMem_Free(work);
        return PyErr_NoMemory();
    }
    double *x = work + n * n;
    turn(b, n, k, x);
    const int well = solved(A, n, k, work, x);
    turn(x, k, n, PyArray_DATA((PyArrayObject *)made));
    PyMem_Free(work);
    if (well)
        return made;
    Py_DECREF(made);
    Py_RETURN_NONE;
}

/* ---- the state ---- */

FUNCTION(rate)
{
    if (!expect(count, 2, "rate(y, x)"))
        return NULL;
    const npy_intp size = length(given[0]), n = size < 0 ? -1 : length(given[1]);
    if (n > size / 2)
        PyErr_Format(PyExc_ValueError, "y has %zd numbers, too few for x", (Py_ssize_t)size);
    double *x[2], *values;
    if (PyErr_Occurred() || !take_arrays(given, 2, (npy_intp[]){size, n}, x))
        return NULL;
    PyObject *made = make(1, size, &values);
    if (made == NULL)
        return NULL;
    memcpy(values, x[0] + n, (size_t)n * sizeof(double));
    memcpy(values + n, x[1], (size_t)n * sizeof(double));
    memset(values + 2 * n, 0, (size_t)(size - 2 * n) * sizeof(double));
    return made;
}

FUNCTION(advanced)
{
    if (!expect(count, 3, "advanced(y, step, rate)"))
        return NULL;
    const npy_intp n = length(given[0]);
    const double *y = n < 0 ? NULL : numbers(given[0], n);
    const double step = PyFloat_AsDouble(given[1]);
    const double *rate = y == NULL || PyErr_Occurred() ? NULL : numbers(given[2], n);
    double *end;
    PyObject *made = rate == NULL ? NULL : make(1, n, &end);
    for (npy_intp i = 0; made != NULL && i < n; i++)
        end[i] = y[i] + step * rate[i];
    return made;
}

FUNCTION(ralston)
{
    if (!expect(count, 5, "ralston(y, step, rate1, rate2, rate3)"))
        return NULL;
    const npy_intp n = length(given[0]);
    const double *y = n < 0 ? NULL : numbers(given[0], n);
    const double ninth = PyFloat_AsDouble(given[1]) / 9.0;
    double *r[3], *end;
    if (y == NULL || PyErr_Occurred() || !take_arrays(given + 2, 3, (npy_intp[]){n, n, n}, r))
        return NULL;
    PyObject *made = make(1, n, &end);
    for (npy_intp i = 0; made != NULL && i < n; i++)
        end[i] = y[i] + ninth * (2.0 * r[0][i] + 3.0 * r[1][i] + 4.0 * r[2][i]);
    return made;
}

static PyMethodDef methods[] = {
    METHOD(memory, "(first, last, size)"),
    METHOD(cut, "(values, low, high)"),
    METHOD(rubbed, "(tau, u, rows)"),
    METHOD(gripped, "(tau, rotors, u, bend, rows, before, step)"),
    METHOD(balance, "(M, rotors, a, tau)"),
    METHOD(solve, "(A, b)"),
    METHOD(rate, "(y, x)"),
    METHOD(advanced, "(y, step, rate)"),
    METHOD(ralston, "(y, step, rate1, rate2, rate3)"),
    {0},
};
static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "hric_stages", NULL, -1, methods, NULL, NULL, NULL, NULL};

/* Address of a function that a module of scipy offers to compiled code; NULL with a Python error set. */
static void *function_of(const char *module, const char *name)
{
    PyObject *imported = PyImport_ImportModule(module);
    PyObject *table = imported == NULL ? NULL : PyObject_GetAttrString(imported, "__pyx_capi__");
    PyObject *capsule = table == NULL ? NULL : PyMapping_GetItemString(table, name);
    void *address = capsule == NULL ? NULL : PyCapsule_GetPointer(capsule, PyCapsule_GetName(capsule));
    Py_XDECREF(capsule);
    Py_XDECREF(table);
    Py_XDECREF(imported);
    return address;
}

PyMODINIT_FUNC PyInit_hric_stages(void)
{
    import_array();
    dgemv = ((Address){function_of("scipy.linalg.cython_blas", "dgemv")}).multiply;
    dposv = dgemv == NULL ? NULL : ((Address){function_of("scipy.linalg.cython_lapack", "dposv")}).solve;
    return dposv == NULL ? NULL : PyModule_Create(&definition);
}

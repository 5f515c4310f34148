/* Python type `Bodies`: kinematics and dynamics of a tree of links on Python lists, and inverse dynamics at many
 * instants on arrays; see tree.py. */
#include "hric_dynamics/capsules.h"
#include "hric_dynamics/tree.h"

enum { ROOT_NUMBERS = 16, LOAD_NUMBERS = 9 };

/* Capsule on a link, in its frame: index of the link, -1: the base; both ends of the axis; radius. */
typedef struct {
    double link, ends[2][3], radius;
} Capsule;

typedef struct {
    PyObject_HEAD
    Tree tree;
    double *q, *dq, *ddq, *efforts; /* joint values, one per link */
    int coordinates, *coordinate;   /* number of coordinates; index of each link's coordinate, -1: its joint is fixed */
} Bodies;

/* Copy the values of the coordinates to the joints of the links; 0 for fixed joints. */
static void spread(const Bodies *self, const double *values, double *of_links)
{
    for (int i = 0; i < self->tree.n; i++)
        of_links[i] = self->coordinate[i] < 0 ? 0.0 : values[self->coordinate[i]];
}

static void collect(const Bodies *self, const double *of_links, double *values)
{
    for (int i = 0; i < self->tree.n; i++)
        if (self->coordinate[i] >= 0)
            values[self->coordinate[i]] = of_links[i];
}

static int take_values(const Bodies *self, PyObject *sequence, double *of_links)
{
    double values[self->coordinates + 1];
    if (!take(sequence, self->coordinates, values))
        return 0;
    spread(self, values, of_links);
    return 1;
}

static PyObject *efforts_list(const Bodies *self)
{
    double values[self->coordinates + 1];
    memset(values, 0, sizeof values);
    collect(self, self->efforts, values);
    return list(values, self->coordinates);
}

/* Return the index of a link from a Python integer; -1 with a Python error set on failure. */
static int take_index(const Bodies *self, PyObject *number)
{
    const long index = PyLong_AsLong(number);
    if (index >= 0 && index < self->tree.n)
        return (int)index;
    if (!PyErr_Occurred())
        PyErr_Format(PyExc_IndexError, "there are %d links", self->tree.n);
    return -1;
}

static PyObject *bodies_gravity(Bodies *self, PyObject *const *given, Py_ssize_t count)
{
    Tree *tree = &self->tree;
    double gravity[3];
    if (!expect(count, 2, "gravity(q, gravity)") || !take_values(self, given[0], self->q)
        || !take(given[1], 3, gravity))
        return NULL;
    place_tree(tree, self->q);
    accumulate(tree->n, tree->parent, tree->bodies);
    for (int i = 0; i < tree->n; i++)
        self->efforts[i] = holding_effort(&tree->S[i], &tree->bodies[i], gravity);
    return efforts_list(self);
}

static PyObject *bodies_inverse_dynamics(Bodies *self, PyObject *const *given, Py_ssize_t count)
{
    double gravity[3];
    if (!expect(count, 4, "inverse_dynamics(q, dq, ddq, gravity)") || !take_values(self, given[0], self->q)
        || !take_values(self, given[1], self->dq) || !take_values(self, given[2], self->ddq)
        || !take(given[3], 3, gravity))
        return NULL;
    place_tree(&self->tree, self->q);
    tree_efforts(&self->tree, gravity, self->dq, self->ddq, self->efforts);
    return efforts_list(self);
}

static PyObject *bodies_mass_matrix(Bodies *self, PyObject *q)
{
    const int n = self->coordinates, links = self->tree.n, *at = self->coordinate;
    if (!take_values(self, q, self->q))
        return NULL;
    double M[links * links + 1], chosen[n * n + 1];
    place_tree(&self->tree, self->q);
    tree_mass_matrix(&self->tree, M);
    memset(chosen, 0, sizeof chosen);
    for (int i = 0; i < links; i++)
        for (int j = 0; j < links; j++)
            if (at[i] >= 0 && at[j] >= 0)
                chosen[at[i] * n + at[j]] = M[i * links + j];
    return list(chosen, (Py_ssize_t)n * n);
}

static PyObject *bodies_pose(Bodies *self, PyObject *const *given, Py_ssize_t count)
{
    if (!expect(count, 2, "pose(q, link)") || !take_values(self, given[0], self->q))
        return NULL;
    const int index = take_index(self, given[1]);
    if (index < 0)
        return NULL;
    place_joints(&self->tree, self->q, index + 1);
    const Pose *pose = &self->tree.poses[index];
    double T[12];
    for (int i = 0; i < 3; i++) {
        memcpy(T + 4 * i, pose->R + 3 * i, 3 * sizeof(double));
        T[4 * i + 3] = pose->p[i];
    }
    return list(T, 12);
}

static PyObject *bodies_jacobian(Bodies *self, PyObject *const *given, Py_ssize_t count)
{
    const int n = self->coordinates;
    double point[3], J[6 * n + 1];
    if (!expect(count, 3, "jacobian(q, link, point)") || !take_values(self, given[0], self->q)
        || !take(given[2], 3, point))
        return NULL;
    const int index = take_index(self, given[1]);
    if (index < 0)
        return NULL;
    place_joints(&self->tree, self->q, index + 1);
    memset(J, 0, sizeof J);
    for (int i = index; i >= 0; i = self->tree.parent[i]) {
        const Spatial *S = &self->tree.S[i];
        double linear[3] = {S->v[0], S->v[1], S->v[2]};
        add_cross(S->w, point, linear);
        for (int k = 0; self->coordinate[i] >= 0 && k < 3; k++) {
            J[k * n + self->coordinate[i]] = linear[k];
            J[(3 + k) * n + self->coordinate[i]] = S->w[k];
        }
    }
    return list(J, 6 * (Py_ssize_t)n);
}

/* Place both ends of the capsules' axes in the world; return 0 with a Python error set if a link does not exist. */
static int place_capsules(Bodies *self, const Capsule *capsules, Py_ssize_t count, double (*out)[2][3])
{
    const Tree *tree = &self->tree;
    place_joints(&self->tree, self->q, tree->n);
    for (Py_ssize_t i = 0; i < count; i++) {
        const int link = (int)capsules[i].link;
        if (link < -1 || link >= tree->n) {
            PyErr_Format(PyExc_IndexError, "there are %d links", tree->n);
            return 0;
        }
        const Pose *pose = link < 0 ? &tree->base : &tree->poses[link];
        for (int end = 0; end < 2; end++) {
            rotate(pose->R, capsules[i].ends[end], out[i][end]);
            for (int k = 0; k < 3; k++)
                out[i][end][k] += pose->p[k];
        }
    }
    return 1;
}

static PyObject *bodies_capsule_ends(Bodies *self, PyObject *const *given, Py_ssize_t count)
{
    Py_buffer view[2];
    if (!expect(count, 4, "capsule_ends(q, base, capsules, ends)") || !take_values(self, given[0], self->q)
        || !take(given[1], sizeof(Pose) / sizeof(double), (double *)&self->tree.base))
        return NULL;
    if (!take_views(given + 2, 2, 1, view)) {
        self->tree.base = WORLD;
        return NULL;
    }
    const Py_ssize_t n = view[0].len / (Py_ssize_t)sizeof(Capsule);
    const Py_ssize_t bytes[2] = {n * (Py_ssize_t)sizeof(Capsule), n * (Py_ssize_t)sizeof(double[2][3])};
    const int done = views_fit(view, 2, bytes) && place_capsules(self, view[0].buf, n, view[1].buf);
    release_views(view, 2);
    self->tree.base = WORLD;
    return done ? Py_NewRef(Py_None) : NULL;
}

/* Distance of the axes of two capsules; at: result, positions of the nearest points along both, 0 to 1. */
static double axes_apart(const double a[2][3], const double b[2][3], double at[2])
{
    double w[3], u[3], v[3];
    for (int k = 0; k < 3; k++) {
        w[k] = a[0][k] - b[0][k];
        u[k] = a[1][k] - a[0][k];
        v[k] = b[1][k] - b[0][k];
    }
    return sqrt(segments_apart(w, u, v, at));
}

/* Distances of the pairs of the links' own capsules that `pairs` names by two numbers each; negative for an overlap. */
static PyObject *bodies_capsule_distances(Bodies *self, PyObject *const *given, Py_ssize_t count)
{
    enum { CAPSULES, PAIRS, DISTANCES, VIEWS };
    Py_buffer view[VIEWS];
    if (!expect(count, 1 + VIEWS, "capsule_distances(q, capsules, pairs, distances)")
        || !take_values(self, given[0], self->q) || !take_views(given + 1, VIEWS, DISTANCES, view))
        return NULL;
    const Py_ssize_t size = sizeof(double), n = view[CAPSULES].len / (Py_ssize_t)sizeof(Capsule),
                     m = view[DISTANCES].len / size,
                     bytes[VIEWS] = {n * (Py_ssize_t)sizeof(Capsule), 2 * m * size, m * size};
    const Capsule *capsules = view[CAPSULES].buf;
    const double (*pairs)[2] = view[PAIRS].buf;
    double ends[n + 1][2][3], at[2], *distances = view[DISTANCES].buf;
    const int placed = views_fit(view, VIEWS, bytes) && place_capsules(self, capsules, n, ends);
    for (Py_ssize_t pair = 0; placed && pair < m; pair++) {
        const double i = pairs[pair][0], j = pairs[pair][1];
        if (!(0.0 <= i && i < (double)n && 0.0 <= j && j < (double)n)) {
            PyErr_Format(PyExc_IndexError, "there are %zd capsules", n);
            break;
        }
        const Capsule *a = capsules + (Py_ssize_t)i, *b = capsules + (Py_ssize_t)j;
        distances[pair] = axes_apart(ends[a - capsules], ends[b - capsules], at) - a->radius - b->radius;
    }
    release_views(view, VIEWS);
    return PyErr_Occurred() ? NULL : Py_NewRef(Py_None);
}

/* Nearest capsule of a set for each capsule of another; their ends are placed. Each row of the result: distance [m],
 * negative for an overlap; number of the nearest capsule; nearest points on the axes [m]. */
FUNCTION(nearest)
{
    enum { ENDS_A, RADII_A, ENDS_B, RADII_B, ROWS, SETS };
    Py_buffer view[SETS];
    if (!expect(count, SETS, "nearest(ends_a, radii_a, ends_b, radii_b, rows)") || !take_views(given, SETS, ROWS, view))
        return NULL;
    const Py_ssize_t size = sizeof(double), n = view[RADII_A].len / size, m = view[RADII_B].len / size;
    const Py_ssize_t bytes[SETS] = {6 * n * size, n * size, 6 * m * size, m * size, 8 * m * size};
    double (*a)[2][3] = view[ENDS_A].buf, (*b)[2][3] = view[ENDS_B].buf, (*rows)[8] = view[ROWS].buf;
    const double *radii_a = view[RADII_A].buf, *radii_b = view[RADII_B].buf;
    const int fits = views_fit(view, SETS, bytes);
    for (Py_ssize_t pair = 0; fits && pair < n * m; pair++) {
        const Py_ssize_t i = pair % n, j = pair / n;
        double at[2], *row = rows[j];
        const double distance = axes_apart(a[i], b[j], at) - radii_a[i] - radii_b[j];
        if (i > 0 && (isnan(row[0]) || distance >= row[0]))
            continue; /* a distance that is not known stays so */
        row[0] = distance;
        row[1] = (double)i;
        for (int k = 0; k < 3; k++) {
            row[2 + k] = a[i][0][k] + at[0] * (a[i][1][k] - a[i][0][k]);
            row[5 + k] = b[j][0][k] + at[1] * (b[j][1][k] - b[j][0][k]);
        }
    }
    release_views(view, SETS);
    return fits ? Py_NewRef(Py_None) : NULL;
}

/* -- many instants ------------------------------------------------------------------------------------------------- */

enum { ROOT, Q, DQ, DDQ, LOADS, TORQUE, FORCE, MOMENT, POSITION, ROTATION, ARRAYS };

/* Set the pose of the base and compute its spatial velocity v and acceleration a (minus gravity).
 *
 * motion: position of the root's origin, orientation (x, y, z, w), angular velocity, angular acceleration, acceleration
 * of the origin. v and a are about the world's origin, in an inertial frame that moves with the root's origin at this
 * instant, in which the velocity of the root's origin is zero. */
static void place_root(Tree *tree, const double motion[ROOT_NUMBERS], const double gravity[3], Spatial *v, Spatial *a)
{
    const double *p = motion, x = motion[3], y = motion[4], z = motion[5], w = motion[6];
    const double R[9] = {1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z),       2.0 * (x * z + w * y),
                         2.0 * (x * y + w * z),       1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x),
                         2.0 * (x * z - w * y),       2.0 * (y * z + w * x),       1.0 - 2.0 * (x * x + y * y)};
    memcpy(tree->base.R, R, sizeof R);
    memcpy(tree->base.p, p, sizeof tree->base.p);
    for (int k = 0; k < 3; k++) {
        v->w[k] = motion[7 + k];
        a->w[k] = motion[10 + k];
        a->v[k] = motion[13 + k] - gravity[k];
        v->v[k] = 0.0;
    }
    add_cross(p, v->w, v->v);
    add_cross(p, a->w, a->v);
}

/* Subtract an external load (force, torque, point of application) on a link from the force its parent must exert. */
static void relieve(const double load[LOAD_NUMBERS], Spatial *force)
{
    Spatial acting = {{load[3], load[4], load[5]}, {load[0], load[1], load[2]}};
    add_cross(load + 6, acting.v, acting.w);
    for (int k = 0; k < 3; k++) {
        force->w[k] -= acting.w[k];
        force->v[k] -= acting.v[k];
    }
}

static void solve_instant(Bodies *self, const double gravity[3], const int *loaded, int loads, int t,
                          double *const *array)
{
    Tree *tree = &self->tree;
    const int n = self->coordinates;
    Spatial v, a;
    place_root(tree, array[ROOT] + t * ROOT_NUMBERS, gravity, &v, &a);
    spread(self, array[Q] + t * n, self->q);
    spread(self, array[DQ] + t * n, self->dq);
    spread(self, array[DDQ] + t * n, self->ddq);
    place_tree(tree, self->q);
    link_forces(tree, &v, &a, self->dq, self->ddq);
    for (int i = 0; i < loads; i++)
        relieve(array[LOADS] + (t * loads + i) * LOAD_NUMBERS, &tree->forces[loaded[i]]);
    joint_efforts(tree->n, tree->parent, tree->S, tree->forces, self->efforts);
    collect(self, self->efforts, array[TORQUE] + t * n);
    for (int i = 0; i < tree->n; i++) {
        const int row = t * tree->n + i;
        const double *f = tree->forces[i].v, *p = tree->poses[i].p;
        double moment[3] = {tree->forces[i].w[0], tree->forces[i].w[1], tree->forces[i].w[2]};
        add_cross(f, p, moment); /* moment about the link's origin instead of the world's */
        memcpy(array[FORCE] + 3 * row, f, 3 * sizeof(double));
        memcpy(array[MOMENT] + 3 * row, moment, sizeof moment);
        memcpy(array[POSITION] + 3 * row, p, 3 * sizeof(double));
        memcpy(array[ROTATION] + 9 * row, tree->poses[i].R, 9 * sizeof(double));
    }
}

static PyObject *solve_buffers(Bodies *self, const double *gravity, PyObject *indices, const Py_buffer *view)
{
    const Py_ssize_t loads = PyList_GET_SIZE(indices), j = self->coordinates, l = self->tree.n;
    const Py_ssize_t size = sizeof(double), n = j > 0 ? view[Q].len / (size * j) : 0, row = size * n;
    const Py_ssize_t bytes[ARRAYS] = {
        row * ROOT_NUMBERS, row * j,     row * j,     row * j,    row * loads * LOAD_NUMBERS, row * j,
        3 * row * l,        3 * row * l, 3 * row * l, 9 * row * l};
    int loaded[loads + 1];
    double *array[ARRAYS];
    if (!views_fit(view, ARRAYS, bytes))
        return NULL;
    for (int i = 0; i < ARRAYS; i++)
        array[i] = view[i].buf;
    for (Py_ssize_t i = 0; i < loads; i++)
        if ((loaded[i] = take_index(self, PyList_GET_ITEM(indices, i))) < 0)
            return NULL;
    for (int t = 0; t < n; t++)
        solve_instant(self, gravity, loaded, (int)loads, t, array);
    self->tree.base = WORLD;
    Py_RETURN_NONE;
}

static PyObject *bodies_solve(Bodies *self, PyObject *const *given, Py_ssize_t count)
{
    double gravity[3];
    Py_buffer view[ARRAYS];
    if (!expect(count, 2 + ARRAYS,
                "solve(gravity, links, root, q, dq, ddq, loads, torque, force, moment, position, rotation)")
        || !take(given[0], 3, gravity))
        return NULL;
    if (!PyList_Check(given[1])) {
        PyErr_SetString(PyExc_TypeError, "the links of the loads must be a list");
        return NULL;
    }
    if (!take_views(given + 2, ARRAYS, TORQUE, view))
        return NULL;
    PyObject *done = solve_buffers(self, gravity, given[1], view);
    release_views(view, ARRAYS);
    return done;
}

/* -- the type ------------------------------------------------------------------------------------------------------ */

static int bodies_init(Bodies *self, PyObject *args)
{
    PyObject *rows;
    if (!PyArg_ParseTuple(args, "iO!", &self->coordinates, &PyList_Type, &rows))
        return -1;
    const Py_ssize_t links = PyList_GET_SIZE(rows);
    self->q = zeroed(4 * (size_t)links, sizeof(double));
    self->coordinate = zeroed((size_t)links, sizeof(int));
    if (!make_tree(&self->tree, (int)links))
        return -1;
    self->dq = self->q + links;
    self->ddq = self->dq + links;
    self->efforts = self->ddq + links;
    for (int i = 0; i < links; i++) {
        struct {
            double coordinate;
            Link link;
        } row;
        if (!take(PyList_GET_ITEM(rows, i), 1 + LINK_NUMBERS, (double *)&row) || !set_link(&self->tree, i, &row.link))
            return -1;
        if (!(row.coordinate < (double)self->coordinates)) {
            PyErr_Format(PyExc_ValueError, "the coordinate of link %d is not among %d", i, self->coordinates);
            return -1;
        }
        self->coordinate[i] = row.coordinate < 0.0 ? -1 : (int)row.coordinate;
    }
    return 0;
}

static void bodies_clear(Bodies *self)
{
    clear_tree(&self->tree);
    PyMem_Free(self->q);
    PyMem_Free(self->coordinate);
}

static PyMethodDef bodies_methods[] = {
    {"gravity", FAST(bodies_gravity), "gravity(q, gravity): return the joint efforts that hold the links"},
    {"inverse_dynamics", FAST(bodies_inverse_dynamics),
     "inverse_dynamics(q, dq, ddq, gravity): return the joint efforts"},
    {"mass_matrix", (PyCFunction)bodies_mass_matrix, METH_O, "mass_matrix(q): return the mass matrix, row-major"},
    {"pose", FAST(bodies_pose), "pose(q, link): return the upper 3 x 4 part of a link's pose in the world, row-major"},
    {"jacobian", FAST(bodies_jacobian),
     "jacobian(q, link, point): return the Jacobian of a point in the world, linear above angular, row-major"},
    {"capsule_ends", FAST(bodies_capsule_ends),
     "capsule_ends(q, base, capsules, ends): write both ends of the axes of capsules in the world, for a pose of the "
     "base"},
    {"capsule_distances", FAST(bodies_capsule_distances),
     "capsule_distances(q, capsules, pairs, distances): write the distances of pairs of capsules on the links"},
    {"solve", FAST(bodies_solve),
     "solve(gravity, links, root, q, dq, ddq, loads, torque, force, moment, position, rotation): inverse dynamics at "
     "many instants; the last five arrays are written"},
    {0}};

static PyMethodDef functions[] = {
    METHOD(nearest,
           "(ends_a, radii_a, ends_b, radii_b, rows): write the nearest of a set of capsules for each of another"),
    {0}};

TYPE_MODULE(hric_bodies, Bodies, bodies, functions)

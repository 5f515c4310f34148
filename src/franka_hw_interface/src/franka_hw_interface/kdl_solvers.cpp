/* KDL's dynamics and Jacobian on Python lists and arrays. Through PyKDL, copying the elements in and out takes several
   times as long as the computation; and KDL's own solver of the gravity torque spends time on velocities that are all
   zero. */
#include <hric_core/python_numbers.h>

#include <algorithm>
#include <array>
#include <exception>
#include <memory>
#include <type_traits>
#include <vector>

#include <kdl/chaindynparam.hpp>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainjnttojacsolver.hpp>

namespace
{

/* Count of numbers of a segment, in the order of `_numbers` in kdl_chain.py. */
constexpr int SEGMENT = 26;
/* Joints of a tree at most. */
constexpr int MOST = 64;

KDL::Segment segment(const double* s)
{
  const KDL::Vector p(s[1], s[2], s[3]), axis(s[13], s[14], s[15]);
  const KDL::Rotation R(s[4], s[5], s[6], s[7], s[8], s[9], s[10], s[11], s[12]);
  const KDL::Joint joint(p, axis, s[0] != 0.0 ? KDL::Joint::RotAxis : KDL::Joint::TransAxis);
  const KDL::RotationalInertia tensor(s[20], s[21], s[22], s[23], s[24], s[25]);
  return KDL::Segment(joint, KDL::Frame(R, p), KDL::RigidBodyInertia(s[16], KDL::Vector(s[17], s[18], s[19]), tensor));
}

/* A moving part of the arm: its joint in the frame of the part before, mass, first moment of mass, and intermediate
   results of the last torque: pose in the part before, axis of the joint and acceleration in the own frame, force. */
struct Part
{
  explicit Part(const double* s)
    : revolute(s[0] != 0.0),
      origin(s[1], s[2], s[3]),
      axis(segment(s).getJoint().JointAxis()),
      R(s[4], s[5], s[6], s[7], s[8], s[9], s[10], s[11], s[12]),
      mass(s[16]),
      moment(mass * KDL::Vector(s[17], s[18], s[19]))
  {
  }
  bool revolute;
  KDL::Vector origin, axis;
  KDL::Rotation R;
  double mass;
  KDL::Vector moment;
  KDL::Frame pose;
  KDL::Vector own_axis, acceleration;
  KDL::Wrench force;
};

/* Solvers of KDL for one chain, and their containers. */
struct Solvers
{
  Solvers(const KDL::Chain& given, const KDL::Vector& gravity)
    : chain(given),
      dynamics(chain, gravity),
      differential(chain),
      forward(chain),
      q(chain.getNrOfJoints()),
      dq(q),
      coriolis(q),
      mass(chain.getNrOfJoints()),
      jacobian(chain.getNrOfJoints())
  {
  }
  KDL::Chain chain; /* the solvers refer to it */
  KDL::ChainDynParam dynamics;
  KDL::ChainJntToJacSolver differential;
  KDL::ChainFkSolverPos_recursive forward;
  KDL::JntArray q, dq, coriolis;
  KDL::JntSpaceInertiaMatrix mass;
  KDL::Jacobian jacobian;
  KDL::Frame last;
};

struct Arm
{
  std::vector<Part> parts;
  KDL::Vector upwards; /* acceleration of the base that has the effect of gravity */
  std::vector<double> q, torque;
  std::unique_ptr<Solvers> solvers;
};

/* Recursive Newton-Euler for an arm at rest: the operations of KDL's ChainIdSolver_RNE in the same order, without those
   on angular accelerations, which are zero, so that the results are equal bit for bit. The motion of the first `shared`
   parts is that of another arm, which has been computed. */
void hold(Arm& arm, const Arm& other, std::size_t shared)
{
  const KDL::Vector* before = &arm.upwards;
  for (std::size_t i = 0; i < arm.parts.size(); i++)
  {
    Part& part = arm.parts[i];
    if (i < shared)
    {
      part.pose = other.parts[i].pose;
      part.own_axis = other.parts[i].own_axis;
      part.acceleration = other.parts[i].acceleration;
    }
    else
    {
      part.pose.M = part.revolute ? KDL::Rotation::Rot2(part.axis, arm.q[i]) * part.R : part.R;
      part.pose.p = part.revolute ? part.origin : part.origin + part.axis * arm.q[i];
      part.own_axis = part.pose.M.Inverse(part.axis);
      part.acceleration = part.pose.M.Inverse(*before);
    }
    part.force = KDL::Wrench(part.mass * part.acceleration, part.moment * part.acceleration);
    before = &part.acceleration;
  }
  for (std::size_t i = arm.parts.size(); i-- > 0;)
  {
    const Part& part = arm.parts[i];
    arm.torque[i] = dot(part.own_axis, part.revolute ? part.force.torque : part.force.force);
    if (i > 0)
      arm.parts[i - 1].force = arm.parts[i - 1].force + part.pose * part.force;
  }
}

const char* NAME = "hric_kdl.Arm";

PyObject* gravity(PyObject* capsule, PyObject* position)
{
  Arm& arm = *static_cast<Arm*>(PyCapsule_GetPointer(capsule, NAME));
  if (!take(position, Py_ssize_t(arm.q.size()), arm.q.data()))
    return nullptr;
  hold(arm, arm, 0);
  return list(arm.torque.data(), Py_ssize_t(arm.torque.size()));
}

/* Return the arm of a method with `expected` arguments, with the position in the first of them; NULL with a Python
   error set on failure. */
Arm* placed(PyObject* capsule, PyObject* const* given, Py_ssize_t count, Py_ssize_t expected, const char* usage)
{
  Arm* arm = static_cast<Arm*>(PyCapsule_GetPointer(capsule, NAME));
  if (arm == nullptr || !expect(count, expected, usage) ||
      !take(given[0], Py_ssize_t(arm->q.size()), arm->solvers->q.data.data()))
    return nullptr;
  return arm;
}

/* Write rows x columns numbers to an array, row by row. Return None, or NULL with a Python error set on failure, also
   with a code of KDL below zero. */
template <class Matrix>
PyObject* write(const Matrix& matrix, unsigned rows, unsigned columns, int code, PyObject* array)
{
  if (code < 0)
    return PyErr_Format(PyExc_ArithmeticError, "KDL's error %d", code);
  Py_buffer view;
  if (PyObject_GetBuffer(array, &view, PyBUF_C_CONTIGUOUS | PyBUF_WRITABLE) < 0)
    return nullptr;
  const Py_ssize_t size = Py_ssize_t(rows * columns * sizeof(double));
  const int fits = views_fit(&view, 1, &size);
  double* out = static_cast<double*>(view.buf);
  for (unsigned i = 0; fits && i < rows; i++)
    for (unsigned j = 0; j < columns; j++)
      *out++ = matrix(i, j);
  PyBuffer_Release(&view);
  return fits ? Py_NewRef(Py_None) : nullptr;
}

PyObject* mass(PyObject* capsule, PyObject* const* given, Py_ssize_t count)
{
  Arm* arm = placed(capsule, given, count, 2, "mass(q, out)");
  if (arm == nullptr)
    return nullptr;
  Solvers& kdl = *arm->solvers;
  const int code = kdl.dynamics.JntToMass(kdl.q, kdl.mass);
  return write(kdl.mass, kdl.mass.rows(), kdl.mass.columns(), code, given[1]);
}

PyObject* coriolis(PyObject* capsule, PyObject* const* given, Py_ssize_t count)
{
  Arm* arm = placed(capsule, given, count, 3, "coriolis(q, dq, out)");
  if (arm == nullptr || !take(given[1], Py_ssize_t(arm->q.size()), arm->solvers->dq.data.data()))
    return nullptr;
  Solvers& kdl = *arm->solvers;
  const int code = kdl.dynamics.JntToCoriolis(kdl.q, kdl.dq, kdl.coriolis);
  return write(kdl.coriolis, kdl.coriolis.rows(), 1, code, given[2]);
}

PyObject* jacobian(PyObject* capsule, PyObject* const* given, Py_ssize_t count)
{
  Arm* arm = placed(capsule, given, count, 4, "jacobian(q, segments, point, out)");
  const long segments = arm == nullptr ? -1 : PyLong_AsLong(given[1]);
  const bool elsewhere = count == 4 && given[2] != Py_None;
  std::array<double, 3> p{};
  if (PyErr_Occurred() || (elsewhere && !take(given[2], 3, p.data())))
    return nullptr;
  Solvers& kdl = *arm->solvers;
  SetToZero(kdl.jacobian);
  int code = kdl.differential.JntToJac(kdl.q, kdl.jacobian, int(segments));
  if (code >= 0 && elsewhere)
    code = kdl.forward.JntToCart(kdl.q, kdl.last, int(segments));
  if (code >= 0 && elsewhere)
    kdl.jacobian.changeRefPoint(kdl.last.M * KDL::Vector(p[0], p[1], p[2]));
  return write(kdl.jacobian, 6, kdl.jacobian.columns(), code, given[3]);
}

PyMethodDef arm_methods[] = {
  { "gravity", gravity, METH_O, "(q) -> torque that holds the arm" },
  { "mass", FAST(mass), "(q, out): write the mass matrix" },
  { "coriolis", FAST(coriolis), "(q, dq, out): write the Coriolis torque" },
  { "jacobian", FAST(jacobian),
    "(q, segments, point, out): write the Jacobian of a point of the last segment, None: its origin" }
};

void release(PyObject* capsule)
{
  delete static_cast<Arm*>(PyCapsule_GetPointer(capsule, NAME));
}

/* Return a tuple of the methods of an arm, which all refer to it. */
PyObject* bound(std::unique_ptr<Arm> arm)
{
  PyObject* capsule = PyCapsule_New(arm.get(), NAME, release);
  if (capsule == nullptr)
    return nullptr;
  static_cast<void>(arm.release());  // the capsule has it now
  constexpr std::size_t count = std::extent<decltype(arm_methods)>::value;
  PyObject* made = PyTuple_New(count);
  for (std::size_t i = 0; made != nullptr && i < count; i++)
  {
    PyObject* function = PyCFunction_New(&arm_methods[i], capsule);
    if (function == nullptr)
      Py_CLEAR(made);
    else
      PyTuple_SET_ITEM(made, i, function);
  }
  Py_DECREF(capsule);
  return made;
}

PyObject* functions_of(PyObject*, PyObject* const* given, Py_ssize_t count)
{
  std::array<double, 3> g{};
  if (!expect(count, 2, "functions(segments, gravity)") || !take(given[1], 3, g.data()))
    return nullptr;
  const Py_ssize_t n = PySequence_Size(given[0]);
  if (n < 0)
    return nullptr;
  try
  {
    auto arm = std::make_unique<Arm>();
    KDL::Chain chain;
    for (Py_ssize_t i = 0; i < n; i++)
    {
      std::array<double, SEGMENT> numbers{};
      PyObject* row = PySequence_GetItem(given[0], i);
      const bool taken = row != nullptr && take(row, SEGMENT, numbers.data());
      Py_XDECREF(row);
      if (!taken)
        return nullptr;
      arm->parts.emplace_back(numbers.data());
      chain.addSegment(segment(numbers.data()));
    }
    arm->upwards = KDL::Vector(-g[0], -g[1], -g[2]);
    arm->q.resize(std::size_t(n));
    arm->torque.resize(std::size_t(n));
    arm->solvers = std::make_unique<Solvers>(chain, KDL::Vector(g[0], g[1], g[2]));
    return bound(std::move(arm));
  }
  catch (const std::exception& error)
  {
    PyErr_SetString(PyExc_ValueError, error.what());
    return nullptr;
  }
}

/* Tree of chains whose links each have mass in one chain only. */
struct Tree
{
  struct Chain
  {
    Arm* arm;
    std::vector<int> joints; /* index of each joint in the tree */
    std::size_t other;       /* index of a chain before this one, or of this one */
    std::size_t shared;      /* number of first joints that both have in common */
  };
  Tree(std::size_t n, PyObject* list) : q(n), held(n), functions(Py_NewRef(list))
  {
  }
  Tree(const Tree&) = delete;
  Tree& operator=(const Tree&) = delete;
  ~Tree()
  {
    Py_DECREF(functions);
  }
  std::vector<Chain> chains;
  std::vector<double> q, held;
  PyObject* functions; /* of the chains, so that their arms exist as long as the tree */
};

const char* TREE = "hric_kdl.Tree";

PyObject* hold_tree(PyObject* capsule, PyObject* position)
{
  Tree& tree = *static_cast<Tree*>(PyCapsule_GetPointer(capsule, TREE));
  if (!take(position, Py_ssize_t(tree.q.size()), tree.q.data()))
    return nullptr;
  std::fill(tree.held.begin(), tree.held.end(), 0.0);
  for (const Tree::Chain& chain : tree.chains)
  {
    for (std::size_t k = 0; k < chain.joints.size(); k++)
      chain.arm->q[k] = tree.q[std::size_t(chain.joints[k])];
    hold(*chain.arm, *tree.chains[chain.other].arm, chain.shared);
    for (std::size_t k = 0; k < chain.joints.size(); k++)
      tree.held[std::size_t(chain.joints[k])] += chain.arm->torque[k];
  }
  return list(tree.held.data(), Py_ssize_t(tree.held.size()));
}

PyMethodDef tree_method = { "gravity", hold_tree, METH_O, "(q) -> torque that holds the tree" };

void release_tree(PyObject* capsule)
{
  delete static_cast<Tree*>(PyCapsule_GetPointer(capsule, TREE));
}

/* Add a chain, given as the gravity of an arm and the indices of its joints; return 0 with a Python error set on
   failure. */
int add_chain(Tree& tree, PyObject* given)
{
  PyObject *function, *indices;
  if (!PyArg_ParseTuple(given, "O!O!", &PyCFunction_Type, &function, &PyTuple_Type, &indices))
    return 0;
  const std::size_t place = tree.chains.size();
  Tree::Chain chain{ static_cast<Arm*>(PyCapsule_GetPointer(PyCFunction_GET_SELF(function), NAME)), {}, place, 0 };
  for (Py_ssize_t k = 0; k < PyTuple_GET_SIZE(indices); k++)
    chain.joints.push_back(int(PyLong_AsLong(PyTuple_GET_ITEM(indices, k))));
  if (PyErr_Occurred() || !below(chain.joints.data(), int(chain.joints.size()), int(tree.q.size())))
    return 0;
  if (chain.joints.size() != chain.arm->q.size())
  {
    PyErr_Format(PyExc_ValueError, "%zu indices are needed, got %zu", chain.arm->q.size(), chain.joints.size());
    return 0;
  }
  for (std::size_t i = 0; i < place; i++)
  {
    const std::vector<int>& joints = tree.chains[i].joints;
    std::size_t same = 0;
    while (same < joints.size() && same < chain.joints.size() && joints[same] == chain.joints[same])
      same++;
    if (same > chain.shared)
      chain.other = i, chain.shared = same;
  }
  tree.chains.push_back(chain);
  return 1;
}

PyObject* tree_gravity(PyObject*, PyObject* const* given, Py_ssize_t count)
{
  if (!expect(count, 2, "tree_gravity(n, chains)"))
    return nullptr;
  const Py_ssize_t n = PyLong_AsSsize_t(given[0]);
  if (n < 0 || n > MOST || !PyList_Check(given[1]))
    return PyErr_Format(PyExc_ValueError, "0 to %d joints and a list of chains are needed", MOST);
  auto tree = std::make_unique<Tree>(std::size_t(n), given[1]);
  for (Py_ssize_t i = 0; i < PyList_GET_SIZE(given[1]); i++)
    if (!add_chain(*tree, PyList_GET_ITEM(given[1], i)))
      return nullptr;
  PyObject* capsule = PyCapsule_New(tree.get(), TREE, release_tree);
  if (capsule == nullptr)
    return nullptr;
  static_cast<void>(tree.release());  // the capsule has it now
  PyObject* made = PyCFunction_New(&tree_method, capsule);
  Py_DECREF(capsule);
  return made;
}

PyMethodDef functions[] = {
  { "functions", FAST(functions_of), "(segments, gravity) -> gravity, mass, coriolis, jacobian of an arm" },
  { "tree_gravity", FAST(tree_gravity), "(n, [(gravity of a chain, its joints), ...]) -> gravity of a tree" },
  {}
};

PyModuleDef definition = {
  PyModuleDef_HEAD_INIT, "hric_kdl", nullptr, -1, functions, nullptr, nullptr, nullptr, nullptr
};

}  // namespace

PyMODINIT_FUNC PyInit_hric_kdl()
{
  return PyModule_Create(&definition);
}

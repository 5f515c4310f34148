/* KDL's dynamics and Jacobian on Python lists and arrays. Through PyKDL, copying the elements in and out takes several
   times as long as the computation; and KDL's own solver of the gravity torque spends time on velocities that are all
   zero. */
#include <hric_core/python_numbers.h>

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
constexpr std::size_t MOST = 64;

KDL::Segment segment(const double* s)
{
  const KDL::Vector p(s[1], s[2], s[3]), axis(s[13], s[14], s[15]);
  const KDL::Rotation R(s[4], s[5], s[6], s[7], s[8], s[9], s[10], s[11], s[12]);
  const KDL::Joint joint(p, axis, s[0] != 0.0 ? KDL::Joint::RotAxis : KDL::Joint::TransAxis);
  const KDL::RotationalInertia tensor(s[20], s[21], s[22], s[23], s[24], s[25]);
  return KDL::Segment(joint, KDL::Frame(R, p), KDL::RigidBodyInertia(s[16], KDL::Vector(s[17], s[18], s[19]), tensor));
}

/* A moving part of the arm: its constant segment, and intermediate results of the last torque. */
struct Part
{
  KDL::Segment segment;
  KDL::Frame pose;
  KDL::Twist axis;
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
  KDL::Twist upwards; /* acceleration of the base that has the effect of gravity */
  std::vector<double> q, torque;
  std::unique_ptr<Solvers> solvers;
};

/* Recursive Newton-Euler for an arm at rest, with the operations of KDL's ChainIdSolver_RNE in the same order, so that
   the results are equal bit for bit. */
void hold(Arm& arm)
{
  KDL::Twist acceleration = arm.upwards;
  for (std::size_t i = 0; i < arm.parts.size(); i++)
  {
    Part& part = arm.parts[i];
    part.pose = part.segment.pose(arm.q[i]);
    part.axis = part.pose.M.Inverse(part.segment.twist(arm.q[i], 1.0));
    acceleration = part.pose.Inverse(acceleration);
    part.force = part.segment.getInertia() * acceleration;
  }
  for (std::size_t i = arm.parts.size(); i-- > 0;)
  {
    const Part& part = arm.parts[i];
    arm.torque[i] = dot(part.axis, part.force);
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
  hold(arm);
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
      arm->parts.push_back(Part{ segment(numbers.data()), {}, {}, {} });
      chain.addSegment(arm->parts.back().segment);
    }
    arm->upwards = KDL::Twist(KDL::Vector(-g[0], -g[1], -g[2]), KDL::Vector::Zero());
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

/* Return the torques that hold a tree: the sum of those of its chains, whose links each have mass in one chain only. */
PyObject* tree_gravity(PyObject*, PyObject* const* given, Py_ssize_t count)
{
  if (!expect(count, 3, "tree_gravity(n, chains, q)"))
    return nullptr;
  const Py_ssize_t n = PyLong_AsSsize_t(given[0]);
  std::array<double, MOST> q{}, held{};
  if (n < 0 || n > Py_ssize_t(MOST) || !PyList_Check(given[1]))
    return PyErr_Format(PyExc_ValueError, "0 to %d joints and a list of chains are needed", int(MOST));
  if (!take(given[2], n, q.data()))
    return nullptr;
  for (Py_ssize_t i = 0; i < PyList_GET_SIZE(given[1]); i++)
  {
    PyObject *function, *indices;
    if (!PyArg_ParseTuple(PyList_GET_ITEM(given[1], i), "O!O", &PyCFunction_Type, &function, &indices))
      return nullptr;
    Arm* arm = static_cast<Arm*>(PyCapsule_GetPointer(PyCFunction_GET_SELF(function), NAME));
    std::array<double, MOST> at{};
    if (arm == nullptr || arm->q.size() > MOST || !take(indices, Py_ssize_t(arm->q.size()), at.data()))
      return nullptr;
    for (std::size_t k = 0; k < arm->q.size(); k++)
      if (at[k] >= 0.0 && at[k] < double(n))
        arm->q[k] = q[std::size_t(at[k])];
      else
        return PyErr_Format(PyExc_IndexError, "there are %zd joints", n);
    hold(*arm);
    for (std::size_t k = 0; k < arm->q.size(); k++)
      held[std::size_t(at[k])] += arm->torque[k];
  }
  return list(held.data(), n);
}

PyMethodDef functions[] = {
  { "functions", FAST(functions_of), "(segments, gravity) -> gravity, mass, coriolis, jacobian of an arm" },
  { "tree_gravity", FAST(tree_gravity), "(n, [(gravity of a chain, its joints), ...], q) -> torque that holds a tree" },
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

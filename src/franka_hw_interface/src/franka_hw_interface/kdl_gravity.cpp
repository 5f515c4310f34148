/* KDL's gravity torque on Python lists. Through PyKDL, copying the elements in and out takes twice as long as the
   torque itself; and KDL's own solver spends time on velocities that are all zero. */
#include <hric_core/python_numbers.h>

#include <array>
#include <exception>
#include <memory>
#include <vector>

#include <kdl/segment.hpp>

namespace
{

/* Count of numbers of a segment, in the order of `_numbers` in kdl_chain.py. */
constexpr int SEGMENT = 26;

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

struct Arm
{
  std::vector<Part> parts;
  KDL::Twist upwards; /* acceleration of the base that has the effect of gravity */
  std::vector<double> q, torque;
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

PyMethodDef gravity_method = { "gravity", gravity, METH_O, "(q) -> torque that holds the arm" };

void release(PyObject* capsule)
{
  delete static_cast<Arm*>(PyCapsule_GetPointer(capsule, NAME));
}

PyObject* gravity_function(PyObject*, PyObject* const* given, Py_ssize_t count)
{
  std::array<double, 3> g{};
  if (!expect(count, 2, "gravity_function(segments, gravity)") || !take(given[1], 3, g.data()))
    return nullptr;
  const Py_ssize_t n = PySequence_Size(given[0]);
  if (n < 0)
    return nullptr;
  try
  {
    auto arm = std::make_unique<Arm>();
    for (Py_ssize_t i = 0; i < n; i++)
    {
      std::array<double, SEGMENT> numbers{};
      PyObject* row = PySequence_GetItem(given[0], i);
      const bool taken = row != nullptr && take(row, SEGMENT, numbers.data());
      Py_XDECREF(row);
      if (!taken)
        return nullptr;
      arm->parts.push_back(Part{ segment(numbers.data()), {}, {}, {} });
    }
    arm->upwards = KDL::Twist(KDL::Vector(-g[0], -g[1], -g[2]), KDL::Vector::Zero());
    arm->q.resize(std::size_t(n));
    arm->torque.resize(std::size_t(n));
    PyObject* capsule = PyCapsule_New(arm.get(), NAME, release);
    if (capsule == nullptr)
      return nullptr;
    static_cast<void>(arm.release());  // the capsule has it now
    PyObject* made = PyCFunction_New(&gravity_method, capsule);
    Py_DECREF(capsule);
    return made;
  }
  catch (const std::exception& error)
  {
    PyErr_SetString(PyExc_ValueError, error.what());
    return nullptr;
  }
}

PyMethodDef functions[] = {
  { "gravity_function", FAST(gravity_function), "(segments, gravity) -> a function from q to the gravity torque" }, {}
};

PyModuleDef definition = {
  PyModuleDef_HEAD_INIT, "hric_kdl", nullptr, -1, functions, nullptr, nullptr, nullptr, nullptr
};

}  // namespace

PyMODINIT_FUNC PyInit_hric_kdl()
{
  return PyModule_Create(&definition);
}

// Types whose numbers are always the same ones: all of them in a row, in the order of the definition.
#pragma once

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include <geometry_msgs/PointStamped.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TwistStamped.h>
#include <geometry_msgs/WrenchStamped.h>

#include "path.h"

namespace hric_perception
{

template <class Message>
struct Fixed;

inline void fill(double* out, const geometry_msgs::Pose& pose)
{
  const auto& p = pose.position;
  const auto& q = pose.orientation;
  const std::array<double, 7> all{ p.x, p.y, p.z, q.x, q.y, q.z, q.w };
  std::copy(all.begin(), all.end(), out);
}

inline void fill(double* out, const geometry_msgs::Vector3& first, const geometry_msgs::Vector3& second)
{
  const std::array<double, 6> all{ first.x, first.y, first.z, second.x, second.y, second.z };
  std::copy(all.begin(), all.end(), out);
}

template <>
struct Fixed<geometry_msgs::PoseStamped>
{
  static std::vector<Leaf> leaves()
  {
    return { { "pose.position.x", "m" },    { "pose.position.y", "m" },    { "pose.position.z", "m" },   { "pose.orientation.x", "1" },
             { "pose.orientation.y", "1" }, { "pose.orientation.z", "1" }, { "pose.orientation.w", "1" } };
  }
  static void read(const geometry_msgs::PoseStamped& message, double* out)
  {
    fill(out, message.pose);
  }
};

template <>
struct Fixed<geometry_msgs::PointStamped>
{
  static std::vector<Leaf> leaves()
  {
    return { { "point.x", "m" }, { "point.y", "m" }, { "point.z", "m" } };
  }
  static void read(const geometry_msgs::PointStamped& message, double* out)
  {
    out[0] = message.point.x;
    out[1] = message.point.y;
    out[2] = message.point.z;
  }
};

template <>
struct Fixed<geometry_msgs::WrenchStamped>
{
  static std::vector<Leaf> leaves()
  {
    return { { "wrench.force.x", "N" },    { "wrench.force.y", "N" },    { "wrench.force.z", "N" },
             { "wrench.torque.x", "N m" }, { "wrench.torque.y", "N m" }, { "wrench.torque.z", "N m" } };
  }
  static void read(const geometry_msgs::WrenchStamped& message, double* out)
  {
    fill(out, message.wrench.force, message.wrench.torque);
  }
};

template <>
struct Fixed<geometry_msgs::TwistStamped>
{
  static std::vector<Leaf> leaves()
  {
    return { { "twist.linear.x", "m/s" },    { "twist.linear.y", "m/s" },    { "twist.linear.z", "m/s" },
             { "twist.angular.x", "rad/s" }, { "twist.angular.y", "rad/s" }, { "twist.angular.z", "rad/s" } };
  }
  static void read(const geometry_msgs::TwistStamped& message, double* out)
  {
    fill(out, message.twist.linear, message.twist.angular);
  }
};

}  // namespace hric_perception

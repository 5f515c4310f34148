// Types whose numbers stand in lists with a list of names beside them: one row, or many samples row by row.
#pragma once

#include <string>
#include <vector>

#include <hric_msgs/ControlLog.h>
#include <hric_msgs/SampleChunk.h>
#include <sensor_msgs/JointState.h>

#include "path.h"

namespace hric_perception
{

using Numbers = std::vector<double>;
using Names = std::vector<std::string>;

template <class Message>
struct Table;

template <>
struct Table<sensor_msgs::JointState>
{
  static std::vector<Leaf> lists()
  {
    return { { "position", "rad" }, { "velocity", "rad/s" }, { "effort", "N m" } };
  }
  static const Names& names(const sensor_msgs::JointState& message)
  {
    return message.name;
  }
  static const Numbers& list(const sensor_msgs::JointState& message, std::size_t index)
  {
    return index == 0 ? message.position : index == 1 ? message.velocity : message.effort;
  }
  static std::size_t rows(const sensor_msgs::JointState&)
  {
    return 1;
  }
  static double offset(const sensor_msgs::JointState&, std::size_t)  // from the stamp of the header to that of a row [s]
  {
    return 0.0;
  }
  static std::string unit(const sensor_msgs::JointState&)
  {
    return "";
  }
};

template <>
struct Table<hric_msgs::ControlLog>
{
  static std::vector<Leaf> lists()
  {
    return { { "position", "rad" }, { "velocity", "rad/s" }, { "effort", "N m" }, { "command_raw", "" }, { "command", "" } };
  }
  static const Names& names(const hric_msgs::ControlLog& message)
  {
    return message.joint_names;
  }
  static const Numbers& list(const hric_msgs::ControlLog& message, std::size_t index)
  {
    const Numbers* const all[] = { &message.position, &message.velocity, &message.effort, &message.command_raw, &message.command };
    return *all[index];
  }
  static std::size_t rows(const hric_msgs::ControlLog& message)
  {
    return message.time.size();
  }
  static double offset(const hric_msgs::ControlLog& message, std::size_t row)
  {
    return message.time[row] - message.time[0];
  }
  static std::string unit(const hric_msgs::ControlLog&)
  {
    return "";
  }
};

template <>
struct Table<hric_msgs::SampleChunk>
{
  static std::vector<Leaf> lists()
  {
    return { { "data", "" } };
  }
  static const Names& names(const hric_msgs::SampleChunk& message)
  {
    return message.channels;
  }
  static const Numbers& list(const hric_msgs::SampleChunk& message, std::size_t)
  {
    return message.data;
  }
  static std::size_t rows(const hric_msgs::SampleChunk& message)
  {
    return message.channels.empty() || !(message.rate > 0.0) ? 0 : message.data.size() / message.channels.size();
  }
  static double offset(const hric_msgs::SampleChunk& message, std::size_t row)
  {
    return static_cast<double>(row) / message.rate;
  }
  static std::string unit(const hric_msgs::SampleChunk& message)
  {
    return message.unit;
  }
};

}  // namespace hric_perception

// What passes through the filters: the chosen values of one message, or of one sample of a chunk.
#pragma once

#include <string>
#include <vector>

#include <boost/shared_ptr.hpp>
#include <ros/message_traits.h>
#include <std_msgs/Header.h>

namespace hric_perception
{

struct Sample
{
  std_msgs::Header header;
  std::vector<double> values;
};

using SamplePtr = boost::shared_ptr<Sample const>;

// One value of the synchronised sample: its field, as in the plan, and its unit; empty: not known.
struct Column
{
  std::string field;
  std::string unit;
};

}  // namespace hric_perception

namespace ros
{
namespace message_traits
{

template <>
struct HasHeader<hric_perception::Sample> : TrueType
{
};

template <>
struct HasHeader<hric_perception::Sample const> : TrueType
{
};

}  // namespace message_traits
}  // namespace ros

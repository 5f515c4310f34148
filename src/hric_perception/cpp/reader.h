// From messages of the listed types to samples. The fields are those of hric_perception.sync.paths.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <ros/ros.h>

#include "sample.h"

namespace hric_perception
{

// What becomes of each message.
struct Sink
{
  std::function<void(const SamplePtr&)> sample;
  std::function<void()> malformed;                                       // a message that contradicts itself
  std::function<void()> other;                                           // one that does not hold what is looked for
  std::function<void(const std::vector<std::string>& by_column)> units;  // a chunk told its units, for the columns in their order
};

// One source.
class Reader
{
public:
  virtual ~Reader() = default;

  // Adds the values that a field names; unit: empty for that of the type. Throws std::invalid_argument, which names what is valid.
  virtual void choose(const std::string& field, const std::string& unit) = 0;
  virtual ros::Subscriber subscribe(ros::NodeHandle& node, const std::string& topic, Sink sink) = 0;

  const std::vector<Column>& columns() const
  {
    return columns_;
  }

protected:
  std::vector<Column> columns_;
};

// A reader of a message type such as "sensor_msgs/JointState". Throws std::invalid_argument, which names the types that exist here.
std::unique_ptr<Reader> makeReader(const std::string& type);

}  // namespace hric_perception

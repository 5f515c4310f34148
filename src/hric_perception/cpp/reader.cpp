#include "readers.h"

namespace hric_perception
{

std::unique_ptr<Reader> makeReader(const std::string& type)
{
  using Make = std::unique_ptr<Reader> (*)();
  static const std::map<std::string, Make> TYPES{
    { "geometry_msgs/PointStamped", [] { return std::unique_ptr<Reader>(new FixedReader<geometry_msgs::PointStamped>); } },
    { "geometry_msgs/PoseStamped", [] { return std::unique_ptr<Reader>(new FixedReader<geometry_msgs::PoseStamped>); } },
    { "geometry_msgs/TwistStamped", [] { return std::unique_ptr<Reader>(new FixedReader<geometry_msgs::TwistStamped>); } },
    { "geometry_msgs/WrenchStamped", [] { return std::unique_ptr<Reader>(new FixedReader<geometry_msgs::WrenchStamped>); } },
    { "hric_msgs/ControlLog", [] { return std::unique_ptr<Reader>(new TableReader<hric_msgs::ControlLog>); } },
    { "hric_msgs/MocapData", [] { return std::unique_ptr<Reader>(new MocapReader); } },
    { "hric_msgs/SampleChunk", [] { return std::unique_ptr<Reader>(new TableReader<hric_msgs::SampleChunk>); } },
    { "sensor_msgs/JointState", [] { return std::unique_ptr<Reader>(new TableReader<sensor_msgs::JointState>); } },
  };
  const auto found = TYPES.find(type);
  if (found != TYPES.end())
    return found->second();
  std::string valid;
  for (const auto& [name, make] : TYPES)
    valid += (valid.empty() ? "" : ", ") + name;
  throw std::invalid_argument("type '" + type + "'; valid here: " + valid);
}

}  // namespace hric_perception

// The node: sources, filter, and what is told of them.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <hric_msgs/SyncLayout.h>
#include <ros/ros.h>

#include "joiner.h"
#include "reader.h"

namespace hric_perception
{

struct Source
{
  std::string topic;
  std::unique_ptr<Reader> reader;
  ros::Subscriber subscriber;
  double timeout = 0.5;  // [s of wall time]
  ros::WallTime heard, refused_at;
  ros::Time first, last;  // stamps of the samples of the last whole second, for the rate
  uint64_t samples = 0, counted = 0, malformed = 0, other = 0, refused = 0;
  float rate = 0.0F;  // [Hz]
  double skew_sum = 0.0, skew_max = 0.0;
  uint64_t skews = 0;
};

class SynchronizerNode
{
public:
  // Reads the private parameters and begins. Throws std::invalid_argument with one line for the user.
  SynchronizerNode();

private:
  void readSources(const XmlRpc::XmlRpcValue& plan);
  void readSource(const XmlRpc::XmlRpcValue& entry, const std::string& where);
  void begin(const std::string& topic, std::size_t queue);
  Sink sink(std::size_t index);
  bool belongs(const ros::Time& stamp);
  void makeFilter();
  void take(std::size_t index, const SamplePtr& sample);
  void publish(const std::vector<SamplePtr>& set);
  void publishLayout();
  void report();
  std::string starving(const Source& source) const;
  void diagnose();

  ros::NodeHandle node_, private_{ "~" };
  std::vector<Source> sources_;
  hric_msgs::SyncLayout layout_;
  std::size_t reference_ = 0;
  double tolerance_ = 0.01;
  std::unique_ptr<Joiner> joiner_;
  ros::Publisher samples_, layouts_, statuses_, diagnostics_;
  ros::WallTimer timer_;
  ros::WallTime begun_;
  ros::Time last_, newest_;
  ros::WallTime agreed_;
  std::size_t queue_ = 0;
  double waited_ = 0.0;
  uint64_t sent_ = 0;
  unsigned reports_ = 0;
  std::string told_;
};

}  // namespace hric_perception

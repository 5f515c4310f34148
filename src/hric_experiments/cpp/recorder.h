// Subscribes to topics of any type and passes the messages to the writer.
#pragma once

#include <map>
#include <string>

#include <ros/callback_queue.h>
#include <ros/ros.h>

#include "bag_writer.h"
#include "options.h"

namespace hric_experiments
{

class Recorder
{
public:
  Recorder(const Options& options, BagWriter& writer);

  // Passes on the messages received since the last call.
  void take();

  // Reports that the run does not have to wait for the recording any more.
  ~Recorder()
  {
    report(ros::Time());
  }

private:
  void report(const ros::Time& reached);  // 0: the recording has ended
  void lookForTopics();
  bool chosen(const std::string& topic) const;
  void subscribe(const std::string& topic);

  const Options& options_;
  BagWriter& writer_;
  ros::CallbackQueue queue_;
  ros::NodeHandle node_;
  std::map<std::string, ros::Subscriber> subscribers_;
  ros::Publisher progress_;
  ros::WallTime next_look_, next_report_;
};

}  // namespace hric_experiments

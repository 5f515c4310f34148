// Subscriber to topics of any type, which passes their messages to a bag writer.
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

  // Passes the messages received since the last call to the writer; subscribes to new topics.
  void take();

  // Reports that the simulation no longer has to wait for the recorder.
  ~Recorder()
  {
    report(ros::Time());
  }

private:
  void report(
      const ros::Time& reached);  // reached: time up to which messages were received; 0: the recording has ended
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

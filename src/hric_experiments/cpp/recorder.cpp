#include "recorder.h"

#include <functional>

#include <ros/master.h>
#include <std_msgs/Header.h>

namespace hric_experiments
{
namespace
{

const ros::WallDuration LOOK_PERIOD(0.5);  // period of the query for new topics at the master
// A simulation with a limited real-time factor waits for the nodes that report their progress on this topic
// (hric_core.robot_time.progress).
constexpr char PROGRESS_TOPIC[] = "hric/progress";
const ros::WallDuration PROGRESS_PERIOD(0.05);

}  // namespace

Recorder::Recorder(const Options& options, BagWriter& writer) : options_(options), writer_(writer)
{
  node_.setCallbackQueue(&queue_);
  progress_ = node_.advertise<std_msgs::Header>(PROGRESS_TOPIC, 10);
  for (const std::string& topic : options.topics)
    subscribe(ros::names::resolve(topic));
}

void Recorder::take()
{
  if (options_.topics.empty() && ros::WallTime::now() >= next_look_)
  {
    lookForTopics();
    next_look_ = ros::WallTime::now() + LOOK_PERIOD;
  }
  const ros::Time reached = ros::Time::now();  // time of /clock; earlier messages have arrived or are in the queue
  queue_.callAvailable();
  if (ros::Time::isSimTime() && ros::WallTime::now() >= next_report_)
  {
    report(reached);
    next_report_ = ros::WallTime::now() + PROGRESS_PERIOD;
  }
}

void Recorder::report(const ros::Time& reached)
{
  std_msgs::Header progress;
  progress.stamp = reached;
  progress.frame_id = ros::this_node::getName();
  progress_.publish(progress);
}

void Recorder::lookForTopics()
{
  ros::master::V_TopicInfo topics;
  if (!ros::master::getTopics(topics))
    return;
  for (const ros::master::TopicInfo& topic : topics)
    if (chosen(topic.name))
      subscribe(topic.name);
}

bool Recorder::chosen(const std::string& topic) const
{
  return subscribers_.count(topic) == 0 && !(options_.exclude && std::regex_match(topic, *options_.exclude));
}

void Recorder::subscribe(const std::string& topic)
{
  using Event = ros::MessageEvent<const topic_tools::ShapeShifter>;
  ros::SubscribeOptions options;
  options.topic = topic;
  options.queue_size = 0;  // unlimited: messages sent while this process is not scheduled must not be lost
  options.md5sum = ros::message_traits::md5sum<topic_tools::ShapeShifter>();
  options.datatype = ros::message_traits::datatype<topic_tools::ShapeShifter>();
  options.helper = boost::make_shared<ros::SubscriptionCallbackHelperT<const Event&>>(
      [this, topic](const Event& event) { writer_.put({ topic, event }); });
  subscribers_[topic] = node_.subscribe(options);
}

}  // namespace hric_experiments

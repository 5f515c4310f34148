// Program bag_recorder: records topics into one bag; started and monitored by the node recorder.
#include <csignal>
#include <cstring>
#include <iostream>
#include <stdexcept>

#include <ros/master.h>
#include <ros/ros.h>

#include "bag_writer.h"
#include "options.h"
#include "recorder.h"

namespace
{

constexpr char HELP[] =
    "Record topics into a bag until SIGINT or SIGTERM. The bag is called BAG.active until it is closed.\n"
    "Usage: rosrun hric_experiments bag_recorder BAG [--exclude EXPRESSION] [TOPIC...]\n"
    "Without TOPIC all topics are recorded, except those whose complete name matches the regular expression "
    "EXPRESSION. "
    "Run folders, splitting and free disk space are managed by the node recorder.\n";
// Polling period of received messages, which are stamped at their receipt; one wake-up processes many of them.
const ros::WallDuration PERIOD(0.01);

// Time limit for calls to a dead master, which roscpp would repeat forever.
const ros::WallDuration MASTER_TIMEOUT(1.0);

constexpr int INTERRUPTED = 130;

volatile std::sig_atomic_t ending = 0;

void end(int)
{
  ending = 1;
}

// Waits for the master; roscpp would also wait, but without reacting to signals.
bool waitForMaster()
{
  for (bool reported = false; !ending; ros::WallDuration(0.1).sleep())
  {
    if (ros::master::check())
      return true;
    if (!reported)
      std::cerr << "bag_recorder: the ROS master at " << ros::master::getURI() << " does not respond; waiting for it"
                << std::endl;
    reported = true;
  }
  return false;
}

int record(const hric_experiments::Options& options)
{
  const ros::NodeHandle alive;
  hric_experiments::BagWriter writer(options.bag);
  {
    hric_experiments::Recorder recorder(options, writer);
    while (!ending && ros::ok() && !writer.failed())
    {
      recorder.take();
      PERIOD.sleep();
    }
    recorder.take();
  }
  if (writer.dropped())
    ROS_ERROR("%s: %lu messages were dropped, because the disk was too slow and the queue in memory was full",
              options.bag.c_str(), writer.dropped());
  writer.finish();
  return 0;
}

}  // namespace

int main(int argc, char** argv)
{
  if (argc > 1 && (!std::strcmp(argv[1], "--help") || !std::strcmp(argv[1], "-h")))
  {
    std::cout << HELP;
    return 0;
  }
  ros::init(argc, argv, "bag_recorder", ros::init_options::NoSigintHandler);
  std::signal(SIGINT, end);
  std::signal(SIGTERM, end);
  ros::master::setRetryTimeout(MASTER_TIMEOUT);
  try
  {
    const hric_experiments::Options options = hric_experiments::readOptions({ argv + 1, argv + argc });
    return waitForMaster() ? record(options) : INTERRUPTED;
  }
  catch (const std::invalid_argument& error)
  {
    std::cerr << "bag_recorder: " << error.what() << std::endl;
    return 2;
  }
  catch (const rosbag::BagException& error)
  {
    std::cerr << "bag_recorder: " << error.what() << std::endl;  // the node has shut down, so ROS does not log this
    return 1;
  }
}

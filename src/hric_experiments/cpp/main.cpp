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
    "Records topics into a bag until SIGINT or SIGTERM: BAG.active until it is closed.\n"
    "Usage: rosrun hric_experiments bag_recorder BAG [--exclude EXPRESSION] [TOPIC...]\n"
    "Without topics: all, but for those whose whole name EXPRESSION fits. Run folders, splitting and free space are "
    "the node recorder's.\n";
// Polling period of the messages, which have their receipt stamps already; one wake-up takes many of them.
const ros::WallDuration PERIOD(0.01);

// Limits calls to a dead master, which roscpp would repeat for ever.
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
    ROS_ERROR("%s: %lu messages found no room in memory, since the disk did not keep up", options.bag.c_str(),
              writer.dropped());
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

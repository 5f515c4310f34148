// The node synchronizer_cpp: policies exact and approximate through message_filters. INTERFACE.md lists topics and parameters.
#include <cstring>
#include <iostream>
#include <stdexcept>

#include "node.h"

int main(int argc, char** argv)
{
  for (int index = 1; index < argc; ++index)
    if (!std::strcmp(argv[index], "--help") || !std::strcmp(argv[index], "-h"))
    {
      std::cout << "Samples of 2 to " << hric_perception::MOST_SOURCES << " sources of the same or almost the same stamp, by message_filters.\n"
                << "Usage: rosrun hric_perception synchronizer_cpp _plan:=\"{policy: approximate, reference: TOPIC, sources: [...]}\"\n"
                << "INTERFACE.md of hric_perception lists topics and parameters.\n";
      return 0;
    }
  ros::init(argc, argv, "synchronizer");
  const ros::NodeHandle alive;  // without one, nothing is logged any more
  try
  {
    hric_perception::SynchronizerNode node;
    ros::spin();
  }
  catch (const std::invalid_argument& error)
  {
    ROS_FATAL("%s", error.what());
    return 1;
  }
  return 0;
}

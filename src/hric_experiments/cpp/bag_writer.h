// Messages on their way into a bag, in a thread of their own: a disk that stalls holds nobody who sends.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <string>
#include <thread>

#include <ros/message_event.h>
#include <rosbag/bag.h>
#include <topic_tools/shape_shifter.h>

namespace hric_experiments
{

struct Message
{
  std::string topic;
  ros::MessageEvent<const topic_tools::ShapeShifter> event;
};

class BagWriter
{
public:
  // Opens `<path>.active`. Throws rosbag::BagException.
  explicit BagWriter(const std::string& path);
  ~BagWriter();

  // Never waits for the disk.
  void put(Message message);

  // Writes what was put, closes the bag and gives it its name. Throws rosbag::BagException, also for what failed
  // before.
  void finish();

  // Whether the disk refused something: nothing more is written.
  bool failed() const;

  // Messages that found no room in memory.
  uint64_t dropped() const;

private:
  void work();
  void write(const Message& message);
  void endChunk();
  void fail(const std::string& reason);

  const std::string path_;
  rosbag::Bag bag_;
  mutable std::mutex mutex_;
  std::condition_variable something_;
  std::deque<Message> waiting_;
  std::size_t bytes_ = 0;
  uint64_t dropped_ = 0;
  bool finishing_ = false;
  bool fresh_ = false, filling_ = false;  // whether a chunk is open, and whether the next message fills one
  std::size_t buffered_ = 0;              // of messages that librosbag keeps a copy of [B]
  std::string failure_;
  std::thread thread_;
};

}  // namespace hric_experiments

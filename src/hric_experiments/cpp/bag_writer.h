// Writer of a bag in a separate thread, so that a stalled disk does not block the subscribers.
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

  // Queues a message without waiting for the disk.
  void put(Message message);

  // Writes the queued messages, closes the bag and renames it to its final path. Throws rosbag::BagException if this
  // or an earlier write failed.
  void finish();

  // Returns true if a write failed; no more messages are written then.
  bool failed() const;

  // Returns the number of messages that were dropped because the queue was full.
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
  bool fresh_ = false, filling_ = false;  // true if a chunk is open; true if the next message shall fill a chunk alone
  std::size_t buffered_ = 0;              // size of the messages of which librosbag has a copy [B]
  std::string failure_;
  std::thread thread_;
};

}  // namespace hric_experiments

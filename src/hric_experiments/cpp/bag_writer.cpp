#include "bag_writer.h"

#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>

#include <ros/console.h>

namespace hric_experiments
{
namespace
{

constexpr std::size_t MAX_WAITING = std::size_t{ 1 }
                                    << 30;   // maximum size of the queue in memory [B]; project default, unconfirmed
constexpr uint32_t CHUNK_SIZE = 768 * 1024;  // before compression [B]; default of rosbag
// Maximum age of an open chunk; it is lost if the recorder is killed. Closing a chunk costs two seeks on the disk.
constexpr std::chrono::milliseconds CHUNK_TIME{ 400 };
// Polling period of the queue; one wake-up writes many messages.
constexpr std::chrono::milliseconds PERIOD{ 20 };

std::string active(const std::string& path)
{
  return path + ".active";
}

// Returns a stamp that a bag accepts: 0, which in ROS means that there is no time yet, is replaced by the minimum.
ros::Time stamp(const ros::Time& received)
{
  return received < ros::TIME_MIN ? ros::TIME_MIN : received;
}

}  // namespace

BagWriter::BagWriter(const std::string& path) : path_(path)
{
  bag_.open(active(path), rosbag::bagmode::Write);
  bag_.setCompression(rosbag::compression::LZ4);
  bag_.setChunkThreshold(CHUNK_SIZE);
  thread_ = std::thread(&BagWriter::work, this);
}

BagWriter::~BagWriter()
{
  try
  {
    finish();
  }
  catch (const rosbag::BagException& error)
  {
    ROS_ERROR("%s", error.what());
  }
}

void BagWriter::put(Message message)
{
  const std::size_t size = message.event.getConstMessage()->size();
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!failure_.empty())
    return;
  if (bytes_ + size > MAX_WAITING)
  {
    ROS_ERROR_COND(dropped_ == 0, "%s: the disk is too slow and the queue in memory is full: messages are dropped",
                   path_.c_str());
    ++dropped_;
    return;
  }
  bytes_ += size;
  waiting_.push_back(std::move(message));
}

void BagWriter::finish()
{
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    finishing_ = true;
  }
  something_.notify_one();
  if (!thread_.joinable())
    return;
  thread_.join();
  if (!failure_.empty())
    throw rosbag::BagIOException(failure_);
  bag_.close();
  if (std::rename(active(path_).c_str(), path_.c_str()) != 0)
    throw rosbag::BagIOException(path_ + " cannot be renamed to its final name: " + std::strerror(errno));
}

bool BagWriter::failed() const
{
  const std::lock_guard<std::mutex> lock(mutex_);
  return !failure_.empty();
}

uint64_t BagWriter::dropped() const
{
  const std::lock_guard<std::mutex> lock(mutex_);
  return dropped_;
}

void BagWriter::work()
{
  auto closing = std::chrono::steady_clock::now() + CHUNK_TIME;
  for (bool going_on = true; going_on;)
  {
    std::deque<Message> messages;
    {
      std::unique_lock<std::mutex> lock(mutex_);
      going_on = !something_.wait_for(lock, PERIOD, [this] { return finishing_; });
      messages.swap(waiting_);
      bytes_ = 0;
    }
    try
    {
      for (const Message& message : messages)
        write(message);
      if (const auto now = std::chrono::steady_clock::now(); now >= closing)
      {
        endChunk();
        closing = now + CHUNK_TIME;
      }
    }
    catch (const rosbag::BagException& error)
    {
      fail(error.what());
      return;
    }
  }
}

void BagWriter::write(const Message& message)
{
  bag_.write(message.topic, stamp(message.event.getReceiptTime()), *message.event.getConstMessage(),
             message.event.getConnectionHeaderPtr());
  fresh_ = true;
  buffered_ += message.event.getConstMessage()->size();
  if (filling_)
  {
    bag_.setChunkThreshold(CHUNK_SIZE);
    filling_ = fresh_ = false;
    buffered_ = 0;
  }
}

void BagWriter::endChunk()
{
  if (!fresh_)
    return;
  // Setting any threshold closes the open chunk. But librosbag frees its copy of the messages only when a chunk becomes
  // full, so from time to time a threshold of 1 makes the next message fill a chunk alone.
  filling_ = buffered_ > CHUNK_SIZE;
  bag_.setChunkThreshold(filling_ ? 1 : CHUNK_SIZE);
  fresh_ = false;
}

void BagWriter::fail(const std::string& reason)
{
  const std::lock_guard<std::mutex> lock(mutex_);
  failure_ = active(path_) + " cannot be written: " + reason;
  waiting_.clear();
}

}  // namespace hric_experiments

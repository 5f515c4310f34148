// The readers of each kind of type.
#pragma once

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <sstream>
#include <utility>

#include <boost/make_shared.hpp>
#include <hric_msgs/MocapData.h>

#include "fixed_types.h"
#include "reader.h"
#include "table_types.h"

namespace hric_perception
{

constexpr uint32_t QUEUE = 2000;  // messages that wait to be looked at
constexpr std::size_t NONE = std::numeric_limits<std::size_t>::max();

template <class Message>
class TypedReader : public Reader
{
public:
  ros::Subscriber subscribe(ros::NodeHandle& node, const std::string& topic, Sink sink) override
  {
    sink_ = std::move(sink);
    return node.subscribe<Message>(topic, QUEUE, [this](const boost::shared_ptr<Message const>& message) { read(*message); },
                                   ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay());
  }

protected:
  virtual void read(const Message& message) = 0;

  void put(const Message& message, double offset, std::vector<double> values)
  {
    auto sample = boost::make_shared<Sample>();
    sample->header = message.header;
    sample->header.stamp += ros::Duration().fromNSec(std::llround(offset * 1e9));
    sample->values = std::move(values);
    sink_.sample(sample);
  }

  Sink sink_;
};

template <class Message>
class FixedReader : public TypedReader<Message>
{
public:
  void choose(const std::string& field, const std::string& unit) override
  {
    const auto leaves = Fixed<Message>::leaves();
    for (const auto index : below(leaves, field, ros::message_traits::datatype<Message>()))
    {
      chosen_.push_back(index);
      this->columns_.push_back({ leaves[index].name, unit.empty() ? leaves[index].unit : unit });
    }
  }

protected:
  void read(const Message& message) override
  {
    std::array<double, 7> all{};
    Fixed<Message>::read(message, all.data());
    std::vector<double> values;
    for (const auto index : chosen_)
      values.push_back(all[index]);
    this->put(message, 0.0, std::move(values));
  }

private:
  std::vector<std::size_t> chosen_;
};

// The number of an element, which is given by number or by name; NONE: it is not there.
inline std::size_t find(const std::string& chosen, const Names& names)
{
  if (chosen.find_first_not_of("0123456789") == std::string::npos)
    return std::stoul(chosen);
  const auto found = std::find(names.begin(), names.end(), chosen);
  return found == names.end() ? NONE : static_cast<std::size_t>(found - names.begin());
}

template <class Message>
class TableReader : public TypedReader<Message>
{
public:
  void choose(const std::string& field, const std::string& unit) override
  {
    const auto lists = Table<Message>::lists();
    const Path path = readPath(field);
    const auto list = below(lists, path.head, ros::message_traits::datatype<Message>()).front();
    if (path.head.empty() || path.chosen.empty() || !path.rest.empty())
      throw std::invalid_argument("field '" + field + "'; valid: elements in brackets, such as " + lists[list].name + "[0]");
    for (const auto& name : path.chosen)
    {
      chosen_.emplace_back(list, name);
      this->columns_.push_back({ path.head + "[" + name + "]", unit.empty() ? lists[list].unit : unit });
    }
  }

protected:
  void read(const Message& message) override
  {
    const std::size_t rows = Table<Message>::rows(message), width = Table<Message>::names(message).size();
    if (rows == 0)
      return this->sink_.malformed();
    if (!locate(message, rows, width))
      return;
    tellUnits(message);
    for (std::size_t row = 0; row < rows; ++row)
    {
      std::vector<double> values;
      for (std::size_t column = 0; column < chosen_.size(); ++column)
        values.push_back(Table<Message>::list(message, chosen_[column].first)[row * width + where_[column]]);
      this->put(message, Table<Message>::offset(message, row), std::move(values));
    }
  }

private:
  // Where the chosen elements stand in a row.
  bool locate(const Message& message, std::size_t rows, std::size_t width)
  {
    where_.clear();
    for (const auto& [list, name] : chosen_)
    {
      const std::size_t size = Table<Message>::list(message, list).size(), index = find(name, Table<Message>::names(message));
      if (rows > 1 && size != rows * width)
        return this->sink_.malformed(), false;
      if (index == NONE || index >= size / rows)
        return this->sink_.other(), false;
      where_.push_back(index);
    }
    return true;
  }

  void tellUnits(const Message& message)
  {
    const std::string unit = Table<Message>::unit(message);
    if (unit.empty() || told_)
      return;
    told_ = true;
    std::istringstream words(unit);
    const std::vector<std::string> each{ std::istream_iterator<std::string>(words), {} };
    const bool by_channel = each.size() == Table<Message>::names(message).size();
    std::vector<std::string> units;
    for (std::size_t column = 0; column < where_.size(); ++column)
      units.push_back(by_channel ? each[where_[column]] : unit);
    this->sink_.units(units);
  }

  std::vector<std::pair<std::size_t, std::string>> chosen_;  // list, element
  std::vector<std::size_t> where_;
  bool told_ = false;
};

class MocapReader : public TypedReader<hric_msgs::MocapData>
{
public:
  void choose(const std::string& field, const std::string& unit) override
  {
    static const std::vector<Leaf> LEAVES{ { "pose.position.x", "m" },    { "pose.position.y", "m" },    { "pose.position.z", "m" },
                                           { "pose.orientation.x", "1" }, { "pose.orientation.y", "1" }, { "pose.orientation.z", "1" },
                                           { "pose.orientation.w", "1" }, { "mean_error", "m" },         { "tracking_valid", "" } };
    const Path path = readPath(field);
    if (path.head != "rigid_bodies" || path.chosen.empty() || path.rest.empty())
      throw std::invalid_argument("field '" + field + "' of hric_msgs/MocapData; valid here: rigid_bodies[NAME].pose, or what is below it");
    for (const auto& name : path.chosen)
      for (const auto index : below(LEAVES, path.rest, "hric_msgs/RigidBodyState"))
      {
        chosen_.emplace_back(name, index);
        columns_.push_back({ "rigid_bodies[" + name + "]." + LEAVES[index].name, unit.empty() ? LEAVES[index].unit : unit });
      }
  }

protected:
  void read(const hric_msgs::MocapData& message) override
  {
    std::vector<double> values;
    for (const auto& [name, index] : chosen_)
      values.push_back(value(message, name, index));
    put(message, 0.0, std::move(values));
  }

private:
  static constexpr std::size_t POSE = 7, MEAN_ERROR = 7;

  // Not a number where the body is not seen.
  static double value(const hric_msgs::MocapData& message, const std::string& name, std::size_t index)
  {
    const bool number = name.find_first_not_of("0123456789") == std::string::npos;
    std::size_t position = 0;
    for (const auto& body : message.rigid_bodies)
    {
      if (number ? position++ != std::stoul(name) : body.name != name)
        continue;
      if (index > MEAN_ERROR)
        return body.tracking_valid;
      if (!body.tracking_valid)
        return std::nan("");
      std::array<double, POSE> pose;
      fill(pose.data(), body.pose);
      return index < POSE ? pose[index] : static_cast<double>(body.mean_error);
    }
    return index > MEAN_ERROR ? 0.0 : std::nan("");
  }

  std::vector<std::pair<std::string, std::size_t>> chosen_;  // body, leaf
};

}  // namespace hric_perception

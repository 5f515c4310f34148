#include "node.h"

#include <algorithm>
#include <cmath>

#include <hric_msgs/SyncedSample.h>
#include <hric_msgs/SyncStatus.h>

#include <diagnostic_msgs/DiagnosticArray.h>

namespace hric_perception
{
namespace
{

constexpr double STATUS_PERIOD = 0.2;  // [s]
constexpr unsigned STATUSES = 5;       // per diagnostics (1 Hz, REP 107)
constexpr double AGREE = 1.0;          // stamps within this of the newest one are of the same time [s]
constexpr double SILENCE = 0.5;        // where nothing of the time so far came for as long, another one begins [s]
constexpr uint32_t QUEUE = 4000;       // samples that wait for a listener that is slow

}  // namespace

void SynchronizerNode::begin(const std::string& topic, std::size_t queue)
{
  queue_ = queue;
  makeFilter();
  layout_.interpolations.assign(layout_.names.size(), layout_.policy == "exact" ? "exact" : "nearest");
  samples_ = node_.advertise<hric_msgs::SyncedSample>(topic, QUEUE);
  layouts_ = node_.advertise<hric_msgs::SyncLayout>(topic + "_layout", 1, true);
  statuses_ = node_.advertise<hric_msgs::SyncStatus>(topic + "_status", 10);
  diagnostics_ = node_.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10);
  layouts_.publish(layout_);
  begun_ = ros::WallTime::now();
  for (std::size_t index = 0; index < sources_.size(); ++index)
    sources_[index].subscriber = sources_[index].reader->subscribe(node_, sources_[index].topic, sink(index));
  timer_ = node_.createWallTimer(ros::WallDuration(STATUS_PERIOD), [this](const ros::WallTimerEvent&) { report(); });
}

Sink SynchronizerNode::sink(std::size_t index)
{
  Source* const source = &sources_[index];
  std::size_t first = 0;
  for (std::size_t before = 0; before < index; ++before)
    first += sources_[before].reader->columns().size();
  const auto units = [this, first](const std::vector<std::string>& by_column) {
    for (std::size_t column = 0; column < by_column.size(); ++column)
      if (layout_.units[first + column].empty())
        layout_.units[first + column] = by_column[column];
    layouts_.publish(layout_);
  };
  return { [this, index](const SamplePtr& sample) { take(index, sample); }, [source] { ++source->malformed; }, [source] { ++source->other; }, units };
}

void SynchronizerNode::take(std::size_t index, const SamplePtr& sample)
{
  Source& source = sources_[index];
  const ros::Time stamp = sample->header.stamp;
  if (!belongs(stamp) || (!source.last.isZero() && stamp <= source.last))
  {
    ++source.refused;
    source.refused_at = ros::WallTime::now();
    return;
  }
  source.heard = ros::WallTime::now();
  source.last = stamp;
  ++source.samples;
  if (source.first.isZero() || stamp < source.first)
  {
    source.first = stamp;
    source.counted = 0;
  }
  else
    ++source.counted;
  if ((stamp - source.first).toSec() >= 1.0)
  {
    source.rate = static_cast<float>(static_cast<double>(source.counted) / (stamp - source.first).toSec());
    source.first = stamp;
    source.counted = 0;
  }
  joiner_->push(index, sample);
}

// Whether a stamp is of the time that the sources agree on (CommonTime of the Python node). The filters take order for granted: one stamp of another
// time, and they hand out nothing more. Where all sources went over to another time, the filter is made anew.
bool SynchronizerNode::belongs(const ros::Time& stamp)
{
  const ros::WallTime now = ros::WallTime::now();
  const bool same = newest_.isZero() || std::abs((stamp - newest_).toSec()) <= AGREE;
  if (!same && (now - agreed_).toSec() <= SILENCE)
    return false;
  agreed_ = now;
  newest_ = same ? std::max(newest_, stamp) : stamp;
  if (!same)
  {
    makeFilter();
    for (Source& source : sources_)
      source.first = source.last = ros::Time();
  }
  return true;
}

void SynchronizerNode::makeFilter()
{
  joiner_ = makeJoiner(layout_.policy, sources_.size(), queue_, tolerance_, [this](const std::vector<SamplePtr>& set) { publish(set); });
}

void SynchronizerNode::publish(const std::vector<SamplePtr>& set)
{
  hric_msgs::SyncedSample message;
  message.header.stamp = last_ = set[reference_]->header.stamp;
  for (std::size_t index = 0; index < set.size(); ++index)
  {
    const auto& values = set[index]->values;
    const double age = (last_ - set[index]->header.stamp).toSec();
    message.values.insert(message.values.end(), values.begin(), values.end());
    message.age.push_back(static_cast<float>(age));
    message.valid.push_back(std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); }));
    Source& source = sources_[index];
    source.skew_sum += std::abs(age);
    source.skew_max = std::max(source.skew_max, std::abs(age));
    ++source.skews;
    waited_ = std::max(waited_, (source.last - last_).toSec());
  }
  ++sent_;
  samples_.publish(message);
}

std::string SynchronizerNode::starving(const Source& source) const
{
  const double silence = (ros::WallTime::now() - (source.heard.isZero() ? begun_ : source.heard)).toSec();
  if (silence <= source.timeout)
    return "";
  if (source.other + source.malformed + source.refused > 0 && source.samples == 0)
    return "only messages without the values wanted";
  if (source.refused_at > source.heard)
    return "only samples that are stamped with another time, or not later than those before";
  return source.heard.isZero() ? "never heard" : "silent";
}

void SynchronizerNode::report()
{
  hric_msgs::SyncStatus message;
  message.header.stamp = last_;
  std::string told;
  for (Source& source : sources_)
  {
    const std::string reason = starving(source);
    told += reason.empty() ? "" : (told.empty() ? "" : "; ") + source.topic + ": " + reason;
    message.sources.push_back(source.topic);
    message.samples.push_back(source.samples);
    message.rate.push_back(source.rate);
    message.starving.push_back(!reason.empty());
    message.reasons.push_back(reason);
    message.refused.push_back(source.malformed + source.refused);
    message.late.push_back(0);
    message.skew_mean.push_back(source.skews ? static_cast<float>(source.skew_sum / static_cast<double>(source.skews)) : 0.0F);
    message.skew_max.push_back(static_cast<float>(source.skew_max));
  }
  message.sent = sent_;
  const uint64_t instants = sources_[reference_].samples;
  message.dropped = instants > sent_ ? instants - sent_ : 0;
  message.delay = static_cast<float>(waited_);
  statuses_.publish(message);
  const bool changed = told != told_;
  told_ = told;
  if (changed && !told.empty())
    ROS_ERROR_STREAM(ros::this_node::getName() << ": starving: " << told);
  if (changed || ++reports_ % STATUSES == 0)
    diagnose();
}

void SynchronizerNode::diagnose()
{
  diagnostic_msgs::DiagnosticArray message;
  message.header.stamp = ros::Time::now();
  diagnostic_msgs::DiagnosticStatus state;
  state.name = ros::this_node::getName().substr(1) + ": sources";
  state.level = told_.empty() ? diagnostic_msgs::DiagnosticStatus::OK : diagnostic_msgs::DiagnosticStatus::ERROR;
  state.message = told_.empty() ? std::to_string(sources_.size()) + " sources" : "starving: " + told_;
  const auto tell = [&state](const std::string& key, double value) {
    diagnostic_msgs::KeyValue pair;
    pair.key = key;
    pair.value = std::to_string(value);
    state.values.push_back(pair);
  };
  tell("sent", static_cast<double>(sent_));
  tell("longest delay [ms]", 1e3 * waited_);
  for (Source& source : sources_)
  {
    tell(source.topic + " rate [Hz]", source.rate);
    tell(source.topic + " samples", static_cast<double>(source.samples));
    tell(source.topic + " skew, largest [ms]", 1e3 * source.skew_max);
    tell(source.topic + " refused", static_cast<double>(source.malformed + source.refused));
    source.skew_sum = source.skew_max = 0.0;
    source.skews = 0;
  }
  waited_ = 0.0;
  message.status.push_back(state);
  diagnostics_.publish(message);
}

}  // namespace hric_perception

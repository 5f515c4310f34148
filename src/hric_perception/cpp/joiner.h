// The filters of message_filters, for a number of sources that is known at run time only.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "sample.h"

namespace hric_perception
{

constexpr std::size_t MOST_SOURCES = 6;  // the filters' type has a parameter for each of them; each number is compiled
using Joined = std::function<void(const std::vector<SamplePtr>&)>;

// Takes samples of all sources and hands out sets of one of each.
class Joiner
{
public:
  virtual ~Joiner() = default;

  // A sample of a source; the set that it completes, if any, is handed out before this returns.
  virtual void push(std::size_t source, const SamplePtr& sample) = 0;
};

// policy: "exact" or "approximate"; sources: 2 to MOST_SOURCES; queue: samples kept per source; tolerance: largest span of a set [s].
std::unique_ptr<Joiner> makeJoiner(const std::string& policy, std::size_t sources, std::size_t queue, double tolerance, Joined joined);

}  // namespace hric_perception

#include "joiner.h"

#include <stdexcept>
#include <utility>

#include <message_filters/pass_through.h>
#include <message_filters/sync_policies/approximate_time.h>
#include <message_filters/sync_policies/exact_time.h>
#include <message_filters/synchronizer.h>

namespace hric_perception
{
namespace
{

template <std::size_t>
using Each = Sample;

// The filters call back with nine arguments, of which those beyond the number of sources are of no type.
struct Gather
{
  using result_type = void;

  template <class... Parts>
  void operator()(const Parts&... parts) const
  {
    std::vector<SamplePtr> found;
    (take(found, parts), ...);
    joined(found);
  }

  static void take(std::vector<SamplePtr>& found, const SamplePtr& part)
  {
    found.push_back(part);
  }

  template <class Nothing>
  static void take(std::vector<SamplePtr>&, const boost::shared_ptr<Nothing const>&)
  {
  }

  Joined joined;
};

template <class Policy, std::size_t... Index>
class FilterJoiner : public Joiner
{
public:
  FilterJoiner(const Policy& policy, Joined joined) : filter_(policy)
  {
    filter_.connectInput(inputs_[Index]...);
    filter_.registerCallback(Gather{ std::move(joined) });
  }

  void push(std::size_t source, const SamplePtr& sample) override
  {
    inputs_[source].add(sample);
  }

private:
  message_filters::PassThrough<Sample> inputs_[sizeof...(Index)];
  message_filters::Synchronizer<Policy> filter_;
};

template <std::size_t... Index>
std::unique_ptr<Joiner> make(bool exact, std::size_t queue, double tolerance, Joined joined, std::index_sequence<Index...>)
{
  using Exact = message_filters::sync_policies::ExactTime<Each<Index>...>;
  using Approximate = message_filters::sync_policies::ApproximateTime<Each<Index>...>;
  const auto size = static_cast<uint32_t>(queue);
  if (exact)
    return std::make_unique<FilterJoiner<Exact, Index...>>(Exact(size), std::move(joined));
  Approximate policy(size);
  policy.setMaxIntervalDuration(ros::Duration(tolerance));
  return std::make_unique<FilterJoiner<Approximate, Index...>>(policy, std::move(joined));
}

}  // namespace

std::unique_ptr<Joiner> makeJoiner(const std::string& policy, std::size_t sources, std::size_t queue, double tolerance, Joined joined)
{
  if (policy != "exact" && policy != "approximate")
    throw std::invalid_argument("plan/policy is '" + policy + "'; valid here: exact, approximate (resample: the node synchronizer)");
  const bool exact = policy == "exact";
  switch (sources)
  {
    case 2:
      return make(exact, queue, tolerance, std::move(joined), std::make_index_sequence<2>());
    case 3:
      return make(exact, queue, tolerance, std::move(joined), std::make_index_sequence<3>());
    case 4:
      return make(exact, queue, tolerance, std::move(joined), std::make_index_sequence<4>());
    case 5:
      return make(exact, queue, tolerance, std::move(joined), std::make_index_sequence<5>());
    case 6:
      return make(exact, queue, tolerance, std::move(joined), std::make_index_sequence<6>());
    default:
      throw std::invalid_argument("plan/sources has " + std::to_string(sources) + " sources; valid here: 2 to " + std::to_string(MOST_SOURCES));
  }
}

}  // namespace hric_perception

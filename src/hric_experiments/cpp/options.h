// Command-line options of bag_recorder.
#pragma once

#include <optional>
#include <regex>
#include <string>
#include <vector>

namespace hric_experiments
{

struct Options
{
  std::string bag;                    // final path of the bag
  std::vector<std::string> topics;    // topics to record; empty: all, including topics that appear later
  std::optional<std::regex> exclude;  // topics whose full name matches are not recorded if `topics` is empty
};

// Parses the arguments after the program name. Throws std::invalid_argument with a message for the user.
Options readOptions(const std::vector<std::string>& arguments);

}  // namespace hric_experiments

// Command line of the recorder.
#pragma once

#include <optional>
#include <regex>
#include <string>
#include <vector>

namespace hric_experiments
{

struct Options
{
  std::string bag;                    // final path
  std::vector<std::string> topics;    // empty: all, including topics that appear later
  std::optional<std::regex> exclude;  // topics whose full name matches are left out of all
};

// Throws std::invalid_argument with one line for the user.
Options readOptions(const std::vector<std::string>& arguments);

}  // namespace hric_experiments

#include "options.h"

#include <stdexcept>

namespace hric_experiments
{
namespace
{

std::regex readExpression(const std::string& text)
{
  try
  {
    return std::regex(text, std::regex::ECMAScript | std::regex::optimize);
  }
  catch (const std::regex_error& error)
  {
    throw std::invalid_argument("--exclude '" + text + "' is no regular expression: " + error.what());
  }
}

}  // namespace

Options readOptions(const std::vector<std::string>& arguments)
{
  Options options;
  for (auto argument = arguments.begin(); argument != arguments.end(); ++argument)
    if (*argument == "--exclude")
    {
      if (++argument == arguments.end())
        throw std::invalid_argument("--exclude needs a regular expression");
      options.exclude = readExpression(*argument);
    }
    else if (argument->rfind("-", 0) == 0)
      throw std::invalid_argument("unknown option '" + *argument + "'; valid: --exclude EXPRESSION");
    else if (options.bag.empty())
      options.bag = *argument;
    else
      options.topics.push_back(*argument);
  if (options.bag.empty())
    throw std::invalid_argument(
        "the path of the bag is missing; usage: bag_recorder BAG [--exclude EXPRESSION] [TOPIC...]");
  return options;
}

}  // namespace hric_experiments

// A field of a message as text: head[chosen, chosen].rest
#pragma once

#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

namespace hric_perception
{

struct Path
{
  std::string head;
  std::vector<std::string> chosen;  // in brackets; empty: there are none
  std::string rest;                 // behind the dot
};

inline std::string trimmed(const std::string& text)
{
  const auto begin = text.find_first_not_of(' ');
  return begin == std::string::npos ? "" : text.substr(begin, text.find_last_not_of(' ') - begin + 1);
}

inline Path readPath(const std::string& text)
{
  Path path;
  const auto open = text.find('['), dot = text.find('.');
  if (open == std::string::npos || (dot != std::string::npos && dot < open))
  {
    path.head = text.substr(0, dot);
    path.rest = dot == std::string::npos ? "" : text.substr(dot + 1);
    return path;
  }
  const auto close = text.find(']', open);
  if (close == std::string::npos || (close + 1 < text.size() && text[close + 1] != '.'))
    throw std::invalid_argument("field '" + text + "'; valid: elements in brackets, such as position[panda_joint1]");
  path.head = text.substr(0, open);
  path.rest = close + 1 < text.size() ? text.substr(close + 2) : "";
  for (std::size_t begin = open + 1; begin <= close;)
  {
    const auto end = std::min(text.find(',', begin), close);
    path.chosen.push_back(trimmed(text.substr(begin, end - begin)));
    begin = end + 1;
  }
  return path;
}

// A number below a message: its name and unit.
struct Leaf
{
  const char* name;
  const char* unit;
};

// Those that a path means: one of this name, or all below it; all where it is empty.
inline std::vector<std::size_t> below(const std::vector<Leaf>& leaves, const std::string& path, const std::string& type)
{
  std::vector<std::size_t> found;
  std::string valid;
  for (std::size_t index = 0; index < leaves.size(); ++index)
  {
    const std::string name = leaves[index].name;
    if (path.empty() || name == path || name.compare(0, path.size() + 1, path + ".") == 0)
      found.push_back(index);
    valid += (index ? ", " : "") + name;
  }
  if (found.empty())
    throw std::invalid_argument("no field '" + path + "' in " + type + "; valid: " + valid + ", or what stands before a dot");
  return found;
}

}  // namespace hric_perception

// The plan, as hric_perception.sync.layout reads it, as far as it concerns policies exact and approximate.
#include <cmath>
#include <set>
#include <stdexcept>

#include "node.h"

namespace hric_perception
{
namespace
{

using XmlRpc::XmlRpcValue;

void only(const XmlRpcValue& mapping, const std::set<std::string>& valid, const std::string& where)
{
  if (mapping.getType() != XmlRpcValue::TypeStruct)
    throw std::invalid_argument(where + " is no mapping of names to values");
  std::string text;
  for (const auto& name : valid)
    text += (text.empty() ? "" : ", ") + name;
  for (const auto& entry : mapping)
    if (valid.count(entry.first) == 0)
      throw std::invalid_argument("no key '" + entry.first + "' in " + where + "; valid: " + text);
}

std::string text(const XmlRpcValue& mapping, const std::string& name, const std::string& where)
{
  if (!mapping.hasMember(name))
    return "";
  const XmlRpcValue& value = mapping[name];
  if (value.getType() != XmlRpcValue::TypeString)
    throw std::invalid_argument(where + "/" + name + " is no text");
  return static_cast<std::string>(XmlRpcValue(value));
}

// A number above 0.
double number(const XmlRpcValue& mapping, const std::string& name, double otherwise, const std::string& where)
{
  if (!mapping.hasMember(name))
    return otherwise;
  XmlRpcValue value = mapping[name];
  double found = 0.0;
  if (value.getType() == XmlRpcValue::TypeInt)
    found = static_cast<int>(value);
  else if (value.getType() == XmlRpcValue::TypeDouble)
    found = static_cast<double>(value);
  if (!(found > 0.0) || !std::isfinite(found))
    throw std::invalid_argument(where + "/" + name + "; valid: a finite number above 0");
  return found;
}

const XmlRpcValue& list(const XmlRpcValue& mapping, const std::string& name, const std::string& where)
{
  if (!mapping.hasMember(name) || mapping[name].getType() != XmlRpcValue::TypeArray || mapping[name].size() == 0)
    throw std::invalid_argument(where + "/" + name + "; valid: a list that is not empty");
  return mapping[name];
}

}  // namespace

SynchronizerNode::SynchronizerNode()
{
  XmlRpcValue plan;
  const std::string where = private_.resolveName("plan");
  if (!private_.getParam("plan", plan))
    throw std::invalid_argument("parameter " + where + " is not set");
  // These filters know no delay: they wait for a late source as long as their queue lasts.
  only(plan, { "policy", "reference", "tolerance", "delay", "incomplete", "sources" }, where);
  const std::string incomplete = text(plan, "incomplete", where);
  if (!incomplete.empty() && incomplete != "drop")
    throw std::invalid_argument(where + "/incomplete is '" + incomplete + "'; valid here: drop");
  readSources(plan);
  layout_.policy = text(plan, "policy", where);
  tolerance_ = number(plan, "tolerance", tolerance_, where);
  const std::string reference = text(plan, "reference", where);
  std::string valid;
  reference_ = sources_.size();
  for (std::size_t index = 0; index < sources_.size(); ++index)
  {
    valid += (valid.empty() ? "" : ", ") + sources_[index].topic;
    if (sources_[index].topic == node_.resolveName(reference))
      reference_ = index;
  }
  if (reference.empty() || reference_ == sources_.size())
    throw std::invalid_argument(where + "/reference is '" + reference + "'; valid: one of " + valid);
  layout_.reference = sources_[reference_].topic;
  const int queue = private_.param("queue", 1000);
  if (queue < 1)
    throw std::invalid_argument(private_.resolveName("queue") + " is " + std::to_string(queue) + "; valid: 1 or more samples");
  begin(private_.param<std::string>("topic", "/hric/perception/sync"), static_cast<std::size_t>(queue));
}

void SynchronizerNode::readSources(const XmlRpcValue& plan)
{
  const std::string where = private_.resolveName("plan");
  const XmlRpcValue& entries = list(plan, "sources", where);
  for (int index = 0; index < entries.size(); ++index)
    readSource(entries[index], where + "/sources[" + std::to_string(index) + "]");
}

void SynchronizerNode::readSource(const XmlRpcValue& entry, const std::string& where)
{
  // max_gap and capacity are of the other implementation.
  only(entry, { "topic", "type", "signals", "timeout", "max_gap", "capacity" }, where);
  Source source;
  source.topic = node_.resolveName(text(entry, "topic", where));
  source.timeout = number(entry, "timeout", source.timeout, where);
  source.reader = makeReader(text(entry, "type", where));
  const XmlRpcValue& signals = list(entry, "signals", where);
  for (int index = 0; index < signals.size(); ++index)
  {
    const std::string place = where + "/signals[" + std::to_string(index) + "]";
    XmlRpcValue signal = signals[index];
    if (signal.getType() == XmlRpcValue::TypeString)
    {
      source.reader->choose(static_cast<std::string>(signal), "");
      continue;
    }
    only(signal, { "field", "unit" }, place);
    source.reader->choose(text(signal, "field", place), text(signal, "unit", place));
  }
  for (const auto& column : source.reader->columns())
  {
    layout_.names.push_back(source.topic + "." + column.field);
    layout_.units.push_back(column.unit);
    layout_.sources.push_back(source.topic);
  }
  sources_.push_back(std::move(source));
}

}  // namespace hric_perception

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/params/live_params.hpp"

#include <algorithm>
#include <sstream>

namespace situation_awareness {
namespace {

/// The entry of that name, or null.
template <class Entries>
auto* find(Entries& entries, const std::string& name) {
  const auto entry =
      std::find_if(entries.begin(), entries.end(), [&](const auto& candidate) { return candidate.name == name; });
  return entry == entries.end() ? nullptr : &*entry;
}

using NamedTexts = std::vector<std::pair<std::string, std::string>>;

NamedTexts texts_of(const dynamic_reconfigure::Config& msg) {
  NamedTexts texts;
  const auto add = [&texts](const auto& entries) {
    for (const auto& entry : entries) {
      std::ostringstream text;
      text << entry.value;
      texts.emplace_back(entry.name, text.str());
    }
  };
  add(msg.doubles);
  add(msg.ints);
  add(msg.strs);
  return texts;
}

}  // namespace

void ReadConfig::operator()(const char* name, double& value, Bounds, const char*, const char*) const {
  if (const auto* const entry = find(msg_.doubles, name)) value = entry->value;
}

void ReadConfig::operator()(const char* name, int& value, Bounds, const char*, const char*) const {
  if (const auto* const entry = find(msg_.ints, name)) value = entry->value;
}

void ReadConfig::operator()(const char* name, std::vector<HalfSpace>& value, const char*) const {
  if (const auto* const entry = find(msg_.strs, name)) read_yaml_text(entry->value, value);
}

void WriteConfig::operator()(const char* name, double value, Bounds, const char*, const char*) const {
  if (auto* const entry = find(msg_.doubles, name)) entry->value = value;
}

void WriteConfig::operator()(const char* name, int value, Bounds, const char*, const char*) const {
  if (auto* const entry = find(msg_.ints, name)) entry->value = value;
}

void WriteConfig::operator()(const char* name, const std::vector<HalfSpace>& value, const char*) const {
  if (auto* const entry = find(msg_.strs, name)) entry->value = yaml_text(value);
}

std::string config_text(const dynamic_reconfigure::Config& msg) {
  std::string text;
  for (const auto& [name, value] : texts_of(msg)) text += (text.empty() ? "" : ", ") + name + " = " + value;
  return text;
}

std::string config_changes(const dynamic_reconfigure::Config& before, const dynamic_reconfigure::Config& after,
                           const std::string& before_word) {
  const NamedTexts old = texts_of(before);
  std::string text;
  for (const auto& [name, value] : texts_of(after)) {
    const auto same_name = [&name = name](const auto& entry) { return entry.first == name; };
    const auto was = std::find_if(old.begin(), old.end(), same_name);
    if (was == old.end() || was->second == value) continue;
    text += (text.empty() ? "" : ", ") + name + " = " + value + " (" + before_word + " " + was->second + ")";
  }
  return text;
}

}  // namespace situation_awareness

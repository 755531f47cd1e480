// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/rviz/stage_board.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace situation_awareness {
namespace {

using diagnostic_msgs::DiagnosticStatus;

StageStatus::Level level_of(const DiagnosticStatus& status) {
  switch (status.level) {
    case DiagnosticStatus::OK:
      return StageStatus::Level::kOk;
    case DiagnosticStatus::WARN:
      return StageStatus::Level::kWarn;
    case DiagnosticStatus::STALE:
      return StageStatus::Level::kStale;
    default:
      return StageStatus::Level::kError;
  }
}

bool grew(const std::optional<std::string>& before, const std::string& now) {
  return std::strtod(now.c_str(), nullptr) > std::strtod(before.value_or("0").c_str(), nullptr);
}

}  // namespace

std::optional<std::string> StageStatus::value(const std::string& key) const {
  const auto found =
      std::find_if(values.begin(), values.end(), [&key](const StageValue& value) { return value.key == key; });
  return found == values.end() ? std::nullopt : std::optional(found->value);
}

StageBoard::StageBoard(const std::vector<std::string>& node_names) {
  for (const std::string& name : node_names) {
    stages_.push_back({name, {}});
    stages_.back().status.name = name.substr(name.rfind('/') + 1);
  }
}

void StageBoard::receive(const diagnostic_msgs::DiagnosticArray& msg, double now_s) {
  for (Stage& stage : stages_) {
    std::optional<StageStatus> next;
    for (const DiagnosticStatus& status : msg.status) {
      // A node that has not run yet has a status without values ("Node starting up").
      if (status.name.substr(0, status.name.find(':')) != stage.node_name) continue;
      if (!next) {
        next = StageStatus{stage.status.name, level_of(status), status.message, {}, false, now_s};
      } else if (level_of(status) > next->level) {
        next->level = level_of(status);
        next->summary = status.message;
      }
      next->paused = next->paused || status.message == "paused";
      for (const diagnostic_msgs::KeyValue& pair : status.values) {
        const bool drop = pair.key.rfind("dropped: ", 0) == 0;
        next->values.push_back({pair.key, pair.value, drop && grew(stage.status.value(pair.key), pair.value)});
      }
    }
    if (next) stage.status = std::move(*next);
  }
}

std::vector<StageStatus> StageBoard::stages(double now_s) const {
  std::vector<StageStatus> result;
  for (const Stage& stage : stages_) {
    result.push_back(stage.status);
    StageStatus& status = result.back();
    if (!status.heard_s || now_s - *status.heard_s <= kStale_s) continue;
    status.level = StageStatus::Level::kStale;
    status.summary = "silent for " + std::to_string(std::lround(now_s - *status.heard_s)) + " s";
    status.paused = false;  // a restarted stage is not paused
    for (StageValue& value : status.values) value.grows_badly = false;
  }
  return result;
}

}  // namespace situation_awareness

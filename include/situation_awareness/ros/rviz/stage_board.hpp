// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <diagnostic_msgs/DiagnosticArray.h>

namespace situation_awareness {

struct StageValue {
  std::string key;
  std::string value;
  bool grows_badly = false;  ///< counts what was dropped, and more of it since the message before
};

struct StageStatus {
  enum class Level { kOk, kWarn, kError, kStale };

  std::string name;
  Level level = Level::kStale;
  std::string summary = "not there";
  std::vector<StageValue> values;
  bool paused = false;            ///< as it says itself
  std::optional<double> heard_s;  ///< when this was said

  /// The value of a key, if it is there.
  std::optional<std::string> value(const std::string& key) const;
};

/// What the stages last said of themselves on /diagnostics. Time is an argument: seconds of any clock that only grows.
class StageBoard {
 public:
  static constexpr double kStale_s = 3.0;

  /// `node_names` of the stages along the data path, as they are called on /diagnostics: in full, without the leading
  /// slash. A stage is shown by the last part of its node's name.
  explicit StageBoard(const std::vector<std::string>& node_names);

  /// A node with several statuses is as bad as the worst of those in one message.
  void receive(const diagnostic_msgs::DiagnosticArray& msg, double now_s);

  /// In the order of the data path; one of which nothing was heard for kStale_s is stale, with its last values.
  std::vector<StageStatus> stages(double now_s) const;

 private:
  struct Stage {
    std::string node_name;
    StageStatus status;
  };

  std::vector<Stage> stages_;
};

}  // namespace situation_awareness

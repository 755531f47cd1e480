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
  bool grows_badly = false;  ///< a count of drops that has grown since the previous message
};

struct StageStatus {
  enum class Level { kOk, kWarn, kError, kStale };

  std::string name;
  Level level = Level::kStale;
  std::string summary = "not there";
  std::vector<StageValue> values;
  bool paused = false;            ///< by its own status
  std::optional<double> heard_s;  ///< time of the message

  /// The value of a key, if it is there.
  std::optional<std::string> value(const std::string& key) const;
};

/// The latest status of each stage on /diagnostics. Time is an argument: seconds of any monotonic clock.
class StageBoard {
 public:
  static constexpr double kStale_s = 3.0;

  /// `node_names` of the stages along the data path, as on /diagnostics: full names without the leading slash. A stage
  /// is shown by the last part of its node's name.
  explicit StageBoard(const std::vector<std::string>& node_names);

  /// Several statuses of a node in one message give the most severe level.
  void receive(const diagnostic_msgs::DiagnosticArray& msg, double now_s);

  /// In the order of the data path; a stage without a message for kStale_s is stale, with its last values.
  std::vector<StageStatus> stages(double now_s) const;

 private:
  struct Stage {
    std::string node_name;
    StageStatus status;
  };

  std::vector<Stage> stages_;
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "situation_awareness/common/file.hpp"

namespace situation_awareness {

/// A file of lines of JSON, which takes the place of an earlier one when it is complete. An empty path: nothing is
/// written.
class LineFile {
 public:
  /// Throws std::runtime_error as NewFile.
  explicit LineFile(const std::string& path);

  explicit operator bool() const { return file_.has_value(); }

  /// `line` with its line break. Throws std::runtime_error if the disk is full.
  void write(const std::string& line);

  /// Throws std::runtime_error if not all could be written.
  void finish();

 private:
  std::optional<NewFile> file_;
  std::string waiting_;
};

}  // namespace situation_awareness

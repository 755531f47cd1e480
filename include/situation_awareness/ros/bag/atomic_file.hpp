// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fstream>
#include <string>

namespace situation_awareness {

/// A file that is renamed from PATH.part only when it is complete; until then an earlier file stays.
class AtomicFile {
 public:
  explicit AtomicFile(std::string path) : path_(std::move(path)), partial_(path_ + ".part") {}
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;
  /// Removes an incomplete file.
  ~AtomicFile();

  const std::string& path() const { return path_; }
  /// Path to write to.
  const std::string& partial() const { return partial_; }

  /// Throws std::runtime_error if the file cannot be renamed.
  void finish();

 private:
  std::string path_, partial_;
  bool done_ = false;
};

/// An atomic file of lines. An empty path: nothing is written.
class LineFile {
 public:
  /// Throws std::runtime_error if the file cannot be written.
  explicit LineFile(const std::string& path);

  explicit operator bool() const { return !file_.path().empty(); }

  /// `line` with its line break.
  void write(const std::string& line) { stream_ << line; }

  /// Throws std::runtime_error if not all could be written.
  void finish();

 private:
  AtomicFile file_;
  std::ofstream stream_;
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/bag/line_file.hpp"

#include <cstddef>
#include <string_view>

namespace situation_awareness {
namespace {

constexpr std::size_t kWriteBytes = 1 << 16;

}  // namespace

LineFile::LineFile(const std::string& path) {
  if (path.empty()) return;
  file_.emplace(path, FileKind{"a file of JSON lines", [](std::string_view head) { return head.front() == '{'; }});
}

void LineFile::write(const std::string& line) {
  if (!file_) return;
  waiting_ += line;
  if (waiting_.size() < kWriteBytes) return;
  file_->write(waiting_);
  waiting_.clear();
}

void LineFile::finish() {
  if (!file_) return;
  file_->write(waiting_);
  file_->finish();
}

}  // namespace situation_awareness

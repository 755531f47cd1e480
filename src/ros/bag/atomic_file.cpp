// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/bag/atomic_file.hpp"

#include <cstdio>
#include <stdexcept>

namespace situation_awareness {
namespace {

[[noreturn]] void fail(const std::string& path) { throw std::runtime_error(path + ": cannot be written"); }

}  // namespace

AtomicFile::~AtomicFile() {
  if (!done_ && !path_.empty()) std::remove(partial_.c_str());
}

void AtomicFile::finish() {
  if (std::rename(partial_.c_str(), path_.c_str()) != 0) fail(path_);
  done_ = true;
}

LineFile::LineFile(const std::string& path) : file_(path) {
  if (!*this) return;
  stream_.open(file_.partial(), std::ios::binary | std::ios::trunc);
  if (!stream_) fail(path);
}

void LineFile::finish() {
  if (!*this) return;
  stream_.close();
  if (!stream_) fail(file_.path());
  file_.finish();
}

}  // namespace situation_awareness

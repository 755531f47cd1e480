// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <exception>
#include <string>

namespace situation_awareness {

/// Why a text is not YAML, by what yaml-cpp threw, in one line: its message quotes the character that it refuses, which
/// may be the end of a line.
inline std::string yaml_defect(const std::exception& error) {
  std::string defect = std::string("not valid YAML: ") + error.what();
  const auto is_control = [](char c) { return static_cast<unsigned char>(c) < 0x20; };
  std::replace_if(defect.begin(), defect.end(), is_control, ' ');
  return defect;
}

}  // namespace situation_awareness

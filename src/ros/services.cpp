// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/services.hpp"

#include <stdexcept>

namespace situation_awareness {

std::string count_of(std::size_t number, const std::string& of_what) {
  return std::to_string(number) + ' ' + of_what + (number == 1 ? "" : "s");
}

void check_absolute(const std::string& file) {
  if (file.empty() || file.front() != '/') throw std::invalid_argument("'" + file + "' is no absolute path");
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>

#include "situation_awareness/common/json.hpp"
#include "situation_awareness/common/params.hpp"

namespace situation_awareness {

/// Reads the members of an object of JSON, each by its name, or what takes its place where it is missing. Each throws
/// std::invalid_argument, beginning with `place`, naming the member and what is wrong with it.
class JsonMembers {
 public:
  JsonMembers(const Json& object, std::string place) : object_(object), place_(std::move(place)) {
    if (!object.is_object()) throw std::invalid_argument(place_ + "is no object");
  }

  [[noreturn]] void refuse(const std::string& name, const std::string& defect) const {
    throw std::invalid_argument(place_ + name + ' ' + defect);
  }

  /// Null if it is missing.
  const Json* find(const char* name) const {
    const auto found = object_.find(name);
    return found != object_.end() ? &*found : nullptr;
  }

  double number(const Json& value, const char* name, Bounds bounds) const {
    if (!value.is_number()) refuse(name, "is no number");
    const auto number = value.get<double>();
    if (!(number >= bounds.low && number <= bounds.high)) refuse(name, "is out of bounds");
    return number;
  }
  const Json& at(const char* name) const {
    const Json* const value = find(name);
    if (value == nullptr) refuse(name, "is missing");
    return *value;
  }
  double number(const char* name, Bounds bounds) const { return number(at(name), name, bounds); }
  double number(const char* name, Bounds bounds, double otherwise) const {
    return find(name) != nullptr ? number(name, bounds) : otherwise;
  }

  /// The stamp of a member in seconds, which holds 1 us.
  std::int64_t stamp_ns(const char* name) const { return std::llround(1e9 * number(name, kTime_s)); }
  std::int64_t stamp_ns(const char* name, std::int64_t otherwise_ns) const {
    return find(name) != nullptr ? stamp_ns(name) : otherwise_ns;
  }

  /// False if it is missing.
  bool flag(const char* name) const {
    const Json* const value = find(name);
    if (value == nullptr) return false;
    if (!value->is_boolean()) refuse(name, "is neither true nor false");
    return value->get<bool>();
  }

 private:
  /// Stamps are of ROS, or of a time long before that.
  static constexpr Bounds kTime_s{-2e9, 4'294'967'295.0};

  const Json& object_;
  std::string place_;
};

}  // namespace situation_awareness

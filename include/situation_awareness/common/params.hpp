// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sstream>
#include <stdexcept>
#include <string>

namespace situation_awareness {

/// Closed interval that a parameter must lie in.
struct Bounds {
  double low;
  double high;
};

namespace detail {

/// The visitor of check_bounds.
struct CheckBounds {
  std::string section;

  template <class Value>
  void operator()(const char* name, const Value& value, Bounds bounds, const char* unit, const char* /*doc*/) const {
    const auto number = static_cast<double>(value);
    if (number >= bounds.low && number <= bounds.high) return;  // false for NaN
    std::ostringstream message;
    message << section << '.' << name << " = " << number << " is outside [" << bounds.low << ", " << bounds.high << "]";
    if (*unit != '\0') message << ' ' << unit;
    throw std::invalid_argument(message.str());
  }

  /// A field that is not a number has no bounds; its own type's validate() looks at it.
  template <class Value>
  void operator()(const char* /*name*/, const Value& /*value*/, const char* /*doc*/) const {}
};

}  // namespace detail

/// Throw std::invalid_argument naming section, field, value and bound of the first field of `params` that is out of
/// bounds.
///
/// A params struct lists its fields once, in
/// `template <class Self, class Visit> static void fields(Self& self, Visit&& visit)`, which calls
/// `visit(name, value, bounds, unit, sentence)` for each number and `visit(name, value, sentence)` for everything else:
/// the check here and the YAML loader both read that list.
template <class Params>
void check_bounds(const Params& params, const std::string& section) {
  Params::fields(params, detail::CheckBounds{section});
}

}  // namespace situation_awareness

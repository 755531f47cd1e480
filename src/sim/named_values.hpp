// SPDX-License-Identifier: BSD-3-Clause
// The texts of a world's file that set parameters. Private to sim/.
#pragma once

#include <charconv>
#include <cmath>
#include <istream>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "situation_awareness/common/params.hpp"

namespace situation_awareness {

/// The values of a text, each after its name, as a visitor of params that assigns numbers to the fields.
class NamedValues {
 public:
  explicit NamedValues(std::istream& words) {
    for (std::string name, value; words >> name;) {
      if (!(words >> value)) throw std::invalid_argument("has '" + name + "' without a value");
      if (!values_.emplace(name, value).second) throw std::invalid_argument("has '" + name + "' twice");
    }
  }

  template <class Value>
  void operator()(const char* name, Value& value, Bounds /*bounds*/, const char* /*unit*/, const char* /*doc*/) {
    const std::optional<std::string> text = take(name);
    if (!text) return;
    double number = 0.0;
    const auto [end, error] = std::from_chars(text->data(), text->data() + text->size(), number);
    if (error != std::errc() || end != text->data() + text->size() || !std::isfinite(number)) {
      throw std::invalid_argument("has '" + *text + "' where the number of '" + name + "' should be");
    }
    if (std::is_integral_v<Value> && !(number == std::floor(number) && std::abs(number) < 1e9)) {
      throw std::invalid_argument("needs a whole number after '" + std::string(name) + "'");
    }
    value = static_cast<Value>(number);
  }

  /// The value after a name, if the text has it.
  std::optional<std::string> take(const std::string& name) {
    const auto node = values_.extract(name);
    return node.empty() ? std::nullopt : std::optional<std::string>(node.mapped());
  }

  void check_all_used() const {
    if (!values_.empty()) throw std::invalid_argument("has '" + values_.begin()->first + "', which it does not know");
  }

 private:
  std::map<std::string, std::string> values_;
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/common/params.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <stdexcept>

namespace situation_awareness {

namespace detail {

void check_bound(const std::string& section, const char* name, double value, Bounds bounds, const char* unit) {
  if (value >= bounds.low && value <= bounds.high) return;  // false for NaN
  throw std::invalid_argument(section + '.' + name + " = " + yaml_text(value) + " is outside " + text_of(bounds, unit));
}

}  // namespace detail

std::string yaml_text(bool value) { return value ? "true" : "false"; }

std::string yaml_text(int value) { return std::to_string(value); }

std::string yaml_text(double value) {
  if (std::isnan(value)) return ".nan";
  if (std::isinf(value)) return value > 0.0 ? ".inf" : "-.inf";
  std::array<char, 32> digits{};
  std::string text(digits.data(), std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr);
  const bool is_int = text.find_first_of(".e") == std::string::npos;
  if (is_int && std::abs(value) > std::numeric_limits<std::int32_t>::max()) text += ".0";  // a larger int is refused
  return text;
}

std::string yaml_text(const std::string& value) {
  std::string text = "\"";
  for (const char c : value) {
    if (c == '"' || c == '\\') {
      text += '\\';
      text += c;
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) {
      std::array<char, 8> escape{};
      std::snprintf(escape.data(), escape.size(), "\\x%02x", static_cast<unsigned>(static_cast<unsigned char>(c)));
      text += escape.data();
    } else {
      text += c;
    }
  }
  return text + '"';
}

std::string yaml_text(const Parameter& parameter) {
  return std::visit(
      [](const auto& value) {
        if constexpr (std::is_pointer_v<std::decay_t<decltype(value)>>) {
          return yaml_text(*value);
        } else {
          return value.get();
        }
      },
      parameter.value);
}

std::string text_of(Bounds bounds, const std::string& unit) {
  return '[' + yaml_text(bounds.low) + ", " + yaml_text(bounds.high) + ']' + (unit.empty() ? "" : " ") + unit;
}

namespace {

/// `what_follows`: from the unknown key.
std::string message_of(const UnknownKey& key, const std::string& what_follows) {
  std::string names;
  for (const std::string& name : key.known) names += (names.empty() ? "" : ", ") + name;
  return key.source + ": unknown parameter " + key.path + what_follows + ", known are: " + names;
}

}  // namespace

std::string message_of(const UnknownKey& key) { return message_of(key, " has no effect"); }

void print_warning(const UnknownKey& key) { std::fprintf(stderr, "warning: %s\n", message_of(key).c_str()); }

void refuse(const UnknownKey& key) { throw std::invalid_argument(message_of(key, "")); }

}  // namespace situation_awareness

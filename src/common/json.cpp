// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/common/json.hpp"

#include <string>

namespace situation_awareness {
namespace {

/// Bounds of what nlohmann_json reads: it takes up to 50 bytes for each value.
constexpr std::size_t kMaxValues = 10'000'000, kMaxDepth = 32;

}  // namespace

void check_json_size(std::string_view text) {
  if (text.size() > kMaxJsonBytes) {
    throw std::invalid_argument("has more than " + std::to_string(kMaxJsonBytes) + " bytes");
  }
  std::size_t values = 0, depth = 0;
  bool is_text = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '"') is_text = !is_text;
    if (is_text) {
      if (c == '\\') ++i;
      continue;
    }
    const bool opens = c == '[' || c == '{';
    if (opens) ++depth;
    if ((c == ']' || c == '}') && depth > 0) --depth;
    if (opens || c == ',') ++values;
    if (depth > kMaxDepth) throw std::invalid_argument("is nested too deeply");
    if (values > kMaxValues) throw std::invalid_argument("has more than " + std::to_string(kMaxValues) + " values");
  }
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string_view>

#include <nlohmann/json.hpp>

namespace situation_awareness {

/// Keys keep their order.
using Json = nlohmann::ordered_json;

/// A number that is read back exactly. Throws std::runtime_error if it is not finite.
inline double finite(double value) {
  if (!std::isfinite(value)) throw std::runtime_error("a number to be written is not finite");
  return value;
}

/// A new object at the end of a list, with reserved members.
inline Json& add_object(Json& list, std::size_t members) {
  Json& object = list.emplace_back(Json::object());
  object.get_ref<Json::object_t&>().reserve(members);
  return object;
}

/// The list of `number(0)` ... `number(count - 1)`, all finite.
template <class Number>
Json list_of(int count, const Number& number) {
  Json list = Json::array();
  list.get_ref<Json::array_t&>().reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) list.push_back(finite(number(i)));
  return list;
}

/// The size of a file that is read at once as JSON, at most.
constexpr std::size_t kMaxJsonBytes = std::size_t{256} << 20;

/// Throws std::invalid_argument if a text has too many values, or too deeply within each other, before memory is taken
/// for them.
void check_json_size(std::string_view text);

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>

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

/// One line: {"stamp":S, and the members of `rest`, an object that is not empty. The stamp is in seconds with all
/// digits of its nanoseconds, which a double cannot represent.
std::string json_line(std::int64_t stamp_ns, const Json& rest);

}  // namespace situation_awareness

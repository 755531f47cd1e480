// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <type_traits>
#include <utility>

namespace situation_awareness {

namespace detail {

struct ConvertsToAnything {
  template <class Value>
  operator Value() const;  // NOLINT: only for what is not evaluated
};

template <class Aggregate, std::size_t... Is>
auto constructible_from(std::index_sequence<Is...>)
    -> decltype(Aggregate{(static_cast<void>(Is), ConvertsToAnything{})...}, std::true_type());
template <class Aggregate>
std::false_type constructible_from(...);

/// Converts to any type, for counting initialisers.
struct CountFields {
  std::size_t& count;
  template <class Value, class... Declared>
  void operator()(const char* /*name*/, const Value& /*value*/, const Declared&... /*declared*/) const {
    ++count;
  }
};

}  // namespace detail

/// The number of data members of a plain struct: its largest number of initialisers.
template <class Aggregate, std::size_t kMost = 64>
constexpr std::size_t aggregate_size() {
  if constexpr (decltype(detail::constructible_from<Aggregate>(std::make_index_sequence<kMost>()))::value) {
    return kMost;
  } else {
    return aggregate_size<Aggregate, kMost - 1>();
  }
}

/// The number of parameters and sections that a params struct declares in fields().
template <class Params>
std::size_t declared_size() {
  std::size_t count = 0;
  const Params params;
  Params::fields(params, detail::CountFields{count});
  return count;
}

}  // namespace situation_awareness

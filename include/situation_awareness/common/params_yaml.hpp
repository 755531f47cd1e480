// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "situation_awareness/common/params.hpp"

namespace situation_awareness {

/// Set `parameters` from YAML text that has their sections as maps; parameters that it omits keep their values.
///
/// Throws std::invalid_argument naming `source`, the parameter's path and its bound: for a wrong type, a number out of
/// bounds, and what canonical_yaml refuses. Values are those of rosparam, which reads 1e-3 as a string: a number may be
/// given as a string, but not a string as a number. `on_unknown_key` is called for each key without a parameter. Some
/// values may have been set then.
void read_yaml(const std::vector<Parameter>& parameters, const std::string& yaml, const std::string& source,
               const OnUnknownKey& on_unknown_key);

/// The parameters as YAML text that read_yaml reads back exactly.
std::string yaml_of(const std::vector<Parameter>& parameters);

/// The content of a file. Throws std::invalid_argument naming it if it cannot be read.
std::string read_text_file(const std::string& path);

/// Calls `validate()` of the struct's sections and then of the struct, and throws what they throw.
template <class Params>
void validate_all(const Params& params);

/// A params struct from YAML text by read_yaml, validated; parameters that the text omits are as in `defaults`. Throws
/// std::invalid_argument naming `source` and the reason.
template <class Params>
Params params_from_yaml(const std::string& yaml, const std::string& source,
                        const OnUnknownKey& on_unknown_key = print_warning, Params defaults = Params());

/// A params struct as YAML text.
template <class Params>
std::string yaml_from_params(Params params) {
  return yaml_of(parameters_of(params));
}

// --- implementation -------------------------------------------------------------------------------------------------

namespace detail {

template <class Value, class = void>
struct HasValidate : std::false_type {};
template <class Value>
struct HasValidate<Value, std::void_t<decltype(std::declval<const Value&>().validate())>> : std::true_type {};

/// The visitor of validate_all.
struct ValidateSections {
  template <class Section>
  void operator()(const char* /*name*/, const Section& section) const {
    validate_all(section);
  }

  template <class Value, class... Declared>
  void operator()(const char* /*name*/, const Value& /*value*/, const Declared&...) const {}
};

}  // namespace detail

template <class Params>
void validate_all(const Params& params) {
  Params::fields(params, detail::ValidateSections{});
  if constexpr (detail::HasValidate<Params>::value) params.validate();
}

template <class Params>
Params params_from_yaml(const std::string& yaml, const std::string& source, const OnUnknownKey& on_unknown_key,
                        Params defaults) {
  Params params = std::move(defaults);
  read_yaml(parameters_of(params), yaml, source, on_unknown_key);
  try {
    validate_all(params);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(source + ": " + error.what());
  }
  return params;
}

}  // namespace situation_awareness

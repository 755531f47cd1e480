// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "situation_awareness/common/params.hpp"

namespace situation_awareness {

/// Set `parameters` from YAML text that has their sections as maps; what it leaves out keeps its value.
///
/// Throws std::invalid_argument with one sentence that names `source`, the parameter's path and its bound: for a wrong
/// type, a number out of bounds, a key that is given twice. `on_unknown_key` is called for each key that no parameter
/// has. Some values may have been set then. YAML 1.1 tools, rosparam among them, take 1e-3 for a text: a number may be
/// given as a text, but not a text as a number.
void read_yaml(const std::vector<Parameter>& parameters, const std::string& yaml, const std::string& source,
               const OnUnknownKey& on_unknown_key);

/// The parameters as YAML text that read_yaml reads back as the same.
std::string yaml_of(const std::vector<Parameter>& parameters);

/// The content of a file. Throws std::invalid_argument naming it if it cannot be read.
std::string read_text_file(const std::string& path);

/// Throws what the `validate()` of the struct and of the sections in it throws; the inner ones come first.
template <class Params>
void validate_all(const Params& params);

/// A params struct from YAML text, as read_yaml does and validated; what the text leaves out is as in `defaults`.
/// Throws std::invalid_argument with one sentence that names `source` and what is wrong.
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

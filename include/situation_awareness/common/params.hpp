// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

namespace situation_awareness {

/// Closed interval of a parameter.
struct Bounds {
  double low;
  double high;
};

/// Marks a parameter that may be changed while its node runs: visit(..., kLive).
struct Live {};
constexpr Live kLive{};

/// A parameter of a user-defined type, by its YAML text.
struct YamlValue {
  std::function<std::string()> get;
  std::function<void(const std::string&)> set;  ///< throws std::invalid_argument: "must be ..."
};

/// One parameter: its declaration and a reference to its value.
struct Parameter {
  std::string section;  ///< path of the section that it is in: detections.fit; empty at the top
  std::string name;     ///< its key there, which ends in the unit
  std::variant<bool*, int*, double*, std::string*, YamlValue> value;
  std::optional<Bounds> bounds;  ///< of a number
  std::string unit;              ///< empty where there is none
  std::string doc;               ///< one sentence; empty: nobody sets it by hand, and no reference lists it
  bool live = false;             ///< may be changed while its node runs

  std::string path() const { return section.empty() ? name : section + '.' + name; }
};

/// The parameters of a params struct and of the sections in it, in the order of their declaration.
///
/// A params struct is a plain struct that declares each of its parameters once, in
///
///     template <class Self, class Visit>
///     static void fields(Self& self, Visit&& visit) {
///       visit("max_gap_m", self.max_gap_m, Bounds{0.001, 10.0}, "m", "largest distance between ...");  // a number
///       visit("shape", self.shape, "ellipse or circle");  // bool, std::string, or a type with its own YAML text
///       visit("min_points", self.min_points, Bounds{2, 1000}, "", "fewest points of ...", kLive);
///       visit("fit", self.fit);                           // a section: another params struct
///     }
///
/// Reading, writing, checking and documentation all use this declaration. A user-defined type has, in its namespace,
/// `std::string yaml_text(const T&)` and `void read_yaml_text(const std::string&, T&)`, which throws
/// std::invalid_argument("must be ..."). Constraints between fields are checked by a member `void validate() const`.
///
/// `params` must outlive the result.
template <class Params>
std::vector<Parameter> parameters_of(Params& params, const std::string& section = "");

/// Throws std::invalid_argument naming section, field, value and bound of the first number of `params` that is out of
/// bounds; the sections in it are left to their own structs.
template <class Params>
void check_bounds(const Params& params, const std::string& section);

/// A value as YAML text in the flow style that reads back as the same.
std::string yaml_text(bool value);
std::string yaml_text(int value);
std::string yaml_text(double value);
std::string yaml_text(const std::string& value);  ///< in double quotes
std::string yaml_text(const Parameter& parameter);
std::string yaml_text(const char* value) = delete;  // would convert to bool

/// "[0, 1000] m"
std::string text_of(Bounds bounds, const std::string& unit);

/// A key that no parameter has.
struct UnknownKey {
  std::string source;              ///< name of the text, such as a path
  std::string path;                ///< with its section: segments.max_gap
  std::vector<std::string> known;  ///< the keys that its section has, sorted
};

/// "my.yaml: unknown parameter segments.max_gap has no effect, known are: free_faces, ..."
std::string message_of(const UnknownKey& key);

/// Handler of unknown keys.
using OnUnknownKey = std::function<void(const UnknownKey&)>;

/// Writes the message to stderr as a warning, for programs without a log.
void print_warning(const UnknownKey& key);

/// Throws std::invalid_argument with the same facts.
[[noreturn]] void refuse(const UnknownKey& key);

// --- implementation -------------------------------------------------------------------------------------------------

namespace detail {

struct AnyVisitor {};

template <class Value, class = void>
struct IsSection : std::false_type {};
template <class Value>
struct IsSection<Value, std::void_t<decltype(Value::fields(std::declval<Value&>(), std::declval<AnyVisitor&>()))>>
    : std::true_type {};

void check_bound(const std::string& section, const char* name, double value, Bounds bounds, const char* unit);

/// The visitor of check_bounds.
struct CheckBounds {
  const std::string& section;

  template <class Number, class... Declared>
  void operator()(const char* name, const Number& value, Bounds bounds, const char* unit, const Declared&...) const {
    check_bound(section, name, static_cast<double>(value), bounds, unit);
  }

  template <class Value, class... Declared>
  void operator()(const char* /*name*/, const Value& /*value*/, const Declared&...) const {}
};

/// The visitor of parameters_of.
class ListParameters {
 public:
  ListParameters(std::vector<Parameter>& list, const std::string& section) : list_(list), section_(section) {}

  template <class Number, class... Tag>
  void operator()(const char* name, Number& value, Bounds bounds, const char* unit, const char* doc, Tag... tag) {
    static_assert(std::is_same_v<Number, int> || std::is_same_v<Number, double>, "int and double have bounds");
    list_.push_back({section_, name, &value, bounds, unit, doc, is_live(tag...)});
  }

  template <class Value, class... Tag>
  void operator()(const char* name, Value& value, const char* doc, Tag... tag) {
    static_assert(!std::is_arithmetic_v<Value> || std::is_same_v<Value, bool>, "a number is declared with its bounds");
    if constexpr (std::is_same_v<Value, bool> || std::is_same_v<Value, std::string>) {
      list_.push_back({section_, name, &value, {}, "", doc, is_live(tag...)});
    } else {
      const YamlValue text{[&value] { return yaml_text(value); },
                           [&value](const std::string& yaml) { read_yaml_text(yaml, value); }};
      list_.push_back({section_, name, text, {}, "", doc, is_live(tag...)});
    }
  }

  template <class Section>
  void operator()(const char* name, Section& section) {
    static_assert(IsSection<Section>::value, "a section is a struct with fields()");
    Section::fields(section, ListParameters(list_, section_.empty() ? name : section_ + '.' + name));
  }

 private:
  static bool is_live() { return false; }
  static bool is_live(Live /*tag*/) { return true; }

  std::vector<Parameter>& list_;
  std::string section_;
};

}  // namespace detail

template <class Params>
std::vector<Parameter> parameters_of(Params& params, const std::string& section) {
  static_assert(!std::is_const_v<Params>, "the values of the result can be set");
  std::vector<Parameter> list;
  Params::fields(params, detail::ListParameters(list, section));
  return list;
}

template <class Params>
void check_bounds(const Params& params, const std::string& section) {
  Params::fields(params, detail::CheckBounds{section});
}

}  // namespace situation_awareness

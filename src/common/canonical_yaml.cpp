// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/common/canonical_yaml.hpp"

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <regex>
#include <set>
#include <stdexcept>
#include <utility>
#include <variant>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/common/yaml_defect.hpp"

namespace situation_awareness {
namespace {

using Null = std::monostate;
using Value = std::variant<Null, bool, std::int64_t, double, std::string>;

constexpr double kPi = 3.14159265358979323846;
constexpr const char* kTag = "tag:yaml.org,2002:";

/// The kinds of texts without quotes, by yaml/resolver.py of PyYAML 6.0 and rosparam/__init__.py of ros_comm 1.15.15.
struct Kinds {
  std::regex is_null{"~|null|Null|NULL|"};
  std::regex is_true{"yes|Yes|YES|true|True|TRUE|on|On|ON"};
  std::regex is_false{"no|No|NO|false|False|FALSE|off|Off|OFF"};
  std::regex is_int{
      "[-+]?0b[01_]+|[-+]?0[0-7_]+|[-+]?(0|[1-9][0-9_]*)|[-+]?0x[0-9a-fA-F_]+|[-+]?[1-9][0-9_]*(:[0-5]?[0-9])+"};
  std::regex is_float{
      "[-+]?[0-9][0-9_]*\\.[0-9_]*([eE][-+][0-9]+)?|\\.[0-9][0-9_]*([eE][-+][0-9]+)?|"
      "[-+]?[0-9][0-9_]*(:[0-5]?[0-9])+\\.[0-9_]*|[-+]?\\.(inf|Inf|INF)|\\.(nan|NaN|NAN)"};
  std::regex is_time{
      "[0-9]{4}-[0-9]{2}-[0-9]{2}|[0-9]{4}-[0-9]{1,2}-[0-9]{1,2}([Tt]|[ \t]+)[0-9]{1,2}:[0-9]{2}:[0-9]{2}(\\.[0-9]*)?"
      "([ \t]*(Z|[-+][0-9]{1,2}(:[0-9]{2})?))?"};
  std::regex is_angle{"(deg|rad)\\(([^)]*)\\)"};
};

const Kinds& kinds() {
  static const Kinds all;
  return all;
}

/// Texts that are longer are of no kind: std::regex takes memory of the stack for each character.
constexpr std::size_t kMaxLength = 200;

bool is(const std::string& text, const std::regex& kind) {
  return text.size() <= kMaxLength && std::regex_match(text, kind);
}

std::string without(std::string text, char dropped) {
  text.erase(std::remove(text.begin(), text.end(), dropped), text.end());
  return text;
}

/// The whole text as a number; none where it is none, or out of range.
template <class Number, class... Base>
std::optional<Number> number(const std::string& text, Base... base) {
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base...);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// Takes the sign off; -1 or 1.
int take_sign(std::string& text) {
  const bool is_signed = !text.empty() && (text[0] == '-' || text[0] == '+');
  const int sign = is_signed && text[0] == '-' ? -1 : 1;
  if (is_signed) text.erase(0, 1);
  return sign;
}

/// Digits in base 60, such as 12:30, added from the last one on.
template <class Number>
std::optional<Number> sexagesimal(const std::string& text) {
  constexpr Number kMaxUnit{1'000'000'000};
  Number sum{}, unit{1};
  for (std::size_t end = text.size(); unit < kMaxUnit; unit *= 60) {
    const std::size_t colon = end == 0 ? std::string::npos : text.rfind(':', end - 1);
    const std::size_t begin = colon == std::string::npos ? 0 : colon + 1;
    const std::optional<Number> digit = number<Number>(text.substr(begin, end - begin));
    if (!digit || *digit > kMaxUnit) return std::nullopt;
    sum += *digit * unit;
    if (begin == 0) return sum;
    end = colon;
  }
  return std::nullopt;
}

std::optional<bool> bool_of(const std::string& text) {
  if (is(text, kinds().is_true)) return true;
  if (is(text, kinds().is_false)) return false;
  return std::nullopt;
}

std::optional<std::int64_t> int_of(std::string text) {
  text = without(std::move(text), '_');
  const int sign = take_sign(text);
  const auto of_base = [&text](std::size_t prefix, int base) {
    return number<std::int64_t>(text.substr(prefix), base);
  };
  const auto magnitude = text.rfind("0b", 0) == 0              ? of_base(2, 2)
                         : text.rfind("0x", 0) == 0            ? of_base(2, 16)
                         : text.size() > 1 && text[0] == '0'   ? of_base(1, 8)
                         : text.find(':') != std::string::npos ? sexagesimal<std::int64_t>(text)
                                                               : of_base(0, 10);
  if (!magnitude) return std::nullopt;
  return sign * *magnitude;
}

std::optional<double> float_of(std::string text) {
  text = without(std::move(text), '_');
  const int sign = take_sign(text);
  if (text.size() == 4 && (text[1] == 'i' || text[1] == 'I')) return sign * std::numeric_limits<double>::infinity();
  if (text.size() == 4 && (text[1] == 'n' || text[1] == 'N')) return std::numeric_limits<double>::quiet_NaN();
  const auto magnitude = text.find(':') != std::string::npos ? sexagesimal<double>(text) : number<double>(text);
  if (!magnitude) return std::nullopt;
  return sign * *magnitude;
}

/// A number, pi, and products and quotients of these: rosparam has Python evaluate what is in rad().
std::optional<double> angle_of(std::string text) {
  text = without(std::move(text), ' ');
  const int sign = take_sign(text);
  std::optional<double> angle;
  for (char operation = '*'; operation != '\0';) {
    const std::size_t end = std::min(text.find_first_of("*/"), text.size());
    const std::string factor = text.substr(0, end);
    const std::optional<double> value = factor == "pi" ? kPi : number<double>(factor);
    if (!value) return std::nullopt;
    angle = !angle ? *value : operation == '*' ? *angle * *value : *angle / *value;
    operation = end < text.size() ? text[end] : '\0';
    text.erase(0, end + 1);
  }
  return sign * *angle;
}

/// 1e-05 is a text to readers of YAML 1.1.
std::string with_point(std::string number) {
  const std::size_t exponent = number.find('e');
  if (exponent != std::string::npos && number.find('.') == std::string::npos) number.insert(exponent, ".0");
  return number;
}

class Writer {
 public:
  std::string text(const YAML::Node& node, const std::string& path, int depth = 0) {
    count(depth);
    if (node.IsMap()) return map(node, path, depth);
    if (!node.IsSequence()) return scalar(node, path);
    std::string list;
    for (std::size_t i = 0; i < node.size(); ++i) {
      list += (i == 0 ? "" : ", ") + text(node[i], path + '[' + std::to_string(i) + ']', depth + 1);
    }
    return '[' + list + ']';
  }

 private:
  using Entries = std::vector<std::pair<std::string, YAML::Node>>;

  [[noreturn]] static void fail(const std::string& path, const std::string& reason) {
    throw std::invalid_argument((path.empty() ? "the parameters" : path) + ' ' + reason);
  }

  /// An alias may stand for what it is in, and for much.
  void count(int depth) {
    constexpr int kMaxDepth = 100;
    constexpr std::size_t kMaxNodes = 100'000;
    if (depth > kMaxDepth || ++nodes_ > kMaxNodes) fail("", "are nested too deep");
  }

  std::string map(const YAML::Node& node, const std::string& path, int depth) {
    std::string text_of_all;
    for (const auto& [key, value] : entries(node, path, depth)) {
      text_of_all += (text_of_all.empty() ? "" : ", ") + yaml_text(key) + ": " +
                     text(value, path.empty() ? key : path + '.' + key, depth + 1);
    }
    return '{' + text_of_all + '}';
  }

  /// Those of a map, and before them those of the maps that it merges, unless it has them itself.
  Entries entries(const YAML::Node& node, const std::string& path, int depth) {
    count(depth);
    Entries merged, own;
    std::set<std::string> names;
    for (const auto& item : node) {
      if (item.first.IsScalar() && item.first.Tag() == "?" && item.first.Scalar() == "<<") {
        merge(item.second, path, depth, merged);
        continue;
      }
      const std::string name = "the name of a parameter" + (path.empty() ? "" : " in " + path);
      if (!item.first.IsScalar()) fail(name, "must be a text");
      const std::string& key = item.first.Scalar();
      if (item.first.Tag() == "?" && !std::holds_alternative<std::string>(plain(key, name))) {
        fail(name, "must be a text: " + key + " is none without quotes");
      }
      if (!names.insert(key).second) fail(path.empty() ? key : path + '.' + key, "is given twice");
      own.emplace_back(key, item.second);
    }
    for (auto& entry : own) set(merged, std::move(entry));
    return merged;
  }

  void merge(const YAML::Node& from, const std::string& path, int depth, Entries& merged) {
    if (from.IsMap()) {
      for (auto& entry : entries(from, path, depth + 1)) set(merged, std::move(entry));
    } else if (from.IsSequence()) {
      for (std::size_t i = from.size(); i-- > 0;) {  // the first has precedence
        if (!from[i].IsMap()) fail(path, "must merge maps by <<");
        merge(from[i], path, depth, merged);
      }
    } else {
      fail(path, "must merge maps by <<");
    }
  }

  static void set(Entries& entries, std::pair<std::string, YAML::Node> entry) {
    const auto same = std::find_if(entries.begin(), entries.end(),
                                   [&entry](const auto& other) { return other.first == entry.first; });
    if (same == entries.end()) {
      entries.push_back(std::move(entry));
    } else {
      same->second.reset(entry.second);
    }
  }

  /// What a text without quotes is.
  static Value plain(const std::string& text, const std::string& path) {
    if (is(text, kinds().is_null)) return Null();
    if (const auto flag = bool_of(text)) return *flag;
    if (is(text, kinds().is_float)) return checked(float_of(text), text, path);
    if (is(text, kinds().is_int)) return checked(int_of(text), text, path);
    if (is(text, kinds().is_time))
      fail(path, "= " + text + " is a time, which parameters cannot be: put a text into quotes");
    if (text == "=" || text == "<<") fail(path, "= " + text + " has a meaning of its own: put a text into quotes");
    std::smatch parts;
    if (text.size() > kMaxLength || !std::regex_match(text, parts, kinds().is_angle)) return text;
    return parts[1] == "deg" ? degrees(parts[2], path) : checked(angle_of(parts[2]), text, path);
  }

  static double degrees(const std::string& text, const std::string& path) {
    return checked(number<double>(without(text, ' ')), "deg(" + text + ")", path) * kPi / 180.0;
  }

  template <class Number>
  static Number checked(const std::optional<Number>& value, const std::string& text, const std::string& path) {
    if (!value) fail(path, "= " + text + " is no number that can be read");
    return *value;
  }

  static Value value_of(const YAML::Node& node, const std::string& path) {
    if (node.IsNull()) return Null();
    const std::string& text = node.Scalar();
    const std::string& tag = node.Tag();
    if (tag == "?") return plain(text, path);
    const std::string kind = tag.rfind(kTag, 0) == 0 ? tag.substr(std::string(kTag).size()) : tag;
    if (kind == "!" || kind.empty() || kind == "str") return text;
    if (const auto flag = kind == "bool" ? bool_of(text) : std::nullopt) return *flag;
    if (kind == "int" && is(text, kinds().is_int)) return checked(int_of(text), text, path);
    if (kind == "float" && is(text, kinds().is_float)) return checked(float_of(text), text, path);
    if (kind == "float" && is(text, kinds().is_int)) return checked(number<double>(without(text, '_')), text, path);
    if (kind == "!degrees") return degrees(text, path);
    if (kind == "!radians") return checked(angle_of(text), text, path);
    fail(path, "= " + tag + ' ' + text + " is of a kind that parameters cannot be");
  }

  static std::string scalar(const YAML::Node& node, const std::string& path) {
    const Value value = value_of(node, path);
    if (std::holds_alternative<Null>(value)) return "~";
    if (const bool* const flag = std::get_if<bool>(&value)) return yaml_text(*flag);
    if (const double* const real = std::get_if<double>(&value)) return with_point(yaml_text(*real));
    if (const std::string* const text = std::get_if<std::string>(&value)) return yaml_text(*text);
    const std::int64_t whole = std::get<std::int64_t>(value);
    if (whole != static_cast<std::int32_t>(whole)) {
      fail(path, "= " + node.Scalar() + " is a whole number beyond 32 bits, which parameters cannot be: write " +
                     std::to_string(whole) + ".0");
    }
    return std::to_string(whole);
  }

  std::size_t nodes_ = 0;
};

}  // namespace

std::string canonical_yaml(const std::string& yaml) {
  std::vector<YAML::Node> documents;
  try {
    documents = YAML::LoadAll(yaml);
  } catch (const YAML::Exception& error) {
    throw std::invalid_argument(yaml_defect(error));
  }
  if (documents.size() > 1) throw std::invalid_argument("not valid YAML for parameters: several documents");
  return documents.empty() ? "" : Writer().text(documents.front(), "");
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <system_error>
#include <type_traits>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/pose2.hpp"

namespace YAML {
class Node;
}

namespace situation_awareness {

// The state of a map of any kind declares each of its fields once, as
//
//     template <class Self, class Visit>
//     static void fields(Self& self, Visit&& visit) {
//       visit("label", self.label);                       // std::string, bool, or a type with its own YAML text
//       visit("observations", self.observations); // an int, a count visit("id", self.id, 1, kMaxId); // an integer
//       with its bounds visit("height_m", self.height_m, Bounds{-1, 1}); // a double visit("start", self.start_m,
//       kPosition); // numbers with names: NumbersOf visit("covariance", self.P, Bounds{0, 1e9}); // a square matrix,
//       with the bounds of its variances visit("vertices", self.vertices, kMaxVertices); // a std::vector of structs
//       with fields() of their own
//     }
//
// and written, read and checked by the visitors below. A user-defined type has yaml_text() and read_yaml_text(), as in
// common/params.hpp.

/// The numbers of a value, by their names in a file; specialised for each such type.
template <class Value>
struct NumbersOf;

template <>
struct NumbersOf<Eigen::Vector2d> {
  template <class Self, class Visit>
  static void visit(Self& value, Visit&& visit) {
    visit("x_m", value.x());
    visit("y_m", value.y());
  }
};

template <>
struct NumbersOf<Pose2> {
  template <class Self, class Visit>
  static void visit(Self& value, Visit&& visit) {
    visit("x_m", value.translation_m.x());
    visit("y_m", value.translation_m.y());
    visit("yaw_rad", value.yaw_rad);
  }
};

namespace detail {

template <class Value>
constexpr bool kIsNumber = std::is_arithmetic_v<Value> && !std::is_same_v<Value, bool>;

template <class Value, class = void>
struct HasNumbers : std::false_type {};
template <class Value>
struct HasNumbers<Value, std::void_t<decltype(sizeof(NumbersOf<Value>))>> : std::true_type {};

template <class Value>
struct IsSquareMatrix : std::false_type {};
template <int N>
struct IsSquareMatrix<Eigen::Matrix<double, N, N>> : std::true_type {};

template <class Value>
struct IsList : std::false_type {};
template <class Item>
struct IsList<std::vector<Item>> : std::true_type {};

/// As YAML text; of a number the shortest one that is read back exactly.
template <class Value>
std::string field_text(const Value& value) {
  if constexpr (kIsNumber<Value>) {
    std::array<char, 32> text;
    return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
  } else {
    return yaml_text(value);
  }
}

/// "elements[3]: ", after the place of the list.
std::string item_place(const std::string& place, const std::string& name, std::size_t item);

}  // namespace detail

/// Writes one field after the other as a line `name: value`.
class WriteFields {
 public:
  /// Appends to `text`.
  explicit WriteFields(std::string& text, std::string indent = "") : text_(text), indent_(std::move(indent)) {}

  template <class Value, class... Limits>
  void operator()(const char* name, const Value& value, const Limits&... /*limits*/) {
    if constexpr (detail::IsList<Value>::value) {
      list(name, value, [](const auto& /*item*/) { return std::string(); });
    } else if constexpr (detail::IsSquareMatrix<Value>::value) {
      matrix(name, value);
    } else if constexpr (detail::HasNumbers<Value>::value) {
      std::string numbers;
      NumbersOf<Value>::visit(value, [&numbers](const char* part, double number) {
        numbers += (numbers.empty() ? "{" : ", ") + std::string(part) + ": " + detail::field_text(number);
      });
      line(name, numbers + "}");
    } else {
      line(name, detail::field_text(value));
    }
  }

  /// The same of a list with a readable comment on each item.
  template <class Item, class CommentOn>
  void list(const char* name, const std::vector<Item>& items, const CommentOn& comment_on) {
    line(name, items.empty() ? "[]" : "");
    for (const Item& item : items) {
      const std::string comment = comment_on(item);
      text_ += indent_ + "  -" + (comment.empty() ? "" : "  # ") + comment + '\n';
      Item::fields(item, WriteFields(text_, indent_ + "    "));
    }
  }

 private:
  void line(const char* name, const std::string& value);
  void matrix(const char* name, const Eigen::Ref<const Eigen::MatrixXd>& value);

  std::string& text_;
  std::string indent_;
};

/// Reads one field after the other, in any order, and records the remaining ones. Throws std::invalid_argument naming
/// the field. Bounds are checked by CheckFields.
class ReadFields {
 public:
  /// Fields that have names in YAML; `place` begins each message.
  ReadFields(const YAML::Node& node, std::string place);

  template <class Value, class... Limits>
  void operator()(const char* name, Value& value, const Limits&... limits) {
    if constexpr (detail::IsList<Value>::value) {
      for (ReadFields& item_fields : list(name, limits...)) {
        Value::value_type::fields(value.emplace_back(), item_fields);
        item_fields.refuse_rest();
      }
    } else if constexpr (detail::IsSquareMatrix<Value>::value) {
      matrix(name, value);
    } else if constexpr (detail::HasNumbers<Value>::value) {
      ReadFields parts = part(name);
      NumbersOf<Value>::visit(value, parts);
      parts.refuse_rest();
    } else {
      read(name, text(name), value);
    }
  }

  /// The fields of each item of a list.
  std::vector<ReadFields> list(const char* name, std::size_t max_items);

  /// Adds a field that a file of an older version does not have.
  void add(const char* name, const std::string& text);

  void refuse_rest() const;

 private:
  struct Content;

  [[noreturn]] void refuse(const std::string& name, const std::string& defect) const;
  YAML::Node take(const std::string& name);
  std::string text(const std::string& name);
  ReadFields part(const std::string& name);
  void matrix(const char* name, Eigen::Ref<Eigen::MatrixXd> value);

  template <class Value>
  void read(const std::string& name, const std::string& text, Value& value) const {
    if constexpr (std::is_same_v<Value, std::string>) {
      value = text;
    } else if constexpr (std::is_same_v<Value, bool>) {
      if (text != "true" && text != "false") refuse(name, "= " + text + " is neither true nor false");
      value = text == "true";
    } else if constexpr (detail::kIsNumber<Value>) {
      const char* const end = text.data() + text.size();
      const auto [stop, error] = std::from_chars(text.data(), end, value);
      if (error == std::errc() && stop == end) return;
      refuse(name, "= " + text + " is no " + (std::is_integral_v<Value> ? "whole " : "") + "number that fits");
    } else {
      try {
        read_yaml_text(text, value);
      } catch (const std::invalid_argument& error) {
        refuse(name, "= " + text + ' ' + error.what());
      }
    }
  }

  std::string place_;
  std::shared_ptr<Content> content_;
};

/// Checks one field after the other: numbers within their bounds, counts from 0 to kMaxCount, covariances symmetric and
/// positive semidefinite. Throws std::invalid_argument naming the field, its value and its bounds.
class CheckFields {
 public:
  /// `place` begins each message.
  explicit CheckFields(std::string place = "") : place_(std::move(place)) {}

  template <class Value, class... Limits>
  void operator()(const char* name, const Value& value, const Limits&... limits) const {
    if constexpr (detail::IsList<Value>::value) {
      size(name, value.size(), limits...);
      for (std::size_t i = 0; i < value.size(); ++i) {
        Value::value_type::fields(value[i], CheckFields(detail::item_place(place_, name, i)));
      }
    } else if constexpr (detail::IsSquareMatrix<Value>::value) {
      covariance(name, value, limits...);
    } else if constexpr (detail::HasNumbers<Value>::value) {
      NumbersOf<Value>::visit(value, [&](const char* /*part*/, double number) { range(name, number, limits...); });
    } else if constexpr (sizeof...(Limits) > 0 && std::is_integral_v<Value>) {
      using Widest = std::conditional_t<std::is_signed_v<Value>, std::int64_t, std::uint64_t>;
      range(name, Widest{value}, static_cast<Widest>(limits)...);
    } else if constexpr (sizeof...(Limits) > 0) {
      range(name, value, limits...);
    } else if constexpr (detail::kIsNumber<Value>) {
      count(name, value);
    }
  }

  [[noreturn]] void refuse(const std::string& name, const std::string& defect) const;

 private:
  void range(const char* name, std::uint64_t value, std::uint64_t low, std::uint64_t high) const;
  void range(const char* name, std::int64_t value, std::int64_t low, std::int64_t high) const;
  void range(const char* name, double value, Bounds bounds) const;
  void count(const char* name, int value) const;
  void size(const char* name, std::size_t items, std::size_t max_items) const;
  void covariance(const char* name, const Eigen::Ref<const Eigen::MatrixXd>& P, Bounds variance) const;

  std::string place_;
};

}  // namespace situation_awareness

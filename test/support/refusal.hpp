// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <cctype>
#include <stdexcept>
#include <string>
#include <vector>

namespace situation_awareness {

/// The message with which `call` throws an `Error`; empty if it throws nothing. Other exceptions are passed on.
template <class Error = std::invalid_argument, class Call>
std::string refusal_of(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

/// Whether `message` has `fact` as a whole: the field "scan.max_range_m" is neither in "my_scan.max_range_m" nor in
/// "scan.max_range_m.x", the number "1" neither in "-1" nor in "10" or "1.5", the path "/a/b" not in "/a/b.onnx".
inline bool has_fact(const std::string& message, const std::string& fact) {
  if (fact.empty()) return false;
  const auto is_word = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; };
  const auto at = [&](std::size_t i) { return i < message.size() ? message[i] : ' '; };
  for (std::size_t i = message.find(fact); i != std::string::npos; i = message.find(fact, i + 1)) {
    const char before = i == 0 ? ' ' : message[i - 1];
    const std::size_t end = i + fact.size();
    const bool goes_on_before = is_word(before) || before == '.' || before == '-' || before == '/';
    const bool goes_on_behind = is_word(at(end)) || at(end) == '/' || (at(end) == '.' && is_word(at(end + 1)));
    const bool begins_alone = is_word(fact.front()) || fact.front() == '-' || fact.front() == '/';
    if (!(begins_alone && goes_on_before) && !(is_word(fact.back()) && goes_on_behind)) return true;
  }
  return false;
}

/// Checks the facts of a message and not its wording: it is one line and has all the facts, which are fields, values,
/// bounds, paths and names. `EXPECT_TRUE(names(refusal_of([&] { ... }), {"scan.max_range_m", "-1"}))`.
inline testing::AssertionResult names(const std::string& message, const std::vector<std::string>& facts) {
  if (message.empty()) return testing::AssertionFailure() << "nothing was refused";
  if (message.find('\n') != std::string::npos) return testing::AssertionFailure() << "more than a line: " << message;
  for (const std::string& fact : facts) {
    if (!has_fact(message, fact)) return testing::AssertionFailure() << fact << " is not in: " << message;
  }
  return testing::AssertionSuccess();
}

}  // namespace situation_awareness

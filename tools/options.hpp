// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdio>
#include <exception>
#include <functional>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>

namespace situation_awareness {

/// The command line cannot be used; what() says why.
struct UsageError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Takes the value of the named option; throws UsageError if it cannot be used.
using TakeValue = std::function<void(const std::string& option, const std::string& value)>;

/// The number that a text is, and NaN if it is none.
inline double number_of(const std::string& text) try {
  std::size_t end = 0;
  const double value = std::stod(text, &end);
  return end == text.size() ? value : std::numeric_limits<double>::quiet_NaN();
} catch (const std::logic_error&) {
  return std::numeric_limits<double>::quiet_NaN();
}

inline TakeValue into(std::string& text) {
  return [&text](const std::string& /*option*/, const std::string& value) { text = value; };
}

/// What `parse` makes of option and value.
template <class Value, class Parse>
TakeValue into(Value& place, const Parse& parse) {
  return [&place, parse](const std::string& option, const std::string& value) { place = parse(option, value); };
}

/// Read options, each followed by its value, and flags. True if help was asked for; what comes after it is not read.
inline bool read_options(int argc, char** argv, const std::map<std::string, TakeValue>& options,
                         const std::map<std::string, bool*>& flags = {}) {
  for (int i = 1; i < argc; ++i) {
    const std::string name = argv[i];
    if (name == "--help" || name == "-h") return true;
    if (const auto flag = flags.find(name); flag != flags.end()) {
      *flag->second = true;
      continue;
    }
    const auto option = options.find(name);
    if (option == options.end()) throw UsageError("unknown option " + name);
    if (++i >= argc) throw UsageError(name + " needs a value");
    option->second(name, argv[i]);
  }
  return false;
}

inline void require(const std::string& option, const std::string& value) {
  if (value.empty()) throw UsageError(option + " is missing");
}

/// The exit status of a program: `run` with the arguments that `parse` makes of the command line, or `usage` where
/// their `help` is set. Says on stderr, after the program's name, what they throw.
template <class Parse, class Run>
int run_program(const char* name, const char* usage, int argc, char** argv, const Parse& parse, const Run& run) try {
  const auto arguments = parse(argc, argv);
  if (arguments.help) {
    std::printf("%s", usage);
    return 0;
  }
  return run(arguments);
} catch (const UsageError& error) {
  std::fprintf(stderr, "%s: %s\n\n%s", name, error.what(), usage);
  return 2;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s: %s\n", name, error.what());
  return 1;
}

}  // namespace situation_awareness

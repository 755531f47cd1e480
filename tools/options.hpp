// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
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

inline TakeValue into(std::string& text) {
  return [&text](const std::string& /*option*/, const std::string& value) { text = value; };
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

}  // namespace situation_awareness

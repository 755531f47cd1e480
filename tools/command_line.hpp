// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
class Validator;
}  // namespace CLI

namespace situation_awareness {

// The command lines of all programs, by CLI11. It consists of headers that take ten seconds to compile, so
// command_line.cpp alone includes them.

/// What the value of an option has to be.
class Check {
 public:
  /// By a function that says of the option's text what is wrong, or returns an empty sentence.
  explicit Check(const std::function<std::string(const std::string&)>& what_is_wrong);
  explicit Check(const CLI::Validator& validator);

  /// Either of two.
  friend Check operator|(const Check& a, const Check& b);

 private:
  friend class CommandLineOption;
  std::shared_ptr<const CLI::Validator> validator_;
};

/// A number in this range; NaN is in none.
Check from_to(double low, double high);
/// A number in this range, which help shows; unlike with from_to, NaN passes.
Check in_range(double low, double high);
/// One of these names, which help shows.
Check one_of(const std::vector<std::string>& names);

/// An option of a command line, which must outlive it.
class CommandLineOption {
 public:
  explicit CommandLineOption(CLI::Option& option) : option_(&option) {}

  CommandLineOption& required();
  CommandLineOption& type_name(const std::string& name);    ///< of its value, for help
  CommandLineOption& default_str(const std::string& text);  ///< as which help shows its default
  CommandLineOption& check(const Check& check);
  CommandLineOption& delimiter(char delimiter);  ///< between the values of a list
  CommandLineOption& take_all();                 ///< of those given, not the last alone
  CommandLineOption& needs(const CommandLineOption& other);
  CommandLineOption& excludes(const CommandLineOption& other);
  CommandLineOption& excludes(const std::string& other);

 private:
  CLI::Option* option_;
};

/// The command line cannot be used, for the reason that the sentence gives.
struct CommandLineError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// An option is missing.
CommandLineError option_required(const std::string& option);

/// The command line of a program. Of an option that is given twice the last counts.
class CommandLine {
 public:
  CommandLine(const std::string& name, const std::string& description);
  CommandLine(const CommandLine&) = delete;
  CommandLine& operator=(const CommandLine&) = delete;
  ~CommandLine();

  /// An option that sets `value`, of a type that command_line.cpp lists.
  template <class Value>
  CommandLineOption add_option(const std::string& name, Value& value, const std::string& description);
  CommandLineOption add_option_function(const std::string& name, const std::function<void(const std::string&)>& use,
                                        const std::string& description);
  CommandLineOption add_flag(const std::string& name, bool& value, const std::string& description);
  /// To be called after all options are set; may throw CommandLineError.
  void callback(const std::function<void()>& after_parsing);
  /// How often the option was given.
  std::size_t count(const std::string& option) const;

 private:
  friend int run_program(CommandLine& app, int argc, char** argv, const std::function<int()>& run);
  std::unique_ptr<CLI::App> app_;
};

/// A whole number as options are read; none where the text is no such number.
std::optional<std::uint64_t> whole_number(const std::string& text);

/// Where `parse` cannot read the value of an option, and throws std::invalid_argument, the command line cannot be used.
void check_option(const std::function<void()>& parse);

/// The exit status of a program: what `run` returns, 1 where it throws, 2 where the command line cannot be used, 0
/// after help was asked for. Says on stderr in one sentence, after the program's name, what is wrong.
int run_program(CommandLine& app, int argc, char** argv, const std::function<int()>& run);

/// A program that does `run` with its options, which `add_options` adds to the command line.
template <class Options, class AddOptions, class Run>
int run_program(const std::string& name, const std::string& description, int argc, char** argv,
                const AddOptions& add_options, const Run& run) {
  Options options;
  CommandLine app(name, description);
  add_options(app, options);
  return run_program(app, argc, argv, [&] { return run(options); });
}

}  // namespace situation_awareness

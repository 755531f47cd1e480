// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdio>
#include <exception>
#include <sstream>
#include <stdexcept>
#include <string>

#include <CLI/CLI.hpp>

namespace situation_awareness {

/// The command line of a program. Of an option that is given twice the last counts.
class CommandLine : public CLI::App {
 public:
  CommandLine(const std::string& name, const std::string& description) : CLI::App(description, name) {
    option_defaults()->take_last()->always_capture_default();
    get_formatter()->column_width(36);
  }
};

/// A check for numbers that NaN does not pass, unlike CLI::Range.
inline CLI::Validator from_to(double low, double high) {
  return CLI::Validator(
      [low, high](const std::string& text) {
        double value = 0.0;
        if (CLI::detail::lexical_cast(text, value) && value >= low && value <= high) return std::string();
        std::ostringstream sentence;
        sentence << "needs a number from " << low << " to " << high << ", not " << text;
        return sentence.str();
      },
      "");
}

/// Where `parse` cannot read the value of an option, and throws std::invalid_argument, the command line cannot be used.
template <class Parse>
void check_option(const Parse& parse) {
  try {
    parse();
  } catch (const std::invalid_argument& error) {
    throw CLI::ValidationError(error.what());
  }
}

/// The exit status of a program: what `run` returns, 1 where it throws, 2 where the command line cannot be used, 0
/// after help was asked for. Says on stderr in one sentence, after the program's name, what is wrong.
template <class Run>
int run_program(CommandLine& app, int argc, char** argv, const Run& run) {
  const auto fail = [&app](int status, const std::string& sentence) {
    std::fflush(stdout);  // the sentence comes last
    std::fprintf(stderr, "%s: %s\n", app.get_name().c_str(), sentence.c_str());
    return status;
  };
  try {
    app.parse(argc, argv);
    return run();
  } catch (const CLI::CallForHelp&) {
    std::printf("%s", app.help().c_str());
    return 0;
  } catch (const CLI::ParseError& error) {
    return fail(2, std::string(error.what()) + " (--help lists the options)");
  } catch (const std::exception& error) {
    return fail(1, error.what());
  }
}

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

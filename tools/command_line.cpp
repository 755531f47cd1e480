// SPDX-License-Identifier: BSD-3-Clause
#include "command_line.hpp"

#include <cstdio>
#include <exception>
#include <sstream>

#include <CLI/CLI.hpp>

namespace situation_awareness {

Check::Check(const std::function<std::string(const std::string&)>& what_is_wrong)
    : validator_(std::make_shared<const CLI::Validator>(
          [what_is_wrong](std::string& text) { return what_is_wrong(text); }, "")) {}

Check::Check(const CLI::Validator& validator) : validator_(std::make_shared<const CLI::Validator>(validator)) {}

Check operator|(const Check& a, const Check& b) { return Check(*a.validator_ | *b.validator_); }

Check from_to(double low, double high) {
  return Check([low, high](const std::string& text) {
    double value = 0.0;
    if (CLI::detail::lexical_cast(text, value) && value >= low && value <= high) return std::string();
    std::ostringstream sentence;
    sentence << "needs a number from " << low << " to " << high << ", not " << text;
    return sentence.str();
  });
}

Check in_range(double low, double high) { return Check(CLI::Range(low, high)); }

Check one_of(const std::vector<std::string>& names) { return Check(CLI::IsMember(names)); }

// --- options ---------------------------------------------------------------------------------------------------------

CommandLineOption& CommandLineOption::required() {
  option_->required();
  return *this;
}

CommandLineOption& CommandLineOption::type_name(const std::string& name) {
  option_->type_name(name);
  return *this;
}

CommandLineOption& CommandLineOption::default_str(const std::string& text) {
  option_->default_str(text);
  return *this;
}

CommandLineOption& CommandLineOption::check(const Check& check) {
  option_->check(*check.validator_);
  return *this;
}

CommandLineOption& CommandLineOption::delimiter(char delimiter) {
  option_->delimiter(delimiter);
  return *this;
}

CommandLineOption& CommandLineOption::take_all() {
  option_->take_all();
  return *this;
}

CommandLineOption& CommandLineOption::needs(const CommandLineOption& other) {
  option_->needs(other.option_);
  return *this;
}

CommandLineOption& CommandLineOption::excludes(const CommandLineOption& other) {
  option_->excludes(other.option_);
  return *this;
}

CommandLineOption& CommandLineOption::excludes(const std::string& other) {
  option_->excludes(other);
  return *this;
}

CommandLineError option_required(const std::string& option) {
  return CommandLineError(CLI::RequiredError(option).what());
}

// --- the command line ------------------------------------------------------------------------------------------------

CommandLine::CommandLine(const std::string& name, const std::string& description)
    : app_(std::make_unique<CLI::App>(description, name)) {
  app_->option_defaults()->take_last()->always_capture_default();
  app_->get_formatter()->column_width(36);
}

CommandLine::~CommandLine() = default;

template <class Value>
CommandLineOption CommandLine::add_option(const std::string& name, Value& value, const std::string& description) {
  return CommandLineOption(*app_->add_option(name, value, description));
}

template CommandLineOption CommandLine::add_option(const std::string&, double&, const std::string&);
template CommandLineOption CommandLine::add_option(const std::string&, int&, const std::string&);
template CommandLineOption CommandLine::add_option(const std::string&, std::uint32_t&, const std::string&);
template CommandLineOption CommandLine::add_option(const std::string&, std::uint64_t&, const std::string&);
template CommandLineOption CommandLine::add_option(const std::string&, std::string&, const std::string&);
template CommandLineOption CommandLine::add_option(const std::string&, std::optional<double>&, const std::string&);
template CommandLineOption CommandLine::add_option(const std::string&, std::vector<int>&, const std::string&);
template CommandLineOption CommandLine::add_option(const std::string&, std::vector<double>&, const std::string&);
template CommandLineOption CommandLine::add_option(const std::string&, std::vector<std::string>&, const std::string&);

CommandLineOption CommandLine::add_option_function(const std::string& name,
                                                   const std::function<void(const std::string&)>& use,
                                                   const std::string& description) {
  return CommandLineOption(*app_->add_option_function<std::string>(name, use, description));
}

CommandLineOption CommandLine::add_flag(const std::string& name, bool& value, const std::string& description) {
  return CommandLineOption(*app_->add_flag(name, value, description));
}

void CommandLine::callback(const std::function<void()>& after_parsing) { app_->callback(after_parsing); }

std::size_t CommandLine::count(const std::string& option) const { return app_->count(option); }

std::optional<std::uint64_t> whole_number(const std::string& text) {
  std::uint64_t value = 0;
  if (!CLI::detail::lexical_cast(text, value)) return std::nullopt;
  return value;
}

void check_option(const std::function<void()>& parse) {
  try {
    parse();
  } catch (const std::invalid_argument& error) {
    throw CommandLineError(error.what());
  }
}

int run_program(CommandLine& app, int argc, char** argv, const std::function<int()>& run) {
  const auto fail = [&app](int status, const std::string& sentence) {
    std::fflush(stdout);  // the sentence comes last
    std::fprintf(stderr, "%s: %s\n", app.app_->get_name().c_str(), sentence.c_str());
    return status;
  };
  const auto refuse = [&fail](const std::exception& error) {
    return fail(2, std::string(error.what()) + " (--help lists the options)");
  };
  try {
    app.app_->parse(argc, argv);
    return run();
  } catch (const CLI::CallForHelp&) {
    std::printf("%s", app.app_->help().c_str());
    return 0;
  } catch (const CLI::ParseError& error) {
    return refuse(error);
  } catch (const CommandLineError& error) {
    return refuse(error);
  } catch (const std::exception& error) {
    return fail(1, error.what());
  }
}

}  // namespace situation_awareness

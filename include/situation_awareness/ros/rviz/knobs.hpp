// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <dynamic_reconfigure/Config.h>
#include <dynamic_reconfigure/ConfigDescription.h>

namespace situation_awareness {

using KnobValue = std::variant<bool, int, double, std::string>;

/// A parameter of a dynamic_reconfigure server.
struct Knob {
  std::string name;
  std::string description;
  KnobValue value;      ///< its default, until the server has sent the current one
  KnobValue low, high;  ///< of the same type; empty texts for a text
};

bool operator==(const Knob& a, const Knob& b);

/// The knobs of a server in its order, at their defaults. Those without type or bounds are left out.
std::vector<Knob> knobs_of(const dynamic_reconfigure::ConfigDescription& description);

/// The value of a parameter in `config`, if any.
std::optional<KnobValue> value_in(const dynamic_reconfigure::Config& config, const std::string& name);

/// The request that sets one parameter and leaves the others.
dynamic_reconfigure::Config config_of(const std::string& name, const KnobValue& value);

/// For display: numbers with as many digits as needed.
std::string text_of(const KnobValue& value);

}  // namespace situation_awareness

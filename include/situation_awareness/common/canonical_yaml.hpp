// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace situation_awareness {

/// The one document of a YAML text in the flow style, with each value written in the one way that all readers take
/// alike. A value is what roslaunch and rosparam have on the parameter server (PyYAML 6.0, by the rules of YAML 1.1):
/// 010 is 8, 12:30 is 750, 1_000 is 1000, yes and on are true, deg(90) is an angle in rad, << merges maps; y and 1e-3
/// are texts, which a parameter takes for a number where it is one.
///
/// Throws std::invalid_argument with the reason, after the path of the value, for what they refuse or silently lose: a
/// doubled key, a key that is no text, several documents, a date, a whole number beyond 32 bits; and for no YAML.
std::string canonical_yaml(const std::string& yaml);

}  // namespace situation_awareness

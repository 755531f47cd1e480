// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "situation_awareness/sim/scanner.hpp"

namespace situation_awareness {

/// Whether a preset is given by the path of its file, which has a folder or ends in .yaml, and not by name.
bool is_scanner_preset_path(const std::string& preset);

/// The file of a scanner's preset: a path as it is, a name as FOLDER/NAME.yaml. models/scanners has those of this
/// package.
std::string scanner_preset_file(const std::string& preset, const std::string& folder);

/// A scanner by a YAML file of the names of SimulatedScannerParams; those that it omits keep their defaults. Throws
/// std::invalid_argument naming file, field and bound; also for unknown names.
SimulatedScannerParams load_scanner_preset(const std::string& path);

}  // namespace situation_awareness

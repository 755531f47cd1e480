// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/scanner_presets.hpp"

#include <filesystem>

#include "situation_awareness/common/params_yaml.hpp"

namespace situation_awareness {

bool is_scanner_preset_path(const std::string& preset) {
  const std::filesystem::path path(preset);
  return path.has_parent_path() || path.extension() == ".yaml";
}

std::string scanner_preset_file(const std::string& preset, const std::string& folder) {
  if (is_scanner_preset_path(preset)) return preset;
  return (std::filesystem::path(folder) / (preset + ".yaml")).string();
}

SimulatedScannerParams load_scanner_preset(const std::string& path) {
  return params_from_yaml<SimulatedScannerParams>(read_text_file(path), path, refuse);
}

}  // namespace situation_awareness

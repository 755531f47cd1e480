// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/common/model_file.hpp"

#include <yaml-cpp/yaml.h>

#include <exception>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "situation_awareness/common/sha256.hpp"

namespace situation_awareness {
namespace {

constexpr int kManifestVersion = 1;

std::string read_whole_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!std::filesystem::is_regular_file(path) || !file) throw std::runtime_error(path + ": cannot be read");
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

std::string manifest_path_of(const std::string& onnx_path) {
  const std::string extension = ".onnx";
  const bool has_extension = onnx_path.size() > extension.size() &&
                             onnx_path.compare(onnx_path.size() - extension.size(), extension.size(), extension) == 0;
  if (!has_extension) throw std::runtime_error(onnx_path + ": not the name of an .onnx file");
  return onnx_path.substr(0, onnx_path.size() - extension.size()) + ".manifest.yaml";
}

}  // namespace

ModelFile read_model_file(const std::string& onnx_path) {
  ModelFile file;
  file.manifest_path = manifest_path_of(onnx_path);
  file.onnx = read_whole_file(onnx_path);
  file.manifest = read_whole_file(file.manifest_path);
  try {
    const YAML::Node root = YAML::Load(file.manifest);
    const int version = root["version"].as<int>();
    if (version != kManifestVersion) throw std::runtime_error("unknown version " + std::to_string(version));
    file.sha256 = root["sha256"].as<std::string>();
  } catch (const std::exception& error) {
    throw std::runtime_error(file.manifest_path + ": not a manifest of a network (" + error.what() + ")");
  }
  if (sha256(file.onnx) != file.sha256) {
    throw std::runtime_error(onnx_path + ": its SHA-256 is not the one in " + file.manifest_path +
                             ": damaged, or of another version");
  }
  return file;
}

}  // namespace situation_awareness

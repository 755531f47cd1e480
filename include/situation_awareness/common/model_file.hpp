// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace situation_awareness {

/// A network's file MODEL.onnx, whole, and the text of MODEL.manifest.yaml beside it.
struct ModelFile {
  std::string onnx;
  std::string sha256;  ///< of `onnx`, in hexadecimal
  std::string manifest_path;
  std::string manifest;  ///< YAML; what each kind of network has in it beside version and sha256 is its reader's
};

/// Reads both and compares the file's SHA-256 with the manifest's, because a damaged file may crash an importer
/// (docs/math/detections.md, "Loading"). Throws std::runtime_error naming the file and the reason: missing, not a
/// manifest, of another version than 1, damaged.
ModelFile read_model_file(const std::string& onnx_path);

}  // namespace situation_awareness

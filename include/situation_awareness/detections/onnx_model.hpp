// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

namespace situation_awareness {

/// A network with one row of inputs and outputs per sample, read from an ONNX file by OpenCV dnn and run on the calling
/// thread only: fully connected layers by DenseLayers, without allocation after the largest batch, all others by OpenCV
/// dnn. Not thread-safe: one model, one thread.
class OnnxModel {
 public:
  /// Reads MODEL.onnx and, beside it, MODEL.manifest.yaml, which has (docs/math/detections.md, "Loading")
  ///   version  1
  ///   sha256   of the ONNX file, in hexadecimal
  ///   input    {name, shape: [batch, N] or [batch, 1, 1, N]}
  ///   output   {name, shape: [batch, M]}
  ///   golden   {first, input, fill, output}: the inputs from index `first` on, the value of all others (0 where it is
  ///            left out), and the answer
  /// Throws std::runtime_error naming the file and the reason: missing, damaged, of other names or shapes, or with
  /// other outputs than the golden vector.
  explicit OnnxModel(const std::string& onnx_path);
  ~OnnxModel();
  OnnxModel(OnnxModel&&) noexcept;
  OnnxModel& operator=(OnnxModel&&) noexcept;

  int inputs() const;                      ///< N, numbers per row
  int outputs() const;                     ///< M, numbers per row
  const std::string& file_sha256() const;  ///< of the ONNX file, in hexadecimal

  /// The inputs of the next forward, all set to `value`: `rows` (at least 1) rows of inputs() numbers, one behind the
  /// other. Valid until the next call.
  float* resize(int rows, float value = 0.0F);

  /// The outputs for all rows in one forward: rows of outputs() numbers, one behind the other. Valid until the next
  /// call. Throws std::runtime_error if the network's output has another shape.
  const float* forward();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

namespace situation_awareness {

/// Fully connected layers, each y = A x + b, with max(y, 0) if `relu`, one behind the other: a forward on the calling
/// thread that allocates no memory unless its batch is larger than all before. The result of a row does not depend on
/// the other rows of the batch, bit for bit. With the processor's fused multiply-add where it has AVX2, so that other
/// processors differ by rounding. Not thread-safe: it keeps the outputs of its layers.
class DenseLayers {
 public:
  using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  /// Puts a layer behind the others; A has a row for each output. Throws std::invalid_argument if its number of inputs
  /// is not that of the layer before, if `b` has another number of outputs than A, or if there are none.
  void add(const Eigen::Ref<const Rows>& A, const Eigen::Ref<const Eigen::VectorXf>& b, bool relu);

  bool empty() const { return layers_.empty(); }
  int inputs() const;   ///< numbers per row; 0 without layers
  int outputs() const;  ///< numbers per row; 0 without layers

  /// The outputs of `rows` rows of inputs() numbers: rows of outputs() numbers, one behind the other. Valid until the
  /// next call. There must be a layer.
  const float* forward(const float* inputs, int rows);

 private:
  static constexpr std::size_t kPanel = 16;  ///< outputs of a panel
  /// Biases or the weights of one input: a line of the processor's cache, of which each is loaded at once.
  struct alignas(kPanel * sizeof(float)) PanelLine {
    std::array<float, kPanel> of_outputs;
  };

  struct Layer {
    int inputs = 0;
    int outputs = 0;
    bool relu = false;
    /// For each panel of outputs, the last one filled with zeros: the biases, then the weights of one input after the
    /// other.
    std::vector<PanelLine> panels;
  };

  std::vector<Layer> layers_;
  std::vector<int> used_, counts_;   ///< inputs of a layer that are not zero, kept for their memory
  std::vector<float> front_, back_;  ///< outputs of two layers in turn, kept for their memory
};

}  // namespace situation_awareness

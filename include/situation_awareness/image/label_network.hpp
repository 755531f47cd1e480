// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/image/image.hpp"

namespace situation_awareness {

/// The size to which images are scaled for a LabelNetwork.
struct LabelNetworkParams {
  int width = 448;
  int height = 448;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("width", self.width, Bounds{32, 4096}, "px", "columns of the network's input, a multiple of 32");
    visit("height", self.height, Bounds{32, 4096}, "px", "rows of the network's input, a multiple of 32");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// A fully convolutional network that gives for each class the probability of each label pixel to show it, such as
/// ScoutNet (D. Maturana, S. Arora, S. Scherer, Looking forward: a semantic mapping system for scouting with micro
/// aerial vehicles, 2017, Sect. IV), read from an ONNX file by OpenCV dnn and run on the calling thread only. Not
/// thread-safe: one network, one thread. A forward of OpenCV dnn allocates.
class LabelNetwork {
 public:
  /// Reads MODEL.onnx and, beside it, MODEL.manifest.yaml, which has
  ///   version, sha256   (common/model_file.hpp)
  ///   input             {name, shape: [batch, 3, height, width], multiple: of what height and width must be multiples}
  ///   output            {name, shape: [batch, K, height / S, width / S]}: probabilities that add up to 1
  ///   stride            S, pixels of the input along a side of a label pixel
  ///   classes           K names
  ///   normalisation     {mean, deviation}: the input is (number / 255 - mean) / deviation for red, green and blue
  ///   golden            {size, output}: the answer for an image of size x size pixels whose numbers are
  ///                     (7 x + 13 y + 61 c + floor(x y / 3)) mod 256, c = 0, 1, 2 for red, green and blue
  /// Throws std::invalid_argument for params, and std::runtime_error naming the file and the reason: missing, damaged,
  /// of other names or shapes, with another answer than the golden one, or not for images of this size.
  LabelNetwork(const std::string& onnx_path, const LabelNetworkParams& params);
  ~LabelNetwork();
  LabelNetwork(LabelNetwork&&) noexcept;
  LabelNetwork& operator=(LabelNetwork&&) noexcept;

  const LabelNetworkParams& params() const;
  const std::vector<std::string>& class_names() const;
  const std::string& file_sha256() const;  ///< of the ONNX file, in hexadecimal

  /// The place of the class in class_names(). Throws std::invalid_argument naming it and those that there are.
  std::size_t index_of(const std::string& class_name) const;

  /// Labels of an image of any size, one for each class, with the image's stamp and the image's camera scaled to the
  /// labels' size. Valid until the next call. Throws std::invalid_argument where the image cannot be used.
  const std::vector<SoftLabels>& label(const ColorImage& image);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace situation_awareness

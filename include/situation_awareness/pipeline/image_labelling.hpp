// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/image/label_network.hpp"

namespace situation_awareness {

/// The network that labels images, where labels are not given.
struct ImageLabellingParams {
  std::string model = "scoutnet.onnx";
  std::string class_name = "car";
  LabelNetworkParams network;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("model", self.model, "ONNX file of the network, absolute or relative to model_folder");
    visit("class_name", self.class_name, "one of the network's classes, which is mapped");
    LabelNetworkParams::fields(self.network, visit);
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// From images to labels of one class.
class ImageLabelling {
 public:
  /// Throws std::invalid_argument naming the field, and std::runtime_error naming the file and what is wrong with it.
  ImageLabelling(const ImageLabellingParams& params, const std::string& model_folder);

  /// As LabelNetwork::label. Valid until the next call.
  const SoftLabels& label(const ColorImage& image) { return network_.label(image)[of_class_]; }

  const std::string& model_path() const { return path_; }
  const std::string& model_sha256() const { return network_.file_sha256(); }

 private:
  std::string path_;
  LabelNetwork network_;
  std::size_t of_class_;
};

}  // namespace situation_awareness

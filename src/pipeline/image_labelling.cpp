// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/image_labelling.hpp"

#include <filesystem>
#include <stdexcept>

namespace situation_awareness {

void ImageLabellingParams::validate() const {
  check_bounds(*this, "labelling");
  network.validate();
  if (model.empty()) throw std::invalid_argument("labelling.model is empty, the path of an ONNX file");
}

ImageLabelling::ImageLabelling(const ImageLabellingParams& params, const std::string& model_folder)
    : path_((params.validate(), std::filesystem::path(model_folder) / params.model)),
      network_(path_, params.network),
      of_class_(network_.index_of(params.class_name)) {}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "situation_awareness/pipeline/image_labelling.hpp"
#include "situation_awareness/ros/params/nodelet_params.hpp"

namespace situation_awareness {

/// Parameters of the nodelet image_labelling (cfg/grid.yaml).
struct ImageLabellingNodeletParams {
  NodeletParams nodelet;
  std::string model_folder;
  std::string image_kind = "auto";
  ImageLabellingParams labelling;
  std::vector<UnknownKey> unknown;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    NodeletParams::fields(self.nodelet, visit);
    visit("model_folder", self.model_folder, "folder of models with relative paths; empty: models/ of this package");
    visit("image_kind", self.image_kind,
          "what the images are: rectified, with P of camera_info, or raw, with K and D; auto: what the topic's name "
          "says (image_rect*, image_raw), else rectified where there is distortion");
    visit("labelling", self.labelling);
  }
};

/// As read_nodelet_params; keys of other stages, which may read the same file, are not unknown.
ImageLabellingNodeletParams read_image_labelling_nodelet_params(const ParamReader& reader);

}  // namespace situation_awareness

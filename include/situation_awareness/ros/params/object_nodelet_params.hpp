// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "situation_awareness/pipeline/object_pipeline.hpp"
#include "situation_awareness/ros/params/nodelet_params.hpp"

namespace situation_awareness {

/// Parameters of the nodelets on the way to the map of objects (cfg/objects.yaml). All take the same ones, so that one
/// file and one line of a launch file serve them all.
struct ObjectNodeletParams {
  NodeletParams nodelet;
  std::string model_folder;  ///< where models are looked for; empty: models/ of this package
  ObjectPipelineParams pipeline;
  std::vector<UnknownKey> unknown;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    NodeletParams::fields(self.nodelet, visit);
    visit("model_folder", self.model_folder, "folder of the detector's network; empty: models/ of this package");
    ObjectPipelineParams::fields(self.pipeline, visit);
  }
};

/// As read_nodelet_params; keys of other stages, which read the same file, are not unknown, and a relative model is
/// looked for in ~model_folder.
ObjectNodeletParams read_object_nodelet_params(const ParamReader& reader);

}  // namespace situation_awareness

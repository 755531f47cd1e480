// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/object_map_params.hpp"

#include <stdexcept>

namespace situation_awareness {

void ObjectMapParams::validate() const {
  check_bounds(*this, "objects");
  if (shape != "ellipse" && shape != "circle") {
    throw std::invalid_argument("objects.shape = " + shape + " is unknown, known are: circle, ellipse");
  }
}

}  // namespace situation_awareness

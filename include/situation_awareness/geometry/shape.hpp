// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace situation_awareness {

/// What the outline of an object looks like.
enum class Shape : std::uint8_t {
  kEllipse,
  kBox,
  kCompact,  ///< neither is known: something of about this size is there
};

/// "ellipse", "box", "compact".
inline const char* name_of(Shape shape) {
  switch (shape) {
    case Shape::kEllipse:
      return "ellipse";
    case Shape::kBox:
      return "box";
    case Shape::kCompact:
      return "compact";
  }
  return "";
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

struct EllipseFitParams;

/// Estimates an ellipse from each segment of kind kObject. Not thread-safe: one detector, one thread.
class Detector {
 public:
  virtual ~Detector() = default;

  /// `memory`: detections no longer needed, whose memory the result reuses. `not_asked`: not zero for segments whose
  /// detection nobody needs: the result may leave them out, as if they were of another kind.
  Detections detect(const Segments& segments, Detections memory = {}, const std::vector<char>* not_asked = nullptr);

  /// Other parameters from the next scan on; they have been validated.
  virtual void set_fit(const EllipseFitParams& fit) = 0;

  /// SHA-256 of its network's file in hexadecimal; empty if it has none.
  virtual std::string model_sha256() const { return ""; }

 protected:
  bool is_asked(std::size_t segment) const { return not_asked_ == nullptr || (*not_asked_)[segment] == 0; }

 private:
  /// Add to `found` the detections, and the reasons for segments without one; on entry it has only the fields copied
  /// from the segments.
  virtual void find(const Segments& segments, Detections& found) = 0;

  const std::vector<char>* not_asked_ = nullptr;  ///< during detect()
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/detections/detector.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// Another detector's detections without those whose p_ellipse is below `min_p_ellipse`, which are refused as "not one
/// ellipse".
class ProbableDetector final : public Detector {
 public:
  ProbableDetector(std::unique_ptr<Detector> detector, double min_p_ellipse);

  void set_fit(const EllipseFitParams& fit) override { detector_->set_fit(fit); }
  std::string model_sha256() const override { return detector_->model_sha256(); }

  /// From the next scan on.
  void set_min_p_ellipse(double min_p_ellipse) { min_p_ellipse_ = min_p_ellipse; }

 private:
  void find(const Segments& segments, Detections& found) override;

  std::unique_ptr<Detector> detector_;
  double min_p_ellipse_;
};

}  // namespace situation_awareness

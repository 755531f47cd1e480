// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/detections/detector.hpp"
#include "situation_awareness/detections/least_squares.hpp"
#include "situation_awareness/detections/shape_network.hpp"
#include "situation_awareness/geometry/expected_outline.hpp"
#include "situation_awareness/segments/segments.hpp"

namespace situation_awareness {

/// Another detector's detections, judged by the probability that their segment is one ellipse. Without a shape network
/// those below `min_p_ellipse` are refused as "not one ellipse". With one, nothing is refused for its shape: the
/// network says how probable an ellipse is and which box it would be else, and the detection has the mean and
/// covariance of not knowing which (docs/math/boxes.md). Where a scan shows more range noise than `range_sigma_m` of
/// the fit, that of the scan is used: rough hits are no corners.
class ProbableDetector final : public Detector {
 public:
  ProbableDetector(std::unique_ptr<Detector> detector, double min_p_ellipse, const EllipseFitParams& fit);
  ProbableDetector(std::unique_ptr<Detector> detector, std::unique_ptr<ShapeNetwork> shapes,
                   const EllipseFitParams& fit);

  /// Detections of one scan, refined about what the map expects in it (`refine`).
  Detections detect(const Segments& segments, const std::vector<ExpectedOutline>& known_level, Detections memory = {});
  using Detector::detect;

  void set_fit(const EllipseFitParams& fit) override { fit_ = fit; }

  /// The parameters with the range noise of the latest scan.
  const EllipseFitParams& scan_fit() const { return scan_fit_; }

  std::string model_sha256() const override { return detector_->model_sha256(); }

  /// From the next scan on.
  void set_min_p_ellipse(double min_p_ellipse) { min_p_ellipse_ = min_p_ellipse; }

 private:
  void find(const Segments& segments, Detections& found) override;
  void refuse_improbable(Detections& found) const;
  void compare_with_boxes(const Segments& segments, Detections& found);

  std::unique_ptr<Detector> detector_;
  std::unique_ptr<ShapeNetwork> shapes_;  ///< null: only ellipses are expected
  double min_p_ellipse_ = 0.0;
  EllipseFitParams fit_;
  EllipseFitParams scan_fit_;            ///< with the range noise of the latest scan
  std::vector<std::size_t> judged_;      ///< segments, kept for its memory
  std::vector<RefusedSegment> refused_;  ///< by the other detector, kept for its memory
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "situation_awareness/detections/detections.hpp"
#include "situation_awareness/detections/detector.hpp"
#include "situation_awareness/detections/least_squares.hpp"
#include "situation_awareness/detections/refine.hpp"
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

  /// Detections of one scan, refined about what the map expects in it: those of `refine`. The other detector is asked
  /// only for segments where its result matters.
  Detections detect(const Segments& segments, const std::vector<ExpectedOutline>& known_level, Detections memory = {});
  using Detector::detect;

  void set_fit(const EllipseFitParams& fit) override { fit_ = fit; }

  std::string model_sha256() const override { return detector_->model_sha256(); }

  /// From the next scan on.
  void set_min_p_ellipse(double min_p_ellipse) { min_p_ellipse_ = min_p_ellipse; }

 private:
  void find(const Segments& segments, Detections& found) override;
  void refuse_improbable(Detections& found) const;
  void judge_shapes(const Segments& segments);
  void refine_known(const Segments& segments);
  void fit_large(const Segments& segments);
  void compare_with_boxes(Detections& found);

  std::unique_ptr<Detector> detector_;
  std::unique_ptr<ShapeNetwork> shapes_;  ///< null: only ellipses are expected
  double min_p_ellipse_ = 0.0;
  EllipseFitParams fit_;
  EllipseFitParams scan_fit_;  ///< with the range noise of the latest scan
  /// A segment, and what is known of it before the other detector is asked.
  struct Judged {
    Detection as_box;
    const char* box_defect = "";
    bool is_large = false;    ///< longer than what the network was trained for
    bool is_refined = false;  ///< as a known object, whatever the other detector would say
    Detection refined;
  };
  bool refines_ = false;  ///< during detect() with known objects
  KnownObjects known_objects_;
  // Kept for their memory:
  std::vector<std::size_t> objects_;     ///< segments
  std::vector<Judged> judged_;           ///< of objects_
  std::vector<std::size_t> judged_of_;   ///< of the segments
  std::vector<char> is_refined_;         ///< of the segments
  std::vector<RefusedSegment> refused_;  ///< by the other detector
};

}  // namespace situation_awareness

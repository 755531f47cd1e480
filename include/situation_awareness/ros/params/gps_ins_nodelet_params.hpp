// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "situation_awareness/pose/gps_ins.hpp"
#include "situation_awareness/pose/local_world.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/params/nodelet_params.hpp"

namespace situation_awareness {

/// Parameters of the nodelet gps_ins: the section `gps_ins`, and its own.
struct GpsInsNodeletParams {
  NodeletParams nodelet;
  std::string base_frame = "base_link";
  std::string imu_frame;
  std::string fix_frame;
  std::string origin;
  double rate_hz = 50.0;
  bool publish_tf = true;
  double fix_sigma_m = 2.0;
  bool use_heading = false;
  double heading_offset_rad = 0.0;
  double heading_sigma_rad = 0.05;
  GpsInsParams gps_ins;
  std::vector<UnknownKey> unknown;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    NodeletParams::fields(self.nodelet, visit);
    visit("base_frame", self.base_frame, kBaseFrameDoc);
    visit("imu_frame", self.imu_frame, "frame of the IMU, whatever its messages say; empty: theirs");
    visit("fix_frame", self.fix_frame, "frame of the receiver's antenna, whatever its messages say; empty: theirs");
    visit("origin", self.origin,
          "of the world, \"LAT,LON,ALT\" in degrees and m above the ellipsoid; empty: the first good fix, which may "
          "differ from nodelet to nodelet");
    visit("rate_hz", self.rate_hz, Bounds{0.1, 1000.0}, "Hz",
          "largest rate of odometry, pose and TF; at most that of the IMU");
    visit("publish_tf", self.publish_tf, "publish the transform from world to base");
    visit("fix_sigma_m", self.fix_sigma_m, Bounds{0.001, 1000.0}, "m",
          "standard deviation of east and of north, half of that of up, of fixes that come without a covariance");
    visit("use_heading", self.use_heading, "use the yaw of the orientations on the topic `heading`");
    visit(
        "heading_offset_rad", self.heading_offset_rad, Bounds{-7.0, 7.0}, "rad",
        "added to that yaw: minus the declination of a compass, which is positive where its north is east of the true "
        "one");
    visit("heading_sigma_rad", self.heading_sigma_rad, Bounds{0.001, 3.0}, "rad",
          "standard deviation added to that of each message");
    visit("gps_ins", self.gps_ins);
  }
};

/// Checks what a nodelet that places something by GPS and INS has in common with gps_ins, and makes its frames those of
/// tf2. Throws std::invalid_argument naming the parameter.
template <class Params>
void check_inertial_params(Params& params, const std::string& source) {
  for (std::string* frame : {&params.base_frame, &params.imu_frame, &params.fix_frame}) *frame = tf2_frame(*frame);
  if (params.base_frame.empty()) throw std::invalid_argument(source + ": base_frame is empty");
  if (!params.origin.empty()) parse_geodetic_position(params.origin, source + ": origin");
}

/// Parameters of a nodelet that places scans by a filter of its own, which is as that of gps_ins is told to be.
struct InertialParams {
  std::string base_frame = "base_link";
  std::string imu_frame;
  std::string fix_frame;
  std::string origin;
  double fix_sigma_m = 2.0;
  GpsInsParams gps_ins;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("base_frame", self.base_frame, kBaseFrameDoc);
    visit("imu_frame", self.imu_frame, "as that of gps_ins");
    visit("fix_frame", self.fix_frame, "as that of gps_ins");
    visit("origin", self.origin,
          "as that of gps_ins; where both run give it to both, since their first good fixes may differ");
    visit("fix_sigma_m", self.fix_sigma_m, Bounds{0.001, 1000.0}, "m", "as that of gps_ins");
    visit("gps_ins", self.gps_ins);
  }
};

/// The parameters of the nodelet gps_ins that say what `nodelet` and `inertial` do.
GpsInsNodeletParams gps_ins_params_of(const NodeletParams& nodelet, const InertialParams& inertial);

/// As read_nodelet_params; keys of other stages, which may read the same file, are not unknown.
GpsInsNodeletParams read_gps_ins_nodelet_params(const ParamReader& reader);

}  // namespace situation_awareness

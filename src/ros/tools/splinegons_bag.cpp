// SPDX-License-Identifier: BSD-3-Clause
// From a recorded bag to the boundaries of large obstacles, without a roscore, as fast as possible.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <deque>
#include <memory>
#include <string>
#include <utility>

#include <sensor_msgs/Imu.h>
#include <sensor_msgs/NavSatFix.h>

#include "command_line.hpp"
#include "situation_awareness/common/counters.hpp"
#include "situation_awareness/common/params_yaml.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/pipeline/splinegon_pipeline.hpp"
#include "situation_awareness/pose/gps_ins.hpp"
#include "situation_awareness/ros/bag/atomic_file.hpp"
#include "situation_awareness/ros/bag/bag_options.hpp"
#include "situation_awareness/ros/bag/bag_player.hpp"
#include "situation_awareness/ros/bag/first_message.hpp"
#include "situation_awareness/ros/bag/json_line.hpp"
#include "situation_awareness/ros/bag/scans.hpp"
#include "situation_awareness/ros/convert/odometry.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/gps_ins_input.hpp"
#include "situation_awareness/ros/params/gps_ins_nodelet_params.hpp"
#include "situation_awareness/ros/transform_queue.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kName = "splinegons_bag";
constexpr const char* kConfig = "splinegons.yaml";
constexpr const char* kDescription =
    R"(Reads laser scans, an IMU, fixes of a GPS receiver and transforms from a bag and writes pose and boundaries of large
obstacles after each scan as one line of JSON:
  {"stamp": s, "pose": {"x", "y", "z", "roll", "pitch", "yaw": number, "covariance": [36 numbers, row by row]},
   "boundaries": [{"id": int, "closed": bool, "vertices": [[x, y, bulge], ...], "sigma_m": [one per vertex]}]}
in m, rad and s, in the local east, north and up of the origin. The pose is that of the base at the stamp, its covariance
that of x, y, z and of the attitude's error in the base. Boundaries run counter-clockwise around the obstacle; a vertex's
bulge is tan(arc angle / 4) of the arc to the next one. Invalid scans have no line and are counted by reason. Files are
written atomically.
)";

using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr double kResetTimeJump_s = 1.0;
/// Of poses from /tf, which have no covariance.
constexpr double kTfSigma_m = 0.01;
constexpr double kTfSigma_rad = 0.002;
/// The pose is that by the map where its variance is so much less than that by GPS and INS.
constexpr double kWorseThanMap = 1.5;

struct Options {
  BagOptions bag;
  std::string scan_topic = "/scan", imu_topic = "/imu", fix_topic = "/fix";
  std::string localization = "gps", origin, lidar_frame, base_frame = "base_link", out;
};

void add_options(CLI::App& app, Options& options) {
  add_bag_options(app, options.bag, kConfig);
  const auto text = [&app](const char* name, std::string& value, const char* type, const char* what) {
    return app.add_option(name, value, what)->type_name(type);
  };
  text("--scan-topic", options.scan_topic, "TOPIC", "sensor_msgs/LaserScan");
  text("--imu-topic", options.imu_topic, "TOPIC", "sensor_msgs/Imu");
  text("--fix-topic", options.fix_topic, "TOPIC", "sensor_msgs/NavSatFix");
  text("--origin", options.origin, "LAT,LON,ALT", "of the world, in degrees and m (default: the first good fix)");
  text("--lidar-frame", options.lidar_frame, "FRAME", "of the scanner (default: that of its messages)");
  text("--base-frame", options.base_frame, "FRAME", "whose pose is estimated");
  text("--localization", options.localization, "KIND", "gps, with the IMU, or tf: the pose in the world is that of /tf")
      ->check(CLI::IsMember({"gps", "tf"}));
  text("--out", options.out, "FILE", "output file of the lines")->required();
  app.callback([&options] {
    if (!options.origin.empty()) check_option([&options] { parse_geodetic_position(options.origin, "--origin"); });
  });
}

/// R = Rz(yaw) Ry(pitch) Rx(roll).
Json json_of(const Eigen::Isometry3d& T_world_base, const Matrix6& covariance, const Splinegons& splinegons) {
  Json line;
  Json& pose = line["pose"] = Json::object();
  const Eigen::Matrix3d& R = T_world_base.linear();
  pose["x"] = finite(T_world_base.translation().x());
  pose["y"] = finite(T_world_base.translation().y());
  pose["z"] = finite(T_world_base.translation().z());
  pose["roll"] = finite(std::atan2(R(2, 1), R(2, 2)));
  pose["pitch"] = finite(std::atan2(-R(2, 0), std::hypot(R(2, 1), R(2, 2))));
  pose["yaw"] = finite(std::atan2(R(1, 0), R(0, 0)));
  pose["covariance"] = list_of(36, [&](int i) { return covariance(i / 6, i % 6); });
  Json& list = line["boundaries"] = Json::array();
  for (const Splinegon& splinegon : splinegons.boundaries) {
    Json& element = add_object(list, 4);
    element["id"] = splinegon.id;
    element["closed"] = splinegon.closed;
    Json& vertices = element["vertices"] = Json::array();
    Json& sigma = element["sigma_m"] = Json::array();
    for (const SplinegonVertex& vertex : splinegon.vertices) {
      vertices.push_back(list_of(3, [&](int i) { return i < 2 ? vertex.p_world_m(i) : vertex.bulge; }));
      sigma.push_back(finite(vertex.sigma_m));
    }
  }
  return line;
}

/// Of the pose's x, y and yaw in the axes of the world.
Eigen::Matrix3d planar_covariance(const Eigen::Isometry3d& T_world_base, const Matrix6& covariance) {
  Eigen::Matrix<double, 3, 6> J = Eigen::Matrix<double, 3, 6>::Zero();
  J(0, 0) = J(1, 1) = 1.0;
  J.row(2).tail<3>() = T_world_base.linear().row(2);
  return J * covariance * J.transpose();
}

struct BagParams {
  SplinegonPipelineParams pipeline;
  GpsInsParams gps_ins;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    SplinegonPipelineParams::fields(self.pipeline, visit);
    visit("gps_ins", self.gps_ins);
  }
};

void map_by_tf(const Options& options, const BagParams& params) {
  BagPlayer player(options.bag, kResetTimeJump_s);
  LineFile out(options.out);
  SplinegonPipeline pipeline(params.pipeline);
  const std::string world_frame = tf2_frame(options.bag.world_frame), base_frame = tf2_frame(options.base_frame);
  Matrix6 covariance = Matrix6::Zero();
  covariance.diagonal().head<3>().setConstant(kTfSigma_m * kTfSigma_m);
  covariance.diagonal().tail<3>().setConstant(kTfSigma_rad * kTfSigma_rad);
  subscribe_scans(
      player, options.scan_topic,
      [&](const Scan& scan, const auto& T_world_lidar, const auto& T_world_lidar_end) {
        const Eigen::Isometry3d T_world_base =
            transform_at(player.transforms(), world_frame, base_frame, to_ros_time(scan.stamp_ns));
        player.timed([&] {
          pipeline.process(scan, T_world_lidar, T_world_lidar_end, planar_covariance(T_world_base, covariance));
        });
        out.write(json_line(scan.stamp_ns, json_of(T_world_base, covariance, pipeline.splinegons())));
      },
      options.lidar_frame);
  player.play();
  out.finish();
  player.print_summary();
}

/// Empty where there is no fix.
std::string fix_frame(const Options& options) {
  const auto fix = first_message<sensor_msgs::NavSatFix>(options.bag.bag, options.fix_topic);
  return fix ? tf2_frame(fix->header.frame_id) : "";
}

void add_to(Counters& sum, const Counters& counters) {
  for (const auto& [reason, count] : counters) sum[reason] += count;
}

/// The pose by GPS and INS while a bag is played. The transform of the player is that by inertial navigation alone, in
/// a frame of its own: gyroscopes and accelerations, and no jumps where fixes correct the pose.
class BagNavigation {
 public:
  static constexpr const char* kOdomFrame = "splinegons_bag_odom";
  /// For which scans wait until the pose is ready. They are mapped then, but have no line of their own.
  static constexpr double kBacklog_s = 30.0;

  /// As it was known at that time.
  struct Known {
    std::int64_t stamp_ns = 0;
    Eigen::Isometry3d T_world_odom;
    Matrix6 covariance;
    Eigen::Vector3d v_odom_m_s, angular_velocity_odom_rad_s;  ///< of the base
    Eigen::Vector3d v_world_m_s;
    double velocity_sigma_m_s = 0.0;
  };

  BagNavigation(BagPlayer& player, const Options& options, const GpsInsParams& params)
      : player_(player), options_(options), fix_frame_(fix_frame(options)) {
    params.validate();
    params_.base_frame = options.base_frame;
    params_.origin = options.origin;
    params_.gps_ins = params;
    player.subscribe<sensor_msgs::Imu>(options.imu_topic,
                                       [this](const auto& msg, const ros::Time& /*recorded*/) { add(*msg); });
    player.subscribe<sensor_msgs::NavSatFix>(options.fix_topic,
                                             [this](const auto& msg, const ros::Time& /*recorded*/) { add(*msg); });
  }

  /// Before it poses are from what came later: scans of that time waited for them.
  bool was_ready_at(std::int64_t stamp_ns) const { return stamp_ns >= ready_since_ns_; }

  const Known& known_at(std::int64_t stamp_ns) {
    while (known_.size() > 1 && known_[1].stamp_ns <= stamp_ns) known_.pop_front();
    return known_.front();
  }

  void print_summary() const {
    const GpsIns* const filter = input_ ? input_->filter() : nullptr;
    if (filter == nullptr || !filter->is_ready()) {
      std::printf("gps_ins: not ready: %s\n", filter != nullptr ? filter->reason() : "no IMU");
    }
    Counters all = refused_;
    if (input_) add_to(all, input_->counters());
    if (filter != nullptr) add_to(all, filter->counters());
    for (const auto& [reason, count] : all) {
      std::printf("gps_ins: %llu %s\n", static_cast<unsigned long long>(count), reason.c_str());
    }
  }

 private:
  /// The frame itself, if its place on the base is known, else the base.
  std::string known(const std::string& frame) const {
    const std::string base_frame = tf2_frame(options_.base_frame);
    if (frame.empty() || frame == base_frame) return base_frame;
    if (player_.transforms().canTransform(base_frame, frame, ros::Time(0))) return frame;
    std::fprintf(stderr, "%s: no transform from %s to %s: taken for the same frame\n", kName, base_frame.c_str(),
                 frame.c_str());
    return base_frame;
  }

  void add(const sensor_msgs::Imu& msg) {
    if (!input_) {
      params_.imu_frame = known(tf2_frame(msg.header.frame_id));
      params_.fix_frame = known(fix_frame_);
      input_ = std::make_unique<GpsInsInput>(params_, player_.transforms());
      input_->keep_backlog(kBacklog_s);
    }
    const std::string reason = input_->add_imu(msg);
    if (!reason.empty()) ++refused_[reason];
    if (input_->filter() == nullptr) return;
    const GpsInsPose pose = input_->filter()->pose();
    if (!pose.is_ready) return;
    if (ready_since_ns_ == StampOrder::kNone) {
      ready_since_ns_ = pose.stamp_ns;
      for (const GpsInsPose& earlier : input_->backlog_poses(pose)) go_on(earlier);
    }
    go_on(pose);
  }

  /// The next pose in order.
  void go_on(const GpsInsPose& pose) {
    if (!known_.empty() && pose.stamp_ns <= known_.back().stamp_ns) return;
    const Eigen::Matrix3d R_world_base = pose.T_world_base.linear();
    const double yaw_rad = pose2_of(pose.T_world_base).yaw_rad;
    if (known_.empty()) {
      odom_yaw_rad_ = yaw_rad;
      p_odom_m_ = pose.T_world_base.translation();
      v_odom_m_s_ = pose.velocity_world_m_s;
    }
    const double step_s = known_.empty() ? 0.0 : seconds_between(known_.back().stamp_ns, pose.stamp_ns);
    odom_yaw_rad_ += step_s * yaw_rate(pose);
    const Eigen::Matrix3d R_odom_world =
        Eigen::AngleAxisd(odom_yaw_rad_ - yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    const Eigen::Matrix3d R_odom_base = R_odom_world * R_world_base;
    const Eigen::Vector3d a_odom_m_s2 =
        R_odom_base * pose.specific_force_base_m_s2 - kStandardGravity_m_s2 * Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d change_m_s = 0.5 * step_s * (a_odom_m_s2_ + a_odom_m_s2);
    p_odom_m_ += step_s * (v_odom_m_s_ + 0.5 * change_m_s);
    v_odom_m_s_ += change_m_s;
    a_odom_m_s2_ = a_odom_m_s2;
    p_odom_m_.z() = pose.T_world_base.translation().z();
    Eigen::Isometry3d T_odom_base = Eigen::Isometry3d::Identity();
    T_odom_base.translation() = p_odom_m_;
    T_odom_base.linear() = R_odom_base;
    player_.add_transform(transform_to_msg(T_odom_base, pose.stamp_ns, kOdomFrame, options_.base_frame));
    const double yaw_variance =
        R_world_base.row(2) * pose.covariance.bottomRightCorner<3, 3>() * R_world_base.row(2).transpose();
    const double velocity_variance = pose.velocity_covariance.topLeftCorner<2, 2>().diagonal().maxCoeff() +
                                     pose.velocity_world_m_s.head<2>().squaredNorm() * yaw_variance;
    known_.push_back({pose.stamp_ns, pose.T_world_base * T_odom_base.inverse(), pose.covariance, v_odom_m_s_,
                      R_odom_base * pose.angular_velocity_base_rad_s, pose.velocity_world_m_s,
                      std::sqrt(velocity_variance)});
  }

  /// About the vertical, of Rz(yaw) Ry(pitch) Rx(roll).
  static double yaw_rate(const GpsInsPose& pose) {
    const Eigen::Matrix3d R = pose.T_world_base.linear();
    const double roll_rad = std::atan2(R(2, 1), R(2, 2));
    const double cos_pitch = std::hypot(R(2, 1), R(2, 2));
    return (std::sin(roll_rad) * pose.angular_velocity_base_rad_s.y() +
            std::cos(roll_rad) * pose.angular_velocity_base_rad_s.z()) /
           std::max(cos_pitch, 0.1);
  }

  void add(const sensor_msgs::NavSatFix& msg) {
    if (input_) input_->add_fix(msg);
  }

  BagPlayer& player_;
  const Options& options_;
  GpsInsNodeletParams params_;
  std::string fix_frame_;
  std::unique_ptr<GpsInsInput> input_;
  Counters refused_;
  std::int64_t ready_since_ns_ = StampOrder::kNone;
  std::deque<Known> known_;
  double odom_yaw_rad_ = 0.0;
  Eigen::Vector3d p_odom_m_ = Eigen::Vector3d::Zero(), v_odom_m_s_ = p_odom_m_, a_odom_m_s2_ = p_odom_m_;
};

/// Where GPS and INS know the pose worse than the map does, in an outage of the fixes, it is that by the map: x, y and
/// yaw. Height, roll and pitch stay.
void place_by_map(const MapAlignment& alignment, const Eigen::Isometry3d& T_world_odom,
                  const Eigen::Isometry3d& T_odom_base, Eigen::Isometry3d& T_world_base, Matrix6& covariance) {
  if (!alignment.has_begun()) return;
  const Eigen::Matrix3d by_map = alignment.covariance_world(), before = planar_covariance(T_world_base, covariance);
  if (before.topLeftCorner<2, 2>().trace() < kWorseThanMap * by_map.topLeftCorner<2, 2>().trace()) return;
  const Pose2 T_map = alignment.T_world_odom();
  Eigen::Isometry3d T_new_odom = Eigen::Isometry3d::Identity();
  T_new_odom.translation() << T_map.translation_m, T_world_odom.translation().z();
  T_new_odom.linear() = Eigen::AngleAxisd(T_map.yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  T_world_base = T_new_odom * T_odom_base;
  // The error of the yaw is one about the vertical, along the third row of R in the base.
  const Eigen::Vector3d up_base = T_world_base.linear().row(2).transpose();
  Eigen::Matrix<double, 6, 3> J = Eigen::Matrix<double, 6, 3>::Zero();
  J(0, 0) = J(1, 1) = 1.0;
  J.block<3, 1>(3, 2) = up_base;
  const Eigen::Matrix3d level = Eigen::Matrix3d::Identity() - up_base * up_base.transpose();
  Matrix6 kept = Matrix6::Zero();
  kept(2, 2) = covariance(2, 2);
  kept.bottomRightCorner<3, 3>() = level * covariance.bottomRightCorner<3, 3>() * level;
  covariance = kept + J * by_map * J.transpose();
}

void map_by_gps(const Options& options, const BagParams& params) {
  BagOptions bag = options.bag;
  bag.world_frame = BagNavigation::kOdomFrame;
  bag.tf_timeout_s = std::max(bag.tf_timeout_s, BagNavigation::kBacklog_s);
  BagPlayer player(bag, kResetTimeJump_s);
  LineFile out(options.out);
  SplinegonPipeline pipeline(params.pipeline);
  BagNavigation navigation(player, options, params.gps_ins);
  const std::string base_frame = tf2_frame(options.base_frame);
  subscribe_scans(
      player, options.scan_topic,
      [&](const Scan& scan, const auto& T_odom_lidar, const auto& T_odom_lidar_end) {
        const Eigen::Isometry3d T_odom_base =
            transform_at(player.transforms(), BagNavigation::kOdomFrame, base_frame, to_ros_time(scan.stamp_ns));
        const BagNavigation::Known& known = navigation.known_at(scan.stamp_ns);
        const Eigen::Isometry3d T_world_base = known.T_world_odom * T_odom_base;
        InertialPlacement placement;
        placement.T_world_odom = pose2_of(known.T_world_odom);
        placement.pose_covariance = planar_covariance(T_world_base, known.covariance);
        const Eigen::Vector3d of_arm_m_s =
            known.angular_velocity_odom_rad_s.cross(T_odom_lidar.translation() - T_odom_base.translation());
        placement.v_odom_m_s = (known.v_odom_m_s + of_arm_m_s).head<2>();
        placement.v_world_m_s = (known.v_world_m_s + known.T_world_odom.linear() * of_arm_m_s).head<2>();
        placement.velocity_sigma_m_s = known.velocity_sigma_m_s;
        player.timed([&] { pipeline.process(scan, T_odom_lidar, T_odom_lidar_end, placement); });
        if (!navigation.was_ready_at(scan.stamp_ns)) return;
        Eigen::Isometry3d T_world_base_out = T_world_base;
        Matrix6 covariance = known.covariance;
        place_by_map(pipeline.alignment(), known.T_world_odom, T_odom_base, T_world_base_out, covariance);
        out.write(json_line(scan.stamp_ns, json_of(T_world_base_out, covariance, pipeline.splinegons())));
      },
      options.lidar_frame);
  player.play();
  out.finish();
  player.print_summary();
  navigation.print_summary();
}

int splinegons_bag(const Options& options) {
  const std::string path = config_path(options.bag, kConfig);
  const auto params = params_from_yaml<BagParams>(read_text_file(path), path, print_warning);
  if (options.localization == "tf") {
    map_by_tf(options, params);
  } else {
    map_by_gps(options, params);
  }
  return 0;
}

}  // namespace
}  // namespace situation_awareness

int main(int argc, char** argv) {
  using namespace situation_awareness;
  Options options;
  CommandLine app(kName, kDescription);
  add_options(app, options);
  return run_program(app, argc, argv, [&options] { return splinegons_bag(options); });
}

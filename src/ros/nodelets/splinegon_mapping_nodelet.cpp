// SPDX-License-Identifier: BSD-3-Clause
// scan, imu, fix, TF base -> lidar (or scan, TF world -> lidar)  ->  splinegons, polygons, splinegon_markers,
// local_polygon_markers
#include <algorithm>
#include <cstddef>
#include <exception>
#include <optional>
#include <string>

#include <ros/publisher.h>
#include <visualization_msgs/MarkerArray.h>
#include <boost/make_shared.hpp>
#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/pipeline/timed_splinegon_map.hpp"
#include "situation_awareness/points/horizontal_projection.hpp"
#include "situation_awareness/points/point_states.hpp"
#include "situation_awareness/ros/convert/polygons.hpp"
#include "situation_awareness/ros/convert/scan.hpp"
#include "situation_awareness/ros/inertial_input.hpp"
#include "situation_awareness/ros/map_publisher.hpp"
#include "situation_awareness/ros/map_services.hpp"
#include "situation_awareness/ros/markers/splinegon_markers.hpp"
#include "situation_awareness/ros/params/splinegon_nodelet_params.hpp"
#include "situation_awareness/ros/point_report.hpp"
#include "situation_awareness/ros/posed_input.hpp"
#include "situation_awareness/ros/scan_check.hpp"
#include "situation_awareness/ros/splinegon_kind.hpp"
#include "situation_awareness/ros/stage_nodelet.hpp"

namespace situation_awareness {

class SplinegonMappingStage {
 public:
  using Context = InertialInput::Context;
  static constexpr const char* kInput = "scan";
  static constexpr auto kReadParams = read_splinegon_nodelet_params;

  SplinegonMappingStage(Context& context, const SplinegonNodeletParams& params)
      : context_(context),
        params_(params),
        map_(params.pipeline, params.reset_time_jump_s),
        publisher_(context, params.nodelet),
        polygons_publisher_(context.node().advertise<PolygonArray>("polygons", 5)),
        local_publisher_(context.node().advertise<visualization_msgs::MarkerArray>("local_polygon_markers", 5)),
        services_(context, params.nodelet.world_frame, map_,
                  [this](const Splinegons& splinegons) { publisher_.publish(splinegons); }) {
    map_.trust_stamps();  // the input has judged them
    const double variance_m2 = params.pose_sigma_m * params.pose_sigma_m;
    pose_covariance_ =
        Eigen::Vector3d(variance_m2, variance_m2, params.pose_sigma_rad * params.pose_sigma_rad).asDiagonal();
    if (params.localization == "gps") {
      by_gps_.emplace(context, gps_ins_params_of(params.nodelet, params.inertial), params.reset_time_jump_s);
    } else {
      by_tf_.emplace(
          context, params.nodelet, params.reset_time_jump_s, 0.0,
          PosedInput<sensor_msgs::LaserScan, InertialScan>::Use{
              scan_msg_defect, [this](const sensor_msgs::LaserScan& msg) { return taken(msg, params_.nodelet.deskew); },
              [] {}});
    }
    context.diagnostics().on_report([this](StageDiagnostics::Status& status) { report(status); });
  }

  bool process(const InertialScan& posed) {
    if (services_.passes_over()) return false;
    Scan scan = scan_from_msg(*posed.msg);
    if (!params_.nodelet.deskew) scan.time_increment_s = 0.0;
    const std::string defect = projection_defect(scan, posed.T_odom_lidar, posed.T_odom_lidar_end);
    if (!defect.empty()) return context_.drop(defect);
    const StampOrder::Verdict verdict =
        by_tf_ ? map_.process(scan, posed.T_odom_lidar, posed.T_odom_lidar_end, pose_covariance_)
               : map_.process(scan, posed.T_odom_lidar, posed.T_odom_lidar_end, posed.placement);
    if (verdict == StampOrder::Verdict::kRefused) return context_.drop(drop_reason::kStamp);
    if (verdict == StampOrder::Verdict::kRestart) {
      context_.diagnostics().counted({{"time jumped back: new map", 1}});
    }
    context_.diagnostics().counted(map_.pipeline().polylines().refused);
    states_.add(map_.pipeline().points());
    publisher_.publish(map_.splinegons());
    if (polygons_publisher_.getNumSubscribers() > 0) {
      context_.publish(polygons_publisher_, polygons_to_msg(map_.polygons_in_world(), params_.nodelet.world_frame));
    }
    if (local_publisher_.getNumSubscribers() > 0) {
      local_publisher_.publish(boost::make_shared<const visualization_msgs::MarkerArray>(local_markers_.update(
          map_.pipeline().polylines(), map_.pipeline().T_world_map(), params_.nodelet.world_frame)));
    }
    return true;
  }

 private:
  void report(StageDiagnostics::Status& status) {
    warn_of_no_hit(states_, status);
    const std::vector<Splinegon>& boundaries = map_.splinegons().boundaries;
    status.add("boundaries", boundaries.size());
    status.add("closed", std::count_if(boundaries.begin(), boundaries.end(),
                                       [](const Splinegon& splinegon) { return splinegon.closed; }));
    std::size_t vertices = 0;
    double worst_m = 0.0;
    for (const Splinegon& splinegon : boundaries) {
      vertices += splinegon.vertices.size();
      for (const SplinegonVertex& vertex : splinegon.vertices) worst_m = std::max(worst_m, vertex.sigma_m);
    }
    status.add("vertices", vertices);
    status.add("polygons where arcs do not follow", map_.pipeline().map().polygons());
    status.add("kept, as what is new crosses itself", map_.pipeline().map().kept());
    status.add("largest sigma [m]", worst_m);
    status.add("chains", map_.pipeline().polygons().chains.size());
  }

  Context& context_;
  SplinegonNodeletParams params_;
  Eigen::Matrix3d pose_covariance_;  ///< of poses by TF
  TimedSplinegonMap map_;
  PointStates states_;
  MapPublisher<SplinegonKind> publisher_;
  ros::Publisher polygons_publisher_, local_publisher_;
  LocalPolygonMarkers local_markers_;
  MapServices<SplinegonKind> services_;
  std::optional<InertialInput> by_gps_;
  std::optional<PosedInput<sensor_msgs::LaserScan, InertialScan>> by_tf_;
};

using SplinegonMappingNodelet = StageNodelet<SplinegonMappingStage>;

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::SplinegonMappingNodelet, nodelet::Nodelet)

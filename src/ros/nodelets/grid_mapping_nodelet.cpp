// SPDX-License-Identifier: BSD-3-Clause
// labels, camera_info, odometry (for its covariance), TF world -> camera  ->  targets, grid, grid_cells
#include <cstdint>
#include <optional>
#include <string>

#include <nav_msgs/OccupancyGrid.h>
#include <nav_msgs/Odometry.h>
#include <ros/publisher.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_srvs/Trigger.h>
#include <pluginlib/class_list_macros.hpp>

#include "situation_awareness/SaveGrid.h"
#include "situation_awareness/common/stamp_order.hpp"
#include "situation_awareness/common/time.hpp"
#include "situation_awareness/map/grid/geotiff.hpp"
#include "situation_awareness/pipeline/grid_pipeline.hpp"
#include "situation_awareness/ros/camera_report.hpp"
#include "situation_awareness/ros/convert/camera.hpp"
#include "situation_awareness/ros/convert/grid.hpp"
#include "situation_awareness/ros/convert/labels.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"
#include "situation_awareness/ros/image_subscriber.hpp"
#include "situation_awareness/ros/odometry_covariances.hpp"
#include "situation_awareness/ros/params/grid_nodelet_params.hpp"
#include "situation_awareness/ros/posed_input.hpp"
#include "situation_awareness/ros/receipt.hpp"
#include "situation_awareness/ros/services.hpp"
#include "situation_awareness/ros/stage_nodelet.hpp"
#include "situation_awareness/ros/timed_subscriber.hpp"

namespace situation_awareness {

class GridMappingStage {
 public:
  using Input = PosedInput<sensor_msgs::Image, PosedMessage<sensor_msgs::Image>, ImageSubscriber>;
  using Context = Input::Context;
  static constexpr const char* kInput = "labels";
  static constexpr auto kReadParams = read_grid_nodelet_params;

  GridMappingStage(Context& context, const GridNodeletParams& params)
      : context_(context),
        params_(params),
        camera_(params.image_kind, context.node().resolveName(kInput)),
        targets_publisher_(context.node().advertise<TargetArray>("targets", 20)),
        grid_publisher_(context.node().advertise<nav_msgs::OccupancyGrid>("grid", 1, true)),
        cells_publisher_(context.node().advertise<sensor_msgs::PointCloud2>("grid_cells", 1, true)),
        services_(context),
        input_(context, params.nodelet, 0.0,
               {labels_msg_defect,
                [](const sensor_msgs::Image& msg) {
                  return Taken{tf2_frame(msg.header.frame_id), msg.header.stamp, msg.header.stamp};
                },
                [] {}}) {
    pipeline_.emplace(params_.pipeline, ElevationFile(elevation_source(params_.elevation, "origin")));
    pipeline_->trust_stamps();  // the input has judged them
    context.diagnostics().on_report([this](StageDiagnostics::Status& status) { report(status); });
    context.when_made([this] {
      info_.emplace(context_.node(), "camera_info",
                    [this](const auto& msg, const ros::SteadyTime& /*arrival*/) { camera_info_ = msg; });
      odometry_.emplace(context_.node(), "odometry", [this](const auto& msg, const ros::SteadyTime& /*arrival*/) {
        covariances_.add(*msg, receipt_ns());
      });
      services_.add<std_srvs::Trigger>(context_.private_node(), "reset",
                                       [this](const auto& /*request*/, auto& response) {
                                         begin();
                                         response.message = "the grid and its targets were forgotten";
                                       });
      services_.add<SaveGrid>(context_.private_node(), "save_grid", [this](const auto& request, auto& response) {
        check_absolute(request.file);
        save_geotiff(request.file, pipeline_->map().grid());
        response.message = "saved in " + request.file;
      });
    });
  }

  bool process(const PosedMessage<sensor_msgs::Image>& posed) {
    if (!camera_info_) return context_.drop("no camera_info");
    const CameraModel& model = camera_.take(*camera_info_, *posed.msg);
    if (!model.defect.empty()) return context_.drop(model.defect);
    SoftLabels labels = labels_from_msg(*posed.msg, model.camera);
    const std::string defect = camera_.undistort(labels);
    if (!defect.empty()) return context_.drop(defect);
    const std::size_t out_of_range = drop_out_of_range(labels);
    if (out_of_range > 0) context_.diagnostics().counted({{"labels out of [0, 1]", out_of_range}});
    const GridTargets& targets = pipeline_->process(labels, posed.T_world_sensor, covariances_.at(labels.stamp_ns));
    if (!pipeline_->is_pose_known()) return context_.drop("pose not known well enough");
    if (pipeline_->verdict() == StampOrder::Verdict::kRefused) return context_.drop(drop_reason::kStamp);
    if (pipeline_->verdict() == StampOrder::Verdict::kRestart) {
      context_.diagnostics().counted({{"time jumped back: new map", 1}});
      grid_ns_.reset();
    }
    context_.publish(targets_publisher_, grid_targets_to_msg(targets, params_.nodelet.world_frame));
    if (!grid_ns_ || seconds_between(*grid_ns_, labels.stamp_ns) >= params_.grid_period_s) publish_grid();
    const std::string nothing = pipeline_->why_latest_tells_nothing();
    if (!nothing.empty()) return context_.drop(nothing);
    return true;
  }

 private:
  void begin() {
    pipeline_->begin_anew();
    covariances_.clear();
    grid_ns_.reset();
  }

  void publish_grid() {
    if (grid_publisher_.getNumSubscribers() + cells_publisher_.getNumSubscribers() == 0) return;
    const SemanticGrid grid = pipeline_->map().grid();
    grid_ns_ = grid.stamp_ns;
    context_.publish(grid_publisher_, grid_to_msg(grid, params_.nodelet.world_frame));
    context_.publish(cells_publisher_, grid_to_cloud(grid, params_.nodelet.world_frame));
  }

  void report(StageDiagnostics::Status& status) {
    const std::string why_nothing = pipeline_->why_nothing();
    if (!why_nothing.empty()) status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, why_nothing);
    for (const std::string& warning : pipeline_->elevation_warnings()) {
      status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, warning);
    }
    status.add("targets", pipeline_->targets().targets.size());
    status.add("ground above the elevation [m]", pipeline_->map().elevation_offset_m());
    status.add("camera_info", camera_info_ ? "received" : "none yet");
    situation_awareness::report(camera_.model(), status);
    status.add("odometry without covariance", covariances_.unknown());
    status.add("odometry not in order", covariances_.refused());
  }

  Context& context_;
  GridNodeletParams params_;
  ImageCamera camera_;
  std::optional<GridPipeline> pipeline_;
  OdometryCovariances covariances_;
  sensor_msgs::CameraInfoConstPtr camera_info_;  ///< the latest
  std::optional<std::int64_t> grid_ns_;          ///< of the latest grid that was published
  ros::Publisher targets_publisher_, grid_publisher_, cells_publisher_;
  Services services_;
  std::optional<TimedSubscriber<sensor_msgs::CameraInfo>> info_;
  std::optional<TimedSubscriber<nav_msgs::Odometry>> odometry_;
  Input input_;
};

using GridMappingNodelet = StageNodelet<GridMappingStage>;

}  // namespace situation_awareness

PLUGINLIB_EXPORT_CLASS(situation_awareness::GridMappingNodelet, nodelet::Nodelet)

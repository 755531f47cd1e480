// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "situation_awareness/ros/convert/camera.hpp"
#include "situation_awareness/ros/convert/compressed_image.hpp"
#include "situation_awareness/ros/convert/grid.hpp"
#include "situation_awareness/ros/convert/labels.hpp"
#include "situation_awareness/ros/odometry_covariances.hpp"

namespace situation_awareness::grid_messages_test {
namespace {

constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

TEST(GridMessages, GridsComeBack) {
  SemanticGrid grid;
  grid.stamp_ns = 1'500'000'000;
  grid.cell_m = 0.5;
  grid.first_column = -7;
  grid.first_row = 12;
  grid.width = 3;
  grid.height = 2;
  grid.probability = {0.0F, 0.25F, kUnknown, 1.0F, 0.5F, 0.777F};
  const SemanticGrid read = grid_from_msg(grid_to_msg(grid, "world"));
  EXPECT_EQ(read.stamp_ns, grid.stamp_ns);
  EXPECT_EQ(read.cell_m, grid.cell_m);
  EXPECT_EQ(read.first_column, grid.first_column);
  EXPECT_EQ(read.first_row, grid.first_row);
  ASSERT_EQ(read.probability.size(), grid.probability.size());
  for (std::size_t i = 0; i < read.probability.size(); ++i) {
    EXPECT_EQ(std::isnan(read.probability[i]), std::isnan(grid.probability[i]));
    if (!std::isnan(grid.probability[i])) {
      EXPECT_NEAR(read.probability[i], grid.probability[i], 0.00501F);
    }
  }
  std::vector<GridCluster> clusters;
  find_clusters(read, clusters);  // of the cells above a half
  ASSERT_EQ(clusters.size(), 2U);
  EXPECT_LT((clusters[0].p_world_m - grid.middle_world_m(0, 1)).norm(), 1e-9);
}

TEST(GridMessages, TargetsComeBackExactly) {
  GridTargets targets;
  targets.stamp_ns = 7;
  GridTarget target;
  target.id = 3;
  target.p_world_m = {1.1, -2.2, 3.3};
  target.covariance_m2 << 0.4, 0.1, 0.1, 0.2;
  target.area_m2 = 8.25;
  target.probability = 0.9;
  targets.targets = {target};
  const GridTargets read = grid_targets_from_msg(grid_targets_to_msg(targets, "world"));
  ASSERT_EQ(read.targets.size(), 1U);
  EXPECT_EQ(read.stamp_ns, 7);
  EXPECT_EQ(read.targets[0].id, target.id);
  EXPECT_EQ(read.targets[0].p_world_m, target.p_world_m);
  EXPECT_EQ(read.targets[0].covariance_m2, target.covariance_m2);
  EXPECT_EQ(read.targets[0].area_m2, target.area_m2);
  EXPECT_EQ(read.targets[0].probability, target.probability);
}

sensor_msgs::CameraInfo info_of(int width, int height) {
  return camera_to_msg({width, height, 11.0, 12.0, 0.5 * (width - 1), 0.5 * (height - 1)}, 5, "camera");
}

/// 2 x 2 pixels whose red, green and blue are 10, 20, 30; 11, 21, 31; ..., with rows that are longer than their pixels.
sensor_msgs::Image image_of(const std::string& encoding, const std::vector<int>& channels) {
  sensor_msgs::Image msg;
  msg.width = msg.height = 2;
  msg.encoding = encoding;
  msg.step = static_cast<std::uint32_t>(2 * channels.size() + 3);
  msg.data.assign(2 * msg.step, 0xEE);
  for (std::size_t pixel = 0; pixel < 4; ++pixel) {
    for (std::size_t i = 0; i < channels.size(); ++i) {
      msg.data[pixel / 2 * msg.step + pixel % 2 * channels.size() + i] =
          static_cast<std::uint8_t>(10 * (channels[i] + 1) + static_cast<int>(pixel));
    }
  }
  return msg;
}

TEST(ImageMessages, AllEncodingsAreTheSameImage) {
  const std::vector<std::uint8_t> rgb = {10, 20, 30, 11, 21, 31, 12, 22, 32, 13, 23, 33};
  for (const auto& [encoding, channels] : std::vector<std::pair<std::string, std::vector<int>>>{
           {"rgb8", {0, 1, 2}}, {"bgr8", {2, 1, 0}}, {"rgba8", {0, 1, 2, 3}}, {"bgra8", {2, 1, 0, 3}}}) {
    const sensor_msgs::Image msg = image_of(encoding, channels);
    EXPECT_EQ(image_msg_defect(msg), "") << encoding;
    EXPECT_EQ(image_from_msg(msg, info_of(2, 2)).rgb, rgb) << encoding;
  }
  const ColorImage grey = image_from_msg(image_of("mono8", {0}), info_of(2, 2));
  EXPECT_EQ(grey.rgb, (std::vector<std::uint8_t>{10, 10, 10, 11, 11, 11, 12, 12, 12, 13, 13, 13}));
  EXPECT_EQ(grey.camera.fx_px, 11.0);
  EXPECT_EQ(grey.camera.fy_px, 12.0);
}

TEST(ImageMessages, NumbersOfTwoBytesAreTheSameImage) {
  const std::vector<std::uint8_t> rgb = {10, 20, 30, 11, 21, 31, 12, 22, 32, 13, 23, 33};
  for (const auto& [encoding, channels] : std::vector<std::pair<std::string, std::vector<int>>>{
           {"rgb16", {0, 1, 2}}, {"bgr16", {2, 1, 0}}, {"rgba16", {0, 1, 2, 3}}, {"mono16", {0}}}) {
    for (const bool is_bigendian : {false, true}) {
      sensor_msgs::Image msg = image_of(encoding, channels);
      std::vector<std::uint8_t> data;
      for (const std::uint8_t byte : msg.data) {  // v * 257, less a little
        data.push_back(is_bigendian ? byte : static_cast<std::uint8_t>(byte - 9));
        data.push_back(is_bigendian ? static_cast<std::uint8_t>(byte - 9) : byte);
      }
      msg.data = data;
      msg.step *= 2;
      msg.is_bigendian = is_bigendian ? 1 : 0;
      EXPECT_EQ(image_msg_defect(msg), "") << encoding;
      const std::vector<std::uint8_t> read = image_from_msg(msg, info_of(2, 2)).rgb;
      if (encoding == "mono16") {
        EXPECT_EQ(read, (std::vector<std::uint8_t>{10, 10, 10, 11, 11, 11, 12, 12, 12, 13, 13, 13}));
      } else {
        EXPECT_EQ(read, rgb) << encoding << ' ' << is_bigendian;
      }
      msg.data.pop_back();
      EXPECT_EQ(image_msg_defect(msg), "image with too little data");
    }
  }
}

TEST(ImageMessages, CodedColorsAreRead) {
  for (const auto& [encoding, bytes] : std::vector<std::pair<std::string, std::uint32_t>>{
           {"bayer_rggb8", 1}, {"bayer_grbg16", 2}, {"yuv422", 2}, {"yuv422_yuy2", 2}, {"8UC1", 1}, {"8UC3", 3}}) {
    sensor_msgs::Image msg;
    msg.width = 6;
    msg.height = 4;
    msg.encoding = encoding;
    msg.step = bytes * msg.width;
    msg.data.assign(std::size_t{msg.step} * msg.height, 128);  // grey, as yuv 130
    EXPECT_EQ(image_msg_defect(msg), "") << encoding;
    for (const std::uint8_t number : image_from_msg(msg, info_of(6, 4)).rgb) EXPECT_NEAR(number, 129, 2) << encoding;
    msg.width = 5;
    const bool is_coded = encoding[0] == 'b' || encoding[0] == 'y';
    EXPECT_EQ(image_msg_defect(msg), is_coded ? "image of a size that its encoding does not have" : "") << encoding;
  }
}

TEST(CompressedImages, AreImagesOrSayThatTheyCannotBeRead) {
  cv::Mat grey(4, 6, CV_8UC1, cv::Scalar(77)), deep(4, 6, CV_16UC1, cv::Scalar(77 * 257));
  cv::Mat color(4, 6, CV_8UC3, cv::Scalar(30, 20, 10)), labels(4, 6, CV_32FC1, cv::Scalar(0.25));
  const auto read = [](const cv::Mat& mat, const char* file, const std::string& format) {
    sensor_msgs::CompressedImage msg;
    msg.header.frame_id = "camera";
    msg.format = format;
    EXPECT_TRUE(cv::imencode(file, mat, msg.data));
    return *decompressed(msg);
  };
  const sensor_msgs::CameraInfo info = info_of(6, 4);
  const sensor_msgs::Image png = read(color, ".png", "rgb8; png compressed bgr8");
  EXPECT_EQ(png.header.frame_id, "camera");
  EXPECT_EQ(camera_info_msg_defect(info, png), "");
  const std::vector<std::uint8_t> rgb = image_from_msg(png, info).rgb;
  EXPECT_EQ(std::vector<std::uint8_t>(rgb.begin(), rgb.begin() + 3), (std::vector<std::uint8_t>{10, 20, 30}));
  EXPECT_NEAR(image_from_msg(read(color, ".jpg", "jpeg"), info).rgb[0], 10, 3);
  EXPECT_EQ(image_from_msg(read(grey, ".png", "mono8; png compressed "), info).rgb[5], 77);
  EXPECT_EQ(image_from_msg(read(deep, ".png", "png"), info).rgb[5], 77);
  EXPECT_EQ(read(grey, ".jpg", "bayer_grbg8; jpeg compressed ").encoding, "bayer_grbg8");
  EXPECT_EQ(labels_from_msg(read(labels, ".tiff", "32FC1; tiff compressed "), info).probability[7], 0.25F);
  EXPECT_EQ(labels_msg_defect(png), "labels are not 32FC1");
  sensor_msgs::CompressedImage bad;
  bad.data.assign(50, 3);
  EXPECT_EQ(image_msg_defect(*decompressed(bad)), "compressed image that cannot be read");
  EXPECT_EQ(labels_msg_defect(*decompressed(bad)), "compressed image that cannot be read");
}

/// A calibrated camera: P is another than K.
sensor_msgs::CameraInfo calibrated_info() {
  sensor_msgs::CameraInfo info = info_of(100, 80);
  info.D = {-0.25, 0.06, 0.0, 0.0, 0.0};
  info.P[0] = 9.0;
  info.P[5] = 9.5;
  info.P[2] = 48.0;
  info.P[6] = 41.0;
  return info;
}

sensor_msgs::Image sized(std::uint32_t width, std::uint32_t height) {
  sensor_msgs::Image image;
  image.width = width;
  image.height = height;
  return image;
}

TEST(CameraModels, AreOfTheMatrixOfTheKindOfImage) {
  const sensor_msgs::CameraInfo info = calibrated_info();
  const sensor_msgs::Image image = sized(100, 80);
  const CameraModel rectified = camera_model(info, image, ImageKind::kRectified);
  EXPECT_EQ(rectified.defect, "");
  EXPECT_EQ(rectified.camera.fx_px, 9.0);
  EXPECT_EQ(rectified.camera.cy_px, 41.0);
  EXPECT_FALSE(rectified.distortion);
  EXPECT_EQ(rectified.assumed, "");
  const CameraModel raw = camera_model(info, image, ImageKind::kRaw);
  EXPECT_EQ(raw.camera.fx_px, 11.0);
  ASSERT_TRUE(raw.distortion);
  EXPECT_EQ(raw.distortion->coefficients, (std::vector<double>{-0.25, 0.06, 0.0, 0.0}));
  // What nothing tells is rectified, as it is asked for, and is told.
  const CameraModel either = camera_model(info, image, ImageKind::kAuto);
  EXPECT_EQ(either.camera.fx_px, 9.0);
  EXPECT_NE(either.assumed, "");
}

TEST(CameraModels, RefuseDistortionWhereNothingTellsWhetherTheImageHasIt) {
  sensor_msgs::CameraInfo info = info_of(100, 80);
  const sensor_msgs::Image image = sized(100, 80);
  info.D = {-0.25, 0.06, 0.0, 0.0, 0.0};  // and P is K
  EXPECT_NE(camera_info_msg_defect(info, image), "");
  EXPECT_EQ(camera_info_msg_defect(info, image, ImageKind::kRaw), "");
  EXPECT_EQ(camera_info_msg_defect(info, image, ImageKind::kRectified), "");
  info.P.fill(0.0);
  EXPECT_NE(camera_info_msg_defect(info, image), "");
  EXPECT_NE(camera_info_msg_defect(info, image, ImageKind::kRectified), "");
  info.D.clear();
  EXPECT_EQ(camera_model(info, image, ImageKind::kAuto).camera.fx_px, 11.0);
  EXPECT_EQ(camera_model(info, image, ImageKind::kRectified).camera.fx_px, 11.0);
}

TEST(CameraModels, KnowTheModelsOfDistortion) {
  const auto model_of = [](const std::string& name, const std::vector<double>& D) {
    sensor_msgs::CameraInfo info = info_of(100, 80);
    info.distortion_model = name;
    info.D = D;
    return camera_model(info, sized(100, 80), ImageKind::kRaw);
  };
  EXPECT_EQ(model_of("plumb_bob", {0.1, 0.0, 0.0, 0.0, 0.2}).distortion->coefficients.size(), 5U);
  EXPECT_EQ(model_of("", {0.1, 0.01}).distortion->coefficients.size(), 4U);
  EXPECT_EQ(model_of("rational_polynomial", {0.1, 0, 0, 0, 0, 0, 0, 0.2}).distortion->coefficients.size(), 8U);
  const CameraModel fisheye = model_of("equidistant", {0.1, 0.0, 0.0, 0.0});
  EXPECT_EQ(fisheye.distortion->model, LensDistortion::Model::kEquidistant);
  EXPECT_EQ(fisheye.distortion->coefficients, (std::vector<double>{0.1, 0.0, 0.0, 0.0}));
  EXPECT_TRUE(model_of("equidistant", {0.0, 0.0, 0.0, 0.0}).distortion);  // no pinhole camera either
  EXPECT_NE(model_of("equidistant", {0.1, 0.0, 0.0, 0.0, 0.5}).defect, "");
  EXPECT_NE(model_of("inverse_brown_conrady", {0.1}).defect, "");
  EXPECT_NE(model_of("plumb_bob", {std::numeric_limits<double>::quiet_NaN()}).defect, "");
  EXPECT_EQ(model_of("inverse_brown_conrady", {0.0, 0.0}).defect, "");  // none
}

TEST(CameraModels, OfRawImagesAreTurnedAsRectifiedOnesAre) {
  sensor_msgs::CameraInfo info = info_of(100, 80);
  info.R = {0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0};
  const CameraModel raw = camera_model(info, sized(100, 80), ImageKind::kRaw);
  ASSERT_TRUE(raw.distortion);
  EXPECT_EQ(raw.distortion->R_rectified_camera(0, 1), -1.0);
  EXPECT_FALSE(camera_model(info, sized(100, 80), ImageKind::kAuto).distortion);  // without distortion it is as it is
  info.R.fill(0.0);                                                               // none is given
  EXPECT_FALSE(camera_model(info, sized(100, 80), ImageKind::kRaw).distortion);
}

TEST(CameraModels, FollowTheRegionOfInterestAndBinning) {
  sensor_msgs::CameraInfo info = info_of(100, 80);
  info.binning_x = info.binning_y = 2;
  CameraModel model = camera_model(info, sized(50, 40), ImageKind::kAuto);
  EXPECT_EQ(model.defect, "");
  EXPECT_EQ(model.camera.width, 50);
  EXPECT_EQ(model.camera.fx_px, 5.5);
  EXPECT_EQ(model.camera.cx_px, 24.5);  // in the middle as before
  info.roi.x_offset = 20;
  info.roi.y_offset = 10;
  info.roi.width = 60;
  info.roi.height = 50;
  model = camera_model(info, sized(30, 25), ImageKind::kAuto);
  EXPECT_EQ(model.camera.cx_px, (49.5 - 20.0 + 0.5) / 2.0 - 0.5);
  EXPECT_EQ(model.camera.cy_px, (39.5 - 10.0 + 0.5) / 2.0 - 0.5);
  EXPECT_EQ(camera_info_msg_defect(info, sized(31, 25)), "camera_info of another size");
  info.binning_x = info.binning_y = 0;
  model = camera_model(info, sized(60, 50), ImageKind::kAuto);
  EXPECT_EQ(model.camera.fx_px, 11.0);
  EXPECT_EQ(model.camera.cx_px, 29.5);
  EXPECT_EQ(camera_model(info, sized(100, 80), ImageKind::kAuto).camera.cx_px, 49.5);  // all of it all the same
}

TEST(ImageKinds, AreToldByTheNamesOfImageProc) {
  EXPECT_EQ(image_kind("auto", "/camera/image_rect"), ImageKind::kRectified);
  EXPECT_EQ(image_kind("auto", "camera/image_rect_color/compressed"), ImageKind::kRectified);
  EXPECT_EQ(image_kind("auto", "/camera/image_raw"), ImageKind::kRaw);
  EXPECT_EQ(image_kind("auto", "/image_color/compressed"), ImageKind::kRaw);
  EXPECT_EQ(image_kind("auto", "/camera/labels"), ImageKind::kAuto);
  EXPECT_EQ(image_kind("raw", "/camera/image_rect"), ImageKind::kRaw);
  EXPECT_THROW(image_kind("fish", "/camera/image_rect"), std::invalid_argument);
}

TEST(ImageMessages, DefectsAreNamed) {
  sensor_msgs::Image msg = image_of("rgb8", {0, 1, 2});
  msg.encoding = "16UC1";
  EXPECT_EQ(image_msg_defect(msg), "image is not of rgb, bgr, mono, bayer or yuv422");
  EXPECT_EQ(labels_msg_defect(msg), "labels are not 32FC1");
  msg = image_of("rgb8", {0, 1, 2});
  msg.data.pop_back();
  EXPECT_EQ(image_msg_defect(msg), "image with too little data");
  msg.width = 0;
  EXPECT_EQ(image_msg_defect(msg), "image without pixels");
  msg.width = 9000;
  EXPECT_EQ(image_msg_defect(msg), "image of more than 8192 pixels across");
  sensor_msgs::CameraInfo info = info_of(2, 2);
  EXPECT_EQ(camera_info_msg_defect(info, image_of("rgb8", {0, 1, 2})), "");
  info.K[4] = 0.0;
  EXPECT_EQ(camera_info_msg_defect(info, image_of("rgb8", {0, 1, 2})), "camera_info without focal length");
}

TEST(LabelMessages, ComeBackExactlyInEitherByteOrder) {
  SoftLabels labels;
  labels.stamp_ns = 5;
  labels.camera = {3, 1, 11.0, 12.0, 1.0, 0.0};
  labels.probability = {0.125F, kUnknown, 1.0F};
  sensor_msgs::Image msg = labels_to_msg(labels, "camera");
  const sensor_msgs::CameraInfo info = camera_to_msg(labels.camera, 5, "camera");
  EXPECT_EQ(labels_msg_defect(msg), "");
  EXPECT_EQ(camera_info_msg_defect(info, msg), "");
  for (const bool is_bigendian : {false, true}) {
    if (is_bigendian) {
      for (std::size_t i = 0; i < msg.data.size(); i += 4) std::reverse(&msg.data[i], &msg.data[i] + 4);
      msg.is_bigendian = 1;
    }
    const SoftLabels read = labels_from_msg(msg, info);
    EXPECT_EQ(read.stamp_ns, labels.stamp_ns);
    EXPECT_EQ(read.camera.fy_px, 12.0);
    EXPECT_EQ(std::memcmp(read.probability.data(), labels.probability.data(), 12), 0);
  }
}

TEST(OdometryCovariances, AreNoneWhereTheMessageHasNone) {
  OdometryCovariances covariances;
  nav_msgs::Odometry msg;
  const auto add = [&](double xx, double xy, double yy, double rest) {
    msg.header.stamp += ros::Duration(0.01);
    msg.pose.covariance.fill(0.0);
    for (std::size_t i = 0; i < 6; ++i) msg.pose.covariance[7 * i] = rest;
    msg.pose.covariance[0] = xx;
    msg.pose.covariance[1] = msg.pose.covariance[6] = xy;
    msg.pose.covariance[7] = yy;
    covariances.add(msg);
  };
  add(0.0, 0.0, 0.0, 0.0);
  add(-1.0, 0.0, 1.0, 1.0);
  add(std::numeric_limits<double>::quiet_NaN(), 0.0, 1.0, 1.0);
  add(2.25, 3.0, 2.25, 1.0);  // of the variance -0.75 in a direction
  EXPECT_EQ(covariances.unknown(), 4U);
  EXPECT_FALSE(covariances.at(static_cast<std::int64_t>(msg.header.stamp.toNSec())));
  add(2.25, 2.0, 2.25, 1.0);
  const auto known = covariances.at(static_cast<std::int64_t>(msg.header.stamp.toNSec()));
  ASSERT_TRUE(known);
  EXPECT_EQ((*known)(0, 1), 2.0);
}

}  // namespace
}  // namespace situation_awareness::grid_messages_test

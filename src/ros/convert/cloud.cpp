// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/ros/convert/cloud.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <vector>

#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl_conversions/pcl_conversions.h>
#include <sensor_msgs/point_cloud2_iterator.h>

#include "situation_awareness/common/time.hpp"
#include "situation_awareness/ros/convert/poses.hpp"
#include "situation_awareness/ros/convert/time.hpp"

namespace situation_awareness {

sensor_msgs::PointCloud2 cloud_to_msg(const Cloud& cloud, const std::string& sensor_frame) {
  using sensor_msgs::PointField;
  sensor_msgs::PointCloud2 msg;
  msg.header.stamp = to_ros_time(cloud.stamp_ns);
  msg.header.frame_id = sensor_frame;
  sensor_msgs::PointCloud2Modifier modifier(msg);
  modifier.setPointCloud2Fields(6, "x", 1, PointField::FLOAT32, "y", 1, PointField::FLOAT32, "z", 1,
                                PointField::FLOAT32, "intensity", 1, PointField::FLOAT32, "ring", 1, PointField::UINT16,
                                "time", 1, PointField::FLOAT32);
  modifier.resize(cloud.points.size());
  msg.height = static_cast<std::uint32_t>(cloud.rows);
  msg.width = static_cast<std::uint32_t>(cloud.columns);
  msg.row_step = msg.width * msg.point_step;
  msg.is_dense = std::none_of(cloud.points.begin(), cloud.points.end(),
                              [](const CloudPoint& point) { return std::isnan(point.x_m); });

  // The fields are packed as by drivers, so most floats are unaligned and must not be bound to references.
  std::uint8_t* to = msg.data.data();
  const auto put = [&to](auto value) {
    std::memcpy(to, &value, sizeof value);
    to += sizeof value;
  };
  for (const CloudPoint& point : cloud.points) {
    put(point.x_m);
    put(point.y_m);
    put(point.z_m);
    put(point.intensity);
    put(point.ring);
    put(point.time_s);
  }
  return msg;
}

namespace {

using sensor_msgs::PointField;

/// Bytes of one value; 0 for a type that there is not.
std::uint64_t size_of(std::uint8_t datatype) {
  switch (datatype) {
    case PointField::INT8:
    case PointField::UINT8:
      return 1;
    case PointField::INT16:
    case PointField::UINT16:
      return 2;
    case PointField::INT32:
    case PointField::UINT32:
    case PointField::FLOAT32:
      return 4;
    case PointField::FLOAT64:
      return 8;
    default:
      return 0;
  }
}

/// The field of that name, if it is one value of one of these types.
const PointField* find_field(const sensor_msgs::PointCloud2& msg, const std::string& name,
                             std::initializer_list<std::uint8_t> types) {
  for (const PointField& field : msg.fields) {
    if (field.name != name || field.count > 1) continue;
    if (std::find(types.begin(), types.end(), field.datatype) != types.end()) return &field;
  }
  return nullptr;
}

/// Whether a name has "time" in it, as those that few drivers give to times of points.
bool is_of_time(const std::string& name) {
  const std::string time = "time";
  const auto is_letter = [](char c, char letter) { return std::tolower(static_cast<unsigned char>(c)) == letter; };
  return std::search(name.begin(), name.end(), time.begin(), time.end(), is_letter) != name.end();
}

const PointField* find_time_field(const sensor_msgs::PointCloud2& msg) {
  const auto find = [&msg](const std::string& name) {
    return find_field(msg, name,
                      {PointField::FLOAT32, PointField::FLOAT64, PointField::INT16, PointField::UINT16,
                       PointField::INT32, PointField::UINT32});
  };
  for (const char* name : {"time", "t", "timestamp"}) {
    if (const PointField* field = find(name)) return field;
  }
  for (const PointField& field : msg.fields) {
    if (!is_of_time(field.name)) continue;
    if (const PointField* found = find(field.name)) return found;
  }
  return nullptr;
}

bool is_whole(const PointField& field) {
  return field.datatype != PointField::FLOAT32 && field.datatype != PointField::FLOAT64;
}

template <class Number>
double number_at(const std::uint8_t* from) {
  Number number;
  std::memcpy(&number, from, sizeof number);  // it may lie where none can be referred to
  return static_cast<double>(number);
}

double number_at(const std::uint8_t* from, std::uint8_t type) {
  switch (type) {
    case PointField::INT16:
      return number_at<std::int16_t>(from);
    case PointField::UINT16:
      return number_at<std::uint16_t>(from);
    case PointField::INT32:
      return number_at<std::int32_t>(from);
    case PointField::UINT32:
      return number_at<std::uint32_t>(from);
    case PointField::FLOAT32:
      return number_at<float>(from);
    default:
      return number_at<double>(from);
  }
}

/// Some drivers leave it out.
std::size_t row_step_of(const sensor_msgs::PointCloud2& msg) {
  return msg.row_step != 0 ? msg.row_step : std::size_t{msg.width} * msg.point_step;
}

const std::uint8_t* point_of(const sensor_msgs::PointCloud2& msg, std::size_t place) {
  return msg.data.data() + place / msg.width * row_step_of(msg) + place % msg.width * msg.point_step;
}

/// Calls visit(number) with that of every point in the field.
template <class Visit>
void for_each_number(const sensor_msgs::PointCloud2& msg, const PointField& field, Visit&& visit) {
  for (std::size_t row = 0; row < msg.height; ++row) {
    const std::uint8_t* from = msg.data.data() + row * row_step_of(msg) + field.offset;
    for (std::size_t column = 0; column < msg.width; ++column, from += msg.point_step) {
      visit(number_at(from, field.datatype));
    }
  }
}

float intensity_of(const pcl::PointXYZ& /*point*/) { return std::numeric_limits<float>::quiet_NaN(); }
float intensity_of(const pcl::PointXYZI& point) { return point.intensity; }

template <class Point>
void take_points(const sensor_msgs::PointCloud2& msg, std::vector<CloudPoint>& points) {
  pcl::PointCloud<Point> from;
  if (msg.row_step != 0) {
    pcl::fromROSMsg(msg, from);
  } else {
    sensor_msgs::PointCloud2 whole = msg;
    whole.row_step = static_cast<std::uint32_t>(row_step_of(msg));
    pcl::fromROSMsg(whole, from);
  }
  points.reserve(from.size());
  for (const Point& point : from) points.push_back({point.x, point.y, point.z, intensity_of(point)});
}

}  // namespace

std::string cloud_msg_defect(const sensor_msgs::PointCloud2& msg) {
  const std::string bad = "bad cloud: ";
  if (msg.header.frame_id.empty()) return bad + "no frame_id";
  // To TF a stamp of zero means "the latest", which would be a made-up pose.
  if (msg.header.stamp.isZero()) return bad + "stamp is zero";
  if (msg.height == 0 || msg.width == 0) return bad + "no points";
  if (msg.is_bigendian != 0) return bad + "big-endian";
  for (const PointField& field : msg.fields) {
    const std::uint64_t count = std::max<std::uint64_t>(field.count, 1);
    if (field.offset + count * size_of(field.datatype) > msg.point_step) return bad + "field beyond its point";
  }
  for (const char* name : {"x", "y", "z"}) {
    if (find_field(msg, name, {PointField::FLOAT32}) == nullptr) return bad + "x, y, z are not float32";
  }
  const std::uint64_t row_step = msg.row_step != 0 ? msg.row_step : std::uint64_t{msg.width} * msg.point_step;
  if (std::uint64_t{msg.width} * msg.point_step > row_step || row_step > std::numeric_limits<std::uint32_t>::max() ||
      std::uint64_t{msg.height} * row_step > msg.data.size()) {
    return bad + "less data than points";
  }
  return "";
}

CloudMsgTimes cloud_msg_times(const sensor_msgs::PointCloud2& msg, CloudTimeReader& reader) {
  const PointField* const field = find_time_field(msg);
  if (field == nullptr) return {};
  std::vector<double> numbers;
  numbers.reserve(std::size_t{msg.width} * msg.height);
  for_each_number(msg, *field, [&numbers](double number) { numbers.push_back(number); });
  const std::uint32_t at[] = {find_field(msg, "x", {PointField::FLOAT32})->offset,
                              find_field(msg, "y", {PointField::FLOAT32})->offset,
                              find_field(msg, "z", {PointField::FLOAT32})->offset};
  const auto has_return = [&](std::size_t place) {
    const std::uint8_t* const from = point_of(msg, place);
    const auto value = [&](int i) { return static_cast<float>(number_at<float>(from + at[i])); };
    return is_return({value(0), value(1), value(2)});
  };
  return {true, reader.read(numbers, has_return, is_whole(*field), to_nanoseconds(msg.header.stamp))};
}

CloudTimes CloudMsgTimes::times() const {
  if (!scale) return {};
  const CloudTimes times = scale->times();
  return {static_cast<float>(times.first_s), static_cast<float>(times.last_s)};
}

Taken taken(const sensor_msgs::PointCloud2& msg, const CloudMsgTimes& msg_times, bool deskew) {
  const CloudTimes times = msg_times.times();
  const auto at = [&](double time_s) { return to_ros_time(to_nanoseconds(msg.header.stamp) + nanoseconds(time_s)); };
  return {tf2_frame(msg.header.frame_id), at(times.first_s), at(deskew ? times.last_s : times.first_s)};
}

Taken taken(const sensor_msgs::PointCloud2& msg, bool deskew) {
  CloudTimeReader reader;
  return taken(msg, cloud_msg_times(msg, reader), deskew);
}

Cloud cloud_from_msg(const sensor_msgs::PointCloud2& msg) {
  CloudTimeReader reader;
  return cloud_from_msg(msg, cloud_msg_times(msg, reader));
}

Cloud cloud_from_msg(const sensor_msgs::PointCloud2& msg, const CloudMsgTimes& times) {
  Cloud cloud;
  cloud.stamp_ns = to_nanoseconds(msg.header.stamp);
  cloud.rows = msg.height;
  cloud.columns = msg.width;
  // PCL complains of each cloud that lacks a field of the point.
  if (find_field(msg, "intensity", {PointField::FLOAT32}) != nullptr) {
    take_points<pcl::PointXYZI>(msg, cloud.points);
  } else {
    take_points<pcl::PointXYZ>(msg, cloud.points);
  }
  if (!times.has_field) return cloud;
  const CloudTimeScale no_times{0.0, 0.0, 1.0, 0.0};
  const CloudTimeScale& scale = times.scale ? *times.scale : no_times;
  auto point = cloud.points.begin();
  for_each_number(msg, *find_time_field(msg),
                  [&](double number) { (point++)->time_s = static_cast<float>(scale.time_s(number)); });
  return cloud;
}

}  // namespace situation_awareness

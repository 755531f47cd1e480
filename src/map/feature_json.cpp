// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/feature_json.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <utility>
#include <variant>
#include <vector>

#include "json_members.hpp"
#include "situation_awareness/estimation/covariance.hpp"
#include "situation_awareness/geometry/angles.hpp"

namespace situation_awareness {
namespace {

constexpr Bounds kPosition_m{-1e6, 1e6}, kSize_m{1e-3, 1e4}, kSigma_m{0.0, 1e3}, kSpeed{-1e3, 1e3}, kUnit{0.0, 1.0};
constexpr Bounds kArea_m2{1e-6, 1e8}, kCovariance{-1e9, 1e9};
/// An arc is less than a circle.
constexpr Bounds kBulge{-1e3, 1e3};
constexpr std::size_t kMaxVertices = 400'000;
/// The standard deviation of an outline that is drawn by hand.
constexpr double kDrawnSigma_m = 0.02;

double seconds(std::int64_t stamp_ns) { return 1e-9 * static_cast<double>(stamp_ns); }

// --- writing --------------------------------------------------------------------------------------------------------

void add_point(Json& outline, const Eigen::Vector2d& p_m) {
  outline.push_back(list_of(2, [&](int i) { return p_m(i); }));
}

/// Its centroid: of the area of a closed outline, else of the line.
Eigen::Vector2d middle_of(const std::vector<ChainVertex>& vertices, bool closed) {
  const std::size_t n = vertices.size();
  const Eigen::Vector2d& first_m = vertices[0].p_world_m;
  double area_m2 = 0.0, length_m = 0.0;
  Eigen::Vector2d of_area = Eigen::Vector2d::Zero(), of_line = Eigen::Vector2d::Zero();
  for (std::size_t k = 0; k + (closed ? 0 : 1) < n; ++k) {
    const Eigen::Vector2d from_m = vertices[k].p_world_m - first_m, to_m = vertices[(k + 1) % n].p_world_m - first_m;
    const double cross_m2 = from_m.x() * to_m.y() - from_m.y() * to_m.x(), edge_m = (to_m - from_m).norm();
    area_m2 += 0.5 * cross_m2;
    of_area += cross_m2 / 6.0 * (from_m + to_m);
    length_m += edge_m;
    of_line += 0.5 * edge_m * (from_m + to_m);
  }
  if (closed && std::abs(area_m2) > 1e-9) return first_m + of_area / area_m2;
  return length_m > 0.0 ? Eigen::Vector2d(first_m + of_line / length_m) : first_m;
}

void add_place(const Eigen::Vector2d& p_m, Json& element) {
  element["x"] = finite(p_m.x());
  element["y"] = finite(p_m.y());
}

/// Members of a feature that its shape decides.
struct AddShape {
  Json& element;

  void operator()(const EllipseShape& shape) const { add_body(shape.ellipse_world, Shape::kEllipse, {}, shape.body); }
  void operator()(const BoxShape& shape) const {
    add_body(moment_equal_ellipse(shape.box_world), Shape::kBox, shape.box_world, shape.body);
  }
  void add_body(const Ellipse& ellipse, Shape kind, const Box& box, const BodyState& body) const {
    Object object;
    object.shape = kind;
    object.ellipse_world = ellipse;
    object.box_world = box;
    Json& outline = element["outline"] = Json::array();
    for (const Eigen::Vector2d& p_world_m : outline_world(object)) add_point(outline, p_world_m);
    element["closed"] = true;
    const auto P = body.covariance.block<2, 2>(object_error::kPosition, object_error::kPosition);
    element["sigma_m"] = finite(std::sqrt(std::max(0.5 * P.trace(), 0.0)));
    add_place(ellipse.center_m, element);
    element["psi"] = finite(ellipse.psi_rad);
    element["rx"] = finite(ellipse.rx_m);
    element["ry"] = finite(ellipse.ry_m);
    element["vx"] = finite(body.velocity_world_m_s.x());
    element["vy"] = finite(body.velocity_world_m_s.y());
    element["wz"] = finite(body.angular_velocity_rad_s);
    element["covariance"] = list_of(64, [&](int i) { return body.covariance(i / 8, i % 8); });
  }

  void operator()(const PolylineShape& shape) const {
    Json& outline = element["outline"] = Json::array();
    Json sigma = Json::array();
    for (const ChainVertex& vertex : shape.vertices) {
      add_point(outline, vertex.p_world_m);
      sigma.push_back(finite(vertex.sigma_m));
    }
    element["closed"] = shape.closed;
    element["sigma_m"] = std::move(sigma);
    add_place(middle_of(shape.vertices, shape.closed), element);
  }

  void operator()(const ArcShape& shape) const {
    Json& outline = element["outline"] = Json::array();
    Json sigma = Json::array();
    for (const SplinegonVertex& vertex : shape.vertices) {
      outline.push_back(list_of(3, [&](int i) { return i < 2 ? vertex.p_world_m(i) : vertex.bulge; }));
      sigma.push_back(finite(vertex.sigma_m));
    }
    element["closed"] = shape.closed;
    element["sigma_m"] = std::move(sigma);
    constexpr double kSpacing_m = 0.2;
    add_place(middle_of(lines_along(splinegon_of(shape), kSpacing_m), shape.closed), element);
  }

  /// The outline is the circle of its area, of two arcs.
  void operator()(const FootprintShape& shape) const {
    const Eigen::Vector2d p_m = shape.p_world_m.head<2>();
    const double radius_m = std::sqrt(shape.area_m2 / kPi);
    Json& outline = element["outline"] = Json::array();
    for (const double side : {-1.0, 1.0}) {
      outline.push_back(Json::array({finite(p_m.x() + side * radius_m), finite(p_m.y()), 1.0}));
    }
    element["closed"] = true;
    element["sigma_m"] = finite(std::sqrt(std::max(0.5 * shape.covariance_m2.trace(), 0.0)));
    add_place(p_m, element);
    element["area_m2"] = finite(shape.area_m2);
    element["z"] = finite(shape.p_world_m.z());
  }
};

// --- reading --------------------------------------------------------------------------------------------------------

FeatureId id_of(const JsonMembers& members) {
  const Json* const value = members.find("id");
  if (value == nullptr) return 0;
  constexpr FeatureId kEnd = FeatureId{1} << 53;
  if (!value->is_number_unsigned() || value->get<FeatureId>() == 0 || value->get<FeatureId>() >= kEnd) {
    members.refuse("id", "is no whole number in [1, 2^53)");
  }
  return value->get<FeatureId>();
}

/// The one of `values` whose name a member is.
template <class Value, std::size_t N>
Value one_of(const JsonMembers& members, const char* name, const std::array<Value, N>& values, Value otherwise) {
  const Json* const text = members.find(name);
  if (text == nullptr) return otherwise;
  const auto value =
      std::find_if(values.begin(), values.end(), [&](Value candidate) { return *text == name_of(candidate); });
  if (value == values.end()) members.refuse(name, "= " + text->dump() + " is unknown");
  return *value;
}

/// Calls visit(point, sigma_m) with each vertex of the outline, a list of at least `fewest` numbers.
template <class Visit>
void for_each_vertex(const JsonMembers& members, std::size_t fewest, const Visit& visit) {
  const Json* const points = members.find("outline");
  if (points == nullptr || !points->is_array() || points->size() > kMaxVertices) {
    members.refuse("outline", "is no list of vertices, or too long");
  }
  const Json* const sigma = members.find("sigma_m");
  const bool has_each = sigma != nullptr && sigma->is_array();
  if (has_each && sigma->size() != points->size()) members.refuse("sigma_m", "has not one value for each vertex");
  for (std::size_t k = 0; k < points->size(); ++k) {
    const Json& point = (*points)[k];
    if (!point.is_array() || point.size() < fewest) members.refuse("outline", "has a vertex without its numbers");
    const double sigma_m =
        sigma == nullptr ? kDrawnSigma_m : members.number(has_each ? (*sigma)[k] : *sigma, "sigma_m", kSigma_m);
    visit(point, sigma_m);
  }
}

Eigen::Vector2d place_of(const JsonMembers& members, const Json& point) {
  return {members.number(point[0], "outline", kPosition_m), members.number(point[1], "outline", kPosition_m)};
}

void read_sights(const JsonMembers& members, std::int64_t stamp_ns, Feature& feature) {
  feature.first_seen_ns = members.stamp_ns("first_seen", stamp_ns);
  feature.last_seen_ns = members.stamp_ns("last_seen", stamp_ns);
  if (feature.first_seen_ns > feature.last_seen_ns) members.refuse("first_seen", "is after last_seen");
  if (members.find("last_absent") != nullptr) feature.last_absent_ns = members.stamp_ns("last_absent");
  if (members.find("first_absent") != nullptr) feature.first_absent_ns = members.stamp_ns("first_absent");
  const Json* const seen_by = members.find("seen_by");
  if (seen_by == nullptr) {
    feature.seen_by.file = true;
    return;
  }
  for (const Json& sensor : *seen_by) {
    feature.seen_by.scan |= sensor == "scan";
    feature.seen_by.cloud |= sensor == "cloud";
    feature.seen_by.camera |= sensor == "camera";
    feature.seen_by.file |= sensor == "file";
  }
}

BodyState body_of(const JsonMembers& members) {
  BodyState body;
  body.velocity_world_m_s = {members.number("vx", kSpeed, 0.0), members.number("vy", kSpeed, 0.0)};
  body.angular_velocity_rad_s = members.number("wz", kSpeed, 0.0);
  const Json* const numbers = members.find("covariance");
  if (numbers == nullptr) {
    body.covariance.diagonal().setConstant(kDrawnSigma_m * kDrawnSigma_m);
    return body;
  }
  if (!numbers->is_array() || numbers->size() != 64) members.refuse("covariance", "has not 64 numbers");
  for (int i = 0; i < 64; ++i) {
    body.covariance(i / 8, i % 8) = members.number((*numbers)[static_cast<std::size_t>(i)], "covariance", kCovariance);
  }
  if (!is_positive_semidefinite(body.covariance.topLeftCorner<6, 6>()) ||
      !is_positive_semidefinite(body.covariance.bottomRightCorner<2, 2>())) {
    members.refuse("covariance", "is none");
  }
  return body;
}

Ellipse ellipse_of(const JsonMembers& members) {
  Ellipse ellipse;
  ellipse.center_m = {members.number("x", kPosition_m), members.number("y", kPosition_m)};
  ellipse.psi_rad = members.number("psi", Bounds{-2.0 * kPi, 2.0 * kPi}, 0.0);
  ellipse.rx_m = members.number("rx", kSize_m);
  ellipse.ry_m = members.number("ry", kSize_m);
  if (ellipse.ry_m > ellipse.rx_m) members.refuse("ry", "is more than rx");
  return ellipse;
}

PolylineShape polyline_of(const JsonMembers& members) {
  PolylineShape shape;
  shape.closed = members.flag("closed");
  for_each_vertex(members, 2, [&](const Json& point, double sigma_m) {
    shape.vertices.push_back({place_of(members, point), sigma_m});
  });
  if (shape.vertices.size() < (shape.closed ? 3U : 2U)) members.refuse("outline", "has too few vertices");
  return shape;
}

/// Reads an outline whose main vertices and joints alternate.
ArcShape arcs_of(const JsonMembers& members) {
  ArcShape shape;
  shape.closed = members.flag("closed");
  for_each_vertex(members, 3, [&](const Json& point, double sigma_m) {
    SplinegonVertex vertex;
    vertex.p_world_m = place_of(members, point);
    vertex.bulge = members.number(point[2], "outline", kBulge);
    vertex.sigma_m = sigma_m;
    if (!shape.vertices.empty() && shape.vertices.back().p_world_m == vertex.p_world_m) {
      members.refuse("outline", "has the same vertex twice");
    }
    shape.vertices.push_back(vertex);
  });
  const std::size_t n = shape.vertices.size();
  if (n < (shape.closed ? 4U : 3U) || (n % 2 == 0) != shape.closed) {
    members.refuse("outline", "has not main vertices and joints in turn");
  }
  if (shape.closed && area_m2(splinegon_of(shape)) <= 0.0) members.refuse("outline", "is not counter-clockwise");
  return shape;
}

FootprintShape footprint_of(const JsonMembers& members) {
  FootprintShape shape;
  shape.p_world_m = {members.number("x", kPosition_m), members.number("y", kPosition_m),
                     members.number("z", kPosition_m, 0.0)};
  const double sigma_m = members.number("sigma_m", kSigma_m, kDrawnSigma_m);
  shape.covariance_m2 = sigma_m * sigma_m * Eigen::Matrix2d::Identity();
  shape.area_m2 = members.number("area_m2", kArea_m2);
  return shape;
}

FeatureShape shape_of(const JsonMembers& members) {
  const Json& kind = members.at("kind");
  if (kind == "ellipse") return EllipseShape{ellipse_of(members), body_of(members)};
  if (kind == "box") return BoxShape{moment_equal_box(ellipse_of(members)), body_of(members)};
  if (kind == "polyline") return polyline_of(members);
  if (kind == "boundary") return arcs_of(members);
  if (kind == "target") return footprint_of(members);
  members.refuse("kind", "= " + kind.dump() + " is unknown");
}

}  // namespace

void add_feature(Json& list, const Feature& feature) {
  Json& element = add_object(list, 26);
  element["id"] = feature.id;
  element["kind"] = kind_of(feature.shape);
  element["class"] = name_of(feature.object_class);
  element["p_class"] = finite(feature.p_class);
  element["p_exists"] = finite(feature.p_exists);
  element["p_moving"] = finite(feature.p_moving);
  element["motion"] = name_of(feature.motion);
  element["first_seen"] = seconds(feature.first_seen_ns);
  element["last_seen"] = seconds(feature.last_seen_ns);
  if (feature.last_absent_ns) element["last_absent"] = seconds(*feature.last_absent_ns);
  if (feature.first_absent_ns) element["first_absent"] = seconds(*feature.first_absent_ns);
  Json& seen_by = element["seen_by"] = Json::array();
  if (feature.seen_by.scan) seen_by.push_back("scan");
  if (feature.seen_by.cloud) seen_by.push_back("cloud");
  if (feature.seen_by.camera) seen_by.push_back("camera");
  if (feature.seen_by.file) seen_by.push_back("file");
  std::visit(AddShape{element}, feature.shape);
}

Feature feature_from_json(const Json& object, std::int64_t stamp_ns, const std::string& place) {
  const JsonMembers members(object, place);
  Feature feature;
  feature.id = id_of(members);
  feature.object_class =
      one_of(members, "class",
             std::array{ObjectClass::kUnknown, ObjectClass::kPerson, ObjectClass::kVehicle, ObjectClass::kPole},
             ObjectClass::kUnknown);
  feature.p_class = members.number("p_class", kUnit, 0.0);
  feature.p_exists = members.number("p_exists", kUnit, 1.0);
  feature.p_moving = members.number("p_moving", kUnit, 0.0);
  feature.motion =
      one_of(members, "motion", std::array{Motion::kMoving, Motion::kStanding, Motion::kFixed}, Motion::kFixed);
  read_sights(members, stamp_ns, feature);
  feature.shape = shape_of(members);
  return feature;
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/sim/path.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <sstream>
#include <stdexcept>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "situation_awareness/geometry/angles.hpp"
#include "situation_awareness/sim/periodic_spline.hpp"

namespace situation_awareness {
namespace {

using Row = std::vector<double>;

/// The words of a path's text: its kind, and the numbers behind each further word, in rows that `;` ends.
class PathText {
 public:
  explicit PathText(const std::string& text) {
    std::string spaced;
    for (const char c : text) spaced += c == ';' ? std::string(" ; ") : std::string(1, c);
    std::istringstream words(spaced);
    if (!(words >> kind_)) throw std::invalid_argument("is empty");
    if (kind_ == "with" && !(words >> body_)) throw std::invalid_argument("lacks the body to move with");
    std::vector<Row>* rows = nullptr;
    for (std::string word; words >> word;) {
      double number = 0.0;
      const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
      const bool is_number = error == std::errc() && end == word.data() + word.size() && std::isfinite(number);
      if (!is_number && word != ";") {
        const auto [place, is_new] = rows_.emplace(word, std::vector<Row>(1));
        if (!is_new) throw std::invalid_argument("has '" + word + "' twice");
        rows = &place->second;
      } else if (rows == nullptr) {
        throw std::invalid_argument("has '" + word + "' where a word should be");
      } else if (is_number) {
        rows->back().push_back(number);
      } else {
        rows->emplace_back();
      }
    }
  }

  const std::string& kind() const { return kind_; }

  /// The body to move with, of the kind `with`; else empty.
  const std::string& body() const { return body_; }

  bool has(const std::string& word) const { return rows_.count(word) != 0; }

  /// The rows behind `word`, which is marked as used.
  std::vector<Row> take_rows(const std::string& word) {
    const auto place = rows_.find(word);
    if (place == rows_.end()) throw std::invalid_argument("lacks '" + word + "'");
    std::vector<Row> rows = std::move(place->second);
    rows_.erase(place);
    if (rows.size() > 1 && rows.back().empty()) rows.pop_back();  // allows a semicolon after the last row
    return rows;
  }

  Row take(const std::string& word, std::size_t count) {
    std::vector<Row> rows = take_rows(word);
    if (rows.size() != 1 || rows[0].size() != count) {
      throw std::invalid_argument("needs " + std::to_string(count) + " number(s) after '" + word + "'");
    }
    return std::move(rows[0]);
  }

  double take_number(const std::string& word) { return take(word, 1)[0]; }
  double take_number(const std::string& word, double otherwise) { return has(word) ? take_number(word) : otherwise; }

  double take_positive(const std::string& word) {
    const double number = take_number(word);
    if (!(number > 0.0)) throw std::invalid_argument("needs a positive number after '" + word + "'");
    return number;
  }

  void check_all_used() const {
    if (!rows_.empty()) throw std::invalid_argument("has '" + rows_.begin()->first + "', which it does not know");
  }

 private:
  std::string kind_, body_;
  std::map<std::string, std::vector<Row>> rows_;
};

Eigen::Vector3d in_plane(double x, double y, double z = 0.0) { return {x, y, z}; }

ScriptedPath stand(const Eigen::Vector3d& position_m) {
  return [=](double /*time_s*/) {
    PathState state;
    state.position_m = position_m;
    return state;
  };
}

ScriptedPath circle(PathText& text, double height_m) {
  const Row center = text.take("center", 2);
  const double r = text.take_positive("radius");
  const double w = text.take_number("rate");
  const double phase = text.take_number("phase", 0.0);
  return [=](double time_s) {
    const double c = std::cos(w * time_s + phase);
    const double s = std::sin(w * time_s + phase);
    PathState state;
    state.position_m = in_plane(center[0] + r * c, center[1] + r * s, height_m);
    state.velocity_m_s = r * w * in_plane(-s, c);
    state.acceleration_m_s2 = -r * w * w * in_plane(c, s);
    state.jerk_m_s3 = -r * w * w * w * in_plane(-s, c);
    return state;
  };
}

ScriptedPath line(PathText& text, double height_m) {
  const Row from = text.take("from", 2);
  const Row to = text.take("to", 2);
  const double w = 2.0 * kPi / text.take_positive("period");
  const double phase = text.take_number("phase", 0.0);
  const Eigen::Vector3d middle = in_plane(0.5 * (from[0] + to[0]), 0.5 * (from[1] + to[1]), height_m);
  const Eigen::Vector3d half = in_plane(0.5 * (to[0] - from[0]), 0.5 * (to[1] - from[1]));
  return [=](double time_s) {
    const double c = std::cos(w * time_s + phase);
    const double s = std::sin(w * time_s + phase);
    PathState state;
    state.position_m = middle - c * half;
    state.velocity_m_s = w * s * half;
    state.acceleration_m_s2 = w * w * c * half;
    state.jerk_m_s3 = -w * w * w * s * half;
    return state;
  };
}

ScriptedPath straight(PathText& text, double height_m) {
  const Row from = text.take("from", 2);
  const Row velocity = text.take("velocity", 2);
  const Eigen::Vector3d start = in_plane(from[0], from[1], height_m);
  const Eigen::Vector3d step = in_plane(velocity[0], velocity[1]);
  return [=](double time_s) {
    PathState state;
    state.position_m = start + time_s * step;
    state.velocity_m_s = step;
    return state;
  };
}

/// p = b + R q, where R turns by the carrying body's yaw and q(t) is the position in its axes; v = b' + R (yaw' J q +
/// q').
ScriptedPath with_body(PathText& text, double height_m, const ScriptedPath& body) {
  const Row at = text.take("at", 2);
  const bool swings = text.has("swing");
  const double amplitude_m = text.take_number("swing", 0.0);
  const double w = swings ? 2.0 * kPi / text.take_positive("period") : 0.0;
  const double phase = swings ? text.take_number("phase", 0.0) : 0.0;
  return [=](double time_s) {
    const PathState carrier = body(time_s);
    const Eigen::Rotation2Dd R(carrier.yaw_rad);
    const Eigen::Vector2d q(at[0] + amplitude_m * std::sin(w * time_s + phase), at[1]);
    const Eigen::Vector2d q_rate(amplitude_m * w * std::cos(w * time_s + phase), 0.0);
    const Eigen::Vector2d J_q(-q.y(), q.x());
    PathState state;
    state.position_m << carrier.position_m.head<2>() + R * q, height_m;
    state.velocity_m_s << carrier.velocity_m_s.head<2>() + R * (carrier.yaw_rate_rad_s * J_q + q_rate), 0.0;
    state.acceleration_m_s2.setConstant(std::numeric_limits<double>::quiet_NaN());
    state.jerk_m_s3.setConstant(std::numeric_limits<double>::quiet_NaN());
    state.yaw_rad = carrier.yaw_rad;
    state.yaw_rate_rad_s = carrier.yaw_rate_rad_s;
    return state;
  };
}

/// A foot: it stands for half of the period where its place in the body's axes is in the middle of this time, then goes
/// to the next such place with the least jerk.
ScriptedPath foot_of_body(PathText& text, double height_m, const ScriptedPath& body) {
  const Row at = text.take("at", 2);
  const double period_s = text.take_positive("steps");
  const double phase_cycles = text.take_number("phase", 0.0) / (2.0 * kPi);
  const auto foothold = [=](double cycle) {
    const PathState carrier = body((cycle - phase_cycles) * period_s);
    const Eigen::Vector2d place_m =
        carrier.position_m.head<2>() + Eigen::Rotation2Dd(carrier.yaw_rad) * Eigen::Vector2d(at[0], at[1]);
    return Eigen::Vector3d(place_m.x(), place_m.y(), carrier.yaw_rad);
  };
  return [=](double time_s) {
    const double cycles = time_s / period_s + phase_cycles;
    const double cycle = std::floor(cycles + 0.25);                // stands from a quarter before to a quarter after it
    const double s = std::max(0.0, 2.0 * (cycles - cycle) - 0.5);  // the part of the way
    const Eigen::Vector3d from = foothold(cycle);
    Eigen::Vector3d way = foothold(cycle + 1.0) - from;
    way.z() = wrap_to_pi(way.z());
    const Eigen::Vector3d pose = from + s * s * s * (10.0 + s * (6.0 * s - 15.0)) * way;
    const Eigen::Vector3d rate = 30.0 * s * s * (1.0 - s) * (1.0 - s) * 2.0 / period_s * way;
    PathState state;
    state.position_m << pose.head<2>(), height_m;
    state.velocity_m_s << rate.head<2>(), 0.0;
    state.acceleration_m_s2.setConstant(std::numeric_limits<double>::quiet_NaN());
    state.jerk_m_s3.setConstant(std::numeric_limits<double>::quiet_NaN());
    state.yaw_rad = pose.z();
    state.yaw_rate_rad_s = rate.z();
    return state;
  };
}

/// The waypoints of a loop as columns (x, y, z, yaw). Yaw goes the shorter way from point to point, without jumps.
Eigen::Matrix4Xd waypoints(const std::vector<Row>& rows, double height_m) {
  if (rows.size() < 3) throw std::invalid_argument("needs at least 3 points");
  Eigen::Matrix4Xd points(4, static_cast<Eigen::Index>(rows.size()));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Row& row = rows[i];
    if ((row.size() != 2 && row.size() != 4) || row.size() != rows[0].size()) {
      throw std::invalid_argument("needs points of 2 numbers each (x y) or of 4 (x y z yaw)");
    }
    const auto column = static_cast<Eigen::Index>(i);
    points.col(column) << row[0], row[1], height_m, 0.0;
    if (row.size() == 2) continue;
    const double yaw_before = i == 0 ? row[3] : points(3, column - 1);
    points(2, column) = row[2];
    points(3, column) = yaw_before + wrap_to_pi(row[3] - yaw_before);
  }
  return points;
}

/// Length of the closed curve in x, y, z. The midpoint rule converges fast for a periodic integrand.
double length_of(const PeriodicSpline& curve) {
  constexpr int kSamplesPerLeg = 64;
  const int samples = kSamplesPerLeg * static_cast<int>(curve.period());
  double sum = 0.0;
  for (int i = 0; i < samples; ++i) sum += curve((i + 0.5) / kSamplesPerLeg, 1).head<3>().norm();
  return sum / kSamplesPerLeg;
}

ScriptedPath loop(PathText& text, double height_m) {
  const double speed = text.take_positive("speed");
  Eigen::Matrix4Xd points = waypoints(text.take_rows("points"), height_m);

  // Yaw may gain whole turns per lap: the spline has only the remainder.
  const Eigen::Index n = points.cols();
  const double yaw_step =
      (points(3, n - 1) - points(3, 0) + wrap_to_pi(points(3, 0) - points(3, n - 1))) / static_cast<double>(n);
  for (Eigen::Index i = 0; i < n; ++i) points(3, i) -= yaw_step * static_cast<double>(i);
  const PeriodicSpline curve(points);

  const double length_m = length_of(curve);
  if (!(length_m > 1e-6)) throw std::invalid_argument("has all its points at one place");
  const double rate = curve.period() * speed / length_m;  // points per second
  return [=](double time_s) {
    const double u = rate * time_s;
    const Eigen::Vector4d place = curve(u);
    const Eigen::Vector4d slope = curve(u, 1);
    PathState state;
    state.position_m = place.head<3>();
    state.velocity_m_s = rate * slope.head<3>();
    state.acceleration_m_s2 = rate * rate * curve(u, 2).head<3>();
    state.jerk_m_s3 = rate * rate * rate * curve(u, 3).head<3>();
    state.yaw_rad = place[3] + yaw_step * u;
    state.yaw_rate_rad_s = rate * (slope[3] + yaw_step);
    return state;
  };
}

/// From place to place, at rest at each: position and yaw go by the polynomial whose first three derivatives are zero
/// at both ends. Before the first and after the last one the body stands.
ScriptedPath stops(PathText& text, double height_m) {
  std::vector<Row> places = text.take_rows("places");
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (places[i].size() != 4) throw std::invalid_argument("needs places of 4 numbers each (x y yaw time)");
    if (i == 0) continue;
    if (!(places[i][3] > places[i - 1][3])) throw std::invalid_argument("needs places at times that increase");
    places[i][2] = places[i - 1][2] + wrap_to_pi(places[i][2] - places[i - 1][2]);
  }
  return [=](double time_s) {
    const auto next = std::find_if(places.begin(), places.end(), [=](const Row& place) { return place[3] > time_s; });
    const Row& to = next == places.end() ? places.back() : *next;
    const Row& from = next == places.begin() ? to : *std::prev(next);
    const double duration_s = to[3] - from[3];
    PathState state;
    state.position_m = in_plane(from[0], from[1], height_m);
    state.yaw_rad = from[2];
    if (!(duration_s > 0.0)) return state;
    const double s = (time_s - from[3]) / duration_s, r = 1.0 - s;
    const Eigen::Vector3d way = in_plane(to[0] - from[0], to[1] - from[1]);
    const double part = s * s * s * s * (35.0 + s * (-84.0 + s * (70.0 - 20.0 * s)));
    const double rate = 140.0 * s * s * s * r * r * r / duration_s;
    state.position_m += part * way;
    state.velocity_m_s = rate * way;
    state.acceleration_m_s2 = 420.0 * s * s * r * r * (r - s) / (duration_s * duration_s) * way;
    state.jerk_m_s3 = 840.0 * s * r * (1.0 - 5.0 * s * r) / (duration_s * duration_s * duration_s) * way;
    state.yaw_rad += part * (to[2] - from[2]);
    state.yaw_rate_rad_s = rate * (to[2] - from[2]);
    return state;
  };
}

/// The same path with an additional rotation about the vertical at a constant rate.
ScriptedPath spinning(const ScriptedPath& path, double yaw_rad, double rate_rad_s) {
  return [=](double time_s) {
    PathState state = path(time_s);
    state.yaw_rad += yaw_rad + rate_rad_s * time_s;
    state.yaw_rate_rad_s += rate_rad_s;
    return state;
  };
}

/// The same path, at a constant angle to the direction of motion.
ScriptedPath tangent(const ScriptedPath& path, double yaw_rad) {
  return [=](double time_s) {
    PathState state = path(time_s);
    const Eigen::Vector3d& v = state.velocity_m_s;
    const Eigen::Vector3d& a = state.acceleration_m_s2;
    state.yaw_rad = yaw_rad + std::atan2(v.y(), v.x());
    state.yaw_rate_rad_s = (v.x() * a.y() - v.y() * a.x()) / v.head<2>().squaredNorm();
    return state;
  };
}

Presence take_presence(PathText& text) {
  Presence presence;
  presence.appears_s = text.take_number("appears", presence.appears_s);
  presence.goes_s = text.take_number("goes", presence.goes_s);
  if (!(presence.goes_s > presence.appears_s)) throw std::invalid_argument("goes before it appears");
  if (!text.has("transits")) return presence;
  const std::vector<Row> rows = text.take_rows("transits");
  presence.transits.emplace();
  for (const double number : rows.front()) {
    if (!(number >= 1.0 && number < 1e6 && number == std::floor(number))) {
      throw std::invalid_argument("needs whole numbers from 1 on after 'transits'");
    }
    presence.transits->push_back(static_cast<int>(number));
  }
  if (rows.size() != 1 || presence.transits->empty()) {
    throw std::invalid_argument("needs the numbers of transits after 'transits'");
  }
  std::sort(presence.transits->begin(), presence.transits->end());
  return presence;
}

}  // namespace

ScriptedPath parse_path(const std::string& text, const Eigen::Vector3d& position_m, double yaw_rad,
                        const PathOfBody& path_of_body) {
  PathText words(text);
  const std::string kind = words.kind();
  ScriptedPath path;
  bool moves_on = false;  // never at rest, so that the direction of motion is defined
  bool has_yaw = false;
  if (kind == "stand") {
    path = stand(position_m);
  } else if (kind == "circle") {
    path = circle(words, position_m.z());
    moves_on = path(0.0).velocity_m_s.norm() > 0.0;
  } else if (kind == "line") {
    path = line(words, position_m.z());
  } else if (kind == "straight") {
    path = straight(words, position_m.z());
    moves_on = path(0.0).velocity_m_s.norm() > 0.0;
  } else if (kind == "loop") {
    const std::vector<Row> rows = PathText(words).take_rows("points");
    has_yaw = rows[0].size() == 4;
    moves_on = true;
    path = loop(words, position_m.z());
  } else if (kind == "stops") {
    has_yaw = true;
    path = stops(words, position_m.z());
  } else if (kind == "with") {
    const ScriptedPath body = path_of_body ? path_of_body(words.body()) : ScriptedPath();
    if (!body) {
      throw std::invalid_argument("moves with '" + words.body() +
                                  "', which only an object may, and only with a body that has a path of its own");
    }
    path = words.has("steps") ? foot_of_body(words, position_m.z(), body) : with_body(words, position_m.z(), body);
  } else {
    throw std::invalid_argument("starts with '" + kind +
                                "' instead of stand, circle, line, straight, loop, stops or with");
  }

  if (has_yaw && (words.has("spin") || words.has("tangent"))) {
    throw std::invalid_argument("turns in two ways: by the yaw of its points, and by 'spin' or 'tangent'");
  }
  if (words.has("tangent")) {
    if (words.has("spin")) throw std::invalid_argument("turns in two ways: 'spin' and 'tangent'");
    if (!moves_on) throw std::invalid_argument("has 'tangent' but does not move on all the time");
    words.take("tangent", 0);
    path = tangent(path, yaw_rad);
  } else if (!has_yaw) {
    path = spinning(path, yaw_rad, words.take_number("spin", 0.0));
  }
  take_presence(words);
  words.check_all_used();
  return path;
}

PathFacts facts_of_path(const std::string& text) {
  PathText words(text);
  return {take_presence(words), words.body(), words.kind() == "stand" && !words.has("spin")};
}

}  // namespace situation_awareness

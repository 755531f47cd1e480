// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include <Eigen/Core>

#include "situation_awareness/evaluation/ellipse_posterior.hpp"
#include "situation_awareness/geometry/angles.hpp"

// The detection of least expected loss.
namespace situation_awareness {
namespace {

bool is_of_circles(DetectionLoss loss) {
  return loss == DetectionLoss::kCircle || loss == DetectionLoss::kCircleSquared;
}

/// The expected distance of characteristic points and its gradient, for many truths at once.
class ExpectedDistance {
 public:
  using Vector = Eigen::VectorXd;

  ExpectedDistance(DetectionLoss loss, const std::vector<Ellipse>& truths, std::size_t stride) : loss_(loss) {
    const auto n = static_cast<Eigen::Index>((truths.size() + stride - 1) / stride);
    for (Eigen::ArrayXd* array : {&x_, &y_, &ux_, &uy_, &vx_, &vy_}) array->resize(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const Ellipse& truth = truths[static_cast<std::size_t>(i) * stride];
      const double c = std::cos(truth.psi_rad);
      const double s = std::sin(truth.psi_rad);
      x_(i) = truth.center_m.x();
      y_(i) = truth.center_m.y();
      ux_(i) = truth.rx_m * c;
      uy_(i) = truth.rx_m * s;
      vx_(i) = -truth.ry_m * s;
      vy_(i) = truth.ry_m * c;
    }
  }

  /// (t_x, t_y, psi, rx, ry), or (t_x, t_y, r) of a circle.
  Vector parameters(const Ellipse& ellipse) const {
    if (loss_ == DetectionLoss::kCircle)
      return Eigen::Vector3d(ellipse.center_m.x(), ellipse.center_m.y(), ellipse.rx_m);
    Vector result(5);
    result << ellipse.center_m, ellipse.psi_rad, ellipse.rx_m, ellipse.ry_m;
    return result;
  }

  Ellipse ellipse(const Vector& p) const {
    if (loss_ == DetectionLoss::kCircle) return {{p(0), p(1)}, 0.0, p(2), p(2)};
    return {{p(0), p(1)}, p(2), p(3), p(4)};
  }

  double operator()(const Vector& parameters, Vector& gradient) const {
    const Ellipse e = ellipse(parameters);
    const Eigen::Vector2d x_axis(std::cos(e.psi_rad), std::sin(e.psi_rad));
    const Eigen::Vector2d y_axis(-x_axis.y(), x_axis.x());
    Sums sums;
    for (Eigen::Index begin = 0; begin < x_.size(); begin += kBlock) {
      add(begin, std::min(kBlock, x_.size() - begin), e.center_m, e.rx_m * x_axis, e.ry_m * y_axis, sums);
    }
    const double scale = 0.25 / static_cast<double>(x_.size());
    const Eigen::Vector2d d_u = sums.d_u * scale;
    const Eigen::Vector2d d_v = sums.d_v * scale;
    gradient.resize(parameters.size());
    gradient.head<2>() = sums.d_t * scale;
    if (loss_ == DetectionLoss::kCircle) {
      gradient(2) = d_u.dot(x_axis) + d_v.dot(y_axis);
    } else {
      gradient(2) = e.rx_m * d_u.dot(y_axis) - e.ry_m * d_v.dot(x_axis);
      gradient(3) = d_u.dot(x_axis);
      gradient(4) = d_v.dot(y_axis);
    }
    return sums.distance * scale;
  }

 private:
  static constexpr Eigen::Index kBlock = 256;  ///< truths at a time, so that they stay in the first cache
  using Block = Eigen::Array<double, Eigen::Dynamic, 1, 0, kBlock, 1>;

  /// Sums over truths of the four distances and of their derivatives by t and by the half axes u and v.
  struct Sums {
    double distance = 0.0;
    Eigen::Vector2d d_t = Eigen::Vector2d::Zero();
    Eigen::Vector2d d_u = Eigen::Vector2d::Zero();
    Eigen::Vector2d d_v = Eigen::Vector2d::Zero();
  };

  void add(Eigen::Index begin, Eigen::Index size, const Eigen::Vector2d& t, const Eigen::Vector2d& u,
           const Eigen::Vector2d& v, Sums& sums) const {
    const Block dx = t.x() - x_.segment(begin, size);
    const Block dy = t.y() - y_.segment(begin, size);
    Block ux = ux_.segment(begin, size);
    Block uy = uy_.segment(begin, size);
    Block vx = vx_.segment(begin, size);
    Block vy = vy_.segment(begin, size);
    const auto four_distances = [&](double sign) -> Block {
      return norm(dx + (u.x() - sign * ux), dy + (u.y() - sign * uy)) +
             norm(dx - (u.x() - sign * ux), dy - (u.y() - sign * uy)) +
             norm(dx + (v.x() - sign * vx), dy + (v.y() - sign * vy)) +
             norm(dx - (v.x() - sign * vx), dy - (v.y() - sign * vy));
    };
    if (loss_ == DetectionLoss::kSymmetric) {
      const Block sign = (four_distances(1.0) <= four_distances(-1.0)).select(Block::Ones(size), -Block::Ones(size));
      ux *= sign;
      uy *= sign;
      vx *= sign;
      vy *= sign;
    }
    const auto add_point = [&](const Eigen::Vector2d& axis, const Block& truth_x, const Block& truth_y, double side,
                               Eigen::Vector2d& d_axis) {
      const Block ex = dx + side * (axis.x() - truth_x);
      const Block ey = dy + side * (axis.y() - truth_y);
      const Block distance = norm(ex, ey);
      const Block inverse = distance.max(kTinyM).inverse();
      const Eigen::Vector2d direction((ex * inverse).sum(), (ey * inverse).sum());
      sums.distance += distance.sum();
      sums.d_t += direction;
      d_axis += side * direction;
    };
    for (const double side : {1.0, -1.0}) {
      add_point(u, ux, uy, side, sums.d_u);
      add_point(v, vx, vy, side, sums.d_v);
    }
  }

  static Block norm(const Block& x, const Block& y) { return (x.square() + y.square()).sqrt(); }

  static constexpr double kTinyM = 1e-12;

  DetectionLoss loss_;
  Eigen::ArrayXd x_, y_, ux_, uy_, vx_, vy_;
};

/// A local minimum near `start` (Broyden, Fletcher, Goldfarb and Shanno), and its value.
std::pair<Eigen::VectorXd, double> minimize(const ExpectedDistance& f, const Eigen::VectorXd& start) {
  constexpr int kMaxIterations = 60;
  constexpr double kFirstStepM = 0.02;
  constexpr double kToleranceM = 1e-8;
  Eigen::VectorXd x = start;
  Eigen::VectorXd gradient;
  double value = f(x, gradient);
  Eigen::MatrixXd H_inverse =
      kFirstStepM / std::max(gradient.norm(), 1e-9) * Eigen::MatrixXd::Identity(x.size(), x.size());
  for (int i = 0; i < kMaxIterations; ++i) {
    Eigen::VectorXd step = -H_inverse * gradient;
    if (step.dot(gradient) >= 0.0) break;
    Eigen::VectorXd next_gradient;
    double next = f(x + step, next_gradient);
    for (int halvings = 0; next > value + 1e-4 * step.dot(gradient) && halvings < 20; ++halvings) {
      step *= 0.5;
      next = f(x + step, next_gradient);
    }
    if (next >= value) break;
    const double gain = value - next;
    const Eigen::VectorXd change = next_gradient - gradient;
    const double curvature = step.dot(change);
    x += step;
    value = next;
    gradient = next_gradient;
    if (gain < kToleranceM) break;
    if (curvature > 0.0) {
      const Eigen::MatrixXd I = Eigen::MatrixXd::Identity(x.size(), x.size());
      const Eigen::MatrixXd V = I - change * step.transpose() / curvature;
      H_inverse = (V.transpose() * H_inverse * V + step * step.transpose() / curvature).eval();
    }
  }
  return {x, value};
}

Ellipse mean_of(const std::vector<Ellipse>& ellipses) {
  Vector5d mean = Vector5d::Zero();
  for (const Ellipse& ellipse : ellipses) mean += smooth_parameters(ellipse) / static_cast<double>(ellipses.size());
  return ellipse_from_smooth_parameters(mean);
}

}  // namespace

double loss_of(DetectionLoss loss, const Ellipse& estimate, const Ellipse& truth) {
  switch (loss) {
    case DetectionLoss::kSymmetric:
      return symmetric_characteristic_distance(estimate, truth);
    case DetectionLoss::kCircleSquared:
      return (estimate.center_m - truth.center_m).squaredNorm() + std::pow(estimate.rx_m - truth.rx_m, 2);
    case DetectionLoss::kOrdered:
    case DetectionLoss::kCircle:
      break;
  }
  return characteristic_distance(estimate, truth);
}

double expected_loss(DetectionLoss loss, const Ellipse& estimate, const std::vector<Ellipse>& truths) {
  if (truths.empty()) throw std::invalid_argument("truths: none");
  double sum = 0.0;
  for (const Ellipse& truth : truths) sum += loss_of(loss, estimate, truth);
  return sum / static_cast<double>(truths.size());
}

Ellipse bayes_estimate(DetectionLoss loss, const std::vector<Ellipse>& truths) {
  if (truths.empty()) throw std::invalid_argument("truths: none");
  const Ellipse mean = mean_of(truths);
  if (loss == DetectionLoss::kCircleSquared) return mean;

  // Candidates: the mean, the rotated mean, and some of the truths. Screened by few truths, the best are improved by
  // more of them, and the best of those by all.
  constexpr int kTurns = 8;
  constexpr std::size_t kDrawsTried = 16;
  constexpr std::size_t kScreeningTruths = 256;
  constexpr std::size_t kCoarseTruths = 1024;
  constexpr std::size_t kImproved = 4;
  const auto stride_for = [&](std::size_t n) { return std::max<std::size_t>(1, truths.size() / n); };
  std::vector<Ellipse> candidates = {mean};
  if (!is_of_circles(loss)) {
    for (int i = 0; i < kTurns; ++i) {
      Ellipse turned = mean;
      turned.psi_rad = kPi * (static_cast<double>(i) / (kTurns - 1) - 0.5);
      candidates.push_back(turned);
    }
    const std::size_t stride = stride_for(kDrawsTried);
    for (std::size_t i = stride / 2; i < truths.size(); i += stride) candidates.push_back(truths[i]);
  }
  const ExpectedDistance screen(loss, truths, stride_for(kScreeningTruths));
  std::vector<std::pair<double, std::size_t>> order;
  Eigen::VectorXd gradient;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    order.emplace_back(screen(screen.parameters(candidates[i]), gradient), i);
  }
  std::sort(order.begin(), order.end());
  const ExpectedDistance coarse(loss, truths, stride_for(kCoarseTruths));
  std::pair<Eigen::VectorXd, double> best{coarse.parameters(mean), std::numeric_limits<double>::infinity()};
  for (std::size_t i = 0; i < std::min(kImproved, order.size()); ++i) {
    const auto improved = minimize(coarse, coarse.parameters(candidates[order[i].second]));
    if (improved.second < best.second) best = improved;
  }
  const ExpectedDistance all(loss, truths, 1);
  return all.ellipse(minimize(all, best.first).first);
}

}  // namespace situation_awareness

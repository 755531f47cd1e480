// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "situation_awareness/common/params.hpp"
#include "situation_awareness/geometry/simplify.hpp"
#include "situation_awareness/map/splinegons/splinegons.hpp"

namespace situation_awareness {

/// A place of a boundary, known across it.
struct SplinegonElement {
  Eigen::Vector2d p_world_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d normal_world = Eigen::Vector2d::UnitX();  ///< unit, toward the free side
  double variance_m2 = 0.0;                                 ///< across, above zero, independent of other elements'
};

struct SplinegonFitParams {
  int vertices = 16;

  template <class Self, class Visit>
  static void fields(Self& self, Visit&& visit) {
    visit("vertices", self.vertices, Bounds{4, 64}, "",
          "main vertices of a boundary, a joint between any two: more where these do not follow it, fewer where there "
          "are "
          "not three elements for each");
  }

  /// Throws std::invalid_argument naming field and bound.
  void validate() const;
};

/// How well a boundary's elements were met.
struct SplinegonFitQuality {
  double chi2_per_freedom = 0.0;  ///< 1 if the elements' variances and the model are right
  int iterations = 0;
  int as_polygon = 0;  ///< biarcs that do not follow the elements, where the polygon of these is given
  bool warm = false;   ///< began with the fit before
};

/// Fits splinegons to ordered elements of boundaries: the weighted least squares chain of biarcs, with Huber's loss,
/// over places and tangents of the main vertices; those are placed where the curvature changes, and there are as many
/// as it takes to follow the elements. Where arcs do not, it has the corners of the elements' polygon. Standard
/// deviations include what arcs do not follow (docs/math/splinegons.md). Its time is linear in the number of elements.
/// The same input gives the same output. It keeps its memory: no allocation after warm-up.
class SplinegonFit {
 public:
  /// Throws std::invalid_argument naming field and bound.
  explicit SplinegonFit(const SplinegonFitParams& params);

  /// Fits the elements, in order and counter-clockwise around the obstacle, some 0.05 to 0.5 m apart; there may be
  /// gaps. `common_variance_m2` is that of an error that all elements share, across the boundary. `vertices` holds an
  /// earlier fit of this boundary, from which a fit begins if it still holds, or nothing; it is overwritten with the
  /// new one as Splinegon has it. With fewer than 6 elements, or if they extend over less than 0.2 m, it is empty
  /// afterwards. Without `follow_tips` two neighbours that are off are left out as outliers are: where elements are in
  /// disorder the boundary would cross itself.
  SplinegonFitQuality fit(const std::vector<SplinegonElement>& elements, bool closed, double common_variance_m2,
                          std::vector<SplinegonVertex>& vertices, bool follow_tips = true);

  /// The polygon of the elements instead, as a splinegon of straight arcs, simplified by 2 cm, which its standard
  /// deviations include. It is empty of fewer than 3 places.
  void fit_polygon(const std::vector<SplinegonElement>& elements, bool closed, double common_variance_m2,
                   std::vector<SplinegonVertex>& vertices);

 private:
  using Vector6d = Eigen::Matrix<double, 6, 1>;
  using Matrix6d = Eigen::Matrix<double, 6, 6>;

  /// A main vertex. At a corner two tangents.
  struct Node {
    Eigen::Vector2d p_m;
    double yaw_in_rad, yaw_out_rad;
    bool corner;
    Eigen::Vector2d found_m;  ///< of a corner: where it was found
  };
  /// Half of a biarc, by the node that it is at.
  struct ArcOfNode {
    Eigen::Vector2d p_m, along;  ///< of the node, and its tangent there
    double curvature_1pm;
    Vector6d curvature_slope;  ///< by x, y, yaw of the node before, and of the one after
    Eigen::Vector2d begin_m;
    Eigen::Vector2d begin_along;  ///< of the boundary there, at a corner in the middle of both tangents
    double begin_yaw_rad, length_m;
  };
  /// Elements on both sides of boundary without any.
  struct Gap {
    std::size_t last, next;
  };
  struct Corner {
    double s_m;  ///< along the polygon of the elements
    Eigen::Vector2d p_m;
    double yaw_in_rad, yaw_out_rad, score;
    double window_m;  ///< in which it was found
  };
  struct LineSums;
  struct CornerSide;
  struct Residual {
    double distance_m;
    Vector6d slope;  ///< by x, y, yaw of the node before, and of the one after
  };
  /// Normal equations of a biarc's elements.
  struct Sums {
    Matrix6d H;
    Vector6d g;
    std::size_t elements;
  };
  /// Of the elements of a biarc.
  struct Residuals {
    double products = 0.0;  ///< of neighbours, in standard deviations
    double pair_m = 0.0;    ///< by how much two neighbours are off at most that noise does not explain
    double elements = 0.0, weights = 0.0, squares_m2 = 0.0;
    std::size_t first = 0, last = 0;
  };
  /// Elements in a row.
  struct Run {
    std::size_t first = 0, elements = 0;
  };
  struct PolygonCorner {
    Eigen::Vector2d p_m;
    double sigma_m;
  };
  /// The lower half of a symmetric matrix that is zero farther than `below` from its diagonal.
  class BandMatrix {
   public:
    BandMatrix() = default;
    BandMatrix(const BandMatrix&) = default;
    BandMatrix& operator=(const BandMatrix& other);
    void reset(Eigen::Index size, Eigen::Index below);
    void swap(BandMatrix& other);
    /// row >= column
    double& operator()(Eigen::Index row, Eigen::Index column) { return entries_(column * below_ + row); }
    const double& operator()(Eigen::Index row, Eigen::Index column) const { return entries_(column * below_ + row); }
    void scale_diagonal(double factor);
    /// Overwrites it with its Cholesky factor, which the others are of.
    void factorize();
    void solve(Eigen::VectorXd& b) const;
    /// The entries of the inverse within the band (Takahashi et al., 1973).
    void invert(BandMatrix& inverse) const;

   private:
    Eigen::Index resize(Eigen::Index size, Eigen::Index below);

    Eigen::Index size_ = 0, below_ = 0;
    Eigen::VectorXd entries_;
  };
  static constexpr std::size_t kNoCorner = static_cast<std::size_t>(-1);
  /// A place along the boundary for a node.
  struct Station {
    double s_m;
    std::size_t corner;  ///< index of what is there, or kNoCorner
  };
  /// The boundary between corners.
  struct Piece {
    Station begin;
    double end_s_m, amount;
    std::size_t intervals;
  };
  /// Unknowns of a node: along, across, yaw, at a corner the second yaw.
  struct Unknowns {
    Eigen::Index first;
    Eigen::Vector2d along;
  };

  std::size_t biarcs() const { return closed_ ? nodes_.size() : nodes_.size() - 1; }
  std::size_t next_node(std::size_t k) const { return k + 1 < nodes_.size() ? k + 1 : 0; }
  bool is_smooth(std::size_t arc) const;

  bool take(const std::vector<SplinegonElement>& elements);
  std::size_t wanted_nodes() const;
  void find_corners();
  double way_m(std::size_t from, std::size_t to) const;
  static bool is_surely_less(const LineSums& from, const Eigen::Vector2d& from_way_m, const LineSums& to,
                             const Eigen::Vector2d& to_way_m, double tan_angle);
  bool corner_after(std::size_t last, Corner& corner) const;
  bool corner_between(std::size_t last, double window_m, const CornerSide& left_side, const CornerSide& right_side,
                      Corner& corner) const;
  bool is_arc(std::size_t begin, std::size_t end) const;
  void find_arcs();
  void share_out(std::size_t count, double from_s, double to_s);
  void place_on_elements();
  bool place_on_earlier(const std::vector<SplinegonVertex>& vertices);
  std::size_t element_after(const Corner& corner) const;
  void add_missing_corners();
  void place_again();
  double way_to_foot_m(const Eigen::Vector2d& p_m, std::size_t index) const;
  void measure();
  void keep_stations();
  void share_out_again();
  void place_at_stations();
  void sum_residuals();
  static bool is_misfit(const Residuals& sums);
  bool part_misfits();
  void thin_out_gaps();
  void compute_arcs();
  void assign_by_stations(const std::vector<double>& at_m, double whole_m);
  bool assign_nearest();
  void assign_stepwise();
  void expect_jumps(bool first);
  Residual residual_of(const Eigen::Vector2d& p_m, std::size_t index) const;
  void compute_residuals();
  bool is_one_arc(std::size_t begin, std::size_t arcs) const;
  Eigen::Index unknowns_at(std::size_t k) const { return nodes_[k].corner ? 4 : 3; }
  std::array<Eigen::Index, 6> unknowns_of_biarc(std::size_t biarc, Matrix6d& J) const;
  void add_to_row(const Vector6d& slope, std::size_t biarc);
  void add_sums(std::size_t biarc);
  double straighten(std::size_t biarc);
  void add_jump(std::size_t before, std::size_t after, double jump, double weight);
  double build();
  void swap_with_before();
  void hold(BandMatrix& H) const;
  void keep_order();
  int iterate(int most);
  double chi2_per_freedom() const;
  double correlation_factor() const;
  void measure_gaps();
  void find_polygons();
  void spread_polygons();
  std::size_t first_element(std::size_t biarc) const;
  Run elements_of(std::size_t biarc, std::size_t count) const;
  Eigen::Vector2d begin_of(std::size_t biarc) const;
  Eigen::Vector2d end_of(std::size_t biarc) const;
  bool cut_beside_polygons();
  void append_corners(bool is_end, bool is_whole, double common_variance_m2, std::vector<SplinegonVertex>& vertices);
  void remove_if_degenerate(std::vector<SplinegonVertex>& vertices) const;
  void add_polygon(std::size_t biarc, std::size_t count, double common_variance_m2,
                   std::vector<SplinegonVertex>& vertices);
  void write(double common_variance_m2, double scale, std::vector<SplinegonVertex>& vertices);

  SplinegonFitParams params_;
  double tan_of_straight_;  ///< of the turn of two lines below which there is no corner
  bool closed_ = false, follow_tips_ = true;
  Eigen::Vector2d origin_m_ = Eigen::Vector2d::Zero();
  // Of the elements; places are relative to the origin.
  std::vector<Eigen::Vector2d> points_m_, normals_;
  std::vector<double> weights_;  ///< one over their standard deviations
  std::vector<double> s_m_;      ///< along the polygon of the elements
  double perimeter_m_ = 0.0;     ///< of that polygon
  double raised_ = 1.0;          ///< factor of the standard deviations
  std::vector<Gap> gaps_;
  std::vector<double> scratch_;
  std::vector<std::size_t> arc_of_, arc_of_before_;
  std::vector<double> element_s_m_;  ///< along the curve
  std::vector<Corner> candidates_, corners_;
  std::vector<std::size_t> by_score_, missing_;

  std::vector<Node> nodes_, nodes_before_;
  std::vector<ArcOfNode> arcs_;     ///< two of each biarc
  std::vector<double> jump_sigma_;  ///< expected jump of the curvature at the begin of each arc, 1/m
  double parameters_ = 0.0;         ///< that the elements determine
  std::vector<Station> stations_, arc_ends_;
  std::vector<std::size_t> first_of_, last_of_;  ///< elements of each arc
  std::vector<Residuals> residuals_;
  Simplification simplification_;
  std::vector<std::size_t> kept_;
  std::vector<bool> is_polygon_;  ///< of biarcs
  std::vector<double> cut_m_;     ///< of each arc, beside a polygon: at a biarc's begin or end
  std::vector<PolygonCorner> corners_m_;
  std::vector<double> gap_m_;  ///< the largest gap of each biarc
  std::vector<Piece> pieces_;
  std::vector<double> cell_s_m_, arc_s_m_, share_, slope_;  ///< what main vertices are placed by
  std::vector<double> share_before_;                        ///< of the cells before each, in sum

  std::vector<Unknowns> unknowns_of_;
  Eigen::Index unknowns_ = 0;
  std::vector<Sums> sums_;
  BandMatrix H_, H_factor_, covariance_;
  Eigen::VectorXd g_, delta_, row_;
  std::vector<Residual> of_elements_;  ///< as the arcs are
  /// Equations, arcs and residuals before a step, which are swapped back if the step makes the fit worse.
  BandMatrix H_before_;
  Eigen::VectorXd g_before_;
  std::vector<Unknowns> unknowns_of_before_;
  std::vector<ArcOfNode> arcs_before_;
  std::vector<Residual> of_elements_before_;
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "biarc_chain.hpp"
#include "biarc_residuals.hpp"
#include "boundary_corners.hpp"
#include "boundary_elements.hpp"
#include "stations.hpp"

namespace situation_awareness {

/// Places the main vertices of a chain of biarcs along a boundary.
class MainVertices {
 public:
  /// `most`: main vertices of a boundary that no misfit asks for more of.
  MainVertices(std::size_t most, const BoundaryElements& elements, const std::vector<BoundaryCorner>& corners,
               BiarcChain& chain)
      : most_(most), elements_(elements), corners_(corners), chain_(chain) {}

  /// The number of nodes of a boundary of which no misfit asks for more.
  std::size_t wanted_nodes() const;

  /// The first placing: nodes evenly along the polygon of the elements, or, where those are too few, where arcs end.
  void place_on_elements();
  /// Begins with an earlier fit; false if it is not of this boundary as it is now.
  bool place_on_earlier(const std::vector<SplinegonVertex>& vertices);
  /// Places the nodes anew on the fitted curve, each biarc with the same share of the third root of the curvature's
  /// slope: its distance from a curve is proportional to slope and length^3.
  void place_again();
  /// Parts the biarcs that do not follow the boundary and have elements for it; whether there are any.
  bool part_misfits();

 private:
  std::size_t element_after(const BoundaryCorner& corner) const;
  void add_missing_corners();
  void measure();
  void keep_stations();
  void share_out_again();
  void thin_out_gaps();
  void place_at_stations();
  void assign_by_stations(const std::vector<double>& at_m, double whole_m);

  std::size_t most_;
  const BoundaryElements& elements_;
  const std::vector<BoundaryCorner>& corners_;
  BiarcChain& chain_;
  std::vector<Station> stations_, arc_ends_;
  StationShares shares_;
  std::vector<double> arc_s_m_;      ///< begins of the arcs, and the end of the last
  std::vector<double> element_s_m_;  ///< along the curve
  std::vector<double> slope_;        ///< of the curvature, as the nodes are placed by it
  std::vector<std::size_t> missing_;
  std::vector<BiarcChain::Node> nodes_before_;
  std::vector<BiarcResiduals> residuals_;
};

}  // namespace situation_awareness

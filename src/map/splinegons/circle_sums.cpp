// SPDX-License-Identifier: BSD-3-Clause
#include "circle_sums.hpp"

#include <Eigen/Cholesky>

namespace situation_awareness {

Eigen::Vector3d CircleSums::solve() const { return A.ldlt().solve(rhs); }

}  // namespace situation_awareness

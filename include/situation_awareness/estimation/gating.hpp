// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace situation_awareness {

/// Quantile of the chi-square distribution with `degrees_of_freedom` at a probability in (0, 1).
double chi_square_quantile(double probability, double degrees_of_freedom);

}  // namespace situation_awareness

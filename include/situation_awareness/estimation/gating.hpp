// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace situation_awareness {

/// The value that a chi-square variable with `degrees_of_freedom` stays below with the given probability in (0, 1).
double chi_square_quantile(double probability, double degrees_of_freedom);

}  // namespace situation_awareness

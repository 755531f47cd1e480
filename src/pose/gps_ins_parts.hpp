// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// Common to the sources of GpsIns.
namespace situation_awareness {

/// Yaws that are tried at the start, and the standard deviation of each: a third more than that of its part of the
/// turn. In a steady turn the yaw cannot be told from biases of gyroscopes and accelerometers. One filter does not know
/// that, as it is linear about its own yaw, and gets certain of one that is near where it began; of so many, neighbours
/// get certain of different ones, and their likelihoods say how likely the biases are that each of them needs.
constexpr int kYaws = 32;
/// s. Before the first fix that is used, in which roll and pitch are seen.
constexpr double kLevelWindow_s = 1.0;

inline constexpr const char* kNoYaw = "yaw is not known yet: turn or change speed";

}  // namespace situation_awareness

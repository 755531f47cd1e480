// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace situation_awareness {

/// Folder of this package with cfg/ and models/: by ROS_PACKAGE_PATH, else beside the running program where that is
/// installed. Throws std::runtime_error if neither exists.
std::string package_folder();

}  // namespace situation_awareness

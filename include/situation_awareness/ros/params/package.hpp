// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace situation_awareness {

/// Folder of this package with cfg/ and models/: what ROS_PACKAGE_PATH says, else beside the running program where that
/// is installed. Throws std::runtime_error if it is neither.
std::string package_folder();

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>

namespace situation_awareness {

/// The height (m) of a surface such as the sea's above the ellipsoid of WGS 84.
using HeightAboveEllipsoid = std::function<double(double latitude_deg, double longitude_deg)>;

/// That of a geoid, "egm96" or "egm2008", by GeographicLib's grid of it or PROJ's; empty if neither is installed.
HeightAboveEllipsoid find_geoid(const std::string& name);

}  // namespace situation_awareness

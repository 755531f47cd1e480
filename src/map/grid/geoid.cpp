// SPDX-License-Identifier: BSD-3-Clause
#include "geoid.hpp"

#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <vector>

#include <ogr_srs_api.h>
#include <GeographicLib/Geoid.hpp>

namespace situation_awareness {
namespace {

HeightAboveEllipsoid by_geographiclib(const std::vector<const char*>& grids) {
  for (const char* const grid : grids) {
    try {
      auto geoid = std::make_shared<GeographicLib::Geoid>(grid);
      return [geoid](double latitude_deg, double longitude_deg) { return (*geoid)(latitude_deg, longitude_deg); };
    } catch (const std::exception&) {  // it is not installed
    }
  }
  return {};
}

// Between CRSs, PROJ returns heights unchanged where it lacks the grid, and says nothing. A pipeline that names the
// grid cannot be made without.
HeightAboveEllipsoid by_proj(const std::string& grid) {
  OGRSpatialReferenceH degrees = OSRNewSpatialReference(nullptr);
  OGRCoordinateTransformationH transformation = nullptr;
  if (OSRSetFromUserInput(degrees, "+proj=longlat +datum=WGS84") == OGRERR_NONE) {
    const std::string pipeline =
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=vgridshift +multiplier=1 +grids=" +
        grid + " +step +proj=unitconvert +xy_in=rad +xy_out=deg";
    OGRCoordinateTransformationOptionsH options = OCTNewCoordinateTransformationOptions();
    OCTCoordinateTransformationOptionsSetOperation(options, pipeline.c_str(), FALSE);
    transformation = OCTNewCoordinateTransformationEx(degrees, degrees, options);
    OCTDestroyCoordinateTransformationOptions(options);
  }
  OSRDestroySpatialReference(degrees);
  if (transformation == nullptr) return {};
  const std::shared_ptr<void> made(transformation, OCTDestroyCoordinateTransformation);
  return [made](double latitude_deg, double longitude_deg) {
    double height_m = 0.0;
    const bool is_known = OCTTransform(made.get(), 1, &longitude_deg, &latitude_deg, &height_m) != 0;
    return is_known ? height_m : std::numeric_limits<double>::quiet_NaN();
  };
}

}  // namespace

HeightAboveEllipsoid find_geoid(const std::string& name) {
  const bool is_old = name == "egm96";
  if (!is_old && name != "egm2008") throw std::invalid_argument(name + " is no geoid: egm96 or egm2008");
  const auto grids = is_old ? std::vector<const char*>{"egm96-5", "egm96-15"}
                            : std::vector<const char*>{"egm2008-1", "egm2008-2_5", "egm2008-5"};
  if (HeightAboveEllipsoid geoid = by_geographiclib(grids)) return geoid;
  return by_proj(is_old ? "us_nga_egm96_15.tif" : "us_nga_egm08_25.tif");
}

}  // namespace situation_awareness

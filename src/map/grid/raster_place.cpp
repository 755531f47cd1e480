// SPDX-License-Identifier: BSD-3-Clause
#include "raster_place.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <cpl_conv.h>
#include <ogr_srs_api.h>

#include "situation_awareness/common/format.hpp"

namespace situation_awareness {
namespace {

constexpr double kEarth_m = 6.4e6;
constexpr int kSides = 16;            ///< parts of an edge whose ends are looked at
constexpr double kLeastPixel = 1e-3;  ///< of a raster in metres

using Srs = std::shared_ptr<void>;
Srs owned(OGRSpatialReferenceH srs) { return {srs, OSRDestroySpatialReference}; }

/// The CRS of a raster; null if it has none, or one that says nothing of where on the Earth it is.
Srs srs_of(GDALDatasetH dataset) {
  OGRSpatialReferenceH const of_dataset = GDALGetSpatialRef(dataset);
  if (of_dataset == nullptr) return nullptr;
  Srs srs = owned(OSRClone(of_dataset));
  OSRSetAxisMappingStrategy(srs.get(), OAMS_TRADITIONAL_GIS_ORDER);
  return srs;
}

bool is_on_earth(const Srs& srs) {
  return srs && (OSRIsGeographic(srs.get()) != 0 || OSRIsDerivedGeographic(srs.get()) != 0 ||
                 OSRIsProjected(srs.get()) != 0 || OSRIsCompound(srs.get()) != 0);
}

std::string text_of(const char* text) { return text == nullptr ? "" : text; }

/// "WGS 84 / UTM zone 32N (EPSG:32632)"
std::string name_of(const Srs& srs) {
  const std::string authority = text_of(OSRGetAuthorityName(srs.get(), nullptr)),
                    code = text_of(OSRGetAuthorityCode(srs.get(), nullptr));
  return text_of(OSRGetName(srs.get())) + (code.empty() ? "" : " (" + authority + ":" + code + ")");
}

/// What a compound CRS says that its heights are above: egm96, egm2008, ellipsoid or the name of its vertical part;
/// empty if it is none.
std::string vertical_of(const Srs& srs) {
  if (!srs) return "";
  if (OSRIsCompound(srs.get()) == 0) {
    return OSRIsGeographic(srs.get()) != 0 && OSRGetAxesCount(srs.get()) == 3 ? "ellipsoid" : "";
  }
  const std::string code = text_of(OSRGetAuthorityCode(srs.get(), "VERT_CS")),
                    name = text_of(OSRGetAttrValue(srs.get(), "VERT_CS", 0));
  if (code == "5773" || name.find("EGM96") != std::string::npos) return "egm96";
  if (code == "3855" || name.find("EGM2008") != std::string::npos) return "egm2008";
  if (text_of(OSRGetAttrValue(srs.get(), "VERT_DATUM", 1)) == "2002") return "ellipsoid";  // GDAL's datum type of it
  return name.empty() ? "a vertical CRS without a name" : name;
}

}  // namespace

double crs_height_unit_m(GDALDatasetH dataset) {
  const Srs srs = srs_of(dataset);
  if (!srs || OSRIsCompound(srs.get()) == 0) return 1.0;
  const double unit_m = OSRGetTargetLinearUnits(srs.get(), "VERT_CS", nullptr);
  return unit_m > 0.0 ? unit_m : 1.0;
}

/// From degrees to a CRS and back.
class RasterPlace::Crs {
 public:
  explicit Crs(Srs srs) : whole_(std::move(srs)), flat_(owned(OSRClone(whole_.get()))) {
    OSRDemoteTo2D(flat_.get(), nullptr);
    OSRSetAxisMappingStrategy(flat_.get(), OAMS_TRADITIONAL_GIS_ORDER);
    OSRSetFromUserInput(degrees_.get(), "EPSG:4326");
    OSRSetAxisMappingStrategy(degrees_.get(), OAMS_TRADITIONAL_GIS_ORDER);
    to_ = between(degrees_, flat_);
    from_ = between(flat_, degrees_);
    if (!to_ || !from_) throw std::invalid_argument("PROJ knows no way between its CRS, " + name() + ", and EPSG:4326");
  }

  std::string name() const { return name_of(whole_); }
  bool is_in_degrees() const { return OSRIsGeographic(flat_.get()) != 0 || OSRIsDerivedGeographic(flat_.get()) != 0; }
  bool is_in_metres() const {
    return !is_in_degrees() && std::abs(OSRGetLinearUnits(flat_.get(), nullptr) - 1.0) < 1e-9;
  }
  /// How far around the Earth is, in its unit of longitude.
  double turn() const { return 2.0 * M_PI / OSRGetAngularUnits(flat_.get(), nullptr); }

  /// (x, y) in the CRS of (longitude, latitude) in degrees.
  std::optional<Eigen::Vector2d> of(double longitude_deg, double latitude_deg) const {
    return transformed(to_, {longitude_deg, latitude_deg});
  }
  std::optional<Eigen::Vector2d> degrees_of(const Eigen::Vector2d& p) const { return transformed(from_, p); }

  /// The zero of its heights by PROJ; empty where they come out unchanged, as without the grid of its geoid.
  HeightAboveEllipsoid zero(double latitude_deg, double longitude_deg) const {
    const Srs geodetic = owned(OSRNewSpatialReference(nullptr));
    OSRSetFromUserInput(geodetic.get(), "EPSG:4979");
    OSRSetAxisMappingStrategy(geodetic.get(), OAMS_TRADITIONAL_GIS_ORDER);
    const std::shared_ptr<void> up = between(whole_, geodetic);
    if (!up) return {};
    const auto zero = [up, to = to_](double latitude, double longitude) {
      const auto p = transformed(to, {longitude, latitude});
      double x = p ? p->x() : 0.0, y = p ? p->y() : 0.0, height_m = 0.0;
      const bool is_known = p && OCTTransform(up.get(), 1, &x, &y, &height_m) != 0 && std::isfinite(height_m);
      return is_known ? height_m : std::numeric_limits<double>::quiet_NaN();
    };
    const double here_m = zero(latitude_deg, longitude_deg);
    if (!(std::abs(here_m) > 1e-6)) return {};
    return zero;
  }

 private:
  static std::shared_ptr<void> between(const Srs& from, const Srs& to) {
    OGRCoordinateTransformationH const made = OCTNewCoordinateTransformation(from.get(), to.get());
    return made == nullptr ? nullptr : std::shared_ptr<void>(made, OCTDestroyCoordinateTransformation);
  }
  static std::optional<Eigen::Vector2d> transformed(const std::shared_ptr<void>& by, Eigen::Vector2d p) {
    if (OCTTransform(by.get(), 1, &p.x(), &p.y(), nullptr) == 0 || !p.allFinite()) return std::nullopt;
    return p;
  }

  Srs whole_, flat_, degrees_ = owned(OSRNewSpatialReference(nullptr));
  std::shared_ptr<void> to_, from_;
};

RasterPlace::RasterPlace(GDALDatasetH dataset, const ElevationSource& source, double typical_m)
    : columns_(GDALGetRasterXSize(dataset)), rows_(GDALGetRasterYSize(dataset)) {
  if (GDALGetGeoTransform(dataset, transform_.data()) != CE_None) {
    throw std::invalid_argument("it has no geotransform");
  }
  const Srs srs = srs_of(dataset);
  if (is_on_earth(srs)) {
    crs_ = std::make_shared<const Crs>(srs);
  } else if (srs && OSRIsLocal(srs.get()) != 0) {
    for (double& number : transform_) number *= OSRGetLinearUnits(srs.get(), nullptr);
  } else if (srs && OSRIsGeocentric(srs.get()) != 0) {
    throw std::invalid_argument("its CRS, " + name_of(srs) + ", is geocentric");
  }
  const bool is_finite = std::all_of(transform_.begin(), transform_.end(), [](double v) { return std::isfinite(v); });
  if (!is_finite || GDALInvGeoTransform(transform_.data(), inverse_.data()) == 0) {
    throw std::invalid_argument("its geotransform has no area");
  }
  pixel_m_ = std::min(std::hypot(transform_[1], transform_[4]), std::hypot(transform_[2], transform_[5]));
  if (!crs_ && pixel_m_ < kLeastPixel) {
    throw std::invalid_argument(
        "its pixels are " + formatted("%g", pixel_m_) +
        " wide, and it has no CRS: if these are degrees, gdal_edit.py -a_srs EPSG:4326 says so");
  }
  if (crs_ && !source.origin) {
    const auto [x, y] = std::pair{0.5 * columns_, 0.5 * rows_};
    const auto at = crs_->degrees_of(
        {transform_[0] + x * transform_[1] + y * transform_[2], transform_[3] + x * transform_[4] + y * transform_[5]});
    remedy_ =
        "its CRS is " + crs_->name() + ", and the world has no origin: give that (origin, LAT,LON,ALT), or warp it";
    if (at) {
      remedy_ += ", as here to an origin in its middle: gdalwarp -r bilinear -t_srs '+proj=tmerc" +
                 formatted(" +lat_0=%.7f +lon_0=%.7f +datum=WGS84 +units=m' ", at->y(), at->x()) + source.path +
                 " warped.tif";
    }
    if (!crs_->is_in_metres()) throw std::invalid_argument(remedy_);
    crs_ = nullptr;  // its metres may be the world's
  } else if (crs_) {
    world_.emplace(source.origin->latitude_deg, source.origin->longitude_deg, source.origin->altitude_m);
  }
  std::string above = vertical_of(srs);
  const std::string driver = text_of(GDALGetDriverShortName(GDALGetDatasetDriver(dataset)));
  if (above.empty() && driver == "SRTMHGT") above = "egm96";  // those of the mission are
  set_vertical(source, above, typical_m);
  is_aligned_ = !world_ && transform_[2] == 0.0 && transform_[4] == 0.0 && transform_[1] > 0.0;
  set_extent();
}

void RasterPlace::set_vertical(const ElevationSource& source, const std::string& of_crs, double typical_m) {
  std::string above = source.vertical;
  if (!above.empty() && above != "egm96" && above != "egm2008" && above != "ellipsoid" && above != "local") {
    throw std::invalid_argument("dem_vertical must be egm96, egm2008, ellipsoid or local, not " + above);
  }
  if (!source.origin) {
    if (above.empty() || above == "local") return;
    throw std::invalid_argument("heights above " + above + " (dem_vertical) need the world's origin, LAT,LON,ALT");
  }
  origin_ = *source.origin;
  if (above.empty() && crs_) above = of_crs;
  const double here_m = std::isnan(typical_m) ? 0.0 : typical_m;
  if (above == "local" || (above.empty() && !crs_)) {
    ellipsoid_m_ = origin_.altitude_m + here_m;
    return;
  }
  if (!world_) world_.emplace(origin_.latitude_deg, origin_.longitude_deg, origin_.altitude_m);
  if (source.geoid_m != 0.0 && above != "ellipsoid" && !above.empty()) {
    zero_ = [geoid_m = source.geoid_m](double /*latitude_deg*/, double /*longitude_deg*/) { return geoid_m; };
  } else if (above.empty() || above == "ellipsoid") {
    zero_ = [](double /*latitude_deg*/, double /*longitude_deg*/) { return 0.0; };
  } else if (above == "egm96" || above == "egm2008") {
    zero_ = find_geoid(above);
  } else {
    zero_ = crs_->zero(origin_.latitude_deg, origin_.longitude_deg);
  }
  if (!zero_) {
    throw std::invalid_argument(
        "its heights are above the sea (" + above +
        "), and neither GeographicLib nor PROJ has a grid of how high that is: give it "
        "(dem_geoid_m), install one (geographiclib-get-geoids egm96-5 egm2008-5), or take the heights "
        "as above the ellipsoid (dem_vertical), and images tell what is missing");
  }
  if (above.empty()) {
    const HeightAboveEllipsoid sea = find_geoid("egm96");
    warning_ = "it does not say what its heights are above, and they are taken as above the ellipsoid (dem_vertical)";
    if (sea)
      warning_ +=
          formatted("; above the sea they would be %.0f m higher", sea(origin_.latitude_deg, origin_.longitude_deg));
  }
  ellipsoid_m_ = here_m + zero_(origin_.latitude_deg, origin_.longitude_deg);
  if (!std::isfinite(ellipsoid_m_)) throw std::invalid_argument("the geoid is not known at the world's origin");
}

RasterPoint RasterPlace::in_raster(const Eigen::Vector2d& p_world_m) const {
  Eigen::Vector2d p = p_world_m;
  double raised_m = 0.0;
  if (world_) {
    double z_m = ellipsoid_m_ - origin_.altitude_m - 0.5 * p.squaredNorm() / kEarth_m;
    double latitude_deg = 0.0, longitude_deg = 0.0, height_m = 0.0;
    for (int i = 0; i < 3; ++i) {
      world_->Reverse(p_world_m.x(), p_world_m.y(), z_m, latitude_deg, longitude_deg, height_m);
      z_m += ellipsoid_m_ - height_m;
    }
    if (zero_) raised_m = z_m - ellipsoid_m_ + zero_(latitude_deg, longitude_deg);
    if (crs_) {
      const auto there = crs_->of(longitude_deg, latitude_deg);
      if (!there) return RasterPoint::Constant(std::numeric_limits<double>::quiet_NaN());
      p = *there;
    }
  }
  RasterPoint at(inverse_[0] + p.x() * inverse_[1] + p.y() * inverse_[2],
                 inverse_[3] + p.x() * inverse_[4] + p.y() * inverse_[5], raised_m);
  if (crs_ && crs_->is_in_degrees()) {  // a raster may go around the Earth from any meridian
    const double turn = crs_->turn() * std::abs(inverse_[1]);
    if (turn > 1.0) at.x() -= turn * std::round((at.x() - 0.5 * columns_) / turn);
  }
  return at;
}

std::optional<Eigen::Vector2d> RasterPlace::in_world(const Eigen::Vector2d& p_raster) const {
  const Eigen::Vector2d p(transform_[0] + p_raster.x() * transform_[1] + p_raster.y() * transform_[2],
                          transform_[3] + p_raster.x() * transform_[4] + p_raster.y() * transform_[5]);
  if (!crs_) return p;
  const auto degrees = crs_->degrees_of(p);
  if (!degrees) return std::nullopt;
  Eigen::Vector3d at;
  world_->Forward(degrees->y(), degrees->x(), ellipsoid_m_, at.x(), at.y(), at.z());
  return at.head<2>();
}

void RasterPlace::set_extent() {
  for (int i = 0; i <= kSides; ++i) {
    for (int j = 0; j <= kSides; ++j) {
      const auto at = in_world({static_cast<double>(columns_) * i / kSides, static_cast<double>(rows_) * j / kSides});
      if (at) extent_world_m_.extend(*at);
    }
  }
  if (extent_world_m_.isEmpty())
    throw std::invalid_argument("its coordinates are no places of its CRS, " + crs_->name());
  if (!crs_) return;
  const Eigen::Vector2d middle(0.5 * columns_, 0.5 * rows_);
  const auto here = in_world(middle), right = in_world(middle + Eigen::Vector2d(1.0, 0.0)),
             below = in_world(middle + Eigen::Vector2d(0.0, 1.0));
  if (!here || !right || !below) throw std::invalid_argument("its middle is no place of its CRS, " + crs_->name());
  pixel_m_ = std::min((*right - *here).norm(), (*below - *here).norm());
  if (!(pixel_m_ > 0.0)) throw std::invalid_argument("its pixels have no area in the world");
}

Eigen::AlignedBox2d RasterPlace::raster_box(const Eigen::AlignedBox2d& box_world_m) const {
  constexpr double kBeside = 2.0, kBent = 0.01;  // pixels, and of what is bent between the places looked at
  Eigen::AlignedBox2d box;
  for (int i = 0; i <= kSides; ++i) {
    for (int j = 0; j <= kSides; ++j) {
      const Eigen::Vector2d part(static_cast<double>(i) / kSides, static_cast<double>(j) / kSides);
      const RasterPoint at = in_raster(box_world_m.min() + part.cwiseProduct(box_world_m.sizes()));
      if (at.allFinite()) box.extend(Eigen::Vector2d(at.head<2>()));
    }
  }
  if (box.isEmpty()) return box;
  const Eigen::Vector2d beside = kBent * box.sizes() + Eigen::Vector2d::Constant(kBeside);
  return {box.min() - beside, box.max() + beside};
}

}  // namespace situation_awareness

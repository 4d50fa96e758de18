#include "host_tools/gdal_support.hpp"

#include <mutex>

#include <cpl_error.h>
#include <gdal.h>
#include <ogr_srs_api.h>

namespace leadline::host {

void DestroySystem::operator()(void* system) const { OSRDestroySpatialReference(system); }

void DestroyTransform::operator()(void* transform) const {
  OCTDestroyCoordinateTransformation(transform);
}

QuietGdal::QuietGdal() {
  static std::once_flag once;
  std::call_once(once, [] { GDALAllRegister(); });
  CPLErrorReset();
  CPLPushErrorHandler(CPLQuietErrorHandler);
}

QuietGdal::~QuietGdal() { CPLPopErrorHandler(); }

std::string QuietGdal::reason() {
  const std::string text = CPLGetLastErrorMsg();
  return text.empty() ? text : ": " + text;
}

}  // namespace leadline::host

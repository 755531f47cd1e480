// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include <cpl_error.h>
#include <gdal.h>

namespace situation_awareness {

struct CloseDataset {
  void operator()(void* dataset) const { GDALClose(dataset); }
};
using Dataset = std::unique_ptr<void, CloseDataset>;

/// GDAL's messages go into the errors that are thrown, instead of stderr.
struct QuietGdal {
  QuietGdal() {
    GDALAllRegister();
    CPLPushErrorHandler(CPLQuietErrorHandler);
    CPLErrorReset();
  }
  QuietGdal(const QuietGdal&) = delete;
  QuietGdal& operator=(const QuietGdal&) = delete;
  ~QuietGdal() { CPLPopErrorHandler(); }
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <exception>

#include <nodelet/nodelet.h>

namespace situation_awareness {

/// A nodelet that refuses to start with one sentence where `start` throws; its manager and the others live on.
class StageNodelet : public nodelet::Nodelet {
 private:
  virtual void start() = 0;

  void onInit() final {
    try {
      start();
    } catch (const std::exception& error) {
      NODELET_FATAL_STREAM(getName() << " does not start: " << error.what());
      throw;  // the manager drops this nodelet
    }
  }
};

}  // namespace situation_awareness

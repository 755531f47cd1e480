// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <set>
#include <string>

#include "situation_awareness/pipeline/localization_pipeline.hpp"
#include "situation_awareness/pose/reflector_localization.hpp"
#include "situation_awareness/ros/stage_diagnostics.hpp"

namespace situation_awareness {

/// A sentence on each reflector that is not where the map says, and how far from there it stands, by its index in the
/// file.
std::string missing_sentence(const ReflectorMap& map, int reflector);
std::string moved_sentence(const ReflectorMap& map, const MovedReflector& moved);

/// A sentence on a lack of reflectors, and what it does to the standard deviation of the position.
std::string too_few_sentence(const ReflectorCoverage& coverage, double sigma_m);

/// What localisation by reflectors says on /diagnostics and in the log.
class ReflectorReport {
 public:
  /// `name`: of the nodelet; `pipeline` must outlive this.
  ReflectorReport(const std::string& name, const LocalizationPipeline& pipeline)
      : name_(name), pipeline_(pipeline), localization_(pipeline.localization()) {}

  /// After a scan: warns in the log of a reflector when it is found not to be in its place, and says when it is again.
  void add(const ReflectorUpdate& update);

  void report(StageDiagnostics::Status& status);

 private:
  void log_changes(const ReflectorUpdate& update);

  std::string name_;
  const LocalizationPipeline& pipeline_;
  const ReflectorLocalization& localization_;
  ReflectorUpdate latest_;
  bool has_update_ = false;
  std::set<int> missing_, moved_;
};

}  // namespace situation_awareness

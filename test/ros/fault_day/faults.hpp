// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "feed.hpp"

namespace situation_awareness {

/// Expected ids after the fault.
enum class Ids {
  kKept,     ///< each object has the id after the fault that it had before
  kFree,     ///< what scans say is gone may get a new id
  kNew,      ///< a new map, with ids not used before
  kRestart,  ///< a new process: a new map, with ids from 1
};

/// Result of an injection.
struct Injected {
  std::string wrong;                    ///< that could be seen at once
  std::optional<double> down_s;         ///< for how long no map came, where something died, in wall time
  std::optional<std::int64_t> from_ns;  ///< stamp from which on the map must come back; else that of the latest scan
};

/// One kind of fault, injected into a running feed.
struct Fault {
  std::string name;
  std::string how;   ///< what is done
  std::string must;  ///< what must happen, beside the map being back
  Ids ids = Ids::kKept;
  bool death = false;  ///< of a process or a stage: late in a day only
  std::function<Injected(Feed& feed)> inject;
  bool in_day = true;  ///< else only by its name
};

std::vector<Fault> all_faults();

}  // namespace situation_awareness

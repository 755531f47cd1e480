// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace situation_awareness {

/// A cell of a table of docs/reliability.md, filled by the test in whose scope it stands: what `stage` does where a
/// fault is in one of its inputs. Where the environment's SITUATION_AWARENESS_FAULTS names a file, a line of JSON is
/// added to it when the scope ends, with the test's name and whether it has no failure until then.
///
///     const FaultCell cell("safety_areas", "scan", "stopped", "no verdict, the vehicle stands after .5 s");
class FaultCell {
 public:
  FaultCell(std::string stage, std::string input, std::string fault, std::string does);
  FaultCell(const FaultCell&) = delete;
  FaultCell& operator=(const FaultCell&) = delete;
  ~FaultCell();

 private:
  std::string stage_, input_, fault_, does_;
};

}  // namespace situation_awareness

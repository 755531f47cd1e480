// SPDX-License-Identifier: BSD-3-Clause
#include "support/fault_cell.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <utility>

#include <nlohmann/json.hpp>

namespace situation_awareness {

FaultCell::FaultCell(std::string stage, std::string input, std::string fault, std::string does)
    : stage_(std::move(stage)), input_(std::move(input)), fault_(std::move(fault)), does_(std::move(does)) {}

FaultCell::~FaultCell() {
  const char* path = std::getenv("SITUATION_AWARENESS_FAULTS");
  if (path == nullptr) return;
  const testing::TestInfo* test = testing::UnitTest::GetInstance()->current_test_info();
  const nlohmann::json line = {{"stage", stage_},
                               {"input", input_},
                               {"fault", fault_},
                               {"does", does_},
                               {"test", std::string(test->test_suite_name()) + "." + test->name()},
                               {"passed", !testing::Test::HasFailure()}};
  std::ofstream(path, std::ios::app) << line.dump() + "\n";
}

}  // namespace situation_awareness

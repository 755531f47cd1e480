// SPDX-License-Identifier: BSD-3-Clause
#include "support/refusal.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

namespace situation_awareness::refusal_test {
namespace {

const std::string kMessage = "/a/my.yaml: scan.max_range_m = -1 is outside [0, 1000] m, see 'ranges'.";

TEST(Refusal, NamesWholeFactsOnly) {
  for (const char* fact :
       {"/a/my.yaml", "scan.max_range_m", "-1", "0", "1000", "m", "ranges", "'ranges'", "[0, 1000]"}) {
    EXPECT_TRUE(has_fact(kMessage, fact)) << fact;
  }
  for (const char* part : {"/a/my", "my.yaml", "yaml", "max_range_m", "scan", "scan.max_range", "1", "100", "00",
                           "range", "max_range", ""}) {
    EXPECT_FALSE(has_fact(kMessage, part)) << part;
  }
  EXPECT_FALSE(has_fact("gain = 0.5", "0"));
  EXPECT_FALSE(has_fact("gain = 0.5", "5"));
  EXPECT_TRUE(has_fact("gain must be 0.5.", "0.5"));
  EXPECT_TRUE(has_fact("10 and 1", "1")) << "the second";
}

TEST(Refusal, HasAllFactsInOneLine) {
  EXPECT_TRUE(names(kMessage, {"scan.max_range_m", "-1"}));
  EXPECT_FALSE(names(kMessage, {"scan.max_range_m", "-2"}));
  EXPECT_FALSE(names(kMessage + '\n', {"-1"}));
  EXPECT_TRUE(names(kMessage, {}));
  EXPECT_FALSE(names("", {})) << "nothing was refused";
}

TEST(Refusal, IsTheMessageOfTheErrorThatIsAskedFor) {
  EXPECT_EQ(refusal_of([] { throw std::invalid_argument("a"); }), "a");
  EXPECT_EQ(refusal_of([] {}), "");
  EXPECT_EQ(refusal_of<std::runtime_error>([] { throw std::runtime_error("b"); }), "b");
  EXPECT_THROW(refusal_of([] { throw std::runtime_error("b"); }), std::runtime_error);
}

}  // namespace
}  // namespace situation_awareness::refusal_test

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/common/counters.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <string>

#include "situation_awareness/common/random.hpp"

namespace situation_awareness::counters_test {
namespace {

TEST(Counters, CountAsAMapDoes) {
  Random random(1);
  Counters counters;
  std::map<std::string, std::uint64_t> oracle;
  for (int i = 0; i < 20000; ++i) {
    if (random.uniform() < 0.01) {
      counters.reset();
      oracle.clear();
    }
    const std::string reason(static_cast<std::size_t>(random.uniform(1.0, 80.0)), random.uniform() < 0.5 ? 'a' : 'b');
    if (random.uniform() < 0.7) {
      const auto more = static_cast<std::uint64_t>(random.uniform(0.0, 5.0));
      counters[reason] += more;
      oracle[reason] += more;
    }
    ASSERT_EQ(counters.of(reason), oracle.count(reason) != 0 ? oracle.at(reason) : 0U);
    ASSERT_EQ(counters.size(), oracle.size());
    ASSERT_EQ(counters.empty(), oracle.empty());
    auto expected = oracle.begin();
    for (const auto& [text, count] : counters) {
      ASSERT_EQ(text, expected->first);
      ASSERT_EQ(count, expected->second);
      ++expected;
    }
  }
}

TEST(Counters, AreEqualAfterAResetForAnyHistory) {
  Counters used{{"z", 3}, {"y", 2}};
  used.reset();
  EXPECT_EQ(used, Counters{});
  ++used["b"];
  used["a"] += 2;
  EXPECT_EQ(used, (Counters{{"a", 2}, {"b", 1}}));
  EXPECT_NE(used, (Counters{{"a", 1}, {"b", 1}}));
}

}  // namespace
}  // namespace situation_awareness::counters_test

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/common/stamp_order.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "situation_awareness/common/in_order.hpp"
#include "situation_awareness/common/random.hpp"

namespace situation_awareness::stamp_order_test {
namespace {

using Verdict = StampOrder::Verdict;

Verdict judge(StampOrder& order, double stamp_s) { return order.judge(nanoseconds(stamp_s)); }
/// The receipt is by another clock.
Verdict judge(StampOrder& order, double stamp_s, double received_s) {
  return order.judge(nanoseconds(stamp_s), nanoseconds(received_s) + 77);
}

/// A stream at a rate, until 100 s.
StampOrder after_stream(double period_s, bool has_receipts) {
  StampOrder order;
  for (int i = -StampOrder::kSteady; i <= 0; ++i) {
    const double stamp_s = 100.0 + i * period_s;
    EXPECT_EQ(has_receipts ? judge(order, stamp_s, stamp_s) : judge(order, stamp_s), Verdict::kNext);
  }
  return order;
}

TEST(StampOrder, DistinguishesALoopFromJitter) {
  StampOrder order;
  EXPECT_EQ(judge(order, 100.0), Verdict::kNext);
  EXPECT_EQ(judge(order, 100.1), Verdict::kNext);
  EXPECT_EQ(judge(order, 100.1), Verdict::kRefused) << "repeats";
  EXPECT_EQ(judge(order, 99.5), Verdict::kRefused) << "goes back a little";
  EXPECT_EQ(judge(order, 100.2), Verdict::kNext) << "what was refused is forgotten";
  EXPECT_EQ(judge(order, 5.0), Verdict::kRefused);
  EXPECT_EQ(order.doubted(), 1);
  EXPECT_EQ(judge(order, 5.1), Verdict::kRefused);
  EXPECT_EQ(order.latest_ns(), nanoseconds(100.2));
  EXPECT_EQ(judge(order, 5.2), Verdict::kRestart) << "three agree";
  EXPECT_TRUE(order.has_agreed());
  EXPECT_EQ(judge(order, 5.3), Verdict::kNext);
  EXPECT_FALSE(order.has_agreed());
}

TEST(StampOrder, ASingleStampIsRefusedWhateverItIs) {
  for (const double period_s : {0.001, 0.01, 0.05, 0.0775, 0.1}) {
    for (const double shift_s : {-3600.0, -5.0, -0.2, 0.2, 0.25, 2.0, 5.0, 3600.0}) {
      for (const bool has_receipts : {false, true}) {
        StampOrder order = after_stream(period_s, has_receipts);
        const double now_s = 100.0 + period_s;
        EXPECT_EQ(has_receipts ? judge(order, now_s + shift_s, now_s) : judge(order, now_s + shift_s),
                  Verdict::kRefused)
            << period_s << ' ' << shift_s;
        const double next_s = now_s + period_s;
        EXPECT_EQ(has_receipts ? judge(order, next_s, next_s) : judge(order, next_s), Verdict::kNext)
            << period_s << ' ' << shift_s;
        EXPECT_EQ(order.doubted(), 0);
      }
    }
  }
}

// Of a stream that is slower than the error, receipts tell what is ahead; what is late may have been under way.
TEST(StampOrder, OfASlowStreamReceiptsTell) {
  for (const double period_s : {0.2, 0.5, 1.0, 3.0}) {
    for (const double shift_s : {-3600.0, -5.0, 0.2, 2.0, 5.0, 3600.0}) {
      StampOrder order = after_stream(period_s, true);
      const double now_s = 100.0 + period_s;
      EXPECT_EQ(judge(order, now_s + shift_s, now_s), Verdict::kRefused) << period_s << ' ' << shift_s;
      EXPECT_EQ(judge(order, now_s + period_s, now_s + period_s), Verdict::kNext) << period_s << ' ' << shift_s;
    }
  }
  StampOrder order = after_stream(1.0, true);
  EXPECT_EQ(judge(order, 100.8, 101.0), Verdict::kNext) << "late";
  EXPECT_EQ(judge(order, 102.0, 102.0), Verdict::kNext) << "not late";
}

TEST(StampOrder, ASilenceThatReceiptsExplainIsNone) {
  StampOrder order = after_stream(0.05, true);
  EXPECT_EQ(judge(order, 130.0, 130.03), Verdict::kNext);
  EXPECT_EQ(judge(order, 130.05, 130.05), Verdict::kNext);
  EXPECT_EQ(judge(order, 130.3, 130.1), Verdict::kRefused) << "the silence is no period";
}

// As a recording that is played fast has it.
TEST(StampOrder, ASilenceThatNothingExplainsIsOneOnceThreeAgree) {
  StampOrder order = after_stream(0.05, false);
  EXPECT_EQ(judge(order, 130.0), Verdict::kRefused);
  EXPECT_EQ(judge(order, 130.05), Verdict::kRefused);
  EXPECT_EQ(judge(order, 130.1), Verdict::kNext);
  EXPECT_EQ(judge(order, 130.15), Verdict::kNext);
}

TEST(StampOrder, SeveralWrongStampsThatDisagreeAreNoJump) {
  StampOrder order = after_stream(0.05, false);
  for (const double wrong_s : {105.0, 90.0, 3700.0, 105.2, 60.0, 107.0}) {
    EXPECT_EQ(judge(order, wrong_s), Verdict::kRefused) << wrong_s;
  }
  EXPECT_EQ(judge(order, 100.05), Verdict::kNext);
  for (const double wrong_s : {105.0, 105.05}) EXPECT_EQ(judge(order, wrong_s), Verdict::kRefused);
  EXPECT_EQ(judge(order, 100.1), Verdict::kNext) << "one of the time before";
  EXPECT_EQ(judge(order, 105.1), Verdict::kRefused) << "the first again";
}

TEST(StampOrder, AnyPaceIsFollowed) {
  StampOrder order;
  Random random(3);
  double stamp_s = 0.0;
  int refused = 0;
  for (const double period_s : {0.05, 2.0, 0.01, 7.0, 0.1, 0.5, 30.0, 0.02}) {
    int refused_now = 0;
    for (int i = 0; i < 100; ++i) {
      stamp_s += period_s * random.uniform(0.8, 1.2);
      refused_now += judge(order, stamp_s) != Verdict::kNext;
    }
    EXPECT_LE(refused_now, 10) << period_s;
    refused += refused_now;
  }
  EXPECT_LT(refused, 40);
}

TEST(StampOrder, AFirstStampThatTheOthersContradictIsOutvoted) {
  for (const double first_s : {95.0, 105.0, 3700.0}) {
    StampOrder order;
    EXPECT_EQ(judge(order, first_s, 100.0), Verdict::kNext);
    EXPECT_EQ(judge(order, 100.05, 100.05), Verdict::kRefused);
    EXPECT_EQ(judge(order, 100.1, 100.1), Verdict::kRefused);
    EXPECT_EQ(judge(order, 100.15, 100.15), Verdict::kRestart);
  }
}

TEST(StampOrder, TrustsAnother) {
  StampOrder order;
  order.trust();
  for (const double stamp_s : {1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 40.0, 40.1}) {
    EXPECT_EQ(judge(order, stamp_s), Verdict::kNext);
  }
  EXPECT_EQ(judge(order, 40.0), Verdict::kRefused);
  EXPECT_EQ(judge(order, 5.0), Verdict::kRestart);
  order.reset();
  EXPECT_EQ(order.latest_ns(), StampOrder::kNone);
}

// Stamps of a driver may have any value; the difference of two stamps need not fit into a stamp.
TEST(StampOrder, OrdersAnyTwoStamps) {
  constexpr std::int64_t kFirst = std::numeric_limits<std::int64_t>::min() + 1;
  constexpr std::int64_t kLast = std::numeric_limits<std::int64_t>::max();
  EXPECT_NEAR(seconds_between(kFirst, kLast), 0x1.0p64 * 1e-9, 1e-3);
  EXPECT_NEAR(seconds_between(kLast, kFirst), -0x1.0p64 * 1e-9, 1e-3);
  EXPECT_EQ(seconds_between(kLast - 1, kLast), 1e-9) << "small differences of large stamps are exact";
  StampOrder order;
  EXPECT_EQ(order.judge(kLast), Verdict::kNext);
  EXPECT_EQ(order.judge(kFirst), Verdict::kRefused);
  EXPECT_EQ(order.judge(kFirst + 1), Verdict::kRefused);
  EXPECT_EQ(order.judge(kFirst + 2), Verdict::kRestart);
  EXPECT_EQ(order.judge(kLast), Verdict::kNext);
}

/// Messages that are their stamps in s; what became of each.
class InOrderTest : public ::testing::Test {
 protected:
  void add(double stamp_s, double now_s) {
    in_order_.add(
        stamp_s, nanoseconds(stamp_s), nanoseconds(now_s), nanoseconds(now_s),
        [this](double item_s, Verdict verdict) {
          passed_.push_back(item_s);
          restarts_ += verdict == Verdict::kRestart;
        },
        [this](bool was_held) { ++(was_held ? held_ : refused_); });
  }
  void stream(double from_s, int messages) {
    for (int i = 0; i < messages; ++i) add(from_s + 0.05 * i, from_s + 0.05 * i);
    passed_.clear();
  }

  using Passed = std::vector<double>;
  InOrder<double> in_order_;
  Passed passed_;
  int restarts_ = 0, held_ = 0, refused_ = 0;
};

TEST_F(InOrderTest, DropsTheOneThatNoneAgreesWith) {
  stream(100.0, 20);
  add(106.0, 101.0);
  EXPECT_EQ(in_order_.held(), 1U);
  EXPECT_EQ(passed_, Passed());
  add(101.05, 101.05);
  EXPECT_EQ(passed_, Passed{101.05}) << "it waits for no other";
  EXPECT_EQ(held_, 1);
  add(101.0, 101.1);
  EXPECT_EQ(refused_, 1);
}

TEST_F(InOrderTest, LosesNothingByARestart) {
  stream(100.0, 20);
  for (const double stamp_s : {3.0, 3.05, 3.1, 3.15}) add(stamp_s, 98.0 + stamp_s);
  EXPECT_EQ(passed_, (Passed{3.0, 3.05, 3.1, 3.15}));
  EXPECT_EQ(restarts_, 1);
  EXPECT_EQ(held_ + refused_, 0);
}

TEST_F(InOrderTest, LosesNothingByASilenceThatNothingExplains) {
  stream(100.0, 20);
  for (const double stamp_s : {131.0, 131.05, 131.1}) add(stamp_s, stamp_s - 30.0);
  EXPECT_EQ(passed_, (Passed{131.0, 131.05, 131.1}));
  EXPECT_EQ(restarts_ + held_ + refused_, 0);
}

TEST_F(InOrderTest, AReceiptThatExplainsItLater) {
  stream(100.0, 20);
  add(104.0, 101.0);
  const auto release = [this](double now_s) {
    in_order_.release(nanoseconds(now_s), nanoseconds(now_s),
                      [this](double item_s, Verdict /*verdict*/) { passed_.push_back(item_s); });
  };
  release(103.9);
  EXPECT_EQ(passed_, Passed());
  release(104.0);
  EXPECT_EQ(passed_, Passed{104.0});
  add(104.05, 104.05);
  EXPECT_EQ(passed_.size(), 2U);
}

}  // namespace
}  // namespace situation_awareness::stamp_order_test

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "situation_awareness/common/stamp_order.hpp"

namespace situation_awareness {

/// Passes on messages of a stream in the order of their stamps, as StampOrder judges them, and holds those that are
/// doubted: they are passed on once others agree with them, or receipts explain them, and dropped when a message comes
/// that goes on as before. So a silence or a restart loses no message here, and one that is held delays no other.
template <class Item>
class InOrder {
 public:
  using Verdict = StampOrder::Verdict;

  /// Calls `pass(item, verdict)` for each message that is in order now, where the verdict is kNext, or kRestart for the
  /// first of another time; and `drop(was_held)` for each that is not. kRefused: it is held or was dropped. `now_ns`:
  /// by the clock of `release`.
  template <class Pass, class Drop>
  Verdict add(Item item, std::int64_t stamp_ns, std::int64_t received_ns, std::int64_t now_ns, const Pass& pass,
              const Drop& drop) {
    const Verdict verdict = order_.judge(stamp_ns, received_ns);
    if (!order_.has_agreed() && order_.doubted() <= 1) drop_all(drop);
    if (order_.doubted() > 0) {
      held_.push_back({std::move(item), now_ns});
    } else if (verdict == Verdict::kRefused) {
      drop(/*was_held=*/false);
    } else {
      const bool was_held = !held_.empty();
      pass_all(verdict, pass);
      pass(std::move(item), was_held ? Verdict::kNext : verdict);
    }
    return verdict;
  }

  /// Passes on those that are held for two usual periods, or kLongest_s where it is not known, and that receipts
  /// explain by then: nothing has come that says otherwise.
  template <class Pass>
  void release(std::int64_t received_ns, std::int64_t now_ns, const Pass& pass) {
    if (held_.empty() || !order_.explains_doubted(received_ns)) return;
    const double patience_s = order_.period_s() > 0.0 ? 2.0 * order_.period_s() : kLongest_s;
    if (seconds_between(held_.front().since_ns, now_ns) < patience_s) return;
    order_.accept_doubted();
    pass_all(Verdict::kNext, pass);
  }

  /// Drops those that are held, such as at the end of a recording: nothing agreed with them.
  template <class Drop>
  void end(const Drop& drop) {
    drop_all(drop);
  }

  const StampOrder& order() const { return order_; }
  std::size_t held() const { return held_.size(); }

 private:
  static constexpr double kLongest_s = 1.0;

  struct Held {
    Item item;
    std::int64_t since_ns;
  };

  template <class Pass>
  void pass_all(Verdict verdict, const Pass& pass) {
    for (Held& held : held_) pass(std::move(held.item), std::exchange(verdict, Verdict::kNext));
    held_.clear();
  }
  template <class Drop>
  void drop_all(const Drop& drop) {
    for (std::size_t i = 0; i < held_.size(); ++i) drop(/*was_held=*/true);
    held_.clear();
  }

  StampOrder order_;
  std::vector<Held> held_;  ///< StampOrder::kAgreeing - 1 at most
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace situation_awareness {

/// Counts by reason, sorted by the reasons' text. Reasons are short fixed texts that diagnostics print unchanged. They
/// are few and mostly the same from scan to scan: `reset` keeps their memory.
class Counters {
 public:
  using Entry = std::pair<std::string, std::uint64_t>;

  Counters() = default;
  Counters(std::initializer_list<Entry> entries) {
    for (const Entry& entry : entries) (*this)[entry.first] += entry.second;
  }

  std::uint64_t& operator[](std::string_view reason) {
    auto entry = lower_bound(reason);
    if (entry == end_used() || entry->first != reason) {
      if (used_ == entries_.size()) make_room();
      // Reuses the first spare entry and its text's memory.
      const auto place = std::lower_bound(entries_.begin(), end_used(), reason, before);
      const auto spare = end_used();
      spare->first.assign(reason);
      spare->second = 0;
      std::rotate(place, spare, spare + 1);
      ++used_;
      entry = place;
    }
    return entry->second;
  }

  /// Count of a reason; 0 if it never occurred.
  std::uint64_t of(std::string_view reason) const {
    const auto entry = std::lower_bound(begin(), end(), reason, before);
    return entry != end() && entry->first == reason ? entry->second : 0;
  }

  bool empty() const { return used_ == 0; }
  std::size_t size() const { return used_; }
  std::vector<Entry>::const_iterator begin() const { return entries_.begin(); }
  std::vector<Entry>::const_iterator end() const { return entries_.begin() + static_cast<std::ptrdiff_t>(used_); }

  /// Removes all counts and keeps their memory. The first reset makes room for some reasons, which may first occur at
  /// any later time.
  void reset() {
    used_ = 0;
    if (entries_.empty()) make_room();
  }

  friend bool operator==(const Counters& a, const Counters& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end());
  }
  friend bool operator!=(const Counters& a, const Counters& b) { return !(a == b); }

 private:
  static constexpr std::size_t kReasonLength = 64;
  static constexpr std::size_t kRoom = 16;  ///< made at once

  static bool before(const Entry& entry, std::string_view reason) { return entry.first < reason; }
  void make_room() {
    for (std::size_t i = 0; i < kRoom; ++i) entries_.emplace_back().first.reserve(kReasonLength);
  }
  std::vector<Entry>::iterator end_used() { return entries_.begin() + static_cast<std::ptrdiff_t>(used_); }
  std::vector<Entry>::iterator lower_bound(std::string_view reason) {
    return std::lower_bound(entries_.begin(), end_used(), reason, before);
  }

  std::vector<Entry> entries_;  ///< those used, sorted, and spare ones
  std::size_t used_ = 0;
};

}  // namespace situation_awareness

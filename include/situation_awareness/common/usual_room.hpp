// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>

namespace situation_awareness {

/// Room that lists get which are short after most scans, when they are first used: else the first scan with more would
/// allocate, at any time.
constexpr std::size_t kUsualRoom = 128;

/// As list.assign(size, value). Where the list has too little room, it gets half as much again and at least the usual
/// room, so that it stops allocating though its size varies from scan to scan.
template <class List>
void assign_with_room(List& list, std::size_t size, const typename List::value_type& value) {
  if (list.capacity() < size) list.reserve(std::max(kUsualRoom, size + size / 2));
  list.assign(size, value);
}

/// Reserves room for a list that grows with a map, before it gets so long: by a quarter at a time, as doubling it would
/// leave up to half of its memory empty.
template <class List>
void make_room(List& list, std::size_t size) {
  if (list.capacity() < size) list.reserve(size + size / 4 + kUsualRoom);
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

#include <gtest/gtest.h>

#include "situation_awareness/map/polygons/polygons.hpp"

namespace situation_awareness {

/// The two chains are equal bit for bit.
inline void expect_same(const Chain& a, const Chain& b) {
  EXPECT_EQ(a.id, b.id);
  EXPECT_EQ(a.closed, b.closed);
  EXPECT_EQ(a.first_seen_ns, b.first_seen_ns);
  EXPECT_EQ(a.last_seen_ns, b.last_seen_ns);
  EXPECT_EQ(a.p_exists, b.p_exists);
  EXPECT_EQ(a.state, b.state);
  ASSERT_EQ(a.vertices.size(), b.vertices.size());
  for (std::size_t i = 0; i < a.vertices.size(); ++i) {
    EXPECT_EQ(a.vertices[i].p_world_m, b.vertices[i].p_world_m);
    EXPECT_EQ(a.vertices[i].sigma_m, b.vertices[i].sigma_m);
  }
}

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/pipeline/closed_loops.hpp"

#include <algorithm>

#include "situation_awareness/common/time.hpp"

namespace situation_awareness {

void ClosedLoops::add(std::int64_t from_ns, std::int64_t to_ns) {
  const auto first =
      std::find_if(spans_.begin(), spans_.end(), [&](const Span& span) { return span.to_ns >= from_ns; });
  const auto end = std::find_if(first, spans_.end(), [&](const Span& span) { return span.from_ns > to_ns; });
  Span joined = {from_ns, to_ns};
  if (first != end) {
    joined.from_ns = std::min(from_ns, first->from_ns);
    joined.to_ns = std::max(to_ns, (end - 1)->to_ns);
  }
  spans_.insert(spans_.erase(first, end), joined);
}

double ClosedLoops::open_s(std::int64_t from_ns, std::int64_t to_ns) const {
  if (to_ns <= from_ns) return 0.0;
  double open_s = seconds_between(from_ns, to_ns);
  for (const Span& span : spans_) {
    const std::int64_t begin_ns = std::max(span.from_ns, from_ns), end_ns = std::min(span.to_ns, to_ns);
    if (begin_ns < end_ns) open_s -= seconds_between(begin_ns, end_ns);
  }
  return open_s;
}

}  // namespace situation_awareness

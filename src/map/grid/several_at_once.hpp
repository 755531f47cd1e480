// SPDX-License-Identifier: BSD-3-Clause
#pragma once

/// Of a function with loops over numbers: it is compiled also for processors with AVX2, which take twice as many at
/// once, and the one for the processor at hand is taken when the library is loaded. Results are the same bits: a
/// product and a sum stay two operations.
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__linux__)
#define SITUATION_AWARENESS_SEVERAL_AT_ONCE __attribute__((target_clones("avx2", "default")))
#else
#define SITUATION_AWARENESS_SEVERAL_AT_ONCE
#endif

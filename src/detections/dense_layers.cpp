// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/detections/dense_layers.hpp"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <utility>

#include "situation_awareness/common/usual_room.hpp"

namespace situation_awareness {
namespace {

// Fast but ugly, for `pipeline_speed` (scripts/evaluate speed, "detect"): the sums of a tile, some rows by kOutputs
// outputs, stay in the processor's vector registers, so that each weight is loaded once per tile.

constexpr int kOutputs = 16;  // of a panel

/// Rows of a tile whose inputs are not all used.
constexpr int kSparseRows = 2;

/// Rows of indices of the inputs that are not zero, as many as the counts say; none where the product uses all.
struct SparseInputs {
  const int* used;
  const int* counts;
};

struct Product {
  const float* inputs;  ///< rows of n numbers
  int n;
  const float* panels;
  int outputs;
  bool relu;
  float* results;  ///< rows of `outputs` numbers
};

struct Four {
  static constexpr int kWidth = 4;
  using Vector = float __attribute__((vector_size(kWidth * sizeof(float))));
};

#if defined(__x86_64__)
struct Eight {
  static constexpr int kWidth = 8;
  using Vector = float __attribute__((vector_size(kWidth * sizeof(float))));
};

struct Sixteen {
  static constexpr int kWidth = 16;
  using Vector = float __attribute__((vector_size(kWidth * sizeof(float))));
};
#endif

/// The sums of one row and panel, as results.
template <typename Vector, int kVectors>
[[gnu::always_inline]] inline void store(const Product& product, int row, int panel, Vector (&sums)[kVectors]) {
  if (product.relu) {
    const Vector zero{};
    for (Vector& sum : sums) sum = sum < zero ? zero : sum;
  }
  const int first = panel * kOutputs;
  float* const y = product.results + static_cast<std::ptrdiff_t>(row) * product.outputs + first;
  if (first + kOutputs <= product.outputs) {
    std::memcpy(y, sums, sizeof(sums));
  } else {
    std::memcpy(y, sums, static_cast<std::size_t>(product.outputs - first) * sizeof(float));
  }
}

template <typename Lanes, int kRows, int kPanels>
[[gnu::always_inline]] inline void multiply_tile(const Product& product, int row, int panel) {
  using Vector = typename Lanes::Vector;
  constexpr int kWidth = Lanes::kWidth;
  constexpr int kVectors = kOutputs / kWidth;
  const auto n = static_cast<std::ptrdiff_t>(product.n);
  const std::ptrdiff_t panel_size = kOutputs * (n + 1);
  const float* const x = product.inputs + row * n;
  const float* w = product.panels + panel * panel_size;
  Vector sums[kRows][kPanels][kVectors];
  for (int p = 0; p < kPanels; ++p) {
    for (int v = 0; v < kVectors; ++v) {
      Vector bias;
      std::memcpy(&bias, w + p * panel_size + v * kWidth, sizeof(bias));
      for (int r = 0; r < kRows; ++r) sums[r][p][v] = bias;
    }
  }
  for (std::ptrdiff_t i = 0; i < n; ++i) {
    w += kOutputs;
    for (int p = 0; p < kPanels; ++p) {
      for (int v = 0; v < kVectors; ++v) {
        Vector weights;
        std::memcpy(&weights, w + p * panel_size + v * kWidth, sizeof(weights));
        for (int r = 0; r < kRows; ++r) sums[r][p][v] += weights * x[r * n + i];
      }
    }
  }
  for (int p = 0; p < kPanels; ++p) {
    for (int r = 0; r < kRows; ++r) store(product, row + r, panel + p, sums[r][p]);
  }
}

/// A tile of `rows` rows, kMost at most.
template <typename Lanes, int kMost, int kPanels>
[[gnu::always_inline]] inline void multiply_up_to(const Product& product, int row, int rows, int panel) {
  if constexpr (kMost > 1) {
    if (rows < kMost) return multiply_up_to<Lanes, kMost - 1, kPanels>(product, row, rows, panel);
  }
  multiply_tile<Lanes, kMost, kPanels>(product, row, panel);
}

/// In tiles of about the same size: one of a single row takes as long as one of four, for each of its sums waits for
/// the one before.
template <typename Lanes, int kMostRows, int kPanels>
[[gnu::always_inline]] inline void multiply_rows(const Product& product, int rows, int panel) {
  const int tiles = (rows + kMostRows - 1) / kMostRows;
  int row = 0;
  for (int tile = 0; tile < tiles; ++tile) {
    const int count = (rows - row) / (tiles - tile);
    multiply_up_to<Lanes, kMostRows, kPanels>(product, row, count, panel);
    row += count;
  }
}

template <typename Lanes, int kMostRows, int kPanels>
[[gnu::always_inline]] inline void multiply_dense(const Product& product, int rows) {
  const int panels = (product.outputs + kOutputs - 1) / kOutputs;
  int panel = 0;
  for (; panel + kPanels <= panels; panel += kPanels) multiply_rows<Lanes, kMostRows, kPanels>(product, rows, panel);
  for (; panel < panels; ++panel) multiply_rows<Lanes, kMostRows, 1>(product, rows, panel);
}

/// Half of what a layer with `relu` gives are zeros, which add nothing: the sums are those of the dense product, bit
/// for bit. Rows of a tile use as many inputs, the shorter ones a zero behind their own.
template <typename Lanes, int kRows, int kPanels>
[[gnu::always_inline]] inline void multiply_sparse_tile(const Product& product, const SparseInputs& sparse, int row,
                                                        int panel) {
  using Vector = typename Lanes::Vector;
  constexpr int kWidth = Lanes::kWidth;
  constexpr int kVectors = kOutputs / kWidth;
  const auto n = static_cast<std::ptrdiff_t>(product.n);
  const std::ptrdiff_t panel_size = kOutputs * (n + 1);
  const float* const w = product.panels + panel * panel_size;
  const float* const x = product.inputs + row * n;
  const int* const used = sparse.used + row * n;
  Vector sums[kRows][kPanels][kVectors];
  for (int p = 0; p < kPanels; ++p) {
    for (int v = 0; v < kVectors; ++v) {
      Vector bias;
      std::memcpy(&bias, w + p * panel_size + v * kWidth, sizeof(bias));
      for (int r = 0; r < kRows; ++r) sums[r][p][v] = bias;
    }
  }
  const int count = sparse.counts[row];
  for (std::ptrdiff_t k = 0; k < count; ++k) {
    for (int r = 0; r < kRows; ++r) {
      const std::ptrdiff_t i = used[r * n + k];
      const float input = x[r * n + i];
      const float* const weights_of = w + (i + 1) * kOutputs;
      for (int p = 0; p < kPanels; ++p) {
        for (int v = 0; v < kVectors; ++v) {
          Vector weights;
          std::memcpy(&weights, weights_of + p * panel_size + v * kWidth, sizeof(weights));
          sums[r][p][v] += weights * input;
        }
      }
    }
  }
  for (int p = 0; p < kPanels; ++p) {
    for (int r = 0; r < kRows; ++r) store(product, row + r, panel + p, sums[r][p]);
  }
}

template <typename Lanes, int kPanels>
[[gnu::always_inline]] inline void multiply_sparse_rows(const Product& product, const SparseInputs& sparse, int rows,
                                                        int panel) {
  int row = 0;
  for (; row + kSparseRows <= rows; row += kSparseRows) {
    multiply_sparse_tile<Lanes, kSparseRows, kPanels>(product, sparse, row, panel);
  }
  for (; row < rows; ++row) multiply_sparse_tile<Lanes, 1, kPanels>(product, sparse, row, panel);
}

template <typename Lanes>
[[gnu::always_inline]] inline void multiply_sparse(const Product& product, const SparseInputs& sparse, int rows) {
  const int panels = (product.outputs + kOutputs - 1) / kOutputs;
  int panel = 0;
  for (; panel + 2 <= panels; panel += 2) multiply_sparse_rows<Lanes, 2>(product, sparse, rows, panel);
  if (panel < panels) multiply_sparse_rows<Lanes, 1>(product, sparse, rows, panel);
}

void multiply_portable(const Product& product, const SparseInputs& sparse, int rows) {
  sparse.counts != nullptr ? multiply_sparse<Four>(product, sparse, rows) : multiply_dense<Four, 2, 1>(product, rows);
}

#if defined(__x86_64__)
[[gnu::target("avx2,fma")]] void multiply_avx2(const Product& product, const SparseInputs& sparse, int rows) {
  sparse.counts != nullptr ? multiply_sparse<Eight>(product, sparse, rows) : multiply_dense<Eight, 5, 1>(product, rows);
}

[[gnu::target("avx512f")]] void multiply_avx512(const Product& product, const SparseInputs& sparse, int rows) {
  sparse.counts != nullptr ? multiply_sparse<Sixteen>(product, sparse, rows)
                           : multiply_dense<Sixteen, 8, 2>(product, rows);
}

bool has_avx2() {
  static const bool has = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  return has;
}

bool has_avx512() {
  static const bool has = __builtin_cpu_supports("avx512f");
  return has;
}
#endif

/// From this number of rows on the dense product is faster with AVX-512 than that of the inputs that are not zero, for
/// its rows share the weights that they load: of two networks twelve rows take 71 us instead of 86 us, four rows 57 us
/// instead of 35 us.
constexpr int kDenseRows = 6;

bool is_dense_faster([[maybe_unused]] int rows) {
#if defined(__x86_64__)
  return has_avx512() && rows >= kDenseRows;
#else
  return false;
#endif
}

void multiply(const Product& product, const SparseInputs& sparse, int rows) {
#if defined(__x86_64__)
  if (has_avx512()) return multiply_avx512(product, sparse, rows);
  if (has_avx2()) return multiply_avx2(product, sparse, rows);
#endif
  multiply_portable(product, sparse, rows);
}

/// Indices of the numbers of a row that are not zero; their count.
int find_used_portable(const float* x, int n, int* used) {
  int count = 0;
  for (int i = 0; i < n; ++i) {
    std::uint32_t bits = 0;
    std::memcpy(&bits, x + i, sizeof(bits));
    used[count] = i;
    count += bits << 1U != 0 ? 1 : 0;  // without the sign
  }
  return count;
}

#if defined(__x86_64__)
constexpr int kBlock = Eight::kWidth;

/// For each set of eight numbers, as bits, the indices of its members as bytes, the lowest first.
constexpr std::array<std::uint64_t, 1 << kBlock> members_of_sets() {
  std::array<std::uint64_t, 1 << kBlock> members{};
  for (std::uint64_t set = 0; set < members.size(); ++set) {
    unsigned shift = 0;
    for (std::uint64_t i = 0; i < kBlock; ++i) {
      if ((set >> i & 1U) == 0) continue;
      members[set] |= i << shift;
      shift += 8;
    }
  }
  return members;
}

/// As the portable one, eight numbers at once: writes up to eight indices behind those that count.
[[gnu::target("avx2,popcnt")]] int find_used_avx2(const float* x, int n, int* used) {
  static constexpr auto kMembers = members_of_sets();
  int count = 0;
  int i = 0;
  for (; i + kBlock <= n; i += kBlock) {
    const __m256 is_used = _mm256_cmp_ps(_mm256_loadu_ps(x + i), _mm256_setzero_ps(), _CMP_NEQ_UQ);
    const auto set = static_cast<unsigned>(_mm256_movemask_ps(is_used));
    const __m128i members = _mm_cvtsi64_si128(static_cast<long long>(kMembers[set]));
    const __m256i indices = _mm256_add_epi32(_mm256_cvtepu8_epi32(members), _mm256_set1_epi32(i));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(used + count), indices);
    count += __builtin_popcount(set);
  }
  const int rest = find_used_portable(x + i, n - i, used + count);
  for (int k = 0; k < rest; ++k) used[count + k] += i;
  return count + rest;
}
#endif

int find_used_of_row(const float* x, int n, int* used) {
#if defined(__x86_64__)
  if (has_avx2()) return find_used_avx2(x, n, used);
#endif
  return find_used_portable(x, n, used);
}

/// The inputs that are not zero, row by row; `used` has room for kUsedRoom more.
constexpr std::size_t kUsedRoom = 8;

void find_used(const float* inputs, int n, int rows, int* used, int* counts) {
  for (int row = 0; row < rows; ++row) {
    const std::ptrdiff_t first = static_cast<std::ptrdiff_t>(row) * n;
    counts[row] = find_used_of_row(inputs + first, n, used + first);
  }
  for (int row = 0; row + kSparseRows <= rows; row += kSparseRows) {
    const int most = *std::max_element(counts + row, counts + row + kSparseRows);
    for (int r = row; r < row + kSparseRows; ++r) {
      int* const of_row = used + static_cast<std::ptrdiff_t>(r) * n;
      if (counts[r] == most) continue;
      int zero = 0;  // the first one that is left out
      while (zero < counts[r] && of_row[zero] == zero) ++zero;
      std::fill(of_row + counts[r], of_row + most, zero);
      counts[r] = most;
    }
  }
}

}  // namespace

void DenseLayers::add(const Eigen::Ref<const Rows>& A, const Eigen::Ref<const Eigen::VectorXf>& b, bool relu) {
  if (A.size() == 0 || b.size() != A.rows() || (!empty() && A.cols() != outputs())) {
    throw std::invalid_argument("a layer of " + std::to_string(A.rows()) + " outputs, " + std::to_string(A.cols()) +
                                " inputs and " + std::to_string(b.size()) + " biases behind " +
                                std::to_string(outputs()) + " outputs");
  }
  static_assert(kPanel == static_cast<std::size_t>(kOutputs));
  Layer layer{static_cast<int>(A.cols()), static_cast<int>(A.rows()), relu, {}};
  for (int first = 0; first < layer.outputs; first += kOutputs) {
    for (int i = -1; i < layer.inputs; ++i) {
      PanelLine line{};
      for (int j = first; j < std::min(first + kOutputs, layer.outputs); ++j) {
        line.of_outputs[static_cast<std::size_t>(j - first)] = i < 0 ? b(j) : A(j, i);
      }
      layer.panels.push_back(line);
    }
  }
  layers_.push_back(std::move(layer));
}

int DenseLayers::inputs() const { return empty() ? 0 : layers_.front().inputs; }
int DenseLayers::outputs() const { return empty() ? 0 : layers_.back().outputs; }

const float* DenseLayers::forward(const float* inputs, int rows) {
  bool is_sparse = false;
  for (const Layer& layer : layers_) {
    const auto size = static_cast<std::size_t>(rows) * static_cast<std::size_t>(layer.outputs);
    if (back_.size() < size) assign_with_room(back_, size, 0.0F);
    const auto inputs_size = static_cast<std::size_t>(rows) * static_cast<std::size_t>(layer.inputs);
    SparseInputs sparse{nullptr, nullptr};
    if (is_sparse) {  // room for them is kept whatever the number of rows, so that fewer rows allocate nothing
      const std::size_t used_size = inputs_size + kUsedRoom;
      if (used_.size() < used_size) assign_with_room(used_, used_size, 0);
      if (counts_.size() < static_cast<std::size_t>(rows)) assign_with_room(counts_, static_cast<std::size_t>(rows), 0);
    }
    if (is_sparse && !is_dense_faster(rows)) {
      find_used(inputs, layer.inputs, rows, used_.data(), counts_.data());
      sparse = {used_.data(), counts_.data()};
    }
    multiply({inputs, layer.inputs, layer.panels.front().of_outputs.data(), layer.outputs, layer.relu, back_.data()},
             sparse, rows);
    is_sparse = layer.relu;
    std::swap(front_, back_);
    inputs = front_.data();
  }
  return inputs;
}

}  // namespace situation_awareness

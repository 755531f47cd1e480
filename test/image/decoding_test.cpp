// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/image/decoding.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "support/refusal.hpp"

namespace situation_awareness::decoding_test {
namespace {

constexpr int kWidth = 12, kHeight = 8;
constexpr std::size_t kStep = 30;  // rows are longer than their pixels

/// Left and right halves have each a colour.
std::array<int, 3> color_at(int column) {
  return column < kWidth / 2 ? std::array<int, 3>{200, 90, 30} : std::array<int, 3>{20, 60, 240};
}

void expect_colors(const std::vector<std::uint8_t>& rgb, int within) {
  ASSERT_EQ(rgb.size(), std::size_t{3} * kWidth * kHeight);
  for (int row = 0; row < kHeight; ++row) {
    for (const int column : {0, 1, 2, 3, 8, 9, 10, 11}) {  // not between the halves, where colours are interpolated
      for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(rgb[static_cast<std::size_t>(3 * (row * kWidth + column) + c)],
                    color_at(column)[static_cast<std::size_t>(c)], within)
            << row << ' ' << column << ' ' << c;
      }
    }
  }
}

TEST(RgbOf, ReadsEachBayerPattern) {
  // Channels of the four pixels of a pattern, rows first.
  for (const auto& [coding, pattern] :
       std::vector<std::pair<ColorCoding, std::array<int, 4>>>{{ColorCoding::kBayerRggb, {0, 1, 1, 2}},
                                                               {ColorCoding::kBayerBggr, {2, 1, 1, 0}},
                                                               {ColorCoding::kBayerGbrg, {1, 2, 0, 1}},
                                                               {ColorCoding::kBayerGrbg, {1, 0, 2, 1}}}) {
    std::vector<std::uint8_t> data(kStep * kHeight, 0xEE);
    for (int row = 0; row < kHeight; ++row) {
      for (int column = 0; column < kWidth; ++column) {
        const auto channel = static_cast<std::size_t>(pattern[static_cast<std::size_t>(2 * (row % 2) + column % 2)]);
        data[static_cast<std::size_t>(row) * kStep + static_cast<std::size_t>(column)] =
            static_cast<std::uint8_t>(color_at(column)[channel]);
      }
    }
    expect_colors(rgb_of(data.data(), kWidth, kHeight, kStep, coding), 0);
  }
}

TEST(RgbOf, ReadsBothOrdersOfYuv) {
  for (const bool color_first : {true, false}) {
    std::vector<std::uint8_t> data(kStep * kHeight, 0xEE);
    for (int row = 0; row < kHeight; ++row) {
      for (int column = 0; column < kWidth; column += 2) {
        const auto [r, g, b] = color_at(column);
        // ITU-R BT.601, video range
        const auto y = static_cast<std::uint8_t>(16.5 + 0.257 * r + 0.504 * g + 0.098 * b);
        const auto u = static_cast<std::uint8_t>(128.5 - 0.148 * r - 0.291 * g + 0.439 * b);
        const auto v = static_cast<std::uint8_t>(128.5 + 0.439 * r - 0.368 * g - 0.071 * b);
        const std::array<std::uint8_t, 4> two =
            color_first ? std::array<std::uint8_t, 4>{u, y, v, y} : std::array<std::uint8_t, 4>{y, u, y, v};
        std::copy(two.begin(), two.end(), data.begin() + row * static_cast<int>(kStep) + 2 * column);
      }
    }
    expect_colors(rgb_of(data.data(), kWidth, kHeight, kStep, color_first ? ColorCoding::kUyvy : ColorCoding::kYuyv),
                  3);
  }
}

TEST(RgbOf, RefusesSizesThatACodingDoesNotHave) {
  const std::vector<std::uint8_t> data(1000);
  EXPECT_TRUE(is_size_of(ColorCoding::kUyvy, 6, 5));
  for (const auto& [width, height] : {std::pair(5, 8), std::pair(8, 5), std::pair(2, 8)}) {
    EXPECT_TRUE(names(
        refusal_of<std::invalid_argument>([&] { rgb_of(data.data(), width, height, 20, ColorCoding::kBayerRggb); }),
        {std::to_string(width) + " x " + std::to_string(height)}));
  }
}

TEST(DecodeImage, ReadsFilesOfEachDepth) {
  for (const auto& [type, file] : {std::pair(CV_8UC1, ".png"), std::pair(CV_16UC1, ".png"), std::pair(CV_8UC3, ".png"),
                                   std::pair(CV_8UC4, ".png"), std::pair(CV_32FC1, ".tiff")}) {
    cv::Mat image(5, 7, type);
    cv::randu(image, 0, 200);
    std::vector<std::uint8_t> bytes;
    ASSERT_TRUE(cv::imencode(file, image, bytes));
    const DecodedImage decoded = decode_image(bytes);
    EXPECT_EQ(decoded.width, 7);
    EXPECT_EQ(decoded.height, 5);
    EXPECT_EQ(decoded.channels, image.channels());
    EXPECT_EQ(decoded.bytes, static_cast<int>(image.elemSize1()));
    EXPECT_EQ(decoded.data, std::vector<std::uint8_t>(image.data, image.data + image.total() * image.elemSize()));
  }
}

TEST(DecodeImage, OfWhatIsNoImageIsEmpty) {
  cv::Mat image(50, 70, CV_8UC3, cv::Scalar(1, 2, 3));
  std::vector<std::uint8_t> png;
  ASSERT_TRUE(cv::imencode(".png", image, png));
  std::vector<std::uint8_t> cut(png.begin(), png.begin() + 20);
  for (const std::vector<std::uint8_t>& bytes : {std::vector<std::uint8_t>{}, std::vector<std::uint8_t>(100, 7), cut}) {
    EXPECT_TRUE(decode_image(bytes).data.empty());
  }
}

}  // namespace
}  // namespace situation_awareness::decoding_test

// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/image/decoding.hpp"

#include <exception>
#include <stdexcept>
#include <string>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace situation_awareness {
namespace {

bool is_yuv(ColorCoding coding) { return coding == ColorCoding::kUyvy || coding == ColorCoding::kYuyv; }

int conversion_of(ColorCoding coding) {
  switch (coding) {
    case ColorCoding::kBayerRggb:
      return cv::COLOR_BayerRGGB2RGB;
    case ColorCoding::kBayerBggr:
      return cv::COLOR_BayerBGGR2RGB;
    case ColorCoding::kBayerGbrg:
      return cv::COLOR_BayerGBRG2RGB;
    case ColorCoding::kBayerGrbg:
      return cv::COLOR_BayerGRBG2RGB;
    case ColorCoding::kUyvy:
      return cv::COLOR_YUV2RGB_UYVY;
    case ColorCoding::kYuyv:
      return cv::COLOR_YUV2RGB_YUYV;
  }
  throw std::invalid_argument("there is no such coding of colours");
}

}  // namespace

bool is_size_of(ColorCoding coding, std::uint32_t width, std::uint32_t height) {
  return width % 2 == 0 && width >= 4 && (is_yuv(coding) || (height % 2 == 0 && height >= 4));
}

std::vector<std::uint8_t> rgb_of(const std::uint8_t* data, int width, int height, std::size_t step,
                                 ColorCoding coding) {
  const bool is_bayer = !is_yuv(coding);
  if (width < 0 || height < 1 ||
      !is_size_of(coding, static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height))) {
    throw std::invalid_argument("an image of " + std::to_string(width) + " x " + std::to_string(height) +
                                " pixels has no such coding of colours");
  }
  const cv::Mat from(height, width, is_bayer ? CV_8UC1 : CV_8UC2, const_cast<std::uint8_t*>(data), step);
  std::vector<std::uint8_t> rgb(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  cv::Mat to(height, width, CV_8UC3, rgb.data());
  cv::cvtColor(from, to, conversion_of(coding));
  return rgb;
}

DecodedImage decode_image(const std::vector<std::uint8_t>& file) {
  DecodedImage image;
  try {
    const cv::Mat mat = cv::imdecode(file, cv::IMREAD_UNCHANGED);
    const int depth = mat.depth();
    if (mat.empty() || !mat.isContinuous() || (depth != CV_8U && depth != CV_16U && depth != CV_32F)) return {};
    image.width = mat.cols;
    image.height = mat.rows;
    image.channels = mat.channels();
    image.bytes = static_cast<int>(mat.elemSize1());
    image.data.assign(mat.data, mat.data + mat.total() * mat.elemSize());
  } catch (const std::exception&) {  // OpenCV throws for some files, and returns nothing for others
    return {};
  }
  return image;
}

}  // namespace situation_awareness

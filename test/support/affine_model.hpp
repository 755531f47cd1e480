// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <openssl/evp.h>

#include <array>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace situation_awareness {

inline std::string sha256_of(const std::string& content) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  EVP_Digest(content.data(), content.size(), digest.data(), &size, EVP_sha256(), nullptr);
  std::string text;
  for (unsigned int i = 0; i < size; ++i) {
    std::array<char, 3> byte{};
    std::snprintf(byte.data(), byte.size(), "%02x", digest[i]);
    text += byte.data();
  }
  return text;
}

/// The network y = A x + b, with known outputs, as an ONNX file and its manifest.
struct AffineModel {
  Eigen::MatrixXf A;  ///< outputs by inputs
  Eigen::VectorXf b;
  bool image_like = true;  ///< input [batch, 1, 1, N], else [batch, N]
  float fill = 0.0F;       ///< of the golden vector

  static AffineModel zero(int inputs, int outputs) {
    AffineModel model;
    model.A = Eigen::MatrixXf::Zero(outputs, inputs);
    model.b = Eigen::VectorXf::Zero(outputs);
    return model;
  }

  /// The file: ModelProto of onnx.proto in protobuf's wire format, where a field is its number, its kind and its value.
  std::string onnx() const {
    const auto text = [](int number, const std::string& value) {
      return varint(static_cast<std::uint64_t>(number) << 3 | 2) + varint(value.size()) + value;
    };
    const auto number_of = [](int number, std::uint64_t value) {
      return varint(static_cast<std::uint64_t>(number) << 3) + varint(value);
    };
    const auto tensor = [&](const std::string& name, const std::vector<std::uint64_t>& dims, const float* data,
                            Eigen::Index size) {
      std::string proto;
      for (const std::uint64_t dim : dims) proto += number_of(1, dim);
      const auto bytes = static_cast<std::size_t>(size) * sizeof(float);
      return proto + number_of(2, 1) + text(8, name) + text(9, {reinterpret_cast<const char*>(data), bytes});
    };
    const auto value_info = [&](const std::string& name, const std::vector<std::uint64_t>& dims) {
      std::string shape = text(1, text(2, "batch"));
      for (const std::uint64_t dim : dims) shape += text(1, number_of(1, dim));
      return text(1, name) + text(2, text(1, number_of(1, 1) + text(2, shape)));
    };
    const auto inputs = static_cast<std::uint64_t>(A.cols());
    const auto outputs = static_cast<std::uint64_t>(A.rows());
    std::string graph;
    if (image_like) graph += text(1, text(1, "x") + text(2, "row") + text(3, "flatten") + text(4, "Flatten"));
    const std::string transposed = text(1, "transB") + number_of(3, 1) + number_of(20, 2);
    graph += text(1, text(1, image_like ? "row" : "x") + text(1, "A") + text(1, "b") + text(2, "y") +
                         text(3, "affine") + text(4, "Gemm") + text(5, transposed));
    graph += text(2, "affine");
    const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows = A;
    graph += text(5, tensor("A", {outputs, inputs}, rows.data(), rows.size()));
    graph += text(5, tensor("b", {outputs}, b.data(), b.size()));
    graph += text(11, value_info("x", image_like ? std::vector<std::uint64_t>{1, 1, inputs}
                                                 : std::vector<std::uint64_t>{inputs}));
    graph += text(12, value_info("y", {outputs}));
    return number_of(1, 7) + text(7, graph) + text(8, number_of(2, 13));
  }

  std::string manifest() const {
    std::ostringstream text;
    text << "version: 1\nsha256: " << sha256_of(onnx()) << "\ninput: {name: x, shape: [batch, "
         << (image_like ? "1, 1, " : "") << A.cols() << "]}\noutput: {name: y, shape: [batch, " << A.rows() << "]}\n";
    text.precision(9);
    Eigen::VectorXf x = Eigen::VectorXf::Constant(A.cols(), fill);
    x(0) = 0.5F;
    const Eigen::VectorXf y = A * x + b;
    text << "golden:\n  first: 0\n  input: [0.5]\n";
    if (fill != 0.0F) text << "  fill: " << fill << '\n';
    text << "  output: [";
    for (Eigen::Index i = 0; i < y.size(); ++i) text << (i > 0 ? ", " : "") << y(i);
    text << "]\n";
    return text.str();
  }

  void write(const std::filesystem::path& onnx_path) const {
    std::ofstream(onnx_path, std::ios::binary | std::ios::trunc) << onnx();
    std::ofstream(std::filesystem::path(onnx_path).replace_extension(".manifest.yaml")) << manifest();
  }

 private:
  static std::string varint(std::uint64_t value) {
    std::string bytes;
    for (; value > 127; value >>= 7) bytes += static_cast<char>((value & 127) | 128);
    return bytes + static_cast<char>(value);
  }
};

}  // namespace situation_awareness

// SPDX-License-Identifier: BSD-3-Clause
// Parts of ONNX files, for networks with known outputs: onnx.proto in protobuf's wire format, where a field is its
// number, its kind and its value.
#pragma once

#include <openssl/evp.h>

#include <array>
#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

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

namespace onnx_proto {

inline std::string varint(std::uint64_t value) {
  std::string bytes;
  for (; value > 127; value >>= 7) bytes += static_cast<char>((value & 127) | 128);
  return bytes + static_cast<char>(value);
}

inline std::string text(int number, const std::string& value) {
  return varint(static_cast<std::uint64_t>(number) << 3 | 2) + varint(value.size()) + value;
}

inline std::string number_of(int number, std::uint64_t value) {
  return varint(static_cast<std::uint64_t>(number) << 3) + varint(value);
}

/// TensorProto of floats.
inline std::string tensor(const std::string& name, const std::vector<std::uint64_t>& dims, const float* data,
                          std::size_t size) {
  std::string proto;
  for (const std::uint64_t dim : dims) proto += number_of(1, dim);
  return proto + number_of(2, 1) + text(8, name) + text(9, {reinterpret_cast<const char*>(data), size * sizeof(float)});
}

/// ValueInfoProto of floats with a batch of any size; 0 is another size that is free.
inline std::string value_info(const std::string& name, const std::vector<std::uint64_t>& dims) {
  std::string shape = text(1, text(2, "batch"));
  for (const std::uint64_t dim : dims) shape += text(1, dim > 0 ? number_of(1, dim) : text(2, "free"));
  return text(1, name) + text(2, text(1, number_of(1, 1) + text(2, shape)));
}

/// AttributeProto of integers.
inline std::string integer(const std::string& name, std::uint64_t value) {
  return text(5, text(1, name) + number_of(3, value) + number_of(20, 2));
}
inline std::string integers(const std::string& name, const std::vector<std::uint64_t>& values) {
  std::string proto = text(1, name);
  for (const std::uint64_t value : values) proto += number_of(8, value);
  return text(5, proto + number_of(20, 7));
}

/// NodeProto; `attributes` come from integer() and integers().
inline std::string node(const std::string& type, const std::vector<std::string>& inputs, const std::string& output,
                        const std::string& attributes = "") {
  std::string proto;
  for (const std::string& input : inputs) proto += text(1, input);
  return text(1, proto + text(2, output) + text(3, output + "/" + type) + text(4, type) + attributes);
}

/// ModelProto of a graph.
inline std::string model(const std::string& graph) {
  return number_of(1, 7) + text(7, graph) + text(8, number_of(2, 13));
}

}  // namespace onnx_proto
}  // namespace situation_awareness

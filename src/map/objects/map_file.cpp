// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/objects/map_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "situation_awareness/common/sha256.hpp"
#include "situation_awareness/map/objects/existence.hpp"

namespace situation_awareness {
namespace {

constexpr const char* kFormat = "situation_awareness map";
constexpr std::uint64_t kVersion = 2;
constexpr std::uint64_t kOldestVersion = 1;  // elements have `confirmed` in place of `state`
constexpr std::size_t kMaxBytes = std::size_t{16} << 20;
constexpr std::string_view kSeal = "sha256: ";        // the last line begins with it
constexpr std::string_view kEditedByHand = "edited";  // instead of the sum

/// Names and places of the numbers that something consists of.
using Numbers = std::vector<std::pair<const char*, double*>>;
Numbers numbers_of(Eigen::Vector2d& value) { return {{"x_m", &value.x()}, {"y_m", &value.y()}}; }
Numbers numbers_of(Pose2& value) {
  return {{"x_m", &value.translation_m.x()}, {"y_m", &value.translation_m.y()}, {"yaw_rad", &value.yaw_rad}};
}
Numbers numbers_of(Vector8d& value) {
  constexpr std::array<const char*, 8> kNames = {"x_m",      "y_m",           "vx_m_s", "vy_m_s",
                                                 "wz_rad_s", "mean_radius_m", "p_m",    "q_m"};
  Numbers numbers;
  for (int i = 0; i < 8; ++i) numbers.emplace_back(kNames[static_cast<std::size_t>(i)], &value(i));
  return numbers;
}

/// The shortest text that reads back as the same number.
template <class Number>
std::string text_of(Number value) {
  std::array<char, 32> text;
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
}

template <class Number>
bool read(const std::string& text, Number& value) {
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  return error == std::errc() && stop == end;
}

/// Writes one field after the other as `name: value`.
class WriteFields {
 public:
  WriteFields(std::string& text, std::string indent) : text_(text), indent_(std::move(indent)) {}

  void operator()(const char* name, const std::string& value) { line(name, '"' + value + '"'); }
  void operator()(const char* name, bool value) { line(name, value ? "true" : "false"); }
  void operator()(const char* name, TrackState value) { line(name, name_of(value)); }
  template <class Number, class... Limits>
  std::enable_if_t<std::is_arithmetic_v<Number>> operator()(const char* name, Number value, Limits... /*limits*/) {
    line(name, text_of(value));
  }
  template <class Value>
  std::enable_if_t<!std::is_arithmetic_v<Value>> operator()(const char* name, Value value, Bounds /*bounds*/) {
    std::string list;
    for (const auto& [part, number] : numbers_of(value)) {
      list += (list.empty() ? "{" : ", ") + std::string(part) + ": " + text_of(*number);
    }
    line(name, list + "}");
  }
  void operator()(const char* name, const Matrix8d& value, Bounds /*bounds*/) {
    line(name, "");
    for (int i = 0; i < 8; ++i) {
      text_ += indent_ + "  - [";
      for (int j = 0; j < 8; ++j) text_ += (j == 0 ? "" : ", ") + text_of(value(i, j));
      text_ += "]\n";
    }
  }

 private:
  void line(const char* name, const std::string& value) {
    text_ += indent_ + name + ":" + (value.empty() ? "" : " ") + value + "\n";
  }

  std::string& text_;
  std::string indent_;
};

/// Reads one field after the other from one YAML map, and notes which it knows.
class ReadFields {
 public:
  ReadFields(const YAML::Node& node, std::string place) : place_(std::move(place)) {
    if (!node.IsMap()) throw std::invalid_argument(place_ + "is no map of names and values");
    for (const auto& item : node) {
      if (!item.first.IsScalar()) throw std::invalid_argument(place_ + "a name is no text");
      if (!fields_.emplace(item.first.Scalar(), item.second).second) refuse(item.first.Scalar(), "is there twice");
    }
  }

  YAML::Node take(const std::string& name) {
    const auto field = fields_.find(name);
    if (field == fields_.end()) refuse(name, "is missing");
    const YAML::Node node = field->second;
    fields_.erase(field);
    return node;
  }

  /// Version 1 said whether an element was confirmed, and by the time that it was unseen whether it was lost.
  void state_from_confirmed() {
    bool confirmed = false;
    (*this)("confirmed", confirmed);
    fields_["state"] = YAML::Node(name_of(confirmed ? TrackState::kConfirmed : TrackState::kTentative));
  }

  void refuse_rest() const {
    if (!fields_.empty()) refuse(fields_.begin()->first, "is unknown");
  }

  void operator()(const char* name, std::string& value) { value = scalar(name, take(name)); }
  void operator()(const char* name, bool& value) {
    const std::string text = scalar(name, take(name));
    if (text != "true" && text != "false") refuse(name, "= " + text + " is neither true nor false");
    value = text == "true";
  }
  void operator()(const char* name, TrackState& value) {
    const std::string text = scalar(name, take(name));
    for (const TrackState state : {TrackState::kTentative, TrackState::kConfirmed, TrackState::kLost}) {
      if (text != name_of(state)) continue;
      value = state;
      return;
    }
    refuse(name, "= " + text + " is neither tentative nor confirmed nor lost");
  }
  template <class Number, class... Limits>
  std::enable_if_t<std::is_arithmetic_v<Number>> operator()(const char* name, Number& value, Limits... /*limits*/) {
    read_number(name, take(name), value);
  }
  template <class Value>
  std::enable_if_t<!std::is_arithmetic_v<Value>> operator()(const char* name, Value& value, Bounds /*bounds*/) {
    ReadFields parts(take(name), place_ + name + ": ");
    for (const auto& [part, number] : numbers_of(value)) parts(part, *number);
    parts.refuse_rest();
  }
  void operator()(const char* name, Matrix8d& value, Bounds /*bounds*/) {
    const YAML::Node rows = take(name);
    if (!rows.IsSequence() || rows.size() != 8) refuse(name, "is no list of 8 rows");
    for (int i = 0; i < 8; ++i) {
      const YAML::Node row = rows[i];
      if (!row.IsSequence() || row.size() != 8) refuse(name, "has a row that is no list of 8 numbers");
      for (int j = 0; j < 8; ++j) read_number(name, row[j], value(i, j));
    }
  }

 private:
  [[noreturn]] void refuse(const std::string& name, const std::string& defect) const {
    throw std::invalid_argument(place_ + name + " " + defect);
  }

  const std::string& scalar(const std::string& name, const YAML::Node& node) const {
    if (!node.IsScalar()) refuse(name, "is no single value");
    return node.Scalar();
  }

  template <class Number>
  void read_number(const std::string& name, const YAML::Node& node, Number& value) const {
    const std::string& text = scalar(name, node);
    const bool whole = std::is_integral_v<Number>;
    if (!read(text, value)) refuse(name, "= " + text + " is no " + (whole ? "whole " : "") + "number that fits");
  }

  std::string place_;
  std::map<std::string, YAML::Node> fields_;
};

void check_frame(const std::string& name) {
  const auto plain = [](char c) { return c > ' ' && c < 0x7F && c != '"' && c != '\\'; };
  if (name.empty() || name.size() > 255 || !std::all_of(name.begin(), name.end(), plain)) {
    throw std::invalid_argument("world_frame is no name of a frame");
  }
}

std::string comment_on(const MapElement& element) {
  const Ellipse ellipse = ellipse_world(combine(element.estimate).x);
  std::array<char, 160> text;
  std::snprintf(text.data(), text.size(), "at (%.2f, %.2f) m, radii %.2f m and %.2f m, turned by %.2f rad",
                ellipse.center_m.x(), ellipse.center_m.y(), ellipse.rx_m, ellipse.ry_m, ellipse.psi_rad);
  return text.data();
}

/// Everything before the last line, which must seal it.
std::string_view sealed_content(std::string_view yaml) {
  const std::size_t seal = yaml.rfind('\n' + std::string(kSeal));
  const std::string_view content = yaml.substr(0, seal == std::string_view::npos ? 0 : seal + 1);
  const std::string_view last_line = yaml.substr(content.size());
  if (last_line.empty() || last_line.find('\n') != last_line.size() - 1 || content.empty()) {
    throw std::invalid_argument("does not end with its line sha256: cut off, or no map");
  }
  const std::string_view sum = last_line.substr(kSeal.size(), last_line.size() - kSeal.size() - 1);
  if (sum != kEditedByHand && sum != sha256(content)) {
    throw std::invalid_argument(
        "its content does not have the sum of its last line: damaged (or edited, then make it '" + std::string(kSeal) +
        std::string(kEditedByHand) + "')");
  }
  return content;
}

MapSnapshot parse(const std::string& content) {
  // Not by YAML::LoadAll, which never returns from a text such as a lone comma. More documents are marked as such.
  const auto marked = [&](const std::string& mark) {
    return content.rfind(mark, 0) == 0 || content.find('\n' + mark) != std::string::npos;
  };
  if (marked("---") || marked("...")) throw std::invalid_argument("is not one YAML document");
  ReadFields fields(YAML::Load(content), "");
  std::string format;
  std::uint64_t version = 0;
  fields("format", format);
  if (format != kFormat) throw std::invalid_argument("format = " + format + " is not '" + kFormat + "'");
  fields("version", version);
  if (version < kOldestVersion || version > kVersion) {
    throw std::invalid_argument("version = " + text_of(version) + " is unknown, known are " + text_of(kOldestVersion) +
                                " to " + text_of(kVersion));
  }
  MapSnapshot snapshot;
  MapSnapshot::fields(snapshot, fields);
  const YAML::Node elements = fields.take("elements");
  fields.refuse_rest();
  if (!elements.IsSequence()) throw std::invalid_argument("elements is no list");
  if (elements.size() > map_bounds::kMaxElements) {
    throw std::invalid_argument("elements are more than " + text_of(map_bounds::kMaxElements));
  }
  for (const YAML::Node& node : elements) {
    ReadFields element_fields(node, "elements[" + text_of(snapshot.elements.size()) + "]: ");
    if (version == 1) element_fields.state_from_confirmed();
    MapElement& element = snapshot.elements.emplace_back();
    MapElement::fields(element, element_fields);
    if (version == 1) age(element, snapshot.stamp_ns);
    element_fields.refuse_rest();
  }
  check_frame(snapshot.world_frame);
  snapshot.validate();
  return snapshot;
}

std::runtime_error cannot(const std::string& path, const char* what) {
  return std::runtime_error(path + ": cannot be " + what + ": " + std::strerror(errno));
}

/// A file that is removed again unless it is renamed.
class PartialFile {
 public:
  explicit PartialFile(const std::string& path) : path_(path), partial_(path + ".part") {
    file_ = ::open(partial_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0666);
    if (file_ < 0) throw cannot(path_, "written");
  }
  ~PartialFile() {
    if (file_ >= 0) ::close(file_);
    if (!done_) ::unlink(partial_.c_str());
  }
  PartialFile(const PartialFile&) = delete;
  PartialFile& operator=(const PartialFile&) = delete;

  void write(std::string_view text) {
    while (!text.empty()) {
      const ssize_t written = ::write(file_, text.data(), text.size());
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) throw cannot(path_, "written");
      text.remove_prefix(static_cast<std::size_t>(written));
    }
  }

  /// On the disk first, then under its name: whatever ends in between, one of the two files is whole.
  void finish() {
    if (::fsync(file_) != 0) throw cannot(path_, "written");
    if (::close(std::exchange(file_, -1)) != 0) throw cannot(path_, "written");
    if (std::rename(partial_.c_str(), path_.c_str()) != 0) throw cannot(path_, "written");
    done_ = true;
    const std::filesystem::path folder = std::filesystem::path(path_).parent_path();
    const int directory = ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (directory < 0) return;  // the file is there; some file systems do not let folders be opened
    ::fsync(directory);
    ::close(directory);
  }

 private:
  std::string path_, partial_;
  int file_ = -1;
  bool done_ = false;
};

/// A name that was mistyped must not cost another file.
void check_replaceable(const std::string& path) {
  if (!std::filesystem::exists(path)) return;
  std::string head(4096, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  if (!std::filesystem::is_regular_file(path) || head.find(kFormat) == std::string::npos) {
    throw std::runtime_error(path + ": is there and no map, so it is not replaced");
  }
}

}  // namespace

std::string map_to_yaml(const MapSnapshot& snapshot) {
  check_frame(snapshot.world_frame);
  snapshot.validate();
  std::string text = "# What an object map knew after an update; docs/map_file.md says what is what.\n";
  WriteFields fields(text, "");
  fields("format", std::string(kFormat));
  fields("version", kVersion);
  MapSnapshot::fields(snapshot, fields);
  text += snapshot.elements.empty() ? "elements: []\n" : "elements:\n";
  for (const MapElement& element : snapshot.elements) {
    text += "  -  # " + comment_on(element) + "\n";
    WriteFields element_fields(text, "    ");
    MapElement::fields(element, element_fields);
  }
  const std::string sum = sha256(text);
  text += std::string(kSeal) + sum + "\n";
  return text;
}

MapSnapshot map_from_yaml(const std::string& yaml, const std::string& source) {
  try {
    if (yaml.size() > kMaxBytes) throw std::invalid_argument("is larger than " + text_of(kMaxBytes) + " bytes");
    return parse(std::string(sealed_content(yaml)));
  } catch (const YAML::Exception& error) {
    throw std::invalid_argument(source + ": not valid YAML: " + error.what());
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(source + ": " + error.what());
  }
}

void save_map(const std::string& path, const MapSnapshot& snapshot) {
  const std::string yaml = map_to_yaml(snapshot);
  check_replaceable(path);
  PartialFile file(path);
  file.write(yaml);
  file.finish();
}

MapSnapshot load_map(const std::string& path) {
  std::error_code error;
  std::ifstream file(path, std::ios::binary);
  if (!std::filesystem::is_regular_file(path, error) || !file) {
    throw std::runtime_error(path + ": cannot be read, or no file");
  }
  if (std::filesystem::file_size(path) > kMaxBytes) {
    throw std::invalid_argument(path + ": is larger than " + text_of(kMaxBytes) + " bytes");
  }
  const std::string yaml{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  return map_from_yaml(yaml, path);
}

MapSnapshot load_map(const std::string& path, const std::string& world_frame) {
  MapSnapshot snapshot = load_map(path);
  if (snapshot.world_frame != world_frame) {
    throw std::invalid_argument(path + ": world_frame = " + snapshot.world_frame + " is not the wanted one, " +
                                world_frame);
  }
  return snapshot;
}

}  // namespace situation_awareness

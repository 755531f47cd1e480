// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/map/map_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string_view>
#include <utility>

#include <yaml-cpp/yaml.h>

#include "situation_awareness/common/sha256.hpp"

namespace situation_awareness {
namespace {

constexpr std::size_t kMaxBytes = std::size_t{16} << 20;
constexpr std::string_view kSeal = "sha256: ";        // the last line begins with it
constexpr std::string_view kEditedByHand = "edited";  // instead of the sum

void check_size(std::uintmax_t bytes) {
  if (bytes > kMaxBytes) throw std::invalid_argument("is larger than " + std::to_string(kMaxBytes) + " bytes");
}

/// Everything before the last line, whose checksum must match.
std::string_view sealed_content(std::string_view yaml) {
  // The last line is looked for from the end: most files that are cut off are refused without being read.
  const bool ends = !yaml.empty() && yaml.back() == '\n';
  const std::size_t before = ends ? yaml.substr(0, yaml.size() - 1).rfind('\n') : std::string_view::npos;
  const std::string_view content = yaml.substr(0, before == std::string_view::npos ? 0 : before + 1);
  const std::string_view last_line = yaml.substr(content.size());
  if (content.empty() || last_line.substr(0, kSeal.size()) != kSeal) {
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

/// The one document of a text.
YAML::Node parse(const std::string& content) {
  // Not by YAML::LoadAll, which does not return for a text such as a single comma. Further documents have markers.
  const auto marked = [&](const std::string& mark) {
    return content.rfind(mark, 0) == 0 || content.find('\n' + mark) != std::string::npos;
  };
  if (marked("---") || marked("...")) throw std::invalid_argument("is not one YAML document");
  return YAML::Load(content);
}

/// The version of a file of this kind.
std::uint64_t read_header(ReadFields& fields, const MapFileHeader& header) {
  std::string format;
  fields("format", format);
  if (format != header.format) {
    throw std::invalid_argument("format = " + format + " is not '" + header.format + "'");
  }
  std::uint64_t version = 0;
  fields("version", version);
  if (version < header.oldest_version || version > header.version) {
    throw std::invalid_argument("version = " + std::to_string(version) + " is unknown, known are " +
                                std::to_string(header.oldest_version) + " to " + std::to_string(header.version));
  }
  return version;
}

std::runtime_error cannot(const std::string& path, const char* what) {
  return std::runtime_error(path + ": cannot be " + what + ": " + std::strerror(errno));
}

/// A temporary file, removed unless it is renamed.
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

  /// Syncs before the rename, so that at any interruption one of the two files is complete.
  void finish() {
    if (::fsync(file_) != 0) throw cannot(path_, "written");
    if (::close(std::exchange(file_, -1)) != 0) throw cannot(path_, "written");
    if (std::rename(partial_.c_str(), path_.c_str()) != 0) throw cannot(path_, "written");
    done_ = true;
    const std::filesystem::path folder = std::filesystem::path(path_).parent_path();
    const int directory = ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (directory < 0) return;  // the file is written; some file systems cannot open folders
    ::fsync(directory);
    ::close(directory);
  }

 private:
  std::string path_, partial_;
  int file_ = -1;
  bool done_ = false;
};

/// Protects other files against a mistyped name.
void check_replaceable(const std::string& path, const std::string& format) {
  if (!std::filesystem::exists(path)) return;
  std::string head(4096, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  if (!std::filesystem::is_regular_file(path) || head.find(format) == std::string::npos) {
    throw std::runtime_error(path + ": is there and no '" + format + "', so it is not replaced");
  }
}

}  // namespace

void detail::check_frame(const std::string& world_frame) {
  const auto plain = [](char c) { return c > ' ' && c < 0x7F && c != '"' && c != '\\'; };
  if (world_frame.empty() || world_frame.size() > 255 || !std::all_of(world_frame.begin(), world_frame.end(), plain)) {
    throw std::invalid_argument("world_frame is no name of a frame");
  }
}

std::string detail::write_sealed(const MapFileHeader& header, const std::function<void(WriteFields&)>& write) {
  std::string text = "# " + header.title + '\n';
  WriteFields fields(text);
  fields("format", header.format);
  fields("version", header.version);
  write(fields);
  const std::string sum = sha256(text);
  text += std::string(kSeal) + sum + '\n';
  return text;
}

void detail::read_sealed(const std::string& yaml, const std::string& source, const MapFileHeader& header,
                         const std::function<void(ReadFields& fields, std::uint64_t version)>& read) {
  try {
    check_size(yaml.size());
    ReadFields fields(parse(std::string(sealed_content(yaml))), "");
    const std::uint64_t version = read_header(fields, header);
    read(fields, version);
  } catch (const YAML::Exception& error) {
    throw std::invalid_argument(source + ": not valid YAML: " + error.what());
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(source + ": " + error.what());
  }
}

void detail::replace_file(const std::string& path, const MapFileHeader& header, const std::string& yaml) {
  check_replaceable(path, header.format);
  PartialFile file(path);
  file.write(yaml);
  file.finish();
}

std::string detail::read_file(const std::string& path) {
  std::error_code error;
  std::ifstream file(path, std::ios::binary);
  if (!std::filesystem::is_regular_file(path, error) || !file) {
    throw std::runtime_error(path + ": cannot be read, or no file");
  }
  try {
    check_size(std::filesystem::file_size(path));
  } catch (const std::invalid_argument& too_large) {
    throw std::invalid_argument(path + ": " + too_large.what());
  }
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

void detail::refuse_frame(const std::string& path, const std::string& world_frame, const std::string& wanted) {
  throw std::invalid_argument(path + ": world_frame = " + world_frame + " is not the wanted one, " + wanted);
}

}  // namespace situation_awareness

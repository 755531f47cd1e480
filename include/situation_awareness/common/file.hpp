// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

namespace situation_awareness {

// Every file that is read or replaced goes through here: what is too large is refused before memory is taken for it,
// what is no file of the same kind is not replaced, and an interrupted write leaves the file that was there.

/// Of texts that people write: parameters, paths, reflectors.
constexpr std::size_t kMaxTextBytes = std::size_t{16} << 20;

/// The files of one kind, as far as they are told from others by how they begin.
struct FileKind {
  std::string name;  ///< for messages, such as "a map of objects"
  /// Whether a file that begins so, with kHeadBytes or all that it has, is one.
  std::function<bool(std::string_view head)> has_head;

  static constexpr std::size_t kHeadBytes = 65'536;
};

/// Files that have `mark` within their head; of a mark that begins with a line break, at the begin of a line.
FileKind kind_with_mark(std::string name, std::string mark);

/// The content of a file. Throws std::runtime_error naming a path that cannot be read or is no regular file, and
/// std::invalid_argument naming it and both sizes if it has more than `most_bytes`.
std::string read_file(const std::string& path, std::uintmax_t most_bytes);

/// A file that takes the place of another, or of none, when it is complete. Until then it is beside it under a name of
/// its own, also where several write the same path: the last that finishes stays. What a killed process has left there
/// is removed by the next that writes the path.
class NewFile {
 public:
  /// Throws std::runtime_error naming a path that cannot be written, or that has a file which is neither empty nor of
  /// the kind.
  NewFile(std::string path, FileKind kind);
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;
  /// Removes an incomplete file.
  ~NewFile();

  const std::string& path() const { return path_; }
  /// The path of the incomplete file, for a library that writes by itself and leaves the file the same one.
  const std::string& partial() const { return partial_; }

  /// Throws std::runtime_error naming the path if not all can be written.
  void write(std::string_view text);

  /// Syncs to disk, then renames, so that at any interruption one of the two files is complete. Throws
  /// std::runtime_error naming the path.
  void finish();

 private:
  std::string path_, partial_;
  FileKind kind_;
  int file_ = -1;
};

/// Writes a whole file as NewFile does.
void replace_file(const std::string& path, const FileKind& kind, std::string_view content);

}  // namespace situation_awareness

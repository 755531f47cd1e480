// SPDX-License-Identifier: BSD-3-Clause
#include "situation_awareness/common/file.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <utility>

namespace situation_awareness {
namespace {

constexpr std::size_t kReadBytes = 1 << 20;
/// Of one path at the same time.
constexpr int kMostWriters = 1000;

std::runtime_error cannot(const std::string& path, const char* what) {
  return std::runtime_error(path + ": cannot be " + what + ": " + std::strerror(errno));
}

/// Closes what it has opened.
class OpenFile {
 public:
  OpenFile(const std::string& path, int flags) : file_(::open(path.c_str(), flags | O_CLOEXEC, 0666)) {}
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;
  ~OpenFile() {
    if (file_ >= 0) ::close(file_);
  }

  explicit operator bool() const { return file_ >= 0; }
  int get() const { return file_; }
  int release() { return std::exchange(file_, -1); }

 private:
  int file_;
};

/// Appends to `text` up to a size; whether all was read without an error.
bool read_up_to(int file, std::size_t most_bytes, std::string& text) {
  while (text.size() < most_bytes) {
    const std::size_t before = text.size();
    text.resize(std::min(most_bytes, before + kReadBytes));
    const ssize_t got = ::read(file, text.data() + before, text.size() - before);
    text.resize(before + static_cast<std::size_t>(std::max<ssize_t>(got, 0)));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return got == 0;
  }
  return true;
}

/// Without O_NONBLOCK a pipe that nobody writes would hold the caller for ever.
constexpr int kRead = O_RDONLY | O_NONBLOCK;

/// Protects other files against a mistyped name.
void check_replaceable(const std::string& path, const FileKind& kind) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return;
  const auto refuse = [&](const std::string& reason) {
    throw std::runtime_error(path + ": is there and " + reason + ", so it is not replaced");
  };
  if (!S_ISREG(status.st_mode)) refuse("is no file");
  const OpenFile file(path, kRead);
  std::string head;
  if (!file || !read_up_to(file.get(), FileKind::kHeadBytes, head)) refuse("cannot be read");
  if (!head.empty() && !kind.has_head(head)) refuse("is not " + kind.name);
}

std::filesystem::path folder_of(const std::string& path) {
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  return folder.empty() ? "." : folder;
}

std::string partial_path(const std::string& path, int number) { return path + "." + std::to_string(number) + ".part"; }

/// Removes the incomplete file of a process that is no more: whoever writes has a lock, which ends with its process.
void remove_if_left(const std::string& partial) {
  const OpenFile file(partial, O_WRONLY | O_NOFOLLOW | O_NONBLOCK);
  if (!file || ::flock(file.get(), LOCK_EX | LOCK_NB) != 0) return;
  struct stat locked {
  }, named{};
  const bool is_there = ::fstat(file.get(), &locked) == 0 && ::lstat(partial.c_str(), &named) == 0;
  // Its writer may have finished since, and another have taken the name. With the lock nobody else removes this one.
  if (is_there && S_ISREG(named.st_mode) && locked.st_dev == named.st_dev && locked.st_ino == named.st_ino) {
    ::unlink(partial.c_str());
  }
}

}  // namespace

FileKind kind_with_mark(std::string name, std::string mark) {
  return {std::move(name), [mark = std::move(mark)](std::string_view head) {
            const bool is_line = !mark.empty() && mark.front() == '\n';
            if (is_line && head.substr(0, mark.size() - 1) == std::string_view(mark).substr(1)) return true;
            return head.find(mark) != std::string_view::npos;
          }};
}

std::string read_file(const std::string& path, std::uintmax_t most_bytes) {
  const OpenFile file(path, kRead);
  if (!file) throw cannot(path, "read");
  struct stat status {};
  if (::fstat(file.get(), &status) != 0 || !S_ISREG(status.st_mode)) {
    throw std::runtime_error(path + ": cannot be read: it is no file");
  }
  const auto check_size = [&](std::uintmax_t bytes) {
    if (bytes <= most_bytes) return;
    throw std::invalid_argument(path + ": has " + std::to_string(bytes) + " bytes, more than " +
                                std::to_string(most_bytes));
  };
  check_size(static_cast<std::uintmax_t>(status.st_size));
  std::string text;
  text.reserve(static_cast<std::size_t>(status.st_size) + 1);
  // One more: it may have grown meanwhile.
  if (!read_up_to(file.get(), static_cast<std::size_t>(most_bytes) + 1, text)) throw cannot(path, "read");
  check_size(text.size());
  return text;
}

NewFile::NewFile(std::string path, FileKind kind) : path_(std::move(path)), kind_(std::move(kind)) {
  check_replaceable(path_, kind_);
  for (int number = 1; number <= kMostWriters && file_ < 0; ++number) {
    partial_ = partial_path(path_, number);
    remove_if_left(partial_);
    OpenFile file(partial_, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW);
    if (!file && errno == EEXIST) continue;
    if (!file) throw cannot(path_, "written");
    while (::flock(file.get(), LOCK_EX) != 0 && errno == EINTR) {
    }
    // Before it had its lock another may have taken it for left. Where a file system has no locks nobody removes any.
    struct stat status {};
    if (::fstat(file.get(), &status) == 0 && status.st_nlink > 0) file_ = file.release();
  }
  if (file_ < 0) throw std::runtime_error(path_ + ": cannot be written: too many write it");
}

NewFile::~NewFile() {
  if (file_ < 0) return;
  ::unlink(partial_.c_str());
  ::close(file_);
}

void NewFile::write(std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = ::write(file_, text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) throw cannot(path_, "written");
    text.remove_prefix(static_cast<std::size_t>(written));
  }
}

void NewFile::finish() {
  if (::fsync(file_) != 0) throw cannot(path_, "written");
  check_replaceable(path_, kind_);  // it may have come meanwhile
  if (std::rename(partial_.c_str(), path_.c_str()) != 0) throw cannot(path_, "written");
  if (::close(std::exchange(file_, -1)) != 0) throw cannot(path_, "written");
  const OpenFile folder(folder_of(path_), O_RDONLY | O_DIRECTORY);
  if (folder) ::fsync(folder.get());  // the file is written; some file systems cannot open folders
}

void replace_file(const std::string& path, const FileKind& kind, std::string_view content) {
  NewFile file(path, kind);
  file.write(content);
  file.finish();
}

}  // namespace situation_awareness

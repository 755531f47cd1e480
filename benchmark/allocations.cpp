// SPDX-License-Identifier: BSD-3-Clause
#include "allocations.hpp"

#include <cerrno>
#include <cstddef>

namespace situation_awareness {
namespace {

thread_local Allocations counted;  // needs no construction, so that counting works from the first allocation on

void count(std::size_t bytes) {
  ++counted.count;
  counted.bytes += static_cast<std::int64_t>(bytes);
}

}  // namespace

Allocations allocations() { return counted; }

}  // namespace situation_awareness

// A program's own malloc replaces the C library's for everything that is linked to it; the C library's has these names.
// operator new and OpenCV's fastMalloc call it, too.
extern "C" {

void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t number, std::size_t size);
void* __libc_realloc(void* memory, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) {
  situation_awareness::count(size);
  return __libc_malloc(size);
}

void* calloc(std::size_t number, std::size_t size) {
  situation_awareness::count(number * size);
  return __libc_calloc(number, size);
}

void* realloc(void* memory, std::size_t size) {
  situation_awareness::count(size);
  return __libc_realloc(memory, size);
}

void* memalign(std::size_t alignment, std::size_t size) {
  situation_awareness::count(size);
  return __libc_memalign(alignment, size);
}

void* aligned_alloc(std::size_t alignment, std::size_t size) {
  situation_awareness::count(size);
  return __libc_memalign(alignment, size);
}

int posix_memalign(void** memory, std::size_t alignment, std::size_t size) {
  situation_awareness::count(size);
  *memory = __libc_memalign(alignment, size);
  return *memory != nullptr ? 0 : ENOMEM;
}

}  // extern "C"

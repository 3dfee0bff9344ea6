// SPDX-License-Identifier: MIT
#include "runtime/load/mapped_file.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <new>

#include "sinew/formats/sections.h"

#if defined(__unix__) || defined(__APPLE__)
#define SINEW_HAS_MMAP 1
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#endif

namespace sinew::internal {

#if SINEW_HAS_MMAP

MappedFile mapFile(const std::string& path) {
  MappedFile result;
  // O_NONBLOCK: a named pipe must not hold the caller before it is refused.
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (file < 0) {
    result.reason = std::strerror(errno);
    return result;
  }
  struct stat status {};
  if (::fstat(file, &status) != 0) {
    result.reason = std::strerror(errno);
  } else if (!S_ISREG(status.st_mode)) {
    result.reason = "not a regular file";
  } else if (status.st_size == 0) {
    result.reason = "empty file";
  } else {
    result.bytes = std::size_t(status.st_size);
    void* data = ::mmap(nullptr, result.bytes, PROT_READ, MAP_PRIVATE, file, 0);
    if (data == MAP_FAILED) {
      result.reason = std::strerror(errno);
    } else {
      result.data = data;
      result.mapped = true;
    }
  }
  ::close(file);
  return result;
}

void unmapFile(void* data, std::size_t bytes) { ::munmap(data, bytes); }

#else

MappedFile mapFile(const std::string& path) {
  MappedFile result;
  std::FILE* file = std::fopen(path.c_str(), "rb");
  if (file == nullptr) {
    result.reason = std::strerror(errno);
    return result;
  }
  long size = -1;
  if (std::fseek(file, 0, SEEK_END) == 0) size = std::ftell(file);
  std::rewind(file);
  if (size <= 0) {
    result.reason = size == 0 ? "empty file" : "cannot be read";
  } else {
    result.bytes = std::size_t(size);
    result.data = ::operator new(result.bytes, std::align_val_t(formats::kSectionAlignment));
    if (std::fread(result.data, 1, result.bytes, file) != result.bytes) {
      ::operator delete(result.data, std::align_val_t(formats::kSectionAlignment));
      result.data = nullptr;
      result.reason = "cannot be read";
    }
  }
  std::fclose(file);
  return result;
}

void unmapFile(void*, std::size_t) {}

#endif

}  // namespace sinew::internal

// SPDX-License-Identifier: GPL-3.0-or-later
#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <fstream>
#include <new>
#include <string_view>

#include "tools/core/error.h"
#include "tools/import/import.h"
#include "tools/import/readers.h"
#include "tools/import/text_cursor.h"
#include "tools/import/textures.h"
#include "tools/import/worker_protocol.h"
#include "tools/pictures/decode_picture.h"
#include "tools/pictures/picture_files.h"

namespace sinew::tools {
namespace {

// \param grace how far the hard limit lies above: at the soft one of processor time SIGXCPU says why, at the hard one
// SIGKILL does not.
void limit(decltype(RLIMIT_CPU) resource, std::uint64_t value, std::uint64_t grace = 0) {
  rlimit bound{};
  if (getrlimit(resource, &bound) != 0) return;
  bound.rlim_cur = std::min<rlim_t>(value, bound.rlim_max);
  bound.rlim_max = std::min<rlim_t>(value + grace, bound.rlim_max);
  setrlimit(resource, &bound);
}

// Libraries' own maps are in it: some reserve room for each core.
std::uint64_t addressSpace() {
  std::uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return pages * std::uint64_t(sysconf(_SC_PAGESIZE));
}

void limitSelf() {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  prctl(PR_SET_DUMPABLE, 0);
  limit(RLIMIT_CORE, 0);
}

void limitSelf(std::uint64_t megabytes, double seconds) {
  limitSelf();
  limit(RLIMIT_CPU, std::uint64_t(std::ceil(seconds)), 1);
  limit(RLIMIT_FSIZE, 0);  // the worker writes no file; a pipe is none
  if (!kSanitized) limit(RLIMIT_AS, addressSpace() + (megabytes << 20));
}

class DescriptorSink : public ByteSink {
 public:
  explicit DescriptorSink(int fd) : fd_(fd) { buffer_.reserve(kBuffer); }
  void write(const void* data, std::size_t size) override {
    const auto* bytes = static_cast<const char*>(data);
    if (buffer_.size() + size <= kBuffer) {
      buffer_.append(bytes, size);
      return;
    }
    flush();
    if (size < kBuffer) {
      buffer_.append(bytes, size);
    } else {
      send(bytes, size);
    }
  }
  void flush() {
    send(buffer_.data(), buffer_.size());
    buffer_.clear();
  }

 private:
  static constexpr std::size_t kBuffer = 1U << 16;
  void send(const char* bytes, std::size_t size) const {
    while (size > 0) {
      const ssize_t n = ::write(fd_, bytes, size);
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) std::_Exit(1);  // the parent has gone
      bytes += n;
      size -= std::size_t(n);
    }
  }
  int fd_;
  std::string buffer_;
};

std::string readFile(const std::filesystem::path& file) {
  const int fd = open(file.c_str(), O_RDONLY | O_CLOEXEC);
  struct stat facts {};
  if (fd < 0 || fstat(fd, &facts) != 0)
    throw ReadError(std::string("cannot be read (") + std::strerror(errno) + ")", "Check the file's permissions.");
  std::string bytes(std::size_t(facts.st_size), '\0');
  std::size_t held = 0;
  while (held < bytes.size()) {
    const ssize_t n = ::read(fd, bytes.data() + held, bytes.size() - held);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) throw ReadError(std::string("cannot be read (") + std::strerror(errno) + ")", "Check the disk.");
    if (n == 0) break;
    held += std::size_t(n);
  }
  close(fd);
  bytes.resize(held);
  return bytes;
}

RawScene readScene(const std::filesystem::path& file, const std::string& format) {
  const std::filesystem::path folder = file.parent_path();
  const std::string stem = file.stem().string();
  if (format == "fbx" || format == "dae" || format == "mesh") return readWithAssimp(file, format);
  const std::string bytes = readFile(file);
  if (format == "obj") return readObj(bytes, folder, stem);
  if (format == "ply") return readPly(bytes, stem);
  if (format == "stl") return readStl(bytes, stem);
  if (format == "off") return readOff(bytes, stem);
  if (format == "gltf" || format == "glb") return readGltf(bytes, folder);
  throw ReadError("has the unsupported format " + format);
}

void complain(int fd, const std::string& what, const std::string& cure) {
  DescriptorSink sink(fd);
  const WorkerAnswer answer = WorkerAnswer::complaint;
  sink.write(&answer, sizeof answer);
  for (const std::string& text : {what, cure}) {
    const std::string part = text.substr(0, 4096);
    const auto size = std::uint32_t(part.size());
    sink.write(&size, sizeof size);
    sink.write(part.data(), part.size());
  }
  sink.flush();
}

// One that may be raised again.
void limitSoftly(decltype(RLIMIT_CPU) resource, std::uint64_t value) {
  rlimit bound{};
  if (getrlimit(resource, &bound) != 0) return;
  bound.rlim_cur = std::min<rlim_t>(value, bound.rlim_max);
  setrlimit(resource, &bound);
}

// \return false where the stream ends.
bool receive(int fd, void* data, std::size_t size) {
  auto* out = static_cast<std::byte*>(data);
  while (size > 0) {
    const ssize_t n = ::read(fd, out, size);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    out += n, size -= std::size_t(n);
  }
  return true;
}

// Serves kPicturesFormat.
void answerPictures(int socket, std::uint64_t megabytes, double seconds) {
  limitSelf();
  limit(RLIMIT_FSIZE, kMaxTextureBytes);  // OpenCV reads HDR and EXR from files, which it makes for a moment
  const auto bound = [&] {
    if (!kSanitized) limitSoftly(RLIMIT_AS, addressSpace() + (megabytes << 20));
  };
  enum class Codecs { closed, open, missing } codecs = Codecs::closed;
  const auto openCodecs = [&] {
    limitSoftly(RLIMIT_AS, RLIM_INFINITY);
    try {
      pictureFiles();
      codecs = Codecs::open;
    } catch (const ToolError&) {
      codecs = Codecs::missing;
    }
    bound();
  };
  std::vector<std::byte> bytes;
  for (std::uint64_t size = 0; receive(socket, &size, sizeof size);) {
    limitSoftly(RLIMIT_AS, RLIM_INFINITY);
    bytes.resize(size);
    if (!receive(socket, bytes.data(), bytes.size())) return;
    bound();
    limitSoftly(RLIMIT_CPU, std::uint64_t(std::ceil(double(std::clock()) / double(CLOCKS_PER_SEC) + seconds)));
    PictureState state = PictureState::whole;
    if (!isWholeByStb(bytes)) {
      if (codecs == Codecs::closed) openCodecs();
      if (codecs == Codecs::open) state = pictureState(bytes);
    }
    DescriptorSink sink(socket);
    const char answer = char(state);
    sink.write(&answer, 1);
    sink.flush();
  }
}

}  // namespace

std::optional<std::string> readCompanionFile(const std::filesystem::path& folder, const std::string& name,
                                             std::uint64_t most) {
  const CompanionPath wanted(name);
  std::optional<std::filesystem::path> path;
  if (!wanted.outside) path = fileBelow(folder, wanted.written);
  if (!path) path = fileBelow(folder, wanted.written.filename());
  std::error_code error;
  if (!path || std::filesystem::file_size(*path, error) > most || error) return std::nullopt;
  try {
    return readFile(*path);
  } catch (const ReadError&) {
    return std::nullopt;
  }
}

int runImportWorker(int argument_count, char** arguments) {
  // sinew --import-worker FILE FORMAT FD MEGABYTES SECONDS
  if (argument_count != 7) return kWorkerUsage;
  const auto fd = parseInteger(arguments[4]);
  const auto megabytes = parseInteger(arguments[5]);
  const auto seconds = parseNumber(arguments[6]);
  if (!fd || *fd < 3 || *fd > 1023 || !megabytes || *megabytes < 1 || *megabytes > 1 << 24 || !seconds ||
      !(*seconds > 0 && *seconds < 1e6))
    return kWorkerUsage;
  const int output = int(*fd);
  if (std::string_view(arguments[3]) == kPicturesFormat) {
    answerPictures(output, std::uint64_t(*megabytes), *seconds);
    std::_Exit(0);
  }
  limitSelf(std::uint64_t(*megabytes), *seconds);
  try {
    const RawScene scene = readScene(arguments[2], arguments[3]);
    DescriptorSink sink(output);
    const WorkerAnswer answer = WorkerAnswer::scene;
    sink.write(&answer, sizeof answer);
    writeRawScene(scene, sink);
    sink.flush();
  } catch (const ReadError& error) {
    complain(output, error.what(), error.cure());
  } catch (const std::bad_alloc&) {
    std::_Exit(kWorkerOutOfMemory);
  } catch (const std::length_error&) {
    std::_Exit(kWorkerOutOfMemory);
  } catch (const std::exception& error) {
    complain(output, std::string("cannot be read (") + error.what() + ")", "");
  }
  std::_Exit(0);  // tearing a large scene down takes time and serves nobody
}

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/stage_cache.h"

#define XXH_INLINE_ALL
#include <link.h>
#include <sys/stat.h>
#include <xxhash.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>

#include "sinew/formats/version.h"
#include "tools/core/atomic_file.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

namespace fs = std::filesystem;

constexpr std::array<char, 8> kMagic = {'S', 'N', 'W', 'S', 'T', 'G', '0', '1'};

// In front of an entry's bytes.
struct EntryHeader {
  std::array<char, 8> magic = kMagic;
  StageKey key = {};
  StageKey checksum = {};  // of what follows, up to the end of the file
  std::uint64_t bytes = 0;
  double seconds = 0;  // what making it cost
};

StageKey addressOf(XXH128_hash_t hash) { return {hash.low64, hash.high64}; }

StageKey sumOf(std::span<const std::byte> bytes) { return addressOf(XXH3_128bits(bytes.data(), bytes.size())); }

// Reads a whole file; false where that fails.
bool readWhole(const fs::path& file, std::vector<std::byte>& bytes) {
  std::ifstream in(file, std::ios::binary | std::ios::ate);
  if (!in) return false;
  const std::streamoff size = in.tellg();
  if (size < 0) return false;
  bytes.resize(std::size_t(size));
  in.seekg(0);
  return bool(in.read(reinterpret_cast<char*>(bytes.data()), size));
}

// The program's own bytes, and which files its libraries are: another compiler, library or version may round otherwise.
StageKey programKey() {
  static const StageKey key = [] {
    StageWriter identity;
    std::string version = formats::kSoftwareVersion;
    identity(version);
    std::vector<std::byte> program;
    if (!readWhole("/proc/self/exe", program)) return StageKey{};
    StageKey sum = sumOf(program);
    identity(sum);
    dl_iterate_phdr(
        [](dl_phdr_info* info, std::size_t, void* into) {
          auto& out = *static_cast<StageWriter*>(into);
          std::string name = info->dlpi_name == nullptr ? "" : info->dlpi_name;
          struct stat facts {};
          if (name.empty() || stat(name.c_str(), &facts) != 0) return 0;
          std::array<std::int64_t, 3> state = {std::int64_t(facts.st_size), std::int64_t(facts.st_mtim.tv_sec),
                                               std::int64_t(facts.st_mtim.tv_nsec)};
          out(name);
          out(state);
          return 0;
        },
        &identity);
    return sumOf(identity.take());
  }();
  return key;
}

}  // namespace

StageKey stageKey(const std::vector<std::byte>& inputs) {
  std::array<StageKey, 2> both = {programKey(), sumOf(inputs)};
  StageWriter writer;
  writer(both);
  return sumOf(writer.take());
}

StageKey tetrahedraKey(const VisualMesh& mesh, const TetrahedraOptions& options) {
  StageWriter inputs;
  const auto add = [&](auto value) { inputs(value); };
  add(options);
  add(mesh.positions);
  add(mesh.triangles);
  add(mesh.triangle_face);
  add(mesh.sub_meshes);
  add(mesh.welded_positions);
  add(mesh.welded);
  add(mesh.weld_tolerance);
  add(mesh.bounds_min);
  add(mesh.bounds_max);
  add(mesh.diagonal);
  return stageKey(inputs.take());
}

fs::path StageCache::userFolder() {
  const auto variable = [](const char* name) {
    const char* value = std::getenv(name);
    return fs::path(value == nullptr ? "" : value);
  };
  if (programKey() == StageKey{}) return {};  // what cannot be named cannot be kept
  if (const fs::path cache = variable("XDG_CACHE_HOME"); cache.is_absolute()) return cache / "sinew";
  if (const fs::path home = variable("HOME"); home.is_absolute()) return home / ".cache" / "sinew";
  return {};
}

fs::path StageCache::entry(const std::string& stage, const StageKey& key) const {
  std::array<char, 40> digits{};
  std::snprintf(digits.data(), digits.size(), "%016llx%016llx", static_cast<unsigned long long>(key[1]),
                static_cast<unsigned long long>(key[0]));
  return folder_ / (std::string(digits.data()) + "." + stage);
}

bool StageCache::has(const std::string& stage, const StageKey& key) const {
  std::error_code error;
  return !folder_.empty() && fs::exists(entry(stage, key), error);
}

bool StageCache::load(const std::string& stage, const StageKey& key, std::vector<std::byte>& bytes, double& cost) {
  if (folder_.empty()) return false;
  const fs::path file = entry(stage, key);
  std::error_code error;
  if (!fs::is_regular_file(file, error) || !readWhole(file, bytes)) return false;
  EntryHeader header;
  const bool whole = bytes.size() >= sizeof header;
  if (whole) std::memcpy(&header, bytes.data(), sizeof header);
  // From `bytes` on the header counts for the sum too.
  constexpr std::size_t kSummed = offsetof(EntryHeader, bytes);
  if (!whole || header.magic != kMagic || header.key != key || header.bytes != bytes.size() - sizeof header ||
      header.checksum != sumOf(std::span(bytes).subspan(kSummed))) {
    ++damaged_;
    fs::remove(file, error);
    return false;
  }
  cost = header.seconds;
  bytes.erase(bytes.begin(), bytes.begin() + sizeof header);
  fs::last_write_time(file, fs::file_time_type::clock::now(), error);  // used just now
  return true;
}

void StageCache::store(const std::string& stage, const StageKey& key, const std::vector<std::byte>& bytes,
                       double cost) const {
  EntryHeader header;
  header.key = key;
  header.bytes = bytes.size();
  header.seconds = cost;
  if (sizeof header + bytes.size() > most_bytes_) return;
  std::vector<std::byte> file(sizeof header + bytes.size());
  std::memcpy(file.data(), &header, sizeof header);
  std::memcpy(file.data() + sizeof header, bytes.data(), bytes.size());
  header.checksum = sumOf(std::span(file).subspan(offsetof(EntryHeader, bytes)));
  std::memcpy(file.data(), &header, sizeof header);
  std::error_code error;
  fs::create_directories(folder_, error);
  if (error) return;
  try {
    writeFileAtomically(entry(stage, key), file);
  } catch (const ToolError&) {
    return;  // read-only or full: no cache
  }
  prune();
}

void StageCache::prune() const {
  struct Kept {
    fs::file_time_type used;
    std::uint64_t bytes;
    fs::path file;
    bool operator<(const Kept& other) const { return used != other.used ? used < other.used : file < other.file; }
  };
  std::vector<Kept> all;
  std::uint64_t total = 0;
  std::error_code error;
  for (fs::directory_iterator at(folder_, error), end; !error && at != end; at.increment(error)) {
    std::error_code gone;
    const Kept kept{at->last_write_time(gone), at->file_size(gone), at->path()};
    if (gone) continue;
    total += kept.bytes;
    all.push_back(kept);
  }
  if (total <= most_bytes_) return;
  std::sort(all.begin(), all.end());
  for (const Kept& kept : all) {
    if (total <= most_bytes_ / 4 * 3) break;
    fs::remove(kept.file, error);
    total -= kept.bytes;
  }
}

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
//
// Memory of an instance, size of the library, time to open a package and to add an instance.
#include <elf.h>
#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <memory>
#include <new>

#include "sinew/runtime/world.h"
#include "tools/bench/bench.h"
#include "tools/bench/lattice.h"

namespace sinew::tools {
namespace {

constexpr double kBytesPerVertex = 100;
constexpr double kLibraryBytes = 250 * 1024;

double bytesInUse() {
  const struct mallinfo2 info = mallinfo2();
  return double(info.uordblks) + double(info.hblkhd);
}

// An ELF file as `strip` leaves it, and the libraries it asks for. Empty `reason` where it could be read.
struct SharedLibrary {
  double stripped_bytes = 0;
  std::vector<std::string> needed;
  std::string reason;
};

template <class T>
T recordAt(const std::string& bytes, std::size_t offset) {
  T record{};
  if (offset + sizeof(T) <= bytes.size()) std::memcpy(&record, bytes.data() + offset, sizeof(T));
  return record;
}

SharedLibrary readLibrary(const std::filesystem::path& file) {
  SharedLibrary library;
  std::ifstream stream(file, std::ios::binary);
  if (!stream) {
    library.reason = "no " + file.filename().string() + " beside the program; name one with --library";
    return library;
  }
  const std::string bytes((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
  const auto header = recordAt<Elf64_Ehdr>(bytes, 0);
  if (std::memcmp(header.e_ident, ELFMAG, SELFMAG) != 0 || header.e_ident[EI_CLASS] != ELFCLASS64) {
    library.reason = "no 64-bit ELF file";
    return library;
  }
  const auto section = [&](std::size_t i) {
    return recordAt<Elf64_Shdr>(bytes, header.e_shoff + i * sizeof(Elf64_Shdr));
  };
  const Elf64_Shdr names = section(header.e_shstrndx);
  library.stripped_bytes = double(bytes.size());
  for (std::size_t i = 0; i < header.e_shnum; ++i) {
    const Elf64_Shdr s = section(i);
    const std::size_t name_at = names.sh_offset + s.sh_name;
    const std::string name = name_at < bytes.size() ? std::string(bytes.c_str() + name_at) : std::string();
    if (s.sh_type == SHT_SYMTAB || name == ".strtab" || name.starts_with(".debug")) {
      library.stripped_bytes -= double(s.sh_size) + sizeof(Elf64_Shdr);
    }
    if (s.sh_type != SHT_DYNAMIC) continue;
    const Elf64_Shdr strings = section(s.sh_link);
    for (std::size_t at = s.sh_offset; at < s.sh_offset + s.sh_size; at += sizeof(Elf64_Dyn)) {
      const auto entry = recordAt<Elf64_Dyn>(bytes, at);
      const std::size_t text = strings.sh_offset + entry.d_un.d_val;
      if (entry.d_tag == DT_NEEDED && text < bytes.size()) library.needed.emplace_back(bytes.c_str() + text);
    }
  }
  return library;
}

}  // namespace

void benchMemory(const BenchContext& context) {
  for (const std::uint32_t visual : {0U, 20'000U}) {
    const LatticeBody& body = blockBody(visual);
    constexpr unsigned kInstances = 16;
    WorldSettings settings;
    settings.ground.enabled = true;
    World world(settings);
    const auto grow = [&] {
      std::vector<Vec3> out(visual);
      for (unsigned i = 0; i < kInstances; ++i) {
        const auto id = world.addBody(body.asset);
        world.step(1.0F / 60);
        if (visual > 0) {
          const StridedFloat3 stream{out[0].data(), sizeof(Vec3), visual};
          world.visualVertices(*id, stream, stream);
        }
      }
      world.step(1.0F / 60);
    };
    grow();  // what the world itself needs, and what the allocator keeps
    const double before = bytesInUse();
    grow();
    BenchLine line = lineOf(visual == 0 ? "an instance" : "an instance, normals written", "bytes/vertex");
    line.value = (bytesInUse() - before) / kInstances / body.vertices;
    line.limit = "<= 100 a vertex";
    line.margin = kBytesPerVertex / line.value;
    line.note = std::to_string(body.vertices) + " vertices";
    context.emit(line);
  }
  // A world's bytes for each body that is stepped at the same time, however many bodies it has.
  const LatticeBody& body = blockBody(0);
  World world;
  const double before = bytesInUse();
  const auto first = world.addBody(body.asset);
  world.step(1.0F / 60);
  const double with_one = bytesInUse();
  const auto second = world.addBody(body.asset);
  world.step(1.0F / 60);
  BenchLine line = lineOf("scratch of a thread", "bytes");
  if (first && second) line.value = 2 * with_one - before - bytesInUse();
  line.note = "shared by all bodies of a world; of its largest field";
  context.emit(line);
}

void benchLibrary(const BenchContext& context) {
  std::filesystem::path file = context.options.library;
  if (file.empty() && !context.options.program.empty()) {
    file = context.options.program.parent_path().parent_path() / "lib" / "libsinew_runtime.so";
  }
  const SharedLibrary library = readLibrary(file);
  BenchLine size = lineOf("libsinew_runtime.so, stripped", "bytes");
  size.limit = "<= 250 KiB";
  BenchLine needs = lineOf("libraries it needs beyond C and C++", "libraries");
  needs.limit = "none";
  if (!library.reason.empty()) {
    size.value = needs.value = std::nan("");
    size.note = needs.note = library.reason;
  } else {
    size.value = library.stripped_bytes;
    size.margin = kLibraryBytes / size.value;
    for (const std::string& name : library.needed) {
      const bool known = name.starts_with("libstdc++.") || name.starts_with("libm.") || name.starts_with("libgcc_s.") ||
                         name.starts_with("libc.") || name.starts_with("ld-linux") || name.starts_with("libpthread.");
      if (!known) ++needs.value;
      needs.note += (needs.note.empty() ? "" : " ") + name;
    }
    needs.margin = needs.value == 0 ? 1 : 0.5;
  }
  context.emit(size);
  context.emit(needs);
}

void benchOpen(const BenchContext& context) {
  const LatticeBody& body = blockBody(context.options.quick ? 10'000 : 100'000);
  const std::unique_ptr<std::byte, void (*)(std::byte*)> aligned(
      static_cast<std::byte*>(::operator new(body.package.size(), std::align_val_t(formats::kSectionAlignment))),
      [](std::byte* p) { ::operator delete(p, std::align_val_t(formats::kSectionAlignment)); });
  std::copy(body.package.begin(), body.package.end(), aligned.get());
  const std::span<const std::byte> bytes(aligned.get(), body.package.size());
  BenchLine open = lineOf("open and check a package", "ms");
  const Timing open_timing = measure({[&] {
                                       const auto asset = Asset::inPlace(bytes);
                                       keepAlive(&asset);
                                     }},
                                     context.timing());
  open.value = 1e3 * open_timing.seconds;
  open.spread = open_timing.spread;
  open.note = std::to_string(body.package.size()) + " bytes, " + std::to_string(body.vertices) + " physical and " +
              std::to_string(body.visual_vertices) + " visual vertices";
  context.emit(open);

  World world;
  BodyId last{};
  BenchLine add = lineOf("add an instance", "ms");
  const Timing add_timing = measure({[&] { last = *world.addBody(body.asset); },
                                     [&] {
                                       if (last.value != BodyId{}.value) world.removeBody(last);
                                     },
                                     1},
                                    context.timing());
  add.value = 1e3 * add_timing.seconds;
  add.spread = add_timing.spread;
  context.emit(add);
}

}  // namespace sinew::tools

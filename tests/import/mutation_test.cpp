// SPDX-License-Identifier: GPL-3.0-or-later
// Damages good files at random places and gives them to the readers in this process, so that a sanitizer sees every
// step. Seeds are fixed: a failure repeats.
#include <random>

#include "tests/import/import_fixture.h"
#include "tools/import/assemble.h"
#include "tools/import/readers.h"

namespace sinew::tools {
namespace {

std::string fileBytes(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

std::string damaged(const std::string& whole, std::mt19937& random) {
  std::string bytes = whole;
  const auto below = [&](std::size_t n) { return std::size_t(random()) % n; };
  static constexpr const char* kPieces[] = {
      "-1", "4294967295", "99999999999999999999", "nan", "1e999", "0", "\n", " ", "/", "\"", "{", "]", "-0.5", "3"};
  const std::size_t edits = 1 + below(4);
  for (std::size_t e = 0; e < edits && !bytes.empty(); ++e) {
    switch (below(6)) {
      case 0:
        bytes[below(bytes.size())] = char(random() & 255);
        break;
      case 1:
        bytes[below(bytes.size())] ^= char(1 << below(8));
        break;
      case 2:
        bytes.resize(below(bytes.size()) + 1);
        break;
      case 3:
        bytes.erase(below(bytes.size()), 1 + below(12));
        break;
      case 4:
        bytes.insert(below(bytes.size()), kPieces[below(std::size(kPieces))]);
        break;
      default: {
        const std::size_t at = below(bytes.size());
        const std::string_view piece = kPieces[below(std::size(kPieces))];
        bytes.replace(at, std::min(piece.size(), bytes.size() - at), piece);
      }
    }
  }
  return bytes;
}

/// \return how many of the damaged files were still read.
template <class Read>
std::size_t mutate(const std::string& whole, const std::string& format, std::size_t rounds, Read read) {
  std::mt19937 random(12345);
  const ImportOptions options;
  std::size_t readable = 0;
  for (std::size_t i = 0; i < rounds; ++i) {
    const std::string bytes = damaged(whole, random);
    try {
      RawScene scene = read(bytes);
      validateRawScene(scene);
      checkInvariants(assembleVisualMesh(std::move(scene), "mutated." + format, format, options));
      ++readable;
    } catch (const ReadError&) {
    } catch (const ToolError& error) {
      EXPECT_EQ(int(error.code()), int(ExitCode::bad_input));
    }
  }
  return readable;
}

TEST(Mutation, Obj) {
  const std::string whole =
      "mtllib a.mtl\no first\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0\nv 0 0 1 1 1 1\nvt 0 0\nvt 1 0.5\nvn 0 0 1\ng body "
      "lip\nusemtl m\nf 1/1/1 3/2/1 2//1\nf -4 -3 4\nf 1 4 3 \\\n 2\n# end\nf 2/1 3/2 4\nl 1 2\n";
  EXPECT_GT(mutate(whole, "obj", 4000, [](const std::string& b) { return readObj(b, "/nonexistent", "a"); }), 100U);
}

TEST(Mutation, Ply) {
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\nproperty "
      "uchar red\nproperty uchar green\nproperty uchar blue\nproperty float q\nelement face 4\nproperty list uchar int "
      "vertex_indices\nproperty list uchar float texcoord\nend_header\n";
  const std::string whole = head +
                            "0 0 0 255 0 0 1\n1 0 0 0 255 0 2\n0 1 0 0 0 255 3\n0 0 1 9 9 9 4\n3 0 2 1 6 0 0 1 0 1 "
                            "1\n3 0 1 3 6 0 0 1 0 1 1\n3 0 3 2 0\n3 1 2 3 0\n";
  EXPECT_GT(mutate(whole, "ply", 4000, [](const std::string& b) { return readPly(b, "a"); }), 100U);
  const std::string binary = fileBytes(kAssets / "models/penguin_painted.ply");
  mutate(binary.substr(0, 20000), "ply", 200, [](const std::string& b) { return readPly(b, "a"); });
  EXPECT_GT(mutate(binary, "ply", 60, [](const std::string& b) { return readPly(b, "a"); }), 5U);
}

TEST(Mutation, Stl) {
  const std::string whole = fileBytes(kAssets / "generated/cube_soup.stl");
  mutate(whole, "stl", 300, [](const std::string& b) { return readStl(b, "a"); });
  const std::string text =
      "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid "
      "a\n";
  EXPECT_GT(mutate(text, "stl", 3000, [](const std::string& b) { return readStl(b, "a"); }), 50U);
}

TEST(Mutation, Off) {
  const std::string whole =
      "COFF\n4 4 6\n0 0 0 255 0 0 255\n1 0 0 0 255 0 255\n0 1 0 0 0 255 0\n0 0 1 51 51 51 255\n3 0 2 1\n3 0 1 3\n3 0 3 "
      "2\n3 1 2 3\n";
  EXPECT_GT(mutate(whole, "off", 4000, [](const std::string& b) { return readOff(b, "a"); }), 50U);
}

TEST(Mutation, Gltf) {
  const auto read = [](const std::string& b) { return readGltf(b, "/nonexistent"); };
  const std::string hand = fileBytes(kAssets / "models/hand_rigged.glb");
  // Most damage of a GLB falls on numbers; the JSON is where structure breaks.
  EXPECT_GT(mutate(hand, "glb", 150, read), 5U);
  std::uint32_t json_size = 0;
  std::memcpy(&json_size, hand.data() + 12, 4);
  std::mt19937 random(99);
  for (int i = 0; i < 1500; ++i) {
    std::string json = damaged(hand.substr(20, json_size), random);
    json.resize(json_size, ' ');
    try {
      RawScene scene = read(hand.substr(0, 20) + json + hand.substr(20 + json_size));
      validateRawScene(scene);
    } catch (const ReadError&) {
    }
  }
}

}  // namespace
}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include <bit>
#include <cctype>

#include "tests/import/import_fixture.h"

namespace sinew::tools {
namespace {

class Ply : public ImportTest {};
class Stl : public ImportTest {};
class Off : public ImportTest {};

template <class T>
void put(std::string& out, T value, bool big) {
  std::array<char, sizeof(T)> bytes{};
  std::memcpy(bytes.data(), &value, sizeof value);
  if (big) std::reverse(bytes.begin(), bytes.end());
  out.append(bytes.data(), bytes.size());
}

constexpr double kCorner[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
constexpr int kFace[4][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};

/// A tetrahedron with doubles, 8-bit colours, an unknown scalar, an unknown list and an unused vertex in front.
std::string plyBody(int encoding) {  // 0 text, 1 little, 2 big endian
  std::string out =
      std::string("ply\nformat ") +
      (encoding == 0   ? "ascii"
       : encoding == 1 ? "binary_little_endian"
                       : "binary_big_endian") +
      " 1.0\ncomment made by hand\nelement vertex 5\nproperty double x\nproperty double y\nproperty double z\nproperty "
      "uchar red\nproperty uchar green\nproperty uchar blue\n"
      "property float quality\nproperty list uchar short tags\nelement face 4\nproperty uchar flags\nproperty list "
      "uchar int vertex_indices\nelement edge 1\nproperty int vertex1\nproperty int vertex2\nend_header\n";
  const bool big = encoding == 2;
  for (int v = -1; v < 4; ++v) {
    const double unused[3] = {50, 50, 50};
    const double* p = v < 0 ? unused : kCorner[v];
    if (encoding == 0) {
      out += std::to_string(p[0]) + " " + std::to_string(p[1]) + " " + std::to_string(p[2]) + " 255 51 0 " +
             std::to_string(v + 1) + ".5 2 -1 7\n";
    } else {
      for (int k = 0; k < 3; ++k) put(out, p[k], big);
      out += "\xff\x33";
      out += '\0';
      put(out, float(v + 1) + 0.5F, big);
      out += '\2';
      put(out, std::int16_t(-1), big);
      put(out, std::int16_t(7), big);
    }
  }
  for (const auto& f : kFace) {
    if (encoding == 0) {
      out += "9 3 " + std::to_string(f[0] + 1) + " " + std::to_string(f[1] + 1) + " " + std::to_string(f[2] + 1) + "\n";
    } else {
      out += "\x09\x03";
      for (int k = 0; k < 3; ++k) put(out, std::int32_t(f[k] + 1), big);
    }
  }
  if (encoding == 0) {
    out += "1 2\n";
  } else {
    put(out, std::int32_t(1), big);
    put(out, std::int32_t(2), big);
  }
  return out;
}

TEST_F(Ply, AllEncodingsGiveTheSameMesh) {
  for (int encoding = 0; encoding < 3; ++encoding) {
    SCOPED_TRACE(encoding);
    const VisualMesh mesh = importFile(write("a.ply", plyBody(encoding)));
    EXPECT_EQ(mesh.source_vertex_count, 5U);
    EXPECT_EQ(mesh.unreferenced, std::vector<std::uint32_t>{0});
    EXPECT_EQ(mesh.source_vertex, (std::vector<std::uint32_t>{1, 2, 3, 4}));
    EXPECT_EQ(mesh.positions[3], Eigen::Vector3d(0, 0, 1));
    EXPECT_EQ(mesh.colors[0], (std::array<float, 4>{1, float(51 / 255.0), 0, 1}));
    ASSERT_NE(attributeOf(mesh, "quality"), nullptr);
    EXPECT_EQ(attributeOf(mesh, "quality")->values, (std::vector<float>{1.5F, 2.5F, 3.5F, 4.5F}));
    EXPECT_EQ(findingOf(mesh, "dropped-primitives")->place, "edge");
    EXPECT_NEAR(volumeOf(mesh), 1.0 / 6, 1e-15);
  }
}

TEST_F(Ply, EveryTruncationIsRefused) {
  for (int encoding = 1; encoding < 3; ++encoding) {
    const std::string whole = plyBody(encoding);
    const std::size_t header = whole.find("end_header\n") + 11;
    for (std::size_t size : {std::size_t(3), std::size_t(40), header - 5, header, header + 1, header + 100,
                             whole.size() - 20, whole.size() - 1}) {
      SCOPED_TRACE(size);
      refusal(write("a.ply", whole.substr(0, size)));
    }
  }
}

TEST_F(Ply, StripsBecomeTriangles) {
  const VisualMesh mesh =
      importFile(write("a.ply",
                       "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float "
                       "z\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n"
                       "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n1 2 0\n9 0 1 2 3 -1 2 3 4 5\n"));
  ASSERT_EQ(mesh.triangles.size(), 4U);
  EXPECT_EQ(findingOf(mesh, "flipped-faces"), nullptr) << "every second triangle of a strip turns round";
  for (const Triangle& t : mesh.triangles)
    EXPECT_GT((mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]).z(), 0);
}

TEST_F(Ply, WedgeUvsSplitVerticesAtSeamsOnly) {
  write("skin.png", "\x89PNG\r\n\x1a\n");
  const VisualMesh mesh =
      importFile(write("a.ply",
                       "ply\nformat ascii 1.0\ncomment TextureFile skin.png\nelement vertex 4\nproperty float "
                       "x\nproperty float y\nproperty float z\nelement face 2\nproperty list uchar int "
                       "vertex_indices\nproperty list uchar float texcoord\nend_header\n"
                       "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 6 0 0 1 0 1 1\n3 0 2 3 6 0 0 0.5 0.5 0 1\n"));
  EXPECT_EQ(mesh.positions.size(), 5U);
  EXPECT_EQ(mesh.welded_positions.size(), 4U);
  ASSERT_EQ(mesh.textures.size(), 1U);
  EXPECT_EQ(mesh.textures[0].mime, "image/png");
}

TEST_F(Ply, FaultsAreNamed) {
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face "
      "1\nproperty list uchar int vertex_indices\nend_header\n";
  expectRefusal(write("nan.ply", head + "0 0 0\n1 0 nan\n0 1 0\n3 0 1 2\n"), "vertex 1");
  expectRefusal(write("index.ply", head + "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"),
                "face 0 (line 4 of the body) names vertex 3 of 3");
  expectRefusal(write("negative.ply", head + "0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n"), "names vertex -1 of 3");
  expectRefusal(write("list.ply", head + "0 0 0\n1 0 0\n0 1 0\n4000000000 0 1 2\n"), "more than the file holds");
  expectRefusal(write("count.ply",
                      "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nproperty "
                      "float y\nproperty float z\nend_header\n123"),
                "more than the file holds");
  expectRefusal(write("format.ply", "ply\nformat zip 1.0\nend_header\n"), "unknown format");
  expectRefusal(write("none.ply",
                      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float "
                      "z\nend_header\n0 0 0\n"),
                "has no faces");
  expectRefusal(write("flat.ply",
                      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nend_header\n0 0\n"),
                "without x, y and z");
}

TEST_F(Ply, HeaderLinesThatNoPlyHasAreSkippedAndSaid) {
  const VisualMesh mesh = importFile(write(
      "a.ply",
      "ply\nformat ascii 1.0\nCreated by an old scanner\nelement vertex 3\nproperty float x\nproperty float "
      "y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 "
      "0\n3 0 1 2\n"));
  EXPECT_EQ(mesh.triangles.size(), 1U);
  const Finding* const finding = findingOf(mesh, "unknown-header");
  ASSERT_NE(finding, nullptr);
  EXPECT_EQ(finding->severity, Severity::warning);
  EXPECT_NE(finding->message.find("\"Created by an old scanner\" (line 3 of the header)"), std::string::npos)
      << finding->message;
}

TEST_F(Ply, HeaderLinesBeyondAsciiAreSkippedAndSaid) {
  const struct {
    const char* line;
    const char* said;
  } kLines[] = {{"\xc2\xa9 2004 Foo", "\"\xc2\xa9 2004 Foo\" (line 3 of the header)"},
                {"\xa9 2004 Foo", "\"\xc2\xa9 2004 Foo\" (line 3 of the header)"},
                {"Cr\xc3\xa9\xc3\xa9 par Maya", "\"Cr\xc3\xa9\xc3\xa9 par Maya\""},
                {"Cr\xe9\xe9 par Maya", "\"Cr\xc3\xa9\xc3\xa9 par Maya\""}};
  const auto file = [](const std::string& line) {
    return "ply\nformat ascii 1.0\n" + line +
           "\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list "
           "uchar "
           "int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
  };
  for (const auto& [line, said] : kLines) {
    const VisualMesh mesh = importFile(write("a.ply", file(line)));
    EXPECT_EQ(mesh.triangles.size(), 1U);
    const Finding* const finding = findingOf(mesh, "unknown-header");
    ASSERT_NE(finding, nullptr) << line;
    EXPECT_NE(finding->message.find(said), std::string::npos) << finding->message;
  }
  expectRefusal(write("b.ply", file("\1\2\3 no text")), "unknown header statement");
}

TEST_F(Ply, BytesBehindABinaryBodyAreSaid) {
  const std::string head =
      "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty char x\nproperty char y\nproperty char "
      "z\nelement "
      "face 1\nproperty list uchar uchar vertex_indices\nend_header\n";
  const std::string body = {0, 0, 0, 1, 0, 0, 0, 1, 0, 3, 0, 1, 2};
  EXPECT_EQ(findingOf(importFile(write("whole.ply", head + body)), "trailing-bytes"), nullptr);
  const VisualMesh mesh = importFile(write("more.ply", head + body + "more"));
  EXPECT_EQ(mesh.triangles.size(), 1U);
  const Finding* const finding = findingOf(mesh, "trailing-bytes");
  ASSERT_NE(finding, nullptr);
  EXPECT_EQ(finding->severity, Severity::warning);
  EXPECT_EQ(finding->count, 4U);
}

TEST_F(Ply, FacesMayComeBeforeVertices) {
  const std::string head =
      "ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_indices\nelement vertex 3\nproperty float "
      "x\nproperty float y\nproperty float z\nend_header\n";
  const VisualMesh mesh = importFile(write("a.ply", head + "3 0 1 2\n0 0 0\n1 0 0\n0 1 0\n"));
  ASSERT_EQ(mesh.triangles.size(), 1U);
  EXPECT_EQ(mesh.positions[mesh.triangles[0][1]], Eigen::Vector3d(1, 0, 0));
  expectRefusal(write("index.ply", head + "3 0 1 3\n0 0 0\n1 0 0\n0 1 0\n"), "names vertex 3 of 3");
  expectRefusal(write("cut.ply", head + "3 0 1 2\n0 0 0\n1 0 0\n"), "vertex 2 (line 4 of the body) is missing");
  expectRefusal(
      write("none.ply",
            "ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n3 0 1 2\n"),
      "names vertex 0 of 0");
}

TEST_F(Ply, ContentWithoutExtension) { EXPECT_EQ(importFile(write("scan", plyBody(1))).format, "ply"); }

std::string stlBody(std::uint32_t promised, const std::string& head = "binary") {
  std::string out = head;
  out.resize(80, ' ');
  put(out, promised, false);
  for (const auto& f : kFace) {
    for (int k = 0; k < 3; ++k) put(out, 0.0F, false);
    for (int v : f)
      for (double c : kCorner[v]) put(out, float(c), false);
    put(out, std::uint16_t(0), false);
  }
  return out;
}

TEST_F(Stl, BinaryIsToldByItsSizeEvenIfItSaysSolid) {
  for (const char* head : {"binary", "solid from a bad exporter", "solid facet normal"}) {
    const VisualMesh mesh = importFile(write("a.stl", stlBody(4, head)));
    EXPECT_EQ(mesh.source_vertex_count, 12U);
    EXPECT_EQ(mesh.welded_positions.size(), 4U);
    EXPECT_EQ(findingOf(mesh, "welded-vertices")->count, 8U);
    EXPECT_FALSE(mesh.had_normals);
  }
}

TEST_F(Stl, WrongCounts) {
  expectRefusal(write("more.stl", stlBody(5)), "promises 5 triangles but holds 4");
  expectRefusal(write("huge.stl", stlBody(0xffffffffU)), "promises 4294967295 triangles");
  expectRefusal(write("cut.stl", stlBody(4).substr(0, 84 + 120)), "promises 4 triangles but holds 2");
  std::string begins_like_text = stlBody(4).substr(0, 84 + 120);
  begins_like_text.replace(0, 5, "solid");
  expectRefusal(write("cut_solid.stl", begins_like_text), "promises 4 triangles but holds 2");
  expectRefusal(write("short.stl", "abc"), "is no STL");
  const VisualMesh mesh = importFile(write("tail.stl", stlBody(4) + "made with love"));
  EXPECT_EQ(findingOf(mesh, "trailing-bytes")->count, 14U);
}

TEST_F(Stl, TextOfAnotherFormatIsNamed) {
  std::string obj = "# a tetrahedron\no tetrahedron\n";
  for (const auto& c : kCorner)
    obj += "v " + std::to_string(c[0]) + " " + std::to_string(c[1]) + " " + std::to_string(c[2]) + "\n";
  obj += "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
  ASSERT_GT(obj.size(), 84U);
  expectRefusal(write("obj.stl", obj), "is no STL: it looks like OBJ text. Rename it to end in .obj.");
  expectRefusal(write("short_obj.stl", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), "looks like OBJ");
  expectRefusal(write("off.stl", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"), "looks like OFF");
  expectRefusal(write("ply.stl", plyBody(0)), "looks like PLY");
  expectRefusal(write("text.stl", std::string(200, 'x')), "is no STL: it is text without facets");
}

TEST_F(Stl, TextInCapitalsAndTextThatWasCutOff) {
  const std::string facet =
      "facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1e0 0\nendloop\nendfacet\n";
  std::string capitals = "solid s\n" + facet + "endsolid s\n";
  for (char& c : capitals) c = char(std::toupper(c));
  const VisualMesh mesh = importFile(write("capitals.stl", capitals));
  EXPECT_EQ(mesh.triangles.size(), 1U);
  EXPECT_EQ(findingOf(mesh, "unended-solid"), nullptr);
  expectRefusal(write("cut.stl", "solid s\n" + facet + "facet "), "ends within a facet (line 9)");
  const VisualMesh unended = importFile(write("unended.stl", "solid s\n" + facet));
  EXPECT_NE(findingOf(unended, "unended-solid"), nullptr);
}

TEST_F(Stl, Text) {
  const VisualMesh mesh = importFile(write(
      "a.stl",
      "solid left hand\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nvertex 1 0 0\nendloop\nendfacet\n"
      "facet normal 0 0 0\n outer loop\n\tvertex 0 0 0\n vertex 1 0 0\n vertex 0 0 1\n endloop\n endfacet\nendsolid "
      "left hand\n"
      "solid right\r\nfacet normal 0 0 0\r\nouter loop\r\nvertex 0 0 0\r\nvertex 0 0 1\r\nvertex 0 1 "
      "0\r\nendloop\r\nendfacet\r\n"
      "facet normal 0 0 0\nouter loop\nvertex 1 0 0\nvertex 0 1 0\nvertex 0 0 1\nendloop\nendfacet\nendsolid\n"));
  EXPECT_EQ(mesh.triangles.size(), 4U);
  ASSERT_EQ(mesh.sub_meshes.size(), 2U);
  EXPECT_EQ(mesh.sub_meshes[0].mesh, "left hand");
  EXPECT_NEAR(volumeOf(mesh), 1.0 / 6, 1e-15);
  expectRefusal(write("quad.stl",
                      "solid\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nvertex 1 0 0\nvertex 1 1 "
                      "0\nendloop\nendfacet\nendsolid\n"),
                "no triangle (line 8)");
  expectRefusal(write("nan.stl",
                      "solid\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 nan 0\nvertex 1 0 "
                      "0\nendloop\nendfacet\nendsolid\n"),
                "vertex 1 of triangle 0");
}

TEST_F(Off, PlainAndWithExtras) {
  const VisualMesh plain = importFile(write("a.off",
                                            "OFF # comment\n# another\n5 4 0\n9 9 9\n0 0 0\n1 0 0 # here\n0 1 0\n0 0 "
                                            "1\n3 1 3 2\n3 1 2 4 255 0 0\n\n3 1 4 3\n3 2 3 4\n"));
  EXPECT_EQ(plain.source_vertex_count, 5U);
  EXPECT_EQ(plain.unreferenced, std::vector<std::uint32_t>{0});
  EXPECT_NEAR(volumeOf(plain), 1.0 / 6, 1e-15);
  const VisualMesh colored = importFile(write("c.off",
                                              "COFF 4 4 6\n0 0 0 255 0 0 255\n1 0 0 0 255 0 255\n0 1 0 0 0 255 0\n0 0 "
                                              "1 51 51 51 255\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"));
  EXPECT_EQ(colored.colors[1], (std::array<float, 4>{0, 1, 0, 1}));
  EXPECT_EQ(colored.colors[2][3], 0.0F);
  const VisualMesh normals = importFile(write(
      "n.off",
      "NOFF\n4 4 6\n0 0 0 -1 -1 -1\n1 0 0 1 0 0\n0 1 0 0 1 0\n0 0 1 0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"));
  EXPECT_TRUE(normals.had_normals);
  EXPECT_TRUE(normals.normals[0].isApprox(Eigen::Vector3f(-1, -1, -1).normalized()));
}

TEST_F(Off, ACommentMayFollowANumberAtOnce) {
  const VisualMesh mesh =
      importFile(write("a.off",
                       "COFF#colours\n4 4 6#counts\n0 0 0 0.9 0 0#red\n1 0 0 0 0 0.9#blue 1\n0 1 0 0 "
                       "0 0.9\n0 0 1 0.9 0 0\n3 0 2 1#one\n3 0 1 3 0.9 0 0#two\n3 0 3 2 # three\n3 1 2 3\n"));
  EXPECT_EQ(mesh.triangles.size(), 4U);
  EXPECT_EQ(mesh.colors[1], (std::array<float, 4>{0, 0, 0.9F, 1}));
  expectRefusal(write("few.off", "OFF\n3 1 0\n0 0 0\n1 0#0\n0 1 0\n3 0 1 2\n"),
                "vertex 1 has too few numbers (line 4)");
  expectRefusal(write("nan.off", "OFF\n3 1 0\n0 0 0\n1 0 1.#IND\n0 1 0\n3 0 1 2\n"), "vertex 1 (line 4)");
}

TEST_F(Off, Faults) {
  expectRefusal(write("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"), "face 0 names vertex 3 of 3 (line 6)");
  expectRefusal(write("b.off", "OFF\n3 9 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"), "face 1 of 9 is missing");
  expectRefusal(write("c.off", "OFF\n3 1 0\n0 0 0\n1 0\n0 1 0\n3 0 1 2\n"), "vertex 1 has too few numbers");
  expectRefusal(write("d.off", "OFF\n3 1 0\n0 0 0\n1 0 inf\n0 1 0\n3 0 1 2\n"), "vertex 1 (line 4)");
  expectRefusal(write("e.off", "OFF\n99999999999 1 0\n"), "more than the file holds");
  expectRefusal(write("f.off", "4OFF\n3 1 0\n"), "four or more dimensions");
  expectRefusal(write("g.off", "hello"), "is no OFF");
}

}  // namespace
}  // namespace sinew::tools

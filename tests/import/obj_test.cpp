// SPDX-License-Identifier: GPL-3.0-or-later
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "tests/import/import_fixture.h"

namespace sinew::tools {
namespace {

constexpr const char* kTetrahedron = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

class Obj : public ImportTest {};

TEST_F(Obj, KeepsTheNumbersOfSourceVerticesAndFaces) {
  // Unused vertices before, between and after; two UVs at one vertex; faces in two materials.
  const VisualMesh mesh =
      importFile(write("a.obj",
                       "v 9 9 9\nv 0 0 0\nv 1 0 0\nv 7 7 7\nv 0 1 0\nv 0 0 1\nv -9 0 0\n"
                       "vt 0 0\nvt 1 0\nvt 0.5 1\n"
                       "usemtl b\nf 2/1 5/2 3/3\nusemtl a\nf 2/1 3/2 6/3\nusemtl b\nf 2/3 6/2 5/1\nf 3/1 5/2 6/3\n"));
  EXPECT_EQ(mesh.source_vertex_count, 7U);
  EXPECT_EQ(mesh.unreferenced, (std::vector<std::uint32_t>{0, 3, 6}));
  EXPECT_EQ(mesh.source_face_count, 4U);
  EXPECT_EQ(mesh.welded_positions.size(), 4U);
  // Sub-meshes in order of first use: b has faces 0, 2, 3, a has face 1.
  ASSERT_EQ(mesh.sub_meshes.size(), 2U);
  EXPECT_EQ(mesh.materials[mesh.sub_meshes[0].material].name, "b");
  EXPECT_EQ(mesh.materials[mesh.sub_meshes[1].material].name, "a");
  EXPECT_EQ(mesh.triangle_face, (std::vector<std::uint32_t>{0, 2, 3, 1}));
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    static const Eigen::Vector3d kAt[] = {{9, 9, 9}, {0, 0, 0}, {1, 0, 0}, {7, 7, 7}, {0, 1, 0}, {0, 0, 1}, {-9, 0, 0}};
    EXPECT_EQ(mesh.positions[v], kAt[mesh.source_vertex[v]]);
  }
  EXPECT_EQ(mesh.bounds_max, Eigen::Vector3d(1, 1, 1));
  EXPECT_EQ(findingOf(mesh, "unreferenced-vertices")->count, 3U);
  EXPECT_EQ(findingOf(mesh, "missing-material")->place, "b, a");
}

TEST_F(Obj, UvSeamsStaySplitAndShareAWeldedPoint) {
  const VisualMesh mesh =
      importFile(write("a.obj",
                       "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0.25 0.75\nvt 0.5 0.5\n"
                       "f 1/1 2/2 3/3\nf 1/4 3/5 4/1\n"));
  EXPECT_EQ(mesh.positions.size(), 6U);
  EXPECT_EQ(mesh.welded_positions.size(), 4U);
  EXPECT_EQ(findingOf(mesh, "seams")->count, 2U);
  EXPECT_EQ(findingOf(mesh, "welded-vertices"), nullptr) << "one source vertex with two UVs is no merge";
  const Triangle second = mesh.triangles[1];
  EXPECT_EQ(mesh.uvs[second[0]], Eigen::Vector2f(0.25F, 0.75F));
  EXPECT_EQ(mesh.source_vertex[second[0]], 0U);
}

TEST_F(Obj, AFaceMayBelongToSeveralGroupsAndGroupsMergeByName) {
  const VisualMesh mesh = importFile(write(
      "a.obj",
      std::string("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n") +
          "g body lip_upper\nf 1 3 2\ng body\nf 1 2 4\ng lip_upper  body lip_upper\nf 1 4 3\ng other\nf 2 3 4\n"));
  ASSERT_EQ(mesh.groups.size(), 3U);
  EXPECT_EQ(groupOf(mesh, "body")->triangles, (std::vector<std::uint32_t>{0, 1, 2}));
  EXPECT_EQ(groupOf(mesh, "lip_upper")->triangles, (std::vector<std::uint32_t>{0, 2}));
  EXPECT_EQ(groupOf(mesh, "other")->vertices, (std::vector<std::uint32_t>{1, 2, 3}));
  EXPECT_EQ(mesh.sub_meshes.size(), 1U) << "groups do not split meshes";
}

TEST_F(Obj, ReadsEveryWayOfWriting) {
  const VisualMesh plain = importFile(write("plain.obj", kTetrahedron));
  const struct {
    const char* name;
    const char* text;
  } kWays[] = {
      {"crlf", "v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nv 0 0 1\r\nf 1 3 2\r\nf 1 2 4\r\nf 1 4 3\r\nf 2 3 4\r\n"},
      {"cr", "v 0 0 0\rv 1 0 0\rv 0 1 0\rv 0 0 1\rf 1 3 2\rf 1 2 4\rf 1 4 3\rf 2 3 4\r"},
      {"byte order mark", "\xEF\xBB\xBFv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"},
      {"tabs", "v\t0\t0 0\n \t v 1   0\t0\nv 0 1 0\t\nv 0 0 1\nf\t1 3\t2\nf 1 2 4\nf 1 4 3\nf 2 3 4"},
      {"comments",
       "# v 8 8 8\nv 0 0 0 # first\nv 1 0 0\nv 0 1 0\t#\nv 0 0 1\nf 1 3 2 # f 1 1 1\nf 1 2 4\nf 1 4 3\nf 2 3 4\n#"},
      {"continuations", "v 0 \\\n0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 \\\r\n3 \\\n2\nf 1 2 4\nf 1 4 3\nf 2 3 \\\n4\n"},
      {"negative indices", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -1 -2\nv 0 0 1\nf -4 -3 -1\nf 1 -1 -2\nf -3 -2 -1\n"},
      {"faces first", "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"},
      {"number forms",
       "v +0 0. .0e5\nv 1e0 -0 0.0\nv 0 1.0E+0 0\nv 1e-400 0 1.000000000\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"},
      {"weights", "v 0 0 0 1\nv 1 0 0 1.0\nv 0 1 0 1\nv 0 0 1 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"},
      {"normals without uvs",
       "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 0 0 0\nf 1//1 3//1 2//1\nf 1//1 2//1 4//1\nf 1//1 4//1 3//1\nf 2//1 "
       "3//1 4//1\n"},
      {"trailing slashes", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1/ 3/ 2/\nf 1// 2// 4//\nf 1 4 3\nf 2 3 4\n"},
  };
  for (const auto& way : kWays) {
    SCOPED_TRACE(way.name);
    const VisualMesh mesh = importFile(write(std::string(way.name) + ".obj", way.text));
    EXPECT_EQ(mesh.positions, plain.positions);
    EXPECT_EQ(mesh.triangles, plain.triangles);
    EXPECT_EQ(mesh.source_vertex, plain.source_vertex);
  }
}

TEST_F(Obj, VertexColoursMayBeMissingInPlaces) {
  const VisualMesh mesh = importFile(
      write("a.obj", "v 0 0 0\nv 1 0 0 1 0.5 0.25\nv 0 1 0 0 1 0 0.5\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"));
  ASSERT_EQ(mesh.colors.size(), 4U);
  EXPECT_EQ(mesh.colors[0], (std::array<float, 4>{0, 0, 0, 0}));
  EXPECT_EQ(mesh.colors[1], (std::array<float, 4>{1, 0.5F, 0.25F, 1}));
  EXPECT_EQ(mesh.colors[2], (std::array<float, 4>{0, 1, 0, 0.5F}));
}

TEST_F(Obj, ObjectsNameRunsOfSourceVerticesAndSubMeshes) {
  const VisualMesh mesh = importFile(write(
      "a.obj",
      "v 5 5 5\no first one\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 2 3 4\no second\nv 0 0 1\nv 1 0 1\nv 0 1 1\nf 5 6 7\n"));
  ASSERT_EQ(mesh.source_meshes.size(), 3U);
  EXPECT_EQ(mesh.source_meshes[0].name, "a");
  EXPECT_EQ(mesh.source_meshes[1].name, "first one");
  EXPECT_EQ(mesh.source_meshes[2].first_source_vertex, 4U);
  ASSERT_EQ(mesh.sub_meshes.size(), 2U);
  EXPECT_EQ(mesh.sub_meshes[1].mesh, "second");
}

TEST_F(Obj, MaterialsAndTexturesAreFoundBesideTheFile) {
  const std::string png = "\x89PNG\r\n\x1a\n rest";
  write("Textures/Skin Map.PNG", png);
  write("plain.png", png);
  write("with blanks.mtl",
        "newmtl skin\nKd 0.1 0.2 0.3\nd 0.5\nmap_Kd -s 1 1 1 -o 0.5 .\\textures\\skin map.png\nnewmtl unused\nmap_Kd "
        "nowhere.png\n"
        "newmtl gone\r\nmap_Kd C:\\Users\\me\\lost.png\r\nnewmtl absolute\nmap_Kd C:\\Users\\me\\plain.png\nnewmtl "
        "out\nmap_Kd ../../etc/passwd\n");
  const VisualMesh mesh =
      importFile(write("a.obj",
                       "mtllib with blanks.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl skin\nf 1 3 2\nusemtl "
                       "gone\nf 1 2 4\nusemtl absolute\nf 1 4 3\nusemtl out\nf 2 3 4\n"));
  ASSERT_EQ(mesh.materials.size(), 4U) << "an unused material is none of the mesh's";
  EXPECT_EQ(mesh.materials[0].base_color, (std::array<float, 4>{0.1F, 0.2F, 0.3F, 0.5F}));
  EXPECT_EQ(mesh.textures[mesh.materials[0].texture].bytes.size(), png.size());
  EXPECT_EQ(mesh.textures[mesh.materials[0].texture].mime, "image/png");
  EXPECT_TRUE(mesh.textures[mesh.materials[1].texture].bytes.empty());
  EXPECT_EQ(mesh.textures[mesh.materials[2].texture].bytes.size(), png.size());
  EXPECT_TRUE(mesh.textures[mesh.materials[3].texture].bytes.empty()) << "nothing outside the folder is read";
  EXPECT_EQ(std::count_if(mesh.findings.begin(), mesh.findings.end(),
                          [](const Finding& f) { return f.id == "missing-texture"; }),
            2);
}

TEST_F(Obj, AMissingLibraryIsNamed) {
  const VisualMesh mesh = importFile(write("a.obj", std::string("mtllib lost.mtl\nusemtl x\n") + kTetrahedron));
  EXPECT_EQ(findingOf(mesh, "missing-material-library")->place, "lost.mtl");
}

TEST_F(Obj, AMissingLibraryIsOneFindingHoweverManyMaterialsItDefines) {
  std::string text = kTetrahedron;
  for (int m = 0; m < 13; ++m) {
    text += "mtllib lost.mtl\nusemtl m" + std::to_string(m) + "\nf 1 2 3\n";
  }
  const VisualMesh mesh = importFile(write("a.obj", text));
  const Finding* found = findingOf(mesh, "missing-material-library");
  ASSERT_NE(found, nullptr);
  EXPECT_EQ(found->count, 13U);
  EXPECT_EQ(found->place, "lost.mtl");
  EXPECT_EQ(findingOf(mesh, "missing-material"), nullptr);
  EXPECT_EQ(std::count_if(mesh.findings.begin(), mesh.findings.end(),
                          [](const Finding& f) { return f.id.starts_with("missing"); }),
            1);
}

TEST_F(Obj, LinesAndPointsAreLeftOutAndCounted) {
  const VisualMesh mesh = importFile(write("a.obj", std::string(kTetrahedron) + "l 1 2\np 1\nl 2 3 4\n"));
  EXPECT_EQ(findingOf(mesh, "dropped-primitives")->count, 3U);
}

TEST_F(Obj, AFaceTooSmallKeepsItsNumber) {
  const VisualMesh mesh =
      importFile(write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf\nf 1 2\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"));
  EXPECT_EQ(mesh.triangle_face, (std::vector<std::uint32_t>{2, 3, 4, 5}));
  EXPECT_EQ(findingOf(mesh, "degenerate-faces")->places, (std::vector<std::uint32_t>{0, 1}));
}

TEST_F(Obj, FaultsAreNamedWithTheirPlace) {
  const struct {
    const char* name;
    const char* text;
    const char* part;
  } kFaults[] = {
      {"nan", "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n",
       "vertex 1 (line 2) has a coordinate that is not a finite number"},
      {"inf", "v 0 0 0\nv 0 inf 0\nv 0 1 0\nf 1 2 3\n", "vertex 1 (line 2)"},
      {"overflow", "v 0 0 0\nv 0 0 1\nv 0 1e999 0\nf 1 2 3\n", "vertex 2 (line 3)"},
      {"microsoft nan", "v 0 0 0\nv 0 0 1\nv 0 -1.#IND 0\nf 1 2 3\n", "vertex 2 (line 3)"},
      {"short", "v 0 0 0\nv 1 0\nv 0 1 0\nf 1 2 3\n", "vertex 1 (line 2) has 2 coordinates"},
      {"word", "v 0 0 0\nv 1 zero 0\nv 0 1 0\nf 1 2 3\n", "has \"zero\" where a number belongs (line 2)"},
      {"range", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 4\n", "face 1 names vertex 4 of 3 (line 5)"},
      {"negative range", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -4\n", "names vertex -4, which does not exist (line 4)"},
      {"zero", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "(line 4)"},
      {"huge", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999999999999\n", "(line 4)"},
      {"no faces", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "has no faces"},
      {"one point", "v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n", "has no size"},
      {"too far", "v 1e300 0 0\nv 0 1 0\nv 0 0 0\nf 1 2 3\n", "too far apart"},
  };
  for (const auto& fault : kFaults) {
    SCOPED_TRACE(fault.name);
    expectRefusal(write(std::string(fault.name) + ".obj", fault.text), fault.part);
  }
}

TEST_F(Obj, TexturesThatCannotBeDrawnAreSaid) {
  // Two texels of true colour, blue, green, red.
  const std::string tga = std::string("\0\0\2\0\0\0\0\0\0\0\0\0\2\0\1\0\x18\0", 18) + "\x10\x20\xff\x40\x50\x60";
  write("good.tga", tga);
  write("bad.tga", tga.substr(0, 2) + "\x77" + tga.substr(3));
  write("game.dds", "DDS " + std::string(200, '\0'));
  write("cut.png", "\x89PNG\r\n\x1a\n rest");
  write("a.mtl",
        "newmtl a\nmap_Kd good.tga\nnewmtl b\nmap_Kd bad.tga\nnewmtl c\nmap_Kd game.dds\nnewmtl d\nmap_Kd cut.png\n");
  const VisualMesh mesh = importFile(
      write("a.obj",
            "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl a\nf 1 3 2\nusemtl b\nf 1 2 4\nusemtl c\nf 1 4 "
            "3\nusemtl d\nf 2 3 4\n"));
  std::vector<std::string> unread;
  for (const Finding& f : mesh.findings) {
    if (f.id == "texture-not-read") unread.push_back(f.place);
  }
  EXPECT_EQ(unread, (std::vector<std::string>{"bad.tga", "game.dds", "cut.png"}));
  EXPECT_EQ(mesh.textures[mesh.materials[0].texture].mime, "image/x-tga");
}

// Of each kind a picture of noise is whole, and is not without its second half or its last byte.
TEST_F(Obj, TexturesThatAreCutOffAreSaid) {
  cv::Mat noise(32, 32, CV_8UC4);  // a row of a TGA is 128 bytes, as much as stb reads ahead
  cv::RNG(1).fill(noise, cv::RNG::UNIFORM, 0, 256);
  cv::Mat color, floats;
  cv::cvtColor(noise, color, cv::COLOR_BGRA2BGR);
  color.convertTo(floats, CV_32F, 1 / 255.0);
  std::map<std::string, std::string> pictures;
  for (const char* ending : {".png", ".jpg", ".tif", ".bmp", ".webp"}) {
    std::vector<unsigned char> bytes;
    ASSERT_TRUE(cv::imencode(ending, color, bytes)) << ending;
    pictures[ending] = {bytes.begin(), bytes.end()};
  }
  for (const char* ending : {".exr", ".hdr"}) {
    std::vector<unsigned char> bytes;
    ASSERT_TRUE(cv::imencode(ending, floats, bytes)) << ending;
    pictures[ending] = {bytes.begin(), bytes.end()};
  }
  const std::string radiance = "#?RADIANCE";
  ASSERT_TRUE(pictures[".hdr"].starts_with(radiance + "\n"));
  pictures[".rgbe"] = "#?RGBE" + pictures[".hdr"].substr(radiance.size());
  const auto tga = [](int type) {
    return std::string{0, 0, char(type), 0, 0, 0, 0, 0, 0, 0, 0, 0, 32, 0, 32, 0, 32, 8};
  };
  const std::string texels(noise.datastart, noise.dataend);
  pictures[".tga"] = tga(2) + texels;
  pictures[".runs.tga"] = tga(10);
  for (std::size_t at = 0; at < texels.size(); at += 512) pictures[".runs.tga"] += "\x7f" + texels.substr(at, 512);

  std::string huge = pictures[".png"];
  huge.replace(16, 8, std::string("\0\0\x75\x30\0\0\x75\x30", 8));  // 30,000 x 30,000
  std::map<std::string, std::string> files = {{"huge.png", huge},
                                              {"broken.tif", std::string("II*\0", 4) + std::string(200, '\xff')}};
  std::vector<std::string> expected = {"broken.tif", "huge.png"};
  for (const auto& [ending, bytes] : pictures) {
    files["whole" + ending] = bytes;
    files["half" + ending] = bytes.substr(0, bytes.size() / 2);
    files["less" + ending] = bytes.substr(0, bytes.size() - 1);
    expected.push_back("half" + ending);
    expected.push_back("less" + ending);
  }
  std::string library, faces;
  for (const auto& [name, bytes] : files) {
    write(name, bytes);
    library += "newmtl " + name + "\nmap_Kd " + name + "\n";
    faces += "usemtl " + name + "\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
  }
  write("a.mtl", library);
  const VisualMesh mesh = importFile(write("a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n" + faces));
  std::vector<std::string> unread;
  for (const Finding& f : mesh.findings) {
    if (f.id == "texture-not-read") unread.push_back(f.place);
  }
  std::sort(expected.begin(), expected.end());
  EXPECT_EQ(unread, expected);
}

// libjpeg draws on behind what it lost.
TEST_F(Obj, AJpegThatIsDamagedInsideIsSaid) {
  cv::Mat picture(256, 256, CV_8UC3);
  cv::RNG(1).fill(picture, cv::RNG::UNIFORM, 0, 256);
  std::vector<unsigned char> bytes;
  ASSERT_TRUE(cv::imencode(".jpg", picture, bytes));
  write("whole.jpg", {bytes.begin(), bytes.end()});
  std::fill_n(bytes.begin() + std::ptrdiff_t(bytes.size() / 2), 64, 0x37);
  write("damaged.jpg", {bytes.begin(), bytes.end()});
  write("a.mtl", "newmtl a\nmap_Kd whole.jpg\nnewmtl b\nmap_Kd damaged.jpg\n");
  const VisualMesh mesh = importFile(write("a.obj",
                                           "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl a\nf 1 3 2\nf 1 2 "
                                           "4\nusemtl b\nf 1 4 3\nf 2 3 4\n"));
  std::vector<std::string> said;
  for (const Finding& f : mesh.findings) {
    if (f.id.starts_with("texture-")) said.push_back(f.id + " " + f.place);
  }
  EXPECT_EQ(said, std::vector<std::string>{"texture-damaged damaged.jpg"});
  ASSERT_EQ(mesh.textures.size(), 2U);
  EXPECT_EQ(mesh.textures[1].bytes.size(), bytes.size());
}

TEST_F(Obj, NamesWithBlanksAndBeyondAscii) {
  EXPECT_EQ(importFile(write("ein schöner Kopf ☺/モデル 1.obj", kTetrahedron)).triangles.size(), 4U);
  EXPECT_EQ(importFile(write("UPPER.OBJ", kTetrahedron)).format, "obj");
}

TEST_F(Obj, StatementsThatNoOneKnowsAreSaid) {
  const VisualMesh mesh =
      importFile(write("a.obj", std::string("Created by Foo\ncall x.obj\nCr\xe9\xe9 par Maya\n") + kTetrahedron));
  EXPECT_EQ(mesh.triangles.size(), 4U);
  const Finding* const finding = findingOf(mesh, "unknown-statement");
  ASSERT_NE(finding, nullptr);
  EXPECT_EQ(finding->severity, Severity::warning);
  EXPECT_EQ(finding->count, 3U);
  EXPECT_NE(finding->message.find("\"Created by Foo\" (line 1)"), std::string::npos) << finding->message;
  // What an OBJ can say and nothing here asks for is no news.
  EXPECT_EQ(findingOf(importFile(write("b.obj", std::string("s off\ns 1\nmg 0\nlod 1\nbevel on\nusemap off\nvp 0 0\n"
                                                            "cstype bezier\ndeg 3\nstep 1 1\nparm u 0 1\nend\n") +
                                                    kTetrahedron)),
                      "unknown-statement"),
            nullptr);
}

TEST_F(Obj, WhatIsNoneSaysWhatItLooksLike) {
  std::string capitals = kTetrahedron;
  for (char& c : capitals) c = c == 'v' ? 'V' : c;
  expectRefusal(write("capitals.obj", capitals), "has its statements in capital letters: \"V 0 0 0\" (line 1)");
  for (char& c : capitals) c = c == 'f' ? 'F' : c;
  expectRefusal(write("all_capitals.obj", "Made by hand\n" + capitals), "in capital letters: \"V 0 0 0\" (line 2)");
  expectRefusal(write("stl.obj",
                      "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
                      "endloop\nendfacet\nendsolid\n"),
                "is no OBJ: it looks like STL text. Rename it to end in .stl.");
  expectRefusal(write("off.obj", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"), "looks like OFF");
}

TEST_F(Obj, NamesOfOldExportersBecomeUtf8) {
  // Latin-1 in a group, a material and a missing texture: reports in JSON could not carry it.
  write("a.mtl", "newmtl H\xe4nde\nmap_Kd h\xe4nde.png\n");
  const VisualMesh mesh =
      importFile(write("a.obj", std::string("mtllib a.mtl\nusemtl H\xe4nde\ng \xd6hr K\xc3\xb6pfe\n") + kTetrahedron));
  EXPECT_NE(groupOf(mesh, "\xc3\x96hr"), nullptr);
  EXPECT_NE(groupOf(mesh, "K\xc3\xb6pfe"), nullptr) << "valid UTF-8 stays";
  EXPECT_EQ(mesh.materials[0].name, "H\xc3\xa4nde");
  EXPECT_EQ(findingOf(mesh, "missing-texture")->place, "h\xc3\xa4nde.png");
}

TEST_F(Obj, UnitsAndAxes) {
  const auto file = write("a.obj", kTetrahedron);
  ImportOptions options = testOptions();
  options.unit = "cm";
  options.up = "z";
  const VisualMesh mesh = importFile(file, options);
  EXPECT_DOUBLE_EQ(mesh.metres_per_unit, 0.01);
  EXPECT_EQ(mesh.up_axis, "z");
  // z of the file is up; its y points away from the viewer.
  EXPECT_TRUE(mesh.positions[3].isApprox(Eigen::Vector3d(0, 0.01, 0)));
  EXPECT_TRUE(mesh.positions[2].isApprox(Eigen::Vector3d(0, 0, -0.01)));
  EXPECT_NEAR(volumeOf(mesh), 1e-6 / 6, 1e-15);
  options.unit = "0.3048";
  EXPECT_DOUBLE_EQ(importFile(file, options).metres_per_unit, 0.3048);
  options.unit = "parsec";
  EXPECT_NE(refusal(file, options, ExitCode::usage).find("parsec"), std::string::npos);
}

TEST_F(Obj, AnImplausibleSizeNamesTheLikelyUnit) {
  const VisualMesh mesh =
      importFile(write("a.obj", "v 0 0 0\nv 600 0 0\nv 0 600 0\nv 0 0 600\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"));
  const Finding* finding = findingOf(mesh, "implausible-size");
  ASSERT_NE(finding, nullptr);
  EXPECT_NE(finding->cure.find("--unit mm"), std::string::npos) << finding->cure;
  EXPECT_EQ(findingOf(importFile(write("b.obj", kTetrahedron)), "implausible-size"), nullptr);
}

}  // namespace
}  // namespace sinew::tools

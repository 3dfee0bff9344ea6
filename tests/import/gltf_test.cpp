// SPDX-License-Identifier: GPL-3.0-or-later
#include <nlohmann/json.hpp>

#include "tests/import/import_fixture.h"

namespace sinew::tools {
namespace {

using nlohmann::json;

class Gltf : public ImportTest {};

constexpr int kByte = 5120, kUbyte = 5121, kShort = 5122, kUshort = 5123, kUint = 5125, kFloat = 5126;

/// Builds a GLB piece by piece.
class Builder {
 public:
  json doc = {{"asset", {{"version", "2.0"}}}, {"scene", 0},
              {"scenes", {{{"nodes", {0}}}}},  {"nodes", {{{"mesh", 0}}}},
              {"meshes", json::array()},       {"accessors", json::array()},
              {"bufferViews", json::array()},  {"buffers", json::array()}};
  std::string binary;

  template <class T>
  int view(const std::vector<T>& values) {
    while (binary.size() % 4) binary += '\0';
    doc["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", values.size() * sizeof(T)}});
    binary.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
    return int(doc["bufferViews"].size()) - 1;
  }
  template <class T>
  int accessor(const std::vector<T>& values, int component, const std::string& type, std::size_t count,
               bool normalized = false) {
    json a = {{"bufferView", view(values)}, {"componentType", component}, {"type", type}, {"count", count}};
    if (normalized) a["normalized"] = true;
    doc["accessors"].push_back(a);
    return int(doc["accessors"].size()) - 1;
  }
  std::string glb() {
    while (binary.size() % 4) binary += '\0';
    doc["buffers"] = json::array({{{"byteLength", binary.size()}}});
    std::string text = doc.dump();
    while (text.size() % 4) text += ' ';
    std::string out = "glTF";
    const auto put = [&](std::size_t value) {
      for (int k = 0; k < 4; ++k) out += char(value >> (8 * k) & 255);
    };
    put(2), put(28 + text.size() + binary.size());
    put(text.size()), put(0x4E4F534A), out += text;
    put(binary.size()), put(0x004E4942), out += binary;
    return out;
  }
};

const std::vector<float> kPositions = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
const std::vector<std::uint16_t> kIndices = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};

Builder tetrahedron() {
  Builder b;
  const int positions = b.accessor(kPositions, kFloat, "VEC3", 4);
  const int indices = b.accessor(kIndices, kUshort, "SCALAR", 12);
  b.doc["meshes"].push_back(
      {{"name", "tet"}, {"primitives", {{{"attributes", {{"POSITION", positions}}}, {"indices", indices}}}}});
  return b;
}

json& primitive(Builder& b) { return b.doc["meshes"][0]["primitives"][0]; }

TEST_F(Gltf, QuantizedPositionsAndUvs) {
  Builder b = tetrahedron();
  b.doc["extensionsRequired"] = {"KHR_mesh_quantization"};
  primitive(b)["attributes"]["POSITION"] =
      b.accessor(std::vector<std::int16_t>{0, 0, 0, 32767, 0, 0, 0, 32767, 0, 0, 0, 32767}, kShort, "VEC3", 4, true);
  primitive(b)["attributes"]["TEXCOORD_0"] =
      b.accessor(std::vector<std::uint8_t>{0, 0, 255, 0, 0, 255, 51, 204}, kUbyte, "VEC2", 4, true);
  primitive(b)["attributes"]["NORMAL"] =
      b.accessor(std::vector<std::int8_t>{-127, 0, 0, 127, 0, 0, 0, 127, 0, 0, 0, 127}, kByte, "VEC3", 4, true);
  b.doc["nodes"][0]["scale"] = {2, 2, 2};
  const VisualMesh mesh = importFile(write("a.glb", b.glb()));
  EXPECT_EQ(mesh.positions[1], Eigen::Vector3d(2, 0, 0));
  EXPECT_NEAR(volumeOf(mesh), 8.0 / 6, 1e-12);
  EXPECT_TRUE(mesh.uvs[3].isApprox(Eigen::Vector2f(0.2F, 0.2F)));
  EXPECT_TRUE(mesh.normals[0].isApprox(Eigen::Vector3f(-1, 0, 0)));
  // Unnormalized integers are allowed too.
  primitive(b)["attributes"]["POSITION"] =
      b.accessor(std::vector<std::int16_t>{0, 0, 0, 100, 0, 0, 0, 100, 0, 0, 0, 100}, kShort, "VEC3", 4);
  EXPECT_EQ(importFile(write("b.glb", b.glb())).positions[2], Eigen::Vector3d(0, 200, 0));
}

TEST_F(Gltf, CustomAttributesAndFurtherColours) {
  Builder b = tetrahedron();
  json& attributes = primitive(b)["attributes"];
  attributes["_MASK"] = b.accessor(std::vector<float>{0.25F, 0.5F, 0.75F, 1}, kFloat, "SCALAR", 4);
  attributes["COLOR_1"] = b.accessor(std::vector<float>{1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1}, kFloat, "VEC3", 4);
  VisualMesh mesh = importFile(write("a.glb", b.glb()));
  ASSERT_NE(attributeOf(mesh, "_MASK"), nullptr);
  EXPECT_EQ(attributeOf(mesh, "_MASK")->values, (std::vector<float>{0.25F, 0.5F, 0.75F, 1}));
  EXPECT_EQ(attributeOf(mesh, "COLOR_1")->components, 3U) << "COLOR_1 without COLOR_0";
  EXPECT_TRUE(mesh.colors.empty());
  attributes["COLOR_0"] = b.accessor(
      std::vector<std::uint8_t>{255, 0, 0, 255, 0, 51, 0, 255, 0, 0, 255, 255, 9, 9, 9, 0}, kUbyte, "VEC4", 4, true);
  mesh = importFile(write("b.glb", b.glb()));
  EXPECT_EQ(mesh.colors[1], (std::array<float, 4>{0, float(51 / 255.0), 0, 1}));
}

TEST_F(Gltf, ExtrasOfNodesMeshesPrimitivesAndMaterials) {
  Builder b = tetrahedron();
  b.doc["nodes"][0]["name"] = "body";
  b.doc["nodes"][0]["extras"] = {{"stiffness", 0.25}, {"list", {1, 2}}};
  b.doc["meshes"][0]["extras"] = {{"from", "mesh"}};
  primitive(b)["extras"] = {{"from", "primitive"}};
  primitive(b)["material"] = 0;
  b.doc["materials"] = {{{"name", "skin"}, {"extras", {{"wet", true}}}}};
  const VisualMesh mesh = importFile(write("a.glb", b.glb()));
  ASSERT_EQ(mesh.nodes.size(), 1U);
  const json properties = json::parse(mesh.nodes[0].properties_json);
  EXPECT_EQ(properties["stiffness"], 0.25);
  EXPECT_EQ(properties["list"], json({1, 2}));
  EXPECT_EQ(properties["mesh"]["from"], "mesh");
  EXPECT_EQ(properties["primitives"][0]["from"], "primitive");
  EXPECT_EQ(properties["materials"]["skin"]["wet"], true);
}

TEST_F(Gltf, SparseAccessors) {
  Builder b = tetrahedron();
  const int indices = b.view(std::vector<std::uint8_t>{1, 3});
  const int values = b.view(std::vector<float>{3, 0, 0, 0, 0, 5});
  b.doc["accessors"][0]["sparse"] = {{"count", 2},
                                     {"indices", {{"bufferView", indices}, {"componentType", kUbyte}}},
                                     {"values", {{"bufferView", values}}}};
  VisualMesh mesh = importFile(write("a.glb", b.glb()));
  EXPECT_EQ(mesh.positions[1], Eigen::Vector3d(3, 0, 0));
  EXPECT_EQ(mesh.positions[2], Eigen::Vector3d(0, 1, 0));
  EXPECT_EQ(mesh.positions[3], Eigen::Vector3d(0, 0, 5));
  b.doc["accessors"][0]["sparse"]["count"] = 3;
  expectRefusal(write("b.glb", b.glb()), "/accessors/0/sparse");
  b.doc["accessors"][0]["sparse"]["count"] = 2;
  b.doc["accessors"][0]["count"] = 3;
  expectRefusal(write("c.glb", b.glb()), "a sparse index names element 3 of 3");
}

TEST_F(Gltf, StripsFansAndUnindexed) {
  Builder b;
  const int positions = b.accessor(std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0}, kFloat, "VEC3", 4);
  b.doc["meshes"].push_back({{"primitives",
                              {{{"attributes", {{"POSITION", positions}}}, {"mode", 5}},
                               {{"attributes", {{"POSITION", positions}}}, {"mode", 1}}}}});
  VisualMesh mesh = importFile(write("strip.glb", b.glb()));
  ASSERT_EQ(mesh.triangles.size(), 2U);
  EXPECT_NEAR(areaOf(mesh), 1, 1e-15);
  EXPECT_EQ(findingOf(mesh, "flipped-faces"), nullptr);
  EXPECT_EQ(findingOf(mesh, "dropped-primitives")->count, 1U);
  primitive(b)["mode"] = 6;
  const int indices = b.accessor(std::vector<std::uint32_t>{0, 1, 3, 2}, kUint, "SCALAR", 4);
  primitive(b)["indices"] = indices;
  mesh = importFile(write("fan.glb", b.glb()));
  EXPECT_NEAR(areaOf(mesh), 1, 1e-15);
  EXPECT_EQ(findingOf(mesh, "flipped-faces"), nullptr);
}

TEST_F(Gltf, PrimitivesThatShareAccessorsShareSourceVertices) {
  Builder b = tetrahedron();
  json second = primitive(b);
  second["indices"] = b.accessor(std::vector<std::uint16_t>{1, 2, 3}, kUshort, "SCALAR", 3);
  primitive(b)["indices"] = b.accessor(std::vector<std::uint16_t>{0, 2, 1, 0, 1, 3, 0, 3, 2}, kUshort, "SCALAR", 9);
  b.doc["meshes"][0]["primitives"].push_back(second);
  const VisualMesh mesh = importFile(write("a.glb", b.glb()));
  EXPECT_EQ(mesh.source_vertex_count, 4U);
  EXPECT_EQ(mesh.positions.size(), 7U);
  EXPECT_EQ(mesh.welded_positions.size(), 4U);
  EXPECT_EQ(mesh.sub_meshes.size(), 2U);
  EXPECT_NEAR(volumeOf(mesh), 1.0 / 6, 1e-15);
}

TEST_F(Gltf, MirroredNodesAreRewoundAndNormalsFollow) {
  Builder b = tetrahedron();
  primitive(b)["attributes"]["NORMAL"] =
      b.accessor(std::vector<float>{-1, -1, -1, 1, 0, 0, 0, 1, 0, 0, 0, 1}, kFloat, "VEC3", 4);
  b.doc["nodes"] = {{{"children", {1}}, {"scale", {-1, 2, 1}}}, {{"mesh", 0}, {"translation", {1, 0, 0}}}};
  const VisualMesh mesh = importFile(write("a.glb", b.glb()));
  EXPECT_NEAR(volumeOf(mesh), 2.0 / 6, 1e-15);
  EXPECT_EQ(findingOf(mesh, "inside-out-part"), nullptr) << "the transform explains it";
  EXPECT_EQ(mesh.positions[1], Eigen::Vector3d(-2, 0, 0));
  EXPECT_TRUE(mesh.normals[1].isApprox(Eigen::Vector3f(-1, 0, 0)));
  // A normal goes by the inverse transpose: the y scale of 2 halves its y.
  EXPECT_TRUE(mesh.normals[0].isApprox(Eigen::Vector3f(1, -0.5F, -1).normalized(), 1e-5F));
}

TEST_F(Gltf, SkinWithoutBindMatricesAndPosedSkin) {
  Builder b = tetrahedron();
  primitive(b)["attributes"]["JOINTS_0"] =
      b.accessor(std::vector<std::uint8_t>{0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0}, kUbyte, "VEC4", 4);
  primitive(b)["attributes"]["WEIGHTS_0"] =
      b.accessor(std::vector<float>{1, 0, 0, 0, 0.5F, 0.5F, 0, 0, 0.5F, 0.25F, 0, 0, 1, 0, 0, 0}, kFloat, "VEC4", 4);
  b.doc["nodes"] = {{{"mesh", 0}, {"skin", 0}, {"translation", {100, 0, 0}}}, {{"name", "root"}}, {{"name", "tip"}}};
  b.doc["scenes"][0]["nodes"] = {0, 1, 2};
  b.doc["skins"] = {{{"joints", {1, 2}}}};
  VisualMesh mesh = importFile(write("a.glb", b.glb()));
  EXPECT_EQ(mesh.joints, (std::vector<std::string>{"root", "tip"}));
  EXPECT_EQ(mesh.positions[1], Eigen::Vector3d(1, 0, 0)) << "a skin's node does not move it";
  EXPECT_EQ(findingOf(mesh, "unnormalized-weights")->places, std::vector<std::uint32_t>{2});
  EXPECT_NEAR(double(mesh.skin[2][0].weight), 2.0 / 3, 1e-6);
  // The tip is moved: vertices follow their weights.
  b.doc["nodes"][2]["translation"] = {0, 0, 2};
  mesh = importFile(write("b.glb", b.glb()));
  EXPECT_NE(findingOf(mesh, "posed-skin"), nullptr);
  EXPECT_TRUE(mesh.positions[0].isApprox(Eigen::Vector3d(0, 0, 0)));
  EXPECT_TRUE(mesh.positions[1].isApprox(Eigen::Vector3d(1, 0, 1)));
  EXPECT_TRUE(mesh.positions[3].isApprox(Eigen::Vector3d(0, 0, 3)));
}

TEST_F(Gltf, MorphTargets) {
  Builder b = tetrahedron();
  primitive(b)["targets"] = {
      {{"POSITION", b.accessor(std::vector<float>{0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0}, kFloat, "VEC3", 4)}}};
  b.doc["meshes"][0]["extras"] = {{"targetNames", {"smile"}}};
  b.doc["nodes"][0]["rotation"] = {0, 0, std::sqrt(0.5), std::sqrt(0.5)};  // a quarter turn about z
  const VisualMesh mesh = importFile(write("a.glb", b.glb()));
  ASSERT_EQ(mesh.morphs.size(), 1U);
  EXPECT_EQ(mesh.morphs[0].name, "smile");
  EXPECT_EQ(mesh.morphs[0].vertices, std::vector<std::uint32_t>{2});
  EXPECT_TRUE(mesh.morphs[0].displacements[0].isApprox(Eigen::Vector3f(-1, 0, 0), 1e-6F));
}

TEST_F(Gltf, MorphWeightsThatAreNotAppliedAreSaid) {
  Builder b = tetrahedron();
  const int displacements = b.accessor(std::vector<float>{0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0}, kFloat, "VEC3", 4);
  primitive(b)["targets"] = {{{"POSITION", displacements}}, {{"POSITION", displacements}}};
  b.doc["meshes"][0]["extras"] = {{"targetNames", {"smile", "frown"}}};
  b.doc["meshes"][0]["weights"] = {0.0, 0.0};
  EXPECT_EQ(findingOf(importFile(write("none.glb", b.glb())), "unapplied-morphs"), nullptr);
  b.doc["meshes"][0]["weights"] = {0.0, 1.0};
  const VisualMesh mesh = importFile(write("mesh.glb", b.glb()));
  EXPECT_EQ(mesh.positions[2], Eigen::Vector3d(0, 1, 0));
  const Finding* finding = findingOf(mesh, "unapplied-morphs");
  ASSERT_NE(finding, nullptr);
  EXPECT_EQ(finding->count, 1U);
  EXPECT_EQ(finding->place, "in tet: frown 1");
  EXPECT_FALSE(finding->cure.empty());
  b.doc["nodes"][0]["weights"] = {0.0, 0.0};
  EXPECT_EQ(findingOf(importFile(write("node.glb", b.glb())), "unapplied-morphs"), nullptr);
  b.doc["nodes"][0]["weights"] = {0.0, "much"};
  expectRefusal(write("text.glb", b.glb()), "/nodes/0/weights/1");
}

TEST_F(Gltf, TexturesEmbeddedByUriAndByData) {
  const std::string png = "\x89PNG\r\n\x1a\nrest";
  write("my skin.png", png);
  Builder b = tetrahedron();
  primitive(b)["attributes"]["TEXCOORD_0"] =
      b.accessor(std::vector<float>{0, 0, 1, 0, 0, 1, 0.25F, 0.25F}, kFloat, "VEC2", 4);
  primitive(b)["material"] = 0;
  b.doc["materials"] = {
      {{"pbrMetallicRoughness",
        {{"baseColorFactor", {0.5, 0.25, 1, 1}},
         {"baseColorTexture",
          {{"index", 0}, {"extensions", {{"KHR_texture_transform", {{"offset", {0.5, 0}}, {"scale", {2, 1}}}}}}}}}},
       {"doubleSided", true}}};
  b.doc["textures"] = {{{"source", 0}}};
  b.doc["images"] = {{{"uri", "my%20skin.png"}}};
  VisualMesh mesh = importFile(write("a.glb", b.glb()));
  EXPECT_EQ(mesh.materials[0].base_color, (std::array<float, 4>{0.5F, 0.25F, 1, 1}));
  EXPECT_TRUE(mesh.materials[0].double_sided);
  EXPECT_EQ(mesh.textures[0].mime, "image/png");
  EXPECT_EQ(mesh.uvs[3], Eigen::Vector2f(1, 0.75F)) << "u scaled and moved, v turned up";
  b.doc["images"] = {{{"uri", "data:image/png;base64,iVBORw0KGgpyZXN0"}}};
  mesh = importFile(write("b.glb", b.glb()));
  EXPECT_EQ(mesh.textures[0].bytes.size(), png.size());
  b.doc["images"] = {{{"bufferView", b.view(std::vector<char>(png.begin(), png.end()))}, {"mimeType", "image/jpeg"}}};
  mesh = importFile(write("c.glb", b.glb()));
  EXPECT_EQ(mesh.textures[0].mime, "image/png") << "the bytes tell";
  b.doc["images"] = {{{"uri", "../secret.png"}}};
  mesh = importFile(write("d.glb", b.glb()));
  EXPECT_NE(findingOf(mesh, "missing-texture"), nullptr);
}

TEST_F(Gltf, TextWithDataUriAndWithBufferFile) {
  Builder b = tetrahedron();
  b.glb();
  b.doc["buffers"][0]["uri"] = "my%20data.bin";
  write("my data.bin", b.binary);
  EXPECT_NEAR(volumeOf(importFile(write("a.gltf", b.doc.dump()))), 1.0 / 6, 1e-15);
  b.doc["buffers"][0]["uri"] = "gone.bin";
  expectRefusal(write("b.gltf", b.doc.dump()), "\"gone.bin\" is missing");
  b.doc["buffers"][0]["uri"] = "../gone.bin";
  expectRefusal(write("c.gltf", b.doc.dump()), "outside the file's folder");
  b.doc["buffers"][0].erase("uri");
  expectRefusal(write("d.gltf", b.doc.dump()), "/buffers/0");
  // Two positions, by hand, in a data URI: too few bytes.
  b.doc["buffers"][0]["uri"] = "data:application/octet-stream;base64,AAAAAAAAAAAAAAAA";
  expectRefusal(write("e.gltf", b.doc.dump()), "holds 12");
}

TEST_F(Gltf, NodesInSeveralPlacesAreSeveralMeshes) {
  Builder b = tetrahedron();
  b.doc["nodes"] = {
      {{"mesh", 0}, {"name", "left"}}, {{"mesh", 0}, {"name", "right"}, {"translation", {5, 0, 0}}}, {{"mesh", 0}}};
  b.doc["scenes"][0]["nodes"] = {0, 1};
  const VisualMesh mesh = importFile(write("a.glb", b.glb()));
  EXPECT_EQ(mesh.source_vertex_count, 8U);
  EXPECT_EQ(mesh.sub_meshes[1].node, "right");
  EXPECT_EQ(findingOf(mesh, "dropped-nodes")->count, 1U);
}

TEST_F(Gltf, FaultsNameTheirPlaceInTheJson) {
  const auto refused = [&](const char* name, const std::string& part, auto change) {
    SCOPED_TRACE(name);
    Builder b = tetrahedron();
    change(b);
    expectRefusal(write(std::string(name) + ".glb", b.glb()), part);
  };
  refused("index", "index 11 names vertex 9 of 4 (at /meshes/0/primitives/0/indices)", [](Builder& b) {
    auto bad = kIndices;
    bad[11] = 9;
    primitive(b)["indices"] = b.accessor(bad, kUshort, "SCALAR", 12);
  });
  refused("infinite", "vertex 2 of mesh \"tet\"", [](Builder& b) {
    auto bad = kPositions;
    bad[7] = INFINITY;
    primitive(b)["attributes"]["POSITION"] = b.accessor(bad, kFloat, "VEC3", 4);
  });
  refused("accessor", "/meshes/0/primitives/0/indices", [](Builder& b) { primitive(b)["indices"] = 77; });
  refused("view", "/accessors/0/bufferView", [](Builder& b) { b.doc["accessors"][0]["bufferView"] = 9; });
  refused("reach", "/accessors/0", [](Builder& b) { b.doc["accessors"][0]["count"] = 5; });
  refused("huge", "/accessors/0", [](Builder& b) { b.doc["accessors"][0]["count"] = 4'000'000'000ULL; });
  expectRefusal(write("number.gltf", R"({"asset": {"version": "2.0"}, "extras": 1e999})"), "larger than any double");
  refused("offset", "/accessors/0",
          [](Builder& b) { b.doc["accessors"][0]["byteOffset"] = 18'446'744'073'709'551'615ULL; });
  refused("stride", "/accessors/0", [](Builder& b) { b.doc["bufferViews"][0]["byteStride"] = 8; });
  refused("view reach", "/bufferViews/0", [](Builder& b) { b.doc["bufferViews"][0]["byteLength"] = 1'000'000; });
  refused("type", "/accessors/0/type", [](Builder& b) { b.doc["accessors"][0]["type"] = "VEC9"; });
  refused("component", "/accessors/0/componentType", [](Builder& b) { b.doc["accessors"][0]["componentType"] = 1; });
  refused("negative", "/accessors/0/count", [](Builder& b) { b.doc["accessors"][0]["count"] = -4; });
  refused("fraction", "/accessors/0/count", [](Builder& b) { b.doc["accessors"][0]["count"] = 3.5; });
  refused("cycle", "cycle", [](Builder& b) {
    b.doc["nodes"] = {{{"children", {1}}}, {{"children", {0}}, {"mesh", 0}}};
  });
  refused("self", "cycle", [](Builder& b) { b.doc["nodes"] = {{{"children", {0}}, {"mesh", 0}}}; });
  refused("two parents", "hangs on two nodes", [](Builder& b) {
    b.doc["nodes"] = {{{"children", {1, 2}}}, {{"children", {2}}}, {{"mesh", 0}}};
  });
  refused("scene", "/scene", [](Builder& b) { b.doc["scene"] = 4; });
  refused("mesh", "/nodes/0/mesh", [](Builder& b) { b.doc["nodes"][0]["mesh"] = 4; });
  refused("material", "/meshes/0/primitives/0/material", [](Builder& b) { primitive(b)["material"] = 0; });
  refused("version", "version", [](Builder& b) { b.doc["asset"]["version"] = "1.0"; });
  refused("no meshes", "has no faces", [](Builder& b) { b.doc["nodes"] = {json::object()}; });
  refused("draco", "KHR_draco_mesh_compression",
          [](Builder& b) { b.doc["extensionsRequired"] = {"KHR_draco_mesh_compression"}; });
  refused("meshopt", "Export it without mesh compression",
          [](Builder& b) { b.doc["extensionsRequired"] = {"EXT_meshopt_compression"}; });
  refused("unknown", "ACME_magic", [](Builder& b) { b.doc["extensionsRequired"] = {"ACME_magic"}; });
  refused("counts", "but there are 4 positions", [](Builder& b) {
    primitive(b)["attributes"]["NORMAL"] = b.accessor(std::vector<float>(9), kFloat, "VEC3", 3);
  });
  refused("joint", "weighted to joint 7 of 1", [](Builder& b) {
    primitive(b)["attributes"]["JOINTS_0"] = b.accessor(std::vector<std::uint8_t>(16, 7), kUbyte, "VEC4", 4);
    primitive(b)["attributes"]["WEIGHTS_0"] = b.accessor(std::vector<float>(16, 0.25F), kFloat, "VEC4", 4);
    b.doc["skins"] = {{{"joints", {0}}}};
    b.doc["nodes"][0]["skin"] = 0;
  });
  refused("matrix", "/nodes/0/matrix", [](Builder& b) { b.doc["nodes"][0]["matrix"] = {1, 2}; });
  expectRefusal(write("deep.gltf", std::string(100'000, '[')), "nested deeper");
  expectRefusal(write("broken.gltf", "{\"asset\": {\"version\": \"2.0\"}"), "malformed");
}

// docs/decisions/0015-own-gltf-reader.md holds these files against tinygltf, which refuses, misreads or crashes on
// each.
TEST_F(Gltf, FilesThatALibraryWouldRefuseAreRead) {
  const auto read = [&](const char* name, auto change) {
    SCOPED_TRACE(name);
    Builder b = tetrahedron();
    change(b);
    EXPECT_NEAR(volumeOf(importFile(write(std::string(name) + ".glb", b.glb()))), 1.0 / 6, 1e-15);
  };
  read("image of nothing", [](Builder& b) { b.doc["images"] = {json::object()}; });
  read("indices of zeros", [](Builder& b) {
    b.doc["accessors"].push_back({{"componentType", kUbyte}, {"type", "SCALAR"}, {"count", 3}});
    b.doc["meshes"].push_back(
        {{"primitives", {{{"attributes", {{"POSITION", 0}}}, {"indices", b.doc["accessors"].size() - 1}}}}});
  });
  read("stride of 6", [](Builder& b) {
    primitive(b)["attributes"]["POSITION"] =
        b.accessor(std::vector<std::int16_t>{0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1}, kShort, "VEC3", 4);
    b.doc["bufferViews"].back()["byteStride"] = 6;
  });
  Builder b = tetrahedron();
  const std::string whole = b.glb();
  const std::size_t chunk = whole.size() - b.binary.size() - 8;
  const auto glbOf = [](std::string bytes) {
    const std::uint32_t size = std::uint32_t(bytes.size());
    std::memcpy(bytes.data() + 8, &size, 4);
    return bytes;
  };
  std::string odd = whole + "abc";
  const std::uint32_t odd_size = std::uint32_t(b.binary.size() + 3);
  std::memcpy(odd.data() + chunk, &odd_size, 4);
  const std::string between = whole.substr(0, chunk) + std::string("\4\0\0\0ABCDwxyz", 12) + whole.substr(chunk);
  for (const std::string& bytes : {glbOf(odd), glbOf(between)})
    EXPECT_NEAR(volumeOf(importFile(write("chunks.glb", bytes))), 1.0 / 6, 1e-15);
  // A data URI of a private type, with three bytes more than its buffer has.
  b.doc["buffers"].push_back({{"byteLength", 9}, {"uri", "data:application/vnd.acme;base64,AAAAAAAAAAAAAAAA"}});
  b.doc["bufferViews"].push_back({{"buffer", 1}, {"byteLength", 9}});
  b.doc["accessors"].push_back(
      {{"bufferView", b.doc["bufferViews"].size() - 1}, {"componentType", kUbyte}, {"type", "SCALAR"}, {"count", 4}});
  primitive(b)["attributes"]["_ZERO"] = b.doc["accessors"].size() - 1;
  b.doc["buffers"][0]["uri"] = "beside.bin";
  write("beside.bin", b.binary);
  const VisualMesh mesh = importFile(write("type.gltf", "\xEF\xBB\xBF" + b.doc.dump()));
  ASSERT_NE(attributeOf(mesh, "_ZERO"), nullptr);
  EXPECT_EQ(attributeOf(mesh, "_ZERO")->values, std::vector<float>(4, 0.0F));
}

TEST_F(Gltf, NumbersAndDepthsThatALibraryWouldMisreadAreRefused) {
  Builder b = tetrahedron();
  primitive(b)["attributes"]["POSITION"] = 4'294'967'296ULL;
  expectRefusal(write("wrapped.glb", b.glb()), "names accessor 4294967296 of 2");
  b = tetrahedron();
  b.doc["bufferViews"].push_back({{"buffer", 0}, {"byteLength", 100'000'000}});
  b.doc["images"] = {{{"bufferView", 2}}};
  b.doc["textures"] = {{{"source", 0}}};
  b.doc["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
  primitive(b)["material"] = 0;
  expectRefusal(write("image.glb", b.glb()), "/bufferViews/2");
  b = tetrahedron();
  json nested = 1;
  for (int depth = 0; depth < 1000; ++depth) nested = json{{"a", std::move(nested)}};
  b.doc["extras"] = std::move(nested);
  expectRefusal(write("deep.glb", b.glb()), "nested deeper");
}

TEST_F(Gltf, EveryTruncationOfAGlbIsRefused) {
  const std::string whole = tetrahedron().glb();
  for (std::size_t size = 1; size < whole.size(); size += 7) {
    SCOPED_TRACE(size);
    refusal(write("a.glb", whole.substr(0, size)));
  }
}

}  // namespace
}  // namespace sinew::tools

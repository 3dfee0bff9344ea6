// SPDX-License-Identifier: GPL-3.0-or-later
//
// What old and careless exporters write: it opens, with a warning where something had to be assumed, or the refusal
// names why not. Each file is a tetrahedron of volume 1/6.
#include <array>
#include <functional>
#include <nlohmann/json.hpp>

#include "tests/import/import_fixture.h"

namespace sinew::tools {
namespace {

struct Opens {
  const char* file;
  std::string text;
  const char* finding = "";  ///< that has to be there, as a warning
};

struct Refused {
  const char* file;
  std::string text;
  const char* part;  ///< of the message
};

class Sloppy : public ImportTest {
 protected:
  void opens(std::initializer_list<Opens> cases) const {
    for (const Opens& one : cases) {
      SCOPED_TRACE(one.file);
      try {
        const VisualMesh mesh = importFile(write(one.file, one.text));
        EXPECT_EQ(mesh.triangles.size(), 4U);
        EXPECT_NEAR(volumeOf(mesh), 1.0 / 6, 1e-12);
        const std::string id = one.finding;
        if (id.empty()) continue;
        ASSERT_NE(findingOf(mesh, id), nullptr);
        EXPECT_EQ(findingOf(mesh, id)->severity, Severity::warning);
      } catch (const ToolError& error) {
        ADD_FAILURE() << error.what();
      }
    }
  }
  void refused(std::initializer_list<Refused> cases) const {
    for (const Refused& one : cases) {
      SCOPED_TRACE(one.file);
      expectRefusal(write(one.file, one.text), one.part);
    }
  }
};

const std::string kPoints = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
const std::string kCorners = "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

TEST_F(Sloppy, Obj) {
  opens({{"remarks.obj", "v 0 0 0#a\nv 1 0 0# b\nv 0 1 0\nv 0 0 1\nf 1 3 2#c\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"},
         {"end_of_dos.obj", kPoints + kCorners + "\x1a"},
         {"filled_up.obj", kPoints + kCorners + std::string(300, '\0')},
         {"normals.obj", kPoints + "vn - - -\nvt x\nf 1/1/1 3/1/1 2/1/1\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
          "bad-attribute-numbers"}});
  refused({{"comma.obj", "v 0,5 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
            "has \"0,5\" where a number belongs (line 1). Export it with decimal points"},
           {"fortran.obj", "v 1.0D+00 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "has \"1.0D+00\" where a number belongs"},
           {"binary.obj", std::string("v 0\0\0\0", 6) + kPoints, "is no OBJ: it holds zero bytes"}});
}

TEST_F(Sloppy, ObjColours) {
  const std::array<float, 4> orange = {1, float(128 / 255.0), 0, 1};
  const VisualMesh bytes =
      importFile(write("bytes.obj", "v 0 0 0 255 128 0\nv 1 0 0 0 0 1\nv 0 1 0 0 0 0\nv 0 0 1 255 128 0\n" + kCorners));
  EXPECT_EQ(bytes.colors[0], orange);
  EXPECT_EQ(bytes.colors[1][2], float(1 / 255.0)) << "one colour tells for all";
  const VisualMesh painted =
      importFile(write("zbrush.obj", kPoints + "#MRGB ffff8000ff000000\n#MRGB ffff8000ff0000ff\n" + kCorners));
  ASSERT_EQ(painted.colors.size(), 4U);
  EXPECT_EQ(painted.colors[2], orange);
  EXPECT_EQ(painted.colors[3], (std::array<float, 4>{0, 0, 1, 1}));
}

TEST_F(Sloppy, MaterialLibraries) {
  write("Lib.MTL", "NEWMTL red\nKD 1 0 0\nMAP_KD SKIN.PNG\n");
  write("skin.png", "\x89PNG\r\n\x1a\n");
  for (const char* name : {"lib.mtl", "C:\\work\\lib.mtl", "/models/LIB.mtl", ".\\Lib.MTL"}) {
    SCOPED_TRACE(name);
    const VisualMesh mesh =
        importFile(write("a.obj", "mtllib " + std::string(name) + "\nusemtl red\n" + kPoints + kCorners));
    EXPECT_EQ(findingOf(mesh, "missing-material-library"), nullptr);
    ASSERT_EQ(mesh.materials.size(), 1U);
    EXPECT_EQ(mesh.materials[0].texture, 0U);
  }
}

std::string stl(const std::string& before, const std::string& end_loop = "endloop",
                const std::string& end_facet = "endfacet") {
  static const char* const kAt[] = {"0 0 0", "1 0 0", "0 1 0", "0 0 1"};
  std::string text = before;
  for (const auto& face : {std::array{0, 2, 1}, std::array{0, 1, 3}, std::array{0, 3, 2}, std::array{1, 2, 3}}) {
    text += "facet normal 0 0 0\nouter loop\n";
    for (const int v : face) text += std::string("vertex ") + kAt[v] + "\n";
    text += end_loop + "\n" + end_facet + "\n";
  }
  return text;
}

std::string binaryStl(std::uint32_t count, std::uint16_t attribute) {
  std::string text(80, '\0');
  const auto put = [&](auto value) { text.append(reinterpret_cast<const char*>(&value), sizeof value); };
  put(count);
  for (const auto& face : {std::array{0, 2, 1}, std::array{0, 1, 3}, std::array{0, 3, 2}, std::array{1, 2, 3}}) {
    for (int k = 0; k < 3; ++k) put(0.0F);
    for (const int v : face)
      for (int k = 1; k < 4; ++k) put(v == k ? 1.0F : 0.0F);
    put(attribute);
  }
  return text;
}

TEST_F(Sloppy, Stl) {
  opens({{"two_words.stl", stl("solid a\n", "end loop", "end facet") + "end solid a\n"},
         {"no_solid.stl", stl(""), "unended-solid"},
         {"second.stl", stl("solid a\n").substr(0, 8) + stl("").substr(0) + "endsolid a\n"},
         {"long_remark.stl", "; " + std::string(6000, 'x') + "\n" + stl("solid a\n") + "endsolid\n"},
         {"nan_normals.stl", stl("solid a\nfacet normal -nan(ind) nan -1.#IND\n") + "endsolid\n"},
         {"uncounted.stl", binaryStl(0, 0), "uncounted-triangles"}});
  refused({{"comma.stl", "solid a\nfacet normal 0 0 0\nouter loop\nvertex 0,5 0 0\n",
            "a vertex has \"0,5\" where a number belongs (line 4). Export it with decimal points"}});
  const VisualMesh colored = importFile(write("colours.stl", binaryStl(4, 0x801F)));
  EXPECT_EQ(findingOf(colored, "dropped-colors")->count, 4U);
}

TEST_F(Sloppy, Off) {
  const std::string points = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n";
  const std::string faces = "3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
  const auto oneLine = [](std::string text) {
    std::replace(text.begin(), text.end(), '\n', ' ');
    return text;
  };
  const auto with = [&](const std::string& tail) {
    std::string text;
    for (const char* at : {"0 0 0", "1 0 0", "0 1 0", "0 0 1"}) text += at + tail;
    return text;
  };
  opens({{"glued.off", "OFF4 4 6\n" + points + faces, "unknown-header"},
         {"none.off", "4 4 6\n" + points + faces, "unknown-header"},
         {"small.off", "off\n4 4 6\n" + points + faces},
         {"counts_apart.off", "OFF\n4\n4\n6\n" + points + faces},
         {"edges_apart.off", "OFF\n4 4\n6\n" + points + faces},
         {"no_edges.off", "OFF\n4 4\n" + points + faces},
         {"one_line.off", oneLine("OFF 4 4 6 " + points + faces)},
         {"few_lines.off", "OFF\n4 4 6\n" + oneLine(points) + "\n" + oneLine(faces) + "\n"},
         {"split.off", "OFF\n4 4 6\n0 0\n0\n1 0\n0\n0 1\n0\n0 0\n1\n" + faces},
         {"meshlab.off", "NCOFF\n4 4 6\n" + with(" 0 0 1 255 0 0 255\n") + faces},
         {"meshlab_uv.off", "NCSTOFF\n4 4 6\n" + with(" 0 0 1 255 0 0 255 0.5 0.5\n") + faces},
         {"uncalled_colours.off", "OFF\n4 4 6\n" + with(" 255 0 0 255\n") + faces}});
  refused({{"comma.off", "OFF\n3 1 0\n0 0 0\n1,5 0 0\n0 1 0\n3 0 1 2\n", "Export it with decimal points"},
           {"binary.off", "OFF BINARY\n", "is a binary OFF"},
           {"office.off", "OFFICE\n4 4 6\n", "its first word is not OFF"}});
  const VisualMesh mesh = importFile(folder_ / "meshlab_uv.off");
  EXPECT_TRUE(mesh.had_normals);
  EXPECT_EQ(mesh.colors[0], (std::array<float, 4>{1, 0, 0, 1}));
  EXPECT_EQ(mesh.uvs[0], Eigen::Vector2f(0.5F, 0.5F));
}

TEST_F(Sloppy, Ply) {
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 4\n";
  const std::string body = "end_header\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
  opens({{"marked.ply", "\xEF\xBB\xBF" + head + "property list uchar int vertex_indices\n" + body},
         {"floats.ply", head + "property list uchar float vertex_index\n" + body}});
  refused({{"names.ply", head + "property list uchar int corners\n" + body,
            "has faces without a list vertex_indices (their lists: corners)"},
           {"comma.ply",
            head + "property list uchar int vertex_indices\nend_header\n0,5 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 "
                   "3\n3 0 3 2\n3 1 2 3\n",
            "has \"0,5\" where a number belongs. Export it with decimal points"}});
}

TEST_F(Sloppy, Gltf) {
  using nlohmann::json;
  write("tetra.bin", [] {
    std::string bytes;
    const auto put = [&](auto value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); };
    for (int v = 0; v < 4; ++v)
      for (int k = 1; k < 4; ++k) put(v == k ? 1.0F : 0.0F);
    for (const int i : {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3, 0, 1}) put(std::uint16_t(i));
    return bytes;
  }());
  const auto changed = [](const std::function<void(json&)>& change) {
    json doc = json::parse(R"({"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
      "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
      "buffers": [{"byteLength": 76, "uri": "tetra.bin"}],
      "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 28}],
      "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
                    {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"}]})");
    change(doc);
    return doc.dump(1);
  };
  opens({{"number.gltf", changed([](json& d) { d["asset"]["version"] = 2.0; })},
         {"nulls.gltf", changed([](json& d) {
            d["nodes"][0]["name"] = d["nodes"][0]["scale"] = d["meshes"][0]["name"] = d["skins"] = nullptr;
          })},
         {"zeros.gltf", changed([](json& d) {
            d["nodes"][0]["rotation"] = {0, 0, 0, 0};
          }),
          "zero-rotations"},
         {"loose.gltf", changed([](json& d) { d["accessors"][1]["count"] = 14; }), "loose-indices"},
         {"pictures.gltf", changed([](json& d) {
            d["extensionsRequired"] = {"EXT_texture_avif", "MSFT_texture_dds"};
          })},
         {"case.gltf", changed([](json& d) { d["buffers"][0]["uri"] = "TETRA.BIN"; })},
         {"drive.gltf", changed([](json& d) { d["buffers"][0]["uri"] = "C:\\models\\tetra.bin"; })},
         {"lines.gltf", changed([](json& d) {
            d["buffers"][0]["uri"] =
                "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAA\r\nAAAAAAAAgD8AAAAAAAAAAAAAAAAA"
                "AIA/\nAAACAAEAAAABAAMAAAADAAIAAQACAAMAAAABAA==";
          })}});
  refused({{"comma.gltf", "{\"asset\": {\"version\": \"2.0\"},\n \"scenes\": [],,}", "malformed (line 2, byte 45"},
           {"old.gltf", changed([](json& d) { d["asset"]["version"] = 1.0; }), "version \"1.0\""},
           {"none.gltf", changed([](json& d) { d.erase("asset"); }), "lacks a required entry (at /asset)"}});
}

std::string dae(const std::string& asset, const std::string& scene) {
  return "<?xml version=\"1.0\"?>\n<COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">"
         "<asset>" +
         asset +
         "</asset><library_geometries><geometry id=\"g\"><mesh><source id=\"p\"><float_array id=\"pa\" count=\"12\">0 "
         "0 "
         "0 1 0 0 0 1 0 0 0 1</float_array><technique_common><accessor source=\"#pa\" count=\"4\" stride=\"3\"><param "
         "name=\"X\" type=\"float\"/><param name=\"Y\" type=\"float\"/><param name=\"Z\" type=\"float\"/></accessor>"
         "</technique_common></source><vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/></vertices>"
         "<polygons count=\"4\"><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><p>0 2 1</p><p>0 1 3</p><p>0 3 "
         "2</p><p>1 2 3</p></polygons></mesh></geometry></library_geometries><library_visual_scenes><visual_scene "
         "id=\"s\"><node id=\"n\"><instance_geometry url=\"#g\"/></node></visual_scene></library_visual_scenes>" +
         scene + "</COLLADA>\n";
}

TEST_F(Sloppy, ColladaFbxAndOgre) {
  const std::string scene = "<scene><instance_visual_scene url=\"#s\"/></scene>";
  opens(
      {{"polygons.dae", dae("", scene)},
       {"marked.dae", "\xEF\xBB\xBF" + dae("", scene)},
       {"comma.dae", dae("<unit meter=\"0,01\" name=\"cm\"/>", scene), "unit-not-read"},
       {"zero.dae", dae("<unit meter=\"0\"/>", scene), "unit-not-read"},
       {"tetra.mesh.xml",
        "<mesh><sharedgeometry vertexcount=\"4\"><vertexbuffer positions=\"true\"><vertex><position x=\"0\" y=\"0\" "
        "z=\"0\"/></vertex><vertex><position x=\"1\" y=\"0\" z=\"0\"/></vertex><vertex><position x=\"0\" y=\"1\" "
        "z=\"0\"/></vertex><vertex><position x=\"0\" y=\"0\" z=\"1\"/></vertex></vertexbuffer></sharedgeometry>"
        "<submeshes><submesh material=\"m\" usesharedvertices=\"true\" use32bitindexes=\"false\" "
        "operationtype=\"triangle_list\"><faces count=\"4\"><face v1=\"0\" v2=\"2\" v3=\"1\"/><face v1=\"0\" v2=\"1\" "
        "v3=\"3\"/><face v1=\"0\" v2=\"3\" v3=\"2\"/><face v1=\"1\" v2=\"2\" v3=\"3\"/></faces></submesh></submeshes>"
        "</mesh>\n"}});
  std::string prefixed = dae("", scene);
  prefixed.replace(prefixed.find("<COLLADA"), 8, "<c:COLLADA");
  refused(
      {{"no_scene.dae", dae("", ""), "has no scene"},
       {"prefix.dae", prefixed, "XML names with prefixes"},
       {"text.dae", "hello", "is no Collada"},
       {"old.fbx",
        "; FBX 6.1.0 project file\nFBXHeaderExtension:  {\n FBXHeaderVersion: 1003\n FBXVersion: 6100\n}\nObjects:  "
        "{\n}\n",
        "Convert it to FBX 2013 or later."},
       {"medit.mesh", "MeshVersionFormatted 1\nDimension 3\nVertices\n0\nEnd\n", "is a mesh of MEDIT"}});
}

}  // namespace
}  // namespace sinew::tools

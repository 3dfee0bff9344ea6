// SPDX-License-Identifier: GPL-3.0-or-later
#include <nlohmann/json.hpp>

#include "tests/import/import_fixture.h"

namespace sinew::tools {
namespace {

class Fbx : public ImportTest {};
class Dae : public ImportTest {};

std::string dae(const std::string& asset, const std::string& node, int claimed = 12) {
  return "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" "
         "version=\"1.4.1\">\n<asset>" +
         asset +
         "</asset>\n<library_geometries><geometry id=\"g\" name=\"Tet\"><mesh>\n<source id=\"p\"><float_array "
         "id=\"pa\" count=\"" +
         std::to_string(claimed) +
         "\">0 0 0 1 0 0 0 2 0 0 0 3</float_array><technique_common><accessor source=\"#pa\" count=\"4\" "
         "stride=\"3\"><param name=\"X\" type=\"float\"/><param name=\"Y\" type=\"float\"/><param name=\"Z\" "
         "type=\"float\"/></accessor></technique_common></source>\n"
         "<vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/></vertices>\n<polylist count=\"4\"><input "
         "semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><vcount>3 3 3 3</vcount><p>0 2 1 0 1 3 0 3 2 1 2 "
         "3</p></polylist>\n"
         "</mesh></geometry></library_geometries>\n<library_visual_scenes><visual_scene id=\"s\"><node id=\"n\" "
         "name=\"Node\">" +
         node +
         "<instance_geometry url=\"#g\"/></node></visual_scene></library_visual_scenes>\n<scene><instance_visual_scene "
         "url=\"#s\"/></scene></COLLADA>\n";
}

TEST_F(Dae, UnitsAndAxes) {
  VisualMesh mesh = importFile(write("a.dae", dae("<unit name=\"centimeter\" meter=\"0.01\"/><up_axis>Z_UP</up_axis>",
                                                  "<translate>10 0 0</translate>")));
  EXPECT_DOUBLE_EQ(mesh.metres_per_unit, 0.01);
  EXPECT_NE(mesh.unit_source.find("0.01"), std::string::npos);
  EXPECT_EQ(mesh.up_axis, "z");
  EXPECT_TRUE(mesh.bounds_min.isApprox(Eigen::Vector3d(0.1, 0, -0.02)));
  EXPECT_TRUE(mesh.bounds_max.isApprox(Eigen::Vector3d(0.11, 0.03, 0)));
  EXPECT_EQ(mesh.source_vertex_count, 4U);
  EXPECT_NEAR(volumeOf(mesh), 1e-6, 1e-15);
  EXPECT_EQ(mesh.sub_meshes[0].node, "Node");
  EXPECT_EQ(mesh.sub_meshes[0].mesh, "Tet");

  mesh = importFile(write("b.dae", dae("<unit meter='0.0254' name='inch'/><up_axis>Y_UP</up_axis>", "")));
  EXPECT_DOUBLE_EQ(mesh.metres_per_unit, 0.0254);
  EXPECT_TRUE(mesh.bounds_max.isApprox(Eigen::Vector3d(0.0254, 0.0508, 0.0762)));

  mesh = importFile(write("c.dae", dae("<up_axis>X_UP</up_axis>", "")));
  EXPECT_DOUBLE_EQ(mesh.metres_per_unit, 1);
  EXPECT_TRUE(mesh.bounds_max.isApprox(Eigen::Vector3d(0, 1, 3)));
  EXPECT_NEAR(volumeOf(mesh), 1, 1e-12);

  // The option replaces the file's unit, it does not multiply.
  ImportOptions options = testOptions();
  options.unit = "mm";
  options.up = "y";
  mesh = importFile(folder_ / "a.dae", options);
  EXPECT_TRUE(mesh.bounds_max.isApprox(Eigen::Vector3d(0.011, 0.002, 0.003)));
}

TEST_F(Dae, MirroredNode) {
  const VisualMesh mesh = importFile(write("a.dae", dae("", "<scale>1 -1 1</scale>")));
  EXPECT_NEAR(volumeOf(mesh), 1, 1e-12);
  EXPECT_EQ(findingOf(mesh, "inside-out-part"), nullptr);
}

TEST_F(Dae, AnAccessorBeyondItsArrayIsRefused) {
  expectRefusal(write("a.dae", dae("", "", 11)), "reads 12 numbers of the array \"pa\", which says it holds 11");
  refusal(write("b.dae", dae("", "", 13)));
}

std::string fbx(const std::string& unit, int up, int front, int front_sign, const std::string& scaling = "1,1,1") {
  return "; FBX 7.3.0 project file\nFBXHeaderExtension:  {\n\tFBXHeaderVersion: 1003\n\tFBXVersion: "
         "7300\n}\nGlobalSettings:  {\n\tVersion: 1000\n\tProperties70:  {\n"
         "\t\tP: \"UpAxis\", \"int\", \"Integer\", \"\"," +
         std::to_string(up) +
         "\n\t\tP: \"UpAxisSign\", \"int\", \"Integer\", \"\",1\n\t\tP: \"FrontAxis\", \"int\", \"Integer\", \"\"," +
         std::to_string(front) + "\n\t\tP: \"FrontAxisSign\", \"int\", \"Integer\", \"\"," +
         std::to_string(front_sign) +
         "\n\t\tP: \"CoordAxis\", \"int\", \"Integer\", \"\",0\n\t\tP: \"CoordAxisSign\", \"int\", \"Integer\", "
         "\"\",1\n"
         "\t\tP: \"UnitScaleFactor\", \"double\", \"Number\", \"\"," +
         unit +
         "\n\t}\n}\nObjects:  {\n\tGeometry: 1000, \"Geometry::Tet\", \"Mesh\" {\n\t\tVertices: *12 {\n\t\t\ta: "
         "0,0,0,1,0,0,0,2,0,0,0,3\n\t\t}\n"
         "\t\tPolygonVertexIndex: *12 {\n\t\t\ta: 0,2,-2,0,1,-4,0,3,-3,1,2,-4\n\t\t}\n\t\tGeometryVersion: "
         "124\n\t}\n\tModel: 2000, \"Model::Node\", \"Mesh\" {\n\t\tVersion: 232\n\t\tProperties70:  {\n"
         "\t\t\tP: \"Lcl Translation\", \"Lcl Translation\", \"\", \"A\",10,0,0\n\t\t\tP: \"Lcl Scaling\", \"Lcl "
         "Scaling\", \"\", \"A\"," +
         scaling +
         "\n\t\t\tP: \"stiffness\", \"Number\", \"\", \"AU\",0.25\n\t\t\tP: \"label\", \"KString\", \"\", \"U\", "
         "\"jelly\"\n"
         "\t\t}\n\t\tShading: T\n\t\tCulling: \"CullingOff\"\n\t}\n}\nConnections:  {\n\tC: \"OO\",2000,0\n\tC: "
         "\"OO\",1000,2000\n}\n";
}

TEST_F(Fbx, UnitsAxesAndProperties) {
  VisualMesh mesh = importFile(write("a.fbx", fbx("1", 1, 2, 1)));
  EXPECT_DOUBLE_EQ(mesh.metres_per_unit, 0.01);
  EXPECT_TRUE(mesh.bounds_max.isApprox(Eigen::Vector3d(0.11, 0.02, 0.03)));
  EXPECT_NEAR(volumeOf(mesh), 1e-6, 1e-12);
  const auto node =
      std::find_if(mesh.nodes.begin(), mesh.nodes.end(), [](const NodeSource& n) { return n.name == "Node"; });
  ASSERT_NE(node, mesh.nodes.end());
  EXPECT_EQ(nlohmann::json::parse(node->properties_json), (nlohmann::json{{"stiffness", 0.25}, {"label", "jelly"}}));

  mesh = importFile(write("b.fbx", fbx("2.54", 2, 1, -1)));
  EXPECT_DOUBLE_EQ(mesh.metres_per_unit, 0.0254);
  EXPECT_EQ(mesh.up_axis, "z");
  EXPECT_TRUE(mesh.bounds_min.isApprox(Eigen::Vector3d(0.254, 0, -0.0508)));
  EXPECT_NEAR(mesh.bounds_max.y(), 0.0762, 1e-12);

  mesh = importFile(write("c.fbx", fbx("100", 1, 2, 1, "1,1,-1")));
  EXPECT_NEAR(volumeOf(mesh), 1, 1e-9);
  EXPECT_EQ(findingOf(mesh, "inside-out-part"), nullptr);
}

TEST_F(Fbx, TheBarIsInsideOutAndItsWeightsDoNotSumToOne) {
  const VisualMesh mesh = importFile(kAssets / "models/bar_skeleton.fbx");
  EXPECT_EQ(mesh.source_vertex_count, 1058U);
  EXPECT_EQ(mesh.welded_positions.size(), 1058U);
  EXPECT_EQ(mesh.source_face_count, 1056U);
  EXPECT_EQ(mesh.joints.size(), 14U);
  EXPECT_NEAR(mesh.diagonal, 71.2586494, 1e-4);
  EXPECT_NEAR(volumeOf(mesh), 183.459354, 0.01);
  EXPECT_EQ(findingOf(mesh, "inside-out-part")->count, 1056U);
  EXPECT_EQ(findingOf(mesh, "unnormalized-weights")->count, 1058U);
  std::size_t most = 0;
  for (const auto& influences : mesh.skin) most = std::max(most, influences.size());
  EXPECT_EQ(most, 6U);
  // The normals went with the faces: they point away from the axis of the bar's faces.
  std::size_t agree = 0;
  for (const Triangle& t : mesh.triangles) {
    const Eigen::Vector3d n =
        (mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]);
    agree += n.dot(mesh.normals[t[0]].cast<double>()) > 0;
  }
  EXPECT_GT(agree, mesh.triangles.size() * 99 / 100);
}

class Models : public ImportTest {};

TEST_F(Models, SpotIsTheSameThroughTwoFormats) {
  const VisualMesh obj = importFile(kSamples / "spot/spot.obj");
  const VisualMesh glb = importFile(kAssets / "models/spot_textured.glb");
  EXPECT_EQ(obj.source_vertex_count, 2930U);
  EXPECT_EQ(glb.source_vertex_count, 3225U);
  for (const VisualMesh* mesh : {&obj, &glb}) {
    EXPECT_EQ(mesh->positions.size(), 3225U);
    EXPECT_EQ(mesh->welded_positions.size(), 2930U);
    EXPECT_EQ(mesh->triangles.size(), 5856U);
    EXPECT_NEAR(volumeOf(*mesh), 0.71825879, 1e-7);
    ASSERT_EQ(mesh->textures.size(), 1U);
    EXPECT_EQ(mesh->textures[0].bytes.size(), 78699U);
    EXPECT_EQ(mesh->textures[0].mime, "image/png");
  }
  // The textures lie the same way round.
  double sum_obj = 0;
  double sum_glb = 0;
  for (const auto& uv : obj.uvs) sum_obj += double(uv.y());
  for (const auto& uv : glb.uvs) sum_glb += double(uv.y());
  EXPECT_NEAR(sum_obj, sum_glb, 1e-3 * sum_obj);
}

TEST_F(Models, TroutIsTheSameThroughThreeFormats) {
  const VisualMesh obj = importFile(kAssets / "models/trout/trout.obj");
  const VisualMesh glb = importFile(kAssets / "models/trout/trout.glb");
  const VisualMesh ogre = importFile(kAssets / "models/trout/fish.mesh");
  for (const VisualMesh* mesh : {&obj, &glb, &ogre}) {
    SCOPED_TRACE(mesh->format);
    EXPECT_EQ(mesh->welded_positions.size(), 530U);
    EXPECT_EQ(mesh->triangles.size(), 815U);
    EXPECT_NEAR(mesh->diagonal, 8.69935, 1e-5);
    EXPECT_NEAR(areaOf(*mesh), 34.8947, 1e-3);
    ASSERT_EQ(mesh->uvs.size(), 530U);
    double u = 0;
    double v = 0;
    for (const auto& uv : mesh->uvs) u += double(uv.x()), v += double(uv.y());
    double expected_u = 0;
    double expected_v = 0;
    for (const auto& uv : obj.uvs) expected_u += double(uv.x()), expected_v += double(uv.y());
    EXPECT_NEAR(u, expected_u, 1e-2);
    EXPECT_NEAR(v, expected_v, 1e-2) << "the texture lies the wrong way up";
    EXPECT_EQ(mesh->textures.at(0).bytes.size(), 71256U);
    EXPECT_EQ(mesh->textures.at(0).mime, "image/jpeg");
  }
  EXPECT_EQ(obj.unreferenced, std::vector<std::uint32_t>{0});
  EXPECT_EQ(glb.unreferenced, std::vector<std::uint32_t>{0});
  EXPECT_EQ(glb.joints.size(), 5U);
  EXPECT_EQ(ogre.skin.size(), 530U);
  EXPECT_EQ(findingOf(ogre, "unnormalized-weights"), nullptr);
}

TEST_F(Models, HandKeepsItsWeights) {
  const VisualMesh mesh = importFile(kAssets / "models/hand_rigged.glb");
  EXPECT_EQ(mesh.joints.size(), 25U);
  EXPECT_EQ(mesh.welded_positions.size(), 1159U);
  EXPECT_NEAR(mesh.diagonal, 0.26867, 1e-5);
  EXPECT_NEAR(volumeOf(mesh), 0.0003432334, 1e-9);
  EXPECT_EQ(findingOf(mesh, "unnormalized-weights"), nullptr);
  EXPECT_EQ(findingOf(mesh, "posed-skin"), nullptr);
}

TEST_F(Models, HeadHasItsThirtySixGroups) {
  const VisualMesh mesh = importFile(kAssets / "models/makehuman_head.obj");
  EXPECT_EQ(mesh.source_vertex_count, 5040U);
  EXPECT_EQ(mesh.positions.size(), 5274U);
  EXPECT_EQ(mesh.triangles.size(), 9812U);
  EXPECT_EQ(mesh.groups.size(), 36U);
  std::size_t regions = 0;
  for (const char* name : {"head", "neck", "jaw", "lip_upper", "lip_lower", "mouth_inner", "eyelid_upper_l"}) {
    ASSERT_NE(groupOf(mesh, name), nullptr) << name;
    regions += groupOf(mesh, name)->triangles.size();
  }
  EXPECT_GT(groupOf(mesh, "body")->triangles.size(), regions) << "every region lies within the body";
}

TEST_F(Models, SpiderNamesItsMissingTextures) {
  const VisualMesh mesh = importFile(kAssets / "models/spider/spider.obj");
  EXPECT_EQ(mesh.source_vertex_count, 762U);
  EXPECT_EQ(mesh.welded_positions.size(), 722U);
  EXPECT_EQ(mesh.groups.size(), 19U);
  EXPECT_EQ(mesh.materials.size(), 4U);
  EXPECT_EQ(findingOf(mesh, "repeated-index-faces"), nullptr) << "its 56 degenerate faces appear only once welded";
  std::vector<std::string> missing;
  for (const Finding& f : mesh.findings)
    if (f.id == "missing-texture") missing.push_back(f.place);
  EXPECT_EQ(missing.size(), 4U);
  EXPECT_EQ(missing[0], ".\\wal67ar_small.jpg");
}

TEST_F(Models, PenguinsKeepColoursAndPolygons) {
  const VisualMesh painted = importFile(kAssets / "models/penguin_painted.ply");
  EXPECT_EQ(painted.colors.size(), 3362U);
  EXPECT_TRUE(std::any_of(painted.colors.begin(), painted.colors.end(), [](const auto& c) { return c[0] > 0.9F; }));
  const VisualMesh control = importFile(kAssets / "models/penguin_control.obj");
  EXPECT_EQ(control.source_face_count, 221U);
  EXPECT_EQ(control.triangles.size(), 398U);
  EXPECT_EQ(findingOf(control, "flipped-faces"), nullptr);
}

TEST_F(Models, TheWeldToleranceIsAnOption) {
  ImportOptions options = testOptions();
  options.weld_tolerance = 0;
  EXPECT_EQ(importFile(kAssets / "models/openscad_nonmanifold.obj", options).welded_positions.size(), 658U);
  options.weld_tolerance = 1e-6;
  EXPECT_EQ(importFile(kAssets / "models/openscad_nonmanifold.obj", options).welded_positions.size(), 651U);
}

}  // namespace
}  // namespace sinew::tools

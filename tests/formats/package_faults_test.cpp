// SPDX-License-Identifier: MIT
//
// Each rule of docs/package-format.md, broken alone in a package whose checksums are right.
#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "sinew/formats/package.h"
#include "sinew/formats/writer.h"
#include "tests/support/package_bytes.h"
#include "tests/support/sample_package.h"

namespace sinew::formats {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr double kNanDouble = std::numeric_limits<double>::quiet_NaN();

struct ContentFault {
  const char* reason_has;  ///< section and the start of what must be said
  std::function<void(PackageContent&)> spoil;
};

const std::vector<ContentFault> kContentFaults = {
    // INFO
    {"INFO: a text", [](auto& c) { c.info.name.offset = std::uint32_t(c.strings.size()); }},
    {"INFO: a text", [](auto& c) { c.info.tool_version = {0xffffffff, 0xffffffff}; }},
    {"INFO: a text", [](auto& c) { c.info.source_file.bytes = 0xffffffff; }},
    {"INFO: a text", [](auto& c) { c.info.unit_source.offset = 0xffffffff; }},
    {"INFO: a text", [](auto& c) { c.info.settings_json.offset = 1U << 31; }},
    {"INFO: origin", [](auto& c) { c.info.origin[2] = kNanDouble; }},
    {"INFO: metres_per_unit", [](auto& c) { c.info.metres_per_unit = 0; }},
    {"INFO: metres_per_unit", [](auto& c) { c.info.metres_per_unit = kNanDouble; }},
    {"INFO: metres_per_unit", [](auto& c) { c.info.metres_per_unit = std::numeric_limits<double>::infinity(); }},
    {"INFO: bounds", [](auto& c) { c.info.bounds_min[1] = kNan; }},
    {"INFO: bounds", [](auto& c) { c.info.bounds_max[0] = kInfinity; }},
    {"INFO: bounds", [](auto& c) { c.info.bounds_max[2] = -1; }},
    {"INFO: diagonal", [](auto& c) { c.info.diagonal = 0; }},
    {"INFO: total_mass", [](auto& c) { c.info.total_mass = -1; }},
    {"INFO: density", [](auto& c) { c.info.density = kNan; }},
    {"INFO: physical_volume", [](auto& c) { c.info.physical_volume = -1; }},
    {"INFO: source_volume", [](auto& c) { c.info.source_volume = kInfinity; }},
    {"INFO: max_rest_error", [](auto& c) { c.info.max_rest_error = kNan; }},
    {"INFO: dihedral", [](auto& c) { c.info.min_dihedral_deg = kNan; }},
    {"INFO: dihedral", [](auto& c) { c.info.max_dihedral_deg = 181; }},
    {"INFO: dihedral", [](auto& c) { c.info.min_dihedral_deg = 100; }},
    {"INFO: more inverted", [](auto& c) { c.info.inverted_tetrahedra = 3; }},
    {"INFO: a reserved", [](auto& c) { c.info.reserved0 = 1; }},
    // STRS
    {"INFO: a text", [](auto& c) { c.strings.clear(); }},
    // BODY
    {"BODY: missing", [](auto& c) { c.bodies.clear(); }},
    {"BODY, element 0: its name", [](auto& c) { c.bodies[0].name.bytes = 9999; }},
    {"BODY, element 0: a run", [](auto& c) { c.bodies[0].first_vertex = 1; }},
    {"BODY, element 0: a run", [](auto& c) { c.bodies[0].first_tetrahedron = 1; }},
    {"BODY, element 0: a run", [](auto& c) { c.bodies[0].first_cluster = 1; }},
    {"BODY, element 0: has no", [](auto& c) { c.bodies[0].vertex_count = 0; }},
    {"BODY, element 0: has no", [](auto& c) { c.bodies[0].cluster_count = 0; }},
    {"BODY, element 0: reaches", [](auto& c) { c.bodies[0].vertex_count = 0xffffffff; }},
    {"BODY, element 0: reaches", [](auto& c) { c.bodies[0].tetrahedron_count = 3; }},
    {"BODY, element 0: reaches", [](auto& c) { c.bodies[0].cluster_count = 3; }},
    {"BODY: the bodies", [](auto& c) { c.bodies[0].vertex_count = 4; }},
    {"BODY: the bodies", [](auto& c) { c.bodies[0].tetrahedron_count = 1; }},
    {"BODY: the bodies", [](auto& c) { c.bodies[0].cluster_count = 1; }},
    {"BODY, element 1: a run", [](auto& c) { c.bodies.push_back(c.bodies[0]); }},
    // PVTX
    {"PVTX: missing", [](auto& c) { c.physical_vertices.clear(); }},
    {"PVTX, element 3", [](auto& c) { c.physical_vertices[3].rest_position[1] = kNan; }},
    {"PVTX, element 4", [](auto& c) { c.physical_vertices[4].mass = 0; }},
    {"PVTX, element 4", [](auto& c) { c.physical_vertices[4].mass = -1; }},
    {"PVTX, element 4", [](auto& c) { c.physical_vertices[4].mass = kInfinity; }},
    {"PVTX, element 0", [](auto& c) { c.physical_vertices[0].mass = kNan; }},
    // TETS
    {"TETS, element 1", [](auto& c) { c.tetrahedra[1].vertex[3] = 5; }},
    {"TETS, element 0", [](auto& c) { c.tetrahedra[0].vertex[0] = kNone; }},
    {"TETS, element 1", [](auto& c) { c.tetrahedra[1].vertex[3] = c.tetrahedra[1].vertex[0]; }},
    // CLUS
    {"CLUS: missing", [](auto& c) { c.clusters.clear(); }},
    {"CLUS, element 1: its name", [](auto& c) { c.clusters[1].name.offset = 9999; }},
    {"CLUS, element 0: unknown mode", [](auto& c) { c.clusters[0].mode = static_cast<ClusterMode>(3); }},
    {"CLUS, element 1: is listed", [](auto& c) { c.clusters[1].body = 1; }},
    {"CLUS, element 1: its members do not start", [](auto& c) { c.clusters[1].first_member = 3; }},
    {"CLUS, element 0: has no members", [](auto& c) { c.clusters[0].member_count = 0; }},
    {"CLUS, element 1: its members reach", [](auto& c) { c.clusters[1].member_count = 6; }},
    {"CLUS, element 1: its members reach", [](auto& c) { c.clusters[1].member_count = 0xffffffff; }},
    {"CLUS, element 1: its moment", [](auto& c) { c.clusters[1].quadratic = 1; }},
    {"CLUS, element 1: its moment", [](auto& c) { c.clusters[1].quadratic = kNone; }},
    {"CLUS, element 0: has a quadratic", [](auto& c) { c.clusters[0].quadratic = 0; }},
    {"CLUS, element 0: radius", [](auto& c) { c.clusters[0].radius = 0; }},
    {"CLUS, element 0: radius", [](auto& c) { c.clusters[0].radius = kNan; }},
    {"CLUS, element 0: mass", [](auto& c) { c.clusters[0].mass = -2; }},
    {"CLUS, element 0: alpha", [](auto& c) { c.clusters[0].alpha = 1.5F; }},
    {"CLUS, element 0: alpha", [](auto& c) { c.clusters[0].alpha = kNan; }},
    {"CLUS, element 0: a frequency", [](auto& c) { c.clusters[0].stretch_hz = kNan; }},
    {"CLUS, element 1: a frequency", [](auto& c) { c.clusters[1].bend_hz = -1; }},
    {"CLUS, element 1: a frequency", [](auto& c) { c.clusters[1].twist_hz = -kInfinity; }},
    {"CLUS, element 1: rest_center", [](auto& c) { c.clusters[1].rest_center[0] = kNan; }},
    {"CLUS, element 1: rest_center", [](auto& c) { c.clusters[1].quadratic_mean[5] = kInfinity; }},
    {"CLUS, element 1: rest_center", [](auto& c) { c.clusters[1].a_qq[3] = kNan; }},
    // MEMB
    {"MEMB: missing", [](auto& c) { c.memberships.clear(); }},
    {"MEMB: has members of no", [](auto& c) { c.memberships.push_back({4, 0, 0}); }},
    {"MEMB, element 8", [](auto& c) { c.memberships[8].vertex = 5; }},
    {"MEMB, element 2", [](auto& c) { c.memberships[2].vertex = 1; }},
    {"MEMB, element 3", [](auto& c) { c.memberships[3].vertex = 0; }},
    {"MEMB, element 1: mu", [](auto& c) { c.memberships[1].mu = kNan; }},
    {"MEMB, element 1: mu", [](auto& c) { c.memberships[1].mu = -0.25F; }},
    {"MEMB, element 1: mu", [](auto& c) { c.memberships[1].share = kNan; }},
    {"MEMB, element 1: mu", [](auto& c) { c.memberships[1].share = -1; }},
    {"MEMB: mu of cluster 1", [](auto& c) { c.memberships[5].mu += 0.01F; }},
    {"MEMB: the shares of physical vertex 2", [](auto& c) { c.memberships[2].share = 0.5F; }},
    // AQQ9
    {"AQQ9: has moments", [](auto& c) { c.quadratic_moments.emplace_back(); }},
    {"CLUS, element 1: its moment", [](auto& c) { c.quadratic_moments.clear(); }},
    {"AQQ9, element 0", [](auto& c) { c.quadratic_moments[0].a_qq[44] = kNan; }},
    // Visual mesh
    {"VTRI: missing", [](auto& c) { c.visual_triangles.clear(); }},
    {"VPOS: missing", [](auto& c) { c.visual_positions.clear(); }},
    {"VPOS: a visual mesh without",
     [](auto& c) {
       c.barycentric.clear();
       c.cluster_attachment_ranges.clear();
       c.cluster_attachments.clear();
     }},
    {"VPOS, element 5", [](auto& c) { c.visual_positions[5][2] = kInfinity; }},
    {"VNRM, element 0", [](auto& c) { c.visual_normals[0][0] = kNan; }},
    {"VNRM: 5 elements", [](auto& c) { c.visual_normals.pop_back(); }},
    {"VUV0, element 2", [](auto& c) { c.visual_uvs[2][1] = -kInfinity; }},
    {"VUV0: 7 elements", [](auto& c) { c.visual_uvs.emplace_back(); }},
    {"VCOL: 5 elements", [](auto& c) { c.visual_colors.pop_back(); }},
    {"VTRI, element 4", [](auto& c) { c.visual_triangles[4][1] = 6; }},
    {"VTRI, element 5", [](auto& c) { c.visual_triangles[5][2] = kNone; }},
    {"VSUB, element 1: its name", [](auto& c) { c.sub_meshes[1].name.offset = 9999; }},
    {"VSUB, element 1: does not start", [](auto& c) { c.sub_meshes[1].first_triangle = 2; }},
    {"VSUB: the sub-meshes", [](auto& c) { c.sub_meshes[1].triangle_count = 2; }},
    {"VSUB: the sub-meshes", [](auto& c) { c.sub_meshes[1].triangle_count = 0xffffffff; }},
    {"VSUB, element 0: its material", [](auto& c) { c.sub_meshes[0].material = 2; }},
    {"VSUB, element 0: a reserved", [](auto& c) { c.sub_meshes[0].reserved0 = 1; }},
    {"VMAT, element 1: its name", [](auto& c) { c.materials[1].name.bytes = 9999; }},
    {"VMAT, element 0", [](auto& c) { c.materials[0].base_color[3] = kNan; }},
    {"VMAT, element 0", [](auto& c) { c.materials[0].base_color[0] = 1.5F; }},
    {"VMAT, element 0", [](auto& c) { c.materials[0].texture = 1; }},
    {"VMAT, element 1", [](auto& c) { c.materials[1].flags = 2; }},
    {"VTEX, element 0: its name", [](auto& c) { c.textures[0].name.offset = 9999; }},
    {"VTEX, element 0: its mime", [](auto& c) { c.textures[0].mime.bytes = 9999; }},
    {"VTEX, element 0: its bytes do not start", [](auto& c) { c.textures[0].offset = 1; }},
    {"VTEX, element 0: its bytes reach", [](auto& c) { c.textures[0].bytes += 1; }},
    {"VTEX, element 0: its bytes reach", [](auto& c) { c.textures[0].bytes = ~std::uint64_t{0}; }},
    {"TEXB: has bytes", [](auto& c) { c.textures[0].bytes -= 1; }},
    {"TEXB: needs section VTEX", [](auto& c) { c.textures.clear(); }},
    // Attachments
    {"ATBC: needs section TETS",
     [](auto& c) {
       c.tetrahedra.clear();
       c.bodies[0].tetrahedron_count = 0;
     }},
    {"ATBC: 5 elements", [](auto& c) { c.barycentric.pop_back(); }},
    {"ATBC, element 1", [](auto& c) { c.barycentric[1].tetrahedron = 2; }},
    {"ATBC, element 1", [](auto& c) { c.barycentric[1].weight[2] = kNan; }},
    {"ATCR: 5 elements",
     [](auto& c) {
       c.cluster_attachment_ranges.pop_back();
       c.cluster_attachments.pop_back();
     }},
    {"ATCR: missing", [](auto& c) { c.cluster_attachment_ranges.clear(); }},
    {"ATCW: missing", [](auto& c) { c.cluster_attachments.clear(); }},
    {"ATCR, element 2", [](auto& c) { c.cluster_attachment_ranges[2].first = 3; }},
    {"ATCR, element 0", [](auto& c) { c.cluster_attachment_ranges[0].count = 0; }},
    {"ATCR, element 5", [](auto& c) { c.cluster_attachment_ranges[5].count = 0xffffffff; }},
    {"ATCR, element 1: the weights", [](auto& c) { c.cluster_attachments[2].weight = 0.5F; }},
    {"ATCW, element 0", [](auto& c) { c.cluster_attachments[0].cluster = 2; }},
    {"ATCW, element 3", [](auto& c) { c.cluster_attachments[3].weight = kNan; }},
    {"ATCW: has weights", [](auto& c) { c.cluster_attachments.push_back({0, 1}); }},
    // Identity
    {"VSRC: missing", [](auto& c) { c.visual_identity.clear(); }},
    {"SVTX: missing", [](auto& c) { c.source_identity.clear(); }},
    {"SVLS: missing", [](auto& c) { c.source_visual_list.clear(); }},
    {"SMSH: missing", [](auto& c) { c.source_meshes.clear(); }},
    {"VSRC: 5 elements", [](auto& c) { c.visual_identity.pop_back(); }},
    {"VSRC, element 0", [](auto& c) { c.visual_identity[0].source_vertex = 7; }},
    {"VSRC, element 0", [](auto& c) { c.visual_identity[0].welded = 6; }},
    {"SVTX, element 0: its run of SVLS is", [](auto& c) { c.visual_identity[0].source_vertex = 1; }},
    {"SVTX, element 5: its run of SVLS is", [](auto& c) { std::swap(c.source_visual_list[4], c.source_visual_list[5]); }},
    {"SVTX, element 5: its welded", [](auto& c) { c.visual_identity[5].welded = 3; }},
    {"SVTX, element 2: its welded", [](auto& c) { c.source_identity[2].welded = kNone; }},
    {"SVTX, element 4: names a welded", [](auto& c) { c.source_identity[4].welded = 0; }},
    {"SVTX, element 1: its run of SVLS does", [](auto& c) { c.source_identity[1].first_visual = 0; }},
    {"SVTX, element 6: its run reaches", [](auto& c) { c.source_identity[6].visual_count = 1; }},
    {"SVTX, element 6: its run reaches", [](auto& c) { c.source_identity[6].visual_count = 0xffffffff; }},
    {"SVLS: has visual vertices of no",
     [](auto& c) {
       c.source_identity[5] = {kNone, 4, 0};
       c.source_identity[6].first_visual = 4;
     }},
    {"SVLS: does not have", [](auto& c) { c.source_visual_list.push_back(0); }},
    {"SVLS, element 3", [](auto& c) { c.source_visual_list[3] = 6; }},
    {"SMSH, element 1: its name", [](auto& c) { c.source_meshes[1].name.offset = 9999; }},
    {"SMSH, element 1: does not", [](auto& c) { c.source_meshes[1].first_source_vertex = 5; }},
    {"SMSH: the meshes", [](auto& c) { c.source_meshes[1].source_vertex_count = 2; }},
    // Groups
    {"GRPV: needs section GRUP", [](auto& c) { c.groups.clear(); }},
    {"GRUP, element 0: its name", [](auto& c) { c.groups[0].name.offset = 9999; }},
    {"GRUP, element 2: does not", [](auto& c) { c.groups[2].first = 1; }},
    {"GRUP, element 2: does not", [](auto& c) { c.groups[2].count = 0xffffffff; }},
    {"GRUP, element 0: its vertices", [](auto& c) { std::swap(c.group_vertices[0], c.group_vertices[1]); }},
    {"GRUP, element 2: its vertices", [](auto& c) { c.group_vertices[4] = 6; }},
    {"GRPV: has vertices", [](auto& c) { c.group_vertices.push_back(5); }},
    // Parts
    {"PRTV: needs section PART", [](auto& c) { c.part_vertices = {0}; }},
    {"PART, element 0: its name", [](auto& c) { c.parts = {{{9999, 1}, kNone, 0, 0, 0}}; }},
    {"PART, element 0: its cluster", [](auto& c) { c.parts = {{{0, 0}, 99, 0, 0, 0}}; }},
    {"PART, element 0: its cluster", [](auto& c) { c.parts = {{{0, 0}, kNone, 0, 0, 1}}; }},
    {"PART, element 0: does not", [](auto& c) { c.parts = {{{0, 0}, 0, 0, 1, 0}}; }},
    {"PART, element 0: its vertices",
     [](auto& c) {
       c.parts = {{{0, 0}, 0, 0, 1, 0}};
       c.part_vertices = {9999};
     }},
    {"PRTV: has vertices",
     [](auto& c) {
       c.parts = {{{0, 0}, kNone, 0, 2, 0}};
       c.part_vertices = {0, 1, 2};
     }},
};

TEST(PackageFaults, EachBrokenRuleIsRefusedAndNamed) {
  for (std::size_t i = 0; i < kContentFaults.size(); ++i) {
    PackageContent content = test::samplePackage();
    kContentFaults[i].spoil(content);
    const std::string reason = test::reasonOf(writePackage(content));
    EXPECT_EQ(reason.find("section " + std::string(kContentFaults[i].reason_has)), 0U)
        << "fault " << i << " (" << kContentFaults[i].reason_has << ") gave: " << reason;
    EXPECT_EQ(reason.find('\n'), std::string::npos);
  }
}

const std::vector<ContentFault> kMechanicsFaults = {
    {"CMEC: 1 elements for 2", [](auto& c) { c.mechanics.pop_back(); }},
    {"CMEC, element 0: unknown stiffness", [](auto& c) { c.mechanics[0].stiffness = StiffnessModel(3); }},
    {"CMEC, element 0: unknown limit", [](auto& c) { c.mechanics[0].limit = LimitMethod(7); }},
    {"CMEC, element 0: unknown volume", [](auto& c) { c.mechanics[0].volume = VolumeMethod(3); }},
    {"CMEC, element 1: per_step_beta", [](auto& c) { c.mechanics[1].per_step_beta[1] = 1.5F; }},
    {"CMEC, element 0: young", [](auto& c) { c.mechanics[0].young = -1; }},
    {"CMEC, element 0: young", [](auto& c) { c.mechanics[0].young = kInfinity; }},
    {"CMEC, element 0: poisson", [](auto& c) { c.mechanics[0].poisson = 0.5F; }},
    {"CMEC, element 0: damping", [](auto& c) { c.mechanics[0].damping = kNan; }},
    {"CMEC, element 0: stretch_min", [](auto& c) { c.mechanics[0].stretch_min = 0; }},
    {"CMEC, element 0: stretch_max", [](auto& c) { c.mechanics[0].stretch_max = 0.9F; }},
    {"CMEC, element 0: norm_max", [](auto& c) { c.mechanics[0].norm_max = 2.9F; }},
    {"CMEC, element 0: norm_limit", [](auto& c) { c.mechanics[0].norm_limit = 3.5F; }},
    {"CMEC, element 0: plastic", [](auto& c) { c.mechanics[0].plastic_yield = -0.1F; }},
    {"CMEC, element 0: plastic", [](auto& c) { c.mechanics[0].plastic_creep = kNan; }},
    {"CMEC, element 0: plastic", [](auto& c) { c.mechanics[0].plastic_limit = 11; }},
    {"CMEC, element 0: contraction", [](auto& c) { c.mechanics[0].contraction = 0.95F; }},
    {"CMEC, element 0: fibre", [](auto& c) { c.mechanics[0].fibre[1] = 0.7F; }},
    {"CMEC, element 0: fibre", [](auto& c) { c.mechanics[0].fibre[0] = kNan; }},
    {"CMEC, element 0: its channel", [](auto& c) { c.mechanics[0].channel = 2; }},
    {"CMEC, element 0: its channel", [](auto& c) { c.channels.clear(); }},
    {"CMEC, element 0: a reserved", [](auto& c) { c.mechanics[0].reserved0 = 1; }},
    {"CMEC, element 0: has a curve", [](auto& c) { c.mechanics[0].curve_point_count = 2; }},
    {"CMEC, element 1: its curve has fewer", [](auto& c) { c.mechanics[1].curve_point_count = 1; }},
    {"CMEC, element 1: its curve reaches", [](auto& c) { c.mechanics[1].curve_point_count = 4; }},
    {"CMEC, element 1: its curve reaches", [](auto& c) { c.mechanics[1].first_curve_point = 0xffffffff; }},
    {"CMEC, element 1: its curve reaches", [](auto& c) { c.curve_points.clear(); }},
    {"CMEC, element 1: a point", [](auto& c) { c.curve_points[3].response = 33; }},
    {"CMEC, element 1: a point", [](auto& c) { c.curve_points[2].norm = kNan; }},
    {"CMEC, element 1: the first point", [](auto& c) { c.curve_points[1].response = 3.5F; }},
    {"CMEC, element 1: its curve is not", [](auto& c) { c.curve_points[3].norm = 8; }},
    {"CMEC, element 1: its curve is not", [](auto& c) { c.curve_points[3].response = 4.5F; }},
    {"CURV: needs section CMEC", [](auto& c) { c.mechanics.clear(); }},
    {"CHAN, element 1: its name", [](auto& c) { c.channels[1].name.bytes = 9999; }},
    {"PSTF: 4 elements for 5", [](auto& c) { c.vertex_stiffness.pop_back(); }},
    {"PSTF, element 2: outside", [](auto& c) { c.vertex_stiffness[2] = 1.1F; }},
    {"PPIN: 6 elements for 5", [](auto& c) { c.pin_weights.push_back(0); }},
    {"PPIN, element 0: outside", [](auto& c) { c.pin_weights[0] = kNan; }},
};

struct PinFault {
  const char* reason_has;
  void (*spoil)(PackageContent&);
};

TEST(PackageFaults, EachBrokenRuleOfPinSetsIsRefusedAndNamed) {
  const auto sound = [] {
    PackageContent content = test::mechanicsPackage();
    content.pin_sets = {{content.addText("skull"), content.addText("Head"), 3, 0, 2, 0},
                        {content.addText("none"), content.addText("world"), 0, 2, 0, 0}};
    content.pin_set_vertices = {1, 4};
    return content;
  };
  EXPECT_EQ(test::reasonOf(writePackage(sound())), "");
  const PinFault faults[] = {
      {"PSET, element 0: its name", [](PackageContent& c) { c.pin_sets[0].name.offset = 9999; }},
      {"PSET, element 1: its target", [](PackageContent& c) { c.pin_sets[1].target.bytes = 9999; }},
      {"PSET, element 0: unknown", [](PackageContent& c) { c.pin_sets[0].method = 4; }},
      {"PSET, element 1: unknown", [](PackageContent& c) { c.pin_sets[1].reserved0 = 1; }},
      {"PSET, element 1: does not", [](PackageContent& c) { c.pin_sets[1].first = 1; }},
      {"PSET, element 1: does not", [](PackageContent& c) { c.pin_sets[1].count = 0xffffffff; }},
      {"PSET, element 0: its vertices", [](PackageContent& c) { c.pin_set_vertices[1] = 1; }},
      {"PSET, element 0: its vertices", [](PackageContent& c) { c.pin_set_vertices[1] = 5; }},
      {"PSTV: has vertices", [](PackageContent& c) { c.pin_set_vertices.push_back(0); }},
      {"PSTV: needs section PSET", [](PackageContent& c) { c.pin_sets.clear(); }},
  };
  for (const PinFault& fault : faults) {
    PackageContent content = sound();
    fault.spoil(content);
    const std::string reason = test::reasonOf(writePackage(content));
    EXPECT_NE(reason.find(fault.reason_has), std::string::npos) << fault.reason_has << " gave: " << reason;
  }
}

TEST(PackageFaults, EachBrokenRuleOfMasksIsRefusedAndNamed) {
  const auto sound = [] {
    PackageContent content = test::samplePackage();
    content.masks = {{content.addText("cheek"), 0, 2}, {content.addText("none"), 2, 0}};
    content.mask_weights = {{1, 0.5F}, {4, 1}};
    return content;
  };
  EXPECT_EQ(test::reasonOf(writePackage(sound())), "");
  const PinFault faults[] = {
      {"MASK, element 1: its name", [](PackageContent& c) { c.masks[1].name.bytes = 9999; }},
      {"MASK, element 1: does not", [](PackageContent& c) { c.masks[1].first = 1; }},
      {"MASK, element 0: does not", [](PackageContent& c) { c.masks[0].count = 3; }},
      {"MASK, element 0: its vertices", [](PackageContent& c) { c.mask_weights[1].vertex = 1; }},
      {"MASK, element 0: its vertices", [](PackageContent& c) { c.mask_weights[1].vertex = 9999; }},
      {"MASK, element 0: its vertices", [](PackageContent& c) { c.mask_weights[0].weight = 0; }},
      {"MASK, element 0: its vertices", [](PackageContent& c) { c.mask_weights[0].weight = 1.5F; }},
      {"MASK, element 0: its vertices", [](PackageContent& c) { c.mask_weights[0].weight = kNan; }},
      {"MSKV: has weights",
       [](PackageContent& c) {
         c.mask_weights.push_back({5, 1});
       }},
      {"MSKV: needs section MASK", [](PackageContent& c) { c.masks.clear(); }},
  };
  for (const PinFault& fault : faults) {
    PackageContent content = sound();
    fault.spoil(content);
    const std::string reason = test::reasonOf(writePackage(content));
    EXPECT_NE(reason.find(fault.reason_has), std::string::npos) << fault.reason_has << " gave: " << reason;
  }
}

TEST(PackageFaults, EachBrokenRuleOfMechanicsIsRefusedAndNamed) {
  EXPECT_EQ(test::reasonOf(writePackage(test::mechanicsPackage())), "");
  for (std::size_t i = 0; i < kMechanicsFaults.size(); ++i) {
    PackageContent content = test::mechanicsPackage();
    kMechanicsFaults[i].spoil(content);
    const std::string reason = test::reasonOf(writePackage(content));
    EXPECT_EQ(reason.find("section " + std::string(kMechanicsFaults[i].reason_has)), 0U)
        << "fault " << i << " (" << kMechanicsFaults[i].reason_has << ") gave: " << reason;
  }
}

TEST(PackageFaults, WhatTheFormatAllowsOpens) {
  const std::vector<std::function<void(PackageContent&)>> allowed = {
      [](auto& c) { c.clusters[1].stretch_hz = kInfinity; },
      [](auto& c) { c.clusters[1].stretch_hz = 0; },
      [](auto& c) { c.clusters[0].alpha = 0; },
      [](auto& c) { c.info.source_volume = -1; },
      [](auto& c) {
        c.barycentric[0].weight = {-3, 7, 0.5F};
      },
      [](auto& c) { c.sub_meshes[0].material = kNone; },
      [](auto& c) { c.sub_meshes.clear(); },
      [](auto& c) { c.visual_normals.clear(); },
      [](auto& c) { c.barycentric.clear(); },
      [](auto& c) {
        c.cluster_attachment_ranges.clear();
        c.cluster_attachments.clear();
      },
      [](auto& c) {
        c.groups = {c.groups[1]};
        c.groups[0].first = 0;
        c.group_vertices.clear();
      },
      [](auto& c) {
        c.textures[0].bytes = 0;
        c.texture_bytes.clear();
      },
  };
  for (std::size_t i = 0; i < allowed.size(); ++i) {
    PackageContent content = test::samplePackage();
    allowed[i](content);
    EXPECT_EQ(test::reasonOf(writePackage(content)), "") << "variant " << i;
  }
}

struct FrameFault {
  const char* reason_has;
  std::function<void(Header&, SectionEntry&)> spoil;  ///< the entry is that of section VCOL (optional, 24 bytes)
};

TEST(PackageFaults, EachBrokenFrameIsRefusedAndNamed) {
  const std::vector<FrameFault> faults = {
      {"magic", [](Header& h, SectionEntry&) { h.magic[4] = '\n'; }},
      {"header_bytes", [](Header& h, SectionEntry&) { h.header_bytes = 128; }},
      {"cut short", [](Header& h, SectionEntry&) { h.total_bytes += 64; }},
      {"appended", [](Header& h, SectionEntry&) { h.total_bytes -= 64; }},
      {"header: a reserved", [](Header& h, SectionEntry&) { h.reserved0 = 1; }},
      {"header: a reserved", [](Header& h, SectionEntry&) { h.reserved1[1] = 1; }},
      {"table of 4294967295", [](Header& h, SectionEntry&) { h.section_count = 0xffffffff; }},
      {"INFO: does not start", [](Header& h, SectionEntry&) { h.section_count -= 1; }},
      {"INFO: does not start", [](Header& h, SectionEntry&) { h.section_count = 1; }},
      {"the sections end", [](Header& h, SectionEntry&) { h.section_count = 0; }},
      {"feature bit that", [](Header& h, SectionEntry&) { h.features |= 1U << 12; }},
      {"feature bit that", [](Header& h, SectionEntry&) { h.features |= std::uint64_t{1} << 63; }},
      {"GRUP: present, but", [](Header& h, SectionEntry&) { h.features &= ~std::uint64_t{kFeatureGroups}; }},
      {"VCOL: does not start", [](Header&, SectionEntry& e) { e.offset += 64; }},
      {"VCOL: does not start", [](Header&, SectionEntry& e) { e.offset = ~std::uint64_t{63}; }},
      {"VCOL: reaches", [](Header&, SectionEntry& e) { e.bytes = ~std::uint64_t{0}; }},
      {"VCOL: reaches", [](Header&, SectionEntry& e) { e.bytes = 1U << 30; }},
      {"VCOL: its bytes", [](Header&, SectionEntry& e) { e.element_count += 1; }},
      {"VCOL: its bytes", [](Header&, SectionEntry& e) { e.element_count = (std::uint64_t{1} << 62) + 6; }},
      {"VCOL: has no elements", [](Header&, SectionEntry& e) { e.element_count = 0; }},
      {"VCOL: has no elements", [](Header&, SectionEntry& e) { e.element_bytes = 0; }},
      {"VCOL: elements of 8", [](Header&, SectionEntry& e) { e.element_bytes = 8, e.element_count = 3; }},
      {"VCOL: its flags", [](Header&, SectionEntry& e) { e.flags = kSectionRequired; }},
      {"VCOL: its flags", [](Header&, SectionEntry& e) { e.flags = 2; }},
      {"VCOL: a reserved", [](Header&, SectionEntry& e) { e.reserved0 = 1; }},
      {"VCOL: a reserved", [](Header&, SectionEntry& e) { e.reserved1[0] = 1; }},
      {"VCOL: the padding", [](Header&, SectionEntry& e) { e.bytes -= 4, e.element_count -= 1; }},
      {"GRPV: occurs twice", [](Header&, SectionEntry& e) { e.id = section::group_vertices; }},
  };
  for (const FrameFault& fault : faults) {
    std::vector<std::byte> bytes = writePackage(test::samplePackage());
    Header header;
    std::memcpy(&header, bytes.data(), sizeof header);
    SectionEntry entry = test::entryOf(bytes, section::visual_colors);
    fault.spoil(header, entry);
    test::setEntry(bytes, section::visual_colors, entry);
    std::memcpy(bytes.data(), &header, sizeof header);
    test::reseal(bytes);
    const std::string reason = test::reasonOf(bytes);
    EXPECT_NE(reason.find(fault.reason_has), std::string::npos) << fault.reason_has << " gave: " << reason;
  }
}

TEST(PackageFaults, DamageIsToldByTheSectionItLiesIn) {
  std::vector<std::byte> bytes = writePackage(test::samplePackage());
  bytes[test::entryOf(bytes, section::clusters).offset + 20] ^= std::byte{4};
  EXPECT_EQ(test::reasonOf(bytes), "section CLUS: checksum does not match (damaged)");
}

}  // namespace
}  // namespace sinew::formats

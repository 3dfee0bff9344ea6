// SPDX-License-Identifier: MIT
//
// Each rule of docs/package-format.md, broken alone in a package whose checksums are right.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <functional>
#include <limits>
#include <string>
#include <utility>
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
    {"INFO: origin", [](auto& c) { c.info.origin[0] = -1.1e15; }},
    {"INFO: metres_per_unit", [](auto& c) { c.info.metres_per_unit = 1.1e18; }},
    {"INFO: bounds", [](auto& c) { c.info.bounds_max[1] = 1.1e15F; }},
    {"INFO: diagonal", [](auto& c) { c.info.diagonal *= 1.01F; }},
    {"INFO: diagonal", [](auto& c) { c.info.bounds_max[0] += 0.1F; }},
    {"INFO: diagonal", [](auto& c) { c.info.bounds_max = c.info.bounds_min; }},
    {"INFO: total_mass", [](auto& c) { c.info.total_mass = 1.1e18F; }},
    {"INFO: density", [](auto& c) { c.info.density = 1.1e18F; }},
    {"INFO: physical_volume", [](auto& c) { c.info.physical_volume = 1.1e18F; }},
    {"INFO: source_volume", [](auto& c) { c.info.source_volume = -1.1e18F; }},
    {"INFO: max_rest_error", [](auto& c) { c.info.max_rest_error = 1.1e18F; }},
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
    {"BODY: missing", [](auto& c) { c.pieces.clear(); }},
    {"BODY, element 0: its name", [](auto& c) { c.pieces[0].name.bytes = 9999; }},
    {"BODY, element 0: a run", [](auto& c) { c.pieces[0].first_vertex = 1; }},
    {"BODY, element 0: a run", [](auto& c) { c.pieces[0].first_tetrahedron = 1; }},
    {"BODY, element 0: a run", [](auto& c) { c.pieces[0].first_cluster = 1; }},
    {"BODY, element 0: has no", [](auto& c) { c.pieces[0].vertex_count = 0; }},
    {"BODY, element 0: has no", [](auto& c) { c.pieces[0].cluster_count = 0; }},
    {"BODY, element 0: reaches", [](auto& c) { c.pieces[0].vertex_count = 0xffffffff; }},
    {"BODY, element 0: reaches", [](auto& c) { c.pieces[0].tetrahedron_count = 3; }},
    {"BODY, element 0: reaches", [](auto& c) { c.pieces[0].cluster_count = 3; }},
    {"BODY: the pieces", [](auto& c) { c.pieces[0].vertex_count = 4; }},
    {"BODY: the pieces", [](auto& c) { c.pieces[0].tetrahedron_count = 1; }},
    {"BODY: the pieces", [](auto& c) { c.pieces[0].cluster_count = 1; }},
    {"BODY, element 1: a run", [](auto& c) { c.pieces.push_back(c.pieces[0]); }},
    // PVTX
    {"PVTX: missing", [](auto& c) { c.physical_vertices.clear(); }},
    {"PVTX, element 3", [](auto& c) { c.physical_vertices[3].rest_position[1] = kNan; }},
    {"PVTX, element 3", [](auto& c) { c.physical_vertices[3].rest_position[1] = 1e20F; }},
    {"PVTX, element 3",
     [](auto& c) {
       c.physical_vertices[3].rest_position[2] = c.info.bounds_max[2] + 1.01F * c.info.diagonal;
     }},
    {"PVTX, element 3",
     [](auto& c) {
       c.physical_vertices[3].rest_position[0] = c.info.bounds_min[0] - 1.01F * c.info.diagonal;
     }},
    {"PVTX: the masses", [](auto& c) { c.physical_vertices[4].mass += 0.01F; }},
    {"PVTX: the masses", [](auto& c) { c.info.total_mass *= 0.99F; }},
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
    {"CLUS, element 1: is listed", [](auto& c) { c.clusters[1].piece = 1; }},
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
    {"CLUS, element 1: rest_center", [](auto& c) { c.clusters[1].rest_center[2] = 100; }},
    {"CLUS, element 1: a_qq", [](auto& c) { c.clusters[1].a_qq[3] = kNan; }},
    {"CLUS, element 1: a_qq", [](auto& c) { c.clusters[1].a_qq[0] = 1.1e12F; }},
    {"CLUS, element 0: radius", [](auto& c) { c.clusters[0].radius = 4 * c.info.diagonal; }},
    {"CLUS, element 0: radius", [](auto& c) { c.clusters[0].radius = 1e-12F; }},
    {"CLUS, element 0: mass", [](auto& c) { c.clusters[0].mass = 1.01F * c.info.total_mass; }},
    {"CLUS, element 0: a frequency", [](auto& c) { c.clusters[0].stretch_hz = 1.1e18F; }},
    {"MEMB, element 0: the vertex", [](auto& c) { c.clusters[0].radius *= 0.5F; }},
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
    {"AQQ9, element 0", [](auto& c) { c.quadratic_moments[0].a_qq[7] = -1.1e12F; }},
    {"CLUS, element 1: its element of section AQQ9", [](auto& c) { c.quadratic_moments[0].a_qq[44] = 1e6F; }},
    {"CLUS, element 1: a_qq is not the inverse", [](auto& c) { c.clusters[1].a_qq[1] *= 2; }},
    {"CLUS, element 0: a_qq is not the inverse", [](auto& c) { c.clusters[0].a_qq[5] += 100; }},
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
    {"VPOS, element 5", [](auto& c) { c.visual_positions[5][2] = c.info.bounds_max[2] + 1.01F * c.info.diagonal; }},
    {"VNRM, element 4", [](auto& c) { c.visual_normals[4][1] = -1.01F; }},
    {"VUV0, element 2", [](auto& c) { c.visual_uvs[2][0] = 1.1e9F; }},
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
       c.pieces[0].tetrahedron_count = 0;
     }},
    {"ATBC: 5 elements", [](auto& c) { c.barycentric.pop_back(); }},
    {"ATBC, element 1", [](auto& c) { c.barycentric[1].tetrahedron = 2; }},
    {"ATBC, element 1", [](auto& c) { c.barycentric[1].weight[2] = kNan; }},
    {"ATBC, element 1", [](auto& c) { c.barycentric[1].weight[2] = -1.1e6F; }},
    {"ATBC, element 1: hangs more than a diagonal outside", [](auto& c) { c.barycentric[1].weight[2] = 1e4F; }},
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
    {"ATCW, element 3", [](auto& c) { c.cluster_attachments[3].weight = -0.1F; }},
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
    {"CMEC, element 1: fibre",
     [](auto& c) {
       c.mechanics[1].fibre = {1e-30F, 0, 0};
     }},  // its square is no float
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

// Function j of fieldPackage(), as it is everywhere, times a factor, and what it carries divided by that: places stay.
void scaleFunction(PackageContent& c, std::size_t j, float factor) {
  const Field& field = c.fields[j < 4 ? 0 : 1];
  const std::size_t k = field.function_count, of = j - field.first_function;
  const auto times = [factor](Lanes& lanes) {
    for (float& value : lanes) value *= factor;
  };
  FieldFunction& function = c.field_functions[j];
  function.one /= factor;
  for (float& value : function.rest) value /= factor;
  for (std::size_t axis = 0; axis < 3; ++axis) times(c.field_gradients[field.first_gradient + 3 * of + axis]);
  times(c.field_values[field.first_value + of]);
  for (std::size_t block = 0; block < 2; ++block) times(c.field_point_values[field.first_point_value + k * block + of]);
}

// Function j of the free field becomes (function i + function j) / sqrt(2), and what they carry changes so that places
// stay.
void mixFunctions(PackageContent& c, std::size_t i, std::size_t j) {
  const float half = std::sqrt(0.5F);
  const auto mix = [half](std::vector<Lanes>& lanes, std::size_t a, std::size_t b) {
    for (std::size_t l = 0; l < 8; ++l) lanes[b][l] = half * (lanes[a][l] + lanes[b][l]);
  };
  for (std::size_t axis = 0; axis < 3; ++axis) mix(c.field_gradients, 3 * i + axis, 3 * j + axis);
  mix(c.field_values, i, j);
  for (const std::size_t block : {0U, 4U}) mix(c.field_point_values, block + i, block + j);
  // f_i c_i + f_j c_j = f_i (c_i - c_j) + (f_i + f_j) / sqrt(2) * sqrt(2) c_j
  FieldFunction &a = c.field_functions[i], &b = c.field_functions[j];
  a.one -= b.one;
  b.one /= half;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    a.rest[axis] -= b.rest[axis];
    b.rest[axis] /= half;
  }
}

// Both values of tethers that are of functions i and j.
void setTether(PackageContent& c, std::size_t i, std::size_t j, float value) {
  c.field_tether_values[5 * i + j] = c.field_tether_values[5 * j + i] = value;
}

// The held field is driven by the empty pin set too, by functions that are 0 everywhere. Its tethers, 9 x 9, tie three
// places to that set, whose X sum to 0: by rounding alone, X of one set pulls at 1 of the other. \param last N/m, of
// the third place; the others have 70.
void tieToBothSets(PackageContent& c, double last) {
  const auto insertZeros = [](auto& items, std::size_t before, std::size_t count) {
    items.insert(items.begin() + std::ptrdiff_t(before), count, {});
  };
  const std::vector<FieldFunction> driven(c.field_functions.begin() + 4, c.field_functions.begin() + 8);
  c.field_functions.insert(c.field_functions.begin() + 4, driven.begin(), driven.end());
  for (std::size_t j = 4; j < 8; ++j) c.field_functions[j].pin_set = 0;
  c.fields[1].function_count = 9;
  c.fields[1].driven_count = 8;
  insertZeros(c.field_gradients, 12, 12);
  insertZeros(c.field_values, 4, 4);
  insertZeros(c.field_point_values, 8, 4);
  insertZeros(c.field_point_values, 17, 4);
  insertZeros(c.field_fibre_values, 8, 4);
  const FieldFunction& inner = c.field_functions[12];
  std::vector<double> sums(81, 0.0);
  for (const double x : {0.1, 0.2, -0.3}) {
    const double stiffness = x < 0 ? last : 70;
    constexpr double kInner = 0.7;
    const std::array<double, 4> monomials = {1, x, 0.4, 0.9};
    const std::array<double, 4> carried = {double(inner.one), double(inner.rest[0]), double(inner.rest[1]),
                                           double(inner.rest[2])};
    std::array<double, 9> off = {};
    for (std::size_t n = 0; n < 4; ++n) {
      off[n] = -monomials[n];
      off[4 + n] = monomials[n] - kInner * carried[n];
    }
    off[8] = kInner;
    for (std::size_t i = 0; i < 9; ++i) {
      for (std::size_t j = 0; j < 9; ++j) sums[9 * i + j] += stiffness * (off[i] * off[j]);
    }
  }
  c.field_tether_values.assign(sums.begin(), sums.end());
}

// Both fields once more, as those of level 1: functions 9..17, of which 13..16 are driven.
void addLevel(PackageContent& c) {
  const auto twice = [](auto& items) {
    const auto once = items;
    items.insert(items.end(), once.begin(), once.end());
  };
  const auto before = [](const auto& items) { return std::uint32_t(items.size()); };
  for (std::size_t i = 0; i < 2; ++i) {
    Field f = c.fields[i];
    f.level = 1;
    f.first_function += before(c.field_functions);
    f.first_pack += before(c.field_packs);
    f.first_gradient += before(c.field_gradients);
    f.first_value += before(c.field_values);
    f.first_point += before(c.field_points);
    f.first_point_value += before(c.field_point_values);
    f.first_mode += before(c.field_modes);
    c.fields.push_back(f);
  }
  twice(c.field_functions);
  twice(c.field_packs);
  twice(c.field_gradients);
  twice(c.field_values);
  twice(c.field_points);
  twice(c.field_point_values);
  twice(c.field_modes);
}

// The free field has functions 0..3, pack 0, gradients 0..11, values 0..3, points 0..8 and point values 0..7; the held
// one functions 4..8, pack 1, gradients 12..26, values 4..8, points 9..17, point values 8..17, modes 26..29 (0..25: 12
// modes and their frequencies in two blocks). Fibres 0 and 1 (of the clusters 0 and 1) are of the free field and have
// fibre values 0..3 and 4..7; fibre 2 (of cluster 0) is of the held one and has 8..12. Tether values 0..24 are of the
// held one: 5 i + j.
const std::vector<ContentFault> kFieldFaults = {
    // Presence
    {"FELD: missing", [](auto& c) { c.fields.clear(); }},
    {"FFUN: missing", [](auto& c) { c.field_functions.clear(); }},
    {"FPAK: missing", [](auto& c) { c.field_packs.clear(); }},
    {"FGRD: missing", [](auto& c) { c.field_gradients.clear(); }},
    {"FVAL: missing", [](auto& c) { c.field_values.clear(); }},
    {"FMOD: missing", [](auto& c) { c.field_modes.clear(); }},
    {"FPTV: needs section FPNT", [](auto& c) { c.field_points.clear(); }},
    {"FPNT: needs section FELD",
     [](auto& c) {
       c.fields.clear();
       c.field_functions.clear();
       c.field_packs.clear();
       c.field_gradients.clear();
       c.field_values.clear();
       c.field_modes.clear();
     }},
    {"FELD, element 0: its run of FPTV", [](auto& c) { c.field_point_values.clear(); }},
    {"FFIB: needs section FELD",
     [](auto& c) {
       c.fields.clear();
       c.field_functions.clear();
       c.field_packs.clear();
       c.field_gradients.clear();
       c.field_values.clear();
       c.field_points.clear();
       c.field_point_values.clear();
       c.field_modes.clear();
     }},
    {"FTHR: needs section FELD",
     [](auto& c) {
       c.fields.clear();
       c.field_functions.clear();
       c.field_packs.clear();
       c.field_gradients.clear();
       c.field_values.clear();
       c.field_points.clear();
       c.field_point_values.clear();
       c.field_modes.clear();
       c.field_fibres.clear();
       c.field_fibre_values.clear();
     }},
    {"FFBV: needs section FFIB", [](auto& c) { c.field_fibres.clear(); }},
    {"FTHV: needs section FTHR", [](auto& c) { c.field_tethers.clear(); }},
    {"FTHR, element 0: its run of FTHV", [](auto& c) { c.field_tether_values.clear(); }},
    {"FFIB, element 0: its run of FFBV", [](auto& c) { c.field_fibre_values.clear(); }},
    // FELD: order
    {"FELD, element 0: held is not", [](auto& c) { c.fields[0].held = 2; }},
    {"FELD, element 0: not the free", [](auto& c) { c.fields[0].piece = 1; }},
    {"FELD, element 0: not the free", [](auto& c) { c.fields[0].piece = kNone; }},
    {"FELD, element 1: not the free", [](auto& c) { c.fields[1].held = 0; }},
    {"FELD, element 1: not the free",
     [](auto& c) {
       c.fields[1].held = 0;
       c.fields[1].piece = 1;
     }},
    {"FELD, element 0: held, but", [](auto& c) { c.fields[0].held = 1; }},
    {"FELD, element 1: held, but", [](auto& c) { c.fields[1].piece = 1; }},
    {"FELD, element 2: held, but", [](auto& c) { c.fields.push_back(c.fields[1]); }},
    {"FELD, element 2: not the free", [](auto& c) { c.fields.push_back(c.fields[0]); }},
    // FELD: counts and numbers
    {"FELD, element 0: function_count", [](auto& c) { c.fields[0].function_count = 0; }},
    {"FELD, element 0: function_count", [](auto& c) { c.fields[0].function_count = 1025; }},
    {"FELD, element 0: driven_count", [](auto& c) { c.fields[0].driven_count = 4; }},
    {"FELD, element 1: driven_count", [](auto& c) { c.fields[1].driven_count = 0; }},
    {"FELD, element 1: driven_count", [](auto& c) { c.fields[1].driven_count = 3; }},
    {"FELD, element 1: driven_count", [](auto& c) { c.fields[1].driven_count = 8; }},
    {"FELD, element 1: has no samples", [](auto& c) { c.fields[1].pack_count = 0; }},
    {"FELD, element 0: lowest_hz", [](auto& c) { c.fields[0].lowest_hz = -1; }},
    {"FELD, element 0: lowest_hz", [](auto& c) { c.fields[0].lowest_hz = kInfinity; }},
    {"FELD, element 0: lowest_hz", [](auto& c) { c.fields[0].static_error = kNan; }},
    {"FELD, element 0: lowest_hz", [](auto& c) { c.fields[0].static_error = -0.5F; }},
    {"FELD, element 1: lowest_hz", [](auto& c) { c.fields[1].least_eigenvalue = kNan; }},
    {"FELD, element 1: lowest_hz", [](auto& c) { c.fields[1].least_eigenvalue = 2e18F; }},
    // FELD: runs
    {"FELD, element 0: its run of FFUN", [](auto& c) { c.fields[0].first_function = 1; }},
    {"FELD, element 1: its run of FFUN", [](auto& c) { c.fields[1].first_function = 3; }},
    {"FELD, element 1: its run of FFUN", [](auto& c) { c.fields[1].function_count = 1024; }},
    {"FELD, element 1: its run of FPAK", [](auto& c) { c.fields[1].first_pack = 0; }},
    {"FELD, element 1: its run of FPAK", [](auto& c) { c.fields[1].pack_count = 0xffffffff; }},
    {"FELD, element 1: its run of FGRD", [](auto& c) { c.fields[1].first_gradient = 0; }},
    {"FELD, element 1: its run of FGRD", [](auto& c) { c.field_gradients.pop_back(); }},
    {"FELD, element 1: its run of FVAL", [](auto& c) { c.fields[1].first_value = 0xffffffff; }},
    {"FELD, element 1: its run of FVAL", [](auto& c) { c.field_values.pop_back(); }},
    {"FELD, element 1: its run of FPNT", [](auto& c) { c.fields[1].first_point = 8; }},
    {"FELD, element 1: its run of FPNT", [](auto& c) { c.fields[1].point_count = 0xffffffff; }},
    {"FELD, element 1: its run of FPNT",
     [](auto& c) {
       c.fields[0].point_count = 9 + 1;
       c.field_points.insert(c.field_points.begin() + 9, {{0, 0, 0}, 1});
       c.field_point_values[4][1] = c.field_point_values[0][0];  // all four functions at vertex 0
       c.field_point_values[5][1] = c.field_point_values[1][0];
       c.field_point_values[6][1] = c.field_point_values[2][0];
       c.field_point_values[7][1] = c.field_point_values[3][0];
     }},
    {"FELD, element 1: its run of FPTV", [](auto& c) { c.fields[1].first_point_value = 4; }},
    {"FELD, element 1: its run of FPTV", [](auto& c) { c.field_point_values.pop_back(); }},
    {"FELD, element 1: its run of FMOD", [](auto& c) { c.fields[1].first_mode = 13; }},
    {"FELD, element 1: its run of FMOD", [](auto& c) { c.field_modes.pop_back(); }},
    {"FFUN: has elements", [](auto& c) { c.field_functions.push_back(c.field_functions.back()); }},
    {"FPAK: has elements", [](auto& c) { c.field_packs.push_back(c.field_packs.back()); }},
    {"FGRD: has elements", [](auto& c) { c.field_gradients.emplace_back(); }},
    {"FVAL: has elements", [](auto& c) { c.field_values.emplace_back(); }},
    {"FPNT: has elements", [](auto& c) { c.field_points.push_back(c.field_points.back()); }},
    {"FPTV: has elements", [](auto& c) { c.field_point_values.emplace_back(); }},
    {"FMOD: has elements", [](auto& c) { c.field_modes.emplace_back(); }},
    // FFUN
    {"FFUN, element 1: stiffness", [](auto& c) { c.field_functions[1].stiffness = -1; }},
    {"FFUN, element 1: stiffness", [](auto& c) { c.field_functions[1].stiffness = kNan; }},
    {"FFUN, element 2: stiffness", [](auto& c) { c.field_functions[2].damping_hz = kInfinity; }},
    {"FFUN, element 2: stiffness", [](auto& c) { c.field_functions[2].damping_hz = -1; }},
    {"FFUN, element 1: stiffness", [](auto& c) { c.field_functions[1].decay = -0.5F; }},
    {"FFUN, element 4: stiffness", [](auto& c) { c.field_functions[4].decay = kNan; }},
    {"FFUN, element 8: stiffness", [](auto& c) { c.field_functions[8].decay = 1.5e18F; }},
    {"FFUN, element 3: stiffness", [](auto& c) { c.field_functions[3].one = kNan; }},
    {"FFUN, element 3: stiffness", [](auto& c) { c.field_functions[3].rest[2] = -2e18F; }},
    {"FFUN, element 0: is not driven", [](auto& c) { c.field_functions[0].pin_set = 0; }},
    {"FFUN, element 8: is not driven", [](auto& c) { c.field_functions[8].pin_set = 1; }},
    {"FFUN, element 3: is not driven", [](auto& c) { c.field_functions[3].monomial = 1; }},
    {"FFUN, element 5: the monomials", [](auto& c) { c.field_functions[5].monomial = 2; }},
    {"FFUN, element 4: the monomials", [](auto& c) { c.field_functions[4].monomial = 4; }},
    {"FFUN, element 4: driven by no", [](auto& c) { c.field_functions[4].pin_set = 2; }},
    {"FFUN, element 4: driven by no", [](auto& c) { c.field_functions[4].pin_set = kNone; }},
    {"FFUN, element 6: driven by no", [](auto& c) { c.field_functions[6].pin_set = 0; }},
    {"FFUN, element 4: driven by no",
     [](auto& c) {
       c.pin_sets.clear();
       c.pin_set_vertices.clear();
     }},
    {"FFUN, element 4: one and rest", [](auto& c) { c.field_functions[4].one = -1; }},
    {"FFUN, element 4: one and rest", [](auto& c) { c.field_functions[4].rest[2] = 0.5F; }},
    {"FFUN, element 6: one and rest", [](auto& c) { c.field_functions[6].rest = {1, 0, 0}; }},
    {"FFUN, element 8: driven by no",  // a second four of the same pin set
     [](auto& c) {
       auto functions = c.field_functions;
       c.field_functions.insert(c.field_functions.begin() + 8, functions.begin() + 4, functions.begin() + 8);
       c.field_gradients.resize(c.field_gradients.size() + 12);
       c.field_values.resize(c.field_values.size() + 4);
       c.field_point_values.resize(c.field_point_values.size() + 8);
       c.fields[1].function_count = 9;
       c.fields[1].driven_count = 8;
     }},
    // FPAK
    {"FPAK, element 0: a volume", [](auto& c) { c.field_packs[0].at[1][0] = -100; }},
    {"FPAK, element 0: a volume", [](auto& c) { c.field_packs[0].volume[1] = -1; }},
    {"FPAK, element 1: a volume", [](auto& c) { c.field_packs[1].volume[0] = kInfinity; }},
    {"FPAK, element 0: a volume", [](auto& c) { c.field_packs[0].mu[0] = kNan; }},
    {"FPAK, element 0: a volume", [](auto& c) { c.field_packs[0].mu[7] = -1; }},
    {"FPAK, element 0: a volume", [](auto& c) { c.field_packs[0].lambda[1] = -1; }},
    {"FPAK, element 0: a volume", [](auto& c) { c.field_packs[0].lambda[1] = 1.5e18F; }},
    {"FPAK, element 0: a volume", [](auto& c) { c.field_packs[0].at[2][0] = kNan; }},
    {"FPAK, element 0: a number", [](auto& c) { c.field_packs[0].mu[2] = 1; }},
    {"FPAK, element 1: a number", [](auto& c) { c.field_packs[1].lambda[7] = 1; }},
    {"FPAK, element 1: a number", [](auto& c) { c.field_packs[1].at[0][5] = 1; }},
    {"FPAK, element 0: a number", [](auto& c) { c.field_packs[0].cluster[2] = 0; }},
    {"FPAK, element 1: a number", [](auto& c) { c.field_packs[1].cluster[7] = 1; }},
    {"FPAK, element 0: names a cluster", [](auto& c) { c.field_packs[0].cluster[1] = 2; }},
    {"FPAK, element 1: names a cluster", [](auto& c) { c.field_packs[1].cluster[0] = kNone - 1; }},
    {"FPAK, element 1: names a cluster", [](auto& c) { c.field_packs[1].cluster[7] = 2; }},
    {"FPAK, element 0: names a cluster", [](auto& c) { c.mechanics.clear(); }},
    {"FELD, element 0: its samples have",
     [](auto& c) {
       c.field_packs[0] = {};
       c.field_packs[0].cluster.fill(kNone);
       for (std::size_t i = 0; i < 12; ++i) c.field_gradients[i] = {};
     }},
    // FGRD
    {"FGRD, element 0: the gradients", [](auto& c) { c.field_gradients[4][1] += 0.01F; }},
    {"FGRD, element 12: the gradients", [](auto& c) { c.field_gradients[14][0] += 0.01F; }},
    {"FGRD, element 0: the gradients", [](auto& c) { c.field_gradients[11][0] = kNan; }},
    {"FGRD, element 12: the gradients", [](auto& c) { c.field_gradients[20][1] = kInfinity; }},
    {"FGRD, element 0: the gradients", [](auto& c) { c.field_gradients[0][1] = 0.01F; }},
    {"FGRD, element 0: the gradients", [](auto& c) { c.field_gradients[3][2] = 1e-30F; }},
    {"FGRD, element 0: the gradients", [](auto& c) { c.field_gradients[3][2] = kNan; }},
    {"FGRD, element 0: the gradients", [](auto& c) { c.field_packs[0].volume[2] = 1; }},
    // FVAL
    {"FVAL, element 0: the functions", [](auto& c) { c.field_values[0][4] += 0.01F; }},
    {"FVAL, element 0: the functions", [](auto& c) { c.field_values[2][1] += 0.01F; }},
    {"FVAL, element 0: the functions", [](auto& c) { c.field_values[3][0] = kNan; }},
    {"FVAL, element 4: the functions", [](auto& c) { c.field_values[5][3] = -kInfinity; }},
    {"FVAL, element 4: the functions", [](auto& c) { c.field_values[8][4] *= 1.01F; }},
    {"FVAL, element 0: the functions", [](auto& c) { c.field_values[1][5] = 1e-30F; }},
    {"FVAL, element 4: the functions", [](auto& c) { c.field_values[4][7] = kNan; }},
    // What a function carries is first found out by the gradients, unless it is alike everywhere.
    {"FVAL, element 0: the functions", [](auto& c) { c.field_functions[0].one *= 1.01F; }},
    {"FVAL, element 0: the functions", [](auto& c) { c.field_functions[0].rest[1] += 0.01F; }},
    {"FGRD, element 0: the gradients", [](auto& c) { c.field_functions[2].rest[1] += 0.01F; }},
    {"FGRD, element 12: the gradients", [](auto& c) { c.field_functions[8].one = 0; }},
    {"FFUN, element 1: the sum of mass",  // by another measure: they still give 1 and X
     [](auto& c) { scaleFunction(c, 1, 2); }},
    {"FFUN, element 8: the sum of mass", [](auto& c) { scaleFunction(c, 8, 0.5F); }},
    // Still of norm 1 each, but not orthogonal.
    {"FELD, element 0: mass, centre", [](auto& c) { mixFunctions(c, 0, 1); }},
    {"FELD, element 0: mass, centre", [](auto& c) { mixFunctions(c, 1, 0); }},
    {"FELD, element 0: mass, centre", [](auto& c) { mixFunctions(c, 2, 3); }},
    // FPNT, FPTV
    {"FPNT, element 0: area", [](auto& c) { c.field_points[0].area = 0; }},
    {"FPNT, element 17: area", [](auto& c) { c.field_points[17].area = kNan; }},
    {"FPNT, element 9: area", [](auto& c) { c.field_points[9].area = kInfinity; }},
    {"FPNT, element 3: area", [](auto& c) { c.field_points[3].at[1] = kInfinity; }},
    {"FPTV, element 0: the functions", [](auto& c) { c.field_points[3].at[1] += 0.01F; }},
    {"FPTV, element 4: the functions", [](auto& c) { c.field_points[8].at[0] += 0.01F; }},
    {"FPTV, element 4: the functions", [](auto& c) { c.field_point_values[5][0] += 0.01F; }},
    {"FPTV, element 13: the functions", [](auto& c) { c.field_point_values[17][0] = kNan; }},
    {"FPTV, element 13: the functions", [](auto& c) { c.field_point_values[14][1] = 1; }},
    // FMOD
    {"FMOD, element 0: a mode", [](auto& c) { c.field_modes[0][1] = -1; }},
    {"FMOD, element 13: a mode", [](auto& c) { c.field_modes[13][3] = kInfinity; }},
    {"FMOD, element 13: a mode", [](auto& c) { c.field_modes[13][4] = 1; }},
    {"FMOD, element 0: a mode", [](auto& c) { c.field_modes[1][0] = 1.01F; }},
    {"FMOD, element 0: a mode", [](auto& c) { c.field_modes[12][7] = kNan; }},
    {"FMOD, element 13: a mode", [](auto& c) { c.field_modes[25][7] = 1e-30F; }},
    {"FMOD, element 26: a mode", [](auto& c) { c.field_modes[27][1] = 0.1F; }},
    // FFIB, FFBV
    {"FFIB, element 0: names a field", [](auto& c) { c.field_fibres[0].field = 2; }},
    {"FFIB, element 2: names a field", [](auto& c) { c.field_fibres[2].field = kNone; }},
    {"FFIB, element 0: names a cluster", [](auto& c) { c.field_fibres[0].cluster = 2; }},
    {"FFIB, element 1: names a cluster", [](auto& c) { c.field_fibres[1].cluster = kNone; }},
    {"FFIB, element 0: names a cluster", [](auto& c) { c.mechanics[0].channel = kNone; }},
    {"FFIB, element 1: names a cluster", [](auto& c) { c.mechanics[1].channel = kNone; }},
    {"FFIB, element 1: names a cluster",  // whose values give its fibre, which is none
     [](auto& c) {
       c.mechanics[1].fibre = {};
       for (std::size_t i = 4; i < 8; ++i) c.field_fibre_values[i] = 0;
     }},
    {"FFIB, element 0: names a cluster",
     [](auto& c) {
       c.mechanics.clear();
       for (FieldPack& pack : c.field_packs) pack.cluster.fill(kNone);
     }},
    {"FFIB, element 1: its values", [](auto& c) { c.field_fibres[1].cluster = 0; }},  // may be a part of that fibre
    {"FFIB, element 2: fibres are not", [](auto& c) { c.field_fibres[2].field = 0; }},
    {"FFIB, element 1: fibres are not",  // the held field first
     [](auto& c) {
       std::rotate(c.field_fibres.begin(), c.field_fibres.begin() + 2, c.field_fibres.end());
       std::rotate(c.field_fibre_values.begin(), c.field_fibre_values.begin() + 8, c.field_fibre_values.end());
       c.field_fibres[0].first_value = 0;
       c.field_fibres[1].first_value = 5;
       c.field_fibres[2].first_value = 9;
     }},
    {"FFIB, element 0: tension", [](auto& c) { c.field_fibres[0].tension = -1; }},
    {"FFIB, element 1: tension", [](auto& c) { c.field_fibres[1].tension = kNan; }},
    {"FFIB, element 2: tension", [](auto& c) { c.field_fibres[2].tension = 1.5e18F; }},
    {"FFIB, element 0: its run of FFBV", [](auto& c) { c.field_fibres[0].first_value = 1; }},
    {"FFIB, element 1: its run of FFBV", [](auto& c) { c.field_fibres[1].first_value = 0; }},
    {"FFIB, element 2: its run of FFBV", [](auto& c) { c.field_fibres[2].first_value = kNone; }},
    {"FFIB, element 2: its run of FFBV", [](auto& c) { c.field_fibre_values.pop_back(); }},
    {"FFBV: has elements of no fibre", [](auto& c) { c.field_fibre_values.push_back(0); }},
    {"FFBV: has elements of no fibre", [](auto& c) { c.field_fibres.pop_back(); }},
    {"FFIB, element 0: a value", [](auto& c) { c.field_fibre_values[3] = kNan; }},
    {"FFIB, element 1: a value", [](auto& c) { c.field_fibre_values[4] = -kInfinity; }},
    {"FFIB, element 2: a value", [](auto& c) { c.field_fibre_values[12] = 1.5e18F; }},
    {"FFIB, element 2: a value",
     [](auto& c) {
       c.field_fibres[2].tension = 1e17F;
       c.field_fibre_values[12] = 100;
     }},
    {"FFIB, element 0: its values", [](auto& c) { c.field_fibre_values[0] += 0.01F; }},
    {"FFIB, element 0: its values", [](auto& c) { c.field_fibre_values[2] += 0.01F; }},
    {"FFIB, element 1: its values", [](auto& c) { c.field_fibre_values[5] *= 1.01F; }},
    {"FFIB, element 2: its values", [](auto& c) { c.field_fibre_values[8] += 0.01F; }},   // carries 1 alone
    {"FFIB, element 2: its values", [](auto& c) { c.field_fibre_values[9] += 0.01F; }},   // X alone
    {"FFIB, element 2: its values", [](auto& c) { c.field_fibre_values[11] -= 0.01F; }},  // Z alone
    {"FFIB, element 0: its values", [](auto& c) { c.mechanics[0].fibre = {0, 0.8F, 0.6F}; }},
    {"FFIB, element 1: its values", [](auto& c) { c.mechanics[1].fibre = {-1, 0, 0}; }},
    // FTHR, FTHV
    {"DIST, element 0: names a piece", [](auto& c) { c.distance_grids[0].piece = 99; }},
    {"DIST, element 1: names a piece", [](auto& c) { c.distance_grids.push_back(c.distance_grids[0]); }},
    {"DIST, element 0: has fewer than 2", [](auto& c) { c.distance_grids[0].nodes[1] = 1; }},
    {"DIST, element 0: has fewer than 2", [](auto& c) { c.distance_grids[0].nodes[2] = 257; }},
    {"DIST, element 0: origin", [](auto& c) { c.distance_grids[0].origin[1] = kNan; }},
    {"DIST, element 0: origin", [](auto& c) { c.distance_grids[0].origin[2] = 1e6F; }},
    {"DIST, element 0: spacing", [](auto& c) { c.distance_grids[0].spacing = 0; }},
    {"DIST, element 0: spacing", [](auto& c) { c.distance_grids[0].spacing = kInfinity; }},
    {"DIST, element 0: spacing", [](auto& c) { c.distance_grids[0].unit = kNan; }},
    {"DIST, element 0: spacing", [](auto& c) { c.distance_grids[0].unit = 2 * c.distance_grids[0].spacing; }},
    {"DIST, element 0: its run of DVAL", [](auto& c) { c.distance_grids[0].first_value = 1; }},
    {"DIST, element 0: its run of DVAL", [](auto& c) { c.distance_values.pop_back(); }},
    {"DVAL: has elements of no grid", [](auto& c) { c.distance_values.push_back(0); }},
    {"FTHR, element 0: names a field", [](auto& c) { c.field_tethers[0].field = 2; }},
    {"FTHR, element 0: names a field", [](auto& c) { c.field_tethers[0].field = kNone; }},
    {"FTHR, element 0: names a field", [](auto& c) { c.field_tethers[0].field = 0; }},  // not held
    {"FTHR, element 0: its run of FTHV", [](auto& c) { c.field_tethers[0].first_value = 1; }},
    {"FTHR, element 0: its run of FTHV", [](auto& c) { c.field_tethers[0].first_value = kNone; }},
    {"FTHR, element 0: its run of FTHV", [](auto& c) { c.field_tether_values.pop_back(); }},
    {"FTHR, element 0: its run of FTHV", [](auto& c) { c.field_tether_values.resize(5); }},   // k
    {"FTHR, element 0: its run of FTHV", [](auto& c) { c.field_tether_values.resize(15); }},  // a triangle of it
    {"FTHV: has elements of no field", [](auto& c) { c.field_tether_values.push_back(0); }},
    {"FTHR, element 0: a value is", [](auto& c) { setTether(c, 0, 3, kNan); }},
    {"FTHR, element 0: a value is", [](auto& c) { setTether(c, 4, 2, -kInfinity); }},
    {"FTHR, element 0: a value is", [](auto& c) { setTether(c, 1, 0, 1.5e18F); }},
    {"FTHR, element 0: a value is", [](auto& c) { c.field_tether_values[5 * 0 + 4] *= 1.00001F; }},
    {"FTHR, element 0: a value is", [](auto& c) { c.field_tether_values[5 * 4 + 3] *= 1.00001F; }},
    {"FTHR, element 0: a value is", [](auto& c) { c.field_tether_values[5 * 2 + 1] = kNan; }},
    {"FTHR, element 0: a value on the diagonal", [](auto& c) { c.field_tether_values[0] = -1e-30F; }},
    {"FTHR, element 0: a value on the diagonal",  // else sound
     [](auto& c) {
       for (float& value : c.field_tether_values) value = -value;
     }},
    {"FTHR, element 0: a value is", [](auto& c) { c.field_tether_values[24] = kNan; }},
    {"FTHR, element 0: a value is", [](auto& c) { c.field_tether_values[12] = 1.5e18F; }},
    {"FTHR, element 0: its values pull", [](auto& c) { c.field_tether_values[0] *= 1.01F; }},
    {"FTHR, element 0: its values pull", [](auto& c) { c.field_tether_values[6] *= 1.01F; }},
    {"FTHR, element 0: its values pull", [](auto& c) { c.field_tether_values[18] *= 1.01F; }},
    {"FTHR, element 0: its values pull", [](auto& c) { c.field_tether_values[24] *= 0.99F; }},
    {"FTHR, element 0: its values pull",
     [](auto& c) { setTether(c, 2, 4, 1.01F * c.field_tether_values[5 * 2 + 4]); }},
    {"FTHR, element 0: its values pull", [](auto& c) { setTether(c, 0, 1, 0); }},
    {"FTHR, element 0: its values are not positive", [](auto& c) { tieToBothSets(c, -20); }},
    {"FTHR, element 0: its values pull",  // at what is on no diagonal
     [](auto& c) {
       std::fill(c.field_tether_values.begin(), c.field_tether_values.end(), 0.0F);
       setTether(c, 3, 1, 1e-6F);
     }},
};

// The residual of the free field has values 0..47 and locals 0..4.
const std::vector<ContentFault> kResidualFaults = {
    {"FRSV: needs section FRES", [](auto& c) { c.field_residuals.clear(); }},
    {"FRES, element 0: its run of FRSV", [](auto& c) { c.field_residual_values.clear(); }},
    {"FRES, element 0: its run of FRSL", [](auto& c) { c.field_residual_locals.clear(); }},
    {"FRES, element 0: names a field", [](auto& c) { c.field_residuals[0].field = 1; }},  // held
    {"FRES, element 0: names a field", [](auto& c) { c.field_residuals[0].field = kNone; }},
    {"FRES, element 0: has no modes", [](auto& c) { c.field_residuals[0].mode_count = 0; }},
    {"FRES, element 0: has no modes", [](auto& c) { c.field_residuals[0].mode_count = 257; }},
    {"FRES, element 0: scale", [](auto& c) { c.field_residuals[0].scale = 0; }},
    {"FRES, element 0: scale", [](auto& c) { c.field_residuals[0].scale = kNan; }},
    {"FRES, element 0: its run of FRSV", [](auto& c) { c.field_residuals[0].first_value = 1; }},
    {"FRES, element 0: its run of FRSV", [](auto& c) { c.field_residual_values.pop_back(); }},
    {"FRSV: has elements of no field", [](auto& c) { c.field_residual_values.push_back(0); }},
    {"FRES, element 0: its run of FRSL", [](auto& c) { c.field_residuals[0].first_local = kNone; }},
    {"FRES, element 0: a value of FRSL", [](auto& c) { c.field_residual_locals[1] = 0; }},
    {"FRES, element 0: a value of FRSL", [](auto& c) { c.field_residual_locals[1] = kNan; }},
    {"FRSL: has elements of no field", [](auto& c) { c.field_residual_locals.push_back(1); }},
};

void expectFaults(const std::vector<ContentFault>& faults, const PackageContent& sound) {
  EXPECT_EQ(test::reasonOf(writePackage(sound)), "");
  for (std::size_t i = 0; i < faults.size(); ++i) {
    PackageContent content = sound;
    faults[i].spoil(content);
    const std::string reason = test::reasonOf(writePackage(content));
    EXPECT_EQ(reason.find("section " + std::string(faults[i].reason_has)), 0U)
        << "fault " << i << " (" << faults[i].reason_has << ") gave: " << reason;
  }
}

TEST(PackageFaults, EachBrokenRuleOfFieldsIsRefusedAndNamed) { expectFaults(kFieldFaults, test::fieldPackage()); }

TEST(PackageFaults, EachBrokenRuleOfResidualsIsRefusedAndNamed) {
  expectFaults(kResidualFaults, test::residualPackage());
}

TEST(PackageFaults, EachBrokenRuleOfLevelsIsRefusedAndNamed) {
  PackageContent sound = test::fieldPackage();
  addLevel(sound);
  expectFaults(
      {
          {"FELD, element 2: level is not", [](auto& c) { c.fields[2].level = 2; }},
          {"FELD, element 3: of level 0 behind", [](auto& c) { c.fields[3].level = 0; }},
          {"FELD, element 2: is not of the piece", [](auto& c) { c.fields[2].held = 1; }},
          {"FELD, element 3: is not of the piece", [](auto& c) { c.fields[3].driven_count = 0; }},
          {"FELD, element 3: is not of the piece", [](auto& c) { c.fields[3].function_count = 6; }},
          {"FELD, element 2: its contact points", [](auto& c) { c.field_points[20].area *= 2; }},
          {"FFUN, element 13: driven by another",
           [](auto& c) {
             for (std::size_t j = 13; j < 17; ++j) c.field_functions[j].pin_set = 0;
           }},
      },
      sound);
}

TEST(PackageFaults, EveryPieceHasItsFreeField) {
  const auto dropLast = [](auto& items, std::size_t count) { items.resize(items.size() - count); };
  PackageContent content = test::repeated(test::fieldPackage(), 2);
  dropLast(content.fields, 2);
  dropLast(content.field_functions, 9);
  dropLast(content.field_packs, 2);
  dropLast(content.field_gradients, 27);
  dropLast(content.field_values, 9);
  dropLast(content.field_points, 18);
  dropLast(content.field_point_values, 18);
  dropLast(content.field_modes, 30);
  EXPECT_EQ(test::reasonOf(writePackage(content)), "section FELD: a piece without its free field");
  content = test::repeated(test::fieldPackage(), 2);
  std::swap(content.fields[1].piece, content.fields[3].piece);
  EXPECT_NE(test::reasonOf(writePackage(content)).find("FELD, element 1: held, but"), std::string::npos);
}

TEST(PackageFaults, FieldsNameClustersOfTheirOwnPiece) {
  const ContentFault faults[] = {
      {"FPAK, element 0: names a cluster", [](auto& c) { c.field_packs[0].cluster[0] = 2; }},
      {"FPAK, element 3: names a cluster", [](auto& c) { c.field_packs[3].cluster[1] = 1; }},
      {"FFIB, element 1: names a cluster", [](auto& c) { c.field_fibres[1].cluster = 3; }},
      {"FFIB, element 3: names a cluster", [](auto& c) { c.field_fibres[3].cluster = 0; }},
  };
  for (const ContentFault& fault : faults) {
    PackageContent content = test::repeated(test::fieldPackage(), 2);
    fault.spoil(content);
    const std::string reason = test::reasonOf(writePackage(content));
    EXPECT_EQ(reason.find("section " + std::string(fault.reason_has)), 0U) << fault.reason_has << " gave: " << reason;
  }
}

TEST(PackageFaults, TethersAreInTheOrderOfHeldFields) {
  const ContentFault faults[] = {
      {"FTHR, element 1: names a field", [](auto& c) { c.field_tethers[1].field = 2; }},  // not held
      {"FTHR, element 1: names a field", [](auto& c) { c.field_tethers[1].field = 1; }},
      {"FTHR, element 1: names a field",
       [](auto& c) { std::swap(c.field_tethers[0].field, c.field_tethers[1].field); }},
      {"FTHR, element 1: its run of FTHV", [](auto& c) { c.field_tethers[1].first_value = 0; }},
      {"FTHR, element 1: its run of FTHV", [](auto& c) { c.field_tethers[1].first_value = 5; }},  // k
      {"FTHR, element 1: its run of FTHV", [](auto& c) { c.field_tether_values.resize(49); }},
      {"FTHR, element 1: a value is", [](auto& c) { c.field_tether_values[26] = 0; }},
      {"FTHV: has elements of no field", [](auto& c) { c.field_tethers.pop_back(); }},
  };
  for (const ContentFault& fault : faults) {
    PackageContent content = test::repeated(test::fieldPackage(), 2);
    fault.spoil(content);
    const std::string reason = test::reasonOf(writePackage(content));
    EXPECT_EQ(reason.find("section " + std::string(fault.reason_has)), 0U) << fault.reason_has << " gave: " << reason;
  }
  PackageContent content = test::repeated(test::fieldPackage(), 2);  // only the second body has tethers
  content.field_tethers = {{3, 0}};
  content.field_tether_values.resize(25);
  EXPECT_EQ(test::reasonOf(writePackage(content)), "");
}

TEST(PackageFaults, WhatTheFormatAllowsOfFieldsOpens) {
  const std::vector<std::function<void(PackageContent&)>> allowed = {
      [](auto& c) {  // no contact points
        for (Field& f : c.fields) f.first_point = f.point_count = f.first_point_value = 0;
        c.field_points.clear();
        c.field_point_values.clear();
        c.distance_grids.clear();
        c.distance_values.clear();
      },
      [](auto& c) {  // no distances
        c.distance_grids.clear();
        c.distance_values.clear();
      },
      [](auto& c) {  // not held
        c.fields.resize(1);
        c.field_functions.resize(4);
        c.field_packs.resize(1);
        c.field_gradients.resize(12);
        c.field_values.resize(4);
        c.field_points.resize(9);
        c.field_point_values.resize(8);
        c.field_modes.resize(26);
        c.field_fibres.resize(2);
        c.field_fibre_values.resize(8);
        c.field_tethers.clear();
        c.field_tether_values.clear();
        c.pin_sets.clear();
        c.pin_set_vertices.clear();
      },
      [](auto& c) { c.field_packs[1].mu = {}; },
      [](auto& c) { c.fields[0].lowest_hz = c.fields[0].static_error = 0; },
      [](auto& c) { c.field_functions[2].stiffness = 0; },
      [](auto& c) { c.field_functions[2].decay = 0; },
      [](auto& c) { c.field_functions[2].decay = 1e18F; },
      [](auto& c) {
        c.field_packs[0].cluster = c.field_packs[1].cluster = {1, 1, kNone, kNone, kNone, kNone, kNone, kNone};
      },
      [](auto& c) { c.field_packs[0].cluster.fill(kNone); },
      [](auto& c) { c.field_fibres[1].tension = 0; },
      [](auto& c) {  // a fibre less
        c.field_fibres.pop_back();
        c.field_fibre_values.resize(8);
      },
      [](auto& c) {  // a fibre in two parts
        c.field_fibres[1].cluster = 0;
        std::copy_n(c.field_fibre_values.begin(), 4, c.field_fibre_values.begin() + 4);
      },
      [](auto& c) {  // no tethers
        c.field_tethers.clear();
        c.field_tether_values.clear();
      },
      [](auto& c) {  // that do not pull
        std::fill(c.field_tether_values.begin(), c.field_tether_values.end(), 0.0F);
      },
      [](auto& c) {  // as hard as may be
        const float most = *std::max_element(c.field_tether_values.begin(), c.field_tether_values.end());
        for (float& value : c.field_tether_values) value *= 0.99e18F / most;
      },
      [](auto& c) { tieToBothSets(c, 70); },
      [](auto& c) { tieToBothSets(c, 0); },
      [](auto& c) {  // neither mechanics nor what hangs on them
        c.mechanics.clear();
        c.channels.clear();
        for (FieldPack& pack : c.field_packs) pack.cluster.fill(kNone);
        c.field_fibres.clear();
        c.field_fibre_values.clear();
      },
      [](auto& c) {  // a sample less
        c.field_packs[0].volume[1] = c.field_packs[0].mu[1] = c.field_packs[0].lambda[1] = 0;
        for (Lanes& at : c.field_packs[0].at) at[1] = 0;
        c.field_packs[0].cluster[1] = kNone;
        for (std::size_t i = 0; i < 12; ++i) c.field_gradients[i][1] = 0;
      },
  };
  for (std::size_t i = 0; i < allowed.size(); ++i) {
    PackageContent content = test::fieldPackage();
    allowed[i](content);
    EXPECT_EQ(test::reasonOf(writePackage(content)), "") << "variant " << i;
  }
}

TEST(PackageFaults, WhatTheFormatAllowsOpens) {
  const std::vector<std::function<void(PackageContent&)>> allowed = {
      [](auto& c) { c.clusters[1].stretch_hz = kInfinity; },
      [](auto& c) { c.clusters[1].stretch_hz = 0; },
      [](auto& c) { c.clusters[0].alpha = 0; },
      [](auto& c) { c.info.source_volume = -1; },
      [](auto& c) {
        c.barycentric[0].weight = {-0.5F, 1.5F, 0.25F};
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
      {"feature bit that", [](Header& h, SectionEntry&) { h.features |= 1U << 13; }},
      {"feature bit that", [](Header& h, SectionEntry&) { h.features |= std::uint64_t{1} << 63; }},
      {"FELD: missing, but", [](Header& h, SectionEntry&) { h.features |= 1U << 12; }},
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

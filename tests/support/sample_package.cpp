// SPDX-License-Identifier: MIT
#include "tests/support/sample_package.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string_view>
#include <vector>

#include "sinew/formats/version.h"

namespace sinew::test {
namespace {

using formats::Float3;
using formats::kNone;

template <std::size_t kSize>
using Matrix = std::array<std::array<double, kSize>, kSize>;

// Pseudo-inverse of a symmetric matrix by cyclic Jacobi rotations; eigenvalues below 1e-9 of the largest count as zero.
template <std::size_t kSize>
Matrix<kSize> pseudoInverse(Matrix<kSize> a) {
  Matrix<kSize> vectors{};
  for (std::size_t i = 0; i < kSize; ++i) vectors[i][i] = 1;
  for (int sweep = 0; sweep < 30; ++sweep) {
    for (std::size_t p = 0; p < kSize; ++p) {
      for (std::size_t q = p + 1; q < kSize; ++q) {
        if (a[p][q] == 0) continue;
        const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
        const double t = (theta < 0 ? -1 : 1) / (std::fabs(theta) + std::sqrt(theta * theta + 1));
        const double c = 1 / std::sqrt(t * t + 1), s = t * c;
        for (std::size_t k = 0; k < kSize; ++k) {
          const double kp = a[k][p], kq = a[k][q];
          a[k][p] = c * kp - s * kq;
          a[k][q] = s * kp + c * kq;
        }
        for (std::size_t k = 0; k < kSize; ++k) {
          const double pk = a[p][k], qk = a[q][k];
          a[p][k] = c * pk - s * qk;
          a[q][k] = s * pk + c * qk;
          const double vp = vectors[k][p], vq = vectors[k][q];
          vectors[k][p] = c * vp - s * vq;
          vectors[k][q] = s * vp + c * vq;
        }
      }
    }
  }
  double largest = 0;
  for (std::size_t i = 0; i < kSize; ++i) largest = std::fmax(largest, a[i][i]);
  Matrix<kSize> inverse{};
  for (std::size_t e = 0; e < kSize; ++e) {
    if (a[e][e] < 1e-9 * largest) continue;
    for (std::size_t i = 0; i < kSize; ++i) {
      for (std::size_t j = 0; j < kSize; ++j) inverse[i][j] += vectors[i][e] * vectors[j][e] / a[e][e];
    }
  }
  return inverse;
}

void addCluster(formats::PackageContent& content, std::string_view name, formats::ClusterMode mode,
                const std::vector<float>& shares) {
  formats::Cluster cluster{};
  cluster.name = content.addText(name);
  cluster.mode = mode;
  cluster.first_member = std::uint32_t(content.memberships.size());
  cluster.member_count = std::uint32_t(shares.size());
  cluster.alpha = 1;
  cluster.stretch_hz = mode == formats::ClusterMode::quadratic ? 8.0F : std::numeric_limits<float>::infinity();
  cluster.bend_hz = 4;
  cluster.twist_hz = 2;
  cluster.quadratic = kNone;
  double mass = 0;
  std::array<double, 3> center{};
  for (std::size_t i = 0; i < shares.size(); ++i) {
    const formats::PhysicalVertex& v = content.physical_vertices[i];
    const double m = double(v.mass) * double(shares[i]);
    mass += m;
    for (std::size_t k = 0; k < 3; ++k) center[k] += m * double(v.rest_position[k]);
  }
  for (std::size_t k = 0; k < 3; ++k) cluster.rest_center[k] = float(center[k] / mass);
  cluster.mass = float(mass);

  std::vector<std::array<double, 9>> q(shares.size());
  std::vector<double> mu(shares.size());
  double radius = 0;
  for (std::size_t i = 0; i < shares.size(); ++i) {
    const formats::PhysicalVertex& v = content.physical_vertices[i];
    mu[i] = double(v.mass) * double(shares[i]) / mass;
    content.memberships.push_back({std::uint32_t(i), float(mu[i]), shares[i]});
    double squared = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      q[i][k] = double(v.rest_position[k]) - double(cluster.rest_center[k]);
      squared += q[i][k] * q[i][k];
    }
    radius = std::fmax(radius, std::sqrt(squared));
  }
  cluster.radius = float(radius);
  std::array<double, 6> mean{};
  Matrix<3> moment3{};
  for (std::size_t i = 0; i < q.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) q[i][k] /= double(cluster.radius);
    for (std::size_t k = 0; k < 3; ++k) {
      q[i][3 + k] = q[i][k] * q[i][k];
      q[i][6 + k] = q[i][k] * q[i][(k + 1) % 3];
      for (std::size_t j = 0; j < 3; ++j) moment3[k][j] += mu[i] * q[i][k] * q[i][j];
    }
    for (std::size_t k = 0; k < 6; ++k) mean[k] += mu[i] * q[i][3 + k];
  }
  const Matrix<3> inverse3 = pseudoInverse(moment3);
  cluster.a_qq = {float(inverse3[0][0]), float(inverse3[1][1]), float(inverse3[2][2]),
                  float(inverse3[0][1]), float(inverse3[1][2]), float(inverse3[2][0])};
  for (std::size_t k = 0; k < 6; ++k) cluster.quadratic_mean[k] = float(mean[k]);
  if (mode == formats::ClusterMode::quadratic) {
    Matrix<9> moment9{};
    for (std::size_t i = 0; i < q.size(); ++i) {
      for (std::size_t k = 0; k < 6; ++k) q[i][3 + k] -= mean[k];
      for (std::size_t k = 0; k < 9; ++k) {
        for (std::size_t j = 0; j < 9; ++j) moment9[k][j] += mu[i] * q[i][k] * q[i][j];
      }
    }
    const Matrix<9> inverse9 = pseudoInverse(moment9);
    formats::QuadraticMoment packed{};
    std::size_t at = 0;
    for (std::size_t row = 0; row < 9; ++row) {
      for (std::size_t column = 0; column <= row; ++column) packed.a_qq[at++] = float(inverse9[row][column]);
    }
    cluster.quadratic = std::uint32_t(content.quadratic_moments.size());
    content.quadratic_moments.push_back(packed);
  }
  content.clusters.push_back(cluster);
}

// A PNG of one orange pixel.
constexpr std::array<std::uint8_t, 69> kPicture = {
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44, 0x52, 0x00, 0x00,
    0x00, 0x01, 0x00, 0x00, 0x00, 0x01, 0x08, 0x02, 0x00, 0x00, 0x00, 0x90, 0x77, 0x53, 0xde, 0x00, 0x00, 0x00,
    0x0c, 0x49, 0x44, 0x41, 0x54, 0x78, 0xda, 0x63, 0xf8, 0xdf, 0xe0, 0x00, 0x00, 0x04, 0x41, 0x01, 0xc0, 0x32,
    0x2c, 0x3e, 0x3d, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};

}  // namespace

formats::PackageContent samplePackage() {
  formats::PackageContent content;
  content.physical_vertices = {
      {{0, 0, 0}, 0.5F}, {{1, 0, 0}, 1.5F}, {{0, 1, 0}, 1.5F}, {{0, 0, 1}, 1.5F}, {{1, 1, 1}, 1}};
  content.tetrahedra = {{{0, 1, 2, 3}}, {{1, 2, 3, 4}}};
  addCluster(content, "lower", formats::ClusterMode::linear, {2.0F / 3, 2.0F / 3, 2.0F / 3, 2.0F / 3});
  addCluster(content, "whole", formats::ClusterMode::quadratic, {1.0F / 3, 1.0F / 3, 1.0F / 3, 1.0F / 3, 1});
  content.bodies = {{0, 5, 0, 2, 0, 2, content.addText("corner")}};

  content.visual_positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}, {1, 1, 1}};
  const float third = float(1 / std::sqrt(3.0));
  content.visual_normals = {{-third, -third, -third}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {third, third, third},
                            {third, third, third}};
  content.visual_uvs = {{0, 0}, {1, 0}, {0, 1}, {0.5F, 0.5F}, {1, 1}, {0.25F, 0.75F}};
  content.visual_colors = {{255, 0, 0, 255}, {0, 255, 0, 255},   {0, 0, 255, 255},
                           {0, 0, 0, 255},   {255, 255, 0, 128}, {255, 255, 0, 128}};
  content.visual_triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 4}, {1, 4, 3}, {2, 3, 5}};
  content.materials = {{content.addText("skin"), {1, 0.5F, 0.25F, 1}, 0, formats::kMaterialDoubleSided},
                       {content.addText("plain"), {0.5F, 0.5F, 0.5F, 1}, kNone, 0}};
  content.sub_meshes = {{content.addText("corner/skin"), 0, 0, 3, 0}, {content.addText("corner/plain"), 1, 3, 3, 0}};
  content.textures = {{content.addText("orange.png"), content.addText("image/png"), 0, kPicture.size()}};
  for (const std::uint8_t byte : kPicture) content.texture_bytes.push_back(std::byte{byte});

  // x = x3 + sum w_k (x_k - x3): a corner of the tetrahedron has one weight 1, its fourth corner none.
  content.barycentric = {{0, {1, 0, 0}}, {0, {0, 1, 0}}, {0, {0, 0, 1}},
                         {0, {0, 0, 0}}, {1, {0, 0, 0}}, {1, {0, 0, 0}}};
  for (std::uint32_t v = 0; v < 6; ++v) {
    const auto first = std::uint32_t(content.cluster_attachments.size());
    if (v < 4) content.cluster_attachments.push_back({0, 0.75F});
    content.cluster_attachments.push_back({1, v < 4 ? 0.25F : 1.0F});
    content.cluster_attachment_ranges.push_back({first, v < 4 ? 2U : 1U});
  }

  content.visual_identity = {{0, 0}, {1, 1}, {2, 2}, {3, 3}, {5, 4}, {5, 4}};
  content.source_identity = {{0, 0, 1}, {1, 1, 1}, {2, 2, 1}, {3, 3, 1}, {kNone, 4, 0}, {4, 4, 2}, {kNone, 6, 0}};
  content.source_visual_list = {0, 1, 2, 3, 4, 5};
  content.source_meshes = {{content.addText("corner"), 0, 6}, {content.addText("stray"), 6, 1}};
  content.groups = {{content.addText("tip"), 0, 2}, {content.addText("nobody"), 2, 0}, {content.addText("base"), 2, 3}};
  content.group_vertices = {4, 5, 0, 1, 2};

  formats::BodyInfo& info = content.info;
  info.origin = {10, 0.5, -2};
  info.metres_per_unit = 0.01;
  info.bounds_min = {0, 0, 0};
  info.bounds_max = {1, 1, 1};
  info.diagonal = float(std::sqrt(3.0));
  info.total_mass = 6;
  info.density = 12;
  info.physical_volume = 0.5F;
  info.source_volume = 0.5F;
  info.max_rest_error = 0;
  info.min_dihedral_deg = 54.73561F;  // acos(1/sqrt(3)): the corner tetrahedron; the other one is regular
  info.max_dihedral_deg = 90;
  info.name = content.addText("corner");
  info.tool_version = content.addText(formats::kSoftwareVersion);
  info.source_file = content.addText("corner.obj");
  info.unit_source = content.addText("Given by hand.");
  info.settings_json = content.addText("{}");
  return content;
}

formats::PackageContent mechanicsPackage() {
  formats::PackageContent content = samplePackage();
  formats::ClusterMechanics lower = formats::kPlainMechanics;
  lower.stiffness = formats::StiffnessModel::elastic;
  lower.young = 2e5F;
  lower.poisson = 0.45F;
  lower.damping = 3;
  lower.limit = formats::LimitMethod::principal;
  lower.volume = formats::VolumeMethod::principal;
  lower.plastic_yield = 0.25F;
  lower.plastic_creep = 2;
  lower.fibre = {0, 0.6F, 0.8F};
  lower.channel = 1;
  lower.contraction = 0.375F;
  formats::ClusterMechanics whole = formats::kPlainMechanics;
  whole.stiffness = formats::StiffnessModel::per_step;
  whole.per_step_beta = {0, 0.5F, 1};
  whole.limit = formats::LimitMethod::curve;
  whole.first_curve_point = 1;
  whole.curve_point_count = 3;
  content.mechanics = {lower, whole};
  content.curve_points = {{3, 3}, {4, 4}, {8, 5}, {32, 5}};
  content.channels = {{content.addText("frown")}, {content.addText("smile")}};
  content.vertex_stiffness = {1, 0.5F, 0, 1, 0.25F};
  content.pin_weights = {0, 0, 1, 0.5F, 0};
  return content;
}

}  // namespace sinew::test

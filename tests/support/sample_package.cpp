// SPDX-License-Identifier: MIT
#include "tests/support/sample_package.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string_view>
#include <utility>
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

using Vector = std::array<double, 3>;

Vector minus(const Vector& a, const Vector& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// A number at each vertex of the package's only body.
using OnVertices = std::vector<double>;

// The sections of fields for a package with one body, function by function.
class FieldMaker {
 public:
  explicit FieldMaker(formats::PackageContent& content) : content_(content) {
    for (const formats::PhysicalVertex& v : content.physical_vertices) {
      mass_.push_back(double(v.mass));
      for (std::size_t axis = 0; axis < 3; ++axis) at_[axis].push_back(double(v.rest_position[axis]));
    }
  }

  const OnVertices& coordinate(std::size_t axis) const { return at_[axis]; }

  double product(const OnVertices& a, const OnVertices& b) const {
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += mass_[i] * a[i] * b[i];
    return sum;
  }

  // Less what the others have of it; those are orthonormal.
  OnVertices without(OnVertices a, const std::vector<OnVertices>& others) const {
    for (const OnVertices& other : others) {
      const double part = product(a, other);
      for (std::size_t i = 0; i < a.size(); ++i) a[i] -= part * other[i];
    }
    return a;
  }

  OnVertices normalized(OnVertices a) const {
    const double length = std::sqrt(product(a, a));
    for (double& value : a) value /= length;
    return a;
  }

  // Fours of `driven` functions are 1, X, Y, Z of `pin_set`; `points` are midpoints of two vertices each; the first
  // tetrahedron is under the laws of the first cluster, and the first `fibres` clusters have fibres.
  void add(const std::vector<OnVertices>& functions, std::size_t driven, std::uint32_t pin_set,
           const std::vector<std::array<std::size_t, 2>>& points, std::uint32_t fibres) {
    const auto count = [](const auto& items) { return std::uint32_t(items.size()); };
    formats::Field field{};
    field.held = driven > 0 ? 1 : 0;
    field.function_count = count(functions);
    field.driven_count = std::uint32_t(driven);
    field.first_function = count(content_.field_functions);
    field.first_pack = count(content_.field_packs);
    field.pack_count = 1;
    field.first_gradient = count(content_.field_gradients);
    field.first_value = count(content_.field_values);
    field.first_point = count(content_.field_points);
    field.point_count = count(points);
    field.first_point_value = count(content_.field_point_values);
    field.first_mode = count(content_.field_modes);
    field.lowest_hz = 2.5F;
    field.static_error = 0.125F;
    field.least_eigenvalue = 0.75F;
    content_.fields.push_back(field);

    formats::FieldPack pack{};
    pack.cluster.fill(kNone);
    pack.cluster[0] = 0;
    std::vector<std::vector<Vector>> gradients;  // by tetrahedron and function
    std::vector<double> stiffness(functions.size(), 0.0);
    for (std::size_t t = 0; t < content_.tetrahedra.size(); ++t) {
      const std::array<std::uint32_t, 4>& corner = content_.tetrahedra[t].vertex;
      const double volume = dot(cross(edge(corner, 1), edge(corner, 2)), edge(corner, 3)) / 6;
      pack.volume[t] = float(volume);
      pack.mu[t] = 1000;
      pack.lambda[t] = 1500;
      for (const std::uint32_t v : corner) {
        for (std::size_t axis = 0; axis < 3; ++axis) pack.at[axis][t] += 0.25F * float(at_[axis][v]);
      }
      gradients.emplace_back();
      for (std::size_t j = 0; j < functions.size(); ++j) {
        gradients.back().push_back(gradient(functions[j], corner));
        stiffness[j] += volume * 3500 * dot(gradients.back()[j], gradients.back()[j]);
      }
    }
    content_.field_packs.push_back(pack);
    for (std::size_t j = 0; j < functions.size(); ++j) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        formats::Lanes lanes{};
        for (std::size_t t = 0; t < gradients.size(); ++t) lanes[t] = float(gradients[t][j][axis]);
        content_.field_gradients.push_back(lanes);
      }
      content_.field_functions.push_back(record(functions[j], j, driven, pin_set, stiffness[j]));
    }
    std::vector<std::array<std::size_t, 2>> vertices;
    for (std::size_t i = 0; i < mass_.size(); ++i) vertices.push_back({i, i});
    addValues(functions, vertices, content_.field_values);
    addValues(functions, points, content_.field_point_values);
    std::vector<double> modes;
    for (std::size_t j = driven; j < functions.size(); ++j) modes.insert(modes.end(), 3, stiffness[j]);
    addModes(modes);
    for (std::uint32_t c = 0; c < fibres; ++c) addFibre(c, gradients);
    for (const auto& [a, b] : points) {
      formats::FieldPoint point{{}, 0.25F};
      for (std::size_t axis = 0; axis < 3; ++axis) point.at[axis] = float(0.5 * (at_[axis][a] + at_[axis][b]));
      content_.field_points.push_back(point);
    }
  }

  // Of the last field: ties vertices to its first pin set, each by so many N/m. sum kappa r r^T, r how far a vertex is
  // from where the set would have it, by function. The product of two functions comes first: symmetric to the last bit.
  void addTethers(const std::vector<OnVertices>& functions,
                  const std::vector<std::pair<std::size_t, double>>& tethers) {
    const std::size_t k = functions.size();
    std::vector<double> sums(k * k, 0.0);
    for (const auto& [vertex, kappa] : tethers) {
      std::vector<double> off;
      for (const OnVertices& function : functions) off.push_back(function[vertex]);
      off[0] -= 1;
      for (std::size_t axis = 0; axis < 3; ++axis) off[1 + axis] -= at_[axis][vertex];
      for (std::size_t a = 0; a < k; ++a) {
        for (std::size_t b = 0; b < k; ++b) sums[k * a + b] += kappa * (off[a] * off[b]);
      }
    }
    content_.field_tethers.push_back(
        {std::uint32_t(content_.fields.size() - 1), std::uint32_t(content_.field_tether_values.size())});
    for (const double sum : sums) content_.field_tether_values.push_back(float(sum));
  }

 private:
  Vector place(std::uint32_t v) const { return {at_[0][v], at_[1][v], at_[2][v]}; }

  Vector edge(const std::array<std::uint32_t, 4>& corner, std::size_t k) const {
    return minus(place(corner[k]), place(corner[0]));
  }

  Vector gradient(const OnVertices& function, const std::array<std::uint32_t, 4>& corner) const {
    const double six_volumes = dot(cross(edge(corner, 1), edge(corner, 2)), edge(corner, 3));
    Vector sum{};
    for (std::size_t k = 1; k < 4; ++k) {
      const Vector area = cross(edge(corner, k % 3 + 1), edge(corner, (k + 1) % 3 + 1));
      const double rise = (function[corner[k]] - function[corner[0]]) / six_volumes;
      for (std::size_t axis = 0; axis < 3; ++axis) sum[axis] += rise * area[axis];
    }
    return sum;
  }

  formats::FieldFunction record(const OnVertices& function, std::size_t j, std::size_t driven, std::uint32_t pin_set,
                                double stiffness) const {
    formats::FieldFunction result{};
    result.pin_set = kNone;
    if (j < driven) {
      result.pin_set = pin_set + std::uint32_t(j / 4);
      result.monomial = std::uint32_t(j % 4);
      if (result.monomial == 0) result.one = 1;
      if (result.monomial > 0) result.rest[result.monomial - 1] = 1;
      return result;
    }
    result.stiffness = float(std::fmax(0.0, stiffness));
    for (std::size_t c = 0; c < content_.clusters.size(); ++c) {
      const OnVertices shares = sharesOf(c);
      for (std::size_t i = 0; i < shares.size(); ++i) {
        result.decay += float(mass_[i] * function[i] * function[i] * shares[i] * double(content_.mechanics[c].damping));
      }
    }
    result.damping_hz = float(0.125 * std::sqrt(std::fmax(0.0, stiffness)));
    result.one = float(product(function, OnVertices(function.size(), 1.0)));
    for (std::size_t axis = 0; axis < 3; ++axis) result.rest[axis] = float(product(function, at_[axis]));
    return result;
  }

  OnVertices sharesOf(std::size_t cluster) const {
    OnVertices shares(mass_.size(), 0.0);
    const formats::Cluster& c = content_.clusters[cluster];
    for (std::size_t m = c.first_member; m < c.first_member + c.member_count; ++m) {
      shares[content_.memberships[m].vertex] = double(content_.memberships[m].share);
    }
    return shares;
  }

  // Of the last field. \param gradients by tetrahedron and function.
  void addFibre(std::uint32_t cluster, const std::vector<std::vector<Vector>>& gradients) {
    constexpr double kYoung = 2600;  // that of the samples' mu and lambda, Pa
    const formats::ClusterMechanics& mechanics = content_.mechanics[cluster];
    const Vector along = {double(mechanics.fibre[0]), double(mechanics.fibre[1]), double(mechanics.fibre[2])};
    const OnVertices shares = sharesOf(cluster);
    std::vector<double> values(gradients.front().size(), 0.0);
    double volume = 0;
    for (std::size_t t = 0; t < gradients.size(); ++t) {
      const std::array<std::uint32_t, 4>& corner = content_.tetrahedra[t].vertex;
      double share = 0;
      for (const std::uint32_t v : corner) share += shares[v] / 4;
      const double part = share * dot(cross(edge(corner, 1), edge(corner, 2)), edge(corner, 3)) / 6;
      for (std::size_t j = 0; j < values.size(); ++j) values[j] += part * dot(gradients[t][j], along);
      volume += part;
    }
    content_.field_fibres.push_back({std::uint32_t(content_.fields.size() - 1), cluster,
                                     std::uint32_t(content_.field_fibre_values.size()),
                                     float(double(mechanics.contraction) * kYoung * volume)});
    for (const double value : values) content_.field_fibre_values.push_back(float(value / volume));
  }

  static void addValues(const std::vector<OnVertices>& functions, const std::vector<std::array<std::size_t, 2>>& places,
                        std::vector<formats::Lanes>& to) {
    for (std::size_t first = 0; first < places.size(); first += 8) {
      for (const OnVertices& function : functions) {
        formats::Lanes lanes{};
        for (std::size_t l = 0; l < 8 && first + l < places.size(); ++l) {
          lanes[l] = float(0.5 * (function[places[first + l][0]] + function[places[first + l][1]]));
        }
        to.push_back(lanes);
      }
    }
  }

  // Each unknown counts as a mode: the true ones of a body this regular would hang on rounding.
  void addModes(const std::vector<double>& eigenvalues) {
    const std::size_t unknowns = eigenvalues.size();
    for (std::size_t first = 0; first < unknowns; first += 8) {
      const std::size_t block = content_.field_modes.size(), end = std::min(first + 8, unknowns);
      content_.field_modes.resize(block + unknowns + 1);
      for (std::size_t mode = first; mode < end; ++mode) {
        content_.field_modes[block][mode - first] = float(std::fmax(0.0, eigenvalues[mode]));
        content_.field_modes[block + 1 + mode][mode - first] = 1;
      }
    }
  }

  formats::PackageContent& content_;
  OnVertices mass_;
  std::array<OnVertices, 3> at_;
};

template <class T, class Shift>
void repeat(std::vector<T>& items, std::size_t copies, Shift shift) {
  const std::vector<T> once = items;
  items.clear();
  items.reserve(once.size() * copies);
  for (std::uint32_t k = 0; k < copies; ++k) {
    for (T item : once) {
      shift(item, k);
      items.push_back(item);
    }
  }
}

// Plastic, elastic, with limits and a fibre.
formats::ClusterMechanics mechanicsOfLower() {
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
  return lower;
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
  content.pieces = {{0, 5, 0, 2, 0, 2, content.addText("corner")}};

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

  formats::PackageInfo& info = content.info;
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
  formats::ClusterMechanics whole = formats::kPlainMechanics;
  whole.stiffness = formats::StiffnessModel::per_step;
  whole.per_step_beta = {0, 0.5F, 1};
  whole.limit = formats::LimitMethod::curve;
  whole.first_curve_point = 1;
  whole.curve_point_count = 3;
  content.mechanics = {mechanicsOfLower(), whole};
  content.curve_points = {{3, 3}, {4, 4}, {8, 5}, {32, 5}};
  content.channels = {{content.addText("frown")}, {content.addText("smile")}};
  content.vertex_stiffness = {1, 0.5F, 0, 1, 0.25F};
  content.pin_weights = {0, 0, 1, 0.5F, 0};
  return content;
}

formats::PackageContent fieldPackage() {
  formats::PackageContent content = samplePackage();
  content.pin_sets = {{content.addText("nobody"), content.addText("world"), 0, 0, 0, 0},
                      {content.addText("base"), content.addText("bone"), 0, 0, 3, 0}};
  content.pin_set_vertices = {0, 1, 2};
  formats::ClusterMechanics whole = formats::kPlainMechanics;
  whole.damping = 0.5F;
  whole.fibre = {1, 0, 0};
  whole.channel = 0;
  whole.contraction = 0.25F;
  content.mechanics = {mechanicsOfLower(), whole};
  content.channels = {{content.addText("frown")}, {content.addText("smile")}};
  FieldMaker maker(content);
  const std::vector<std::array<std::size_t, 2>> points = {{0, 0}, {1, 1}, {2, 2}, {3, 3}, {4, 4},
                                                          {0, 1}, {0, 2}, {0, 3}, {1, 4}};
  // The body looks the same along x, y and z: these diagonalize its stiffness as they are.
  const OnVertices &x = maker.coordinate(0), &y = maker.coordinate(1), &z = maker.coordinate(2), one(5, 1.0);
  OnVertices sum(5), first(5), second(5);
  for (std::size_t i = 0; i < 5; ++i) {
    sum[i] = x[i] + y[i] + z[i];
    first[i] = x[i] - y[i];
    second[i] = x[i] + y[i] - 2 * z[i];
  }
  std::vector<OnVertices> free;
  for (const OnVertices& function : {one, sum, first, second}) {
    free.push_back(maker.normalized(maker.without(function, free)));
  }
  maker.add(free, 0, kNone, points, 2);

  const OnVertices inner = maker.normalized({0, 0, 0, 1, 1});
  std::vector<OnVertices> held;
  for (const OnVertices& monomial : {one, x, y, z}) held.push_back(maker.without(monomial, {inner}));
  held.push_back(inner);
  maker.add(held, 4, 1, points, 1);
  maker.addTethers(held, {{3, 40}, {4, 90}});
  content.distance_grids.push_back({0, {2, 2, 3}, 0, {0.0F, 0.0F, 0.0F}, 0.25F, 0.001F});
  for (int i = 0; i < 12; ++i) content.distance_values.push_back(std::int16_t(50 * i - 300));
  return content;
}

formats::PackageContent residualPackage() {
  formats::PackageContent content = fieldPackage();
  content.field_residuals.push_back({0, 2, 0, 0, 1e-5F});
  for (int i = 0; i < 8 * 3 * 2; ++i) content.field_residual_values.push_back(std::int16_t(i % 8 < 5 ? 7 * i - 90 : 0));
  content.field_residual_locals.assign(5, 2e-4F);
  return content;
}

formats::PackageContent repeated(formats::PackageContent c, std::size_t copies) {
  c.info.total_mass *= float(copies);
  const formats::PackageContent once = c;
  const auto n = [](const auto& items) { return std::uint32_t(items.size()); };
  const std::uint32_t vertices = n(c.physical_vertices), tets = n(c.tetrahedra), clusters = n(c.clusters);
  const std::uint32_t members = n(c.memberships), moments = n(c.quadratic_moments), visuals = n(c.visual_positions);
  const std::uint32_t triangles = n(c.visual_triangles), weights = n(c.cluster_attachments);
  const std::uint32_t sources = n(c.source_identity), grouped = n(c.group_vertices);
  const auto same = [](auto&, std::uint32_t) {};
  repeat(c.pieces, copies, [&](auto& b, std::uint32_t k) {
    b.first_vertex += k * vertices, b.first_tetrahedron += k * tets, b.first_cluster += k * clusters;
  });
  repeat(c.physical_vertices, copies, same);
  repeat(c.tetrahedra, copies, [&](auto& t, std::uint32_t k) {
    for (auto& v : t.vertex) v += k * vertices;
  });
  repeat(c.clusters, copies, [&](auto& cluster, std::uint32_t k) {
    cluster.piece = k;
    cluster.first_member += k * members;
    if (cluster.quadratic != kNone) cluster.quadratic += k * moments;
  });
  repeat(c.memberships, copies, [&](auto& m, std::uint32_t k) { m.vertex += k * vertices; });
  repeat(c.quadratic_moments, copies, same);
  repeat(c.mechanics, copies, same);
  repeat(c.visual_positions, copies, same);
  repeat(c.visual_normals, copies, same);
  repeat(c.visual_uvs, copies, same);
  repeat(c.visual_colors, copies, same);
  repeat(c.visual_triangles, copies, [&](auto& t, std::uint32_t k) {
    for (auto& v : t) v += k * visuals;
  });
  repeat(c.sub_meshes, copies, [&](auto& s, std::uint32_t k) { s.first_triangle += k * triangles; });
  repeat(c.barycentric, copies, [&](auto& a, std::uint32_t k) { a.tetrahedron += k * tets; });
  repeat(c.cluster_attachment_ranges, copies, [&](auto& r, std::uint32_t k) { r.first += k * weights; });
  repeat(c.cluster_attachments, copies, [&](auto& a, std::uint32_t k) { a.cluster += k * clusters; });
  repeat(c.visual_identity, copies,
         [&](auto& v, std::uint32_t k) { v.source_vertex += k * sources, v.welded += k * 5; });
  repeat(c.source_identity, copies, [&](auto& s, std::uint32_t k) {
    s.first_visual += k * visuals;
    if (s.welded != kNone) s.welded += k * 5;
  });
  repeat(c.source_visual_list, copies, [&](auto& v, std::uint32_t k) { v += k * visuals; });
  repeat(c.source_meshes, copies, [&](auto& m, std::uint32_t k) { m.first_source_vertex += k * sources; });
  repeat(c.groups, copies, [&](auto& g, std::uint32_t k) { g.first += k * grouped; });
  repeat(c.group_vertices, copies, [&](auto& v, std::uint32_t k) { v += k * visuals; });
  const std::uint32_t bodies = n(once.pieces), sets = n(once.pin_sets), held = n(once.pin_set_vertices);
  repeat(c.pin_sets, copies, [&](auto& s, std::uint32_t k) { s.first += k * held; });
  repeat(c.pin_set_vertices, copies, [&](auto& v, std::uint32_t k) { v += k * vertices; });
  repeat(c.fields, copies, [&](auto& f, std::uint32_t k) {
    f.piece += k * bodies;
    f.first_function += k * n(once.field_functions), f.first_pack += k * n(once.field_packs);
    f.first_gradient += k * n(once.field_gradients), f.first_value += k * n(once.field_values);
    f.first_point += k * n(once.field_points), f.first_point_value += k * n(once.field_point_values);
    f.first_mode += k * n(once.field_modes);
  });
  repeat(c.field_functions, copies, [&](auto& f, std::uint32_t k) {
    if (f.pin_set != kNone) f.pin_set += k * sets;
  });
  repeat(c.field_packs, copies, [&](auto& pack, std::uint32_t k) {
    for (auto& cluster : pack.cluster) {
      if (cluster != kNone) cluster += k * clusters;
    }
  });
  repeat(c.field_gradients, copies, same);
  repeat(c.field_values, copies, same);
  repeat(c.field_points, copies, same);
  repeat(c.field_point_values, copies, same);
  repeat(c.field_modes, copies, same);
  repeat(c.field_fibres, copies, [&](auto& f, std::uint32_t k) {
    f.field += k * n(once.fields), f.cluster += k * clusters, f.first_value += k * n(once.field_fibre_values);
  });
  repeat(c.field_fibre_values, copies, same);
  repeat(c.field_tethers, copies, [&](auto& t, std::uint32_t k) {
    t.field += k * n(once.fields), t.first_value += k * n(once.field_tether_values);
  });
  repeat(c.field_tether_values, copies, same);
  repeat(c.field_residuals, copies, [&](auto& r, std::uint32_t k) {
    r.field += k * n(once.fields), r.first_value += k * n(once.field_residual_values);
    r.first_local += k * n(once.field_residual_locals);
  });
  repeat(c.field_residual_values, copies, same);
  repeat(c.field_residual_locals, copies, same);
  repeat(c.distance_grids, copies, [&](auto& g, std::uint32_t k) {
    g.piece += k * n(once.pieces), g.first_value += k * n(once.distance_values);
  });
  repeat(c.distance_values, copies, same);
  return c;
}

}  // namespace sinew::test

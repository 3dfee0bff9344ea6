// SPDX-License-Identifier: MIT
#include "runtime/solver/hold.h"

#include <algorithm>
#include <cmath>

#include "runtime/clusters/algebra.h"

namespace sinew::internal {
namespace {

/// Patterns with less of the functions than so much of what 1 has there are none.
constexpr double kLeastPattern = 0.2;
/// The search ends where a direction takes less than so much off every energy, or after so many directions.
constexpr double kSettled = 5e-3;
constexpr int kRounds = 32;
/// A hold is at most so much firmer than the piece's own functions.
constexpr double kFirmest = 100;
/// From so many vertices on the bake's elements are the tetrahedra themselves, not the edges' patches.
constexpr std::uint32_t kMostForEdges = 10000;
/// Of a diagonal, which rounding must not make negative.
constexpr double kRounding = 1e-6;

constexpr std::uint32_t kNowhere = 0xFFFFFFFF;

/// Cholesky factor of a symmetric matrix, in place, in its lower triangle; what is nearly dependent is made firmer.
void factorize(double* a, std::size_t n) {
  for (std::size_t i = 0; i < n; ++i) {
    double* const row = a + n * i;
    for (std::size_t j = 0; j <= i; ++j) {
      const double* const other = a + n * j;
      double sum = row[j] * (i == j ? 1 + kRounding : 1);
      const double least = row[j] * kRounding;
      for (std::size_t k = 0; k < j; ++k) sum -= row[k] * other[k];
      row[j] = i == j ? std::sqrt(std::max({sum, least, 1e-300})) : sum / other[j];
    }
  }
}

/// L^-1 times vectors, in place. \param x n rows of `count`.
void solveLower(const double* l, std::size_t n, double* x, std::size_t count) {
  for (std::size_t i = 0; i < n; ++i) {
    double* const to = x + count * i;
    for (std::size_t j = 0; j < i; ++j) {
      const double* const from = x + count * j;
      const double factor = l[n * i + j];
      for (std::size_t c = 0; c < count; ++c) to[c] -= factor * from[c];
    }
    const double scale = 1 / l[n * i + i];
    for (std::size_t c = 0; c < count; ++c) to[c] *= scale;
  }
}

/// A constant deformation gradient: F = sum_i x_i gradient_i^T over the patch's nodes.
struct Patch {
  float volume, mu, lambda;
  std::uint32_t first, count, inner;  ///< nodes; the first `inner` are local
};

class HoldMaker {
 public:
  HoldMaker(const formats::PackageView& package, const Field& field, HoldShape& shape)
      : package_(package), field_(field), shape_(shape), first_(field.driven), functions_(field.k - field.driven) {}

  void make(std::span<const std::uint32_t> vertices) {
    measure();
    for (const std::uint32_t v : vertices) {
      if (volume_[v] > 0) shape_.vertices.push_back(v);
    }
    if (shape_.vertices.empty() || functions_ == 0) return;
    findPatterns();
    findNodes();
    findPatches();
    search();
    finish();
  }

 private:
  Vector3d place(std::uint32_t v) const {
    const auto& x = package_.physicalVertices()[field_.first_vertex + v].rest_position;
    return {double(x[0]), double(x[1]), double(x[2])};
  }
  double mass(std::uint32_t v) const { return double(package_.physicalVertices()[field_.first_vertex + v].mass); }

  struct Tetrahedron {
    std::array<std::uint32_t, 4> vertex;  ///< of the piece
    double volume;
    Eigen::Matrix<double, 3, 4> gradient;
    float mu, lambda;
  };

  /// The solid tetrahedra. Their moduli are those of the nearest sample.
  void measure() {
    const formats::BodyRange& piece = package_.bodies()[field_.piece];
    Array<std::uint8_t> rides(field_.vertex_count);
    for (const formats::AttachedPart& part : package_.parts()) {
      if (part.cluster == formats::kNone) continue;
      const formats::Cluster& cluster = package_.clusters()[part.cluster];
      if (cluster.body != field_.piece) continue;
      for (const formats::Membership& member :
           package_.memberships().subspan(cluster.first_member, cluster.member_count)) {
        if (member.share > 0) rides[member.vertex - field_.first_vertex] = 1;
      }
    }
    volume_.resize(field_.vertex_count);
    for (const formats::Tetrahedron& record :
         package_.tetrahedra().subspan(piece.first_tetrahedron, piece.tetrahedron_count)) {
      Tetrahedron tet;
      bool whole = true;
      for (std::size_t i = 0; i < 4; ++i) {
        tet.vertex[i] = record.vertex[i] - field_.first_vertex;
        whole = whole && rides[tet.vertex[i]] == 0;
      }
      if (!whole) continue;
      const Vector3d at = place(tet.vertex[0]);
      Matrix3d edges;
      for (int i = 0; i < 3; ++i) edges.col(i) = place(tet.vertex[std::size_t(i) + 1]) - at;
      const double six = edges.determinant();
      tet.volume = std::abs(six) / 6;
      const double longest = std::sqrt(edges.colwise().squaredNorm().maxCoeff());
      if (!(tet.volume > 1e-9 * longest * longest * longest)) continue;
      for (int i = 0; i < 3; ++i) {
        tet.gradient.col(i + 1) = Vector3d(edges.col((i + 1) % 3)).cross(Vector3d(edges.col((i + 2) % 3))) / six;
      }
      tet.gradient.col(0) = -(tet.gradient.col(1) + tet.gradient.col(2) + tet.gradient.col(3));
      setModuli(at + 0.25 * (edges.col(0) + edges.col(1) + edges.col(2)), tet);
      for (const std::uint32_t v : tet.vertex) volume_[v] += tet.volume / 4;
      tetrahedra_.push_back(tet);
    }
  }

  void setModuli(const Vector3d& at, Tetrahedron& tet) const {
    const Eigen::Vector3f place = at.cast<float>();
    float nearest = 1e30F;
    tet.mu = tet.lambda = 0;
    for (std::uint32_t p = 0; p < field_.pack_count; ++p) {
      const SamplePack& pack = field_.packs[p];
      for (std::size_t lane = 0; lane < 8; ++lane) {
        if (!(pack.volume[lane] > 0)) continue;
        const Eigen::Vector3f way(pack.at[0][lane] - place[0], pack.at[1][lane] - place[1], pack.at[2][lane] - place[2]);
        const float distance = way.squaredNorm();
        if (!(distance < nearest)) continue;
        nearest = distance;
        tet.mu = pack.mu[lane];
        tet.lambda = pack.lambda[lane];
      }
    }
  }

  /// Q: 1, X, Y, Z, and what functions show beside them, the largest first (Gram, Schmidt).
  void findPatterns() {
    const std::size_t held = shape_.vertices.size(), columns = 4 + field_.k;
    Array<double> column(columns * held), size(columns);
    double held_volume = 0;
    Vector3d middle = Vector3d::Zero();
    for (const std::uint32_t v : shape_.vertices) {
      held_volume += volume_[v];
      middle += volume_[v] * place(v);
    }
    middle /= held_volume;
    for (std::size_t i = 0; i < held; ++i) {
      const std::uint32_t v = shape_.vertices[i];
      const double root = std::sqrt(volume_[v]);
      const Vector3d arm = place(v) - middle;
      column[i] = root;
      for (std::size_t c = 0; c < 3; ++c) column[held * (c + 1) + i] = root * arm[int(c)];
      // Functions have a norm of 1 under masses: on average 1 / sqrt(kg).
      const double unit = root * std::sqrt(field_.mass);
      for (std::uint32_t j = 0; j < field_.k; ++j) column[held * (4 + j) + i] = unit * double(field_.valueAt(v, j));
    }
    const auto dot = [&](std::size_t a, std::size_t b) {
      double sum = 0;
      for (std::size_t i = 0; i < held; ++i) sum += column[held * a + i] * column[held * b + i];
      return sum;
    };
    for (std::size_t c = 0; c < columns; ++c) size[c] = c < 4 ? kRounding * dot(c, c) : kLeastPattern * kLeastPattern * held_volume;
    const auto take = [&](std::size_t c) {
      const double scale = 1 / std::sqrt(dot(c, c));
      for (std::size_t i = 0; i < held; ++i) {
        column[held * c + i] *= scale;
        patterns_.push_back(column[held * c + i]);
      }
      size[c] = -1;
      ++shape_.rank;
      for (std::size_t other = 0; other < columns; ++other) {
        if (size[other] < 0) continue;
        const double part = dot(c, other);
        for (std::size_t i = 0; i < held; ++i) column[held * other + i] -= part * column[held * c + i];
      }
    };
    for (std::size_t c = 0; c < 4; ++c) {
      if (dot(c, c) > size[c]) take(c);
      size[c] = -1;
    }
    while (shape_.rank < kMostPatterns) {
      std::size_t best = 0;
      double most = 0;
      for (std::size_t c = 4; c < columns; ++c) {
        const double left = size[c] < 0 ? 0 : dot(c, c);
        if (left > size[c] && left > most) most = left, best = c;
      }
      if (!(most > 0)) break;
      take(best);
    }
    // From columns times sqrt(V) to Q and V Q.
    shape_.weights.resize(patterns_.size());
    shape_.rows.resize(std::size_t(shape_.rank) * field_.k);
    for (std::uint32_t q = 0; q < shape_.rank; ++q) {
      for (std::size_t i = 0; i < held; ++i) {
        const std::uint32_t v = shape_.vertices[i];
        const double root = std::sqrt(volume_[v]);
        shape_.weights[held * q + i] = root * patterns_[held * q + i];
        patterns_[held * q + i] /= root;
      }
      for (std::uint32_t j = 0; j < field_.k; ++j) {
        double sum = 0;
        for (std::size_t i = 0; i < held; ++i) {
          sum += shape_.weights[held * q + i] * double(field_.valueAt(shape_.vertices[i], j));
        }
        shape_.rows[std::size_t(field_.k) * q + j] = float(sum);
      }
    }
  }

  /// The nodes: first what is held, then what may move about it.
  void findNodes() {
    local_.resize(field_.vertex_count, kNowhere);
    for (const std::uint32_t v : shape_.vertices) {
      local_[v] = std::uint32_t(node_.size());
      node_.push_back(v);
    }
    for (std::uint32_t v = 0; v < field_.vertex_count; ++v) {
      if (!(volume_[v] > 0) || local_[v] != kNowhere) continue;
      // Where all functions vanish pin sets of the package hold.
      bool moves = field_.driven == 0;
      for (std::uint32_t j = field_.driven; j < field_.k && !moves; ++j) moves = field_.valueAt(v, j) != 0;
      if (!moves) continue;
      local_[v] = std::uint32_t(node_.size());
      node_.push_back(v);
    }
  }

  /// Strain is averaged over the tetrahedra around each edge, as the bake does (tools/field/elastic.cpp).
  void findPatches() {
    const bool edges = field_.vertex_count <= kMostForEdges;
    struct Part {
      std::uint32_t a, b, tetrahedron;
    };
    Array<Part> parts;
    for (std::uint32_t t = 0; t < tetrahedra_.size(); ++t) {
      const auto& vertex = tetrahedra_[t].vertex;
      if (!edges) parts.push_back({t, t, t});
      for (std::size_t i = 0; edges && i < 4; ++i) {
        for (std::size_t j = i + 1; j < 4; ++j) {
          parts.push_back({std::min(vertex[i], vertex[j]), std::max(vertex[i], vertex[j]), t});
        }
      }
    }
    std::sort(parts.begin(), parts.end(), [](const Part& x, const Part& y) {
      return x.a != y.a ? x.a < y.a : x.b != y.b ? x.b < y.b : x.tetrahedron < y.tetrahedron;
    });
    for (std::size_t from = 0, to = 0; from < parts.size(); from = to) {
      while (to < parts.size() && parts[to].a == parts[from].a && parts[to].b == parts[from].b) ++to;
      addPatch(std::span<const Part>(parts.begin() + from, parts.begin() + to), edges ? 1.0 / 6 : 1.0);
    }
  }

  template <class Part>
  void addPatch(std::span<const Part> parts, double share) {
    Array<std::uint32_t>& nodes = patch_node_;
    const std::size_t first = nodes.size();
    double volume = 0, mu = 0, lambda = 0;
    bool near = false;
    for (const bool inner : {true, false}) {
      for (const Part& part : parts) {
        for (const std::uint32_t v : tetrahedra_[part.tetrahedron].vertex) {
          if ((local_[v] != kNowhere) != inner) continue;
          if (std::find(nodes.begin() + first, nodes.end(), v) == nodes.end()) nodes.push_back(v);
        }
      }
      if (!inner) continue;
      near = nodes.size() > first;
      if (!near) return;
      inner_ = std::uint32_t(nodes.size() - first);
    }
    patch_gradient_.resize(nodes.size());
    for (const Part& part : parts) {
      const Tetrahedron& tet = tetrahedra_[part.tetrahedron];
      const double own = share * tet.volume;
      volume += own;
      mu += own * double(tet.mu);
      lambda += own * double(tet.lambda);
      for (std::size_t i = 0; i < 4; ++i) {
        const auto at = std::size_t(std::find(nodes.begin() + first, nodes.end(), tet.vertex[i]) - nodes.begin());
        patch_gradient_[at] += (own * tet.gradient.col(int(i))).template cast<float>();
      }
    }
    for (std::size_t i = first; i < nodes.size(); ++i) patch_gradient_[i] /= float(volume);
    patches_.push_back({float(volume), float(mu / volume), float(lambda / volume), std::uint32_t(first),
                        std::uint32_t(nodes.size() - first), inner_});
  }

  /// K times fields on local nodes: 3 rows of `count` a node.
  void apply(const float* x, float* y, std::size_t count) const {
    std::fill_n(y, 3 * node_.size() * count, 0.0F);
    Array<float> strain(9 * count);
    for (const Patch& patch : patches_) {
      std::fill(strain.begin(), strain.end(), 0.0F);
      for (std::uint32_t i = patch.first; i < patch.first + patch.inner; ++i) {
        const float* const from = x + 3 * count * local_[patch_node_[i]];
        for (std::size_t a = 0; a < 3; ++a) {
          for (std::size_t b = 0; b < 3; ++b) {
            const float g = patch_gradient_[i][int(b)];
            float* const to = strain.data() + (3 * a + b) * count;
            for (std::size_t c = 0; c < count; ++c) to[c] += g * from[a * count + c];
          }
        }
      }
      push(patch, strain.data(), y, count);
    }
  }

  /// Adds what a patch's deformation pulls at its local nodes. \param strain 3 x 3 rows of `count`: becomes the stress.
  void push(const Patch& patch, float* strain, float* y, std::size_t count) const {
    const float mu = patch.volume * patch.mu, lambda = patch.volume * patch.lambda;
    for (std::size_t c = 0; c < count; ++c) {
      float f[9];
      for (std::size_t i = 0; i < 9; ++i) f[i] = strain[i * count + c];
      const float trace = lambda * (f[0] + f[4] + f[8]);
      for (std::size_t a = 0; a < 3; ++a) {
        for (std::size_t b = 0; b < 3; ++b) {
          strain[(3 * a + b) * count + c] = mu * (f[3 * a + b] + f[3 * b + a]) + (a == b ? trace : 0.0F);
        }
      }
    }
    for (std::uint32_t i = patch.first; i < patch.first + patch.inner; ++i) {
      float* const to = y + 3 * count * local_[patch_node_[i]];
      for (std::size_t a = 0; a < 3; ++a) {
        for (std::size_t b = 0; b < 3; ++b) {
          const float g = patch_gradient_[i][int(b)];
          const float* const from = strain + (3 * a + b) * count;
          for (std::size_t c = 0; c < count; ++c) to[a * count + c] += g * from[c];
        }
      }
    }
  }

  /// K Phi at the local nodes, and of a piece that nothing else holds its rigid motions under the masses: what w is
  /// orthogonal to. 3 rows of 3 n a node; column 3 j + axis.
  void findConstraints() {
    const std::size_t m = 3 * functions_;
    constraint_.resize(3 * node_.size() * m);
    Array<float> strain(9 * m);
    for (const Patch& patch : patches_) {
      std::fill(strain.begin(), strain.end(), 0.0F);
      for (std::uint32_t j = 0; j < functions_; ++j) {
        Eigen::Vector3f slope = Eigen::Vector3f::Zero();
        for (std::uint32_t i = patch.first; i < patch.first + patch.count; ++i) {
          slope += field_.valueAt(patch_node_[i], first_ + j) * patch_gradient_[i];
        }
        for (std::size_t a = 0; a < 3; ++a) {
          for (std::size_t b = 0; b < 3; ++b) strain[(3 * a + b) * m + 3 * j + a] = slope[int(b)];
        }
      }
      push(patch, strain.data(), constraint_.data(), m);
    }
    if (field_.driven > 0) return;
    center_ = Vector3d::Zero();
    for (std::uint32_t v = 0; v < field_.vertex_count; ++v) center_ += mass(v) / field_.mass * place(v);
    inertia_ = 1e-300;
    for (std::uint32_t v = 0; v < field_.vertex_count; ++v) inertia_ += mass(v) * (place(v) - center_).squaredNorm();
    const double omega = 2 * M_PI * field_.lowest_hz;
    rigid_ = std::max(omega * omega, 1e-300);
    for (std::size_t i = 0; i < node_.size(); ++i) {
      const Vector3d x = place(node_[i]) - center_;
      for (std::uint32_t j = 0; j < functions_; ++j) {
        const Matrix3d part = rigid_ * mass(node_[i]) * rigidPart(j, x, 1);
        for (std::size_t a = 0; a < 3; ++a) {
          for (std::size_t b = 0; b < 3; ++b) constraint_[(3 * i + a) * m + 3 * j + b] += float(part(int(a), int(b)));
        }
      }
    }
  }

  /// Sum over rigid motions r, orthonormal under the masses but for the inertia's form, of r(x) (r . M phi_j e)^T.
  Matrix3d rigidPart(std::uint32_t j, const Vector3d& x, double one) const {
    const formats::FieldFunction& f = field_.functions[first_ + j];
    const Vector3d arm =
        Vector3d(double(f.rest[0]), double(f.rest[1]), double(f.rest[2])) - double(f.one) * center_;
    return one * double(f.one) / field_.mass * Matrix3d::Identity() +
           (x.dot(arm) * Matrix3d::Identity() - arm * x.transpose()) / inertia_;
  }

  /// The least energy w^T K w with w = Q on what is held and w orthogonal to the field, by conjugate gradients among
  /// such w (Gould, Hribar, Nocedal 2001), pattern by pattern.
  void search() {
    findConstraints();
    const std::size_t held = shape_.vertices.size(), nodes = node_.size(), m = 3 * functions_;
    const std::size_t rank = shape_.rank, count = 3 * rank, begin = 3 * held, rows = 3 * nodes;
    findBlocks();
    // constraint_ on what moves becomes B^-1 X L^-T, L L^T = X^T B^-1 X, B the blocks.
    Array<float> scaled(rows * m);
    for (std::size_t i = held; i < nodes; ++i) {
      for (std::size_t c = 0; c < m; ++c) solveBlock(i, constraint_.data() + 3 * i * m + c, scaled.data() + 3 * i * m + c, m);
    }
    Array<double> gram(m * m);
    for (std::size_t r = begin; r < rows; ++r) {
      for (std::size_t i = 0; i < m; ++i) {
        const double factor = double(constraint_[r * m + i]);
        for (std::size_t j = 0; j <= i; ++j) gram[m * i + j] += factor * double(scaled[r * m + j]);
      }
    }
    factorize(gram.data(), m);
    // Rows of both times L^-T.
    const auto whiten = [&](float* row) {
      for (std::size_t i = 0; i < m; ++i) {
        double sum = double(row[i]);
        for (std::size_t j = 0; j < i; ++j) sum -= gram[m * i + j] * double(row[j]);
        row[i] = float(sum / gram[m * i + i]);
      }
    };
    Array<double> violation(m * count);  // X^T w
    w_.resize(rows * count);
    for (std::size_t i = 0; i < held; ++i) {
      for (std::size_t q = 0; q < rank; ++q) {
        const double value = patterns_[held * q + i];
        for (std::size_t a = 0; a < 3; ++a) {
          w_[(3 * i + a) * count + 3 * q + a] = float(value);
          for (std::size_t j = 0; j < m; ++j) {
            violation[count * j + 3 * q + a] += double(constraint_[(3 * i + a) * m + j]) * value;
          }
        }
      }
    }
    Array<double> start;
    start.assign({violation.data(), violation.size()});
    solveLower(gram.data(), m, start.data(), count);
    Array<float> normal(rows * m);  // X L^-T
    for (std::size_t r = begin; r < rows; ++r) {
      std::copy_n(constraint_.data() + r * m, m, normal.data() + r * m);
      whiten(normal.data() + r * m);
      whiten(scaled.data() + r * m);
      for (std::size_t j = 0; j < m; ++j) {
        const float factor = scaled[r * m + j];
        for (std::size_t c = 0; c < count; ++c) w_[r * count + c] -= factor * float(start[count * j + c]);
      }
    }
    Array<float> residual(rows * count), z(rows * count), direction(rows * count), product(rows * count);
    Array<double> slope(count), before(count), curve(count);
    Array<float> taken(m * count);
    // The residual less what the constraints carry of it, which would grow over it in floats; z = B^-1 of that.
    const auto project = [&] {
      std::fill(taken.begin(), taken.end(), 0.0F);
      for (std::size_t r = begin; r < rows; ++r) {
        for (std::size_t j = 0; j < m; ++j) {
          const float factor = scaled[r * m + j];
          for (std::size_t c = 0; c < count; ++c) taken[count * j + c] += factor * residual[r * count + c];
        }
      }
      for (std::size_t r = begin; r < rows; ++r) {
        for (std::size_t j = 0; j < m; ++j) {
          const float factor = normal[r * m + j];
          for (std::size_t c = 0; c < count; ++c) residual[r * count + c] -= factor * taken[count * j + c];
        }
      }
      for (std::size_t i = held; i < nodes; ++i) {
        for (std::size_t c = 0; c < count; ++c) {
          solveBlock(i, residual.data() + 3 * i * count + c, z.data() + 3 * i * count + c, count);
        }
      }
    };
    const auto dots = [&](const Array<float>& x, const Array<float>& y, Array<double>& to) {
      std::fill(to.begin(), to.end(), 0.0);
      for (std::size_t r = begin; r < rows; ++r) {
        for (std::size_t c = 0; c < count; ++c) to[c] += double(x[r * count + c]) * double(y[r * count + c]);
      }
    };
    apply(w_.data(), residual.data(), count);
    Array<double> energy(count);
    for (std::size_t r = 0; r < rows; ++r) {
      for (std::size_t c = 0; c < count; ++c) energy[c] += double(w_[r * count + c]) * double(residual[r * count + c]);
    }
    bool settled = begin == rows;
    for (int round = 0; round < kRounds && !settled; ++round) {
      project();
      dots(residual, z, slope);
      for (std::size_t c = 0; c < count; ++c) curve[c] = round > 0 && before[c] > 0 ? slope[c] / before[c] : 0;
      for (std::size_t r = begin; r < rows; ++r) {
        for (std::size_t c = 0; c < count; ++c) {
          direction[r * count + c] = -z[r * count + c] + float(curve[c]) * direction[r * count + c];
        }
      }
      before.swap(slope);
      apply(direction.data(), product.data(), count);
      dots(direction, product, curve);
      settled = true;
      for (std::size_t c = 0; c < count; ++c) {
        curve[c] = curve[c] > 0 ? before[c] / curve[c] : 0;
        const double taken_off = curve[c] * before[c];
        energy[c] -= taken_off;
        settled = settled && taken_off < kSettled * energy[c];
      }
      for (std::size_t r = begin; r < rows; ++r) {
        for (std::size_t c = 0; c < count; ++c) {
          w_[r * count + c] += float(curve[c]) * direction[r * count + c];
          residual[r * count + c] += float(curve[c]) * product[r * count + c];
        }
      }
    }
    apply(w_.data(), product.data(), count);
    energy_.resize(count * count);
    for (std::size_t r = 0; r < rows; ++r) {
      for (std::size_t i = 0; i < count; ++i) {
        const double factor = double(w_[r * count + i]);
        for (std::size_t j = 0; j < count; ++j) energy_[count * i + j] += factor * double(product[r * count + j]);
      }
      if (r < begin) continue;
      for (std::size_t j = 0; j < m; ++j) {
        for (std::size_t c = 0; c < count; ++c) {
          violation[count * j + c] += double(constraint_[r * m + j]) * double(w_[r * count + c]);
        }
      }
    }
    addViolation(violation, count);
  }

  /// What no w could keep orthogonal, where too little is free about a hold, moves the field's own functions, made
  /// kFirmest times as firm.
  void addViolation(Array<double>& violation, std::size_t count) {
    const std::size_t m = 3 * functions_;
    Array<double> own(m * m);
    for (std::size_t i = 0; i < m; ++i) {
      for (std::size_t j = 0; j < m; ++j) own[m * i + j] = double(field_.stiffness[field_.stride * i + j]);
    }
    if (field_.driven == 0) {
      for (std::uint32_t i = 0; i < functions_; ++i) {
        const formats::FieldFunction& f = field_.functions[first_ + i];
        const Vector3d arm =
            Vector3d(double(f.rest[0]), double(f.rest[1]), double(f.rest[2])) - double(f.one) * center_;
        for (std::uint32_t j = 0; j < functions_; ++j) {
          const Matrix3d part = rigid_ * rigidPart(j, arm, double(f.one));
          for (std::size_t a = 0; a < 3; ++a) {
            for (std::size_t b = 0; b < 3; ++b) own[m * (3 * i + a) + 3 * j + b] += part(int(a), int(b));
          }
        }
      }
    }
    factorize(own.data(), m);
    solveLower(own.data(), m, violation.data(), count);
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t j = 0; j < count; ++j) {
        double sum = 0;
        for (std::size_t r = 0; r < m; ++r) sum += violation[count * r + i] * violation[count * r + j];
        energy_[count * i + j] += kFirmest * sum;
      }
    }
  }

  /// The inverses of the diagonal's blocks.
  void findBlocks() {
    blocks_.resize(node_.size());
    for (const Patch& patch : patches_) {
      for (std::uint32_t i = patch.first; i < patch.first + patch.inner; ++i) {
        const Eigen::Vector3f& g = patch_gradient_[i];
        blocks_[local_[patch_node_[i]]] +=
            patch.volume * (patch.mu * g.squaredNorm() * Eigen::Matrix3f::Identity() + (patch.mu + patch.lambda) * g * g.transpose());
      }
    }
    for (Eigen::Matrix3f& block : blocks_) {
      block.diagonal() *= 1 + float(kRounding);
      block = Eigen::Matrix3f(block.cast<double>().inverse().cast<float>());
    }
  }
  void solveBlock(std::size_t node, const float* from, float* to, std::size_t step) const {
    const Eigen::Matrix3f& block = blocks_[node];
    for (int a = 0; a < 3; ++a) {
      to[std::size_t(a) * step] = block(a, 0) * from[0] + (block(a, 1) * from[step] + block(a, 2) * from[2 * step]);
    }
  }

  void finish() {
    const std::size_t count = 3 * std::size_t(shape_.rank), n = 3 * functions_;
    shape_.stiffness.resize(count * count);
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t j = 0; j < count; ++j) {
        shape_.stiffness[count * i + j] = float(0.5 * (energy_[count * i + j] + energy_[count * j + i]));
      }
    }
    // rows^T S, then times rows.
    Array<double> half(n * count);
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t q = 0; q < shape_.rank; ++q) {
        const double factor = double(shape_.rows[field_.k * q + first_ + i / 3]);
        const float* const from = shape_.stiffness.data() + count * (3 * q + i % 3);
        for (std::size_t c = 0; c < count; ++c) half[count * i + c] += factor * double(from[c]);
      }
    }
    shape_.matrix.resize(n * field_.stride);
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j <= i; ++j) {
        double sum = 0;
        for (std::size_t q = 0; q < shape_.rank; ++q) {
          sum += half[count * i + 3 * q + j % 3] * double(shape_.rows[field_.k * q + first_ + j / 3]);
        }
        shape_.matrix[field_.stride * i + j] = float(sum);
      }
    }
  }

  const formats::PackageView& package_;
  const Field& field_;
  HoldShape& shape_;
  const std::uint32_t first_;      ///< of the functions that no pin set drives
  const std::size_t functions_;    ///< of them
  Array<Tetrahedron> tetrahedra_;
  Array<double> volume_;           ///< by vertex; 0: of no tetrahedron
  Array<double> patterns_;         ///< Q, by pattern and held vertex
  Array<std::uint32_t> local_;     ///< vertex -> node, or kNowhere
  Array<std::uint32_t> node_;      ///< node -> vertex
  Array<Patch> patches_;
  Array<std::uint32_t> patch_node_;
  Array<Eigen::Vector3f> patch_gradient_;
  std::uint32_t inner_ = 0;
  Array<float> constraint_;
  Vector3d center_ = Vector3d::Zero();
  double inertia_ = 1, rigid_ = 0;
  Array<Eigen::Matrix3f> blocks_;
  Array<float> w_;
  Array<double> energy_;
};

/// Shapes that no body uses any more, beyond which the oldest of them go.
constexpr std::size_t kMostShapes = 64;

}  // namespace

std::shared_ptr<const HoldShape> HoldShapes::find(const formats::PackageView& package, const Field& field,
                                                  std::span<const std::uint32_t> vertices) const {
  const std::lock_guard lock(mutex_);
  for (const Entry& entry : entries_) {
    if (entry.shape->field == &field && std::equal(entry.asked.begin(), entry.asked.end(), vertices.begin(), vertices.end()))
      return entry.shape;
  }
  for (std::size_t i = 0; entries_.size() >= kMostShapes && i < entries_.size();) {
    if (entries_[i].shape.use_count() == 1) {
      entries_.erase(i);
    } else {
      ++i;
    }
  }
  Entry entry;
  entry.asked.assign(vertices);
  entry.shape = makeHoldShape(package, field, vertices);
  auto shape = entry.shape;
  entries_.push_back(std::move(entry));
  return shape;
}

std::shared_ptr<const HoldShape> makeHoldShape(const formats::PackageView& package, const Field& field,
                                               std::span<const std::uint32_t> vertices) {
  auto shape = std::make_shared<HoldShape>();
  shape->field = &field;
  HoldMaker(package, field, *shape).make(vertices);
  return shape;
}

}  // namespace sinew::internal

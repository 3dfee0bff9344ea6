// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/peers.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "sinew/runtime/world.h"
#include "tools/core/error.h"
#if SINEW_WITH_BULLET
#include "tests/benchmarks/bullet_solid.h"
#endif

namespace sinew::tools {
namespace {

using Eigen::Matrix3f;
using Eigen::Vector3d;
using Eigen::Vector3f;

// Frames of a method that has vertices. \param step called with a frame's time at its begin; a call is what is timed.
// \param positions of the vertices
template <class Step, class Positions>
Motion played(const MotionBody& body, const MotionScene& scene, const Step& step, const Positions& positions) {
  Motion motion;
  const int frames = int(std::lround(scene.seconds / kFrameSeconds));
  for (int frame = 0; frame < frames && motion.goesOn(scene); ++frame) {
    const double begin = threadSeconds();
    step(frame * kFrameSeconds);
    motion.cpu_seconds += threadSeconds() - begin;
    const std::vector<Vector3d> x = positions();
    motion.finite = std::all_of(x.begin(), x.end(), [](const Vector3d& p) { return p.allFinite(); });
    if (motion.finite) motion.frames.push_back(probed(body, x));
  }
  return motion;
}

std::vector<Vector3d> asDoubles(const std::vector<Vector3f>& x) {
  std::vector<Vector3d> result;
  result.reserve(x.size());
  for (const Vector3f& p : x) result.push_back(p.cast<double>());
  return result;
}

std::vector<Vector3f> asFloats(const std::vector<Vector3d>& x) {
  std::vector<Vector3f> result;
  result.reserve(x.size());
  for (const Vector3d& p : x) result.push_back(p.cast<float>());
  return result;
}

struct Tetrahedron {
  std::array<std::uint32_t, 4> vertex;
  Matrix3f inverse;  // of the edges at rest
  float volume, mu, lambda;
};

std::vector<Tetrahedron> tetrahedraOf(const MotionBody& body) {
  std::vector<Tetrahedron> result;
  for (std::size_t t = 0; t < body.tetrahedra.size(); ++t) {
    const auto& corners = body.tetrahedra[t];
    Eigen::Matrix3d edges;
    for (int k = 0; k < 3; ++k) edges.col(k) = body.rest[corners[std::size_t(k) + 1]] - body.rest[corners[0]];
    const ElasticMaterial& m = body.materials[t];
    result.push_back({corners, edges.inverse().cast<float>(), float(edges.determinant() / 6),
                      float(0.5 * m.young / (1 + m.poisson)),
                      float(m.young * m.poisson / ((1 + m.poisson) * (1 - 2 * m.poisson)))});
  }
  return result;
}

Matrix3f deformationOf(const Tetrahedron& t, const std::vector<Vector3f>& x) {
  Matrix3f edges;
  for (int k = 0; k < 3; ++k) edges.col(k) = x[t.vertex[std::size_t(k) + 1]] - x[t.vertex[0]];
  return edges * t.inverse;
}

Matrix3f cofactors(const Matrix3f& f) {
  Matrix3f c;
  c.col(0) = f.col(1).cross(f.col(2));
  c.col(1) = f.col(2).cross(f.col(0));
  c.col(2) = f.col(0).cross(f.col(1));
  return c;
}

// Of F = RS, by Newton's method for the rotation from the last one (Müller et al. 2016, "A robust method to extract the
// rotational part of deformations").
void follow(const Matrix3f& f, Eigen::Quaternionf& q) {
  for (int i = 0; i < 4; ++i) {
    const Matrix3f r = q.toRotationMatrix();
    const Vector3f axial = r.col(0).cross(f.col(0)) + r.col(1).cross(f.col(1)) + r.col(2).cross(f.col(2));
    const float size = std::abs(r.cwiseProduct(f).sum()) + 1e-9F;
    const Vector3f omega = axial / size;
    const float angle = omega.norm();
    if (angle < 1e-6F) return;
    q = Eigen::Quaternionf(Eigen::AngleAxisf(angle, omega / angle)) * q;
    q.normalize();
  }
}

// A symmetric matrix of 3 x 3 blocks over the vertices, by rows.
class BlockMatrix {
 public:
  explicit BlockMatrix(const MotionBody& body) {
    std::vector<std::vector<std::uint32_t>> neighbours(body.rest.size());
    for (const auto& t : body.tetrahedra) {
      for (const std::uint32_t a : t) neighbours[a].insert(neighbours[a].end(), t.begin(), t.end());
    }
    first_.push_back(0);
    for (auto& row : neighbours) {
      std::sort(row.begin(), row.end());
      row.erase(std::unique(row.begin(), row.end()), row.end());
      column_.insert(column_.end(), row.begin(), row.end());
      first_.push_back(column_.size());
    }
    blocks_.resize(column_.size());
  }
  void clear() { std::fill(blocks_.begin(), blocks_.end(), Matrix3f::Zero()); }
  std::size_t slot(std::uint32_t row, std::uint32_t column) const {
    const auto begin = column_.begin() + std::ptrdiff_t(first_[row]),
               end = column_.begin() + std::ptrdiff_t(first_[row + 1]);
    return std::size_t(std::lower_bound(begin, end, column) - column_.begin());
  }
  Matrix3f& block(std::size_t slot) { return blocks_[slot]; }
  void times(const std::vector<Vector3f>& x, std::vector<Vector3f>& out) const {
    for (std::size_t row = 0; row < out.size(); ++row) {
      Vector3f sum = Vector3f::Zero();
      for (std::size_t i = first_[row]; i < first_[row + 1]; ++i) sum += blocks_[i] * x[column_[i]];
      out[row] = sum;
    }
  }

 private:
  std::vector<std::size_t> first_;
  std::vector<std::uint32_t> column_;
  std::vector<Matrix3f> blocks_;
};

float dot(const std::vector<Vector3f>& a, const std::vector<Vector3f>& b) {
  float sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i].dot(b[i]);
  return sum;
}

}  // namespace

Motion playXpbd(const MotionBody& body, const MotionScene& scene, std::uint32_t substeps) {
  const std::vector<Tetrahedron> tetrahedra = tetrahedraOf(body);
  const std::size_t count = body.rest.size();
  std::vector<Vector3f> x = asFloats(body.rest), before = x, v(count, Vector3f::Zero());
  std::vector<float> inverse_mass(count);
  for (std::size_t i = 0; i < count; ++i) inverse_mass[i] = body.region[i] >= 0 ? 0 : float(1 / body.masses[i]);
  const double h = kFrameSeconds / substeps;
  const auto step = [&](double begin) {
    for (std::uint32_t i = 0; i < substeps; ++i) {
      const double now = begin + i * h;
      const Vector3f gravity = (h * scene.gravityAt(now)).cast<float>();
      const auto decay = float(std::exp(-scene.dampingAt(now) * h));
      for (std::size_t p = 0; p < count; ++p) {
        before[p] = x[p];
        if (body.region[p] >= 0) {
          x[p] = (scene.poseOf(std::size_t(body.region[p]), now + h) * body.rest[p]).cast<float>();
        } else {
          v[p] = decay * (v[p] + gravity);
          x[p] += float(h) * v[p];
        }
      }
      for (const Tetrahedron& t : tetrahedra) {
        // C = |F|, of compliance 1 / (mu V); C = det F - 1 - mu / lambda, of 1 / (lambda V). The lambda that agrees
        // with linear elasticity is Lamé's and mu.
        const auto solve = [&](float c, const Matrix3f& derivative, float compliance) {
          Eigen::Matrix<float, 3, 4> g;
          g.rightCols<3>() = derivative * t.inverse.transpose();
          g.col(0) = -g.rightCols<3>().rowwise().sum();
          float weight = compliance / float(h * h);
          for (int k = 0; k < 4; ++k) weight += inverse_mass[t.vertex[std::size_t(k)]] * g.col(k).squaredNorm();
          if (weight <= 0) return;
          for (int k = 0; k < 4; ++k) {
            x[t.vertex[std::size_t(k)]] -= c / weight * inverse_mass[t.vertex[std::size_t(k)]] * g.col(k);
          }
        };
        const float lambda = t.lambda + t.mu;
        Matrix3f f = deformationOf(t, x);
        const float size = f.norm();
        if (size > 0) solve(size, f / size, 1 / (t.mu * t.volume));
        f = deformationOf(t, x);
        solve(f.determinant() - 1 - t.mu / lambda, cofactors(f), 1 / (lambda * t.volume));
      }
      for (const MotionTether& tether : body.tethers) {
        const float mass = inverse_mass[tether.vertex];
        const Vector3f place = (scene.poseOf(tether.region, now + h) * body.rest[tether.vertex]).cast<float>();
        if (mass > 0)
          x[tether.vertex] -= mass / (mass + float(1 / (tether.stiffness * h * h))) * (x[tether.vertex] - place);
      }
      for (std::size_t p = 0; p < count; ++p) {
        if (scene.ground && body.region[p] < 0) projectToGround(*scene.ground, before[p], x[p]);
        v[p] = (x[p] - before[p]) / float(h);
      }
    }
  };
  return played(body, scene, step, [&] { return asDoubles(x); });
}

Motion playStiffnessWarping(const MotionBody& body, const MotionScene& scene, std::uint32_t substeps,
                            std::uint32_t iterations) {
  const std::vector<Tetrahedron> tetrahedra = tetrahedraOf(body);
  const std::size_t count = body.rest.size();
  BlockMatrix matrix(body);
  std::vector<std::array<std::size_t, 16>> slots;
  std::vector<std::size_t> diagonal;
  for (const Tetrahedron& t : tetrahedra) {
    slots.emplace_back();
    for (std::size_t a = 0; a < 4; ++a) {
      for (std::size_t b = 0; b < 4; ++b) slots.back()[4 * a + b] = matrix.slot(t.vertex[a], t.vertex[b]);
    }
  }
  for (std::uint32_t i = 0; i < count; ++i) diagonal.push_back(matrix.slot(i, i));
  std::vector<Eigen::Quaternionf> turns(tetrahedra.size(), Eigen::Quaternionf::Identity());
  std::vector<Vector3f> x = asFloats(body.rest), v(count, Vector3f::Zero());
  std::vector<Vector3f> r(count), z(count), p(count), q(count), way(count);
  std::vector<Matrix3f> inverse(count);
  const double h = kFrameSeconds / substeps;
  const auto step = [&](double begin) {
    for (std::uint32_t i = 0; i < substeps; ++i) {
      const double now = begin + i * h;
      const Vector3f gravity = (h * scene.gravityAt(now)).cast<float>();
      const auto decay = float(std::exp(-scene.dampingAt(now) * h));
      // M (way - h v') / h² = f(x) - K way, v' with gravity and damping; what is held moves as it is told.
      matrix.clear();
      std::fill(r.begin(), r.end(), Vector3f::Zero());
      for (std::size_t t = 0; t < tetrahedra.size(); ++t) {
        const Tetrahedron& one = tetrahedra[t];
        const Matrix3f f = deformationOf(one, x);
        follow(f, turns[t]);
        const Matrix3f rotation = turns[t].toRotationMatrix();
        const Matrix3f s = rotation.transpose() * f;
        const Matrix3f strain = 0.5F * (s + s.transpose()) - Matrix3f::Identity();
        const Matrix3f stress = 2 * one.mu * strain + one.lambda * strain.trace() * Matrix3f::Identity();
        Eigen::Matrix<float, 3, 4> g;  // gradients, turned
        g.rightCols<3>() = rotation * one.inverse.transpose();
        g.col(0) = -g.rightCols<3>().rowwise().sum();
        const Matrix3f turned = rotation * stress * rotation.transpose();
        for (int a = 0; a < 4; ++a) {
          r[one.vertex[std::size_t(a)]] -= one.volume * (turned * g.col(a));
          for (int b = 0; b < 4; ++b) {
            matrix.block(slots[t][4 * std::size_t(a) + std::size_t(b)]) +=
                one.volume * (one.lambda * g.col(a) * g.col(b).transpose() + one.mu * g.col(b) * g.col(a).transpose() +
                              one.mu * g.col(a).dot(g.col(b)) * Matrix3f::Identity());
          }
        }
      }
      for (const MotionTether& tether : body.tethers) {
        const Vector3f place = (scene.poseOf(tether.region, now + h) * body.rest[tether.vertex]).cast<float>();
        r[tether.vertex] += float(tether.stiffness) * (place - x[tether.vertex]);
        matrix.block(diagonal[tether.vertex]) += float(tether.stiffness) * Matrix3f::Identity();
      }
      for (std::size_t k = 0; k < count; ++k) {
        const auto mass = float(body.masses[k] / (h * h));
        matrix.block(diagonal[k]) += mass * Matrix3f::Identity();
        // In doubles: the determinant of what is very stiff is no float.
        inverse[k] = matrix.block(diagonal[k]).cast<double>().inverse().cast<float>();
        if (body.region[k] >= 0) {
          way[k] = (scene.poseOf(std::size_t(body.region[k]), now + h) * body.rest[k]).cast<float>() - x[k];
        } else {
          way[k] = float(h) * decay * (v[k] + gravity);
          r[k] += mass * way[k];
        }
      }
      matrix.times(way, q);
      const auto precondition = [&] {
        for (std::size_t k = 0; k < count; ++k)
          z[k] = body.region[k] >= 0 ? Vector3f(Vector3f::Zero()) : Vector3f(inverse[k] * r[k]);
      };
      for (std::size_t k = 0; k < count; ++k) r[k] -= q[k];
      precondition();
      p = z;
      float rho = dot(r, z);
      const float enough = 1e-8F * rho;
      for (std::uint32_t n = 0; n < iterations && rho > enough; ++n) {
        matrix.times(p, q);
        const float alpha = rho / dot(p, q);
        for (std::size_t k = 0; k < count; ++k) {
          way[k] += alpha * p[k];
          r[k] -= alpha * q[k];
        }
        precondition();
        const float next = dot(r, z);
        for (std::size_t k = 0; k < count; ++k) p[k] = z[k] + next / rho * p[k];
        rho = next;
      }
      for (std::size_t k = 0; k < count; ++k) {
        const Vector3f before = x[k];
        x[k] += way[k];
        if (scene.ground && body.region[k] < 0) projectToGround(*scene.ground, before, x[k]);
        v[k] = (x[k] - before) / float(h);
      }
    }
  };
  return played(body, scene, step, [&] { return asDoubles(x); });
}

#if SINEW_WITH_BULLET
Motion playBullet(const MotionBody& body, const MotionScene& scene, BulletKind kind, std::uint32_t substeps,
                  std::uint32_t iterations) {
  std::vector<float> vertices, masses;
  std::vector<std::uint32_t> corners;
  std::vector<std::uint8_t> held;
  for (std::size_t v = 0; v < body.rest.size(); ++v) {
    for (int k = 0; k < 3; ++k) vertices.push_back(float(body.rest[v][k]));
    masses.push_back(float(body.masses[v]));
    held.push_back(body.region[v] >= 0 ? 1 : 0);
  }
  for (const auto& t : body.tetrahedra) corners.insert(corners.end(), t.begin(), t.end());
  const double h = kFrameSeconds / substeps;
  const ElasticMaterial& material = body.materials.front();
  benchmarks::BulletSolid solid({vertices, corners, masses, held, material.young, material.poisson},
                                benchmarks::BulletSolid::Kind(kind), h, int(iterations));
  if (scene.ground) solid.addGround(scene.ground->height, scene.ground->friction);
  const auto step = [&](double begin) {
    for (std::uint32_t i = 0; i < substeps; ++i) {
      const double now = begin + i * h;
      const Vector3d gravity = scene.gravityAt(now);
      solid.setGravity({gravity[0], gravity[1], gravity[2]});
      for (std::uint32_t v = 0; v < body.rest.size(); ++v) {
        if (body.region[v] < 0) continue;
        const Vector3d at = scene.poseOf(std::size_t(body.region[v]), now + h) * body.rest[v];
        solid.place(v, {at[0], at[1], at[2]});
      }
      solid.step(std::exp(-scene.dampingAt(now) * h));
    }
  };
  return played(body, scene, step, [&] {
    std::vector<double> flat;
    solid.positions(flat);
    std::vector<Vector3d> points;
    for (std::size_t v = 0; v < body.rest.size(); ++v)
      points.emplace_back(flat[3 * v], flat[3 * v + 1], flat[3 * v + 2]);
    return points;
  });
}
#else
Motion playBullet(const MotionBody&, const MotionScene&, BulletKind, std::uint32_t, std::uint32_t) { return {}; }
#endif

namespace {

// Moves the targets and sets the channels of a scene from a file.
void playFile(const MotionScene& scene, const formats::PackageView& package, double time, const Vector3d& offset,
              World& world, BodyId body) {
  for (std::size_t r = 0; r < scene.regions.size(); ++r) {
    const Eigen::Isometry3d pose = scene.poseOf(r, time);
    RigidTransform to;
    for (int row = 0; row < 3; ++row) {
      to.position[std::size_t(row)] = float(pose.translation()[row] + offset[row]);
      for (int column = 0; column < 3; ++column) {
        to.rotation[3 * std::size_t(row) + std::size_t(column)] = float(pose.linear()(row, column));
      }
    }
    world.movePinSet(world.pinSet(body, package.text(package.pinSets()[r].name)), to);
  }
  for (std::uint32_t c = 0; c < package.channels().size(); ++c) {
    world.setActivation(body, c, float(scene.activation(c, time)));
  }
}

}  // namespace

Motion playSinew(const std::shared_ptr<const Asset>& asset, const MotionScene& scene, const SinewPlay& play) {
  const formats::PackageView& package = asset->package();
  const PackageSolid solid = packageSolid(package);
  const HeldCase held = scene.holds(solid, package, extentOf(solid));
  WorldSettings settings;
  settings.iterations = play.iterations;
  settings.deformation_damping_ratio = 0;
  settings.support_damping = 0;
  World world(settings);
  BodySettings body_settings;
  body_settings.package_pins = held.package_pins;
  body_settings.solver = play.solver;
  const auto added = world.addBody(asset, body_settings);
  if (!added) refuseHold(added.reason());
  const BodyId body = *added;
  std::vector<PinSetId> sets;
  const std::vector<std::uint8_t> played = scene.pieces(solid, held);
  for (const HeldRegion& region : held.regions) {
    if (held.package_pins) continue;
    const auto set = world.addPinSet(body, region.vertices);
    if (!set) refuseHold(set.reason());
    sets.push_back(*set);
  }
  std::vector<std::uint32_t> idle;
  for (std::uint32_t v = 0; v < solid.rest.size(); ++v) {
    if (played[solid.piece[v]] == 0) idle.push_back(v);
  }
  if (!idle.empty()) {
    const auto set = world.addPinSet(body, idle);
    if (!set) refuseHold(set.reason());
  }
  const Vec3 first = world.positions(body).front();
  const Vector3d offset = Vector3d(double(first[0]), double(first[1]), double(first[2])) - solid.rest.front();
  if (scene.ground) {
    GroundPlane& ground = world.settings().ground;
    ground.enabled = true;
    ground.offset = float(scene.ground->height + offset[1]);
    ground.friction = float(scene.ground->friction);
  }
  Motion motion;
  const double h = kFrameSeconds / play.substeps;
  const int frames = int(std::lround(scene.seconds / kFrameSeconds));
  const std::size_t count = package.visualPositions().size();
  for (int frame = 0; frame < frames && motion.goesOn(scene); ++frame) {
    for (std::uint32_t i = 0; i < play.substeps; ++i) {
      const double now = frame * kFrameSeconds + i * h;
      const Vector3d gravity = scene.gravityAt(now);
      for (std::size_t k = 0; k < 3; ++k) world.settings().gravity[k] = float(gravity[Eigen::Index(k)]);
      world.settings().damping = float(scene.dampingAt(now));
      for (std::size_t k = 0; k < sets.size(); ++k) {
        if (scene.regions[k].moves()) world.movePinSet(sets[k], poseOf(scene.regions[k], scene.part(now + h), offset));
      }
      if (scene.file.drive) playFile(scene, package, now + h, offset, world, body);
      const double begin = threadSeconds();
      world.step(float(h));
      motion.cpu_seconds += threadSeconds() - begin;
    }
    std::vector<Vector3f> x(count);
    world.visualVertices(body, {x.front().data(), sizeof(Vector3f), std::uint32_t(count)}, {});
    for (Vector3f& p : x) p -= offset.cast<float>();
    motion.finite = std::all_of(x.begin(), x.end(), [](const Vector3f& p) { return p.allFinite(); });
    if (motion.finite) motion.frames.push_back(std::move(x));
  }
  return motion;
}

}  // namespace sinew::tools

// SPDX-License-Identifier: MIT
#include "runtime/world/body.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "runtime/clusters/goal.h"
#include "runtime/contact/plane.h"
#include "runtime/kernels/kernels.h"
#include "runtime/step/piece_step.h"

namespace sinew::internal {
namespace {

bool within(const Vec3& v, float limit) {
  return std::abs(v[0]) <= limit && std::abs(v[1]) <= limit && std::abs(v[2]) <= limit;  // false for NaN
}

}  // namespace

bool stateIsUsable(const Vec3& x, const Vec3& v) { return within(x, kLargestPosition) && within(v, kLargestVelocity); }

Body::Body(std::shared_ptr<const Asset> source, const BodySettings& body_settings, std::shared_ptr<StiffnessSet> shared,
           std::pmr::memory_resource* memory)
    : asset(std::move(source)),
      settings(body_settings),
      lines(memory),
      x(vertexCount() + 1, &lines),
      v(vertexCount() + 1, &lines),
      force(vertexCount(), memory),
      pinned(vertexCount(), memory),
      blocks(rest().blocks.size(), memory),
      stiffness(std::move(shared)),
      pins(memory),
      picks(memory),
      pin_sets(memory),
      fits(memory),
      fit_of(memory),
      mechanics(package(), rest().mechanics, memory),
      chunks(memory),
      parts(memory),
      pieces(memory),
      coefficients(memory),
      field_values(memory),
      residuals(memory),
      rows(memory),
      frames(memory),
      responses(memory),
      solver_rows(memory),
      terms(memory),
      answers(memory),
      history(memory) {
  std::uint32_t most_functions = 0, most_vertices = 0;
  const bool has_pieces = !rest().fields.empty() && settings.solver == Solver::coupled;
  for (std::uint32_t p = 0; has_pieces && p < package().bodies().size(); ++p) {
    const Field *const free = fieldOf(rest().fields, p, false), *const fixed = fieldOf(rest().fields, p, true);
    Piece& piece = pieces.emplace_back(free, fixed, memory);
    const std::size_t k = std::max(free->k, fixed != nullptr ? fixed->k : 0U);
    for (Array<Vector3d>* array : {&piece.state.z, &piece.state.v, &piece.state.z_before, &piece.state.v_before}) {
      array->reserve(k);
    }
    piece.state.touching.reserve(kMostContacts);
    piece.whole_points.reserve(kMostContacts);
    piece.whole.reserve(3 * k * (3 * k + 7));
    piece.springs.reserve(k * k);
    piece.row.reserve(k);
    most_functions = std::max(most_functions, std::uint32_t(k));
    most_vertices = std::max(most_vertices, free->vertex_count);
  }
  if (!pieces.empty()) {
    coefficients.reserve(4 * std::size_t(most_functions));
    field_values.reserve(24 * ((std::size_t(most_vertices) + 7) / 8));
    residuals.resize(vertexCount());
  }
  std::uint32_t use_block = 0;
  for (const formats::BodyRange& range : package().bodies()) {
    Part part;
    part.first_vertex = range.first_vertex;
    part.vertex_count = range.vertex_count;
    part.first_chunk = std::uint32_t(chunks.size());
    part.first_cluster = range.first_cluster;
    part.cluster_count = range.cluster_count;
    float light = std::numeric_limits<float>::infinity(), heavy = 0;
    for (const float mass : std::span(rest().masses).subspan(range.first_vertex, range.vertex_count)) {
      light = std::min(light, mass);
      heavy = std::max(heavy, mass);
    }
    part.uneven = heavy > kUneven * light;
    const std::uint32_t index = std::uint32_t(parts.size());
    for (std::uint32_t begin = 0; begin < range.vertex_count; begin += kVerticesPerChunk) {
      const std::uint32_t end = std::min(range.vertex_count, begin + kVerticesPerChunk);
      chunks.push_back({index, range.first_vertex + begin, range.first_vertex + end, use_block});
      use_block += (end - begin + 7) / 8;
    }
    part.chunk_count = std::uint32_t(chunks.size()) - part.first_chunk;
    parts.push_back(part);
  }
}

void Body::take(PassScratch& scratch) {
  y = std::span(scratch.y).first(vertexCount() + 1);
  slots = std::span(scratch.slots).first(8 * rest().members.size() + 1);
  slots.back() = {};
}

void Body::giveBack() {
  y = {};
  slots = {};
}

void Body::reset(PassScratch& scratch) {
  std::fill(pinned.begin(), pinned.end(), std::uint8_t(0));
  for (const PinSet& set : pin_sets) {
    for (const PinnedVertex& vertex : set.vertices) pinned[vertex.vertex] = 1;
  }
  pins.clear();
  picks.clear();
  mechanics.reset();
  chooseFields(*this);
  rows.clear();
  repaired = 0;
  placeAtRest(scratch);
}

bool Body::isLost() const {
  bool lost = false;
  for (std::uint32_t c = 0; c < clusterCount(); ++c) {
    const ClusterBlock& block = blocks[c / 8];
    float turned = 0;
    for (const float(&component)[8] : block.rotation) turned += component[c % 8] * component[c % 8];
    lost |= !(turned > 0.5F && turned < 2) ||
            !within({block.center[0][c % 8], block.center[1][c % 8], block.center[2][c % 8]}, kLargestPosition);
  }
  return lost;
}

void Body::recover(PassScratch& scratch) {
  mechanics.forgetShapes(package());
  placeAtRest(scratch);
  repaired = vertexCount();
}

void Body::placeAtRest(PassScratch& scratch) {
  for (Piece& piece : pieces) restPiece(*this, piece);
  outdated = false;
  const Matrix3 rotation = asMatrix(settings.rotation);
  const Vector3 position = asVector(settings.position);
  for (std::uint32_t i = 0; i < vertexCount(); ++i) {
    x[i] = asArray(rotation * asVector(vertices()[i].rest_position) + position);
    v[i] = force[i] = {};
  }
  geometry::Quaternion start = geometry::kIdentityQuaternion;
  geometry::nearestRotation(rotation, start);
  for (ClusterBlock& block : blocks) {
    block = {};
    for (std::size_t k = 0; k < 4; ++k) {
      std::fill(std::begin(block.rotation[k]), std::end(block.rotation[k]), start[k]);
      std::fill(std::begin(block.part_rotation[k]), std::end(block.part_rotation[k]), start[k]);
    }
  }
  matchPositions(scratch);
}

void Body::matchPositions(PassScratch& scratch) {
  take(scratch);
  centers_known = false;
  for (Part& part : parts) {
    part.tangled = false;
    part.turned_seconds = 0;
  }
  for (ClusterBlock& block : blocks) std::fill(std::begin(block.tangled), std::end(block.tangled), 0);
  // A lost vertex must not take its clusters along: it counts as being where they had wanted it.
  for (std::uint32_t i = 0; i < vertexCount(); ++i) y[i] = stateIsUsable(x[i], {}) ? x[i] : asArray(blendedGoal(i));
  const Kernels& kernel = kernels();
  // No frequency: F = A shows the positions as they are.
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    kernel.moments(rest().blocks[b], rest().members.data(), y.data()->data(), blocks[b], slots.data()->data());
  }
  for (const Part& part : parts) {
    updatePartPose(package(), rest(), {}, part.first_cluster, part.cluster_count, blocks);
  }
  for (std::uint32_t b = 0; b < blocks.size(); ++b) {
    StiffnessBlock loose = {};
    for (std::uint32_t c = 8 * b; c < std::min(8 * b + 8, clusterCount()); ++c) {
      storeStiffness(freeStiffness(package(), c), c % 8, loose);
    }
    kernel.match(&rest().blocks[b], &loose, &blocks[b], 1);
  }
  giveBack();
  // The deformation that a state has is not drawn to the rest shape by damping.
  for (std::uint32_t c = 0; c < mechanics.previous.size(); ++c) {
    if (package().clusters()[c].mode != formats::ClusterMode::rigid) rememberDeformation(c);
  }
}

void Body::rememberDeformation(std::uint32_t c) {
  const formats::Cluster& cluster = package().clusters()[c];
  const ClusterFrame frame = loadFrame(blocks, c);
  const Matrix3 rest_moment = rest().clusters[c].moment.leftCols<3>();
  const Matrix3 shape = mechanics.shapes.empty() ? Matrix3(Matrix3::Identity()) : mechanics.shapes[c].shape;
  geometry::Quaternion rotation = frame.rotation;
  // Of a cluster that is lost, R is its part's: its own, which the next pass may find again, is another.
  if (blocks[c / 8].lost[c % 8] != 0) {
    geometry::nearestRotation(Matrix3(frame.f.leftCols<3>()) * rest_moment * shape.transpose(), rotation);
  }
  Columns<9> local = geometry::rotationMatrix(rotation).transpose() * frame.f;
  local.leftCols<3>() -= shape;
  Columns<9>& deformation = mechanics.previous[c];
  if (cluster.mode == formats::ClusterMode::quadratic) {
    deformation = timesSymmetric(local, rest().full_moments[cluster.quadratic]);
  } else {
    deformation.leftCols<3>() = Matrix3(local.leftCols<3>()) * rest_moment;
  }
  if (!deformation.allFinite()) deformation.setZero();
}

Vector3 Body::blendedGoal(std::uint32_t vertex) const {
  Vector3 goal = Vector3::Zero();
  for (const ClusterUse& use : rest().usesOf(vertex)) {
    addGoal(package().clusters()[use.cluster], rest().clusters[use.cluster], loadFrame(blocks, use.cluster),
            vertices()[vertex].rest_position, use.share, goal);
  }
  return goal;
}

Part& Body::partOf(std::uint32_t vertex) {
  const auto begins_behind = [](std::uint32_t index, const Part& part) { return index < part.first_vertex; };
  return *std::prev(std::upper_bound(parts.begin() + 1, parts.end(), vertex, begins_behind));
}

}  // namespace sinew::internal

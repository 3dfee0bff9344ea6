// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/scripted.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <numbers>

#include "sinew/runtime/settings.h"
#include "tools/bake/fields.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

// 1/s: a vertex whose tether alone would ring faster is held. It gives way to an acceleration a by a / omega².
constexpr double kHeldOmega = 2 * std::numbers::pi * 2000;

// Factor on moduli that are relative to each other: the samples of the fields have the product.
double youngScale(const formats::PackageView& package, const PieceElasticity& piece) {
  if (piece.lowest_hz == 0) return 1;
  double scaled = 0, relative = 0;
  for (const formats::Field& field : package.fields()) {
    if (field.piece != piece.piece) continue;
    for (const formats::FieldPack& pack : package.fieldPacks().subspan(field.first_pack, field.pack_count)) {
      for (std::size_t lane = 0; lane < pack.volume.size(); ++lane) {
        if (!(pack.volume[lane] > 0)) continue;
        const Vector3d at(double(pack.at[0][lane]), double(pack.at[1][lane]), double(pack.at[2][lane]));
        std::size_t nearest = 0;
        for (std::size_t t = 1; t < piece.centres.size(); ++t) {
          if ((piece.centres[t] - at).squaredNorm() < (piece.centres[nearest] - at).squaredNorm()) nearest = t;
        }
        scaled += double(pack.volume[lane]) * double(pack.mu[lane]);
        relative += double(pack.volume[lane]) * 0.5 * piece.young[nearest] / (1 + piece.poisson[nearest]);
      }
    }
    break;
  }
  return relative > 0 ? scaled / relative : 1;
}

// Tensions as the fields that the scene plays have them. \param own numbers in the body of the piece's tetrahedra, -1:
// none
void addFibres(const formats::PackageView& package, const PieceElasticity& piece, bool held,
               const std::vector<std::int64_t>& own, MotionBody& body) {
  std::vector<float> tensions;
  for (const formats::FieldFibre& fibre : package.fieldFibres()) {
    const formats::Field& field = package.fields()[fibre.field];
    if (field.piece == piece.piece && (field.held != 0) == held) tensions.push_back(fibre.tension);
  }
  for (std::size_t i = 0; i < piece.fibres.size() && i < tensions.size(); ++i) {
    const formats::ClusterMechanics& mechanics = package.mechanics()[piece.fibres[i].cluster];
    MotionFibre fibre;
    fibre.channel = mechanics.channel;
    fibre.tension = double(tensions[i]);
    fibre.contraction = double(mechanics.contraction);
    fibre.direction = {double(mechanics.fibre[0]), double(mechanics.fibre[1]), double(mechanics.fibre[2])};
    for (const auto& [t, volume] : piece.fibres[i].parts) {
      if (own[t] >= 0) fibre.weights.emplace_back(std::uint32_t(own[t]), volume / piece.fibres[i].volume);
    }
    body.fibres.push_back(std::move(fibre));
  }
}

}  // namespace

std::shared_ptr<const SceneScript> errorScript(const std::string& file) {
  auto script = std::make_shared<SceneScript>(SceneScript::read(file));
  const auto refuse = [&](bool there, const char* pointer, const std::string& what, const std::string& cure) {
    if (there) script->text.fail(pointer, what + " is nothing that the reference of study error can do", cure);
  };
  refuse(!script->cuts.empty(), "/cuts", "a cut", "Leave it out.");
  refuse(!script->picks.empty(), "/picks", "a pick", "Pin the place in the recipe and move its target.");
  refuse(!script->pushes.empty(), "/pushes", "a push", "Leave it out.");
  refuse(!script->impulses.empty(), "/impulses", "an impulse", "Give a force for a short time, on all of the mass.");
  refuse(!script->colliders.empty(), "/colliders", "a collider", "Leave it out, or use the ground.");
  refuse(!script->bodies.empty(), "/bodies", "a place of bodies", "Leave it out: one body, where its source is.");
  refuse(script->drag > 0, "/drag", "drag", "Use damping.");
  refuse(script->self_contact, "/self_contact", "touching itself", "Leave it out.");
  refuse(script->stiffness != 1, "/stiffness", "another stiffness than the recipe's", "Change it in the recipe.");
  for (const SceneScript::Force& force : script->forces) {
    refuse(force.at.has_value(), "/forces", "a force at a point", "Leave out its `at`: it acts on all of the mass.");
  }
  return script;
}

MotionScene scriptedScene(const std::shared_ptr<const SceneScript>& script, const formats::PackageView& package) {
  MotionScene scene;
  const auto drive = std::make_shared<const SceneDrive>(*script, package);
  scene.file = {script, drive};
  scene.free = !script->package_pins || package.pinSets().empty();
  scene.seconds = kFrameSeconds * std::max(1.0, std::round(script->seconds / kFrameSeconds));
  scene.gravity = {0, -script->gravity, 0};
  scene.damping = script->damping.value_or(double(WorldSettings().damping));
  if (script->ground) scene.ground = MotionGround{.height = *script->ground - drive->origin[1]};
  double mass = 0;
  for (const auto& v : package.physicalVertices()) mass += double(v.mass);
  if (!script->forces.empty()) {
    scene.push = [script, mass](double time) {
      Vector3d sum = Vector3d::Zero();
      for (const SceneScript::Force& force : script->forces) {
        if (time < force.keys.front().time || time > force.keys.back().time) continue;
        sum += Vector3d(valueAt(force.keys, time).data()) / mass;
      }
      return sum;
    };
  }
  scene.activation = [script, drive](std::uint32_t channel, double time) {
    for (const SceneDrive::Use& use : drive->channels) {
      if (use.channel == channel) return valueAt(script->channels[use.source].keys, time);
    }
    return 0.0;
  };
  if (scene.free) return scene;
  std::vector<const SceneScript::Target*> targets;
  for (const formats::PinSet& set : package.pinSets()) {
    const auto at = std::find_if(script->targets.begin(), script->targets.end(),
                                 [&](const auto& target) { return target.name == package.text(set.target); });
    targets.push_back(at == script->targets.end() ? nullptr : &*at);
  }
  scene.regions.resize(targets.size());
  scene.pose = [script, drive, targets](std::size_t region, double time) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    if (targets[region] == nullptr) return pose;
    const RigidTransform motion = motionAt(*targets[region], drive->origin, time);
    for (int row = 0; row < 3; ++row) {
      pose.translation()[row] = double(motion.position[std::size_t(row)]);
      for (int column = 0; column < 3; ++column) {
        pose.linear()(row, column) = double(motion.rotation[3 * std::size_t(row) + std::size_t(column)]);
      }
    }
    return pose;
  };
  return scene;
}

MotionBody scriptedBody(const formats::PackageView& package, const MotionScene& scene) {
  const PackageSolid solid = packageSolid(package);
  formats::PackageContent content = formats::contentOf(package);
  MotionBody body;
  std::vector<std::int32_t> number(solid.rest.size(), -1);
  for (std::uint32_t p = 0; p < solid.pieces; ++p) {
    const PieceElasticity piece = elasticityOf(content, p);
    const double scale = youngScale(package, piece);
    std::map<std::array<std::uint32_t, 4>, std::size_t> known;
    for (std::size_t t = 0; t < piece.tetrahedra.size(); ++t) {
      std::array<std::uint32_t, 4> corners = piece.tetrahedra[t];
      for (std::uint32_t& v : corners) v = piece.vertices[v];
      known.emplace(corners, t);
    }
    std::vector<std::int64_t> tetrahedron(piece.tetrahedra.size(), -1);
    for (const auto& t : solid.tetrahedra) {
      if (solid.piece[t[0]] != p) continue;
      const auto at = known.find(t);
      if (at == known.end()) continue;
      std::array<std::uint32_t, 4> own{};
      for (std::size_t k = 0; k < 4; ++k) {
        if (number[t[k]] < 0) {
          number[t[k]] = std::int32_t(body.rest.size());
          body.rest.push_back(solid.rest[t[k]]);
          body.masses.push_back(solid.masses[t[k]]);
          body.region.push_back(-1);
        }
        own[k] = std::uint32_t(number[t[k]]);
      }
      tetrahedron[at->second] = std::int64_t(body.tetrahedra.size());
      body.tetrahedra.push_back(own);
      body.materials.push_back({scale * piece.young[at->second], piece.poisson[at->second]});
    }
    if (!scene.free) {
      for (std::size_t h = 0; h < piece.held.size(); ++h) {
        for (const std::uint32_t v : piece.held[h]) {
          const std::int32_t own = number[piece.vertices[v]];
          if (own >= 0) body.region[std::size_t(own)] = std::int32_t(piece.pin_sets[h]);
        }
      }
      for (const FieldTether& tether : piece.tethers) {
        const std::int32_t own = number[piece.vertices[tether.vertex]];
        if (own < 0) continue;
        const auto v = std::uint32_t(own);
        const std::uint32_t set = piece.pin_sets[tether.held];
        const double stiffness = scale * tether.strength + tether.absolute;
        if (stiffness > body.masses[v] * kHeldOmega * kHeldOmega) {
          body.region[v] = std::int32_t(set);
        } else {
          body.tethers.push_back({v, set, stiffness});
        }
      }
      std::erase_if(body.tethers, [&](const MotionTether& tether) { return body.region[tether.vertex] >= 0; });
    }
    addFibres(package, piece, !scene.free && !piece.held.empty(), tetrahedron, body);
  }
  addSurface(package, number, body);
  return body;
}

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/scene/scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "runtime/geometry/smoothstep.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

constexpr std::array<std::string_view, 10> kNames = {"rest",  "drop",    "squash", "stretch", "hang",
                                                     "stack", "pyramid", "pile",   "stairs",  "cut"};

// Gravity of a scene, in diagonals per second squared: a body one metre across then falls as on Earth.
constexpr float kGravityDiagonals = 9.81F;
// `drop` starts this far above the ground, turned by this angle so that it lands on no face flatly.
constexpr float kDropHeight = 0.35F;
constexpr float kDropTilt = 0.25F;
// `squash` presses between two plates to this part of the height within kPressSeconds, holds, takes both away.
constexpr float kPressedHeight = 0.5F;
constexpr float kPlateThickness = 0.01F, kPlateMargin = 0.1F;  // of the diagonal; half of it, and beyond the body
constexpr float kPressSeconds = 0.5F;
constexpr float kHoldSeconds = 0.25F;
// `stretch` holds this part of the length at both ends and pulls to this factor.
constexpr float kHeldEnds = 0.12F;
constexpr float kStretchFactor = 1.5F;
// `hang` holds this part of the height at the top.
constexpr float kHeldTop = 0.1F;

// Contacts have no rolling resistance of their own, so a ball would roll on for long; in `drop` the air slows it.
constexpr float kDropDamping = 0.6F;

// Rest before a body's sleep, s.
constexpr float kSleepSeconds = 0.5F;
// `stack` puts so many one on another, `pyramid` so many rows of one less each, `pile` drops so many layers of so many
// by so many into a box.
constexpr int kStacked = 10;
constexpr int kRows = 4;
constexpr int kPiledX = 5, kPiledZ = 4, kLayers = 3;
// Walls of the box, of the diagonal.
constexpr float kWallHeight = 2, kWallThickness = 0.1F;
// `stairs`: so many steps, on each of which a body is thrown towards the foot; of the diagonal, and diagonals a second.
constexpr int kSteps = 6;
constexpr float kStepDepth = 1, kStepHeight = 0.35F, kStairWidth = 3, kThrown = 2;
// Between what is put one on another, and between what is dropped, of the diagonal.
constexpr float kStackGap = 1e-3F;
constexpr float kPileGap = 0.05F;
// `cut` cuts what stands on the ground through its middle, so steep (tangent) that what is above slides off.
constexpr double kCutSeconds = 0.25;
constexpr float kCutSlope = 0.9F;

bool hasSeveral(SceneKind kind) {
  return kind == SceneKind::stack || kind == SceneKind::pyramid || kind == SceneKind::pile || kind == SceneKind::stairs;
}

// Where a motion takes a place.
Vec3 placeAfter(const RigidTransform& motion, const Vec3& place) {
  Vec3 to = motion.position;
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t c = 0; c < 3; ++c) to[r] += motion.rotation[3 * r + c] * place[c];
  }
  return to;
}

struct Bounds {
  Vec3 low, high;
  float extent(std::size_t axis) const { return high[axis] - low[axis]; }
  std::size_t longest() const {
    std::size_t axis = 0;
    for (std::size_t a = 1; a < 3; ++a) {
      if (extent(a) > extent(axis)) axis = a;
    }
    return axis;
  }
};

// Drawn bounds in a scene that moves the body without a turn.
Bounds drawnBounds(const formats::PackageInfo& info, const Vec3& position) {
  Bounds b{info.bounds_min, info.bounds_max};
  for (std::size_t a = 0; a < 3; ++a) {
    b.low[a] += position[a];
    b.high[a] += position[a];
  }
  return b;
}

Bounds boundsOf(std::span<const Vec3> points) {
  constexpr float inf = std::numeric_limits<float>::infinity();
  Bounds b{{inf, inf, inf}, {-inf, -inf, -inf}};
  for (const Vec3& p : points) {
    for (std::size_t a = 0; a < 3; ++a) {
      b.low[a] = std::min(b.low[a], p[a]);
      b.high[a] = std::max(b.high[a], p[a]);
    }
  }
  return b;
}

// Turned by golden angles about two axes: no two alike, and the same in each run.
Mat3 turnOf(int i) {
  const float a = 2.3999632F * float(i), b = 1.5F * a;
  const float ca = std::cos(a), sa = std::sin(a), cb = std::cos(b), sb = std::sin(b);
  return {ca, -sa * cb, sa * sb, sa, ca * cb, -ca * sb, 0, sb, cb};
}

float pilePitch(float diagonal) { return (1 + kPileGap) * diagonal; }

// Places of the bodies of a scene with several; the first row lies on the ground. \param bounds of the packages, which
// are taken in turn. \param diagonal the longest.
std::vector<BodySettings> placesOf(SceneKind kind, std::span<const Bounds> bounds, float diagonal,
                                   const BodySettings& common) {
  std::vector<BodySettings> places;
  const float gap = kStackGap * diagonal;
  const auto next = [&]() -> const Bounds& { return bounds[places.size() % bounds.size()]; };
  const auto put = [&](float x, float y, float z) {
    places.push_back(common);
    places.back().position = {x, y, z};
  };
  if (kind == SceneKind::stack) {
    float top = 0;
    for (int i = 0; i < kStacked; ++i) {
      const Bounds& own = next();
      put(0, top - own.low[1], 0);
      top += own.extent(1) + gap;
    }
  } else if (kind == SceneKind::pyramid) {
    float width = 0, height = 0;
    for (const Bounds& one : bounds) width = std::max(width, one.extent(0)), height = std::max(height, one.extent(1));
    for (int row = 0; row < kRows; ++row) {
      for (int i = 0; i < kRows - row; ++i) {
        put((float(i) - 0.5F * float(kRows - row - 1)) * (width + 2 * gap), float(row) * (height + gap) - next().low[1],
            0);
      }
    }
  } else if (kind == SceneKind::stairs) {
    for (int i = 0; i < kSteps; ++i) {
      const int step = kSteps - 1 - i;  // from the top
      put((float(i) + 0.5F) * kStepDepth * diagonal, (float(step + 1) * kStepHeight + 0.6F) * diagonal,
          (float(i % 3) - 1) * 0.3F * kStairWidth * diagonal);
      places.back().rotation = turnOf(i);
    }
  } else {
    const float pitch = pilePitch(diagonal);
    for (int i = 0; i < kPiledX * kPiledZ * kLayers; ++i) {
      const auto along = [&](int k, int side) { return (float(k) - 0.5F * float(side - 1)) * pitch; };
      const int layer = i / (kPiledX * kPiledZ);
      put(along(i % kPiledX, kPiledX), 0.6F * diagonal + float(layer) * pitch, along(i / kPiledX % kPiledZ, kPiledZ));
      places.back().rotation = turnOf(i);
    }
  }
  return places;
}

// Where a body's vertices are after another bake of its package: those of the same place at rest where they were,
// others as the nearest one of the old bake and the body's rotation say.
void carryState(const World& world, BodyId body, const formats::PackageView& package, std::vector<Vec3>& positions,
                std::vector<Vec3>& velocities) {
  const formats::PackageView& old = world.asset(body).package();
  const std::span<const Vec3> old_positions = world.positions(body), old_velocities = world.velocities(body);
  Mat3 rotation{};
  Vec3 translation{};
  world.rigidMotion(body, rotation, translation);
  Vec3 shift{};
  for (std::size_t a = 0; a < 3; ++a) shift[a] = float(package.info().origin[a] - old.info().origin[a]);
  std::vector<std::uint32_t> order(old.physicalVertices().size());
  for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  const auto rest = [&](std::uint32_t i) { return old.physicalVertices()[i].rest_position; };
  // Sorted along x: the search leaves off where x alone is farther than the best.
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) { return rest(a)[0] < rest(b)[0]; });
  for (const formats::PhysicalVertex& vertex : package.physicalVertices()) {
    Vec3 x = {vertex.rest_position[0], vertex.rest_position[1], vertex.rest_position[2]};
    for (std::size_t a = 0; a < 3; ++a) x[a] += shift[a];
    float best = std::numeric_limits<float>::infinity();
    std::uint32_t nearest = 0;
    const auto offer = [&](std::uint32_t i) {
      float squared = 0;
      for (std::size_t a = 0; a < 3; ++a) squared += (rest(i)[a] - x[a]) * (rest(i)[a] - x[a]);
      if (squared < best) best = squared, nearest = i;
      return (rest(i)[0] - x[0]) * (rest(i)[0] - x[0]) <= best;
    };
    const auto middle = std::lower_bound(order.begin(), order.end(), x[0],
                                         [&](std::uint32_t i, float value) { return rest(i)[0] < value; });
    for (auto i = middle; i != order.end() && offer(*i); ++i) {
    }
    for (auto i = middle; i != order.begin() && offer(*(i - 1)); --i) {
    }
    Vec3 place = old_positions[nearest];
    for (std::size_t r = 0; r < 3; ++r) {
      for (std::size_t c = 0; c < 3; ++c) place[r] += rotation[3 * r + c] * (x[c] - rest(nearest)[c]);
    }
    positions.push_back(place);
    velocities.push_back(old_velocities[nearest]);
  }
}

}  // namespace

std::span<const std::string_view> sceneNames() { return kNames; }

std::string sceneList() {
  std::string names;
  for (const auto& known : kNames) names += std::string(known) + ", ";
  return names + "or a file that ends in .json";
}

SceneChoice SceneChoice::byName(const std::string& name) {
  if (name.ends_with(".json")) {
    SceneChoice choice = SceneKind::rest;
    choice.script = std::make_shared<const SceneScript>(SceneScript::read(name));
    return choice;
  }
  const auto at = std::find(kNames.begin(), kNames.end(), name);
  if (at != kNames.end()) return SceneKind(at - kNames.begin());
  throw ToolError(ExitCode::usage, "", "there is no scene '" + name + "'", "Scenes: " + sceneList() + ".");
}

std::string SceneChoice::name() const { return script ? script->name : std::string(kNames[std::size_t(kind)]); }

bool SceneChoice::takesSeveral() const { return script ? !script->bodies.empty() : hasSeveral(kind); }

double SceneChoice::stepSeconds() const { return script && script->step ? *script->step : 1.0 / 60; }

double SceneChoice::seconds() const {
  if (script) return script->seconds;
  switch (kind) {
    case SceneKind::rest:
      return 1;
    case SceneKind::squash:
      return 1.5;
    case SceneKind::stretch:
      return 2;
    case SceneKind::drop:
    case SceneKind::hang:
      return 2.5;
    case SceneKind::stack:
    case SceneKind::pyramid:
    case SceneKind::pile:
    case SceneKind::stairs:
      return 5;
    case SceneKind::cut:
      return 2.5;
  }
  return 2;
}

Scene::Scene(std::shared_ptr<const Asset> asset, const SceneOptions& options, JobSystem* jobs)
    : asset_(std::move(asset)),
      options_(options),
      world_(WorldSettings{}, jobs),
      inputs_(asset_->package().channels().size()),
      held_channels_(inputs_.size()) {
  if (options_.scene.script) script_.emplace(*options_.scene.script, asset_->package());
  reset();
}

std::optional<float> Scene::ownGround() const {
  const SceneKind kind = options_.scene.kind;
  if (script_ && script_->script.ground) return float(*script_->script.ground - script_->origin[1]);
  if (kind == SceneKind::drop || kind == SceneKind::cut || hasSeveral(kind)) return 0.0F;
  return std::nullopt;
}

float Scene::reach() const {
  float most = 0;
  for (std::size_t i = 0; i <= options_.others.size(); ++i) {
    most = std::max(most, packageOf(i)->package().info().diagonal);
  }
  return most;
}

void Scene::add(const BodySettings& settings, const std::shared_ptr<const Asset>& asset) {
  auto added = world_.addBody(asset, settings);
  if (!added) {
    const formats::PackageView& package = asset->package();
    throw ToolError(ExitCode::bad_input, std::string(package.text(package.info().name)), added.reason(),
                    "That is --solver report.");
  }
  bodies_.push_back(*added);
  assets_.push_back(asset);
}

ColliderId Scene::addSolid(const ColliderShape& shape, const ColliderSettings& settings,
                           std::shared_ptr<const SolidMesh> mesh) {
  const auto added = world_.addCollider(shape, settings);
  if (!added) {
    throw ToolError(ExitCode::bad_input, options_.scene.name(), added.reason(), "Change the collider of the scene.");
  }
  solids_.push_back({*added, mesh != nullptr ? std::move(mesh) : meshOf(shape, 2 * reach())});
  return *added;
}

void Scene::removeSolid(ColliderId id) {
  world_.removeCollider(id);
  std::erase_if(solids_, [id](const SceneSolid& solid) { return solid.id == id; });
}

RigidTransform Scene::drivenAt(std::size_t i, double time) const {
  if (script_) {
    const SceneScript::Solid& from = script_->script.colliders[i];
    RigidTransform at = from.motion.keys.empty() ? RigidTransform{} : motionAt(from.motion, script_->origin, time);
    at.position = placeAfter(at, placed(from.at));
    return at;
  }
  const Bounds bounds = drawnBounds(asset_->package().info(), placement_.position);
  const float thick = kPlateThickness * reach();
  const float height = 1 + (kPressedHeight - 1) * geometry::smoothstep(float(time) / kPressSeconds);
  RigidTransform at;
  for (const std::size_t a : {std::size_t(0), std::size_t(2)}) at.position[a] = 0.5F * (bounds.low[a] + bounds.high[a]);
  at.position[1] = i == 0 ? bounds.low[1] - thick : bounds.low[1] + height * bounds.extent(1) + thick;
  return at;
}

ColliderId Scene::addDriven(std::size_t i, const RigidTransform& at) {
  ColliderSettings settings;
  settings.at = at;
  if (script_) {
    const SceneScript::Solid& from = script_->script.colliders[i];
    settings.friction = float(from.friction);
    settings.restitution = float(from.restitution);
    for (std::size_t c = 0; c < 3; ++c) settings.surface_velocity[c] = float(from.surface_velocity[c]);
    return addSolid(from.shape(), settings);
  }
  const Bounds bounds = drawnBounds(asset_->package().info(), placement_.position);
  const float margin = kPlateMargin * reach();
  const float sign = i == 0 ? 1.0F : -1.0F;
  const Vec3 half = {0.5F * bounds.extent(0) + margin, kPlateThickness * reach(), 0.5F * bounds.extent(2) + margin};
  return addSolid(PlaneShape{{0, sign, 0}, half[1]}, settings, plateOf(half, sign));
}

void Scene::addScriptBodies(const BodySettings& common) {
  if (script_->script.bodies.empty()) add(common, asset_);
  for (std::size_t i = 0; i < script_->script.bodies.size(); ++i) {
    const SceneScript::Place& from = script_->script.bodies[i];
    if (from.package > options_.others.size()) {
      script_->script.text.fail(childPointer(childPointer("/bodies", i), "package"), "there is no such package",
                                "They count from 0, in the order of the command line.");
    }
    const std::shared_ptr<const Asset>& asset = packageOf(from.package);
    const formats::PackageInfo& info = asset->package().info();
    SceneScript::Target hinge;
    hinge.axis = from.axis;
    for (std::size_t a = 0; a < 3; ++a) {
      hinge.point[a] = 0.5 * (double(info.bounds_min[a]) + double(info.bounds_max[a]));
    }
    hinge.keys = {{0, from.turn, from.move}};
    const RigidTransform at = motionAt(hinge, {0, 0, 0}, 0);
    BodySettings settings = common;
    settings.position = at.position;
    settings.rotation = at.rotation;
    // Places of a package are relative to its own origin, the world's to the first one's.
    for (std::size_t a = 0; a < 3; ++a) settings.position[a] += float(info.origin[a] - script_->origin[a]);
    add(settings, asset);
    const auto& v = from.velocity;
    if (v != std::array<double, 3>{}) {
      world_.setVelocity(bodies_.back(), {float(v[0]), float(v[1]), float(v[2])}, {0, 0, 0});
    }
  }
}

void Scene::addBox() {
  const float diagonal = reach(), pitch = pilePitch(diagonal), thick = kWallThickness * diagonal;
  const Vec3 half = {0.5F * float(kPiledX) * pitch, 0.5F * kWallHeight * diagonal, 0.5F * float(kPiledZ) * pitch};
  for (const std::size_t axis : {std::size_t(0), std::size_t(2)}) {
    for (const float sign : {-1.0F, 1.0F}) {
      Vec3 size = {half[0], half[1], half[2] + 2 * thick};
      size[axis] = thick;
      ColliderSettings settings;
      settings.at.position = {0, half[1], 0};
      settings.at.position[axis] = sign * (half[axis] + thick);
      addSolid(BoxShape{size}, settings, wallOf(size, axis, -sign));
    }
  }
}

void Scene::addStairs() {
  const float diagonal = reach();
  for (int step = 0; step < kSteps; ++step) {
    const float height = float(kSteps - step) * kStepHeight * diagonal;
    ColliderSettings settings;
    settings.at.position = {(float(step) + 0.5F) * kStepDepth * diagonal, 0.5F * height, 0};
    addSolid(BoxShape{{0.5F * kStepDepth * diagonal, 0.5F * height, 0.5F * kStairWidth * diagonal}}, settings);
  }
}

void Scene::planCuts() {
  cuts_.clear();
  next_cut_ = 0;
  if (script_) {
    for (const SceneScript::Cut& from : script_->script.cuts) {
      Cut& made = cuts_.emplace_back();
      made.time = from.time;
      for (std::size_t a = 0; a < 3; ++a) {
        made.plane.point[a] = float(from.point[a] - script_->origin[a]);
        made.plane.normal[a] = float(from.normal[a]);
      }
      if (!from.corners) continue;
      std::array<Vec3, 4> corners = {};
      for (std::size_t i = 0; i < 4; ++i) {
        for (std::size_t a = 0; a < 3; ++a) corners[i][a] = float((*from.corners)[i][a] - script_->origin[a]);
      }
      made.plane = boundedPlane(corners);
    }
  } else if (options_.scene.kind == SceneKind::cut) {
    const Bounds bounds = boundsOf(start_);
    Cut& made = cuts_.emplace_back();
    made.time = kCutSeconds;
    for (std::size_t a = 0; a < 3; ++a) made.plane.point[a] = 0.5F * (bounds.low[a] + bounds.high[a]);
    made.plane.normal = {0, 1, 0};
    made.plane.normal[bounds.extent(0) >= bounds.extent(2) ? 0 : 2] = kCutSlope;
  }
}

void Scene::cut(const CutPlane& plane) {
  std::vector<BodyId> bodies;
  std::vector<std::shared_ptr<const Asset>> assets;
  std::string reason;
  bool any = false;
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    const auto parts = cutBody(world_, bodies_[b], plane);
    if (!parts) {
      reason = parts.reason();
      bodies.push_back(bodies_[b]);
      assets.push_back(assets_[b]);
      continue;
    }
    any = true;
    bodies.insert(bodies.end(), parts->bodies.begin(), parts->bodies.end());
    for (const CutPart& part : parts->cut.parts) assets.push_back(part.asset);
    for (const CutHeir<PickId>& heir : parts->picks) {
      for (Hand& hand : hands_) hand.pick = hand.pick == heir.before ? heir.now : hand.pick;
    }
  }
  if (!any) {
    const formats::PackageView& package = asset_->package();
    throw ToolError(ExitCode::bad_input, std::string(package.text(package.info().name)),
                    "it cannot be cut here: " + reason, "Move the plane, or choose another --scene.");
  }
  bodies_ = std::move(bodies);
  assets_ = std::move(assets);
  pinned_.clear();  // numbers of the whole
}

void Scene::reset() {
  for (const BodyId body : bodies_) world_.removeBody(body);
  bodies_.clear();
  assets_.clear();
  while (!solids_.empty()) removeSolid(solids_.back().id);
  driven_solids_.clear();
  pushers_.clear();
  hands_.clear();
  held_points_.clear();
  next_impulse_ = 0;
  time_ = even_from_ = 0;
  steps_ = even_steps_ = 0;
  pinned_.clear();

  const SceneKind kind = options_.scene.kind;
  const bool several = hasSeveral(kind) || (script_ && script_->script.bodies.size() > 1);
  const float diagonal = several ? reach() : asset_->package().info().diagonal;
  WorldSettings& world = world_.settings();
  const std::uint32_t usual_iterations = script_ ? script_->script.iterations : 0;
  if (options_.iterations > 0 || usual_iterations > 0)
    world.iterations = options_.iterations > 0 ? options_.iterations : usual_iterations;
  const bool is_cut = options_.scene.kind == SceneKind::cut || (script_ && !script_->script.cuts.empty());
  const bool falls = several || options_.scene.kind == SceneKind::cut || options_.scene.kind == SceneKind::drop ||
                     options_.scene.kind == SceneKind::hang;
  if (several && options_.solver != nullptr) {
    throw ToolError(ExitCode::usage, "", "bodies that the report's solver moves do not touch each other",
                    "Choose another --scene, or the default solver.");
  }
  for (std::size_t i = 0; several && i <= options_.others.size(); ++i) {
    const formats::PackageView& package = packageOf(i)->package();
    if (!package.distanceGrids().empty()) continue;
    throw ToolError(ExitCode::bad_input, std::string(package.text(package.info().name)),
                    "the package has no distance grids, by which bodies touch each other",
                    "Bake it again without field.distances=0.");
  }
  if (const formats::PackageView& package = asset_->package();
      ownGround() && options_.solver == nullptr && !package.fields().empty() && package.fieldPoints().empty()) {
    throw ToolError(ExitCode::bad_input, std::string(package.text(package.info().name)),
                    "the package has no contact points: it would fall through the ground",
                    "Bake it again with --needs contact, or choose --scene hang.");
  }
  const bool touches_itself = script_ && script_->script.self_contact;
  world.collisions = several || is_cut || touches_itself;
  world.sleep_seconds = several || options_.scene.kind == SceneKind::cut ? kSleepSeconds : 0;
  const float usual = script_ ? float(script_->script.gravity) : falls ? kGravityDiagonals * diagonal : 0.0F;
  world.gravity = {0, falls || script_ ? -options_.gravity.value_or(usual) : 0.0F, 0};
  world.ground.enabled = ownGround().has_value();
  world.ground.offset = ownGround().value_or(0);
  if (options_.scene.kind == SceneKind::drop) world.damping = kDropDamping;

  // Damping is towards the rigid motion of all pin sets together: where sets move apart (jaw and skull, lids) it would
  // drag the skin between them along.
  if (script_ && !script_->script.targets.empty()) world.deformation_damping_ratio = 0;
  if (script_ && script_->script.damping) world.damping = float(*script_->script.damping);
  if (script_ && script_->script.support_damping) world.support_damping = float(*script_->script.support_damping);
  if (script_ && script_->script.deformation_damping_ratio)
    world.deformation_damping_ratio = float(*script_->script.deformation_damping_ratio);

  BodySettings placement;
  placement.stiffness_scale = options_.stiffness_scale * (script_ ? float(script_->script.stiffness) : 1.0F);
  placement.solver = options_.solver;
  placement.self_contact = touches_itself;
  placement.drag = script_ ? float(script_->script.drag) : 0;
  placement.package_pins = script_ ? script_->script.package_pins : options_.scene.kind == SceneKind::rest;
  if (options_.scene.kind == SceneKind::drop) {
    // Turned about z, then about x.
    const float c = std::cos(kDropTilt);
    const float s = std::sin(kDropTilt);
    placement.rotation = {c, -s, 0, c * s, c * c, -s, s * s, s * c, c};
  }
  // The lowest point of the rest shape, so placed, comes to y = 0 (the ground) or the drop height above it.
  float lowest = std::numeric_limits<float>::infinity();
  for (const auto& vertex : asset_->package().physicalVertices()) {
    const auto& x = vertex.rest_position;
    lowest =
        std::min(lowest, placement.rotation[3] * x[0] + placement.rotation[4] * x[1] + placement.rotation[5] * x[2]);
  }
  if (options_.scene.kind == SceneKind::cut) lowest = std::min(lowest, asset_->package().info().bounds_min[1]);
  if (!script_) {
    placement.position[1] = -lowest + (options_.scene.kind == SceneKind::drop ? kDropHeight * diagonal : 0.0F);
  }
  if (script_) {
    for (std::size_t i = 0; i < script_->script.colliders.size(); ++i)
      driven_solids_.push_back(addDriven(i, drivenAt(i, 0)));
    addScriptBodies(placement);
  } else if (several) {
    std::vector<Bounds> bounds;
    for (std::size_t i = 0; i <= options_.others.size(); ++i) {
      std::vector<Vec3> rest;
      for (const auto& vertex : packageOf(i)->package().physicalVertices()) rest.push_back(vertex.rest_position);
      bounds.push_back(boundsOf(rest));
    }
    if (kind == SceneKind::pile) addBox();
    if (kind == SceneKind::stairs) addStairs();
    const std::vector<BodySettings> places = placesOf(kind, bounds, diagonal, placement);
    for (std::size_t i = 0; i < places.size(); ++i) {
      add(places[i], packageOf(i % bounds.size()));
      if (kind == SceneKind::stairs) world_.setVelocity(bodies_.back(), {kThrown * diagonal, 0, 0}, {0, 0, 0});
    }
    placement = places.front();
  } else {
    add(placement, asset_);
  }
  placement_ = {placement.position, placement.rotation};
  const auto positions = world_.positions(body());
  start_.assign(positions.begin(), positions.end());
  if (kind == SceneKind::squash) driven_solids_ = {addDriven(0, drivenAt(0, 0)), addDriven(1, drivenAt(1, 0))};

  const Bounds bounds = boundsOf(start_);
  if (options_.scene.kind == SceneKind::hang) {
    // Each separate body by its own top, or all but the highest would fall.
    for (const auto& part : asset_->package().pieces()) {
      const std::span<const Vec3> points = std::span(start_).subspan(part.first_vertex, part.vertex_count);
      const Bounds own = boundsOf(points);
      const float level = own.high[1] - kHeldTop * own.extent(1);
      for (std::uint32_t v = 0; v < points.size(); ++v) {
        if (points[v][1] >= level) pinned_.push_back(part.first_vertex + v);
      }
    }
  } else if (options_.scene.kind == SceneKind::stretch) {
    const std::size_t axis = bounds.longest();
    const float margin = kHeldEnds * bounds.extent(axis);
    for (std::uint32_t v = 0; v < start_.size(); ++v) {
      const float x = start_[v][axis];
      if (x <= bounds.low[axis] + margin || x >= bounds.high[axis] - margin) pinned_.push_back(v);
    }
  }
  for (std::uint32_t v : pinned_) world_.pin(body(), v, start_[v]);
  if (placement.package_pins) {
    const auto held = asset_->package().pinSetVertices();
    pinned_.assign(held.begin(), held.end());
  }
  planCuts();
  if (script_) script_->moveTargets(world_, body(), 0);
  std::fill(inputs_.begin(), inputs_.end(), 0.0F);  // as the new body has them
  driveChannels(0);
}

void Scene::holdChannel(std::uint32_t channel, std::optional<float> value) {
  held_channels_[channel] = value;
  driveChannels(time_);
}

void Scene::driveChannels(double time) {
  wanted_.assign(inputs_.size(), 0.0F);
  if (script_) script_->readInputs(time, wanted_);
  for (std::uint32_t c = 0; c < inputs_.size(); ++c) {
    const float input = held_channels_[c].value_or(wanted_[c]);
    if (input != inputs_[c]) {
      for (const BodyId body : bodies_) world_.setActivation(body, c, input);
    }
    inputs_[c] = input;
  }
}

void Scene::drive() {
  const double end = time_ + double(stepSeconds());
  driveChannels(end);
  if (script_) {
    for (const BodyId one : bodies_) script_->moveTargets(world_, one, end);
    driveHands(end);
    return;
  }
  const auto t = float(time_);
  const Bounds bounds = boundsOf(start_);
  if (options_.scene.kind == SceneKind::squash && !driven_solids_.empty()) {
    if (t > kPressSeconds + kHoldSeconds) {
      for (const ColliderId plate : driven_solids_) removeSolid(plate);
      driven_solids_.clear();
    } else {
      world_.moveCollider(driven_solids_.back(), drivenAt(1, end));
    }
  } else if (options_.scene.kind == SceneKind::stretch && !pinned_.empty()) {
    if (t > kPressSeconds + kHoldSeconds) {
      world_.unpinAll(body());
      pinned_.clear();
      return;
    }
    const std::size_t axis = bounds.longest();
    const float middle = 0.5F * (bounds.low[axis] + bounds.high[axis]);
    const float half_pull = 0.5F * (kStretchFactor - 1) * bounds.extent(axis) * geometry::smoothstep(t / kPressSeconds);
    for (std::uint32_t v : pinned_) {
      Vec3 target = start_[v];
      target[axis] += start_[v][axis] > middle ? half_pull : -half_pull;
      world_.pin(body(), v, target);
    }
  }
}

bool Scene::continueFrom(const Scene& before) {
  if (!(before.options_.scene == options_.scene) || before.bodies_.size() != bodies_.size() || before.next_cut_ > 0)
    return false;
  if (before.pinned_.empty() && !pinned_.empty() && options_.scene.kind == SceneKind::stretch) {
    world_.unpinAll(body());
    pinned_.clear();
  }
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    std::vector<Vec3> positions, velocities;
    carryState(before.world_, before.bodies_[b], assets_[b]->package(), positions, velocities);
    world_.setState(bodies_[b], positions, velocities);
  }
  for (std::size_t i = 0; i < driven_solids_.size(); ++i) {
    // Put where it is: a jump would be a blow.
    removeSolid(driven_solids_[i]);
    if (i < before.driven_solids_.size())
      driven_solids_[i] = addDriven(i, before.world_.colliderPose(before.driven_solids_[i]));
  }
  driven_solids_.resize(std::min(driven_solids_.size(), before.driven_solids_.size()));
  time_ = before.time_;
  steps_ = before.steps_;
  even_from_ = before.even_from_;
  even_steps_ = before.even_steps_;
  next_impulse_ = before.next_impulse_;
  const formats::PackageView& now = asset_->package();
  const formats::PackageView& old = before.asset_->package();
  for (std::size_t c = 0; c < now.channels().size(); ++c) {
    for (std::size_t o = 0; o < old.channels().size(); ++o) {
      if (now.text(now.channels()[c].name) != old.text(old.channels()[o].name)) continue;
      held_channels_[c] = before.held_channels_[o];
    }
  }
  driveChannels(time_);
  return true;
}

float Scene::stepSeconds() const {
  const auto& sequence = options_.step_sequence;
  return sequence.empty() ? options_.step_seconds : sequence[steps_ % sequence.size()];
}

void Scene::setStepSeconds(float seconds) {
  if (seconds == options_.step_seconds) return;
  options_.step_seconds = seconds;
  even_from_ = time_;
  even_steps_ = steps_;
}

void Scene::step() {
  const float seconds = stepSeconds();
  while (next_cut_ < cuts_.size() && cuts_[next_cut_].time < time_ + 0.5 * double(seconds)) {
    cut(cuts_[next_cut_++].plane);
  }
  drive();
  world_.step(seconds);
  ++steps_;
  time_ = options_.step_sequence.empty() ? even_from_ + double(steps_ - even_steps_) * double(seconds)
                                         : time_ + double(seconds);
}

}  // namespace sinew::tools

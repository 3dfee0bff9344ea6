// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/error.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>

#include "sinew/runtime/report.h"
#include "tools/bake/bake.h"
#include "tools/core/error.h"
#include "tools/scene/scene_script.h"
#include "tools/study/error_judge.h"
#include "tools/study/explicit_solid.h"
#include "tools/study/peers.h"
#include "tools/study/scripted.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr std::array<std::string_view, kMethodCount> kMethods = {
    "sinew", "report", "xpbd", "stiffness warping", "bullet fem", "bullet fem, implicit", "bullet links"};
constexpr double kSeconds = 1.5;
// Of the work that the reference may take: that of linear elements, which are played three times and more. Beyond, the
// reference is this runtime itself, of the most functions, so iterated and stepped.
constexpr double kLinearWork = 0.1;
constexpr std::uint32_t kSelfIterations = 16, kSelfSteps = 16;

std::uint32_t functionsOf(const Asset& asset) {
  std::uint32_t functions = 0;
  for (const auto& field : asset.package().fields())
    functions = std::max(functions, std::uint32_t(field.function_count));
  return functions;
}

struct Mesh {
  std::shared_ptr<const Asset> asset;
  std::string name;
};

// A method as it is set.
struct Play {
  Method method;
  std::shared_ptr<const Asset> asset;
  std::string knobs;
  std::function<Motion(const MotionBody&, const MotionScene&)> play;
};

// Inputs of every played scene.
struct Plan {
  std::shared_ptr<const Asset> own;
  PackageSolid solid;
  std::vector<ElasticMaterial> materials;
  std::vector<Mesh> meshes;  // of the peers
  std::vector<Play> plays;

  // Of this runtime's packages the one of most functions.
  std::shared_ptr<const Asset> finest() const {
    std::shared_ptr<const Asset> best = own;
    for (const Play& play : plays) {
      if (play.method == Method::sinew && functionsOf(*play.asset) > functionsOf(*best)) best = play.asset;
    }
    return best;
  }
};

std::shared_ptr<const Asset> bakeWith(Recipe recipe, const std::vector<std::pair<std::string, std::string>>& settings) {
  for (const auto& [key, value] : settings) recipe.settings.set(key, value);
  Progress progress(false);
  const BakeResult result = bake(recipe, progress);
  const auto asset = Asset::fromMemory(result.package);
  if (!asset) {
    throw ToolError(ExitCode::system, recipe.source.string(), "the baked package does not load: " + asset.reason(),
                    "This is a fault of sinew: please report it with the file.");
  }
  return *asset;
}

// No other method has bounds on stretch.
std::optional<Recipe> withoutLimits(std::optional<Recipe> recipe) {
  if (!recipe) return recipe;
  recipe->settings.set("clusters.limit", "none");
  for (RecipeCluster& cluster : recipe->clusters) {
    std::erase_if(cluster.settings, [](const auto& setting) { return setting.first == "clusters.limit"; });
  }
  return recipe;
}

bool hasLimits(const formats::PackageView& package) {
  const auto limited = [](const formats::ClusterMechanics& m) { return m.limit != formats::LimitMethod::none; };
  return std::any_of(package.mechanics().begin(), package.mechanics().end(), limited);
}

// Refuses all but fields on tetrahedra.
void requireTetrahedra(const Asset& asset, const std::string& name) {
  if (asset.package().tetrahedra().empty() || asset.package().barycentric().empty()) {
    throw ToolError(ExitCode::bad_input, name, "its surface does not hang on tetrahedra",
                    "Bake it with attachment.method=barycentric.");
  }
  if (asset.package().fields().empty()) {
    throw ToolError(ExitCode::bad_input, name, "it has no fields to move in",
                    "Bake it again without field.functions=0.");
  }
}

bool isFile(std::string_view scene) { return scene.ends_with(".json"); }

MotionScene sceneOf(std::string_view name) {
  MotionScene scene;
  scene.release = name == kReleaseScene;
  scene.seconds = scene.release ? MotionScene::kReleaseSeconds + kSeconds : kSeconds;
  scene.hold = HoldScene::cantilever;
  if (scene.release) return scene;
  if (name == kFeetScene) {
    scene.hold = HoldScene::lean;  // standing, it is held by its lowest tenth
    scene.ground.emplace();
    scene.free = true;
    return scene;
  }
  const std::optional<HoldScene> hold = holdSceneOf(name);
  if (!hold) {
    std::string all;
    for (const std::string_view known : kErrorScenes) all += (all.empty() ? "" : ", ") + std::string(known);
    throw ToolError(ExitCode::usage, "", "no scene is named " + std::string(name), "Scenes: " + all + ".");
  }
  scene.hold = *hold;
  return scene;
}

void markFronts(ErrorStudy& study) {
  const auto beats = [](const ErrorRow& one, const ErrorRow& other) {
    return one.scene == other.scene && !one.lost && !one.slow &&
           ((one.path < other.path && one.milliseconds <= other.milliseconds) ||
            (one.path <= other.path && one.milliseconds < other.milliseconds));
  };
  for (ErrorRow& row : study.rows) {
    if (row.lost || row.slow) continue;
    row.front =
        std::none_of(study.rows.begin(), study.rows.end(), [&](const ErrorRow& other) { return beats(other, row); });
    row.own_front = std::none_of(study.rows.begin(), study.rows.end(), [&](const ErrorRow& other) {
      return other.method == row.method && beats(other, row);
    });
  }
}

std::string counted(std::uint32_t n, const char* what) { return std::to_string(n) + " " + what + (n == 1 ? "" : "s"); }

// Methods of others, and of the report.
void addPeers(const std::optional<Recipe>& recipe, Plan& plan) {
  const auto add = [&](Method method, const Mesh& mesh, const std::string& knobs, auto play) {
    plan.plays.push_back({method, mesh.asset, mesh.name + ", " + knobs, play});
  };
  for (const Mesh& mesh : plan.meshes) {
    for (const std::uint32_t substeps : {5U, 10U, 20U, 40U}) {
      add(Method::xpbd, mesh, counted(substeps, "step"),
          [substeps](const MotionBody& body, const MotionScene& scene) { return playXpbd(body, scene, substeps); });
    }
    for (const auto& [substeps, iterations] : {std::pair{1U, 8U}, {1U, 40U}, {4U, 8U}, {4U, 40U}}) {
      add(Method::warping, mesh, counted(substeps, "step") + ", " + counted(iterations, "iteration"),
          [substeps = substeps, iterations = iterations](const MotionBody& body, const MotionScene& scene) {
            return playStiffnessWarping(body, scene, substeps, iterations);
          });
    }
#if SINEW_WITH_BULLET
    const auto bullet = [&](Method method, BulletKind kind, std::uint32_t substeps, std::uint32_t iterations,
                            const std::string& knobs) {
      add(method, mesh, knobs, [=](const MotionBody& body, const MotionScene& scene) {
        return playBullet(body, scene, kind, substeps, iterations);
      });
    };
    for (const std::uint32_t n : {1U, 4U, 16U})
      bullet(Method::bullet, BulletKind::finite_elements, n, 0, counted(n, "step"));
    for (const std::uint32_t n : {1U, 4U}) {
      bullet(Method::bullet_implicit, BulletKind::implicit_finite_elements, n, 0, counted(n, "step"));
    }
    for (const std::uint32_t n : {1U, 4U, 16U})
      bullet(Method::bullet_links, BulletKind::links, 1, n, counted(n, "iteration"));
#endif
  }
  std::vector<Mesh> clustered;
  const auto addClusters = [&](const std::shared_ptr<const Asset>& asset) {
    clustered.push_back({asset, counted(std::uint32_t(asset->package().clusters().size()), "cluster")});
  };
  if (!recipe) addClusters(plan.own);
  for (const std::string boxes : {"1,1,1", "2,2,2", "4,4,4"}) {
    if (!recipe) break;
    addClusters(bakeWith(*recipe, {{"clusters.grid", boxes}, {"field.functions", "4"}}));
    // A recipe's own clusters take no grid.
    if (!recipe->clusters.empty()) break;
  }
  for (const Mesh& mesh : clustered) {
    for (const std::uint32_t iterations : {1U, 4U}) {
      add(Method::report, mesh, counted(iterations, "iteration"),
          [asset = mesh.asset, iterations](const MotionBody&, const MotionScene& scene) {
            return playSinew(asset, scene, {&reportSolver(), iterations, 1});
          });
    }
  }
}

// Of a recipe, bakes of several numbers of functions and vertices; of a package itself alone.
Plan planOf(const ErrorInput& input, const ErrorOptions& options, std::vector<std::string>& notes,
            const std::function<void(double)>& progress) {
  Plan plan;
  const std::optional<Recipe> recipe = withoutLimits(input.recipe);
  plan.own = recipe ? bakeWith(*recipe, {}) : input.package;
  if (hasLimits(plan.own->package())) {
    notes.emplace_back("the package has bounds on stretch (clusters.limit), which no other method has");
  }
  requireTetrahedra(*plan.own, input.name);
  plan.solid = packageSolid(plan.own->package());
  for (const PieceMaterial& m : materialsOf(plan.own->package())) plan.materials.push_back(m.material);
  const auto addOwn = [&](const std::shared_ptr<const Asset>& asset, const std::string& name) {
    for (const auto& [iterations, substeps] : {std::pair{1U, 1U}, {4U, 1U}, {4U, 4U}}) {
      plan.plays.push_back(
          {Method::sinew, asset, name + ", " + counted(iterations, "iteration") + ", " + counted(substeps, "step"),
           [asset, iterations = iterations, substeps = substeps](const MotionBody&, const MotionScene& scene) {
             return playSinew(asset, scene, {nullptr, iterations, substeps});
           }});
    }
  };
  if (!recipe) {
    addOwn(plan.own, counted(functionsOf(*plan.own), "function"));
  } else {
    for (std::size_t i = 0; i < options.functions.size(); ++i) {
      const std::uint32_t functions = options.functions[i];
      addOwn(functions == recipe->settings.field.functions
                 ? plan.own
                 : bakeWith(*recipe, {{"field.functions", std::to_string(functions)}}),
             counted(functions, "function"));
      progress(double(i + 1) / double(options.functions.size()));
    }
  }
  if (!options.peers) return plan;
  const auto own_vertices = std::uint32_t(plan.solid.rest.size());
  for (const std::uint32_t vertices : options.vertices) {
    if (!recipe || vertices >= own_vertices) continue;
    try {
      const auto asset =
          bakeWith(*recipe, {{"tetrahedra.vertices", std::to_string(vertices)}, {"field.functions", "4"}});
      if (asset->package().visualPositions().size() != plan.own->package().visualPositions().size()) continue;
      requireTetrahedra(*asset, input.name);
      plan.meshes.push_back({asset, std::to_string(asset->package().physicalVertices().size()) + " vertices"});
    } catch (const ToolError& error) {
      notes.push_back("no mesh of " + std::to_string(vertices) + " vertices: " + error.what());
    }
  }
  plan.meshes.push_back({plan.own, std::to_string(own_vertices) + " vertices"});
  addPeers(recipe, plan);
#if !SINEW_WITH_BULLET
  notes.emplace_back("no Bullet: this build has none (Debian: libbullet-dev)");
#endif
  return plan;
}

// Points times steps of a scene's reference, and of the linear elements beside it.
double referenceWork(const MotionBody& body, const MotionScene& scene, const ErrorOptions& options) {
  const auto nothing = [](double) {};
  const auto workOf = [&](bool quadratic, double most) {
    const double work = playSolid(body, scene, {.quadratic = quadratic, .most_work = 0}, nothing).work;
    return work <= most ? work : 0;
  };
  const double linear = workOf(false, kLinearWork * options.reference_work);
  return workOf(true, options.reference_work) + (scene.ground ? 5 : 4) * linear;
}

// One scene: its reference, then all that is planned.
// \param[in,out] work_left of ErrorOptions::page_work
void measureScene(const std::string& name, const Plan& plan, const ErrorOptions& options, double& work_left,
                  ErrorStudy& study, const std::function<void(double)>& progress) {
  const formats::PackageView& package = plan.own->package();
  const bool from_file = isFile(name);
  MotionScene scene = from_file ? scriptedScene(errorScript(name), package) : sceneOf(name);
  const SolidExtent extent = extentOf(plan.solid);
  HeldCase held = from_file ? HeldCase{} : heldCase(plan.solid, package, scene.hold, extent);
  if (scene.free && !from_file) held.gravity = -Vector3d::UnitY();
  if (!scene.free && !from_file) scene.regions = held.regions;
  const auto bodyOf = [&](const formats::PackageView& of) {
    return from_file ? scriptedBody(of, scene) : motionBody(of, scene, plan.materials, extent);
  };
  const MotionBody body = bodyOf(package);
  if (body.rest.empty()) {
    study.notes.push_back(name + ": nothing is held");
    return;
  }
  ErrorScene result;
  result.name = from_file ? scene.file.script->name : name;
  result.seconds = scene.seconds;
  if (held.gravity.norm() > 0) {
    const ReferenceShape rest = referenceShape(plan.solid, plan.materials, held, options.target * study.diagonal);
    scene.gravity = rest.gravity;
    result.gravity = rest.gravity.norm();
  }
  if (from_file) result.gravity = scene.gravity.norm();
  if (scene.ground && !from_file) {
    double low = body.surface.front()[1];
    for (const Vector3d& x : body.surface) low = std::min(low, x[1]);
    const double fall = MotionScene::kFall * (extent.high - extent.low)[1];
    scene.ground->height = low - fall;
    scene.seconds = result.seconds =
        kFrameSeconds * std::ceil((MotionScene::kLandSeconds + std::sqrt(2 * fall / result.gravity)) / kFrameSeconds);
  }
  std::vector<std::uint8_t> counts(body.surface.size(), 0);
  for (std::size_t v = 0; v < counts.size(); ++v) {
    if (!body.probes[v]) continue;
    for (const std::uint32_t corner : body.probes[v]->vertex)
      counts[v] = std::uint8_t(counts[v] | (body.region[corner] < 0 ? 1 : 0));
  }
  std::map<const Asset*, MotionBody> bodies;
  for (const Mesh& mesh : plan.meshes) {
    const MotionBody& other =
        bodies.emplace(mesh.asset.get(), mesh.asset == plan.own ? body : bodyOf(mesh.asset->package())).first->second;
    if (other.rest.empty()) {
      study.notes.push_back(result.name + ": without the mesh of " + mesh.name + ", of which nothing is held");
      continue;
    }
    for (std::size_t v = 0; v < counts.size(); ++v) {
      if (!other.probes[v]) counts[v] = 0;
    }
  }
  const double work = referenceWork(body, scene, options);
  if (work > work_left && !study.scenes.empty()) {
    study.notes.push_back(result.name + ": left out, as its reference would take long; --scene " + name + " plays it");
    return;
  }
  work_left -= work;
  // The reference: quadratic elements on the recipe's own tetrahedra.
  const auto begin = std::chrono::steady_clock::now();
  const auto nothing = [](double) {};
  // Cheap linear tetrahedra show what is not the elements' matter: the length of steps, the law.
  const ExplicitOptions cheap{.quadratic = false, .most_work = kLinearWork * options.reference_work};
  const ExplicitRun linear = playSolid(body, scene, cheap, nothing);
  const bool elements = linear.work <= cheap.most_work;
  ExplicitRun longer, other_law, own_law;
  if (elements) {
    longer = playSolid(body, scene, {.quadratic = false, .step_share = 0.9}, nothing);
    other_law = playSolid(body, scene, {.law = ElasticLaw::neo_hookean, .quadratic = false}, nothing);
    own_law = playSolid(body, scene, {.law = ElasticLaw::determinant, .quadratic = false}, nothing);
  }
  std::optional<ExplicitRun> firmer;
  if (scene.ground && elements) {
    firmer = playSolid(body, scene, {.quadratic = false, .penalty = 2 * ExplicitOptions{}.penalty}, nothing);
  }
  progress(0.1);
  ExplicitRun reference =
      playSolid(body, scene, {.most_work = options.reference_work}, [&](double of) { progress(0.1 + 0.2 * of); });
  const bool affordable = elements && reference.work <= options.reference_work;
  if (!affordable) reference = linear;
  std::optional<ExplicitRun> coarser;
  if (affordable) {
    ExplicitRun fine = playSolid(refined(body), scene, {.most_work = options.refine_work},
                                 [&](double of) { progress(0.3 + 0.2 * of); });
    if (fine.work <= options.refine_work) coarser = std::exchange(reference, std::move(fine));
  }
  if (!elements) {
    const Asset& finest = *plan.finest();
    const SinewPlay play{nullptr, kSelfIterations, kSelfSteps};
    reference = {};
    reference.motion = playSinew(plan.finest(), scene, play);
    reference.step_seconds = kFrameSeconds / play.substeps;
    result.self = counted(functionsOf(finest), "function") + ", " + counted(play.iterations, "iteration") + ", " +
                  counted(play.substeps, "step");
  }
  if (!reference.motion.finite) {
    study.notes.push_back(name + ": the reference is lost");
    return;
  }
  const ErrorJudge judge(scene, body, counts, reference.motion, package, study.diagonal);
  result.compared = judge.compared();
  result.tetrahedra = reference.tetrahedra;
  result.step_seconds = reference.step_seconds;
  result.rms = judge.rms();
  result.largest = judge.largest();
  result.frequency = judge.frequency();
  result.turned = judge.turned();
  result.shape = judge.shape();
  if (affordable) result.linear = judge.apart(reference.motion, linear.motion);
  if (elements) {
    result.shorter = judge.apart(linear.motion, longer.motion);
    result.neo_hookean = judge.apart(linear.motion, other_law.motion);
    result.own_law = judge.apart(linear.motion, own_law.motion);
  }
  if (coarser) result.refined = judge.apart(reference.motion, coarser->motion);
  if (firmer) result.penalty = judge.apart(linear.motion, firmer->motion);
  result.reference_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const std::string result_name = result.name;
  study.scenes.push_back(std::move(result));
  progress(0.5);
  const bool muscles = !body.fibres.empty(), tethers = !body.tethers.empty();
  if (options.peers && (muscles || tethers)) {
    study.notes.push_back(result_name +
                          (muscles ? ": without XPBD, stiffness warping and Bullet: they are given no muscles here"
                                   : ": without Bullet, which is given no springs here for what pins hold in part"));
  }
#if SINEW_WITH_BULLET
  if (scene.ground && options.peers) {
    study.notes.push_back(
        name +
        ": without Bullet's implicit elements, which do not keep Coulomb's law on its ground (a block "
        "slides at a tenth of the friction) nor the sag of a block that lies there (a quarter less)");
  }
#endif
  for (std::size_t i = 0; i < plan.plays.size(); ++i) {
    const Play& play = plan.plays[i];
    if (scene.ground && play.method == Method::bullet_implicit) continue;
    const bool others = play.method != Method::sinew && play.method != Method::report;
    const bool deforms = play.method == Method::xpbd || play.method == Method::warping;
    if (others && (muscles || (tethers && !deforms))) continue;
    MotionScene timed = scene;
    timed.slowest_seconds = 1e-3 * options.slowest_ms;
    const auto at = bodies.find(play.asset.get());
    const MotionBody& played = at != bodies.end() ? at->second : body;
    if (played.rest.empty()) continue;
    Motion motion = play.play(played, timed);
    ErrorRow row;
    row.scene = std::uint32_t(study.scenes.size() - 1);
    row.method = play.method;
    row.knobs = play.knobs;
    row.vertices = std::uint32_t(play.asset->package().physicalVertices().size());
    row.milliseconds = 1e3 * motion.cpu_seconds / std::max<double>(1, double(motion.frames.size()));
    row.slow = motion.slow;
    if (!row.slow) judge.judge(std::move(motion), row);
    study.rows.push_back(std::move(row));
    progress(0.5 + 0.5 * double(i + 1) / double(plan.plays.size()));
  }
}

}  // namespace

std::string_view nameOf(Method method) { return kMethods[std::size_t(method)]; }

void requireErrorScene(const std::string& name) {
  if (isFile(name)) {
    errorScript(name);
  } else {
    sceneOf(name);
  }
}

ErrorStudy measureError(const ErrorInput& input, const ErrorOptions& options,
                        const std::function<void(double)>& progress) {
  ErrorStudy study;
  study.input = input.name;
  for (const std::string& name : options.scenes) requireErrorScene(name);
  const Plan plan = planOf(input, options, study.notes, [&](double part) { progress(0.1 * part); });
  study.asset = plan.own;
  study.diagonal = plan.solid.diagonal;
  study.vertices = std::uint32_t(plan.solid.rest.size());
  study.tetrahedra = std::uint32_t(plan.solid.tetrahedra.size());
  study.material = plan.materials.front();
  std::vector<std::string> names = options.scenes;
  if (names.empty()) {
    names.assign(kDefaultErrorScenes.begin(), kDefaultErrorScenes.end());
    if (!plan.own->package().pinSets().empty()) names.emplace_back(nameOf(HoldScene::pins));
  }
  double work_left = options.scenes.empty() ? options.page_work : std::numeric_limits<double>::infinity();
  for (std::size_t s = 0; s < names.size(); ++s) {
    measureScene(names[s], plan, options, work_left, study,
                 [&](double part) { progress(0.1 + 0.9 * (double(s) + part) / double(names.size())); });
  }
  markFronts(study);
  return study;
}

const ErrorRow* bestWithin(const ErrorStudy& study, std::uint32_t scene, std::optional<Method> method,
                           double milliseconds) {
  const ErrorRow* best = nullptr;
  for (const ErrorRow& row : study.rows) {
    if (row.scene != scene || (method && row.method != *method) || row.lost || row.slow) continue;
    if (row.milliseconds <= milliseconds && (best == nullptr || row.path < best->path)) best = &row;
  }
  return best;
}

const ErrorRow* bestOfOthers(const ErrorStudy& study, std::uint32_t scene, double milliseconds) {
  const ErrorRow* best = nullptr;
  for (std::size_t m = 0; m < kMethodCount; ++m) {
    const ErrorRow* row = Method(m) == Method::sinew ? nullptr : bestWithin(study, scene, Method(m), milliseconds);
    if (row != nullptr && (best == nullptr || row->path < best->path)) best = row;
  }
  return best;
}

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/error.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <numbers>

#include "sinew/runtime/report.h"
#include "tools/bake/bake.h"
#include "tools/core/error.h"
#include "tools/scene/scene_script.h"
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
constexpr double kEndSeconds = 0.25;
constexpr double kLost = 10;  // diagonals
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

// Where the reference went and what counts of it.
class Judge {
 public:
  Judge(const MotionScene& scene, const MotionBody& body, const std::vector<std::uint8_t>& counts, Motion reference,
        const formats::PackageView& package, double diagonal)
      : body_(body),
        reference_(std::move(reference)),
        first_(std::size_t(std::lround(scene.comparedFrom() / kFrameSeconds))),
        diagonal_(diagonal) {
    for (std::uint32_t v = 0; v < body.surface.size(); ++v) {
      if (counts[v] == 0) continue;
      vertices_.push_back(v);
      area_ += body.areas[v];
    }
    if (scene.free) {
      lying_ = reference_.frames;
      while (scene.ground && first_ + 1 < lying_.size() && lowest(lying_[first_]) > scene.ground->height) ++first_;
      reference_ = withoutRigid(std::move(reference_));
    }
    double square = 0, weight = 0;
    for (std::size_t frame = first_; frame < reference_.frames.size(); ++frame) {
      double here = 0;
      for (const std::uint32_t v : vertices_) {
        const double way = (reference_.frames[frame][v].cast<double>() - body.surface[v]).norm();
        here += body.areas[v] * way * way;
        if (way > largest_) {
          largest_ = way;
          widest_ = frame;
        }
      }
      square += here;
      weight += area_;
    }
    rms_ = std::sqrt(square / weight);
    end_ = meanOfEnd(reference_);
    double end = 0;
    for (const std::uint32_t v : vertices_) end += body.areas[v] * (end_[v] - body.surface[v]).squaredNorm();
    end_rms_ = std::sqrt(end / area_);
    setTriangles(package);
    if (scene.release) {
      before_ = reference_.frames[first_ - 1];
      swing_ = swingOf(reference_);
    }
  }

  double rms() const { return rms_ / diagonal_; }
  double largest() const { return largest_ / diagonal_; }
  std::optional<double> turned() const {
    return lying_.empty() ? std::nullopt : std::optional(degreesOf(rigidOf(lying_.back()).linear()));
  }
  std::uint32_t compared() const { return std::uint32_t(vertices_.size()); }
  const std::vector<Vector3f>& shape() const { return reference_.frames[widest_]; }
  std::optional<double> frequency() const { return swing_ ? std::optional(swing_->frequency) : std::nullopt; }
  std::vector<double> areas() const {
    std::vector<double> result(body_.surface.size(), 0);
    for (const std::uint32_t v : vertices_) result[v] = body_.areas[v];
    return result;
  }

  void judge(Motion motion, ErrorRow& row) const {
    row.lost = !motion.finite || motion.frames.size() < reference_.frames.size();
    if (row.lost) return;
    if (!lying_.empty()) {
      row.astray = apart(motion.frames, lying_);
      row.lost = !(*row.astray * rms_ < kLost * diagonal_);
      if (row.lost) return;
      row.turned = degreesOf(rigidOf(lying_.back()).linear().transpose() * rigidOf(motion.frames.back()).linear());
      motion = withoutRigid(std::move(motion));
    }
    row.shape = motion.frames[widest_];
    double square = 0, weight = 0, furthest = 0;
    for (std::size_t frame = first_; frame < reference_.frames.size(); ++frame) {
      for (const std::uint32_t v : vertices_) {
        const double off = double((motion.frames[frame][v] - reference_.frames[frame][v]).norm());
        square += body_.areas[v] * off * off;
        furthest = std::max(furthest, off);
      }
      weight += area_;
    }
    row.lost = !(furthest < kLost * diagonal_);
    row.path = std::sqrt(square / weight) / rms_;
    row.largest = furthest / largest_;
    const std::vector<Vector3d> end = meanOfEnd(motion);
    double off = 0;
    for (const std::uint32_t v : vertices_) off += body_.areas[v] * (end[v] - end_[v]).squaredNorm();
    // A body let go swings about its rest: its end is measured by how far it went.
    row.end = std::sqrt(off / area_) / std::max(end_rms_, swing_ ? rms_ : 0);
    if (!triangles_.empty()) {
      for (std::size_t frame = first_; frame < reference_.frames.size(); ++frame) {
        row.volume = std::max(row.volume,
                              std::abs(volumeOf(motion.frames[frame]) - volumeOf(reference_.frames[frame])) / volume_);
      }
    }
    if (!swing_) return;
    if (const std::optional<Swing> swing = swingOf(motion)) {
      row.frequency = swing->frequency / swing_->frequency;
      row.decay = swing->decay / swing_->decay;
    }
  }

  // Judged by this reference's means: rms difference of two paths.
  double apart(const Motion& one, const Motion& other) const {
    if (lying_.empty()) return apart(one.frames, other.frames);
    return apart(withoutRigid(one).frames, withoutRigid(other).frames);
  }

 private:
  struct Swing {
    double frequency, decay;  // Hz, 1/s
  };

  using Frames = std::vector<std::vector<Vector3f>>;

  double apart(const Frames& one, const Frames& other) const {
    double square = 0, weight = 0;
    for (std::size_t frame = first_; frame < std::min(one.size(), other.size()); ++frame) {
      for (const std::uint32_t v : vertices_) {
        square += body_.areas[v] * double((one[frame][v] - other[frame][v]).squaredNorm());
      }
      weight += area_;
    }
    return std::sqrt(square / weight) / rms_;
  }

  static double degreesOf(const Eigen::Matrix3d& turn) {
    return Eigen::AngleAxisd(turn).angle() * 180 / std::numbers::pi;
  }

  float lowest(const std::vector<Vector3f>& frame) const {
    float low = frame[vertices_.front()][1];
    for (const std::uint32_t v : vertices_) low = std::min(low, frame[v][1]);
    return low;
  }

  // The rigid motion that takes the rest shape to a frame and leaves the least, by area (Kabsch 1976).
  Eigen::Isometry3d rigidOf(const std::vector<Vector3f>& frame) const {
    Vector3d rest_centre = Vector3d::Zero(), centre = Vector3d::Zero();
    for (const std::uint32_t v : vertices_) {
      rest_centre += body_.areas[v] / area_ * body_.surface[v];
      centre += body_.areas[v] / area_ * frame[v].cast<double>();
    }
    Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
    for (const std::uint32_t v : vertices_) {
      moment += body_.areas[v] * (frame[v].cast<double>() - centre) * (body_.surface[v] - rest_centre).transpose();
    }
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(moment, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Vector3d sign = Vector3d::Ones();
    sign[2] = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
    Eigen::Isometry3d rigid = Eigen::Isometry3d::Identity();
    rigid.linear() = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
    rigid.translation() = centre - rigid.linear() * rest_centre;
    return rigid;
  }

  Motion withoutRigid(Motion motion) const {
    for (std::vector<Vector3f>& frame : motion.frames) {
      const Eigen::Isometry3d back = rigidOf(frame).inverse();
      for (Vector3f& x : frame) x = (back * x.cast<double>()).cast<float>();
    }
    return motion;
  }

  std::vector<Vector3d> meanOfEnd(const Motion& motion) const {
    const auto frames = std::size_t(std::lround(kEndSeconds / kFrameSeconds));
    std::vector<Vector3d> mean(body_.surface.size(), Vector3d::Zero());
    for (std::size_t frame = motion.frames.size() - frames; frame < motion.frames.size(); ++frame) {
      for (const std::uint32_t v : vertices_) mean[v] += motion.frames[frame][v].cast<double>() / double(frames);
    }
    return mean;
  }

  // Part of the way that it had when it was let go, by its crossings of zero and its extremes between them.
  std::optional<Swing> swingOf(const Motion& motion) const {
    std::vector<double> s;
    double norm = 0;
    for (const std::uint32_t v : vertices_)
      norm += body_.areas[v] * (before_[v].cast<double>() - body_.surface[v]).squaredNorm();
    for (std::size_t frame = first_; frame < motion.frames.size(); ++frame) {
      double sum = 0;
      for (const std::uint32_t v : vertices_) {
        sum += body_.areas[v] * (motion.frames[frame][v].cast<double>() - body_.surface[v])
                                    .dot(before_[v].cast<double>() - body_.surface[v]);
      }
      s.push_back(sum / norm);
    }
    std::vector<double> crossings;
    std::vector<std::pair<double, double>> extremes;  // time, log of the size
    double most = 0, when = 0;
    for (std::size_t i = 1; i < s.size(); ++i) {
      if (std::abs(s[i]) > most) {
        most = std::abs(s[i]);
        when = double(i);
      }
      if ((s[i - 1] > 0) == (s[i] > 0)) continue;
      crossings.push_back(double(i) - s[i] / (s[i] - s[i - 1]));
      if (crossings.size() > 1 && most > 1e-3) extremes.emplace_back(when * kFrameSeconds, std::log(most));
      most = 0;
    }
    if (crossings.size() < 3 || extremes.size() < 2) return {};
    const double halves = double(crossings.size() - 1);
    const double time = (crossings.back() - crossings.front()) * kFrameSeconds;
    double t = 0, y = 0, tt = 0, ty = 0;
    for (const auto& [at, size] : extremes) {
      t += at, y += size, tt += at * at, ty += at * size;
    }
    const auto n = double(extremes.size());
    return Swing{0.5 * halves / time, -(n * ty - t * y) / (n * tt - t * t)};
  }

  void setTriangles(const formats::PackageView& package) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, int> open;
    std::map<std::array<float, 3>, std::uint32_t> places;  // vertices that were split at seams are one
    const auto place = [&](std::uint32_t v) {
      return places.try_emplace(package.visualPositions()[v], v).first->second;
    };
    for (const auto& c : package.visualTriangles()) {
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t a = place(c[k]), b = place(c[(k + 1) % 3]);
        open[std::minmax(a, b)] += a < b ? 1 : -1;
      }
    }
    if (std::any_of(open.begin(), open.end(), [](const auto& edge) { return edge.second != 0; })) return;
    for (const auto& c : package.visualTriangles()) triangles_.push_back({c[0], c[1], c[2]});
    std::vector<Vector3f> rest;
    for (const Vector3d& x : body_.surface) rest.push_back(x.cast<float>());
    volume_ = volumeOf(rest);
    if (!(volume_ > 0)) triangles_.clear();
  }
  double volumeOf(const std::vector<Vector3f>& x) const {
    double six = 0;
    for (const auto& c : triangles_) {
      six += x[c[0]].cast<double>().dot(x[c[1]].cast<double>().cross(x[c[2]].cast<double>()));
    }
    return six / 6;
  }

  const MotionBody& body_;
  Motion reference_;
  std::size_t first_, widest_ = 0;
  double diagonal_;
  std::vector<std::uint32_t> vertices_;
  double area_ = 0, rms_ = 0, largest_ = 0, end_rms_ = 0, volume_ = 0;
  std::vector<Vector3d> end_;
  std::vector<Vector3f> before_;
  Frames lying_;  // of what is not held: the reference as it lies
  std::vector<std::array<std::uint32_t, 3>> triangles_;
  std::optional<Swing> swing_;
};

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
  const Judge judge(scene, body, counts, reference.motion, package, study.diagonal);
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

nlohmann::ordered_json errorJson(const ErrorStudy& study) {
  nlohmann::ordered_json json = {{"study", "error"},
                                 {"input", study.input},
                                 {"material", {{"young", study.material.young}, {"poisson", study.material.poisson}}},
                                 {"diagonal", study.diagonal},
                                 {"vertices", study.vertices},
                                 {"tetrahedra", study.tetrahedra},
                                 {"notes", study.notes}};
  json["scenes"] = nlohmann::ordered_json::array();
  for (std::uint32_t s = 0; s < study.scenes.size(); ++s) {
    const ErrorScene& scene = study.scenes[s];
    nlohmann::ordered_json one = {
        {"name", scene.name},
        {"gravity", scene.gravity},
        {"seconds", scene.seconds},
        {"compared_vertices", scene.compared},
        {"reference",
         {{"tetrahedra", scene.tetrahedra},
          {"step_seconds", scene.step_seconds},
          {"seconds", scene.reference_seconds},
          {"rms_displacement", scene.rms},
          {"largest_displacement", scene.largest},
          {"quadratic", scene.linear.has_value()},
          {"self", scene.self.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(scene.self)},
          {"from_linear", scene.linear ? nlohmann::ordered_json(*scene.linear) : nullptr},
          {"change_refined", scene.refined ? nlohmann::ordered_json(*scene.refined) : nullptr},
          {"change_shorter_steps", scene.shorter},
          {"change_neo_hookean", scene.neo_hookean},
          {"change_own_law", scene.own_law},
          {"turned_deg", scene.turned ? nlohmann::ordered_json(*scene.turned) : nullptr},
          {"change_firmer_ground", scene.penalty ? nlohmann::ordered_json(*scene.penalty) : nullptr},
          {"frequency_hz", scene.frequency ? nlohmann::ordered_json(*scene.frequency) : nullptr}}}};
    one["results"] = nlohmann::ordered_json::array();
    for (const ErrorRow& row : study.rows) {
      if (row.scene != s) continue;
      nlohmann::ordered_json r = {{"method", nameOf(row.method)},
                                  {"knobs", row.knobs},
                                  {"vertices", row.vertices},
                                  {"milliseconds_per_frame", row.milliseconds},
                                  {"lost", row.lost},
                                  {"slow", row.slow}};
      if (!row.lost && !row.slow) {
        r["path"] = row.path;
        r["end"] = row.end;
        r["largest"] = row.largest;
        r["volume"] = row.volume;
        if (row.frequency) r["frequency_ratio"] = *row.frequency;
        if (row.decay) r["decay_ratio"] = *row.decay;
        if (row.astray) r["astray"] = *row.astray;
        if (row.turned) r["turned_deg"] = *row.turned;
        r["front"] = row.front;
        r["own_front"] = row.own_front;
      }
      one["results"].push_back(std::move(r));
    }
    json["scenes"].push_back(std::move(one));
  }
  return json;
}

std::string errorText(const ErrorStudy& study) {
  std::array<char, 512> line{};
  std::string text;
  const auto print = [&](const char* format, auto... values) {
    std::snprintf(line.data(), line.size(), format, values...);
    text += line.data();
  };
  print("%s: %u physical vertices, %u tetrahedra, E %.3g Pa, nu %.2g\n", study.input.c_str(), study.vertices,
        study.tetrahedra, study.material.young, study.material.poisson);
  for (std::uint32_t s = 0; s < study.scenes.size(); ++s) {
    const ErrorScene& scene = study.scenes[s];
    print("\n%s: reference %u tetrahedra, %.2g ms steps, moved %.2f %% of the diagonal (rms). ", scene.name.c_str(),
          scene.tetrahedra, 1e3 * scene.step_seconds, 100 * scene.rms);
    if (!scene.self.empty()) {
      print("ITSELF (%s): too large for finite elements; ", scene.self.c_str());
    } else if (scene.linear) {
      print("Quadratic; linear elements are off by %.0f %%, ", 100 * *scene.linear);
    } else {
      print("LINEAR elements, too stiff: too large for quadratic ones; ");
    }
    if (scene.self.empty()) {
      if (scene.refined) print("each cut into eight changed them by %.2g %%, ", 100 * *scene.refined);
      print("half the steps change %.2g %%, the neo-Hookean law %.1f %%, Sinew's own %.1f %%", 100 * scene.shorter,
            100 * scene.neo_hookean, 100 * scene.own_law);
    }
    text += "\n";
    if (scene.penalty) print("  a ground twice as firm changes %.2g %%\n", 100 * *scene.penalty);
    if (scene.turned) {
      print("  astray: path with the rigid motion; turned: degrees, against the reference at its end, which has %.0f\n",
            *scene.turned);
    }
    if (scene.lawMatters()) text += "  strains are so large that the law of elasticity matters: compare with care\n";
    print("  %-20s  %-38s  %8s  %7s  %7s  %7s  %7s  %6s  %6s\n", "method", "knobs", "ms/frame", "path, %", "end, %",
          "most, %", "vol., %", "freq.", "decay");
    for (const ErrorRow& row : study.rows) {
      if (row.scene != s) continue;
      print("%c %-20s  %-38s  %8.3f",
            row.front       ? '*'
            : row.own_front ? '.'
                            : ' ',
            nameOf(row.method).data(), row.knobs.c_str(), row.milliseconds);
      if (row.lost || row.slow) {
        text += row.slow ? "  too slow\n" : "  lost\n";
        continue;
      }
      print("  %7.1f  %7.1f  %7.1f  %7.2f", 100 * row.path, 100 * row.end, 100 * row.largest, 100 * row.volume);
      if (row.frequency) print("  %6.3f  %6.2f", *row.frequency, *row.decay);
      if (row.astray) print("  astray %6.1f, turned %3.0f", 100 * *row.astray, *row.turned);
      text += "\n";
    }
  }
  for (const std::string& note : study.notes) text += "note: " + note + "\n";
  return text +
         "\nErrors are shares of the reference's rms displacement (not moving: 100). path: over all frames. end: mean "
         "shape of the last quarter of a second.\n* nothing is nearer for less time; . nothing of this method is\n";
}

}  // namespace sinew::tools

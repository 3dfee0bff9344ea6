// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/evaluation.h"

#include <exception>
#include <utility>

#include "tools/bake/check_source.h"
#include "tools/import/import.h"

namespace sinew::tools {

FileVersion FileVersion::of(const std::filesystem::path& file) {
  std::error_code error;
  FileVersion version;
  version.time = std::filesystem::last_write_time(file, error);
  if (error) return {};
  version.size = std::filesystem::file_size(file, error);
  return error ? FileVersion{} : version;
}

Evaluation::Evaluation() : thread_([this] { run(); }) {}

Evaluation::~Evaluation() {
  {
    const std::scoped_lock lock(mutex_);
    end_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

void Evaluation::submit(const std::filesystem::path& recipe, const std::string& text) {
  {
    const std::scoped_lock lock(mutex_);
    next_ = Job{recipe, text};
  }
  wake_.notify_all();
}

std::shared_ptr<const Evaluated> Evaluation::poll() {
  const std::scoped_lock lock(mutex_);
  return std::exchange(result_, nullptr);
}

bool Evaluation::isBusy() const {
  const std::scoped_lock lock(mutex_);
  return busy_ || next_.has_value() || result_ != nullptr;
}

void Evaluation::run() {
  std::unique_lock lock(mutex_);
  while (true) {
    wake_.wait(lock, [this] { return end_ || next_.has_value(); });
    if (end_) return;
    const Job job = *std::exchange(next_, std::nullopt);
    busy_ = true;
    lock.unlock();
    auto result = std::make_shared<const Evaluated>(evaluate(job));
    lock.lock();
    busy_ = false;
    result_ = std::move(result);
  }
}

Evaluated Evaluation::evaluate(const Job& job) {
  Evaluated result;
  result.text = job.text;
  try {
    result.recipe = parseRecipe(job.text, job.recipe);
    const Recipe& recipe = result.recipe;
    result.source = read(recipe);
    result.weights = evaluateRecipe(recipe, result.source->mesh, result.source->topology, result.source->cluster_meshes,
                                    result.findings);
    const std::vector<Finding> pins = judgePins(recipe, result.weights);
    result.findings.insert(result.findings.end(), pins.begin(), pins.end());
  } catch (const std::exception& error) {
    result.error = error.what();
    result.weights = {};
  }
  return result;
}

std::shared_ptr<const StudioSource> Evaluation::read(const Recipe& recipe) {
  std::string key = recipe.source.string();
  Settings settings = recipe.settings;
  for (const Settings::Declaration& d : Settings::declarations(settings)) {
    if (d.key.starts_with("import.")) key += "\n" + valueText(settings, d);
  }
  const FileVersion version = FileVersion::of(recipe.source);
  if (source_ != nullptr && key == source_key_ && version == source_version_) return source_;
  auto source = std::make_shared<StudioSource>();
  Progress progress(false);
  source->mesh = importVisualMesh(recipe.source, recipe.settings.import, progress);
  source->cluster_meshes = takeClusterMeshes(source->mesh);
  source->topology = analyzeTopology(source->mesh);
  source->surface = std::make_unique<Surface>(source->mesh);
  source->plane = source->surface->symmetryPlane();
  source->visual.resize(source->mesh.welded_positions.size());
  for (std::uint32_t v = 0; v < source->mesh.welded.size(); ++v) source->visual[source->mesh.welded[v]].push_back(v);
  CheckOptions options;
  options.join_distance = recipe.settings.tetrahedra.join_distance;
  source->findings = checkSource(source->mesh, source->topology, options);
  source_ = source;
  source_key_ = key;
  source_version_ = version;
  return source_;
}

}  // namespace sinew::tools

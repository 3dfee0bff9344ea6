// SPDX-License-Identifier: GPL-3.0-or-later
//
// Evaluation of a recipe on its source, in a thread of its own.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "tools/author/cluster_mesh.h"
#include "tools/author/surface.h"
#include "tools/bake/authored.h"
#include "tools/core/finding.h"
#include "tools/import/topology.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// A source as it is painted on. Never changes; may be read by any thread.
struct StudioSource {
  VisualMesh mesh;
  std::vector<ClusterMesh> cluster_meshes;
  Topology topology;
  std::unique_ptr<Surface> surface;
  std::vector<std::vector<std::uint32_t>> visual;  ///< visual vertices of each welded point
  std::optional<MirrorPlane> plane;                ///< of symmetry; none: there is none
  std::vector<Finding> findings;                   ///< of import and of the doctor
};

/// Reads a file's time and size; two that differ are two versions of it.
struct FileVersion {
  std::filesystem::file_time_type time{};
  std::uintmax_t size = 0;
  static FileVersion of(const std::filesystem::path& file);
  bool operator==(const FileVersion&) const = default;
};

/// A recipe evaluated.
struct Evaluated {
  std::shared_ptr<const StudioSource> source;  ///< null where it could not be read
  Recipe recipe;                               ///< whose weights these are
  AuthoredWeights weights;
  std::vector<Finding> findings;  ///< of the recipe
  std::string error;              ///< why there are no weights; empty: there are
  std::string text;               ///< the recipe's
};

/// Evaluates the newest recipe it is given; sources are read once.
class Evaluation {
 public:
  Evaluation();
  ~Evaluation();
  Evaluation(const Evaluation&) = delete;
  Evaluation& operator=(const Evaluation&) = delete;

  /// Evaluates a recipe's text, after what is running; one that waits is dropped.
  void submit(const std::filesystem::path& recipe, const std::string& text);
  /// A result that has come since the last call.
  std::shared_ptr<const Evaluated> poll();
  bool isBusy() const;

 private:
  struct Job {
    std::filesystem::path recipe;
    std::string text;
  };
  void run();
  Evaluated evaluate(const Job& job);
  std::shared_ptr<const StudioSource> read(const Recipe& recipe);

  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::optional<Job> next_;
  std::shared_ptr<const Evaluated> result_;
  bool busy_ = false, end_ = false;
  // Of the thread alone.
  std::shared_ptr<const StudioSource> source_;
  std::string source_key_;
  FileVersion source_version_;
  std::thread thread_;
};

}  // namespace sinew::tools

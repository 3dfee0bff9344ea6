// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/film.h"

#include <system_error>
#include <vector>

#include "tools/core/atomic_file.h"
#include "tools/core/error.h"
#include "tools/core/text.h"
#include "tools/import/output_files.h"

namespace sinew::tools {

void Film::start(const FilmOptions& options, const std::string& file) {
  cancel();
  if (!file.ends_with(".mp4")) throw ToolError(ExitCode::usage, file, "is no name of a video", "Let it end in .mp4.");
  requireOutput(Output::picture_or_video, file, {options.package});
  if (!folder_) folder_.emplace();
  // A link: the next bake removes the package of the one before.
  const std::filesystem::path linked = folder_->path() / "film.sinew", scene = folder_->path() / "film.json";
  std::error_code error;
  std::filesystem::remove(linked, error);
  std::filesystem::create_hard_link(options.package, linked, error);
  if (options.scene.empty()) writeFileAtomically(scene, options.scene_text);
  std::vector<std::string> words = {"render",
                                    error ? options.package : linked.string(),
                                    "-o",
                                    file,
                                    "--scene",
                                    options.scene.empty() ? scene.string() : options.scene,
                                    "--progress-lines"};
  if (!options.camera.empty()) words.insert(words.end(), {"--camera", options.camera});
  if (options.seconds > 0) words.insert(words.end(), {"--seconds", exactText(options.seconds)});
  if (options.step > 0) words.insert(words.end(), {"--step", exactText(options.step)});
  if (options.turntable) words.emplace_back("--turntable");
  file_ = file;
  failed_ = false;
  if (!child_.start(words, "the video", "Memory may have run out: close other programs."))
    throw ToolError(ExitCode::system, file, child_.error(), "");
}

std::string Film::poll() {
  const ChildJob::Ended ended = child_.poll();
  failed_ = ended == ChildJob::Ended::failed || (failed_ && ended == ChildJob::Ended::no);
  return ended == ChildJob::Ended::no       ? ""
         : ended == ChildJob::Ended::failed ? "no video: " + child_.error()
                                            : "wrote " + file_;
}

}  // namespace sinew::tools

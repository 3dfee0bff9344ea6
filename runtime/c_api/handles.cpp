// SPDX-License-Identifier: MIT
#include "runtime/c_api/handles.h"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <new>
#include <utility>

#include "sinew/formats/version.h"

namespace sinew::handles {
namespace {

thread_local char last_error[256] = "";
// Whether a world has told its log of an error since takeToldStatus(), and of which.
thread_local bool told_error = false, told_out_of_memory = false;

}  // namespace

sinew_status tellFailure(sinew_status status, std::string_view reason) {
  const std::size_t length = std::min(reason.size(), sizeof last_error - 1);
  std::memcpy(last_error, reason.data(), length);
  last_error[length] = '\0';
  return status;
}

sinew_status failNull(const char* call) {
  char line[128];
  std::snprintf(line, sizeof line, "%s: a null pointer, or a struct that its _init function has not filled", call);
  return tellFailure(SINEW_ERROR_ARGUMENT, line);
}

void noteError(std::string_view line) {
  told_error = true;
  told_out_of_memory = line.ends_with(": out of memory");
  tellFailure(SINEW_ERROR_ARGUMENT, line);
}

sinew_status takeToldStatus() {
  if (!std::exchange(told_error, false)) return SINEW_OK;
  return told_out_of_memory ? SINEW_ERROR_MEMORY : SINEW_ERROR_ARGUMENT;
}

sinew_status guarded(const char* call, const Callable& work) noexcept {
  char line[128];
  try {
    return work();
  } catch (const std::bad_alloc&) {
    std::snprintf(line, sizeof line, "%s: out of memory", call);
    return tellFailure(SINEW_ERROR_MEMORY, line);
  } catch (...) {
    std::snprintf(line, sizeof line, "%s: a callback threw an exception", call);
    return tellFailure(SINEW_ERROR_ARGUMENT, line);
  }
}

sinew_status runOnWorld(const char* call, const sinew_world* world, bool all_given, const WorldWork& work,
                        BodyId body) noexcept {
  if (world == nullptr || !all_given) return failNull(call);
  const sinew_status status = guarded(call, [&] { return work.run(work.work, worldOf(world), body); });
  const sinew_status told = takeToldStatus();
  return status != SINEW_OK ? status : told;
}

sinew_status runOnBody(const char* call, const sinew_world* world, BodyId body, bool all_given,
                       const WorldWork& work) noexcept {
  if (world == nullptr || !all_given) return failNull(call);
  if (!worldOf(world).contains(body)) {
    if (const sinew_status told = takeToldStatus(); told != SINEW_OK) return told;
    char line[128];
    std::snprintf(line, sizeof line, "%s: there is no body %u in this world", call, body.value);
    return tellFailure(SINEW_ERROR_ARGUMENT, line);
  }
  return runOnWorld(call, world, true, work, body);
}

}  // namespace sinew::handles

extern "C" {

uint32_t sinew_c_api_version(void) { return SINEW_C_API_VERSION; }

const char* sinew_version(void) { return sinew::formats::kSoftwareVersion; }

const char* sinew_last_error(void) { return sinew::handles::last_error; }

}  // extern "C"

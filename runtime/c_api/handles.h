// SPDX-License-Identifier: MIT
//
// What libraries beside the runtime need to add functions to its C interface.
#pragma once

#include <memory>
#include <new>
#include <string>
#include <string_view>

#include "sinew/c_api.h"
#include "sinew/runtime/export.h"
#include "sinew/runtime/world.h"

namespace sinew::handles {

/// \param world not null.
SINEW_API World& worldOf(sinew_world* world);
/// The caller's to release. Throws std::bad_alloc.
SINEW_API sinew_asset* handleOf(std::shared_ptr<const Asset> asset);
/// \param asset not null.
std::shared_ptr<const Asset> assetOf(const sinew_asset* asset);
/// What sinew_last_error() says from now on. \return the status.
SINEW_API sinew_status tellFailure(sinew_status status, std::string_view reason);
/// Status of what worlds have told their logs in this thread since this was asked last; sinew_last_error() says what.
SINEW_API sinew_status takeToldStatus();

/// Runs work(world) where all is given. \return what it returns, or what the world told its log.
template <class Work>
sinew_status onWorld(const char* call, const sinew_world* world, bool all_given, const Work& work) noexcept {
  try {
    if (world == nullptr || !all_given)
      return tellFailure(SINEW_ERROR_ARGUMENT, std::string(call) + ": a null pointer");
    const sinew_status status = work(worldOf(const_cast<sinew_world*>(world)));
    const sinew_status told = takeToldStatus();
    return status != SINEW_OK ? status : told;
  } catch (const std::bad_alloc&) {
    return tellFailure(SINEW_ERROR_MEMORY, "out of memory");
  } catch (...) {
    return tellFailure(SINEW_ERROR_ARGUMENT, "a callback threw an exception");
  }
}

}  // namespace sinew::handles

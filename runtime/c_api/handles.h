// SPDX-License-Identifier: MIT
//
// What libraries beside the runtime need to add functions to its C interface.
#pragma once

#include <memory>
#include <string_view>

#include "sinew/c_api.h"
#include "sinew/runtime/export.h"
#include "sinew/runtime/world.h"

namespace sinew::handles {

/// \param world not null.
SINEW_API World& worldOf(sinew_world* world);
/// The caller's to release. Throws std::bad_alloc.
SINEW_API sinew_asset* handleOf(std::shared_ptr<const Asset> asset);
/// What sinew_last_error() says from now on. \return the status.
SINEW_API sinew_status tellFailure(sinew_status status, std::string_view reason);
/// Status of what worlds have told their logs in this thread since this was asked last; sinew_last_error() says what.
SINEW_API sinew_status takeToldStatus();

}  // namespace sinew::handles

// SPDX-License-Identifier: MIT
//
// Base of all functions of the C interface: handles, and failures as status codes. Exports are for libraries beside
// the runtime that add functions.
#pragma once

#include <cstdint>
#include <memory>
#include <memory_resource>
#include <string_view>
#include <type_traits>
#include <utility>

#include "sinew/c_api.h"
#include "sinew/runtime/export.h"
#include "sinew/runtime/world.h"

namespace sinew::handles {

/// \param world not null.
SINEW_API World& worldOf(sinew_world* world);
const World& worldOf(const sinew_world* world);
/// Memory of a world and its handle. \param world not null.
std::pmr::memory_resource* memoryOf(const sinew_world* world);
/// The caller's to release. Throws std::bad_alloc.
SINEW_API sinew_asset* handleOf(std::shared_ptr<const Asset> asset);
/// \param asset not null.
std::shared_ptr<const Asset> assetOf(const sinew_asset* asset);
/// Sets the text of sinew_last_error(). \return the status.
SINEW_API sinew_status tellFailure(sinew_status status, std::string_view reason);
/// An error that a world tells its log is the failure of the present call.
void noteError(std::string_view line);
/// Status of what worlds have told their logs in this thread since this was asked last; sinew_last_error() says what.
SINEW_API sinew_status takeToldStatus();
/// The failure of a call that lacks an argument.
SINEW_API sinew_status failNull(const char* call);

/// Something to call, whatever it is: so that what goes around it is compiled once and not for each function.
struct Callable {
  // NOLINTNEXTLINE(google-explicit-constructor): lambdas are passed as they are
  template <class Work>
  Callable(const Work& given)
      : work(&given), run([](const void* it) -> sinew_status { return (*static_cast<const Work*>(it))(); }) {}
  sinew_status operator()() const { return run(work); }

  const void* work;
  sinew_status (*run)(const void*);
};

/// Runs work(); an exception becomes a status.
SINEW_API sinew_status guarded(const char* call, const Callable& work) noexcept;

/// Work of a function on a world, and perhaps a body of it, whatever it is.
struct WorldWork {
  const void* work;
  sinew_status (*run)(const void* work, const World& world, BodyId body);
};

/// Refused where a pointer is missing.
sinew_status runOnWorld(const char* call, const sinew_world* world, bool all_given, const WorldWork& work,
                        BodyId body = {}) noexcept;
/// Refused too where the world has no such body.
sinew_status runOnBody(const char* call, const sinew_world* world, BodyId body, bool all_given,
                       const WorldWork& work) noexcept;

/// A world that is reached through a handle to read stays one to read.
template <class Handle>
using WorldOf = std::conditional_t<std::is_const_v<Handle>, const World, World>;

/// The status that work(arguments...) returns; success where it returns none.
template <class Work, class... Arguments>
sinew_status statusOf(const Work& work, Arguments&&... arguments) {
  if constexpr (std::is_void_v<std::invoke_result_t<const Work&, Arguments...>>) {
    work(std::forward<Arguments>(arguments)...);
    return SINEW_OK;
  } else {
    return work(std::forward<Arguments>(arguments)...);
  }
}

/// Runs work(world) where all is given. \return what it returns, or what the world told its log.
template <class Handle, class Work>
sinew_status onWorld(const char* call, Handle* world, bool all_given, const Work& work) noexcept {
  const auto run = [](const void* it, const World& on, BodyId) {
    return statusOf(*static_cast<const Work*>(it), const_cast<WorldOf<Handle>&>(on));
  };
  return runOnWorld(call, world, all_given, {&work, run});
}

/// The same for a body: work(world, id).
template <class Handle, class Work>
sinew_status onBody(const char* call, Handle* world, std::uint32_t body, bool all_given, const Work& work) noexcept {
  const auto run = [](const void* it, const World& on, BodyId id) {
    return statusOf(*static_cast<const Work*>(it), const_cast<WorldOf<Handle>&>(on), id);
  };
  return runOnBody(call, world, {body}, all_given, {&work, run});
}

}  // namespace sinew::handles

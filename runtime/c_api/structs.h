// SPDX-License-Identifier: MIT
//
// Structs of the C interface that may grow, and its vectors: what all files of it read and write alike.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "sinew/runtime/settings.h"

namespace sinew::handles {

/// Whether a caller's struct was filled by its _init function: all zero it would silently say nothing.
template <class T>
bool isFilled(const T* given) {
  return given != nullptr && given->struct_size > sizeof given->struct_size;
}
template <class T>
bool isNullOrFilled(const T* given) {
  return given == nullptr || isFilled(given);
}

/// A struct of the caller's, which may be older (shorter) or newer than this one; what it lacks keeps its default.
/// \param given null: all does.
template <class T>
T readStruct(const T* given, const T& defaults) {
  T result = defaults;
  if (given != nullptr) std::memcpy(&result, given, std::min<std::size_t>(given->struct_size, sizeof(T)));
  result.struct_size = sizeof(T);
  return result;
}

/// \param size of the caller's struct, bytes: what this one lacks of it is 0.
template <class T>
void writeStruct(T value, T* to, std::size_t size) {
  if (to == nullptr || size < sizeof value.struct_size) return;
  value.struct_size = std::uint32_t(size);
  std::memset(to, 0, size);
  std::memcpy(to, &value, std::min(size, sizeof(T)));
}

inline Vec3 vec3(const float* v) { return {v[0], v[1], v[2]}; }

inline RigidTransform transform(const float* position, const float* rotation) {
  RigidTransform result;
  result.position = vec3(position);
  std::copy_n(rotation, 9, result.rotation.begin());
  return result;
}

}  // namespace sinew::handles

// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <utility>
#include <variant>

namespace sinew {

/// The reason of a refusal: one line for a person.
struct Error {
  std::string reason;
};

/// A value or the reason why there is none. The runtime never throws across its boundary.
template <class T>
class [[nodiscard]] Result {
 public:
  Result(T value) : data_(std::move(value)) {}
  Result(Error error) : data_(std::move(error)) {}

  explicit operator bool() const { return data_.index() == 0; }
  T& operator*() { return std::get<0>(data_); }
  const T& operator*() const { return std::get<0>(data_); }
  T* operator->() { return &std::get<0>(data_); }
  const T* operator->() const { return &std::get<0>(data_); }
  const std::string& reason() const { return std::get<1>(data_).reason; }

 private:
  std::variant<T, Error> data_;
};

}  // namespace sinew

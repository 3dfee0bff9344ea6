// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/timeline.h"

#include <utility>

namespace sinew::tools {

void Timeline::clear() {
  moments_.clear();
  bytes_ = at_ = 0;
}

void Timeline::add(Moment moment) {
  while (moments_.size() > at_ + 1) {
    bytes_ -= moments_.back().state.bytes();
    moments_.pop_back();
  }
  bytes_ += moment.state.bytes();
  moments_.push_back(std::move(moment));
  while (bytes_ > most_bytes_ && moments_.size() > 1) {
    bytes_ -= moments_.front().state.bytes();
    moments_.pop_front();
  }
  at_ = moments_.size() - 1;
}

}  // namespace sinew::tools

// SPDX-License-Identifier: MIT
#include "runtime/geometry/rounded.h"

#include <gtest/gtest.h>

namespace sinew::geometry {
namespace {

// GCC 12 at -O2 takes pairs of doubles to float and back without rounding them: references that were no floats cost
// fast spins their momentum, and packages had weights for other vertices than they hold.
TEST(RoundedToFloat, RoundsEveryComponent) {
  for (const double at : {310470.30783239, 218961.19605379, 13994.025616683, 1.1}) {
    const Eigen::Vector3d v(at, -at, 2 * at);
    const Eigen::Vector3d rounded = roundedToFloat(v);
    for (int k = 0; k < 3; ++k) {
      const volatile float expected = float(v[k]);
      EXPECT_EQ(rounded[k], double(expected));
      EXPECT_NE(rounded[k], v[k]);
    }
  }
}

}  // namespace
}  // namespace sinew::geometry

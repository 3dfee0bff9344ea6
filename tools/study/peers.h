// SPDX-License-Identifier: GPL-3.0-or-later
//
// Scenes of `study error` by other methods, on one thread: each as its authors give it.
#pragma once

#include "tools/study/motion.h"

namespace sinew::tools {

/// Extended position-based dynamics in small steps: one pass over the tetrahedra a step, each by its two constraints of
/// stable neo-Hookean elasticity (Macklin and Müller 2021, "A constraint-based formulation of stable neo-Hookean
/// materials"; steps: Macklin et al. 2019, "Small steps in physics simulation"). Floats.
/// \param substeps of a frame
Motion playXpbd(const MotionBody& body, const MotionScene& scene, std::uint32_t substeps);

/// Linear tetrahedra with their rotations taken out (Müller and Gross 2004, "Interactive virtual materials"), implicit
/// Euler, one linear system a step by conjugate gradients with block-diagonal preconditioning. Floats.
/// \param iterations of them at most
Motion playStiffnessWarping(const MotionBody& body, const MotionScene& scene, std::uint32_t substeps,
                            std::uint32_t iterations);

enum class BulletKind : std::uint8_t { finite_elements, implicit_finite_elements, links };

/// Bullet's soft bodies (tests/benchmarks/bullet_solid.h). No frames where this build has no Bullet.
/// \param iterations of links
Motion playBullet(const MotionBody& body, const MotionScene& scene, BulletKind kind, std::uint32_t substeps,
                  std::uint32_t iterations);

/// How a World plays a package.
struct SinewPlay {
  const SolverFactory* solver = nullptr;  ///< as BodySettings::solver
  std::uint32_t iterations = 4;           ///< WorldSettings::iterations
  std::uint32_t substeps = 1;             ///< of a frame
};

/// The package in a World, with the scene's one damping in place of the world's.
Motion playSinew(const std::shared_ptr<const Asset>& asset, const MotionScene& scene, const SinewPlay& play);

}  // namespace sinew::tools

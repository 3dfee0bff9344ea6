// SPDX-License-Identifier: MIT
//
// Data of the attachment kernels: plain structs, shared with the code that fills them.
#pragma once

#include <cstddef>
#include <cstdint>

namespace sinew::internal {

/// Barycentric attachment of one visual vertex: x = x3 + Σ weight[k] (x_k - x3) over the corners of its slot.
struct AttachmentRecord {
  float weight[3];
  std::uint32_t slot;  ///< into the tetrahedra that visual vertices hang on
};
static_assert(sizeof(AttachmentRecord) == 16);

/// The corners of a slot's tetrahedron: physical vertices.
struct SlotCorners {
  std::uint32_t vertex[4];
};

/// x_0 - x_3, x_1 - x_3, x_2 - x_3, x_3 of a slot's tetrahedron, each xyz and one unused float: a cache line.
struct alignas(64) SlotFrame {
  float column[4][4];
};

/// The reverse of a slot's edges at rest: rows of (X_0 - X_3, X_1 - X_3, X_2 - X_3)^-1, each xyz and one unused float.
struct alignas(16) SlotInverse {
  float row[3][4];
};

/// The goal transform of a cluster as attachments use it: g = column[0] + Σ_k column[k] m_k(q) with q = (X - center) *
/// inverse_radius and m the monomials of docs/report.md §1; columns 4.. count for quadratic clusters only.
struct ClusterColumns {
  float column[10][4];
  float center[3];
  float inverse_radius;
  std::uint32_t quadratic;  ///< 1 or 0
  std::uint32_t unused[3];
};
static_assert(sizeof(ClusterColumns) == 192);

/// A 3x3 matrix column by column, each column xyz and one unused float; the fourth column fills the cache line.
struct alignas(64) PaddedMatrix {
  float column[4][4];
};

/// One cluster that moves a vertex, or one slot at a physical vertex, and its weight.
struct BlendTerm {
  std::uint32_t of;
  float weight;
};

/// A run of BlendTerm.
struct BlendRun {
  std::uint32_t first, count;
};

/// Where a kernel writes: element i at data + i * stride bytes.
struct OutputStream {
  std::byte* data;
  std::size_t stride;
};

/// The attachment kernels of one instruction set; runtime/kernels/attach.h says what each does.
struct AttachKernels {
  void (*slot_frames)(const float* positions, const SlotCorners* corners, SlotFrame* frames, std::uint32_t begin,
                      std::uint32_t end);
  void (*slot_gradients)(const SlotFrame* frames, const SlotInverse* inverses, PaddedMatrix* gradients,
                         std::uint32_t begin, std::uint32_t end);
  void (*gradients)(const BlendRun* runs, const BlendTerm* terms, const PaddedMatrix* slots, PaddedMatrix* gradients,
                    PaddedMatrix* cofactors, std::uint32_t begin, std::uint32_t end);
  void (*attached_positions)(const AttachmentRecord* records, const SlotFrame* frames, std::uint32_t begin,
                             std::uint32_t end, OutputStream out);
  void (*attached_directions)(const AttachmentRecord* records, const SlotCorners* corners,
                              const PaddedMatrix* cofactors, const PaddedMatrix* gradients, const float* rest_normals,
                              const float* rest_tangents, std::uint32_t begin, std::uint32_t end, OutputStream normals,
                              OutputStream tangents);
  void (*blended_positions)(const float* rest, const BlendRun* runs, const BlendTerm* terms,
                            const ClusterColumns* clusters, std::uint32_t begin, std::uint32_t end, OutputStream out);
  void (*blended_directions)(const float* rest, const BlendRun* runs, const BlendTerm* terms,
                             const ClusterColumns* clusters, const float* rest_normals, const float* rest_tangents,
                             std::uint32_t begin, std::uint32_t end, OutputStream normals, OutputStream tangents);
  void (*bounds)(const float* points, std::uint32_t count, float* low, float* high);
  std::uint32_t (*below)(OutputStream places, std::uint32_t begin, std::uint32_t end, const float* plane,
                         std::uint32_t* found);
};

}  // namespace sinew::internal

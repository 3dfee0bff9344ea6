// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace sinew::tools {

/// A use that a game may have for a package. Unused data is left out (tools/bake/leave_out.h).
enum class Need {
  contact,
  cut,
  pins,
  activation,
  plasticity,
  clusters,
  normals,
  uvs,
  colors,
  textures,
  identity,
  groups,
  masks,
  exact
};

struct NeedDeclaration {
  Need need;
  std::string_view name, sentence;
};

/// In the order of the enum.
inline constexpr std::array<NeedDeclaration, 14> kNeedDeclarations = {{
    {Need::contact, "contact", "touching colliders, other bodies or itself"},
    {Need::cut, "cut", "cutting: every tetrahedron, not only those that carry the drawn surface"},
    {Need::pins, "pins", "pin sets and their targets; how pins and picks give way"},
    {Need::activation, "activation", "channels and fibres"},
    {Need::plasticity, "plasticity", "deformation that stays"},
    {Need::clusters, "clusters", "clusters by name, and the report's solver: else those alike are one"},
    {Need::normals, "normals", "the artist's normals: else they are those of the surface"},
    {Need::uvs, "uvs", "texture coordinates, and tangents"},
    {Need::colors, "colors", "vertex colours"},
    {Need::textures, "textures", "pictures"},
    {Need::identity, "identity", "which source vertex is which visual vertex"},
    {Need::groups, "groups", "the artist's named groups"},
    {Need::masks, "masks", "the recipe's masks, by name"},
    {Need::exact, "exact", "numbers of 32 bits, used in place: else of 16, unpacked when loaded"},
}};

/// A set of needs.
class Needs {
 public:
  static Needs all() { return Needs((1U << kNeedDeclarations.size()) - 1); }
  static Needs none() { return Needs(0); }
  /// Needs seen and felt, each unless leaving it out goes unseen.
  static Needs automatic() { return Needs(kAutomatic); }
  /// "all", "none", or names separated by commas, "auto" among them. \return nothing where one is unknown.
  static std::optional<Needs> parse(std::string_view text);

  /// Whether needs that go unseen are left out (tools/bake/leave_out.h, narrowed()).
  bool isAutomatic() const { return (bits_ & kAutomatic) != 0; }
  bool has(Need need) const { return (bits_ >> unsigned(need) & 1U) != 0; }
  Needs with(Need need) const { return Needs(bits_ | 1U << unsigned(need)); }
  Needs without(Need need) const { return Needs(bits_ & ~(1U << unsigned(need))); }
  Needs with(Needs more) const { return Needs(bits_ | more.bits_); }
  /// As parse() takes it.
  std::string text() const;
  /// All names. \param sentences with what each means, in parentheses.
  static std::string names(std::string_view between, bool sentences = false);
  bool operator==(const Needs&) const = default;

 private:
  static constexpr std::uint32_t kAutomatic = 1U << 31;
  explicit Needs(std::uint32_t bits) : bits_(bits) {}
  std::uint32_t bits_;
};

}  // namespace sinew::tools

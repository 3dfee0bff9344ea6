// SPDX-License-Identifier: MIT
//
// The fixed-layout records of a package. One struct per section; docs/package-format.md describes the same bytes for
// readers in other languages. Little-endian, IEEE 754, no implicit padding. SI units, right-handed, y up; positions
// are relative to PackageInfo::origin.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

namespace sinew::formats {

static_assert(std::endian::native == std::endian::little,
              "packages are used in place: a big-endian host needs a byte-swapping reader");

inline constexpr std::array<char, 8> kMagic = {'S', 'I', 'N', 'E', 'W', '\r', '\n', '\x1a'};
inline constexpr std::size_t kSectionAlignment = 64;
inline constexpr std::uint32_t kNone = 0xffffffffU;  ///< "no such index" in every index field that allows it
/// Bound on numbers that have no other bound: the square of one is still a float, and so is a sum of thousands of
/// squares.
inline constexpr float kMostNumber = 1e18F;
/// Bound on places, metres from the origin: beyond it floats can neither square nor subtract places of a body.
inline constexpr float kMostMetres = 1e15F;
/// Bound on texture coordinates.
inline constexpr float kMostTexture = 1e9F;

constexpr std::uint32_t fourcc(const char (&text)[5]) {
  return std::uint32_t(std::uint8_t(text[0])) | std::uint32_t(std::uint8_t(text[1])) << 8 |
         std::uint32_t(std::uint8_t(text[2])) << 16 | std::uint32_t(std::uint8_t(text[3])) << 24;
}

/// Bits of Header::features: the content of a package. A loader refuses a package with a bit that it does not know.
enum Feature : std::uint64_t {
  kFeatureTetrahedra = 1U << 0,
  kFeatureQuadratic = 1U << 1,          ///< at least one quadratic cluster (section AQQ9)
  kFeatureVisual = 1U << 2,             ///< visual mesh sections
  kFeatureBarycentric = 1U << 3,        ///< section ATBC
  kFeatureClusterAttachment = 1U << 4,  ///< sections ATCR, ATCW
  kFeatureIdentity = 1U << 5,           ///< sections VSRC, SVTX, SVLS, SMSH
  kFeatureGroups = 1U << 6,             ///< section GRUP (and GRPV)
  kFeatureTextures = 1U << 7,           ///< section VTEX (and TEXB)
  kFeatureMechanics = 1U << 8,          ///< section CMEC (and CURV where a cluster has a curve)
  kFeatureActivation = 1U << 9,         ///< section CHAN
  kFeatureVertexStiffness = 1U << 10,   ///< section PSTF
  kFeaturePinWeights = 1U << 11,        ///< section PPIN
  kFeatureField = 1U << 12,             ///< sections FELD, FFUN, FPAK, FGRD, FVAL, FMOD
};

struct Header {
  std::array<char, 8> magic;
  std::uint32_t format_version;
  std::uint32_t header_bytes;  ///< sizeof(Header)
  std::uint64_t features;      ///< OR of Feature
  std::uint64_t total_bytes;   ///< size of the file
  std::uint32_t section_count;
  std::uint32_t reserved0;  ///< 0
  std::uint64_t checksum;   ///< XXH3-64, seed 0, of header (this field as 0) followed by the section table
  std::array<std::uint64_t, 2> reserved1;  ///< 0
};
static_assert(sizeof(Header) == 64);

enum SectionFlag : std::uint32_t {
  kSectionRequired = 1U << 0,  ///< a reader that does not know this section must refuse the package
  kSectionPacked = 1U << 1,    ///< its elements are packed: in fewer bytes, to be unpacked before they are used
};

/// The table follows the header at once; entries are in file order, and sections tile the rest of the file: each starts
/// where the one before ended (rounded up to 64), the first right behind the table (rounded up to 64).
struct SectionEntry {
  std::uint32_t id;      ///< fourcc
  std::uint32_t flags;   ///< OR of SectionFlag
  std::uint64_t offset;  ///< from the start of the file; a multiple of 64
  std::uint64_t bytes;   ///< element_count * element_bytes; the rest up to the next multiple of 64 is zero
  std::uint64_t element_count;
  std::uint32_t element_bytes;
  std::uint32_t reserved0;                 ///< 0
  std::uint64_t checksum;                  ///< XXH3-64, seed 0, of `bytes` rounded up to 64 (so padding is covered too)
  std::array<std::uint64_t, 2> reserved1;  ///< 0
};
static_assert(sizeof(SectionEntry) == 64);

/// A piece of the STRS section: UTF-8, not terminated.
struct StringRef {
  std::uint32_t offset;
  std::uint32_t bytes;
};
static_assert(sizeof(StringRef) == 8);

/// INFO, required, one record.
struct PackageInfo {
  std::array<double, 3> origin;     ///< metres, world position that all positions here are relative to
  double metres_per_unit;           ///< metres per unit of length of the source
  std::array<float, 3> bounds_min;  ///< of the visual vertices (physical ones where there is no visual mesh), metres
  std::array<float, 3> bounds_max;
  float diagonal;         ///< of those bounds, metres, > 0
  float total_mass;       ///< kg
  float density;          ///< of the masses, kg/m^3
  float physical_volume;  ///< space that the tetrahedra take, m^3: copies in one place (split cells) count once
  float source_volume;    ///< enclosed by the source's surface, m^3; negative where it is not defined
  float max_rest_error;   ///< largest distance of an attached visual vertex from its rest position / diagonal
  float min_dihedral_deg;
  float max_dihedral_deg;
  std::uint32_t inverted_tetrahedra;  ///< 0 in a package that `sinew bake` wrote
  std::uint32_t reserved0;
  StringRef name;  ///< of the package
  StringRef tool_version;
  StringRef source_file;    ///< file name without folder
  StringRef unit_source;    ///< where metres_per_unit came from, one sentence
  StringRef settings_json;  ///< every setting of the bake as a JSON object
};
static_assert(sizeof(PackageInfo) == 136);

/// BODY, required: the pieces, separate solids of one source, in order; together they cover all vertices, tetrahedra
/// and clusters.
struct PieceRange {
  std::uint32_t first_vertex, vertex_count;
  std::uint32_t first_tetrahedron, tetrahedron_count;
  std::uint32_t first_cluster, cluster_count;
  StringRef name;
};
static_assert(sizeof(PieceRange) == 32);

/// PVTX, required: physical vertices.
struct PhysicalVertex {
  std::array<float, 3> rest_position;
  float mass;  ///< kg, > 0
};
static_assert(sizeof(PhysicalVertex) == 16);

/// TETS: four physical vertices, positively oriented: (b-a) x (c-a) . (d-a) > 0.
struct Tetrahedron {
  std::array<std::uint32_t, 4> vertex;
};
static_assert(sizeof(Tetrahedron) == 16);

enum class ClusterMode : std::uint32_t { rigid = 0, linear = 1, quadratic = 2 };

/// CLUS, required. Symbols as in docs/report.md §1. Lengths inside a cluster are divided by `radius`, so that q is
/// unit-free and of order one; moments use mu normalized to sum to 1 within the cluster.
struct Cluster {
  StringRef name;
  ClusterMode mode;
  std::uint32_t piece;         ///< index into BODY
  std::uint32_t first_member;  ///< into MEMB
  std::uint32_t member_count;
  std::array<float, 3> rest_center;  ///< c0, metres
  float radius;                      ///< metres, > 0
  float mass;                        ///< sum of m_i w_ic / W_i, kg
  float alpha;                ///< 0..1, the report's solver: part of the way to its goal that a vertex goes in a step
  float stretch_hz;           ///< frequency of stretch and shear, Hz; infinity = rigid, 0 = no return
  float bend_hz;              ///< of the squares
  float twist_hz;             ///< of the cross terms
  std::uint32_t quadratic;    ///< index into AQQ9, kNone unless mode is quadratic
  std::array<float, 6> a_qq;  ///< pseudo-inverse of sum mu q q^T: xx yy zz xy yz zx
};
static_assert(sizeof(Cluster) == 88);

/// MEMB, required: the members of all clusters, cluster by cluster, vertices ascending within one.
struct Membership {
  std::uint32_t vertex;  ///< physical vertex
  float mu;              ///< mu_ic / sum over the cluster: sums to 1 in each cluster
  float share;           ///< w_ic / W_i: sums to 1 over the clusters of a vertex
};
static_assert(sizeof(Membership) == 12);

/// AQQ9: pseudo-inverse of the 9x9 moment of centred q~, lower triangle row by row (00 10 11 20 21 22 ...).
struct QuadraticMoment {
  std::array<float, 45> a_qq;
};
static_assert(sizeof(QuadraticMoment) == 180);

/// The source of a cluster's stiffness (docs/method.md §2).
enum class StiffnessModel : std::uint32_t {
  frequency = 0,  ///< Cluster::stretch_hz, bend_hz, twist_hz: independent of the step
  per_step =
      1,  ///< per_step_beta: part that a step of 1/60 s keeps (the report's solver: any step, so stiffer if short)
  elastic = 2,  ///< an isotropic solid, from ClusterMechanics::young and poisson
};

/// The bound on the stretch of a cluster: on F of each sample in it (the report's solver: on its match, A).
enum class LimitMethod : std::uint32_t {
  none = 0,
  rows = 1,             ///< each rest axis at most stretch_max long (the report's solver: each row of A)
  frobenius = 2,        ///< the squared norm at most norm_max
  frobenius_cheap = 3,  ///< the same (the report's solver: by a cheaper, stronger rule)
  soft = 4,             ///< squared norms above norm_max approach norm_limit
  principal = 5,        ///< each principal stretch within stretch_min .. stretch_max
  curve = 6,            ///< squared norms mapped by points of CURV
};

/// Whether a cluster keeps its volume: sets Poisson's ratio if it has no modulus (the report's solver: scales A).
enum class VolumeMethod : std::uint32_t {
  none = 0,
  cube_root = 1,  ///< kept
  principal = 2,  ///< the same: no solver tells the two apart
};

/// CMEC: mechanics of a cluster beyond CLUS, one per cluster. Without the section every cluster is as kPlainMechanics
/// says.
struct ClusterMechanics {
  StiffnessModel stiffness;
  std::array<float, 3> per_step_beta;  ///< 0..1 by class of modes (stretch, bend, twist): 0 rigid, 1 no return
  float young;                         ///< Young's modulus, Pa, 0..1e12
  float poisson;                       ///< Poisson's ratio, 0..0.499
  float damping;                       ///< decay of the cluster's motion that is not rigid, 1/s, 0..1e5
  LimitMethod limit;
  float stretch_min;                ///< least principal stretch, 0.05..1
  float stretch_max;                ///< largest principal stretch or length of a row, 1..20
  float norm_max;                   ///< squared Frobenius norm, 3 (the rest shape's)..1000
  float norm_limit;                 ///< norm_max..1000
  std::uint32_t first_curve_point;  ///< into CURV; 0 without a curve
  std::uint32_t curve_point_count;  ///< 2.. if limit is curve, else 0
  VolumeMethod volume;
  float plastic_yield;         ///< |S - 1| from which on a deformation begins to stay, 0..10; 0 with creep 0: never
  float plastic_creep;         ///< part of the deformation that becomes permanent, 1/s, 0..1e5
  float plastic_limit;         ///< largest |S_p - 1| of the permanent deformation, 0..10
  std::array<float, 3> fibre;  ///< unit, rest shape; 0 0 0 = none
  std::uint32_t channel;       ///< into CHAN: activates the fibre; kNone = none
  float contraction;           ///< shortening along the fibre at full activation, 0..0.9
  std::uint32_t reserved0;     ///< 0
};
static_assert(sizeof(ClusterMechanics) == 96);

/// The mechanics of a cluster without CMEC. Fields that nothing uses hold the defaults of a bake.
inline constexpr ClusterMechanics kPlainMechanics = {.stiffness = StiffnessModel::frequency,
                                                     .per_step_beta = {0.5F, 0.5F, 0.5F},
                                                     .young = 1e5F,
                                                     .poisson = 0.3F,
                                                     .damping = 0,
                                                     .limit = LimitMethod::none,
                                                     .stretch_min = 0.5F,
                                                     .stretch_max = 1.5F,
                                                     .norm_max = 4,
                                                     .norm_limit = 6,
                                                     .first_curve_point = 0,
                                                     .curve_point_count = 0,
                                                     .volume = VolumeMethod::none,
                                                     .plastic_yield = 0.1F,
                                                     .plastic_creep = 0,
                                                     .plastic_limit = 0.5F,
                                                     .fibre = {},
                                                     .channel = kNone,
                                                     .contraction = 0,
                                                     .reserved0 = 0};

/// CURV: a point of a response curve of LimitMethod::curve, which maps squared norms to `response`. Linear between
/// points, constant behind the last, unchanged before the first.
struct CurvePoint {
  float norm;      ///< phi, 3..1e6, strictly ascending in a curve
  float response;  ///< f(phi), 3..phi, not descending; phi itself at a curve's first point
};
static_assert(sizeof(CurvePoint) == 8);

/// CHAN: an input 0..1 that a game sets to contract fibres.
struct ActivationChannel {
  StringRef name;
};
static_assert(sizeof(ActivationChannel) == 8);

// PSTF: float per physical vertex, 0..1: multiplies the pull to the goals (the report's solver). PPIN: float per
// physical vertex, 0..1: how firmly a pin set holds the vertex; 0 = not at all.

/// PSET: a named set of physical vertices that an artist pinned, PSTV[first .. first+count), ascending. Sets hold a
/// body from the start (World::pinSet).
struct PinSet {
  StringRef name;
  StringRef target;         ///< "world", or the game's name of the bone or rigid body that moves the set
  std::uint32_t method;     ///< 0..3, a sinew::PinMethod
  std::uint32_t first;      ///< into PSTV
  std::uint32_t count;      ///< may be 0
  std::uint32_t reserved0;  ///< 0
};
static_assert(sizeof(PinSet) == 32);

/// PART: a loose part of the visual mesh that no tetrahedra of its own fill, by the name that the recipe gave it: an
/// eyeball, teeth, lashes. Its visual vertices are PRTV[first .. first+count), ascending.
struct AttachedPart {
  StringRef name;
  /// Rigid: the cluster that carries the part. Its mu lie on the host's vertices, which have share 0 in it; share 1
  /// have the four vertices of the tetrahedron that the part hangs on, with mu 0. kNone: each vertex follows the
  /// surface.
  std::uint32_t cluster;
  std::uint32_t first;      ///< into PRTV
  std::uint32_t count;      ///< may be 0
  std::uint32_t reserved0;  ///< 0
};
static_assert(sizeof(AttachedPart) == 24);

/// Eight numbers of eight samples, vertices, contact points or modes, computed with side by side.
using Lanes = std::array<float, 8>;

/// FELD: the function space in which a piece moves, x(X) = sum_j phi_j(X) z_j, with its samples (docs/method.md). In
/// the order of pieces; each has one free field, and behind it one more where pin sets hold it. The functions are
/// orthonormal under the masses of the piece and diagonalize sum V (2 mu + lambda) grad phi grad phi^T, but for those
/// that pin sets drive, which are orthogonal to the others.
struct Field {
  std::uint32_t piece;                   ///< into BODY
  std::uint16_t held;                    ///< 0: of the free piece; 1: pin sets prescribe the driven functions
  std::uint16_t level;                   ///< of detail: 0 is the whole; each further one has fewer functions
  std::uint32_t function_count;          ///< k, 1..1024
  std::uint32_t driven_count;            ///< the first so many are prescribed by pin sets: four each; 0 in a free field
  std::uint32_t first_function;          ///< into FFUN
  std::uint32_t first_pack, pack_count;  ///< into FPAK, 1..
  std::uint32_t first_gradient;          ///< into FGRD: 3 k a pack
  std::uint32_t first_value;             ///< into FVAL: k for every eight vertices of the piece
  std::uint32_t first_point, point_count;  ///< into FPNT
  std::uint32_t first_point_value;         ///< into FPTV: k for every eight points
  std::uint32_t first_mode;  ///< into FMOD: 3 n + 1 for every eight of its 3 n modes, n = k - driven_count
  float lowest_hz;           ///< frequency of the lowest elastic mode of the piece, free or held, Hz
  float static_error;        ///< rms error of the static answers that the bake tried, of their rms displacement, 0..
  float least_eigenvalue;    ///< of the sampled rest stiffness against that of all tetrahedra
};
static_assert(sizeof(Field) == 64);

/// FFUN: a function of a field.
struct FieldFunction {
  float stiffness;            ///< w: its diagonal entry of sum V (2 mu + lambda) grad phi grad phi^T, 1/s^2, 0..
  float damping_hz;           ///< decay exp(-4 pi ratio damping_hz t) of its velocity at a damping ratio, Hz, 0..
  float one;                  ///< sum_j one_j phi_j = 1
  std::array<float, 3> rest;  ///< sum_j phi_j rest_j = X, metres
  std::uint32_t pin_set;      ///< into PSET: what drives it; kNone
  std::uint32_t monomial;     ///< of a driven function: 0 = 1, 1..3 = X, Y, Z, on the vertices of its pin set
  float decay;                ///< further decay of its velocity: the damping of its clusters, 1/s, 0..
};
static_assert(sizeof(FieldFunction) == 36);

/// FPAK: eight samples of the elastic energy. Lanes behind the last sample have no cluster, and 0 in all else.
struct FieldPack {
  Lanes volume;                          ///< the sample's weight, m^3, 0..
  Lanes mu, lambda;                      ///< Lame's parameters, Pa, 0..
  std::array<Lanes, 3> at;               ///< rest position, metres
  std::array<std::uint32_t, 8> cluster;  ///< into CLUS: gives its limits and plasticity; kNone: it has none
};
static_assert(sizeof(FieldPack) == 224);

// FGRD: Lanes; pack by pack, function by function: d phi / dX, dY, dZ at the eight samples, 1/m.
// FVAL: Lanes; for every eight vertices of the piece, function by function: phi at them. Lanes behind the last: 0.
// FPTV: the same at the contact points.

// FMOD: Lanes; for every eight elastic modes of the rest shape, rigid ones among them: their squared angular
// frequencies, 1/s^2, then for each function that is not driven their x, y and z coefficients. Modes are orthonormal.
// Lanes behind the last: 0. They speed up the solver and decide nothing.

/// FFIB: a cell of an activated cluster in a field. Its mean deformation gradient along the fibre is d = sum_j b_j z_j;
/// its energy at activation a is 1/2 a / (1 - a contraction) `tension` d . d (docs/method.md §3). By field, then by
/// cluster.
struct FieldFibre {
  std::uint32_t field;        ///< into FELD
  std::uint32_t cluster;      ///< into CLUS; one with a channel
  std::uint32_t first_value;  ///< into FFBV: b_j of its k functions, 1/m
  float tension;              ///< of full activation, J, 0..: contraction, Young's modulus and volume, multiplied
};
static_assert(sizeof(FieldFibre) == 16);

/// Frequency of a vertex of pin weight 1/2 on its tether, Hz; at weight w it is this times w / (1 - w)
/// (docs/method.md §2).
inline constexpr double kPinHz = 60;

/// FTHR: the tethers of a held field, springs between vertices that are not held and its pin sets: the energy is
/// 1/2 sum_ij T_ij z_i . z_j, zero where all sets move as one.
struct FieldTethers {
  std::uint32_t field;        ///< into FELD, ascending; a held one
  std::uint32_t first_value;  ///< into FTHV: T of its k functions, k x k, symmetric, N/m of coefficients
};
static_assert(sizeof(FieldTethers) == 8);

/// FRES: what a free field's functions lack: how its vertices give way to forces while the functions stay. Forces f_w
/// on vertices w move vertex v by d_v f_v + sum_m r_vm sum_w r_wm . f_w, r_vm (three numbers for each mode m) the
/// values of FRSV times `scale`, d_v that of FRSL. Where the piece is at rest, in its frame (docs/method.md §4).
struct FieldResidual {
  std::uint32_t field;        ///< into FELD, ascending; a free one
  std::uint32_t mode_count;   ///< r, 1..256
  std::uint32_t first_value;  ///< into FRSV: by eight vertices of the piece x of each mode, then y, then z
  std::uint32_t first_local;  ///< into FRSL: d_v of the piece's vertices, m/N, > 0
  float scale;                ///< of the values, (m/N)^1/2, > 0
};
static_assert(sizeof(FieldResidual) == 20);

/// FPNT: a contact point, a place of the surface that may touch something.
struct FieldPoint {
  std::array<float, 3> at;  ///< rest position, metres
  float area;               ///< of its share of the surface, m^2, > 0
};
static_assert(sizeof(FieldPoint) == 16);

/// DIST: distances to the drawn surface of a piece at rest, on a regular grid around it; contact points of other
/// bodies are looked up there. By piece, at most one each.
struct DistanceGrid {
  std::uint32_t piece;                 ///< into BODY, ascending
  std::array<std::uint32_t, 3> nodes;  ///< along x, y, z, each 2..kMostDistanceNodes
  std::uint32_t first_value;           ///< into DVAL: x fastest, then y
  std::array<float, 3> origin;         ///< rest position of the first node, metres
  float spacing;                       ///< of nodes, metres, > 0
  float unit;                          ///< of the values, metres, > 0
};
static_assert(sizeof(DistanceGrid) == 40);
inline constexpr std::uint32_t kMostDistanceNodes = 256;
// DVAL: std::int16_t; times DistanceGrid::unit the distance to the drawn surface, metres, negative inside.

// Visual mesh. Element i of VPOS, VNRM, VUV0, VCOL, VSRC, ATBC, ATCR is visual vertex i.
using Float3 = std::array<float, 3>;            ///< VPOS (metres, relative to origin), VNRM (unit)
using Float2 = std::array<float, 2>;            ///< VUV0: u right, v up (0,0 = bottom left of the picture)
using Color8 = std::array<std::uint8_t, 4>;     ///< VCOL: RGBA
using Triangle = std::array<std::uint32_t, 3>;  ///< VTRI: visual vertices, counter-clockwise from outside

/// VSUB: runs of triangles that share a material.
struct SubMesh {
  StringRef name;          ///< node and mesh of the source
  std::uint32_t material;  ///< into VMAT, or kNone
  std::uint32_t first_triangle;
  std::uint32_t triangle_count;
  std::uint32_t reserved0;
};
static_assert(sizeof(SubMesh) == 24);

enum MaterialFlag : std::uint32_t { kMaterialDoubleSided = 1U << 0 };

/// VMAT.
struct Material {
  StringRef name;
  std::array<float, 4> base_color;  ///< linear RGBA, 0..1
  std::uint32_t texture;            ///< into VTEX, or kNone
  std::uint32_t flags;              ///< OR of MaterialFlag
};
static_assert(sizeof(Material) == 32);

/// VTEX: a picture file (PNG, JPEG, ...) as the source had it; its bytes are TEXB[offset .. offset+bytes).
struct Texture {
  StringRef name;
  StringRef mime;
  std::uint64_t offset;
  std::uint64_t bytes;
};
static_assert(sizeof(Texture) == 32);

/// ATBC: barycentric attachment. x = x3 + sum_k weight[k] (x_k - x3) over the tetrahedron's vertices; weights lie
/// outside 0..1 where the visual vertex lies outside its tetrahedron.
struct BarycentricAttachment {
  std::uint32_t tetrahedron;
  std::array<float, 3> weight;
};
static_assert(sizeof(BarycentricAttachment) == 16);

/// ATCR: the run of ATCW that attaches a visual vertex to clusters: x = sum w (F_c q~_c(X) + c_c), X = VPOS.
struct ClusterAttachmentRange {
  std::uint32_t first;
  std::uint32_t count;
};
static_assert(sizeof(ClusterAttachmentRange) == 8);

/// ATCW.
struct ClusterAttachment {
  std::uint32_t cluster;
  float weight;  ///< sums to 1 for each visual vertex
};
static_assert(sizeof(ClusterAttachment) == 8);

/// VSRC: the source of a visual vertex.
struct VisualIdentity {
  std::uint32_t source_vertex;  ///< number in the source, counted over its meshes in SMSH's order
  std::uint32_t welded;         ///< number of the point it was welded into (by position)
};
static_assert(sizeof(VisualIdentity) == 8);

/// SVTX: the reverse, per source vertex. A source vertex no face uses has visual_count 0 and welded kNone.
struct SourceIdentity {
  std::uint32_t welded;
  std::uint32_t first_visual;  ///< into SVLS (u32: visual vertices)
  std::uint32_t visual_count;
};
static_assert(sizeof(SourceIdentity) == 12);

/// SMSH: meshes of the source, by the names the artist gave.
struct SourceMesh {
  StringRef name;
  std::uint32_t first_source_vertex;
  std::uint32_t source_vertex_count;
};
static_assert(sizeof(SourceMesh) == 16);

/// GRUP: named groups of the source; members (visual vertices) are GRPV[first .. first+count), ascending.
struct Group {
  StringRef name;
  std::uint32_t first;
  std::uint32_t count;
};
static_assert(sizeof(Group) == 16);

/// MASK: named weights of the recipe on visual vertices, MSKV[first .. first+count), visual vertices ascending: painted
/// or selected by an artist. For tools and games that ask by name; nothing is simulated from it.
struct Mask {
  StringRef name;
  std::uint32_t first;
  std::uint32_t count;  ///< may be 0
};
static_assert(sizeof(Mask) == 16);

/// MSKV.
struct MaskWeight {
  std::uint32_t vertex;  ///< visual vertex
  float weight;          ///< above 0, at most 1; vertices that are not listed weigh 0
};
static_assert(sizeof(MaskWeight) == 8);

namespace section {
inline constexpr std::uint32_t strings = fourcc("STRS"), info = fourcc("INFO"), pieces = fourcc("BODY"),
                               physical_vertices = fourcc("PVTX"), tetrahedra = fourcc("TETS"),
                               clusters = fourcc("CLUS"), memberships = fourcc("MEMB"),
                               quadratic_moments = fourcc("AQQ9"), mechanics = fourcc("CMEC"),
                               curve_points = fourcc("CURV"), channels = fourcc("CHAN"),
                               vertex_stiffness = fourcc("PSTF"), pin_weights = fourcc("PPIN"),
                               pin_sets = fourcc("PSET"), pin_set_vertices = fourcc("PSTV"), parts = fourcc("PART"),
                               part_vertices = fourcc("PRTV"), visual_positions = fourcc("VPOS"),
                               visual_normals = fourcc("VNRM"), visual_uv = fourcc("VUV0"),
                               visual_colors = fourcc("VCOL"), visual_triangles = fourcc("VTRI"),
                               sub_meshes = fourcc("VSUB"), materials = fourcc("VMAT"), textures = fourcc("VTEX"),
                               texture_bytes = fourcc("TEXB"), barycentric = fourcc("ATBC"),
                               cluster_attachment_ranges = fourcc("ATCR"), cluster_attachments = fourcc("ATCW"),
                               visual_identity = fourcc("VSRC"), source_identity = fourcc("SVTX"),
                               source_visual_list = fourcc("SVLS"), source_meshes = fourcc("SMSH"),
                               groups = fourcc("GRUP"), group_vertices = fourcc("GRPV"), masks = fourcc("MASK"),
                               mask_weights = fourcc("MSKV"), fields = fourcc("FELD"), field_functions = fourcc("FFUN"),
                               field_packs = fourcc("FPAK"), field_gradients = fourcc("FGRD"),
                               field_values = fourcc("FVAL"), field_points = fourcc("FPNT"),
                               field_point_values = fourcc("FPTV"), field_modes = fourcc("FMOD"),
                               field_fibres = fourcc("FFIB"), field_fibre_values = fourcc("FFBV"),
                               field_tethers = fourcc("FTHR"), field_tether_values = fourcc("FTHV"),
                               field_residuals = fourcc("FRES"), field_residual_values = fourcc("FRSV"),
                               field_residual_locals = fourcc("FRSL"), distance_grids = fourcc("DIST"),
                               distance_values = fourcc("DVAL");

/// All of them, in the order in which the writer lays sections out.
inline constexpr std::array kAll = {info,
                                    strings,
                                    pieces,
                                    physical_vertices,
                                    tetrahedra,
                                    clusters,
                                    memberships,
                                    quadratic_moments,
                                    mechanics,
                                    curve_points,
                                    channels,
                                    vertex_stiffness,
                                    pin_weights,
                                    pin_sets,
                                    pin_set_vertices,
                                    parts,
                                    part_vertices,
                                    visual_positions,
                                    visual_normals,
                                    visual_uv,
                                    visual_colors,
                                    visual_triangles,
                                    sub_meshes,
                                    materials,
                                    textures,
                                    texture_bytes,
                                    barycentric,
                                    cluster_attachment_ranges,
                                    cluster_attachments,
                                    visual_identity,
                                    source_identity,
                                    source_visual_list,
                                    source_meshes,
                                    groups,
                                    group_vertices,
                                    masks,
                                    mask_weights,
                                    fields,
                                    field_functions,
                                    field_packs,
                                    field_gradients,
                                    field_values,
                                    field_points,
                                    field_point_values,
                                    field_modes,
                                    field_fibres,
                                    field_fibre_values,
                                    field_tethers,
                                    field_tether_values,
                                    field_residuals,
                                    field_residual_values,
                                    field_residual_locals,
                                    distance_grids,
                                    distance_values};

/// Place of an id in kAll, or kAll.size() for an id this software does not know.
constexpr std::size_t indexOf(std::uint32_t id) {
  std::size_t i = 0;
  while (i < kAll.size() && kAll[i] != id) ++i;
  return i;
}
}  // namespace section

}  // namespace sinew::formats

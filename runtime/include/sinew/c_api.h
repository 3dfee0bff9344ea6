/* SPDX-License-Identifier: MIT
 *
 * Sinew for C and for foreign-function callers: load a package, add bodies to a world, step, read vertices.
 * docs/runtime.md tells the life of a body; samples/hello_runtime_c shows it in one page.
 *
 * Conventions
 *   - C99. All numbers are 32-bit unsigned or float unless they count bytes (size_t). SI units, right-handed, y up.
 *     Matrices are 9 floats, row by row.
 *   - Functions that can fail return a sinew_status: 0 is success. sinew_last_error() then says why, in one line. A
 * call that fails has done nothing.
 *   - Structs begin with struct_size. Fill one with its _init function (which sets all defaults), then change what is
 * to differ: a program built against an older header keeps working with a newer library.
 *   - A call that changes a world, or sinew_body_energy, must not overlap another on it. Other calls that take a const
 *     sinew_world may run side by side, but drawing calls must not overlap state calls. Drawing calls show bodies as
 *     drawn: sinew_body_visual_vertices, _sub_mesh and _bounds, nearest points, casts, overlaps. State calls tell of
 *     them after the last step: positions, velocities, motion, places, saved states, snapshots, all else about where
 *     they are. Of two calls that break this, the later fails: SINEW_ERROR_ARGUMENT, SINEW_ERROR_STATE where it
 *     restores; 0 where it returns no status. Pointers to world data are valid until the next call that changes it.
 *     Different worlds are independent. An asset may be used by many threads.
 *   - Nothing throws. Callbacks must not throw either, nor call their world.
 */
#ifndef SINEW_C_API_H
#define SINEW_C_API_H

#include <stddef.h>
#include <stdint.h>

#include "sinew/runtime/export.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Raised when a function or a struct changes in a way that old programs would notice; adding some does not. */
#define SINEW_C_API_VERSION 2

/* SINEW_C_API_VERSION of the library. Compare it with the header's at start. */
SINEW_API uint32_t sinew_c_api_version(void);
/* Version of the library, for example "0.1.0". */
SINEW_API const char* sinew_version(void);

typedef int32_t sinew_status;
#define SINEW_OK 0
#define SINEW_ERROR_ARGUMENT 1 /* a null pointer, an unknown body, a size or value that does not fit */
#define SINEW_ERROR_PACKAGE 2  /* the file cannot be read, or is not a sound package */
#define SINEW_ERROR_MEMORY 3   /* out of memory */
#define SINEW_ERROR_CAPACITY 4 /* a buffer of the caller's is too small */
#define SINEW_ERROR_STATE 5    /* saved bytes do not belong to this package or version, or are damaged */

/* Why the last call of this thread that failed did so; "" if none has. Valid until the next call of this thread. */
SINEW_API const char* sinew_last_error(void);

#define SINEW_NONE 0xffffffffu /* no such body, pick or index */

/* ---- Assets: what all bodies made from a package share ---- */

typedef struct sinew_asset sinew_asset;

/* Opens and checks a package file. path: UTF-8 or whatever the system takes. */
SINEW_API sinew_status sinew_asset_load(const char* path, sinew_asset** asset);
/* The same from memory. Copies: bytes may go as soon as this returns. */
SINEW_API sinew_status sinew_asset_from_memory(const void* bytes, size_t size, sinew_asset** asset);
/* The same from memory, without a copy. bytes: the whole package, at an address that is a multiple of 64
   (SINEW_ERROR_ARGUMENT otherwise); only read. They must stay, and stay as they are, until the asset is released and
   all bodies made from it are gone: what was checked here is not checked again. */
SINEW_API sinew_status sinew_asset_in_place(const void* bytes, size_t size, sinew_asset** asset);
/* Bodies keep what they need: an asset may be released while they live. Null is ignored. */
SINEW_API void sinew_asset_release(sinew_asset* asset);
/* Makes now what the first output of a body would make: for threads that load. */
SINEW_API sinew_status sinew_asset_prepare_drawing(const sinew_asset* asset);

typedef struct sinew_asset_info {
  uint32_t struct_size;
  uint32_t pieces; /* separate solids of the package, which are one body here */
  uint32_t physical_vertices;
  uint32_t tetrahedra;
  uint32_t clusters;
  uint32_t memberships;
  uint32_t visual_vertices;
  uint32_t visual_triangles;
  uint32_t sub_meshes;
  float diagonal;      /* of the bounds, m */
  float bounds_min[3]; /* of the visual vertices at rest, m, relative to the origin */
  float bounds_max[3];
  float total_mass; /* kg */
  double origin[3]; /* m, world position of the source that positions are relative to */
  uint32_t levels;  /* of detail that bodies can have: 1, the whole, and any that the bake has added */
} sinew_asset_info;

/* Fills as much of info as info->struct_size (set by the caller) has room for. */
SINEW_API sinew_status sinew_asset_get_info(const sinew_asset* asset, sinew_asset_info* info);

/* A section of the package in place: docs/package-format.md describes the records. id: for example
   SINEW_SECTION('V','T','R','I') for the visual triangles. A section that the package lacks gives null and 0. */
#define SINEW_SECTION(a, b, c, d) ((uint32_t)(a) | (uint32_t)(b) << 8 | (uint32_t)(c) << 16 | (uint32_t)(d) << 24)
SINEW_API sinew_status sinew_asset_section(const sinew_asset* asset, uint32_t id, const void** data, uint32_t* count,
                                           uint32_t* bytes_each);

/* The visual vertices that a sub-mesh's triangles use, as runs: pairs of first vertex and count, 2 * `*count` numbers,
   valid as long as the asset. */
SINEW_API sinew_status sinew_asset_sub_mesh_runs(const sinew_asset* asset, uint32_t sub_mesh, const uint32_t** runs,
                                                 uint32_t* count);

/* ---- Worlds ---- */

typedef struct sinew_world sinew_world;
typedef struct sinew_thread_pool sinew_thread_pool;

/* A job system for programs without one: `threads` that share each loop, the caller's included; 0 = one for each core.
   One world at a time may step with it. */
SINEW_API sinew_status sinew_thread_pool_create(uint32_t threads, sinew_thread_pool** pool);
SINEW_API void sinew_thread_pool_destroy(sinew_thread_pool* pool);

/* One part of a loop. */
typedef void (*sinew_range_function)(void* context, uint32_t begin, uint32_t end);

#define SINEW_LOG_INFO 0u
#define SINEW_LOG_WARNING 1u /* something was put right: a lost vertex, a setting out of range */
#define SINEW_LOG_ERROR 2u   /* a call was refused, or memory ran out */

/* Resources of a world from its creation to its end. Each callback gets its user pointer first. */
typedef struct sinew_world_options {
  uint32_t struct_size;
  uint32_t reserved; /* 0 */
  /* Memory of the world and its bodies; both null: the C++ heap. allocate returns null where there is none left;
     alignment is a power of two. release gets the size and alignment that allocate got. */
  void* allocator_user;
  void* (*allocate)(void* user, size_t bytes, size_t alignment);
  void (*release)(void* user, void* memory, size_t bytes, size_t alignment);
  /* The engine's job system; null: `pool`, and where that is null too, the calling thread. Calls range(context, b, e)
     over disjoint ranges that cover 0..count, possibly at the same time, none worth less than `grain` indices, and
     returns when all are done. */
  void* jobs_user;
  void (*parallel_for)(void* user, uint32_t count, uint32_t grain, sinew_range_function range, void* context);
  sinew_thread_pool* pool;
  /* Where the world tells what went wrong, in the calling thread; null: nowhere. The line is only valid in the call. */
  void* log_user;
  void (*log)(void* user, uint32_t severity, const char* line);
} sinew_world_options;

SINEW_API void sinew_world_options_init(sinew_world_options* options, size_t struct_size);

/* Settings of a world; may be changed between two steps. */
typedef struct sinew_world_settings {
  uint32_t struct_size;
  float gravity[3];                /* m/s^2; 0 -9.81 0 */
  uint32_t ground_enabled;         /* 0 or 1; 0 */
  float ground_normal[3];          /* unit; 0 1 0 */
  float ground_offset;             /* points with normal . x < offset are inside, m; 0 */
  float ground_friction;           /* Coulomb coefficient, 0..; 0.6 */
  uint32_t iterations;             /* bound on the work of a step (settings.h), 1..16; 4 */
  float damping;                   /* by the air, 1/s, 0..1e4; 0.2 */
  float deformation_damping_ratio; /* of what is not rigid motion and of contacts, to critical, 0..1; 0.25 */
  float support_damping;           /* of turning on supports, 1/s; 4 */
  float substep_seconds;           /* substep of sinew_world_advance(), s, 1e-5..1; 1/60 */
  uint32_t most_substeps;          /* that one call of it takes, 1..1000; 8 */
  float sleep_seconds;             /* what rests so long falls asleep, s; 0 never; 0 */
  uint32_t collisions;             /* 0 or 1: bodies touch each other, where their packages have distances; 0 */
  float wind[3];                   /* velocity of the air, m/s; 0 0 0 */
  float air_density;               /* kg/m^3, 0..1e4; 1.2 */
  float ground_restitution;        /* as sinew_collider_settings.restitution, 0..1; 0 */
  uint32_t report_contacts;        /* 0 or 1: whether sinew_world_contacts() is kept; 0 */
} sinew_world_settings;

SINEW_API void sinew_world_settings_init(sinew_world_settings* settings, size_t struct_size);

/* options may be null. Settings of which a value is out of its range, or no number, are SINEW_ERROR_ARGUMENT, and a
   world keeps those it has. */
SINEW_API sinew_status sinew_world_create(const sinew_world_settings* settings, const sinew_world_options* options,
                                          sinew_world** world);
SINEW_API void sinew_world_destroy(sinew_world* world);
SINEW_API sinew_status sinew_world_set_settings(sinew_world* world, const sinew_world_settings* settings);
SINEW_API sinew_status sinew_world_get_settings(const sinew_world* world, sinew_world_settings* settings);

/* Advances all bodies. seconds: above 0 and at most 60 (1e-5 .. 1 is tested). */
SINEW_API sinew_status sinew_world_step(sinew_world* world, float seconds);

/* Advances all bodies by a frame's time (0 .. 60 s) in substeps of substep_seconds; what is left over counts for
   the next call, and what is drawn lies between the last two substeps. steps: how many were taken; may be null. See
   sinew::World::advance(). */
SINEW_API sinew_status sinew_world_advance(sinew_world* world, float seconds, uint32_t* steps);

/* ---- Bodies ---- */

/* A body's solver. */
typedef struct sinew_solver sinew_solver;
/* Henriques' scheme: clusters matched one by one and averaged. Of the library sinew_report, which a program links only
   where it wants this. See sinew/runtime/report.h. */
SINEW_API const sinew_solver* sinew_report_solver(void);

typedef struct sinew_body_settings {
  uint32_t struct_size;
  float position[3];          /* m; 0 0 0 */
  float rotation[9];          /* proper rotation about the package's origin, applied before position; identity */
  float stiffness_scale;      /* multiplies all frequencies, 0..1e6; 1 */
  uint32_t keep_previous;     /* 1: keeps the positions before each step, for motion vectors; 0 */
  uint32_t package_pins;      /* 1: the body starts held by the pin sets of its package; 1 */
  const sinew_solver* solver; /* outlives the body; null: the fields of its package; null */
  float friction;             /* Coulomb coefficient, 0..1e4; below 0: that of the ground; -1 */
  uint32_t layers;            /* bits: a pair touches where each has a layer that the other's touches has; 1 */
  uint32_t touches;           /* all */
  float gravity_scale;        /* times the world's gravity, -1e4..1e4; 1 */
  float drag;                 /* of the air, by area of surface, 0..1e4: see sinew::BodySettings; 0 */
  uint32_t self_contact;      /* 1: its surface touches itself: see sinew::BodySettings; 0 */
  uint32_t level;        /* of detail, see sinew::BodySettings; sinew_asset_info.levels - 1 or more: its coarsest; 0 */
  float support_damping; /* of turning on supports, 0..1e4 1/s; below 0: that of the world; -1 */
} sinew_body_settings;

SINEW_API void sinew_body_settings_init(sinew_body_settings* settings, size_t struct_size);

/* Adds an instance of a package, at rest. settings may be null. body: its id, never used again in this world. */
SINEW_API sinew_status sinew_body_add(sinew_world* world, const sinew_asset* asset, const sinew_body_settings* settings,
                                      uint32_t* body);
SINEW_API sinew_status sinew_body_remove(sinew_world* world, uint32_t body);
/* Back to the state in which it was added; pins and picks are let go, the package's pin sets hold again. */
SINEW_API sinew_status sinew_body_reset(sinew_world* world, uint32_t body);
/* 1: it rests and is not stepped (sleep_seconds). Calls that change it or what it touches wake it. */
SINEW_API uint32_t sinew_body_is_asleep(const sinew_world* world, uint32_t body);
SINEW_API sinew_status sinew_body_wake(sinew_world* world, uint32_t body);
/* 1 if the world has it, else 0. */
SINEW_API uint32_t sinew_body_exists(const sinew_world* world, uint32_t body);
/* x becomes rotation x + translation; all else of the body's state turns along. */
SINEW_API sinew_status sinew_body_teleport(sinew_world* world, uint32_t body, const float rotation[9],
                                           const float translation[3]);
/* Teleports a body to where its pins and pin sets have been told to go: after a jump of the skeleton that holds it. */
SINEW_API sinew_status sinew_body_snap_to_pins(sinew_world* world, uint32_t body);

/* Positions (m, world) and velocities (m/s) of the physical vertices, 3 * `*count` floats in place, valid until the
   next call on this world that is not const. */
SINEW_API sinew_status sinew_body_positions(const sinew_world* world, uint32_t body, const float** xyz,
                                            uint32_t* count);
SINEW_API sinew_status sinew_body_velocities(const sinew_world* world, uint32_t body, const float** xyz,
                                             uint32_t* count);
/* Sets the whole state: 3 * count floats each, count the number of physical vertices. velocities may be null (zero). */
SINEW_API sinew_status sinew_body_set_state(sinew_world* world, uint32_t body, const float* positions,
                                            const float* velocities, uint32_t count);
/* Vertices whose state was lost when the last step began, and was put right. */
SINEW_API sinew_status sinew_body_repaired(const sinew_world* world, uint32_t body, uint32_t* count);

/* All that a body's further motion depends on, as bytes; see sinew::World::saveState. */
SINEW_API sinew_status sinew_body_state_size(const sinew_world* world, uint32_t body, size_t* size);
SINEW_API sinew_status sinew_body_save(const sinew_world* world, uint32_t body, void* bytes, size_t size,
                                       size_t* written);
SINEW_API sinew_status sinew_body_restore(sinew_world* world, uint32_t body, const void* bytes, size_t size);

/* ---- Holding and pulling ---- */

/* Holds a physical vertex at a place (m, world) until unpinned; call again to move it. */
SINEW_API sinew_status sinew_body_pin(sinew_world* world, uint32_t body, uint32_t vertex, const float target[3]);
SINEW_API sinew_status sinew_body_unpin(sinew_world* world, uint32_t body, uint32_t vertex);
SINEW_API sinew_status sinew_body_unpin_all(sinew_world* world, uint32_t body);

/* How a pin set holds its vertices where the report's solver moves the body: see sinew::PinMethod. */
#define SINEW_PIN_HOLD 0u
#define SINEW_PIN_INFINITE_MASS 1u
#define SINEW_PIN_MATRIX 2u
#define SINEW_PIN_CONSTRAINED_FIT 3u

/* Attaches `count` physical vertices to a rigid transform (a bone, a rigid body), which is now at position (m) and
   rotation, at the places that they have now. */
SINEW_API sinew_status sinew_body_pin_set(sinew_world* world, uint32_t body, const uint32_t* vertices, uint32_t count,
                                          const float position[3], const float rotation[9], uint32_t method,
                                          uint32_t* pin_set);
/* Moves the transform: reached at the end of the next step, or of the time of the next call of sinew_world_advance(),
   whose last step stops before it by what is left over. */
SINEW_API sinew_status sinew_pin_set_move(sinew_world* world, uint32_t pin_set, const float position[3],
                                          const float rotation[9]);
/* Where it is in what is drawn. */
SINEW_API sinew_status sinew_pin_set_drawn(const sinew_world* world, uint32_t pin_set, float position[3],
                                           float rotation[9]);
SINEW_API sinew_status sinew_pin_set_remove(sinew_world* world, uint32_t pin_set);
/* The pin set that the package names so; a body is held by all of them from the start (see sinew::World::pinSet). */
SINEW_API sinew_status sinew_body_find_pin_set(const sinew_world* world, uint32_t body, const char* name,
                                               uint32_t* pin_set);
/* Moves all of the package's pin sets that follow `target`: the motion of the rest shape (see sinew::World::pinSet).
   SINEW_ERROR_ARGUMENT where none does. */
SINEW_API sinew_status sinew_body_move_pin_target(sinew_world* world, uint32_t body, const char* target,
                                                  const float position[3], const float rotation[9]);
/* Force (N) and torque (N m, about the transform's position) on the transform's owner, mean of the last step. */
SINEW_API sinew_status sinew_pin_set_reaction(const sinew_world* world, uint32_t pin_set, float force[3],
                                              float torque[3]);

/* Contracts the fibres that a channel of the package activates. value: 0 (rest) .. 1. */
SINEW_API sinew_status sinew_body_set_activation(sinew_world* world, uint32_t body, uint32_t channel, float value);
SINEW_API sinew_status sinew_body_set_activation_by_name(sinew_world* world, uint32_t body, const char* channel,
                                                         float value);

/* Changes friction, layers, touches, self_contact, gravity_scale, drag, support_damping and level of a body; get gives
   all that it has. */
SINEW_API sinew_status sinew_body_set_settings(sinew_world* world, uint32_t body, const sinew_body_settings* settings);
SINEW_API sinew_status sinew_body_get_settings(const sinew_world* world, uint32_t body, sinew_body_settings* settings);

#define SINEW_ACTIVE 0u
#define SINEW_PAUSED 1u   /* it stands where it is as if it were rock */
#define SINEW_DISABLED 2u /* it stands, and neither touches nor is found */
SINEW_API sinew_status sinew_body_set_activity(sinew_world* world, uint32_t body, uint32_t activity);
SINEW_API sinew_status sinew_body_get_activity(const sinew_world* world, uint32_t body, uint32_t* activity);

/* A point of a body that stays with its material: of a triangle of visual or physical vertices. */
typedef struct sinew_body_point {
  uint32_t vertex[3];
  float weight[3];   /* of these, sum 1 */
  uint32_t physical; /* 1: vertices are physical ones; 0: visual ones */
} sinew_body_point;

/* The point of the drawn surface that lies nearest to a place (m, world), and where a point lies. */
SINEW_API sinew_status sinew_body_nearest_point(const sinew_world* world, uint32_t body, const float place[3],
                                                sinew_body_point* point);
SINEW_API sinew_status sinew_body_place_of(const sinew_world* world, uint32_t body, const sinew_body_point* point,
                                           float place[3]);
/* Gives a body momentum, N s, or pulls it in the next step, or call of sinew_world_advance() that takes one, N: at a
   point, or where at is null on all of its mass alike. */
SINEW_API sinew_status sinew_body_add_impulse(sinew_world* world, uint32_t body, const sinew_body_point* at,
                                              const float impulse[3]);
SINEW_API sinew_status sinew_body_add_force(sinew_world* world, uint32_t body, const sinew_body_point* at,
                                            const float force[3]);

/* The mean motion of a body's mass: its centre (m), velocities (m/s, rad/s) and mass (kg). */
typedef struct sinew_body_motion {
  uint32_t struct_size;
  float center[3], velocity[3], angular_velocity[3];
  float mass;
} sinew_body_motion;

/* Fills as much of motion as motion->struct_size (set by the caller) has room for. */
SINEW_API sinew_status sinew_body_get_motion(const sinew_world* world, uint32_t body, sinew_body_motion* motion);
/* Makes this the mean motion; how the body deforms stays. angular_velocity may be null (0). */
SINEW_API sinew_status sinew_body_set_velocity(sinew_world* world, uint32_t body, const float velocity[3],
                                               const float angular_velocity[3]);

/* Pulls the point that a visual vertex is attached to towards a place (m, world), as a spring of this frequency
   (Hz, 0.1 .. 100), critically damped, with at most most_force (N; 0: 50 times the body's weight on Earth). */
SINEW_API sinew_status sinew_body_pick(sinew_world* world, uint32_t body, uint32_t visual_vertex, const float target[3],
                                       float frequency_hz, float most_force, uint32_t* pick);
SINEW_API sinew_status sinew_pick_move(sinew_world* world, uint32_t pick, const float target[3]);
SINEW_API sinew_status sinew_pick_release(sinew_world* world, uint32_t pick);
/* The same of a point, and of what a ray (unit direction, within distance) meets first: pick SINEW_NONE where that is
   no body. */
SINEW_API sinew_status sinew_body_pick_point(sinew_world* world, uint32_t body, const sinew_body_point* at,
                                             const float target[3], float frequency_hz, float most_force,
                                             uint32_t* pick);
SINEW_API sinew_status sinew_world_pick_ray(sinew_world* world, const float origin[3], const float direction[3],
                                            float distance, float frequency_hz, float most_force, uint32_t* pick);
/* The pick whose target or point lies nearest to a ray, within radius (m): to take it up again; or SINEW_NONE. */
SINEW_API sinew_status sinew_world_pick_along(const sinew_world* world, const float origin[3], const float direction[3],
                                              float distance, float radius, uint32_t* pick);
/* A locked pick stays where sinew_pick_let_go() leaves it; others that releases. */
SINEW_API sinew_status sinew_pick_lock(sinew_world* world, uint32_t pick, uint32_t locked);
SINEW_API sinew_status sinew_pick_let_go(sinew_world* world, uint32_t pick);
/* All picks of a body; body SINEW_NONE: of the world. */
SINEW_API sinew_status sinew_picks_release(sinew_world* world, uint32_t body);
/* The ids of a body's picks, as many as fit into `capacity`. count: how many it has. */
SINEW_API sinew_status sinew_body_picks(const sinew_world* world, uint32_t body, uint32_t* picks, uint32_t capacity,
                                        uint32_t* count);

/* ---- What bodies collide with, and what lies where: sinew/runtime/collider.h, query.h ---- */

#define SINEW_GROUND_COLLIDER 0u /* the ground of the world's settings, where a collider is asked for or named */

#define SINEW_SHAPE_PLANE 0u
#define SINEW_SHAPE_SPHERE 1u
#define SINEW_SHAPE_CAPSULE 2u /* along y */
#define SINEW_SHAPE_BOX 3u
#define SINEW_SHAPE_HULL 4u         /* the convex hull of points, 4 .. 1024 */
#define SINEW_SHAPE_MESH 5u         /* triangles, counter-clockwise from outside; with a border a sheet */
#define SINEW_SHAPE_HEIGHT_FIELD 6u /* corner (column, row) at x = column cell, z = row cell; solid below */

/* A collider's shape in its own coordinates, metres. Only what its kind has counts; all is copied. */
typedef struct sinew_shape {
  uint32_t struct_size;
  uint32_t kind;             /* SINEW_SHAPE_...; sphere */
  float normal[3];           /* plane: unit; points with normal . x < offset are inside; 0 1 0 */
  float offset;              /* plane: m; 0 */
  float radius;              /* sphere, capsule: m, above 0; 0.5 */
  float half_length;         /* capsule: of the segment along y, m, above 0; 0.5 */
  float half_size[3];        /* box: m, above 0; 0.5 each */
  const float* points;       /* hull, mesh: xyz of each; null */
  uint32_t point_count;      /* 0 */
  uint32_t triangle_count;   /* 0 */
  const uint32_t* triangles; /* mesh: three points each; null */
  const float* heights;      /* height field: m, columns * rows, row by row; null */
  uint32_t columns, rows;    /* 2 .. 4096 each; 0 */
  float cell;                /* m, above 0; 1 */
} sinew_shape;

SINEW_API void sinew_shape_init(sinew_shape* shape, size_t struct_size);

typedef struct sinew_collider_settings {
  uint32_t struct_size;
  float position[3];         /* m; 0 0 0 */
  float rotation[9];         /* proper; identity */
  float friction;            /* Coulomb coefficient, 0..1e4; 0.6 */
  float restitution;         /* part of an impact's momentum that is given back, 0..1; 0 */
  uint32_t layers;           /* as of a body; 1 */
  uint32_t touches;          /* all */
  float mass;                /* kg, of the engine's rigid body; 0: it moves as it is told; 0 */
  float inertia[3];          /* kg m^2, along its axes; 0: it does not turn about that; 0 0 0 */
  float most_speed;          /* m/s, above 0, at which sinew_collider_move() is followed; infinity: in a step */
  float surface_velocity[3]; /* m/s, along its axes: a belt's; 0 0 0 */
} sinew_collider_settings;

SINEW_API void sinew_collider_settings_init(sinew_collider_settings* settings, size_t struct_size);

/* settings may be null. */
SINEW_API sinew_status sinew_collider_add(sinew_world* world, const sinew_shape* shape,
                                          const sinew_collider_settings* settings, uint32_t* collider);
/* Reached as sinew_pin_set_move() says, so that its speed is known. What jumps is removed and added. */
SINEW_API sinew_status sinew_collider_move(sinew_world* world, uint32_t collider, const float position[3],
                                           const float rotation[9]);
/* Where it is after the last step: an engine's rigid body, which has given way, goes on from there. */
SINEW_API sinew_status sinew_collider_pose(const sinew_world* world, uint32_t collider, float position[3],
                                           float rotation[9]);
/* Where it is in what is drawn. */
SINEW_API sinew_status sinew_collider_drawn(const sinew_world* world, uint32_t collider, float position[3],
                                            float rotation[9]);
/* Changes all but position and rotation; get gives all that it has. */
SINEW_API sinew_status sinew_collider_set_settings(sinew_world* world, uint32_t collider,
                                                   const sinew_collider_settings* settings);
SINEW_API sinew_status sinew_collider_get_settings(const sinew_world* world, uint32_t collider,
                                                   sinew_collider_settings* settings);
SINEW_API sinew_status sinew_collider_remove(sinew_world* world, uint32_t collider);
/* Bodies' impulse on it in the last step, N s, and its moment about the collider's position, N m s. */
SINEW_API sinew_status sinew_collider_reaction(const sinew_world* world, uint32_t collider, float impulse[3],
                                               float torque_impulse[3]);

typedef struct sinew_contact_event {
  uint32_t body, collider; /* collider SINEW_NONE: of two bodies */
  uint32_t began;          /* 1; 0: ended */
  uint32_t other;          /* second body, the same one of what touches itself; SINEW_NONE: of a collider */
} sinew_contact_event;

/* Which pairs began or ceased to touch in the last step, as many as fit into `capacity`. count: how many there are. */
SINEW_API sinew_status sinew_world_contact_events(const sinew_world* world, sinew_contact_event* events,
                                                  uint32_t capacity, uint32_t* count);

typedef struct sinew_contact {
  uint32_t body;     /* a body and what pushed it */
  uint32_t collider; /* SINEW_NONE: of two bodies */
  uint32_t other;    /* second body, the same one of what touches itself; SINEW_NONE: of a collider */
  float point[3];    /* mean of the places where they push, by how hard they do, metres, world */
  float normal[3];   /* unit, the way in which `body` is pushed, without friction */
  float impulse[3];  /* on `body`, friction included, N s; of what touches itself 0 */
  float speed;       /* m/s at which the fastest of the places that began to touch came; 0 where none did */
} sinew_contact;

/* All that pushed a body in the last step, once for each pair, as many as fit into `capacity`. count: how many there
   are; none without sinew_world_settings.report_contacts. */
SINEW_API sinew_status sinew_world_contacts(const sinew_world* world, sinew_contact* contacts, uint32_t capacity,
                                            uint32_t* count);

typedef struct sinew_query_filter {
  uint32_t struct_size;
  uint32_t layers;    /* bits: what is in any of these counts; all */
  uint32_t bodies;    /* 1: bodies, by the triangles that are drawn; 1 */
  uint32_t colliders; /* 1: colliders and the ground; 1 */
} sinew_query_filter;

SINEW_API void sinew_query_filter_init(sinew_query_filter* filter, size_t struct_size);

/* A body, or where body is SINEW_NONE a collider. */
typedef struct sinew_query_object {
  uint32_t body, collider;
} sinew_query_object;

typedef struct sinew_cast_hit {
  sinew_query_object object;
  float distance;    /* that the ray, or the ball, has gone, m */
  float point[3];    /* of the surface, m, world */
  float normal[3];   /* unit, of the surface there */
  uint32_t triangle; /* visual triangle of a body, or SINEW_NONE */
} sinew_cast_hit;

/* First hit of a ball of this radius (m; 0: a ray) along a direction (unit) within a distance (m). filter may be
   null. found: 1, and hit is filled; or 0. */
SINEW_API sinew_status sinew_world_cast(const sinew_world* world, const float origin[3], float radius,
                                        const float direction[3], float distance, const sinew_query_filter* filter,
                                        sinew_cast_hit* hit, uint32_t* found);
/* Objects that touch or contain a ball, or a box: bodies by their ids, then colliders, as many as fit into
   `capacity`. count: how many there are. */
SINEW_API sinew_status sinew_world_overlaps_sphere(const sinew_world* world, const float center[3], float radius,
                                                   const sinew_query_filter* filter, sinew_query_object* objects,
                                                   uint32_t capacity, uint32_t* count);
SINEW_API sinew_status sinew_world_overlaps_box(const sinew_world* world, const float half_size[3],
                                                const float position[3], const float rotation[9],
                                                const sinew_query_filter* filter, sinew_query_object* objects,
                                                uint32_t capacity, uint32_t* count);

/* The bodies, colliders and pin sets there are, as many as fit into `capacity`. count: how many there are. */
SINEW_API sinew_status sinew_world_bodies(const sinew_world* world, uint32_t* bodies, uint32_t capacity,
                                          uint32_t* count);
SINEW_API sinew_status sinew_world_colliders(const sinew_world* world, uint32_t* colliders, uint32_t capacity,
                                             uint32_t* count);
SINEW_API sinew_status sinew_body_pin_sets(const sinew_world* world, uint32_t body, uint32_t* pin_sets,
                                           uint32_t capacity, uint32_t* count);

/* The state of a whole world as bytes: see sinew::World::saveSnapshot. assets: of bodies that the world has not. */
SINEW_API sinew_status sinew_world_snapshot_size(const sinew_world* world, size_t* size);
SINEW_API sinew_status sinew_world_save(const sinew_world* world, void* bytes, size_t size, size_t* written);
SINEW_API sinew_status sinew_world_restore(sinew_world* world, const void* bytes, size_t size,
                                           const sinew_asset* const* assets, uint32_t asset_count);

/* ---- Outputs ---- */

/* Where to write: element i of a stream at data + i * stride bytes; null data: not wanted. Element i is visual vertex
   i. See sinew/runtime/output.h for what each stream holds. */
typedef struct sinew_visual_output {
  uint32_t struct_size;
  uint32_t positions_stride; /* bytes, >= 12, a multiple of 4; 12 */
  float* positions;          /* m, world */
  float* normals;            /* unit */
  float* tangents;           /* xyz unit, w +1 or -1 */
  float* previous_positions; /* before the last step, m; needs keep_previous */
  uint32_t normals_stride;   /* 12 */
  uint32_t tangents_stride;  /* >= 16; 16 */
  uint32_t previous_stride;  /* 12 */
  uint32_t count;            /* elements the buffers have room for */
} sinew_visual_output;

SINEW_API void sinew_visual_output_init(sinew_visual_output* output, size_t struct_size);

SINEW_API sinew_status sinew_body_visual_vertices(const sinew_world* world, uint32_t body,
                                                  const sinew_visual_output* output);
/* The same of several bodies, each at most once, side by side by the world's job system. outputs: one for each body,
   one behind the other, each of outputs[0].struct_size bytes. */
SINEW_API sinew_status sinew_world_visual_vertices(const sinew_world* world, const uint32_t* bodies,
                                                   const sinew_visual_output* outputs, uint32_t count);
/* Only the vertices that a sub-mesh uses, at their places in the whole mesh. */
SINEW_API sinew_status sinew_body_visual_sub_mesh(const sinew_world* world, uint32_t body, uint32_t sub_mesh,
                                                  const sinew_visual_output* output);

/* Boxes along the axes (m, world) around the physical and around the visual vertices; low and high: 3 floats each. */
SINEW_API sinew_status sinew_body_physical_bounds(const sinew_world* world, uint32_t body, float low[3], float high[3]);
SINEW_API sinew_status sinew_body_visual_bounds(const sinew_world* world, uint32_t body, float low[3], float high[3]);

/* Rigid motion that best maps the rest shape onto the current one: x ~ rotation X + translation. */
SINEW_API sinew_status sinew_body_rigid_motion(const sinew_world* world, uint32_t body, float rotation[9],
                                               float translation[3]);
/* Kinetic energy, and what the shape stores, J. Either may be null. */
SINEW_API sinew_status sinew_body_energy(const sinew_world* world, uint32_t body, double* kinetic, double* elastic);
/* Moves the origin: bodies, targets and the ground are `by` (m) nearer to it. */
SINEW_API sinew_status sinew_world_shift_origin(sinew_world* world, const float by[3]);
/* The transform that best fits a cluster: its centre (m, world) and linear part. */
SINEW_API sinew_status sinew_body_cluster_frame(const sinew_world* world, uint32_t body, uint32_t cluster,
                                                float center[3], float linear[9]);
/* Change of a cluster's rest shape by plasticity and activation: the identity where it has neither. */
SINEW_API sinew_status sinew_body_cluster_rest_shape(const sinew_world* world, uint32_t body, uint32_t cluster,
                                                     float shape[9]);

/* ---- Cutting: in the library sinew_cut, beside the runtime. sinew/runtime/cut.h tells what holds of a cut ---- */

typedef struct sinew_cut sinew_cut;

typedef struct sinew_cut_settings {
  uint32_t struct_size;
  float spacing;                /* of points inside the section, m; 0: as its rim, about 1,000 at most; 0 */
  float least_part;             /* parts of less of the body's mass stay with their neighbour, 0..0.5; 1e-4 */
  float section_color[4];       /* linear red, green, blue, alpha, 0..1; 0.75 0.25 0.2 1 */
  uint32_t close_open_surfaces; /* 1: also loops of surfaces that enclose nothing are closed; 0 */
  uint32_t keep_textures;       /* 1: parts hold copies of the package's pictures; 1 */
} sinew_cut_settings;

SINEW_API void sinew_cut_settings_init(sinew_cut_settings* settings, size_t struct_size);

/* Cuts a body along the plane through point (m, world) with this normal (any length but 0): its parts take its place,
   with its motion and holds. On refusal it stays. settings may be null. cut: what to ask about the parts, to be
   released. */
SINEW_API sinew_status sinew_body_cut(sinew_world* world, uint32_t body, const float point[3], const float normal[3],
                                      const sinew_cut_settings* settings, sinew_cut** cut);
/* The same along a convex quadrilateral: four corners in order around it (m, world), near one plane. It leaves a slit;
   what it severs is a part. Above is where the corners turn counter-clockwise. */
SINEW_API sinew_status sinew_body_cut_bounded(sinew_world* world, uint32_t body, const float corners[12],
                                              const sinew_cut_settings* settings, sinew_cut** cut);
/* The bodies stay. Null is ignored. */
SINEW_API void sinew_cut_release(sinew_cut* cut);
/* How many parts there are; 0 of null. */
SINEW_API uint32_t sinew_cut_part_count(const sinew_cut* cut);

/* Where a visual vertex of a part comes from: at a + t (b - a) + s (c - a) of visual vertices of the body that was cut;
   a and b SINEW_NONE: inside the section; c SINEW_NONE: on the edge a b. */
typedef struct sinew_cut_origin {
  uint32_t a, b;
  float t;
  uint32_t c;
  float s;
} sinew_cut_origin;

typedef struct sinew_cut_part {
  uint32_t struct_size;
  uint32_t body;
  uint32_t above; /* 1: on the side to which the normal points */
  uint32_t visual_count, physical_count;
  uint32_t reserved;              /* 0 */
  double mass, volume;            /* kg; m^3, that the surface encloses at rest */
  const sinew_cut_origin* visual; /* of the visual vertices; as long as the cut */
  const uint32_t* physical;       /* of the physical vertices: that of the body that was cut; twice beside a slit */
} sinew_cut_part;

/* Fills as much of part as part->struct_size (set by the caller) has room for. */
SINEW_API sinew_status sinew_cut_get_part(const sinew_cut* cut, uint32_t number, sinew_cut_part* part);
/* The package of a part, with its triangles; the caller releases it. */
SINEW_API sinew_status sinew_cut_part_asset(const sinew_cut* cut, uint32_t number, sinew_asset** asset);

/* Successor of a pin set or a pick. */
typedef struct sinew_cut_heir {
  uint32_t before, now;
  uint32_t body;
} sinew_cut_heir;

/* As long as the cut. A set has one for each part with vertices of it. */
SINEW_API sinew_status sinew_cut_pin_sets(const sinew_cut* cut, const sinew_cut_heir** heirs, uint32_t* count);
SINEW_API sinew_status sinew_cut_picks(const sinew_cut* cut, const sinew_cut_heir** heirs, uint32_t* count);

#ifdef __cplusplus
}
#endif

#endif

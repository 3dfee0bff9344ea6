/* SPDX-License-Identifier: MIT
 *
 * The C interface, from C99: every function once with sound arguments and once with unsound ones, and the promises of
 * the header: memory through the caller's allocator only and all of it given back, the caller's jobs, the log, older
 * and newer structs, state that goes on bit for bit.
 *
 *   c_api_test PACKAGE.sinew
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sinew/c_api.h"

static int failures = 0;

#define CHECK(condition)                                                                                        \
  do {                                                                                                          \
    if (!(condition)) {                                                                                         \
      printf("%s:%d: %s does not hold (last error: %s)\n", __FILE__, __LINE__, #condition, sinew_last_error()); \
      ++failures;                                                                                               \
    }                                                                                                           \
  } while (0)
#define CHECK_OK(call) CHECK((call) == SINEW_OK)
/* Refused, with a reason. */
#define CHECK_FAILS(status, call) CHECK((call) == (status) && strlen(sinew_last_error()) > 5)

typedef struct memory {
  size_t allocations, live_blocks, live_bytes;
  int dry;
} memory;

static void* allocate(void* user, size_t bytes, size_t alignment) {
  memory* counts = (memory*)user;
  /* The block's own address lies in front of what is handed out. */
  char *block, *aligned;
  if (counts->dry) return NULL;
  block = malloc(bytes + alignment + sizeof(void*));
  if (block == NULL) return NULL;
  aligned = block + sizeof(void*);
  aligned += (alignment - (size_t)aligned % alignment) % alignment;
  memcpy(aligned - sizeof(void*), &block, sizeof(void*));
  ++counts->allocations;
  ++counts->live_blocks;
  counts->live_bytes += bytes;
  return aligned;
}

static void release(void* user, void* given, size_t bytes, size_t alignment) {
  memory* counts = (memory*)user;
  void* block;
  (void)alignment;
  memcpy(&block, (char*)given - sizeof(void*), sizeof(void*));
  --counts->live_blocks;
  counts->live_bytes -= bytes;
  free(block);
}

static void backwards(void* user, uint32_t count, uint32_t grain, sinew_range_function range, void* context) {
  (void)grain;
  ++*(int*)user;
  while (count > 0) {
    --count;
    range(context, count, count + 1);
  }
}

typedef struct told {
  int errors, warnings;
  char last[256];
} told;

static void onLog(void* user, uint32_t severity, const char* line) {
  told* log = (told*)user;
  if (severity == SINEW_LOG_ERROR) ++log->errors;
  if (severity == SINEW_LOG_WARNING) ++log->warnings;
  strncpy(log->last, line, sizeof log->last - 1);
}

static void testAsset(const char* path, sinew_asset** asset) {
  sinew_asset* none = NULL;
  sinew_asset_info info;
  const void* data;
  const uint32_t* runs;
  uint32_t count, bytes_each;
  FILE* file;
  char* bytes;
  long size;

  CHECK(sinew_c_api_version() == SINEW_C_API_VERSION);
  CHECK(strchr(sinew_version(), '.') != NULL);
  CHECK_FAILS(SINEW_ERROR_PACKAGE, sinew_asset_load("no/such/file.sinew", &none));
  CHECK(strstr(sinew_last_error(), "no/such/file.sinew") != NULL);
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_asset_load(NULL, &none));
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_asset_load(path, NULL));
  CHECK(none == NULL);
  CHECK_OK(sinew_asset_load(path, asset));

  info.struct_size = sizeof info;
  CHECK_OK(sinew_asset_get_info(*asset, &info));
  {
    sinew_world_settings zero; /* as memset leaves it */
    sinew_world* refused = NULL;
    memset(&zero, 0, sizeof zero);
    CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_world_create(&zero, NULL, &refused));
    CHECK(strstr(sinew_last_error(), "_init") != NULL && refused == NULL);
  }
  CHECK(info.physical_vertices > 0 && info.clusters > 0 && info.visual_vertices > 0 && info.pieces == 1);
  CHECK(info.diagonal > 0 && info.total_mass > 0 && info.bounds_max[0] > info.bounds_min[0]);
  {
    /* A struct from before the later fields: nothing behind struct_size is touched. */
    sinew_asset_info older;
    memset(&older, 0x5a, sizeof older);
    older.struct_size = (uint32_t)offsetof(sinew_asset_info, clusters);
    CHECK_OK(sinew_asset_get_info(*asset, &older));
    CHECK(older.physical_vertices == info.physical_vertices && older.clusters == 0x5a5a5a5au);
  }

  CHECK_OK(sinew_asset_prepare_drawing(*asset));
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_asset_prepare_drawing(NULL));
  CHECK_OK(sinew_asset_section(*asset, SINEW_SECTION('V', 'T', 'R', 'I'), &data, &count, &bytes_each));
  CHECK(data != NULL && count == info.visual_triangles && bytes_each == 12);
  CHECK_OK(sinew_asset_section(*asset, SINEW_SECTION('C', 'L', 'U', 'S'), &data, &count, &bytes_each));
  CHECK(data != NULL && count == info.clusters && bytes_each == 88);
  CHECK_OK(sinew_asset_section(*asset, SINEW_SECTION('S', 'T', 'R', 'S'), &data, &count, &bytes_each));
  CHECK(data != NULL && count > 0 && bytes_each == 1);
  CHECK_OK(sinew_asset_section(*asset, SINEW_SECTION('N', 'O', 'N', 'E'), &data, &count, &bytes_each));
  CHECK(data == NULL && count == 0);
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_asset_section(NULL, 0, &data, &count, &bytes_each));
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_asset_sub_mesh_runs(*asset, 1000, &runs, &count));
  if (info.sub_meshes > 0) {
    CHECK_OK(sinew_asset_sub_mesh_runs(*asset, 0, &runs, &count));
    CHECK(count > 0 && runs[0] + runs[1] <= info.visual_vertices);
  }

  file = fopen(path, "rb");
  CHECK(file != NULL);
  if (file == NULL) return;
  fseek(file, 0, SEEK_END);
  size = ftell(file);
  rewind(file);
  bytes = malloc((size_t)size);
  CHECK(bytes != NULL && fread(bytes, 1, (size_t)size, file) == (size_t)size);
  fclose(file);
  CHECK_FAILS(SINEW_ERROR_PACKAGE, sinew_asset_from_memory(bytes, (size_t)size - 1, &none));
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_asset_from_memory(NULL, 10, &none));
  CHECK_OK(sinew_asset_from_memory(bytes, (size_t)size, &none));
  {
    /* The asset has its own copy: the caller's bytes may go. In place, it has none. */
    char* block = malloc((size_t)size + 128);
    char* aligned;
    const void* copied;
    sinew_asset* in_place = NULL;
    CHECK(block != NULL);
    if (block == NULL) return;
    aligned = block + (64 - (size_t)block % 64) % 64;
    memcpy(aligned, bytes, (size_t)size);
    memset(bytes, 0x5a, (size_t)size);
    CHECK_OK(sinew_asset_in_place(aligned, (size_t)size, &in_place));
    CHECK_OK(sinew_asset_section(in_place, SINEW_SECTION('C', 'L', 'U', 'S'), &data, &count, &bytes_each));
    CHECK((const char*)data > aligned && (const char*)data < aligned + size && count == info.clusters);
    CHECK_OK(sinew_asset_section(none, SINEW_SECTION('C', 'L', 'U', 'S'), &copied, &count, &bytes_each));
    CHECK(copied != data && count == info.clusters && memcmp(copied, data, (size_t)count * bytes_each) == 0);
    sinew_asset_release(none);
    sinew_asset_release(in_place);
    none = NULL;
    memmove(aligned + 8, aligned, (size_t)size);
    CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_asset_in_place(aligned + 8, (size_t)size, &none));
    CHECK(strstr(sinew_last_error(), "multiple of 64") != NULL);
    CHECK_FAILS(SINEW_ERROR_PACKAGE, sinew_asset_in_place(aligned, (size_t)size, &none));
    CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_asset_in_place(NULL, 10, &none));
    CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_asset_in_place(aligned, (size_t)size, NULL));
    CHECK(none == NULL);
    free(block);
  }
  sinew_asset_release(NULL);
  free(bytes);
}

static void testMotion(const sinew_asset* asset) {
  sinew_world_options options;
  sinew_world_settings settings;
  sinew_body_settings placement;
  sinew_visual_output output;
  sinew_asset_info info = {0};
  sinew_world* world = NULL;
  memory counts = {0, 0, 0, 0};
  told log = {0, 0, ""};
  int jobs = 0;
  uint32_t body = SINEW_NONE, other = SINEW_NONE, pick = SINEW_NONE, picks[4], count, i;
  const float *x, *v;
  float low[3], high[3], rotation[9], vector[3], matrix[9], *state, *after, *visual;
  const float identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, up[3] = {0, 3, 0}, target[3] = {1, 2, 0};
  size_t size = 0, written = 0, floats;
  unsigned char* saved;

  info.struct_size = sizeof info;
  CHECK_OK(sinew_asset_get_info(asset, &info));
  CHECK(info.levels == 1);
  sinew_world_options_init(&options, sizeof options);
  CHECK(options.struct_size == sizeof options && options.allocate == NULL);
  options.allocator_user = &counts;
  options.allocate = allocate;
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_world_create(NULL, &options, &world)); /* no release */
  options.release = release;
  options.jobs_user = &jobs;
  options.parallel_for = backwards;
  options.log_user = &log;
  options.log = onLog;
  sinew_world_settings_init(&settings, sizeof settings);
  CHECK(settings.gravity[1] < -9 && settings.iterations == 4);
  settings.ground_enabled = 1;
  counts.dry = 1;
  CHECK_FAILS(SINEW_ERROR_MEMORY, sinew_world_create(&settings, &options, &world));
  counts.dry = 0;
  CHECK(counts.live_blocks == 0 && world == NULL);
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_world_create(&settings, &options, NULL));
  CHECK_OK(sinew_world_create(&settings, &options, &world));
  CHECK(counts.live_blocks > 0);

  sinew_body_settings_init(&placement, sizeof placement);
  placement.position[1] = 1;
  placement.keep_previous = 1;
  CHECK_OK(sinew_body_add(world, asset, &placement, &body));
  CHECK_OK(sinew_body_add(world, asset, NULL, &other));
  CHECK(body != other && sinew_body_exists(world, body) == 1 && sinew_body_exists(world, 99) == 0);
  placement.rotation[0] = 7;
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_body_add(world, asset, &placement, &pick));
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_body_add(world, NULL, NULL, &pick));
  counts.dry = 1;
  CHECK_FAILS(SINEW_ERROR_MEMORY, sinew_body_add(world, asset, NULL, &pick));
  counts.dry = 0;
  CHECK_OK(sinew_body_remove(world, other));
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_body_remove(world, other));

  settings.gravity[1] = -5;
  CHECK_OK(sinew_world_set_settings(world, &settings));
  memset(&settings, 0, sizeof settings);
  settings.struct_size = sizeof settings;
  CHECK_OK(sinew_world_get_settings(world, &settings));
  CHECK(settings.gravity[1] == -5 && settings.ground_enabled == 1);
  {
    /* What the world would not compute with is refused, and changes nothing. */
    float* const values[] = {&settings.gravity[0], &settings.damping, &settings.substep_seconds,
                             &settings.ground_offset};
    for (i = 0; i < sizeof values / sizeof *values; ++i) {
      const float sound = *values[i];
      sinew_world* refused = NULL;
      *values[i] = nanf("");
      CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_world_set_settings(world, &settings));
      CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_world_create(&settings, NULL, &refused));
      CHECK(refused == NULL);
      *values[i] = sound;
    }
    CHECK_OK(sinew_world_get_settings(world, &settings));
    CHECK(settings.gravity[1] == -5 && settings.damping >= 0);
  }

  CHECK_OK(sinew_body_positions(world, body, &x, &count));
  CHECK(count == info.physical_vertices);
  CHECK_OK(sinew_body_pin(world, body, 0, x));
  CHECK_OK(sinew_body_pick(world, body, 1, target, 4, 0, &pick));
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_body_pick(world, body, 100000, target, 4, 0, &pick));
  CHECK_OK(sinew_pick_move(world, pick, up));
  CHECK_OK(sinew_body_picks(world, body, picks, 4, &count));
  CHECK(count == 1 && picks[0] == pick);
  CHECK_OK(sinew_world_step(world, 1.0f / 60));
  {
    const size_t before = counts.allocations;
    for (i = 0; i < 30; ++i) CHECK_OK(sinew_world_step(world, 1.0f / 60));
    CHECK(counts.allocations == before);
  }
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_world_step(world, -1));
  {
    uint32_t steps = 9, sum = 0;
    for (i = 0; i < 24; ++i) {
      CHECK_OK(sinew_world_advance(world, 1.0f / 144, &steps));
      sum += steps;
    }
    CHECK(steps <= 1 && sum == 10); /* 24 frames of 144 a second are 10 steps of 1/60 s */
    CHECK_OK(sinew_world_advance(world, 1.0f, NULL));
    CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_world_advance(world, -1, &steps));
  }
  CHECK(log.errors > 0);

  /* The report's scheme, which this program links. */
  sinew_body_settings_init(&placement, sizeof placement);
  CHECK(placement.solver == NULL);
  placement.solver = sinew_report_solver();
  CHECK_OK(sinew_body_add(world, asset, &placement, &other));
  CHECK_OK(sinew_world_step(world, 1.0f / 60));
  CHECK_OK(sinew_body_remove(world, other));

  /* Saved, gone on, restored, gone on: the same bits. */
  floats = 3 * (size_t)info.physical_vertices;
  CHECK_OK(sinew_body_state_size(world, body, &size));
  saved = malloc(size);
  state = malloc(floats * sizeof(float));
  after = malloc(floats * sizeof(float));
  CHECK(saved != NULL && state != NULL && after != NULL && size > 0);
  CHECK_FAILS(SINEW_ERROR_CAPACITY, sinew_body_save(world, body, saved, size - 1, &written));
  CHECK_OK(sinew_body_save(world, body, saved, size, &written));
  CHECK(written == size);
  for (i = 0; i < 20; ++i) CHECK_OK(sinew_world_step(world, 1.0f / 60));
  CHECK_OK(sinew_body_positions(world, body, &x, &count));
  memcpy(after, x, floats * sizeof(float));
  CHECK_OK(sinew_body_restore(world, body, saved, size));
  CHECK_OK(sinew_body_positions(world, body, &x, &count));
  CHECK(memcmp(after, x, floats * sizeof(float)) != 0);
  for (i = 0; i < 20; ++i) CHECK_OK(sinew_world_step(world, 1.0f / 60));
  CHECK_OK(sinew_body_positions(world, body, &x, &count));
  CHECK(memcmp(after, x, floats * sizeof(float)) == 0);
  CHECK_FAILS(SINEW_ERROR_STATE, sinew_body_restore(world, body, saved, size / 2));
  saved[0] = 'x';
  CHECK_FAILS(SINEW_ERROR_STATE, sinew_body_restore(world, body, saved, size));

  CHECK_OK(sinew_pick_release(world, pick));
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_pick_move(world, pick, up));
  CHECK_OK(sinew_body_unpin(world, body, 0));
  CHECK_OK(sinew_body_unpin_all(world, body));

  /* The package has no pin sets to be found or moved. */
  {
    const float here[3] = {0, 0, 0}, unturned[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    uint32_t set = 7;
    CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_body_find_pin_set(world, body, "skull", &set));
    CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_body_find_pin_set(world, body, NULL, &set));
    CHECK(set == 7);
    CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_body_move_pin_target(world, body, "jaw", here, unturned));
  }

  /* A bone that holds three vertices of a body under gravity. */
  {
    const uint32_t held[3] = {0, 1, 2}, twice[2] = {3, 3};
    const float origin[3] = {0, 0, 0};
    uint32_t set = SINEW_NONE;
    float force[3], torque[3], at[3], turned[9];
    CHECK_OK(sinew_body_pin_set(world, body, held, 3, origin, identity, SINEW_PIN_CONSTRAINED_FIT, &set));
    CHECK_FAILS(SINEW_ERROR_ARGUMENT,
                sinew_body_pin_set(world, body, held, 3, origin, identity, SINEW_PIN_HOLD, &pick));
    CHECK_FAILS(SINEW_ERROR_ARGUMENT,
                sinew_body_pin_set(world, body, twice, 2, origin, identity, SINEW_PIN_HOLD, &pick));
    CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_body_pin_set(world, body, twice, 1, origin, identity, 99, &pick));
    CHECK_OK(sinew_pin_set_move(world, set, up, identity));
    CHECK_OK(sinew_world_step(world, 1.0f / 60));
    CHECK_OK(sinew_pin_set_reaction(world, set, force, torque));
    CHECK(force[1] < 0); /* lifting the body pulls the bone down */
    CHECK_OK(sinew_pin_set_drawn(world, set, at, turned));
    CHECK(at[0] == up[0] && at[1] == up[1] && turned[8] == 1);
    CHECK_OK(sinew_pin_set_move(world, set, origin, identity));
    CHECK_OK(sinew_body_snap_to_pins(world, body));
    CHECK_OK(sinew_pin_set_drawn(world, set, at, turned));
    CHECK(fabsf(at[1]) < 1e-5f);
    CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_body_snap_to_pins(world, 12345));
    CHECK_OK(sinew_pin_set_remove(world, set));
    CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_pin_set_remove(world, set));
    CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_pin_set_move(world, set, up, identity));
    CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_pin_set_reaction(world, set, force, torque));
    CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_body_set_activation(world, body, 1000, 0.5f));
    CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_body_set_activation_by_name(world, body, "no such channel", 0.5f));
  }

  /* Teleport and set_state. */
  CHECK_OK(sinew_body_reset(world, body));
  CHECK_OK(sinew_body_positions(world, body, &x, &count));
  memcpy(state, x, floats * sizeof(float));
  CHECK_OK(sinew_body_teleport(world, body, identity, up));
  CHECK_OK(sinew_body_positions(world, body, &x, &count));
  for (i = 0; i < floats; ++i) CHECK(fabsf(x[i] - state[i] - (i % 3 == 1 ? 3.0f : 0.0f)) < 1e-5f);
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_body_teleport(world, body, NULL, up));
  CHECK_OK(sinew_body_set_state(world, body, state, state, info.physical_vertices));
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_body_set_state(world, body, state, NULL, info.physical_vertices - 1));
  CHECK_OK(sinew_body_velocities(world, body, &v, &count));
  CHECK(count == info.physical_vertices);
  for (i = 0; i < floats && v[i] == 0; ++i) continue;
  CHECK(i < floats); /* the nearest motion that its field can have */
  CHECK_OK(sinew_body_set_state(world, body, state, NULL, info.physical_vertices));
  CHECK_OK(sinew_body_velocities(world, body, &v, &count));
  for (i = 0; i < floats; ++i) CHECK(v[i] == 0);
  state[0] = nanf("");
  log.warnings = 0;
  CHECK_OK(sinew_body_set_state(world, body, state, NULL, info.physical_vertices));
  CHECK(log.warnings == 1);
  CHECK_OK(sinew_world_step(world, 1.0f / 60));
  CHECK_OK(sinew_body_repaired(world, body, &count));
  CHECK(count == 0);

  /* Outputs: an interleaved vertex of position, normal, tangent and two floats of the caller's. */
  visual = malloc(sizeof(float) * 12 * info.visual_vertices);
  CHECK(visual != NULL);
  for (i = 0; i < 12 * info.visual_vertices; ++i) visual[i] = -7;
  sinew_visual_output_init(&output, sizeof output);
  CHECK(output.tangents_stride == 16);
  output.positions = visual;
  output.normals = visual + 3;
  output.tangents = visual + 6;
  output.positions_stride = output.normals_stride = output.tangents_stride = 48;
  output.count = info.visual_vertices;
  CHECK_OK(sinew_body_visual_vertices(world, body, &output));
  {
    /* The same in a batch of one; what is not there is told. */
    float* batch = malloc(sizeof(float) * 12 * info.visual_vertices);
    sinew_visual_output outputs[2];
    const uint32_t bodies[2] = {body, 1000};
    CHECK(batch != NULL);
    for (i = 0; i < 12 * info.visual_vertices; ++i) batch[i] = -7;
    outputs[0] = output;
    outputs[0].positions = batch;
    outputs[0].normals = batch + 3;
    outputs[0].tangents = batch + 6;
    outputs[1] = outputs[0];
    CHECK_OK(sinew_world_visual_vertices(world, bodies, outputs, 1));
    CHECK(memcmp(batch, visual, sizeof(float) * 12 * info.visual_vertices) == 0);
    CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_world_visual_vertices(world, bodies, outputs, 2));
    CHECK(strstr(sinew_last_error(), "body 1000") != NULL);
    CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_world_visual_vertices(world, bodies, NULL, 1));
    CHECK_OK(sinew_world_visual_vertices(world, NULL, NULL, 0));
    free(batch);
  }
  CHECK_OK(sinew_body_visual_bounds(world, body, low, high));
  for (i = 0; i < info.visual_vertices; ++i) {
    const float *p = visual + 12 * i, *n = p + 3, *t = p + 6;
    CHECK(p[0] >= low[0] && p[1] >= low[1] && p[2] >= low[2]);
    CHECK(p[0] <= high[0] && p[1] <= high[1] && p[2] <= high[2]);
    CHECK(fabsf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2] - 1) < 1e-5f);
    CHECK(fabsf(n[0] * t[0] + n[1] * t[1] + n[2] * t[2]) < 1e-5f && fabsf(t[3]) == 1);
    CHECK(p[10] == -7 && p[11] == -7);
  }
  output.normals_stride = 10;
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_body_visual_vertices(world, body, &output));
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_body_visual_sub_mesh(world, body, 1000, &output));
  output.normals_stride = 48;
  output.previous_positions = visual + 3;
  output.previous_stride = 48;
  output.normals = output.tangents = NULL;
  if (info.sub_meshes > 0) CHECK_OK(sinew_body_visual_sub_mesh(world, body, 0, &output));
  CHECK_OK(sinew_body_physical_bounds(world, body, low, high));
  CHECK(low[0] < high[0]);
  CHECK_OK(sinew_body_rigid_motion(world, body, rotation, vector));
  CHECK(fabsf(rotation[0] * rotation[0] + rotation[3] * rotation[3] + rotation[6] * rotation[6] - 1) < 1e-3f);
  CHECK_OK(sinew_body_cluster_frame(world, body, 0, vector, matrix));
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_body_cluster_frame(world, body, 1000, vector, matrix));
  /* The first one is plastic, and was thrown about. */
  CHECK_OK(sinew_body_cluster_rest_shape(world, body, 1, matrix));
  CHECK(matrix[0] == 1 && matrix[1] == 0 && matrix[4] == 1 && matrix[8] == 1);
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_body_cluster_rest_shape(world, body, 1000, matrix));
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_body_positions(world, 1000, &x, &count));

  /* A newer program's struct, longer than this library's. */
  {
    struct {
      sinew_body_settings known;
      float unknown[8];
    } newer;
    sinew_body_settings_init(&newer.known, sizeof newer);
    CHECK(newer.known.struct_size == sizeof newer && newer.unknown[7] == 0 && newer.known.stiffness_scale == 1);
    CHECK_OK(sinew_body_add(world, asset, &newer.known, &other));
  }

  sinew_world_destroy(world);
  sinew_world_destroy(NULL);
  CHECK(counts.live_blocks == 0 && counts.live_bytes == 0);
  free(visual);
  free(after);
  free(state);
  free(saved);
}

static void testColliders(const sinew_asset* asset) {
  static const float identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, down[3] = {0, -1, 0};
  static const float corners[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1}, heights[4] = {0, 0, 0, 0};
  static const uint32_t triangle[3] = {0, 2, 1};
  sinew_world* world = NULL;
  sinew_shape shape;
  sinew_collider_settings settings;
  sinew_body_settings body_settings;
  sinew_query_filter filter;
  sinew_query_object objects[4];
  sinew_contact_event events[4];
  sinew_contact contacts[4];
  sinew_world_settings world_settings;
  sinew_cast_hit hit;
  float low[3], high[3], impulse[3], torque[3], above[3], at[3] = {0, 0, 0}, half[3], pushed = 0;
  uint32_t body, floor, other, count, i, kind, began = 0;
  sinew_world_settings_init(&world_settings, sizeof world_settings);
  CHECK(world_settings.report_contacts == 0 && world_settings.ground_restitution == 0);
  world_settings.report_contacts = 1;
  CHECK_OK(sinew_world_create(&world_settings, NULL, &world));
  sinew_body_settings_init(&body_settings, sizeof body_settings);
  CHECK(body_settings.friction < 0 && body_settings.layers == 1 && body_settings.touches == 0xffffffffu);
  body_settings.package_pins = 0;
  body_settings.layers = 2;
  CHECK_OK(sinew_body_add(world, asset, &body_settings, &body));
  CHECK_OK(sinew_body_physical_bounds(world, body, low, high));

  /* A slab a hand's breadth below. */
  sinew_shape_init(&shape, sizeof shape);
  CHECK(shape.kind == SINEW_SHAPE_SPHERE && shape.radius == 0.5f && shape.cell == 1);
  sinew_collider_settings_init(&settings, sizeof settings);
  CHECK(settings.friction == 0.6f && settings.rotation[4] == 1 && settings.layers == 1);
  shape.kind = SINEW_SHAPE_BOX;
  shape.half_size[0] = shape.half_size[2] = 100;
  shape.half_size[1] = 1;
  settings.position[1] = low[1] - 1.1f;
  CHECK_OK(sinew_collider_add(world, &shape, &settings, &floor));
  for (i = 0; i < 120; ++i) {
    CHECK_OK(sinew_world_step(world, 1.0f / 60));
    CHECK_OK(sinew_world_contact_events(world, events, 4, &count));
    if (count > 0 && events[0].began && events[0].body == body && events[0].collider == floor &&
        events[0].other == SINEW_NONE)
      began = 1;
    CHECK_OK(sinew_collider_reaction(world, floor, impulse, torque));
    pushed += impulse[1];
    CHECK_OK(sinew_world_contacts(world, contacts, 4, &count));
    CHECK(count == (impulse[1] != 0 ? 1 : 0));
    if (count == 1)
      CHECK(contacts[0].body == body && contacts[0].collider == floor && contacts[0].other == SINEW_NONE &&
            contacts[0].impulse[1] == -impulse[1] && contacts[0].normal[1] > 0.9f && contacts[0].speed >= 0);
  }
  CHECK(began == 1);
  CHECK(pushed < 0); /* the floor is pressed down */
  CHECK_OK(sinew_body_physical_bounds(world, body, low, high));
  CHECK(low[1] > settings.position[1] + 0.9f);

  /* From above a ray meets the body, or what is below it where bodies do not count. */
  for (i = 0; i < 3; ++i) above[i] = 0.5f * (low[i] + high[i]);
  above[1] = high[1] + 1;
  CHECK_OK(sinew_world_cast(world, above, 0, down, 100, NULL, &hit, &count));
  CHECK(count == 1 && hit.object.body == body && hit.triangle != SINEW_NONE && hit.normal[1] > 0);
  sinew_query_filter_init(&filter, sizeof filter);
  filter.bodies = 0;
  CHECK_OK(sinew_world_cast(world, above, 0.1f, down, 100, &filter, &hit, &count));
  CHECK(count == 1 && hit.object.body == SINEW_NONE && hit.object.collider == floor && hit.triangle == SINEW_NONE);
  filter.bodies = 1;
  filter.layers = 4;
  CHECK_OK(sinew_world_cast(world, above, 0, down, 100, &filter, &hit, &count));
  CHECK(count == 0);
  for (i = 0; i < 3; ++i) half[i] = 0.5f * (high[i] - low[i]), at[i] = 0.5f * (low[i] + high[i]);
  CHECK_OK(sinew_world_overlaps_box(world, half, at, identity, NULL, objects, 1, &count));
  CHECK(count == 2 && objects[0].body == body);
  filter.layers = 2;
  CHECK_OK(sinew_world_overlaps_sphere(world, at, 100, &filter, objects, 4, &count));
  CHECK(count == 1 && objects[0].body == body);

  /* The other shapes; the floor sinks away and is gone. */
  for (kind = 0; kind <= SINEW_SHAPE_HEIGHT_FIELD; ++kind) {
    sinew_shape_init(&shape, sizeof shape);
    shape.kind = kind;
    shape.points = corners;
    shape.point_count = 4;
    shape.triangles = triangle;
    shape.triangle_count = 1;
    shape.heights = heights;
    shape.columns = shape.rows = 2;
    CHECK_OK(sinew_collider_add(world, &shape, NULL, &other));
    CHECK_OK(sinew_collider_remove(world, other));
  }
  settings.position[1] -= 1;
  CHECK_OK(sinew_collider_move(world, floor, settings.position, identity));
  CHECK_OK(sinew_world_step(world, 1.0f / 60));
  {
    float position[3], rotation[9];
    CHECK_OK(sinew_collider_pose(world, floor, position, rotation));
    CHECK(position[1] == settings.position[1] && rotation[0] == 1 && rotation[1] == 0);
    CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_collider_pose(world, floor, NULL, rotation));
    CHECK_OK(sinew_collider_drawn(world, floor, position, rotation));
    CHECK(position[1] == settings.position[1] && rotation[0] == 1 && rotation[1] == 0);
    CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_collider_drawn(world, floor, position, NULL));
    CHECK_OK(sinew_collider_get_settings(world, floor, &settings));
    CHECK(settings.surface_velocity[0] == 0);
    settings.surface_velocity[0] = 2;
    CHECK_OK(sinew_collider_set_settings(world, floor, &settings));
    settings.surface_velocity[0] = 0;
    CHECK_OK(sinew_collider_get_settings(world, floor, &settings));
    CHECK(settings.surface_velocity[0] == 2);
    settings.friction = -1;
    CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_collider_set_settings(world, floor, &settings));
    CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_collider_get_settings(world, 12345, &settings));
    CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_collider_get_settings(world, floor, NULL));
  }
  CHECK_OK(sinew_collider_remove(world, floor));

  shape.kind = 99;
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_collider_add(world, &shape, NULL, &other));
  shape.kind = SINEW_SHAPE_HULL;
  shape.points = NULL;
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_collider_add(world, &shape, NULL, &other));
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_collider_add(world, NULL, NULL, &other));
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_collider_move(world, floor, at, identity));
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_collider_remove(world, floor));
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_collider_reaction(world, floor, impulse, torque));
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_world_cast(world, above, 0, down, 100, NULL, NULL, &count));
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_world_contact_events(world, NULL, 4, &count));
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_world_contacts(world, NULL, 4, &count));
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_world_overlaps_sphere(NULL, at, 1, NULL, NULL, 0, &count));
  sinew_world_destroy(world);
}

static void testPool(const sinew_asset* asset) {
  sinew_thread_pool* pool = NULL;
  sinew_world_options options;
  sinew_world* world = NULL;
  uint32_t body, i;
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_thread_pool_create(100000, &pool));
  CHECK_OK(sinew_thread_pool_create(2, &pool));
  sinew_world_options_init(&options, sizeof options);
  options.pool = pool;
  CHECK_OK(sinew_world_create(NULL, &options, &world));
  for (i = 0; i < 4; ++i) CHECK_OK(sinew_body_add(world, asset, NULL, &body));
  for (i = 0; i < 10; ++i) CHECK_OK(sinew_world_step(world, 1.0f / 60));
  sinew_world_destroy(world);
  sinew_thread_pool_destroy(pool);
  sinew_thread_pool_destroy(NULL);
}

static void testInteraction(const sinew_asset* asset) {
  sinew_world* world = NULL;
  sinew_world_settings settings;
  sinew_body_settings body_settings;
  sinew_body_point point;
  sinew_body_motion motion;
  sinew_collider_settings hand;
  sinew_shape ball;
  const float none[3] = {0, 0, 0}, up[3] = {0, 2, 0}, far_place[3] = {0, 100, 0}, down[3] = {0, -1, 0};
  float place[3];
  uint32_t body, collider, pick, count, activity, ids[2];
  size_t size = 0, written = 0;
  void* bytes;
  sinew_world_settings_init(&settings, sizeof settings);
  CHECK(settings.air_density > 1 && settings.wind[0] == 0);
  settings.gravity[1] = settings.damping = 0;
  CHECK_OK(sinew_world_create(&settings, NULL, &world));
  sinew_body_settings_init(&body_settings, sizeof body_settings);
  CHECK(body_settings.gravity_scale == 1 && body_settings.drag == 0 && body_settings.level == 0);
  body_settings.level = 3; /* more than there are: the last */
  body_settings.package_pins = 0;
  CHECK_OK(sinew_body_add(world, asset, &body_settings, &body));
  motion.struct_size = sizeof motion;
  CHECK_OK(sinew_body_get_motion(world, body, &motion));
  CHECK(motion.mass > 0 && motion.velocity[1] == 0);
  {
    const float impulse[3] = {0, motion.mass, 0};
    CHECK_OK(sinew_body_add_impulse(world, body, NULL, impulse));
    CHECK_OK(sinew_body_get_motion(world, body, &motion));
    CHECK(motion.velocity[1] > 0.999f && motion.velocity[1] < 1.001f);
    CHECK_OK(sinew_body_nearest_point(world, body, far_place, &point));
    CHECK_OK(sinew_body_place_of(world, body, &point, place));
    CHECK_OK(sinew_body_add_force(world, body, &point, impulse));
    CHECK_OK(sinew_world_step(world, 1.0f / 60));
    CHECK_OK(sinew_body_get_motion(world, body, &motion));
    CHECK(motion.velocity[1] > 1.01f && motion.velocity[1] < 1.02f);
  }
  CHECK_OK(sinew_body_set_velocity(world, body, none, NULL));
  point.weight[0] = 7;
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_body_add_force(world, body, &point, up));
  body_settings.drag = -1;
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_body_set_settings(world, body, &body_settings));
  body_settings.drag = 2;
  CHECK_OK(sinew_body_set_settings(world, body, &body_settings));
  CHECK_OK(sinew_body_get_settings(world, body, &body_settings));
  CHECK(body_settings.drag == 2);
  place[1] += 10;
  CHECK_OK(sinew_world_pick_ray(world, place, down, 100, 4, 0, &pick));
  CHECK_OK(sinew_world_pick_along(world, place, down, 100, 1, &ids[0]));
  CHECK(ids[0] == pick);
  if (pick != SINEW_NONE) {
    CHECK_OK(sinew_pick_lock(world, pick, 1));
    CHECK_OK(sinew_pick_let_go(world, pick));
    CHECK_OK(sinew_pick_move(world, pick, up));
  }
  CHECK_OK(sinew_picks_release(world, SINEW_NONE));
  CHECK_OK(sinew_body_picks(world, body, NULL, 0, &count));
  CHECK(count == 0);
  sinew_shape_init(&ball, sizeof ball);
  sinew_collider_settings_init(&hand, sizeof hand);
  hand.most_speed = 3;
  hand.position[1] = 50;
  CHECK_OK(sinew_collider_add(world, &ball, &hand, &collider));
  CHECK_OK(sinew_world_bodies(world, ids, 2, &count));
  CHECK(count == 1 && ids[0] == body);
  CHECK_OK(sinew_world_colliders(world, ids, 2, &count));
  CHECK(count == 1 && ids[0] == collider);
  CHECK_OK(sinew_body_pin_sets(world, body, ids, 2, &count));
  CHECK(count == 0);
  CHECK_OK(sinew_body_set_activity(world, body, SINEW_PAUSED));
  CHECK_OK(sinew_body_get_activity(world, body, &activity));
  CHECK(activity == SINEW_PAUSED);
  CHECK_FAILS(SINEW_ERROR_ARGUMENT, sinew_body_set_activity(world, body, 9));
  CHECK_OK(sinew_world_snapshot_size(world, &size));
  bytes = malloc(size);
  CHECK_FAILS(SINEW_ERROR_CAPACITY, sinew_world_save(world, bytes, size - 1, &written));
  CHECK_OK(sinew_world_save(world, bytes, size, &written));
  CHECK(written == size);
  CHECK_OK(sinew_body_remove(world, body));
  CHECK_FAILS(SINEW_ERROR_STATE, sinew_world_restore(world, bytes, size, NULL, 0));
  CHECK_OK(sinew_world_restore(world, bytes, size, &asset, 1));
  CHECK(sinew_body_exists(world, body));
  free(bytes);
  sinew_world_destroy(world);
}

int main(int argc, char** argv) {
  sinew_asset* asset = NULL;
  if (argc != 2) {
    fprintf(stderr, "usage: %s PACKAGE.sinew\n", argv[0]);
    return 2;
  }
  testAsset(argv[1], &asset);
  if (asset != NULL) {
    testMotion(asset);
    testColliders(asset);
    testInteraction(asset);
    testPool(asset);
  }
  sinew_asset_release(asset);
  if (failures > 0) printf("%d checks failed\n", failures);
  return failures > 0 ? 1 : 0;
}

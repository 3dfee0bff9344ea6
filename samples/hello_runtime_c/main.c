/* SPDX-License-Identifier: MIT
 *
 * A whole simulation on one page, in C99: load a package, drop it on the ground, read the vertices an engine would
 * draw. sample_hello_runtime_c PACKAGE.sinew
 */
#include <sinew/c_api.h>
#include <stdio.h>
#include <stdlib.h>

/* What a world has to say: lost vertices that were put right, calls that were refused. */
static void onLog(void* user, uint32_t severity, const char* line) {
  fprintf((FILE*)user, "%s: %s\n", severity == SINEW_LOG_ERROR ? "error" : "note", line);
}

int main(int argc, char** argv) {
  sinew_asset* asset = NULL;
  sinew_world* world = NULL;
  sinew_asset_info info = {0};
  sinew_world_options options;
  sinew_world_settings settings;
  sinew_body_settings placement;
  sinew_visual_output output;
  uint32_t body = SINEW_NONE, frame;
  int result = 3;
  if (argc != 2) {
    fprintf(stderr, "usage: %s PACKAGE.sinew\n", argv[0]);
    return 2;
  }
  if (sinew_c_api_version() != SINEW_C_API_VERSION) {
    fprintf(stderr, "this program was built for version %u of the C interface\n", (unsigned)SINEW_C_API_VERSION);
    return 3;
  }

  /* 1. An asset holds what all bodies made from a package share. */
  if (sinew_asset_load(argv[1], &asset) != SINEW_OK) {
    fprintf(stderr, "%s\n", sinew_last_error());
    return 3;
  }
  info.struct_size = sizeof info;
  sinew_asset_get_info(asset, &info);

  /* 2. A world with a ground plane at height 0, and a body half its size above it. */
  sinew_world_options_init(&options, sizeof options);
  options.log = onLog;
  options.log_user = stderr;
  sinew_world_settings_init(&settings, sizeof settings);
  settings.ground_enabled = 1;
  sinew_body_settings_init(&placement, sizeof placement);
  placement.position[1] = 0.5f * info.diagonal - info.bounds_min[1];
  sinew_visual_output_init(&output, sizeof output);
  output.count = info.visual_vertices;
  output.positions = malloc(sizeof(float) * 3 * (info.visual_vertices + 1));
  output.normals = malloc(sizeof(float) * 3 * (info.visual_vertices + 1));
  if (output.positions != NULL && output.normals != NULL &&
      sinew_world_create(&settings, &options, &world) == SINEW_OK &&
      sinew_body_add(world, asset, &placement, &body) == SINEW_OK) {
    /* 3. Each frame: step, then let the runtime write into the buffers that go to the graphics card. */
    result = 0;
    for (frame = 1; frame <= 120 && result == 0; ++frame) {
      if (sinew_world_step(world, 1.0f / 60) != SINEW_OK ||
          sinew_body_visual_vertices(world, body, &output) != SINEW_OK) {
        result = 4;
      } else if (frame % 20 == 0 && info.visual_vertices > 0) {
        printf("%.2f s: vertex 0 at (%.4f, %.4f, %.4f) m\n", frame / 60.0, output.positions[0], output.positions[1],
               output.positions[2]);
      }
    }
  }
  if (result != 0) fprintf(stderr, "%s\n", sinew_last_error());
  free(output.normals);
  free(output.positions);
  sinew_world_destroy(world);
  sinew_asset_release(asset);
  return result;
}

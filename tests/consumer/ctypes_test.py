#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The C interface as a foreign-function caller sees it: Python's ctypes against the shared library, no header.

    ctypes_test.py LIBRARY PACKAGE
"""
import ctypes
import math
import sys
from ctypes import POINTER, Structure, byref, c_float, c_int32, c_size_t, c_uint32, c_void_p, sizeof


class Info(Structure):
    _fields_ = [("struct_size", c_uint32), ("pieces", c_uint32), ("physical_vertices", c_uint32), ("tetrahedra", c_uint32),
                ("clusters", c_uint32), ("memberships", c_uint32), ("visual_vertices", c_uint32),
                ("visual_triangles", c_uint32), ("sub_meshes", c_uint32), ("diagonal", c_float)]


class WorldSettings(Structure):
    _fields_ = [("struct_size", c_uint32), ("gravity", c_float * 3), ("ground_enabled", c_uint32),
                ("ground_normal", c_float * 3), ("ground_offset", c_float), ("ground_friction", c_float),
                ("iterations", c_uint32), ("damping", c_float), ("deformation_damping_ratio", c_float),
                ("support_damping", c_float)]


LOG = ctypes.CFUNCTYPE(None, c_void_p, c_uint32, ctypes.c_char_p)
RANGE = ctypes.CFUNCTYPE(None, c_void_p, c_uint32, c_uint32)
PARALLEL_FOR = ctypes.CFUNCTYPE(None, c_void_p, c_uint32, c_uint32, RANGE, c_void_p)


class WorldOptions(Structure):
    _fields_ = [("struct_size", c_uint32), ("reserved", c_uint32), ("allocator_user", c_void_p), ("allocate", c_void_p),
                ("release", c_void_p), ("jobs_user", c_void_p), ("parallel_for", PARALLEL_FOR), ("pool", c_void_p),
                ("log_user", c_void_p), ("log", LOG)]


class VisualOutput(Structure):
    _fields_ = [("struct_size", c_uint32), ("positions_stride", c_uint32), ("positions", POINTER(c_float)),
                ("normals", POINTER(c_float)), ("tangents", POINTER(c_float)), ("previous_positions", POINTER(c_float)),
                ("normals_stride", c_uint32), ("tangents_stride", c_uint32), ("previous_stride", c_uint32),
                ("count", c_uint32)]


def main():
    library, package = sys.argv[1:]
    sinew = ctypes.CDLL(library)
    sinew.sinew_last_error.restype = ctypes.c_char_p
    sinew.sinew_version.restype = ctypes.c_char_p
    failures = []

    def check(sound, what):
        if not sound:
            failures.append(f"{what} (last error: {sinew.sinew_last_error().decode()})")

    def ok(status, what):
        check(status == 0, what)

    check(sinew.sinew_c_api_version() == 2, "version of the C interface")
    asset, world, body = c_void_p(), c_void_p(), c_uint32()
    check(sinew.sinew_asset_load(b"missing.sinew", byref(asset)) == 2, "a missing file is a package error")
    check(b"missing.sinew" in sinew.sinew_last_error(), "the reason names the file")
    ok(sinew.sinew_asset_load(package.encode(), byref(asset)), "load")
    info = Info(struct_size=sizeof(Info))  # shorter than the library's: a caller that knows fewer fields
    ok(sinew.sinew_asset_get_info(asset, byref(info)), "info")
    check(info.physical_vertices > 0 and info.diagonal > 0, "counts")

    lines, loops = [], []

    @LOG
    def log(_, severity, line):
        lines.append((severity, line.decode()))

    @PARALLEL_FOR
    def parallel_for(_, count, grain, work, context):
        loops.append((count, grain))
        work(context, 0, count)

    settings, options, output = WorldSettings(), WorldOptions(), VisualOutput()
    sinew.sinew_world_settings_init(byref(settings), c_size_t(sizeof(settings)))
    check(abs(settings.gravity[1] + 9.81) < 1e-3 and settings.iterations > 0, "defaults")
    settings.ground_enabled = 1
    sinew.sinew_world_options_init(byref(options), c_size_t(sizeof(options)))
    options.log, options.parallel_for = log, parallel_for
    ok(sinew.sinew_world_create(byref(settings), byref(options), byref(world)), "create")
    second = c_uint32()
    ok(sinew.sinew_body_add(world, asset, None, byref(body)), "add")
    ok(sinew.sinew_body_add(world, asset, None, byref(second)), "add another")
    for _ in range(30):
        ok(sinew.sinew_world_step(world, c_float(1 / 60)), "step")
    check(len(loops) > 0, "the caller's job system runs the loops")
    check(sinew.sinew_body_remove(world, 1000) == 1 and "1000" in sinew.sinew_last_error().decode(), "unknown bodies are refused")
    check(sinew.sinew_world_step(world, c_float(-1)) == 1 and any(severity == 2 for severity, _ in lines), "the log tells")

    count = info.visual_vertices
    positions, normals = (c_float * (3 * count))(), (c_float * (3 * count))()
    sinew.sinew_visual_output_init(byref(output), c_size_t(sizeof(output)))
    output.positions, output.normals, output.count = positions, normals, count
    ok(sinew.sinew_body_visual_vertices(world, body, byref(output)), "output")
    low, high = (c_float * 3)(), (c_float * 3)()
    ok(sinew.sinew_body_visual_bounds(world, body, low, high), "bounds")
    for i in range(count):
        point = positions[3 * i:3 * i + 3]
        check(all(low[k] <= point[k] <= high[k] for k in range(3)), f"vertex {i} in the bounds")
        check(abs(math.hypot(*normals[3 * i:3 * i + 3]) - 1) < 1e-5, f"normal {i} unit")

    x, vertices = POINTER(c_float)(), c_uint32()
    ok(sinew.sinew_body_positions(world, body, byref(x), byref(vertices)), "positions")
    check(vertices.value == info.physical_vertices and math.isfinite(x[0]), "physical vertices")
    size, written = c_size_t(), c_size_t()
    ok(sinew.sinew_body_state_size(world, body, byref(size)), "size of the state")
    saved = ctypes.create_string_buffer(size.value)
    ok(sinew.sinew_body_save(world, body, saved, size, byref(written)), "save")

    def state_after(steps):
        for _ in range(steps):
            ok(sinew.sinew_world_step(world, c_float(1 / 60)), "step")
        ok(sinew.sinew_body_positions(world, body, byref(x), byref(vertices)), "positions")
        return x[:3 * vertices.value]

    first = state_after(10)
    ok(sinew.sinew_body_restore(world, body, saved, size), "restore")
    check(state_after(10) == first, "a restored body goes on bit for bit")
    sinew.sinew_world_destroy(world)
    sinew.sinew_asset_release(asset)

    for failure in failures:
        print(f"ctypes_test: {failure}", file=sys.stderr)
    print(f"ctypes: version {sinew.sinew_version().decode()}, {count} visual vertices, {len(loops)} loops in the caller's jobs")
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()

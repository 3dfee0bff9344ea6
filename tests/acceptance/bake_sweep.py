#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes generated sheets, reliefs and tubes (folds, overhangs, borders, holes, noise, pieces; 1,000 to 400,000
triangles), and every mesh of a folder: does `sinew check` say before what `bake` does, and is the work bounded?
Bounds: 10 s up to 100,000 triangles, 20 s up to 400,000, of processor time, which other programs cannot lengthen much;
what misses them is baked once more and has its better time. Seeds are fixed: a case repeats, alone with --only.
Standard library only.

    bake_sweep.py --sinew PROGRAM [--data DIR] [--count N] [--most TRIANGLES] [--only NAME] [--untimed]
"""
import argparse
import json
import math
import os
import pathlib
import random
import resource
import struct
import sys
import tempfile
import time
from array import array

SLOWNESS = float(os.environ.get("SINEW_TEST_SLOWNESS", "1"))  # of this build
BOUNDS = ((100_000, 10), (400_000, 20))
GIVEN_UP = 120  # seconds of the processor; ten times as many on the clock
SHOWN = 10
ENDINGS = {".obj", ".ply", ".stl", ".off", ".glb", ".gltf", ".fbx", ".mesh"}
LARGE = 5  # of the generated ones have the most triangles


def waves(draw, count, most):
    """A height over the unit square: some sine waves of falling amplitude."""
    terms = [(draw.uniform(0, most) * 0.5 ** i, 2 ** i * draw.uniform(-6, 6), 2 ** i * draw.uniform(-6, 6),
              draw.uniform(0, 7)) for i in range(count)]
    return lambda u, v: sum(a * math.sin(x * u + y * v + phase) for a, x, y, phase in terms)


def surface(draw, kind):
    """Where (u, v) of the unit square lies, and what the surface is."""
    bend = waves(draw, 3, 0.1)
    if kind == "sheet":
        pleats = draw.choice([0, 0, draw.randint(1, 12)])
        depth = draw.uniform(0.3, 2)  # above 0.16 a pleat hangs over its neighbour
        def place(u, v):
            turn = 2 * math.pi * pleats * u
            return (u + (depth / (2 * math.pi * pleats) * math.sin(2 * turn) if pleats else 0), v,
                    bend(u, v) + (depth / (4 * pleats) * math.cos(turn) if pleats else 0))
        return place, f"{pleats} pleats"
    if kind == "relief":
        hills = waves(draw, 6, 0.3)
        lean = draw.choice([0, 0, draw.uniform(0.5, 3)])
        def place(u, v):
            height = hills(u, v)
            return u + lean * height, v, height
        return place, f"leaning {lean:.1f}"
    rings, rounds = draw.choice([0, draw.randint(1, 40)]), draw.choice([1, 1, 0.7])
    depth, around, length = draw.uniform(0.05, 0.6), draw.uniform(0, 5), draw.uniform(1, 10)
    def place(u, v):
        # A torus of part of a turn, its radius in folds.
        radius = 0.1 * (1 + depth * math.sin(2 * math.pi * rings * v))
        angle, along = 2 * math.pi * rounds * u, around * (v - 0.5)
        if around < 0.1:
            return radius * math.cos(angle), radius * math.sin(angle), length * v / 4
        far = length / 4 / around + 0.1 + radius * math.cos(angle)
        return far * math.cos(along), far * math.sin(along), radius * math.sin(angle)
    return place, f"{rings} folds, {rounds:.1f} round"


def generated(index, most):
    """Name, vertices (flat floats) and triangles (flat indices) of a case; all of it follows from the index."""
    draw = random.Random(index)
    kind = ("sheet", "relief", "tube")[index % 3]
    # Orders of magnitude alike, and a few of the most.
    triangles = most if index < LARGE else int(1000 * (min(most, 100_000) / 1000) ** draw.random())
    place, what = surface(draw, kind)
    pieces = draw.choice([1, 1, 1, 1, draw.randint(2, 30)])
    aspect = draw.uniform(0.3, 3)
    n = max(2, int(math.sqrt(triangles / pieces / 2 * aspect)))
    m = max(2, int(triangles / pieces / 2 / n))
    noise = draw.choice([0, 0, draw.uniform(0, 1), draw.uniform(0, 1.5)]) / max(n, m)
    closed = kind == "tube" and "1.0 round" in what
    holes, turned, doubled = (draw.choice([0, 0, 0, draw.uniform(0, share)]) for share in (0.05, 0.02, 0.005))
    vertices, faces = array("f"), array("i")
    row = n if closed else n + 1
    for piece in range(pieces):
        first = len(vertices) // 3
        shift = (0.3 * (piece % 5), 0.2 * (piece // 5), 0.05 * piece)
        for j in range(m + 1):
            for i in range(row):
                x, y, z = place(i / n, j / m)
                scale = 1 / pieces ** 0.5
                vertices.extend((x * scale + shift[0] + draw.gauss(0, noise) * scale,
                                 y * scale + shift[1] + draw.gauss(0, noise) * scale,
                                 z * scale + shift[2] + draw.gauss(0, noise) * scale))
        for j in range(m):
            for i in range(n):
                a, b = first + j * row + i, first + j * row + (i + 1) % row
                for face in ((a, b, b + row), (a, b + row, a + row)):
                    if draw.random() < holes:
                        continue
                    faces.extend(face[::-1] if draw.random() < turned else face)
                    if draw.random() < doubled:
                        faces.extend(face)
    about = f"{kind}, {what}, {pieces} pieces, noise {noise * max(n, m):.1f}, holes {holes:.3f}, turned {turned:.3f}, double {doubled:.3f}"
    return f"{kind}_{index:03d}", about, vertices, faces


def write_ply(file, vertices, faces):
    count = len(faces) // 3
    packed = bytearray(13 * count)
    triangle = struct.Struct("<Biii")
    for t in range(count):
        triangle.pack_into(packed, 13 * t, 3, faces[3 * t], faces[3 * t + 1], faces[3 * t + 2])
    header = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices) // 3}\nproperty float x\nproperty float y\n"
              f"property float z\nelement face {count}\nproperty list uchar int vertex_indices\nend_header\n")
    if sys.byteorder == "big":
        vertices.byteswap()
    file.write_bytes(header.encode() + vertices.tobytes() + packed)


def run(*command):
    """exit code (None: given up), seconds of the processor, the last line of stderr"""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        start = time.monotonic()
        pid = os.posix_spawn(str(command[0]), [str(c) for c in command], os.environ,
                             file_actions=[(os.POSIX_SPAWN_DUP2, out.fileno(), 1), (os.POSIX_SPAWN_DUP2, err.fileno(), 2)])
        bound = int(GIVEN_UP * SLOWNESS)
        resource.prlimit(pid, resource.RLIMIT_CPU, (bound, bound))
        killed = False
        while True:
            done, status, usage = os.wait4(pid, os.WNOHANG)
            if done:
                break
            if not killed and time.monotonic() > start + 10 * bound:
                os.kill(pid, 9)
                killed = True
            time.sleep(0.01)
        err.seek(0)
        lines = err.read().decode("utf-8", "replace").strip().splitlines()
    code = os.waitstatus_to_exitcode(status)
    return (None if killed or code == -9 else code, usage.ru_utime + usage.ru_stime,
            lines[-1] if lines else "")


def bound_of(triangles):
    return next((seconds for most, seconds in BOUNDS if triangles <= most), None)


class Sweep:
    def __init__(self, sinew, folder, untimed):
        self.sinew, self.folder, self.untimed = sinew, folder, untimed
        self.rows, self.faults = [], []

    def case(self, name, about, file):
        package, report_file = self.folder / "x.sinew", self.folder / "report.json"
        check, _, check_error = run(self.sinew, "check", file, "--json")
        baked, seconds, error = self.bake(file, package, report_file)
        row = {"name": name, "about": about, "seconds": seconds, "triangles": 0}
        verdict = f"check {check} {check_error[-200:]}, bake {baked} {error[-200:]}"
        if check not in (0, 1, 2, 3) or baked not in (0, 2, 3) or (check == 0) != (baked == 0):
            self.faults.append(f"{name} ({about}): {verdict}")
        if baked == 0:
            report = json.loads(report_file.read_text())
            row["triangles"] = report["visual"]["visual_triangles"]
            bound = None if self.untimed else bound_of(row["triangles"])
            if bound and row["seconds"] > bound * SLOWNESS:
                row["seconds"] = min(row["seconds"], self.bake(file, package, report_file)[1])
                if row["seconds"] > bound * SLOWNESS:
                    self.faults.append(f"{name} ({about}): {row['triangles']} triangles in {row['seconds']:.1f} s, more than {bound} s")
            stages = sorted(report["stages"], key=lambda stage: -stage["seconds"])
            total = sum(stage["seconds"] for stage in stages) or 1
            row["stages"] = ", ".join(f"{s['name']} {100 * s['seconds'] / total:.0f} %" for s in stages[:2])
            row["clock"] = report["seconds"]
            row["method"] = "+".join(sorted({piece["method"] for piece in report["pieces"]}))
        self.rows.append(row)
        print(f"  {name:22s} {row['triangles']:7d} triangles {row['seconds']:6.2f} s  {row.get('method', verdict):14s} "
              f"{row.get('stages', '')}  {about}", flush=True)

    def bake(self, file, package, report_file):
        report_file.unlink(missing_ok=True)
        return run(self.sinew, "bake", file, "-o", package, "--report", report_file, "--quiet", "--no-cache")

    def slowest(self):
        """A table of docs/performance.md."""
        rows = sorted((row for row in self.rows if "clock" in row), key=lambda row: -row["seconds"])[:SHOWN]
        lines = [f"| {row['name']} | {row['triangles']:,} | {row['method']} | {row['seconds']:.1f} | {row['clock']:.1f} | {row['stages']} |"
                 for row in rows]
        return "\n".join(["| mesh | triangles | method | processor, s | clock, s | most of it |", "|---|---|---|---|---|---|", *lines])


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--sinew", required=True, type=pathlib.Path)
    parser.add_argument("--data", type=pathlib.Path, help="a folder of meshes to bake as well")
    parser.add_argument("--count", type=int, default=200, help="generated meshes")
    parser.add_argument("--most", type=int, default=400_000, help="triangles of the largest")
    parser.add_argument("--untimed", action="store_true", help="only whether check and bake agree: a test is not timed")
    parser.add_argument("--only", help="the case of this name alone")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(temporary)
        os.environ["XDG_CACHE_HOME"] = str(folder / "cache")
        sweep = Sweep(arguments.sinew.resolve(), folder, arguments.untimed)
        for file in sorted(arguments.data.rglob("*")) if arguments.data else []:
            if file.suffix in ENDINGS and arguments.only in (None, file.name):
                sweep.case(file.name, "broken" if "bad_input" in file.parts else "given", file)
        for index in range(arguments.count):
            name = f"{('sheet', 'relief', 'tube')[index % 3]}_{index:03d}"
            if arguments.only not in (None, name):
                continue
            _, about, vertices, faces = generated(index, arguments.most)
            file = folder / (name + ".ply")
            write_ply(file, vertices, faces)
            sweep.case(name, about, file)
            file.unlink()
    print(sweep.slowest())
    for fault in sweep.faults:
        print("FAIL", fault)
    print(f"{len(sweep.rows)} meshes, {len(sweep.faults)} failures")
    return 1 if sweep.faults or not sweep.rows else 0


if __name__ == "__main__":
    sys.exit(main())

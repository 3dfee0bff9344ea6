#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Installs formats + runtime alone and uses them as a stranger does.

    consumer.py SOURCE SCRATCH static|shared PACKAGE CMAKE GENERATOR COMPILER

Configures SOURCE by the runtime-only preset, installs into SCRATCH, builds tests/consumer/program and
samples/hello_runtime and hello_runtime_c (a project of C alone) against find_package(sinew), and the latter by
pkg-config too, runs them on PACKAGE, and looks at what headers they saw and what shared libraries they need. The shared library must show its interface only; a foreign-function caller
(ctypes_test.py) uses it as well.
"""
import os
import platform
import re
import shutil
import subprocess
import sys
from pathlib import Path

# The C and C++ runtime, and Sinew itself.
ALLOWED_NEEDED = re.compile(r"^(libsinew_(cut|formats|runtime)\.so|libstdc\+\+\.so|libm\.so|libgcc_s\.so|libc\.so|libpthread\.so|ld-linux)")
# Not TBB, which libstdc++'s <algorithm> draws in by itself for some compilers (tests/layering finds ours).
FOREIGN_HEADER = re.compile(r"/(eigen3?|Eigen|xxhash\.h|CLI|nlohmann|CGAL|assimp|opencv\d?|boost|GLFW|imgui)\b")


def run(*command, **options):
    done = subprocess.run([str(part) for part in command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **options)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stdout}\nconsumer: exit code {done.returncode}")
    return done.stdout


def needed_by(binary):
    return re.findall(r"\(NEEDED\).*\[(.+?)\]", run("readelf", "-d", binary, env=os.environ | {"LC_ALL": "C"}))


def check_pkg_config(moved, scratch, main_c, kind, package):
    """A program of C alone, by what sinew.pc says of the install tree."""
    config = next(moved.rglob("sinew.pc"))
    environment = os.environ | {"PKG_CONFIG_PATH": str(config.parent), "LD_LIBRARY_PATH": str(config.parent.parent)}
    flags = run("pkg-config", "--cflags", "--libs", "sinew", env=environment).split()
    program = scratch / "hello_pkg_config"
    run("cc", "-std=c99", main_c, "-o", program, *flags, env=environment)
    print(run(program, package, env=environment), end="")
    with_cut = run("pkg-config", "--libs", "sinew_cut", env=environment).split()
    if "-lsinew_cut" not in with_cut or with_cut.index("-lsinew_cut") > with_cut.index("-lsinew_runtime"):
        sys.exit(f"consumer: cuts need {with_cut}, the library of cuts first")
    if any(library.startswith("libsinew") for library in needed_by(program)) != (kind == "shared"):
        sys.exit(f"consumer: by pkg-config a {kind} build that needs {needed_by(program)}")


def check_library(library, package):
    """What it needs and what it shows; then the C interface from Python. Prints its size."""
    stripped = library.parent / "stripped.so"
    run("strip", "-o", stripped, library)
    size = stripped.stat().st_size
    for other in needed_by(library):
        if other.startswith("libsinew") or not ALLOWED_NEEDED.match(other):
            sys.exit(f"consumer: {library.name} needs {other}")
    shown = [line.split()[-1] for line in run("nm", "-D", "--defined-only", library).splitlines()]
    strange = [name for name in shown if not re.match(r"^(sinew_|_ZN?K?T?[ISV]?N?K?5sinew)", name)]
    if strange or "sinew_world_step" not in shown or not any(name.startswith("_ZN5sinew5World") for name in shown):
        sys.exit(f"consumer: {library.name} shows {strange or shown}")
    internal = [name for name in shown if "8internal" in name.split("sinew")[1][:12]]
    if internal:
        sys.exit(f"consumer: {library.name} shows {internal}")
    print(run(sys.executable, "-B", Path(__file__).with_name("ctypes_test.py"), stripped, package), end="")
    print(f"consumer: {library.name} has {size} bytes stripped, {len(shown)} symbols, needs {', '.join(needed_by(library))}")


def is_x86():
    return platform.machine().lower() in ("x86_64", "amd64")


def main():
    source, scratch, kind, package, cmake, generator, compiler = sys.argv[1:]
    source, scratch = Path(source), Path(scratch)
    shutil.rmtree(scratch, ignore_errors=True)
    prefix = scratch / "prefix"
    common = ("-G", generator, f"-DCMAKE_CXX_COMPILER={compiler}", "-DCMAKE_BUILD_TYPE=Release")

    # The static one is a small one: kernels of one instruction set alone, which every machine here has.
    options = ("-DBUILD_SHARED_LIBS=ON",) if kind == "shared" else ("-DBUILD_SHARED_LIBS=OFF", "-DSINEW_INSTRUCTION_SETS=sse42")
    # Compiled as by the release preset: where ccache is it has nearly all of it.
    run(cmake, "-S", source, "--preset", "runtime-only", "-B", scratch / "sinew", *common,
        *(options if is_x86() else options[:1]))
    for unasked in ("samples", "tests", "tools"):
        if (scratch / "sinew" / unasked).exists():
            sys.exit(f"consumer: the runtime-only preset builds {unasked}")
    run(cmake, "--build", scratch / "sinew")
    run(cmake, "--install", scratch / "sinew", "--prefix", prefix)
    # Moved, so that nothing can lean on the place it was configured for, nor on the build tree.
    shutil.rmtree(scratch / "sinew")
    moved = scratch / "moved"
    prefix.rename(moved)

    for config in (*moved.rglob("sinew*.cmake"), *moved.rglob("sinew.pc")):
        text = config.read_text(encoding="utf-8")
        for leak in (str(source), str(scratch)):
            if leak in text:
                sys.exit(f"consumer: {config.name} names {leak}")

    standalone = scratch / "hello_source"
    for sample in ("hello_runtime", "hello_runtime_c", "pile", "cut"):
        shutil.copytree(source / "samples" / sample, standalone / sample)
    for name, folder, program in (("consumer", source / "tests" / "consumer" / "program", "consumer"),
                                  ("hello", standalone / "hello_runtime", "sample_hello_runtime"),
                                  ("pile", standalone / "pile", "sample_pile"),
                                  ("cut", standalone / "cut", "sample_cut"),
                                  ("hello_c", standalone / "hello_runtime_c", "sample_hello_runtime_c")):
        build = scratch / name
        run(cmake, "-S", folder, "-B", build, *common, f"-DCMAKE_PREFIX_PATH={moved}")
        run(cmake, "--build", build)
        print(run(build / program, package), end="")
        libraries = needed_by(build / program)
        sinew_shared = any(library.startswith("libsinew") for library in libraries)
        if sinew_shared != (kind == "shared"):
            sys.exit(f"consumer: a {kind} build that needs {libraries}")
        for library in libraries:
            if not ALLOWED_NEEDED.match(library):
                sys.exit(f"consumer: {program} needs {library}")
    check_pkg_config(moved, scratch, standalone / "hello_runtime_c" / "main.c", kind, package)
    for library in moved.rglob("lib*.so"):
        for other in needed_by(library):
            if not ALLOWED_NEEDED.match(other):
                sys.exit(f"consumer: {library.name} needs {other}")

    if kind == "shared":
        check_library(next(path.resolve() for path in moved.rglob("libsinew_runtime.so")), package)

    headers = sorted(path.relative_to(moved / "include").as_posix() for path in moved.rglob("*.h"))
    for header in headers:  # each public header on its own
        dependencies = run(compiler, "-std=c++20", "-M", "-I", moved / "include", "-x", "c++", moved / "include" / header)
        foreign = [path for path in dependencies.split() if FOREIGN_HEADER.search(path.replace(str(moved), ""))]
        if foreign:
            sys.exit(f"consumer: {header} includes {foreign}")
    if not headers:
        sys.exit("consumer: no header was installed")
    c_header = moved / "include" / "sinew" / "c_api.h"
    run("cc", "-std=c99", "-pedantic-errors", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "-I", moved / "include", "-x", "c",
        c_header)
    print(f"consumer: {kind}, {len(headers)} public headers, needs {', '.join(libraries)}")


if __name__ == "__main__":
    main()

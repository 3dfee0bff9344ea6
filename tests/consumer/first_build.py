#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""What scripts/try does on a fresh machine, up to the assembler: with the packages of `scripts/setup --program` alone
the release preset is configured for a quick build. That files it compiles together name nothing twice shows clang-tidy,
which compiles them so (scripts/test).

    first_build.py SOURCE SCRATCH CMAKE COMPILER
"""
import json
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

source, scratch, cmake, compiler = sys.argv[1:]
shutil.rmtree(scratch, ignore_errors=True)

# None of what only tests and checks of a change need is there.
absent = [f"-DCMAKE_DISABLE_FIND_PACKAGE_{name}=ON" for name in ("GTest", "Bullet", "Python3")]
done = subprocess.run([cmake, "--preset", "release", "-S", source, "-B", scratch, f"-DCMAKE_CXX_COMPILER={compiler}",
                       "-DSINEW_CCACHE=", *absent],
                      cwd=source, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
if done.returncode != 0:
    sys.exit(f"{done.stdout}\nfirst build: is not configured without what tests need")
if "its tests are not" not in done.stdout:
    sys.exit(f"{done.stdout}\nfirst build: does not say that tests are left out")
commands = json.loads(Path(scratch, "compile_commands.json").read_text())
tests = [entry["file"] for entry in commands if "_test.cpp" in entry["file"]]
if tests:
    sys.exit(f"first build: compiles tests: {tests[:5]}")
together = [entry for entry in commands if "/Unity/" in entry["file"]]
if not any("tools/field" in entry["file"] for entry in together):
    sys.exit("first build: tools/field is not compiled together")
headers = [entry for entry in commands if entry["file"].endswith("cmake_pch.hxx.cxx")]
for entry in headers:
    done = subprocess.run(shlex.split(entry["command"]) + ["-w"], cwd=entry["directory"], stderr=subprocess.PIPE, text=True)
    if done.returncode != 0:
        sys.exit(f"{done.stderr[-4000:]}\nfirst build: {entry['file']} does not compile")

listed = subprocess.run(["bash", "-c", 'source <(grep -A99 "^build_packages=" "$1" | sed "/^case/,$ d"); '
                         'printf "%s\\n" "${build_packages[@]}" "${program_packages[@]}"', "_", f"{source}/scripts/setup"],
                        stdout=subprocess.PIPE, text=True, check=True).stdout.split()
if "libassimp-dev" not in listed:
    sys.exit(f"first build: the packages of the program were not found in scripts/setup: {listed}")
for name in ("libgtest-dev", "clang-tidy", "clang-format", "xvfb", "xdotool", "libbullet-dev", "ccache"):
    if name in listed:
        sys.exit(f"first build: scripts/setup --program installs {name}")
print(f"configured with {len(listed)} packages; {len(commands)} files to compile, {len(together)} of them several together, no tests")

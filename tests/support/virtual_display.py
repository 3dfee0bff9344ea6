# SPDX-License-Identifier: MIT
"""A screen for tests of windows: Xvfb."""

import os
import shutil
import subprocess
import sys


def skip_without(*programs):
    """Ends the test, as skipped, where one of these is missing."""
    for program in programs:
        if not shutil.which(program):
            print(f"SKIPPED: {program} is not installed (scripts/setup installs it); the window is not tested")
            sys.exit(77)


def without_display(**more):
    """The environment of a program that finds no screen and draws by software, and no settings of whoever runs it."""
    environment = dict(os.environ, **{"LIBGL_ALWAYS_SOFTWARE": "1", "XDG_CONFIG_HOME": "/dev/null/none", **more})
    for name in ("WAYLAND_DISPLAY", "DISPLAY"):
        environment.pop(name, None)
    return environment


def start(environment, width=1280, height=800):
    """Starts a screen and names it in the environment. Returns its process."""
    read_end, write_end = os.pipe()
    server = subprocess.Popen(["Xvfb", "-displayfd", str(write_end), "-screen", "0", f"{width}x{height}x24"], pass_fds=[write_end], stderr=subprocess.DEVNULL)
    os.close(write_end)
    environment["DISPLAY"] = ":" + os.read(read_end, 16).decode().strip()
    return server

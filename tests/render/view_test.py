#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The window of `sinew view`, under a virtual display, driven by a real mouse and keyboard (xdotool).

The window writes what it did in each frame (--log-state); every check is against that, or against a screenshot.
"""
import argparse, json, math, pathlib, shutil, struct, subprocess, sys, tempfile, time, zlib

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "support"))
import virtual_display
from read_png import read_png

parser = argparse.ArgumentParser()
parser.add_argument("--sinew", required=True)
parser.add_argument("--spot", required=True)
parser.add_argument("--keep", help="folder for the screenshots")
arguments = parser.parse_args()

virtual_display.skip_without("Xvfb", "xdotool")

folder = pathlib.Path(tempfile.mkdtemp(prefix="sinew_view_"))
package = folder / "spot.sinew"
started = []


def fail(text):
    raise SystemExit(f"FAILED: {text}")


def check(condition, text):
    if not condition:
        fail(text)
    print(f"ok: {text}")


class View:
    def __init__(self, name, *options):
        self.log = folder / f"{name}.log"
        self.process = subprocess.Popen([arguments.sinew, "view", str(package), "--log-state", str(self.log), *options], env=environment)
        started.append(self.process)

    def state(self):
        """The last whole line of the log."""
        try:
            lines = self.log.read_text().split("\n")[:-1]
        except FileNotFoundError:
            return None
        lines = [line for line in lines if '"time"' in line]
        return json.loads(lines[-1]) if lines else None

    def wait(self, condition, what, seconds=90):
        end = time.time() + seconds
        while time.time() < end:
            if self.process.poll() is not None:
                fail(f"the window ended (exit {self.process.returncode}) while waiting: {what}")
            state = self.state()
            if state and condition(state):
                if not what.endswith("more frames"):
                    print(f"ok: {what}")
                return state
            time.sleep(0.05)
        fail(f"never seen: {what}; last state {self.state()}")

    def frames(self, count):
        start = self.state()["frame"]
        return self.wait(lambda s: s["frame"] >= start + count, f"{count} more frames")

    def settle(self):
        """Until the body's centre rests."""
        last = self.state()
        for _ in range(60):
            now = self.frames(8)
            if math.dist(last["center"], now["center"]) < 2e-4 * now["diagonal"]:
                return now
            last = now
        fail("the body does not come to rest")

    def end(self):
        self.process.terminate()
        self.process.wait(20)


def mouse(*words):
    subprocess.run(["xdotool", *map(str, words)], env=environment, check=True)


def drag_to(view, start, end, steps=12):
    for k in range(1, steps + 1):
        mouse("mousemove", round(start[0] + (end[0] - start[0]) * k / steps), round(start[1] + (end[1] - start[1]) * k / steps))
        view.frames(1)


try:
    environment = virtual_display.without_display()
    subprocess.run([arguments.sinew, "bake", arguments.spot, "-o", str(package)], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    # Without a display: one line that names what to do instead.
    done = subprocess.run([arguments.sinew, "view", str(package)], env=environment, capture_output=True, text=True)
    check(done.returncode == 4 and done.stderr.count("\n") == 1, "without a display it ends with exit 4 and one line")
    check("no display" in done.stderr and f"sinew render {package} -o " in done.stderr, "the line names `sinew render`")

    started.append(virtual_display.start(environment))

    # Grab, drag, let go: the hanging body follows the mouse and swings back.
    view = View("hang", "--scene", "hang")
    view.wait(lambda s: s["frame"] >= 3, "the window opens")
    before = view.settle()
    check(before["grabbed"] is None, "nothing is grabbed at first")
    at = [round(before["center_at"][0]), round(before["center_at"][1])]
    mouse("mousemove", *at)
    view.frames(2)
    mouse("mousedown", 1)
    held = view.wait(lambda s: s["grabbed"] is not None, "pressing on the body grabs it")
    check(math.dist(held["vertex_at"], at) < 40, "the grabbed vertex is under the mouse")
    to = [at[0] + 140, at[1] - 40]
    drag_to(view, at, to)
    view.frames(25)
    pulled = view.state()
    moved = [pulled["target_at"][k] - held["target_at"][k] for k in range(2)]
    check(math.dist(moved, [140, -40]) < 25, f"the target follows the mouse ({moved[0]:.0f}, {moved[1]:.0f} pixels of 140, -40)")
    vertex = [pulled["vertex_at"][k] - held["vertex_at"][k] for k in range(2)]
    check(vertex[0] > 0.4 * 140 and pulled["grabbed"] == held["grabbed"], f"the grabbed vertex came along ({vertex[0]:.0f} pixels right)")
    offset = math.dist(pulled["center"], before["center"]) / before["diagonal"]
    check(offset > 0.01, f"the body was pulled ({offset:.3f} diagonals)")
    check(pulled["camera"] == before["camera"], "the camera stayed")
    mouse("mouseup", 1)
    view.wait(lambda s: s["grabbed"] is None, "releasing lets go")
    after = view.settle()
    left = math.dist(after["center"], before["center"]) / before["diagonal"]
    check(left < 0.1 * offset, f"the body is back ({left:.5f} diagonals away)")

    # Looking around: on the background with the left button, anywhere with the right one; the wheel zooms.
    corner = [1230, 60]
    mouse("mousemove", *corner)
    view.frames(2)
    mouse("mousedown", 1)
    view.frames(2)
    drag_to(view, corner, [1130, 90], 5)
    view.frames(2)
    turned = view.state()
    mouse("mouseup", 1)
    check(turned["grabbed"] is None and abs(turned["camera"]["yaw"] - after["camera"]["yaw"]) > 0.3, "dragging the background orbits")
    view.frames(2)
    mouse("mousemove", *[round(c) for c in view.state()["center_at"]])
    view.frames(2)
    mouse("mousedown", 3)
    view.frames(2)
    mouse("mousemove_relative", 60, 0)
    right = view.wait(lambda s: abs(s["camera"]["yaw"] - turned["camera"]["yaw"]) > 0.2, "the right button orbits on the body too")
    check(right["grabbed"] is None, "without grabbing it")
    mouse("mouseup", 3)
    mouse("click", 4)
    view.wait(lambda s: s["camera"]["distance"] < right["camera"]["distance"] * 0.95, "the wheel zooms in")

    # Keys. There is no window manager here to give the window the keyboard.
    subprocess.run(["xdotool", "search", "--name", "^Sinew", "windowfocus"], env=environment, check=True)
    view.frames(2)
    mouse("key", "space")
    paused = view.wait(lambda s: not s["playing"], "Space pauses")
    check(view.frames(5)["steps"] == paused["steps"], "paused means no steps")
    mouse("key", "n")
    view.wait(lambda s: s["steps"] == paused["steps"] + 1, "N makes one step")
    mouse("key", "r")
    view.wait(lambda s: s["time"] == 0, "R starts again")
    mouse("key", "p")
    view.wait(lambda s: s["physical"], "P shows the physical mesh")
    mouse("key", "c")
    view.wait(lambda s: s["clusters"], "C shows the clusters")
    mouse("key", "2")
    view.wait(lambda s: s["scene"] == "drop", "2 chooses the scene drop")
    view.end()

    # Inputs of a package: a slider moves the channel and that of the other side; what is let go is the scene's again.
    recipe = folder / "muscles.json"
    (folder / "spot.obj").write_bytes(pathlib.Path(arguments.spot).read_bytes())
    sides = [{"name": f"leg.{side}", "from": {"half_space": [0, 0, 0], "normal": [x, 0, 0]}, "channel": f"leg.{side}"}
             for side, x in (("L", 1), ("R", -1))]
    recipe.write_text(json.dumps({"sinew_recipe": 2, "source": "spot.obj", "clusters": sides}))
    scene = folder / "pull.json"
    scene.write_text(json.dumps({"sinew_scene": 1, "channels": {"leg.*": [[0, 0.25]]},
                                 "camera": {"yaw": 10, "pitch": 20, "at": [0, 0, 0], "height": 1}}))
    subprocess.run([arguments.sinew, "bake", str(recipe), "-o", str(package)], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    view = View("channels", "--scene", str(scene))
    driven = view.wait(lambda s: s["frame"] >= 3, "the window opens on a scene from a file")
    check(driven["held_channels"] == 0 and abs(driven["inputs"] - 0.5) < 1e-3, "the scene drives both channels")
    check(abs(driven["camera"]["yaw"] - math.radians(10)) < 1e-4, "the camera is the scene's")
    mouse("mousemove", 170, 76)
    view.frames(2)
    mouse("click", 1)
    view.frames(3)
    mouse("mousemove", 60, 240)
    view.frames(2)
    mouse("mousedown", 1)
    view.frames(2)
    mouse("mousemove", 302, 240)
    both = view.wait(lambda s: s["inputs"] > 1.99, "a slider pulled to its end drives the channel and its other side")
    mouse("mouseup", 1)
    check(both["held_channels"] == 2, "both are held")
    mouse("mousemove", 200, 240)
    view.frames(2)
    mouse("click", 3)
    view.wait(lambda s: s["held_channels"] == 1 and abs(s["inputs"] - 1.25) < 1e-3, "a right click gives one back to the scene")
    mouse("mousemove", 140, 149)
    view.frames(2)
    mouse("click", 1)
    view.wait(lambda s: s["held_channels"] == 0 and abs(s["inputs"] - 0.5) < 1e-3, "the button lets all go")
    view.end()
    subprocess.run([arguments.sinew, "bake", arguments.spot, "-o", str(package)], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    # Pictures of the window: at rest, and at the end of a drag.
    pictures = []
    for name, pull in (("rest", False), ("pulled", True)):
        picture = folder / f"{name}.png"
        view = View(name, "--scene", "hang", "--frames", "110" if pull else "40", "--screenshot", str(picture))
        if pull:
            state = view.wait(lambda s: s["frame"] >= 40, "40 frames")
            at = [round(state["center_at"][0]), round(state["center_at"][1])]
            mouse("mousemove", *at)
            view.frames(2)
            mouse("mousedown", 1)
            view.frames(2)
            drag_to(view, at, [at[0] + 180, at[1]], 8)
        check(view.process.wait(120) == 0, f"the window ends by itself after its frames ({name})")
        if pull:
            mouse("mouseup", 1)
        pictures.append(read_png(picture))
    (width, height, rest), (_, _, pulled_rows) = pictures
    check((width, height) == (1280, 800), "the screenshot has the window's size")
    changed = sum(max(abs(a[3 * x + k] - b[3 * x + k]) for k in range(3)) > 40 for a, b in zip(rest, pulled_rows) for x in range(300, width))
    check(changed > 5000, f"the pulled body looks different ({changed} pixels)")
    orange = sum(r[3 * x] > 220 and 100 < r[3 * x + 1] < 190 and r[3 * x + 2] < 90 for r in pulled_rows for x in range(300, width))
    check(orange > 20, f"the pull is drawn ({orange} pixels)")  # the mark at the point: it has come to the cursor
    still = sum(r[3 * x] > 220 and 100 < r[3 * x + 1] < 190 and r[3 * x + 2] < 90 for r in rest for x in range(300, width))
    check(still < orange / 4, f"without a pull it is not ({still} pixels)")
    if arguments.keep:
        for picture in folder.glob("*.png"):
            shutil.copy(picture, arguments.keep)
    print("all passed")
finally:
    for process in reversed(started):
        if process.poll() is None:
            process.terminate()
            process.wait(20)
    shutil.rmtree(folder, ignore_errors=True)

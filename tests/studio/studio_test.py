#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The window of `sinew studio`, under a virtual display: input from a file paints, picks, bakes and pulls a slider, and
the recipe that it leaves is the one expected; what others write to the recipe while it runs is taken over.
"""
import argparse, json, os, pathlib, resource, shutil, signal, subprocess, sys, tempfile, time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "render"))
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "support"))
import virtual_display
from read_png import read_png

parser = argparse.ArgumentParser()
parser.add_argument("--sinew", required=True)
parser.add_argument("--head", required=True)
parser.add_argument("--keep", help="folder for the screenshots")
parser.add_argument("--write-expected", action="store_true", help="make the recipe of this run the expected one")
arguments = parser.parse_args()
here = pathlib.Path(__file__).resolve().parent
arguments.sinew = str(pathlib.Path(arguments.sinew).resolve())
slowness = int(os.environ.get("SINEW_TEST_SLOWNESS", "1"))

virtual_display.skip_without("Xvfb")

folder = pathlib.Path(tempfile.mkdtemp(prefix="sinew_studio_test_"))
started = []


def check(condition, text):
    if not condition:
        raise SystemExit(f"FAILED: {text}")
    print(f"ok: {text}", flush=True)


def sinew(*words, **more):
    return subprocess.run([arguments.sinew, *map(str, words)], cwd=folder, env=environment, capture_output=True, text=True, **more)


def done(*words):
    result = sinew(*words)
    check(result.returncode == 0, f"{' '.join(map(str, words))[:70]} {result.stderr.strip()[-300:] if result.returncode else ''}")
    return result


def new_recipe(name):
    for words in (["new", "head.obj"], ["set", "import.unit=dm", "import.crease=180", "tetrahedra.vertices=1500", "clusters.mode=linear"]):
        done("author", name, *words)


def numbers_near(a, b, where):
    """Equal, but for numbers that differ by a fraction of a millimetre."""
    if isinstance(a, (int, float)) and isinstance(b, (int, float)) and not isinstance(a, bool):
        check(abs(a - b) < 2e-4, f"{where}: {a} is near {b}") if abs(a - b) >= 2e-4 else None
    elif isinstance(a, dict) and isinstance(b, dict):
        check(list(a) == list(b), f"{where}: keys {list(a)} = {list(b)}") if list(a) != list(b) else None
        for key in a:
            numbers_near(a[key], b[key], f"{where}/{key}")
    elif isinstance(a, list) and isinstance(b, list):
        check(len(a) == len(b), f"{where}: {len(a)} = {len(b)} entries") if len(a) != len(b) else None
        for i, (x, y) in enumerate(zip(a, b)):
            numbers_near(x, y, f"{where}/{i}")
    elif a != b:
        check(False, f"{where}: {a!r} is {b!r}")


def everything(recipe):
    """A recipe with its stroke files inside."""
    document = json.loads((folder / recipe).read_text())
    files = sorted((folder / recipe).with_suffix(".strokes").glob("*.json"))
    return {"recipe": document, "strokes": {file.name: json.loads(file.read_text()) for file in files}}


class Studio:
    def __init__(self, *words):
        self.log = folder / "state.log"
        self.log.unlink(missing_ok=True)
        self.process = subprocess.Popen([arguments.sinew, "studio", *map(str, words), "--log-state", str(self.log)], cwd=folder, env=environment)
        started.append(self.process)

    def state(self):
        try:
            lines = self.log.read_text().split("\n")[:-1]
        except FileNotFoundError:
            return None
        lines = [line for line in lines if '"time"' in line]
        return json.loads(lines[-1]) if lines else None

    def wait(self, condition, what, seconds=120):
        end = time.time() + seconds * slowness
        while time.time() < end:
            check(self.process.poll() is None, f"the window runs while waiting: {what}") if self.process.poll() is not None else None
            state = self.state()
            if state and condition(state):
                print(f"ok: {what}", flush=True)
                return state
            time.sleep(0.05)
        raise SystemExit(f"FAILED: never seen: {what}; last state {self.state()}")


def replayed(name, events, file, *words):
    """Runs events in a window to their end; the states of its frames and what it said."""
    (folder / f"{name}.json").write_text(json.dumps({"events": events}))
    (folder / f"{name}.log").unlink(missing_ok=True)
    done("studio", file, "--replay", f"{name}.json", "--log-state", f"{name}.log", *words)
    lines = [json.loads(line) for line in (folder / f"{name}.log").read_text().split("\n")[:-1]]
    return [line for line in lines if "time" in line], [line["message"] for line in lines if "message" in line]


def newest_strokes(recipe, mask):
    document = json.loads((folder / recipe).read_text())
    return json.loads((folder / document["masks"][mask]["strokes"]).read_text())["strokes"]


def tools_of_the_window():
    new_recipe("tools.json")
    # Brushes on the screen, a loop, grow: each is a stroke of the recipe, one step of its history, and a command.
    replayed("brushes", [
        {"wait": "evaluation"}, {"click": "tab Paint"}, {"click": "New mask"}, {"text": "spot"}, {"key": "enter"},
        {"click": "Screen"}, {"stroke": [[0.062, 0.662, 0.103], [0.04, 0.633, 0.125]]}, {"wait": "evaluation"},
        {"click": "Lasso"}, {"stroke": [[0.0, 0.74, 0.11], [0.03, 0.74, 0.105], [0.03, 0.71, 0.12], [0.0, 0.71, 0.125]]}, {"wait": "evaluation"},
        {"screenshot": "lasso.png"}, {"click": "Grow"}, {"wait": "evaluation"}, {"click": "Make a cluster"}, {"wait": "evaluation"}], "tools.json")
    strokes = newest_strokes("tools.json", "spot")
    check(len(strokes) == 3, f"three strokes ({len(strokes)})")
    check("eye" in strokes[0] and strokes[0]["radius"] > 0, "the first is a brush on the screen")
    check(strokes[1].get("lasso") and len(strokes[1]["points"]) > 3, "the second is a loop")
    check(strokes[2]["mode"] == "grow" and "points" not in strokes[2], "the third grows")
    covered = lambda: json.loads(done("author", "tools.json", "show", "spot", "--json").stdout)["selections"][0]["visual_vertices"]
    with_grow = covered()
    for _ in range(2):  # the cluster, then the growing
        done("author", "tools.json", "undo")
    without = covered()
    check(0 < without < with_grow, f"growing reaches more vertices ({without}, then {with_grow})")
    done("author", "tools.json", "stroke", "spot", "--mode", "grow", "--radius", strokes[2]["radius"], "--falloff", strokes[2]["falloff"])
    check(covered() == with_grow, "the command line grows as the window does")
    refused = sinew("author", "tools.json", "stroke", "spot", "--mode", "grow", "--radius", "0.01", "0,0,0")
    check(refused.returncode == 2 and "no points" in refused.stderr, "growing at a point is refused")

    # Handles: a disc of pins is sized and moved, a fibre is turned; one step of the history each.
    done("author", "tools.json", "add-pins", "hold", "--from", '{"disc": [0, 0.74, 0.11], "radius": 0.02}')
    done("author", "tools.json", "muscle", "smile.L", "--from", "0.062,0.662,0.103", "--to", "0.03,0.619,0.126", "--width", "0.03")
    fibre = json.loads((folder / "tools.json").read_text())["clusters"][-1]["fibre"]
    replayed("handles", [
        {"wait": "evaluation"}, {"click": "tab Regions"}, {"click": "region hold"}, {"wait": 3}, {"pull": "handle radius", "by": [40, 0]}, {"wait": "evaluation"},
        {"wait": 3}, {"screenshot": "handles.png"}, {"pull": "handle center", "by": [30, 20]}, {"wait": "evaluation"},
        {"click": "region smile.L"}, {"wait": 3}, {"pull": "handle fibre", "by": [10, 60]}, {"wait": "evaluation"}, {"wait": 3}, {"screenshot": "fibre.png"}], "tools.json")
    # Order: the window's command is the command line's.
    done("author", "tools.json", "add-cluster", "extra", "--from", "spot")
    replayed("order", [{"wait": "evaluation"}, {"click": "tab Regions"}, {"click": "region extra"}, {"wait": 3}, {"click": "Up"}, {"wait": "evaluation"},
                       {"click": "Solo"}, {"wait": 3}, {"screenshot": "order.png"}], "tools.json")
    check([c["name"] for c in json.loads((folder / "tools.json").read_text())["clusters"]] == ["extra", "smile.L"], "Up moves a cluster up")
    check("move extra up" in done("author", "tools.json", "undo").stdout, "one step of the history")
    done("author", "tools.json", "undo")
    # The slider of a region's frequency scales all three, and is one step.
    replayed("rings", [{"wait": "evaluation"}, {"click": "tab Regions"}, {"click": "region smile.L"}, {"wait": 3}, {"drag": "Rings at", "to": 0.9},
                       {"wait": "evaluation"}, {"wait": 3}, {"screenshot": "rings.png"}], "tools.json")
    made = json.loads((folder / "tools.json").read_text())["clusters"][-1].get("settings", {})
    hz = [made.get(key, 0) for key in ("stretch_hz", "bend_hz", "twist_hz")]
    check(hz[0] > 50 and hz[0] == hz[1] == hz[2], f"what the slider was dragged to stays ({made})")
    done("author", "tools.json", "undo")
    made = json.loads((folder / "tools.json").read_text())["clusters"][-1].get("settings", {})
    check(not any(key.endswith("_hz") for key in made), f"and is one step of the history ({made})")
    document = json.loads((folder / "tools.json").read_text())
    pins = document["pins"][0]["from"]
    check(pins["radius"] > 0.025, f"the handle makes the disc larger ({pins['radius']} m)")
    check(pins["disc"][0] > 0.005, f"the handle moves it ({pins['disc']})")
    check(document["clusters"][-1]["fibre"] != fibre, "the fibre is turned")
    check("set /clusters" in done("author", "tools.json", "undo").stdout, "and back by one step")

    # Playing: back in time, slow motion, a cut, a push; digits typed into a field switch no scene; the pose is saved.
    done("author", "tools.json", "undo")
    states, said = replayed("playing", [
        {"wait": "bake"}, {"click": "tab Scene"}, {"click": "Scene choice"}, {"click": "rest"}, {"wait": 20}, {"key": "space"}, {"key": "b"}, {"key": "b"}, {"wait": 3},
        {"key": "n"}, {"wait": 3}, {"click": "tab Channels"}, {"drag": "channel smile.L", "to": 1}, {"key": "space"}, {"wait": 10}, {"key": "space"}, {"click": "Find"}, {"text": "3"}, {"key": "3"}, {"text": "1"}, {"key": "1"},
        {"key": "space"}, {"key": "b"}, {"wait": 3}, {"key": "enter"}, {"key": "control+s"}, {"wait": 3}, {"screenshot": "save.png"}, {"click": "Save the file"}, {"wait": 3},
        {"key": "control+e"}, {"wait": 3}], "tools.json")
    check(any(later["time"] < before["time"] for before, later in zip(states, states[1:])), "B goes back in time")
    check({s["scene"] for s in states[-20:]} == {"rest"}, "digits typed into a field switch no scene")
    check(states[-1]["inputs"] > 0.99 and not states[-1]["playing"], f"nor do letters play ({states[-1]})")
    scene = json.loads((folder / "tools.scene.json").read_text())
    check(abs(scene["channels"]["smile.L"][-1][1] - 1) < 1e-3 and "camera" in scene, "the scene has the channel and the camera")
    done("render", "tools.sinew", "--scene", "tools.scene.json", "--frames", "1", "-o", "pose.png")
    states, _ = replayed("cutting", [
        {"wait": 20}, {"key": "2"}, {"wait": 10}, {"key": "j"}, {"pull": [800, 400], "by": [60, 0], "hold": 10, "screenshot": "push.png"}, {"key": "1"}, {"wait": 3}, {"key": "k"},
        {"pull": [480, 390], "by": [640, 20], "hold": 3, "screenshot": "knife.png"}, {"wait": 30}, {"screenshot": "cut.png"}, {"key": "space"}, {"key": "b"}, {"wait": 2}], "tools.sinew")
    check(any(s["scene"] == "drop" for s in states), "a digit that nobody types into a field does")
    check(max(s["bodies"] for s in states) >= 2, "a line cuts the body")

    # Colliders: added, moved, sized and turned by their handles while the scene plays; the scene's file has them.
    replayed("colliders", [
        {"wait": 20}, {"key": "2"}, {"wait": 3}, {"click": "tab Scene"}, {"click": "+ Sphere"}, {"click": "+ Capsule"}, {"click": "+ Box"}, {"wait": 5},
        {"pull": "handle center", "by": [-260, 120]}, {"pull": "handle size x", "by": [60, 0]}, {"pull": "handle turn y", "by": [90, 60]}, {"wait": 5}, {"screenshot": "colliders.png"},
        {"click": "capsule 2"}, {"wait": 3}, {"pull": "handle radius", "by": [20, 0]}, {"wait": 3}, {"screenshot": "capsule.png"}, {"click": "sphere 1"}, {"wait": 3},
        {"click": "Remove the collider"}, {"drag": "Height", "to": 0.45}, {"wait": 40}, {"screenshot": "ground.png"}, {"key": "control+s"}, {"wait": 3}, {"click": "Save the file"}, {"wait": 3}], "tools.sinew")
    scene = json.loads((folder / "tools.scene.json").read_text())
    capsule, box = scene["colliders"]
    check("capsule" in capsule and "box" in box, f"the scene has the colliders that were not removed ({scene['colliders']})")
    check(box["box"]["half_size"][0] > 1.2 * box["box"]["half_size"][1], "a handle sizes the box")
    check(abs(box["keys"][0]["turn"]) > 5 and len(box["axis"]) == 3, "a handle turns it")
    check(scene["ground"] < scene["camera"]["at"][1], "the ground is there")
    done("render", "tools.sinew", "--scene", "tools.scene.json", "--frames", "1", "-o", "colliders_scene.png")
    replayed("falling", [{"wait": 20}, {"key": "2"}, {"wait": 3}, {"key": "control+s"}, {"wait": 3}, {"click": "Save the file"}, {"wait": 3}], "tools.sinew")
    measured = json.loads(done("simulate", "tools.sinew", "--scene", "tools.scene.json", "--seconds", "3", "--json").stdout)
    check(measured["lowest"] < 0.1, f"saved, it falls to the ground as here, held by no pins ({measured['lowest']} diagonals above)")

    # The page of keys, the menu, a file that is dropped, one that cannot be opened.
    states, said = replayed("pages", [
        {"wait": "evaluation"}, {"key": "f1"}, {"wait": 4}, {"screenshot": "help.png"}, {"key": "f1"}, {"click": "menu Play"}, {"wait": 4}, {"screenshot": "menu.png"}, {"key": "escape"},
        {"drop": "nothing.obj"}, {"wait": 4}, {"drop": "tools.sinew"}, {"wait": 20}], "tools.json")
    check(any("nothing.obj" in text for text in said), f"what cannot be opened is said ({said})")
    check(states and "opened tools.sinew" in said[-1], "a dropped package plays")
    # The front.
    done("author", "tools.json", "set", "import.front=-x")
    replayed("front", [{"wait": "evaluation"}, {"wait": 3}, {"screenshot": "front.png"}], "tools.json")
    # A factor of all stiffness.
    before = json.loads((folder / "tools.json").read_text())
    stiffer = done("author", "tools.json", "stiffen", "2").stdout
    check("clusters.stretch_hz: default -> 20" in stiffer, "stiffen says what it changes")
    done("author", "tools.json", "undo")
    check(json.loads((folder / "tools.json").read_text()) == before, "and is one step")


def files_cannot_grow():
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1500, 1500))


def films():
    """The menu films what plays, in a process of its own."""
    film = [{"click": "menu File"}, {"click": "Video of the scene ..."}, {"wait": 3}, {"drag": "Length", "to": 0}]
    states, said = replayed("film", [
        {"wait": 20}, {"key": "2"}, {"wait": 5}, {"click": "tab Scene"}, {"click": "+ Box"}, *film, {"screenshot": "film.png"}, {"click": "Film the file"}, {"wait": 2},
        {"screenshot": "filming.png"}, {"wait": "film"}, {"wait": 2}, {"click": "menu File"}, {"click": "Turntable ..."}, {"wait": 3}, {"drag": "Length", "to": 0},
        {"click": "The scene drop from its start, as it is by itself"}, {"click": "Film the file"}, {"wait": "film"}, {"wait": 2}, *film, {"click": "Film the file"},
        {"wait": 2}, {"click": "Cancel the video"}, {"wait": 3}], "tools.sinew")
    check("wrote tools.mp4" in said and "wrote tools.turntable.mp4" in said, f"both are there ({said})")
    check(said[-1] == "the video is given up", "one that is being made can be given up")
    for name in ("tools.mp4", "tools.turntable.mp4"):
        check((folder / name).read_bytes()[4:8] == b"ftyp", f"{name} is a video")
    (folder / "full_film.json").write_text(json.dumps({"events": [{"wait": 20}, {"key": "2"}, *film, {"click": "Film the file"}, {"wait": "film"}, {"wait": 3}]}))
    result = subprocess.run([arguments.sinew, "studio", "tools.sinew", "--replay", "full_film.json", "--log-state", "/dev/stdout"], cwd=folder, env=environment,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=files_cannot_grow)
    said = [json.loads(line)["message"] for line in result.stdout.split("\n") if '"message"' in line]
    check(said and said[-1].startswith("no video: tools.mp4"), f"what cannot be written is said ({said})")


def mouse_is_kept():
    """The mouse's habits are those of the last session; a place that cannot be written is no error."""
    kept = folder / "config" / "sinew" / "studio.json"
    kept.parent.mkdir(parents=True)
    kept.write_text('{"later": 1}')
    look = lambda: replayed("mouse", [{"wait": 3}, {"pull": [1180, 90], "by": [60, 0]}, {"click": "menu Look"}, {"click": "Mouse as in Maya"}, {"wait": 3}], "tools.sinew")[0]
    turned = lambda states: abs(states[-1]["camera"]["yaw"] - states[1]["camera"]["yaw"]) > 0.05
    check(turned(look()), "left beside the model orbits at first")
    check(json.loads(kept.read_text()) == {"later": 1, "navigation": "Maya"}, "the choice is kept beside what else is there")
    check(not turned(look()), "and is that of the next session")
    kept.write_text('{"navigation": ')
    check(turned(look()), "what cannot be read is as if it were not there")
    shutil.rmtree(kept.parent)
    kept.parent.write_text("no folder")
    check(turned(look()), "nor is a place that cannot be written an error")
    kept.parent.unlink()


def trouble_on_the_disk():
    """Files that cannot grow: a message that names the file, and the recipe on the disk is whole."""
    before = (folder / "tools.json").read_bytes()
    (folder / "full.json").write_text(json.dumps({"events": [
        {"wait": "evaluation"}, {"click": "tab Paint"}, {"click": "Paint on"}, {"wait": 3}, {"click": "spot"}, {"click": "Surface"},
        {"stroke": [[-0.062, 0.662, 0.103], [-0.04, 0.633, 0.125]]}, {"wait": 20}, {"key": "control+z"}, {"wait": 20}]}))
    result = subprocess.run([arguments.sinew, "studio", "tools.json", "--replay", "full.json", "--log-state", "/dev/stdout"], cwd=folder, env=environment,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=files_cannot_grow)
    said = [json.loads(line)["message"] for line in result.stdout.split("\n") if '"message"' in line]
    check(result.returncode == 0, f"with a full disk the window goes on {result.stderr[-300:]}")
    check(any("cannot write" in text or "cannot finish" in text for text in said), f"it says so ({said})")
    check((folder / "tools.json").read_bytes() == before, "nothing of the recipe is lost")
    check(sinew("author", "tools.json", "show", "--json").returncode == 0, "it loads")
    if os.geteuid() == 0:
        print("a folder that may not be written into: not tested, root may write everywhere", flush=True)
        return
    closed = folder / "closed"
    shutil.copytree(folder, closed, ignore=lambda *_: ["closed", "cache"])
    closed.chmod(0o555)
    (folder / "closed.json").write_text((folder / "full.json").read_text())
    result = subprocess.run([arguments.sinew, "studio", "closed/tools.json", "--replay", "closed.json", "--log-state", "/dev/stdout"], cwd=folder, env=environment, capture_output=True, text=True)
    closed.chmod(0o755)
    check(result.returncode == 0 and "cannot" in result.stdout, "in a folder that may not be written into it says so")


try:
    environment = virtual_display.without_display(XDG_CACHE_HOME=str(folder / "cache"), XDG_CONFIG_HOME=str(folder / "config"))
    shutil.copy(arguments.head, folder / "head.obj")
    new_recipe("face.json")

    result = sinew("studio", "face.json")
    check(result.returncode == 4 and "no display" in result.stderr, "without a display it ends with exit 4 and one line")

    started.append(virtual_display.start(environment))

    # Events that are wrong say where.
    (folder / "wrong.json").write_text('{"events": [\n {"klick": "Paint"}]}')
    result = sinew("studio", "face.json", "--replay", "wrong.json")
    check(result.returncode == 3 and "line 2" in result.stderr and "click" in result.stderr, "an unknown event is named with its line")

    # The first-time path.
    done("studio", "face.json", "--replay", here / "smile.events.json")
    made = everything("face.json")
    if arguments.write_expected:
        (here / "smile.expected.json").write_text(json.dumps(made, indent=1) + "\n")
    numbers_near(made, json.loads((here / "smile.expected.json").read_text()), "")
    print("ok: the recipe is the expected one", flush=True)
    names = [cluster["name"] for cluster in made["recipe"]["clusters"]]
    check(names == ["cheeks", "brows", "smile.L", "smile.R"], f"clusters {names}")
    check(made["recipe"]["pins"][0]["name"] == "hold", "pins are there")
    shown = json.loads(done("author", "face.json", "show", "--json").stdout)
    counts = {entry["name"]: entry["visual_vertices"] for entry in shown["selections"]}
    check(all(count > 10 for count in counts.values()), f"every region selects vertices: {counts}")
    for picture in ("paint", "pick", "regions", "channels"):
        width, height, rows = read_png(folder / f"{picture}.png")
        check((width, height) == (1280, 800), f"the screenshot {picture} has the window's size")
        colors = {bytes(rows[y][3 * x:3 * x + 3]) for y in range(0, height, 5) for x in range(345, width, 5)}
        check(len(colors) > 200, f"{picture} shows something ({len(colors)} colours)")

    # Reopened: the same; and the command line goes back over what the window did.
    (folder / "look.json").write_text('{"events": [{"wait": "evaluation"}, {"click": "tab Paint"}, {"wait": 5}]}')
    done("studio", "face.json", "--replay", "look.json")
    check(everything("face.json") == made, "opened again and closed, the recipe is the same")
    undone = done("author", "face.json", "undo").stdout
    check("add-pins hold" in undone, "the command line undoes what the window did")
    (folder / "undo.json").write_text('{"events": [{"wait": "evaluation"}, {"key": "control+z"}, {"wait": 5}, {"click": "Redo"}, {"wait": 5}, {"click": "Redo"}, {"wait": 5}]}')
    done("studio", "face.json", "--replay", "undo.json")
    check(everything("face.json")["recipe"] == made["recipe"], "the window redoes what the command line undid")

    # While it plays another program writes the recipe: a new body that goes on, and nothing of theirs is lost.
    (folder / "play.json").write_text(json.dumps({"events": [{"wait": "bake"}, {"click": "tab Scene"}, {"click": "Scene choice"}, {"click": "hang"}, {"wait": 1000000}]}))
    studio = Studio("face.json", "--replay", "play.json")
    before = studio.wait(lambda s: s["scene"] == "hang" and s["time"] > 1, "the scene plays")
    done("author", "face.json", "set", "cheeks.stretch_hz=0.5")
    edited = time.time()
    studio.wait(lambda s: s["bakes"] > before["bakes"], "the window has a draft of the new body")
    print(f"    {time.time() - edited:.1f} s after the edit", flush=True)
    studio.wait(lambda s: s["bakes"] > before["bakes"] + 1, "the whole bake follows the draft")
    print(f"    {time.time() - edited:.1f} s after the edit", flush=True)
    lines = [json.loads(line) for line in studio.log.read_text().split("\n")[:-1] if '"time"' in line]
    for bakes in (before["bakes"] + 1, before["bakes"] + 2):
        swap = next(i for i, line in enumerate(lines) if line["bakes"] >= bakes)
        old, new = lines[swap - 1], lines[swap]
        check(new["time"] >= old["time"], f"the time goes on ({old['time']} s, then {new['time']} s)")
        moved = sum((a - b) ** 2 for a, b in zip(old["center"], new["center"])) ** 0.5 / old["diagonal"]
        check(moved < 0.02, f"the body stays where it is ({moved:.5f} diagonals)")
        check(old["camera"] == new["camera"], "the camera stays")
    # Killed at any moment, nothing is lost.
    studio.process.send_signal(signal.SIGKILL)
    studio.process.wait(20)
    check(json.loads((folder / "face.json").read_text())["clusters"][0]["settings"] == {"stretch_hz": 0.5}, "killed, the recipe is whole")
    done("author", "face.json", "undo")

    # Another program leaves a recipe that cannot be read, and the window has an edit: it asks, and keeps both.
    (folder / "keep.json").write_text(json.dumps({"events": [
        {"wait": "bake"}, {"wait": 500}, {"click": "tab Pick"}, {"click": [0.04, 0.633, 0.125]}, {"click": "Name of it"}, {"text": "spot"},
        {"click": "Mask"}, {"wait": 5}, {"click": "Keep mine"}, {"wait": 5}]}))
    studio = Studio("face.json", "--replay", "keep.json")
    studio.wait(lambda s: s["bakes"] > 0, "the window has a body")
    (folder / "face.json").write_text('{"sinew_recipe": 3, "source": ')
    check(studio.process.wait(120 * slowness) == 0, "asked, the window's edit is kept")
    check("spot" in json.loads((folder / "face.json").read_text())["masks"], "the edit is in the recipe")
    check((folder / "face.json.theirs").read_text() == '{"sinew_recipe": 3, "source": ', "what could not be read is put aside")

    # A source without a recipe gets one beside it; another one's is not taken.
    (folder / "open.json").write_text('{"events": [{"wait": "evaluation"}]}')
    done("studio", "head.obj", "--replay", "open.json")
    check(json.loads((folder / "head.json").read_text())["source"] == "head.obj", "a recipe beside the source")
    shutil.copy(folder / "head.obj", folder / "other.obj")
    (folder / "other.json").write_text((folder / "head.json").read_text())
    result = sinew("studio", "other.obj", "--replay", "open.json")
    check(result.returncode == 2 and "-o NAME.json" in result.stderr, "a recipe of another source is not taken for its own")
    # Another file comes while a dialog about this one's body is open: the dialog goes with the body.
    (folder / "late.json").write_text(json.dumps({"events": [
        {"wait": "bake"}, {"key": "control+s"}, {"wait": 5}, {"drop": "head.json"}, {"wait": "evaluation"}, {"wait": 5},
        {"click": "tab Paint"}, {"click": "New mask"}, {"text": "late"}, {"key": "enter"},
        {"stroke": [[0.62, 6.62, 1.03], [0.4, 6.33, 1.25]]}, {"wait": "evaluation"}]}))
    done("studio", "face.json", "--replay", "late.json")
    check("late" in json.loads((folder / "head.json").read_text()).get("masks", {}), "a dialog closes when another file comes")
    tools_of_the_window()
    films()
    mouse_is_kept()
    trouble_on_the_disk()
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

#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Random input with fixed seeds in the window of `sinew studio`, under a virtual display: no crash, no growth, and the
recipe on the disk always loads, also where the window is killed in the middle.

    random_input.py --sinew build/asan/bin/sinew --head HEAD.obj --seconds 600
"""
import argparse, json, pathlib, random, shutil, signal, subprocess, sys, tempfile, time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "support"))
import virtual_display

parser = argparse.ArgumentParser()
parser.add_argument("--sinew", required=True)
parser.add_argument("--head", required=True)
parser.add_argument("--seconds", type=float, default=600)
parser.add_argument("--events", type=int, default=250, help="of one window")
parser.add_argument("--first-seed", type=int, default=1)
arguments = parser.parse_args()
arguments.sinew = str(pathlib.Path(arguments.sinew).resolve())

virtual_display.skip_without("Xvfb")

WIDTH, HEIGHT, PANEL = 1280, 800, 400
KILLED = 4  # every fourth window is killed on its way
MOST_SECONDS = 900  # of one window, with a sanitizer and a bake
GROWTH = 1.6  # of the memory since the first third, with what is kept to go back
ROOM_MB = 200

folder = pathlib.Path(tempfile.mkdtemp(prefix="sinew_random_input_"))
environment = virtual_display.without_display(XDG_CACHE_HOME=str(folder / "cache"))
sanitizer = environment.get("ASAN_OPTIONS", "")
# The OpenGL driver keeps 240 bytes.
environment["ASAN_OPTIONS"] = ":".join(filter(None, [sanitizer, "detect_leaks=0", "quarantine_size_mb=16"]))


def events(seed):
    dice = random.Random(seed)
    place = lambda: [dice.randrange(PANEL), dice.randrange(HEIGHT)] if dice.random() < 0.5 else [dice.randrange(PANEL, WIDTH), dice.randrange(HEIGHT)]
    keys = list("abcdefghijklmnopqrstuvwxyz0123456789[]") + ["enter", "escape", "space", "tab", "f1", "control+z", "control+z", "control+shift+z", "control+y", "control+s", "control+e"]
    texts = ["cheeks", "a", "..", "smile.L", "ä€", "\"", "x/y", "0.5", "-1", "*", "head.json", " "]
    made = [{"wait": "evaluation"}, {"click": "tab Paint"}, {"click": "New mask"}, {"text": "cheeks"}, {"key": "enter"},
            {"stroke": [[0.062, 0.662, 0.103], [0.04, 0.633, 0.125]]}, {"wait": "evaluation"}]
    tabs = ["tab Regions", "tab Paint", "tab Pick", "tab Scene", "tab Show"]
    for _ in range(arguments.events):
        kind = dice.choices(["click", "right", "pull", "wheel", "key", "text", "orbit", "wait", "drop", "tab"], [30, 4, 18, 6, 20, 8, 4, 4, 1, 5])[0]
        if kind == "click":
            made.append({"click": place()})
        elif kind == "right":
            made.append({"click": place(), "button": "right"})
        elif kind == "pull":
            made.append({"pull": place(), "by": [dice.randint(-300, 300), dice.randint(-200, 200)], "hold": dice.randint(1, 10)})
        elif kind == "wheel":
            made.append({"wheel": dice.choice([-3, -1, 1, 3])})
        elif kind == "key":
            made.append({"key": dice.choice(keys)})
        elif kind == "text":
            made.append({"text": dice.choice(texts)})
        elif kind == "orbit":
            made.append({"orbit": [dice.randint(-200, 200), dice.randint(-200, 200)]})
        elif kind == "wait":
            made.append({"wait": dice.randint(1, 60)})
        elif kind == "tab":
            # By its place: a dialog may lie over it.
            made.append({"click": [30 + 60 * dice.randrange(len(tabs)), 150]})
        else:
            made.append({"drop": dice.choice(["head.obj", "head.json", "nothing.obj", "broken.json", "broken.sinew"])})
    return made


def memory(pid):
    try:
        for line in pathlib.Path(f"/proc/{pid}/status").read_text().splitlines():
            if line.startswith("VmRSS"):
                return int(line.split()[1]) / 1024
    except FileNotFoundError:
        pass
    return 0


def sinew(*words):
    return subprocess.run([arguments.sinew, *map(str, words)], cwd=folder, env=environment, capture_output=True, text=True)


def fail(text):
    raise SystemExit(f"FAILED: {text}")


server = None
try:
    shutil.copy(arguments.head, folder / "head.obj")
    (folder / "broken.json").write_text('{"sinew_recipe": 3, "source": "head.obj", "clusters": 7}')
    (folder / "broken.sinew").write_bytes(b"SINEW" + bytes(100))
    for words in (["new", "head.obj"], ["set", "import.unit=dm", "import.crease=180", "tetrahedra.vertices=300", "clusters.mode=linear", "field.functions=8"]):
        result = sinew("author", "head.json", *words)
        if result.returncode != 0:
            fail(result.stderr)
    server = virtual_display.start(environment, WIDTH, HEIGHT)
    begun, seed, done = time.time(), arguments.first_seed, 0
    while time.time() - begun < arguments.seconds:
        (folder / "random.json").write_text(json.dumps({"events": events(seed)}))
        start = time.time()
        with open(folder / "errors.txt", "w") as errors:
            window = subprocess.Popen([arguments.sinew, "studio", "head.json", "--replay", "random.json"], cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=errors)
        die_at = start + random.Random(-seed).uniform(3, 25) if seed % KILLED == 0 else None
        seen = []
        while window.poll() is None:
            time.sleep(0.25)
            seen.append(memory(window.pid))
            if die_at and time.time() > die_at:
                window.send_signal(signal.SIGKILL)
                window.wait(20)
            if time.time() - start > MOST_SECONDS:
                window.kill()
                window.wait(20)
                fail(f"seed {seed}: the window does not end")
        said = (folder / "errors.txt").read_text()
        killed = die_at is not None and window.returncode == -signal.SIGKILL
        if not killed and (window.returncode != 0 or "ERROR: AddressSanitizer" in said or "runtime error" in said):
            fail(f"seed {seed}: exit {window.returncode}\n{said[-6000:]}")
        settled = seen[len(seen) // 3] if seen else 0
        if not killed and max(seen[-3:], default=0) > GROWTH * settled + ROOM_MB:
            fail(f"seed {seed}: memory grew from {settled:.0f} MB to {seen[-1]:.0f} MB")
        result = sinew("author", "head.json", "show", "--json")
        if result.returncode != 0:
            fail(f"seed {seed}: the recipe does not load: {result.stderr[-2000:]}")
        regions = len(json.loads(result.stdout)["selections"])
        done += 1
        print(f"ok: seed {seed}: {time.time() - start:.0f} s, {'killed' if killed else 'ended by itself'}, {settled:.0f} then {max(seen[-3:], default=0):.0f} MB, {regions} regions", flush=True)
        seed += 1
    print(f"all passed: {done} windows in {time.time() - begun:.0f} s")
finally:
    if server is not None:
        server.terminate()
        server.wait(20)
    shutil.rmtree(folder, ignore_errors=True)

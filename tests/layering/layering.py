#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Fails when an include crosses a line of the map in docs/architecture.md, a file lacks its licence line, or a file
names a place of one machine, work left undone, or (in a comment, a text or a link) a file or a section that is not there.

    layering.py ROOT        prints `file:line: [rule] what is wrong` for each finding; exit 1 if there is one

Allow-lists, not deny-lists: a header this table does not know is a finding, so that a new dependency is a decision
made here, where a reviewer sees it. layering_selftest.py shows that every rule can fail.
"""
import functools
import os
import re
import sys
from dataclasses import dataclass
from pathlib import Path

STANDARD = set("""
algorithm any array atomic barrier bit bitset cassert cctype cerrno cfenv cfloat charconv chrono cinttypes climits clocale
cmath codecvt compare complex concepts condition_variable coroutine csetjmp csignal cstdarg cstddef cstdint cstdio cstdlib
cstring ctime cuchar cwchar cwctype deque exception execution filesystem format forward_list fstream functional future
initializer_list iomanip ios iosfwd iostream istream iterator latch limits list locale map memory memory_resource mutex new
numbers numeric optional ostream queue random ranges ratio regex scoped_allocator semaphore set shared_mutex
source_location span sstream stack stdexcept stop_token streambuf string string_view strstream syncstream system_error
thread tuple type_traits typeindex typeinfo unordered_map unordered_set utility valarray variant vector version
assert.h ctype.h errno.h float.h inttypes.h limits.h math.h signal.h stdarg.h stdbool.h stddef.h stdint.h stdio.h
stdlib.h string.h time.h
""".split())

# The third parties, by the start of the path that is included.
THIRD_PARTIES = {
    "xxhash": ("xxhash.h",),
    "eigen": ("Eigen/",),
    "posix": ("sys/", "unistd.h", "fcntl.h", "poll.h", "spawn.h", "pthread.h", "dirent.h", "dlfcn.h", "linux/", "elf.h", "link.h", "malloc.h"),
    "simd": ("cpuid.h", "immintrin.h", "emmintrin.h", "xmmintrin.h", "smmintrin.h", "arm_neon.h", "wasm_simd128.h"),
    "json": ("nlohmann/",),
    "cli11": ("CLI/",),
    "tbb": ("tbb/", "oneapi/"),
    "assimp": ("assimp/",),
    "cgal": ("CGAL/", "boost/", "gmp", "mpfr"),
    "cholmod": ("cholmod.h",),
    "opencv": ("opencv2/",),
    "epoxy": ("epoxy/",),
    "glfw": ("GLFW/",),
    "x11": ("X11/",),
    "imgui": ("imgui", "backends/imgui"),
    "stb": ("stb_", "stb/"),
    "bullet": ("BulletSoftBody/", "btBulletDynamicsCommon.h"),  # a peer that benchmarks compare with
    "gtest": ("gtest/", "gmock/"),
}

FORMATS_PUBLIC, RUNTIME_PUBLIC = "formats/include/", "runtime/include/"
PUBLIC = (FORMATS_PUBLIC, RUNTIME_PUBLIC)


@dataclass
class Zone:
    """What the files under `path` may include: `own`, starts of paths in this repository; `third`, third parties.
    `std` is always allowed. The longest matching path decides."""
    path: str
    own: tuple = ()
    third: tuple = ()


# The parts of tools, lowest first. A part includes parts below it, never one beside or above it.
TOOL_RANKS = {
    "core": 0, "pictures": 1, "import": 2, "tetrahedralize": 3, "attach": 4, "field": 4, "author": 5, "bake": 6, "scene": 6, "render": 7,
    "study": 8, "bench": 8, "studio": 8, "cli": 9,
}
TOOL_COMMON = ("posix", "eigen", "json", "tbb")
TOOL_THIRD = {
    "import": ("assimp", "cgal"),
    "tetrahedralize": ("cgal",),
    "field": ("cholmod",),
    "pictures": ("opencv", "stb"),
    "author": ("opencv",),
    "render": ("opencv", "epoxy", "stb", "glfw"),
    "scene": ("xxhash",),
    "bake": ("xxhash",),
    "studio": ("opencv", "epoxy", "glfw", "imgui", "x11"),
    "bench": ("simd",),  # measures the machine's peak
    "cli": ("cli11",),
}
# What a part may include beyond the parts below it.
TOOL_OWN = {
    # The references that its figures are compared with.
    "bench": ("tests/benchmarks/",),
    "study": ("tests/benchmarks/",),
}
# Each of these sits behind the named files of its part.
BEHIND = {
    ("tools/import/", "assimp"): ("tools/import/assimp_scene.cpp",),
    ("tools/pictures/", "stb"): ("tools/pictures/decode_picture.cpp",),
    ("tools/render/", "stb"): ("tools/render/text.cpp",),  # fonts
    ("tools/import/", "cgal"): ("tools/import/self_intersections.cpp",),
    ("tools/author/", "opencv"): ("tools/author/mask_image.cpp",),
    ("tools/tetrahedralize/", "cgal"): ("tools/tetrahedralize/cgal_*",),
    ("tools/field/", "cholmod"): ("tools/field/cholesky.cpp",),
    ("tests/", "bullet"): ("tests/benchmarks/bullet_*",),
    ("tests/", "cgal"): ("tests/topology/exact_pairs.cpp",),  # a second opinion with exact constructions
}

RUNTIME_INTERNAL = ("runtime/",)
ZONES = [
    Zone("formats/", own=("formats/",), third=("xxhash",)),
    Zone("formats/include/", own=(FORMATS_PUBLIC,)),
    Zone("runtime/", own=PUBLIC + RUNTIME_INTERNAL, third=("eigen", "simd")),
    Zone("runtime/load/", own=PUBLIC + RUNTIME_INTERNAL, third=("eigen", "posix")),  # memory maps the package
    Zone("runtime/geometry/", own=PUBLIC + ("runtime/geometry/",), third=("eigen", "simd")),
    Zone("runtime/include/", own=PUBLIC),
    Zone("samples/", own=PUBLIC + ("samples/",)),
    Zone("tests/", own=PUBLIC + ("formats/", "runtime/", "tests/"), third=("gtest", "eigen", "xxhash", "posix")),
] + [
    Zone(f"tools/{part}/",
         own=PUBLIC + ("runtime/geometry/", f"tools/{part}/")
         + TOOL_OWN.get(part, ())
         + tuple(f"tools/{other}/" for other, below in TOOL_RANKS.items() if below < rank),
         third=TOOL_COMMON + TOOL_THIRD.get(part, ()))
    for part, rank in TOOL_RANKS.items()
]
# Tests of the tools see what they test, and may look at pictures; they never include what sits behind one file.
MIT_TESTS = ("formats", "geometry", "runtime", "cut", "c_api", "layering", "consumer", "support", "fuzz", "determinism", "assets", "golden")
TOOL_TEST_FILES = ("tests/support/obj_reader.h",)  # shared by tests of several tools
TOOL_TESTS = Zone("tests/", own=PUBLIC + ("formats/", "runtime/", "tools/", "tests/"),
                  third=("gtest", "eigen", "posix", "json", "tbb", "opencv", "epoxy", "cli11", "cgal", "bullet"))

SOURCE_SUFFIXES = {".h", ".hpp", ".c", ".cpp", ".cc", ".inl", ".in"}
LICENSED_SUFFIXES = SOURCE_SUFFIXES | {".py", ".cmake", ".sh", ".glsl", ".vert", ".frag", ".js", ".html"}
TEXT_SUFFIXES = LICENSED_SUFFIXES | {".md", ".json", ".txt", ".yml", ".yaml", ".clang-tidy", ".clang-format"}
SKIPPED_FOLDERS = {".git", "build", ".cache", "__pycache__", "LICENSES"}
ASSETS = re.compile(r"(^|/)(assets|golden|pictures)/")

INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')
SPDX = re.compile(r"SPDX-License-Identifier:\s*(\S+)")
UNDONE = re.compile(r"\b(" + "|".join(("TO" + "DO", "FIX" + "ME", "XX" + "X", "HA" + "CK")) + r")\b")
MACHINE = re.compile(r"(?<![\w.}])/(?:" + "|".join(("home", "work", "root", "Users", "mnt")) + r")/[\w.]")
COMMENT = re.compile(r"(?://|/\*|^ \*)(.*)")
ADDRESS = re.compile(r"\w+://\S+")
POINTER = re.compile(r"(?<![\w.*])[\w/-]+\.(?:cpp|h|md|py)\b(?:,? §(\d+))?")
PAGE = re.compile(r"\bdocs/[\w/-]+\.(?:md|json)\b")
LINK = re.compile(r"\]\((?!\w+://)([^)#\s]*)(?:#([^)\s]+))?\)")
DRIVE = re.compile(r"\b[A-Z]:\\\\?\w")


def is_tool_test(path):
    parts = path.split("/")
    return path in TOOL_TEST_FILES or (parts[0] == "tests" and len(parts) > 2 and parts[1] not in MIT_TESTS)


def licence_of(path):
    """The SPDX identifier that a file of this path must carry."""
    return "GPL-3.0-or-later" if path.startswith("tools/") or is_tool_test(path) else "MIT"


def third_party_of(header):
    for name, starts in THIRD_PARTIES.items():
        if header.startswith(starts):
            return name
    return None


def zone_of(path):
    if is_tool_test(path):
        return TOOL_TESTS
    matching = [zone for zone in ZONES if path.startswith(zone.path)]
    return max(matching, key=lambda zone: len(zone.path), default=None)


def resolve(root, path, header):
    """The path in this repository that an include means, or None."""
    candidates = [str(Path(path).parent / header), header, FORMATS_PUBLIC + header, RUNTIME_PUBLIC + header]
    for candidate in candidates:
        candidate = os.path.normpath(candidate).replace(os.sep, "/")
        if not candidate.startswith("..") and (root / candidate).is_file():
            return candidate
    # A header that is not there (generated, or wrong): judged by what it says.
    if header.startswith("sinew/"):
        return ("runtime" if header.startswith("sinew/runtime/") else "formats") + "/include/" + header
    if header.startswith(("formats/", "runtime/", "tools/", "tests/", "samples/")):
        return header
    return None


def check_include(root, path, header):
    """A (rule, message) pair, or None."""
    zone = zone_of(path)
    if zone is None:
        return "zone", "no rule for this folder: add it to the table in tests/layering/layering.py"
    own = resolve(root, path, header)
    if own is not None:
        if not own.startswith(zone.own):
            return "own", f"{path.split('/')[0]} code here may not include {own} (allowed: {', '.join(zone.own)})"
        return None
    if header in STANDARD:
        return None
    third = third_party_of(header)
    if third is None:
        return "unknown", f"unknown header {header}: a new dependency needs a line in tests/layering/layering.py"
    if third not in zone.third:
        return "third", f"{header} ({third}) is not allowed under {zone.path}"
    behind = BEHIND.get((zone.path, third))
    if behind is not None and not any(
            path.startswith(file[:-1]) if file.endswith("*") else path == file for file in behind):
        return "behind", f"{header} ({third}) sits behind {', '.join(behind)} alone"
    return None


@functools.cache
def files_by_name(root):
    found = {}
    for folder, folders, files in os.walk(root):
        folders[:] = [f for f in folders if f not in SKIPPED_FOLDERS]
        for name in files:
            found.setdefault(name, []).append(Path(folder) / name)
    return found


def heading_ids(text):
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in re.findall(r"^#+ (.*)$", text, re.M)}


def missing_links(root, path, line):
    """What a page links to and is not there: files, and headings of pages."""
    for link in LINK.finditer(line):
        target = (root / path).parent / link.group(1) if link.group(1) else root / path
        if not target.exists():
            yield link.group(1)
        elif link.group(2) and target.suffix == ".md" and link.group(2) not in heading_ids(target.read_text(encoding="utf-8")):
            yield f"{link.group(1)}#{link.group(2)}"


def missing_pointers(root, line):
    """What a source names and is not there: in comments files and numbered sections of pages, in texts pages."""
    comment = COMMENT.search(line)
    for page in PAGE.finditer(line[:comment.start()] if comment else line):
        if not (root / page.group(0)).exists():
            yield page.group(0)
    for pointer in POINTER.finditer(ADDRESS.sub("", comment.group(1))) if comment else ():
        name = pointer.group(0).split(",")[0].split(" ")[0]
        places = files_by_name(root).get(name.rsplit("/", 1)[-1], [])
        section = pointer.group(1)
        if not places:
            yield name
        elif section and not any(re.search(rf"^#+ {section}\b", place.read_text(encoding="utf-8"), re.M) for place in places):
            yield f"{name} §{section}"


def is_licensed(path, text):
    name = path.rsplit("/", 1)[-1]
    return Path(name).suffix in LICENSED_SUFFIXES or name == "CMakeLists.txt" or text.startswith("#!")


def check_file(root, path, text):
    """Yields (line, rule, message) for one file."""
    lines = text.splitlines()
    if is_licensed(path, text):
        found = SPDX.search("\n".join(lines[:5]))
        wanted = licence_of(path)
        if found is None:
            yield 1, "licence", f"no SPDX-License-Identifier in the first lines (wanted: {wanted})"
        elif found.group(1) != wanted:
            yield 1, "licence", f"licence {found.group(1)}, but this folder is {wanted}"
    for number, line in enumerate(lines, 1):
        if Path(path).suffix in SOURCE_SUFFIXES:
            include = INCLUDE.match(line)
            if include:
                finding = check_include(root, path, include.group(2))
                if finding:
                    yield number, *finding
            else:
                for missing in missing_pointers(root, line):
                    yield number, "pointer", f"there is no {missing}"
        if path.endswith(".md"):
            for missing in missing_links(root, path, line):
                yield number, "pointer", f"there is no {missing}"
        undone = UNDONE.search(line)
        if undone:
            yield number, "undone", f"{undone.group(0)}: do it, or write an issue"
        # Tests of importers hold the paths that exporters on Windows write.
        if MACHINE.search(line) or (not path.startswith("tests/") and DRIVE.search(line)):
            yield number, "machine", "names a place of one machine"


def check_tree(root):
    """All findings of a tree as sorted (path, line, rule, message), and the number of files read."""
    root = Path(root)
    findings, count = [], 0
    for folder, folders, files in os.walk(root):
        folders[:] = sorted(f for f in folders if f not in SKIPPED_FOLDERS)
        for name in sorted(files):
            path = (Path(folder) / name).relative_to(root).as_posix()
            if ASSETS.search(path) or name == "CMakeUserPresets.json":
                continue
            with open(root / path, "rb") as file:
                start = file.read(2)
            textual = Path(name).suffix in TEXT_SUFFIXES or name in TEXT_SUFFIXES or start == b"#!"
            if not textual:
                continue
            text = (root / path).read_text(encoding="utf-8", errors="replace")
            count += 1
            findings += [(path, *finding) for finding in check_file(root, path, text)]
    return sorted(findings), count


def main():
    if len(sys.argv) != 2 or not Path(sys.argv[1]).is_dir():
        print("layering: usage: layering.py ROOT", file=sys.stderr)
        return 2
    findings, count = check_tree(sys.argv[1])
    for path, line, rule, message in findings:
        print(f"{path}:{line}: [{rule}] {message}")
    if count == 0:
        print("layering: found no file to check", file=sys.stderr)
        return 2
    print(f"layering: {count} files, {len(findings)} findings")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())

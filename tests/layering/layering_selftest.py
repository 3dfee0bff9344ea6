#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""A checker that cannot fail proves nothing: each snippet below breaks one rule and must be found, alone."""
import sys
import tempfile
import unittest
from pathlib import Path

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).parent))
import layering  # noqa: E402

MIT = "// SPDX-License-Identifier: MIT\n"
GPL = "// SPDX-License-Identifier: GPL-3.0-or-later\n"

GOOD = {
    "formats/include/sinew/formats/package.h": MIT + "#include <span>\n",
    "formats/src/package.cpp": MIT + '#include <xxhash.h>\n#include "sinew/formats/package.h"\n#include "sum.h"\n',
    "formats/src/sum.h": MIT,
    "runtime/include/sinew/runtime/world.h": MIT + '#include "sinew/formats/package.h"\n',
    "runtime/geometry/rotation.h": MIT + "#include <Eigen/Core>\n",
    "runtime/step/world_step.cpp": MIT + '#include "runtime/geometry/rotation.h"\n#include <Eigen/LU>\n',
    "runtime/load/mapped_file.cpp": MIT + "#include <sys/mman.h>\n",
    "tools/import/assimp_scene.cpp": GPL + "#include <assimp/scene.h>\n",
    "tools/import/self_intersections.cpp": GPL + "#include <CGAL/AABB_tree.h>\n",
    "tools/bake/bake.cpp": GPL + '#include "tools/import/import.h"\n#include "runtime/geometry/rotation.h"\n',
    "tools/import/import.h": GPL,
    "tools/cli/main.cpp": GPL + "#include <CLI/CLI.hpp>\n",
    "tools/studio/app.cpp": GPL + "#include <imgui.h>\n#include <GLFW/glfw3.h>\n",
    "samples/hello_runtime/main.cpp": MIT + '#include "sinew/runtime/world.h"\n',
    "tests/bake/bake_test.cpp": GPL + '#include <gtest/gtest.h>\n#include "tools/bake/bake.h"\n',
    "tests/runtime/world_test.cpp": MIT + '#include <gtest/gtest.h>\n#include "runtime/step/world_step.h"\n',
    "tests/assets/weird/note.txt": "TO" + "DO in somebody's asset is theirs\n",
    "CMakeLists.txt": "# SPDX-License-Identifier: MIT\n",
    "scripts/go": "#!/bin/sh\n# SPDX-License-Identifier: MIT\n",
    "docs/method.md": "# The method\n\n## 1 Symbols\n",
    "runtime/step/pointers.cpp": MIT + "// docs/method.md §1, world_step.cpp; https://example.org/gone.md\nint x;  // README.md\n",
    "docs/runtime.md": "Of [symbols](method.md#1-symbols), [code](../tools/cli/main.cpp), [far](https://example.org/gone.md).\n",
    "README.md": "Installs to /usr/local/include, logs to /tmp.\n",
}

# path, text, rule that must be reported
BAD = [
    ("formats/src/a.cpp", MIT + "#include <Eigen/Core>\n", "third"),
    ("formats/src/a.cpp", MIT + "#include <unistd.h>\n", "third"),
    ("formats/include/sinew/formats/a.h", MIT + "#include <xxhash.h>\n", "third"),
    ("formats/include/sinew/formats/a.h", MIT + '#include "formats/src/sum.h"\n', "own"),
    ("formats/src/a.cpp", MIT + '#include "sinew/runtime/world.h"\n', "own"),
    ("runtime/step/a.cpp", MIT + '#include "tools/import/import.h"\n', "own"),
    ("runtime/step/a.cpp", MIT + '#include "../../tools/import/import.h"\n', "own"),
    ("runtime/step/a.cpp", MIT + '#include "formats/src/sum.h"\n', "own"),
    ("runtime/step/a.cpp", MIT + "#include <tbb/parallel_for.h>\n", "third"),
    ("runtime/step/a.cpp", MIT + "#include <sys/mman.h>\n", "third"),
    ("runtime/geometry/a.h", MIT + '#include "runtime/step/world_step.h"\n', "own"),
    ("runtime/include/sinew/runtime/a.h", MIT + "#include <Eigen/Core>\n", "third"),
    ("runtime/include/sinew/runtime/a.h", MIT + '#include "runtime/geometry/rotation.h"\n', "own"),
    ("tools/import/import.cpp", GPL + "#include <assimp/scene.h>\n", "behind"),
    ("tools/import/import.cpp", GPL + "#include <CGAL/AABB_tree.h>\n", "behind"),
    ("tools/bake/a.cpp", GPL + "#include <assimp/scene.h>\n", "third"),
    ("tools/bake/a.cpp", GPL + "#include <CGAL/AABB_tree.h>\n", "third"),
    ("tools/tetrahedralize/grid.cpp", GPL + "#include <CGAL/AABB_tree.h>\n", "behind"),
    ("tools/bake/a.cpp", GPL + "#include <opencv2/core.hpp>\n", "third"),
    ("tools/bake/a.cpp", GPL + "#include <GLFW/glfw3.h>\n", "third"),
    ("tools/cli/a.cpp", GPL + "#include <epoxy/gl.h>\n", "third"),
    ("tools/render/a.cpp", GPL + "#include <imgui.h>\n", "third"),
    ("tools/bake/a.cpp", GPL + "#include <CLI/CLI.hpp>\n", "third"),
    ("tools/import/a.cpp", GPL + '#include "tools/bake/bake.h"\n', "own"),
    ("tools/bake/a.cpp", GPL + '#include "tools/scene/scene.h"\n', "own"),
    ("tools/bake/a.cpp", GPL + '#include "runtime/step/world_step.h"\n', "own"),
    ("samples/hello_runtime/a.cpp", MIT + '#include "runtime/geometry/rotation.h"\n', "own"),
    ("samples/hello_runtime/a.cpp", MIT + "#include <Eigen/Core>\n", "third"),
    ("tests/runtime/a.cpp", MIT + '#include "tools/import/import.h"\n', "own"),
    ("tests/bake/a.cpp", GPL + "#include <assimp/scene.h>\n", "third"),
    ("tests/bake/a.cpp", GPL + "#include <CGAL/AABB_tree.h>\n", "behind"),
    ("tools/bake/a.cpp", GPL + "#include <curl/curl.h>\n", "unknown"),
    ("elsewhere/a.cpp", MIT + "#include <vector>\n", "zone"),
    ("tools/newpart/a.cpp", GPL + "#include <vector>\n", "zone"),
    ("runtime/step/a.cpp", MIT + "// As in nowhere.cpp.\n", "pointer"),
    ("runtime/step/a.cpp", MIT + "int x;  // docs/method.md §3\n", "pointer"),
    ("tools/bake/a.cpp", GPL + "/* see design.md */\n", "pointer"),
    ("tools/cli/a.cpp", GPL + 'const char* text = "see docs/gone.md";\n', "pointer"),
    ("docs/a.md", "As [there](gone.md).\n", "pointer"),
    ("docs/a.md", "As [there](method.md#2-steps).\n", "pointer"),
    ("tools/bake/a.cpp", "#include <vector>\n", "licence"),
    ("tools/bake/a.cpp", MIT, "licence"),
    ("runtime/step/a.h", GPL, "licence"),
    ("tests/bake/a.cpp", MIT, "licence"),
    ("tests/runtime/a.cpp", GPL, "licence"),
    ("tools/bake/CMakeLists.txt", "add_library(x)\n", "licence"),
    ("scripts/a", "#!/bin/sh\ntrue\n", "licence"),
    ("runtime/step/a.cpp", MIT + "// TO" + "DO: later\n", "undone"),
    ("docs/a.md", "FIX" + "ME\n", "undone"),
    ("runtime/step/a.cpp", MIT + 'auto f = "/ho' + 'me/me/mesh.obj";\n', "machine"),
    ("docs/a.md", "run C:\\\\Users\n", "machine"),
]


def findings_of(files):
    with tempfile.TemporaryDirectory() as folder:
        for path, text in files.items():
            target = Path(folder) / path
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(text, encoding="utf-8")
        return layering.check_tree(folder)


class Layering(unittest.TestCase):
    def test_a_good_tree_passes(self):
        findings, count = findings_of(GOOD)
        self.assertEqual(findings, [])
        self.assertEqual(count, len(GOOD) - 1)  # all but the asset

    def test_each_bad_file_is_found_alone(self):
        for path, text, rule in BAD:
            with self.subTest(path=path, text=text):
                findings, _ = findings_of(GOOD | {path: text})
                self.assertEqual([(finding[0], finding[2]) for finding in findings], [(path, rule)], findings)

    def test_each_rule_has_a_bad_file(self):
        source = Path(layering.__file__).read_text(encoding="utf-8")
        rules = {"zone", "own", "unknown", "third", "behind", "licence", "undone", "machine", "pointer"}
        for rule in rules:
            self.assertIn(f'"{rule}", ', source)
        self.assertEqual({rule for _, _, rule in BAD}, rules)

    def test_an_empty_tree_is_no_success(self):
        self.assertEqual(findings_of({})[1], 0)


if __name__ == "__main__":
    unittest.main()

"""Every rule of toolchain/house_check.py bites: a small house, clean at first, then one sin at a time."""

import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(os.environ.get("LEADLINE_ROOT", pathlib.Path(__file__).resolve().parents[2]))
SCRIPT = ROOT / "toolchain" / "house_check.py"

CLEAN = {
    "CMakeLists.txt": "",
    "model/base/a.hpp": "#include <cstdint>\n",
    "model/m.hpp": '#include "model/base/a.hpp"\n',
    "model/m.cpp": '#include "model/m.hpp"\n#include <array>\nint f();  // double new malloc\n',
    "model/kernel_avx2.cpp": "#include <immintrin.h>\n",
    "estimator/e.cpp": '#include "model/base/a.hpp"\n#include <cmath>\nfloat g = 1.5F;\n',
    "proto/p.cpp": '#include "model/base/a.hpp"\nconst char* s = "throw new double";\n',
    "hal/ports.hpp": '#include "model/base/a.hpp"\n',
    "hal/heads/h.cpp": '#include "hal/ports.hpp"\nbool operator==(int, int) = delete;\n',
    "hal/linux/l.cpp": '#include <termios.h>\n#include <vector>\n#include "hal/ports.hpp"\n',
    "hal/emu/emu.hpp": "",
    "hal/m7/m7.hpp": "",
    "firmware/pipeline/p.cpp": '#include "model/m.hpp"\n#include "hal/heads/h.hpp"\n',
    "firmware/linux/main.cpp": '#include <iostream>\n#include "firmware/pipeline/p.hpp"\n',
    "firmware/m7/main.cpp": '#include "firmware/pipeline/p.hpp"\n#include "hal/m7/m7.hpp"\n',
    "firmware/config/c.cpp": '#include <string>\n#include "firmware/pipeline/p.hpp"\n'
                             '#include "hal/linux/l.hpp"\n',
    "host_tools/t.cpp": '#include <vector>\n#include "model/m.hpp"\n#include "hal/emu/emu.hpp"\n'
                        '#include "firmware/pipeline/p.hpp"\n#include "firmware/config/c.hpp"\n'
                        '#include <nlohmann/json.hpp>\n',
    "tests/unit/t.cpp": '#include "host_tools/t.hpp"\n#include "hal/m7/m7.hpp"\n',
}

# (rule, file, what is appended to it)
SINS = [
    # Arrows.
    ("include-arrow", "model/base/a.hpp", '#include "model/m.hpp"'),
    ("include-arrow", "model/m.cpp", '#include "estimator/e.hpp"'),
    ("include-arrow", "model/m.cpp", '#include "proto/p.hpp"'),
    ("include-arrow", "model/m.cpp", '#include "hal/ports.hpp"'),
    ("include-arrow", "model/m.cpp", '#include "host_tools/t.hpp"'),
    ("include-arrow", "estimator/e.cpp", '#include "model/m.hpp"'),
    ("include-arrow", "estimator/e.cpp", '#include "proto/p.hpp"'),
    ("include-arrow", "proto/p.cpp", '#include "model/m.hpp"'),
    ("include-arrow", "hal/ports.hpp", '#include "proto/p.hpp"'),
    ("include-arrow", "hal/linux/l.cpp", '#include "firmware/pipeline/p.hpp"'),
    ("include-arrow", "firmware/pipeline/p.cpp", '#include "host_tools/t.hpp"'),
    ("include-arrow", "firmware/pipeline/p.cpp", '#include "firmware/config/c.hpp"'),
    ("include-arrow", "firmware/pipeline/p.cpp", '#include "hal/linux/l.hpp"'),
    ("include-arrow", "firmware/m7/main.cpp", '#include "firmware/config/c.hpp"'),
    ("include-arrow", "firmware/m7/main.cpp", '#include "hal/linux/l.hpp"'),
    ("include-arrow", "firmware/config/c.cpp", '#include "firmware/linux/main.hpp"'),
    ("include-arrow", "firmware/config/c.cpp", '#include "host_tools/t.hpp"'),
    ("include-arrow", "host_tools/t.cpp", '#include "hal/m7/m7.hpp"'),
    ("include-arrow", "host_tools/t.cpp", '#include "hal/ports.hpp"'),
    ("include-arrow", "host_tools/t.cpp", '#include "firmware/linux/main.hpp"'),
    ("include-arrow", "host_tools/t.cpp", '#include "tests/support/test.hpp"'),
    ("include-arrow", "model/m.cpp", '#  include "tests/oracle/o.hpp"'),
    # Forms that would hide an arrow.
    ("include-form", "model/m.cpp", '#include "base/a.hpp"'),
    ("include-form", "model/m.cpp", '#include "model/../proto/p.hpp"'),
    ("include-form", "estimator/e.cpp", "#include <model/m.hpp>"),
    ("include-form", "model/m.cpp", "#define WHERE <vector>\n#include WHERE"),
    # Standard headers.
    ("std-header", "model/m.cpp", "#include <vector>"),
    ("std-header", "model/m.cpp", "#include <cmath>"),
    ("std-header", "model/m.cpp", "#include <immintrin.h>"),
    ("std-header", "proto/p.cpp", "#include <iostream>"),
    ("std-header", "firmware/pipeline/p.cpp", "#include <chrono>"),
    ("std-header", "firmware/m7/main.cpp", "#include <vector>"),
    ("std-header", "hal/m7/m7.hpp", "#include <string>"),
    ("std-header", "hal/heads/h.cpp", "#include <unistd.h>"),
    ("std-header", "estimator/e.cpp", "#include <memory>"),
    # Poison.
    ("poison-malloc", "model/m.cpp", "void* p = malloc(4);"),
    ("poison-free", "model/m.cpp", "void q(void* p) { free(p); }"),
    ("poison-new", "model/m.cpp", "int* p = new int;"),
    ("poison-delete", "model/m.cpp", "void q(int* p) { delete p; }"),
    ("poison-throw", "proto/p.cpp", "void q() { throw 1; }"),
    ("poison-try", "proto/p.cpp", "void q() { try { } catch (...) { } }"),
    ("poison-rtti", "hal/heads/h.cpp", "auto* x = dynamic_cast<B*>(a);"),
    ("poison-std-heap", "model/m.cpp", "std::vector<int> v;"),
    ("poison-std-heap", "estimator/e.cpp", "std::function<void()> f;"),
    ("poison-std-heap", "model/base/a.hpp", "inline std::string s;"),
    ("poison-streams", "model/m.cpp", "void q() { std::cout << 1; }"),
    ("poison-stdio", "model/m.cpp", 'void q() { printf("x"); }'),
    ("poison-clock", "model/m.cpp", "auto t = std::chrono::steady_clock::now();"),
    ("poison-thread", "model/m.cpp", "std::mutex m;"),
    ("poison-random", "model/m.cpp", "int r = rand();"),
    ("poison-double", "model/m.cpp", "double d;"),
    ("poison-double", "estimator/e.cpp", "double d;"),
    ("poison-float", "model/m.cpp", "float d;"),
    ("poison-float-literal", "model/m.cpp", "auto x = 1.5;"),
    ("poison-float-literal", "proto/p.cpp", "auto x = 1e3;"),
    ("poison-float-literal", "proto/p.cpp", "auto x = .5f;"),
    ("poison-goto", "model/m.cpp", "void q() { goto end; end:; }"),
    # A comment in front does not hide what is behind it, nor does a string.
    ("poison-new", "model/m.cpp", "/* fine */ int* p = new int;"),
    ("poison-new", "model/m.cpp", 'const char* s = "\\""; int* p = new int;'),
    ("poison-new", "model/m.cpp", "int n = 1'000; int* p = new int;"),
    # The exception needs a reason, a known name, and something to except.
    ("allow-tag", "model/m.cpp", "double d;  // house: allow double:"),
    ("allow-tag", "model/m.cpp", "double d;  // house: allow doubel, double: typo"),
    ("allow-tag", "model/m.cpp", "int d;  // house: allow double: nothing here"),
    ("allow-tag", "model/m.cpp", "// house: begin allow double: no end\ndouble d;"),
    ("allow-tag", "model/m.cpp", "// house: end allow"),
    ("allow-tag", "model/m.cpp", "// house: begin allow new: unused\nint d;\n// house: end allow"),
    ("poison-new", "model/m.cpp",
     "// house: begin allow double: why\ndouble d = *new int;\n// house: end allow"),
    ("poison-double", "model/m.cpp",
     "// house: begin allow double: why\ndouble d;\n// house: end allow\ndouble e;"),
    # The top level.
    ("top-level", "misc/x.txt", "x"),
]

FINE = [
    ("model/m.cpp", "double d = 0.5;  // house: allow double: compile-time table only"),
    ("model/m.cpp", "// house: begin allow double: compile-time table only\n"
                    "double d = 1.5;\n\ndouble e;\n// house: end allow"),
    ("model/m.cpp", "int x = 0x1E3 + 0xE5 + 1'000'000; int free_count; map.free_cells();"),
    ("model/m.cpp", "Foo(const Foo&) = delete;\nFoo& operator=(const Foo&) =\n    delete;"),
    ("model/m.cpp", "// std::vector would be wrong here\n/* new\n   double */"),
    ("model/m.cpp", 'const char* r = R"(new double)";'),
    ("model/m.cpp", "char c = '\"'; int newest = 1; int redouble = 2;"),
    ("model/m.cpp", "auto x = a[1].b; auto y = e3.x;"),
    ("model/m.cpp", "// see <vector>: #include <vector>"),
    ("host_tools/t.cpp", "double d = 1.5; std::vector<int> v;"),
    ("hal/linux/l.cpp", "int* p = new int;"),
    ("firmware/linux/main.cpp", "double d;"),
]


def build(folder, changes):
    for path, text in CLEAN.items():
        file = folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    for path, extra in changes:
        file = folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        with file.open("a") as stream:
            stream.write(extra + "\n")


def check(changes):
    with tempfile.TemporaryDirectory() as folder:
        build(pathlib.Path(folder), changes)
        return subprocess.run([sys.executable, str(SCRIPT), "--root", folder],
                              capture_output=True, text=True, timeout=30, check=False)


class HouseCheck(unittest.TestCase):
    def test_the_clean_house_passes(self):
        result = check([])
        self.assertEqual((result.returncode, result.stderr), (0, ""))

    def test_every_sin_is_found_where_it_is(self):
        for rule, path, text in SINS:
            with self.subTest(rule=rule, file=path, text=text):
                result = check([(path, text)])
                self.assertEqual(result.returncode, 1, result.stderr)
                self.assertIn(f"[{rule}]", result.stderr)
                where = path.split("/")[0] if rule == "top-level" else path
                self.assertIn(where + ":", result.stderr)
                if rule != "allow-tag":
                    others = [line for line in result.stderr.splitlines()
                              if ": [" in line and f"[{rule}]" not in line]
                    self.assertEqual(others, [], "another rule fired as well")

    def test_what_is_allowed_passes(self):
        for path, text in FINE:
            with self.subTest(file=path, text=text):
                result = check([(path, text)])
                self.assertEqual((result.returncode, result.stderr), (0, ""))

    def test_the_project_itself_passes(self):
        result = subprocess.run([sys.executable, str(SCRIPT), "--root", str(ROOT)],
                                capture_output=True, text=True, timeout=30, check=False)
        self.assertEqual((result.returncode, result.stderr), (0, ""))

    def test_a_broken_arrow_stops_cmake(self):
        """The real CMakeLists.txt over a house with one sin; it must not get as far as the folders."""
        with tempfile.TemporaryDirectory() as folder:
            house = pathlib.Path(folder) / "house"
            house.mkdir()
            build(house, [("model/m.cpp", '#include "proto/p.hpp"')])
            shutil.copy(ROOT / "CMakeLists.txt", house)
            shutil.copytree(ROOT / "toolchain", house / "toolchain")
            result = subprocess.run(["cmake", "-S", house, "-B", house / "build", "-G", "Ninja"],
                                    capture_output=True, text=True, timeout=120, check=False)
            self.assertNotEqual(result.returncode, 0)
            self.assertIn("model/m.cpp:4: [include-arrow]", result.stderr)
            self.assertIn("The house's rules are broken", result.stderr)
            self.assertNotIn("model/CMakeLists.txt", result.stderr)

    def test_a_wrong_root_is_a_usage_error(self):
        result = subprocess.run([sys.executable, str(SCRIPT), "--root", "/nonexistent"],
                                capture_output=True, text=True, timeout=30, check=False)
        self.assertEqual(result.returncode, 2)


if __name__ == "__main__":
    unittest.main()

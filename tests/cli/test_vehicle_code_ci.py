"""What compiled vehicle code calls and how it computes (toolchain/vehicle_code_check.py), for every target whose compiler is
there: its archives where they were built, and the filter, compiled anew for processors with fused multiply-adds. Each time
a deliberate violation shows that the check bites.

Environment: LEADLINE_ROOT, LEADLINE_BUILD. Standard library only.
"""

import json
import os
import pathlib
import shlex
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(os.environ["LEADLINE_ROOT"])
BUILD = pathlib.Path(os.environ["LEADLINE_BUILD"])
ARCHIVES = ["model/libleadline_model.a", "estimator/libleadline_estimator.a", "proto/libleadline_proto.a",
            "hal/libleadline_hal.a", "firmware/pipeline/libleadline_pipeline.a"]
# Most floating point of all vehicle code.
FILTER = "estimator/navigation_filter.cpp"

# Tools -> compiler, options for a processor with fused multiply-adds, builds of that target. Not those without
# optimization: branches of Eigen's templates that are never taken stay in them, those to the heap among them.
TARGETS = {
    "": ("g++", ["-O3", "-march=haswell"] if os.uname().machine == "x86_64" else [],
         [BUILD.name, "replay-gcc-O3-native", "replay-clang", "replay-scalar"]),
    "aarch64-linux-gnu-": ("aarch64-linux-gnu-g++", [], ["aarch64", "replay-aarch64"]),
    "arm-linux-gnueabihf-": ("arm-linux-gnueabihf-g++", ["-mfpu=neon-vfpv4"], ["armhf", "replay-armhf", "replay-armhf-v7a"]),
    "arm-none-eabi-": ("arm-none-eabi-g++", ["-mcpu=cortex-m7", "-mfpu=fpv5-sp-d16", "-mfloat-abi=hard",
                                             "-fno-math-errno"], ["cortex-m7", "stm32h743"]),
}
VIOLATIONS = {
    "calls malloc": "#include <cstdlib>\nvoid* f() { return std::malloc(8); }",
    "calls sinf": "#include <cmath>\nfloat f(float x) { return std::sin(x); }",
    "calls lroundf": "#include <cmath>\nlong f(float x) { return std::lround(x); }",
    "calls clock_gettime": "#include <ctime>\nlong f() { timespec t; clock_gettime(0, &t); return t.tv_nsec; }",
    "calls _Znw": "int* f() { return new int; }",
    "double precision": "double f(double a, double b) { return a * b; }",
}


def check(tools, *files):
    return subprocess.run([sys.executable, ROOT / "toolchain/vehicle_code_check.py", f"--tools={tools}", *files],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)


class VehicleCode(unittest.TestCase):
    def setUp(self):
        self.dir = pathlib.Path(tempfile.mkdtemp(prefix="leadline-code-"))
        self.addCleanup(shutil.rmtree, self.dir, ignore_errors=True)

    def available(self):
        names = {tools: each for tools, each in TARGETS.items() if shutil.which(each[0])}
        for tools in TARGETS.keys() - names.keys():
            print(f"{TARGETS[tools][0]} is not installed: skipped")
        return names

    def compiled(self, compiler, source, *options):
        out = self.dir / "object.o"
        subprocess.run([compiler, "-std=c++17", *options, "-c", source, "-o", out], check=True)
        return out

    def test_archives_are_clean(self):
        checked = 0
        for tools, (_, _, builds) in self.available().items():
            for build in builds:
                files = [BUILD.parent / build / archive for archive in ARCHIVES]
                if all(file.exists() for file in files):
                    done = check(tools, *files)
                    self.assertEqual(done.returncode, 0, f"{build}: {done.stdout[:4000]}")
                    checked += 1
        self.assertGreater(checked, 0)

    def filter_options(self):
        """As the build has them, without what names this machine's processor, warnings and places."""
        for entry in json.loads((BUILD / "compile_commands.json").read_text()):
            if entry["file"].endswith(FILTER):
                words = shlex.split(entry["command"])
                return [word for word in words if word.startswith(("-f", "-O", "-D", "-std", "-I", "-isystem"))
                        or word == "/usr/include/eigen3"]
        self.fail(f"{FILTER} is not in compile_commands.json")

    def test_no_multiplication_is_fused_where_the_processor_could(self):
        options = self.filter_options()
        self.assertIn("-ffp-contract=off", options)
        for tools, (compiler, processor, _) in self.available().items():
            done = check(tools, self.compiled(compiler, ROOT / FILTER, *options, *processor))
            self.assertEqual(done.returncode, 0, f"{compiler}: {done.stdout[:4000]}")
            fused = check(tools, self.compiled(compiler, ROOT / FILTER, *options, *processor, "-ffp-contract=fast"))
            self.assertEqual(fused.returncode, 1)
            self.assertIn("fused multiply-add", fused.stdout, compiler)

    def test_violations_are_found(self):
        for what, text in VIOLATIONS.items():
            source = self.dir / "violation.cpp"
            source.write_text(text + "\n")
            done = check("", self.compiled("g++", source, "-O2"))
            self.assertEqual(done.returncode, 1, what)
            self.assertIn(what, done.stdout)


if __name__ == "__main__":
    unittest.main()

"""Base of the contract tests: what scripts rely on of `leadline` - exit codes, where messages go, what
they name, and that nothing half-written stays.

Environment: LEADLINE (the program). Standard library only.
"""

import os
import pathlib
import resource
import shutil
import subprocess
import tempfile
import unittest

LEADLINE = os.environ["LEADLINE"]

OK, USAGE, INPUT, OUTPUT, COMPARISON = 0, 2, 3, 4, 5
RESULTS = ["depth.asc", "depth.png", "depth.tif", "model.llm", "sigma.asc", "stats.json"]

HEADER = "time_us,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg,beam_az_deg,beam_el_deg,range_m"
CONFIG = """\
[grid]
cell_mm = 1000
size = [16, 16, 8]
origin_mm = [0, 0, 10000]
[sonar]
beam_half_angle_deg = 3
sigma_pointing_deg = 1
sigma_range_mm = 200
min_range_mm = 500
max_range_mm = 60000
"""


def rows(count=400):
    """Straight down over a flat bottom at 14 m, from all over the grid."""
    return [f"{i * 1000},{(i * 7) % 160 / 10},{(i * 13) % 160 / 10},2,0,0,0,0,90,12.0"
            for i in range(count)]


class Case(unittest.TestCase):
    def setUp(self):
        self.dir = pathlib.Path(tempfile.mkdtemp(prefix="leadline-contract-"))
        self.addCleanup(shutil.rmtree, self.dir, ignore_errors=True)
        self.pings = self.dir / "pings.csv"
        self.config = self.dir / "map.toml"
        self.out = self.dir / "out"
        self.write_rows(rows())
        self.config.write_text(CONFIG)

    def write_rows(self, lines, header=HEADER):
        self.pings.write_text("\n".join([header] + lines) + "\n")

    def run_leadline(self, *arguments, limit_bytes=None, stdin=None, stdout=subprocess.PIPE, timeout_s=50):
        def limit():
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit_bytes, limit_bytes))
        done = subprocess.run(
            [LEADLINE, *map(str, arguments)], input=stdin, stdout=stdout, stderr=subprocess.PIPE,
            text=True, timeout=timeout_s, preexec_fn=limit if limit_bytes is not None else None, check=False)
        self.assertGreaterEqual(done.returncode, 0,
                                f"killed by signal {-done.returncode}: {done.stderr}")
        return done

    def expect(self, done, code, *parts):
        self.assertEqual(done.returncode, code, f"{done.args}\n{done.stderr}{done.stdout}")
        for part in parts:
            self.assertIn(part, done.stderr)
        if code not in (OK, COMPARISON):
            self.assertIn("leadline: error: ", done.stderr)
        return done

    def run_map(self, *arguments, **options):
        return self.run_leadline("map", "--pings", self.pings, "--config", self.config, "--out",
                                 self.out, *arguments, **options)

    def assert_no_results(self):
        left = sorted(os.listdir(self.out)) if self.out.is_dir() else []
        self.assertEqual(left, [])

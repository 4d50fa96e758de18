#!/usr/bin/env python3
"""What scripts rely on: exit codes, where messages go, what they name, and that nothing half-written
stays. Each kind of bad input of the contract is a case of its own.

Environment: LEADLINE (the program). Standard library only.
"""

import json
import os
import pathlib
import re
import resource
import shutil
import signal
import subprocess
import tempfile
import unittest

LEADLINE = os.environ["LEADLINE"]

OK, USAGE, INPUT, OUTPUT, COMPARISON = 0, 2, 3, 4, 5
RESULTS = ["depth.asc", "depth.png", "model.llm", "sigma.asc", "stats.json"]
STATS_KEYS = [
    "pings", "rejected", "voxel_updates", "max_voxels_per_ping", "work_bound", "integrate_seconds",
    "extract_seconds", "bytes_per_voxel", "entropy_bits", "known_fraction", "table_crc", "map_hash",
]

HEADER = ("time_us,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg,beam_az_deg,beam_el_deg,range_m")
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
    return [f"{i * 1000},{(i * 7) % 160 / 10},{(i * 13) % 160 / 10},2,0,0,0,0,90,12.0" for i in range(count)]


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

    def run_leadline(self, *arguments, limit_bytes=None, stdin=None, stdout=subprocess.PIPE):
        def limit():
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit_bytes, limit_bytes))
        done = subprocess.run(
            [LEADLINE, *map(str, arguments)], input=stdin, stdout=stdout, stderr=subprocess.PIPE,
            text=True, timeout=50, preexec_fn=limit if limit_bytes is not None else None, check=False)
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


class CommandLine(Case):
    def test_no_command(self):
        self.expect(self.run_leadline(), USAGE, "subcommand is required", "--help")

    def test_unknown_command_with_a_suggestion(self):
        self.expect(self.run_leadline("gird"), USAGE, 'did you mean "grid"?')

    def test_unknown_option(self):
        self.expect(self.run_leadline("compare", "a", "b", "--bogus"), USAGE, "--bogus")

    def test_missing_option(self):
        self.expect(self.run_leadline("map", "--pings", "p.csv"), USAGE, "required")

    def test_value_that_is_no_number(self):
        self.expect(self.run_leadline("compare", "a", "b", "--max-rmse", "much"), USAGE, "--max-rmse")

    def test_help_and_version_go_to_standard_output(self):
        for arguments in (["--help"], ["--version"]):
            done = self.expect(self.run_leadline(*arguments), OK)
            self.assertIn("leadline", done.stdout.lower())
            self.assertEqual(done.stderr, "")

    def test_every_command_has_help_with_examples(self):
        listed = self.run_leadline("--help").stdout.split("Subcommands:")[1]
        names = re.findall(r"^  ([a-z]+) ", listed.split("\n\n")[0], re.MULTILINE)
        self.assertEqual(sorted(names), ["compare", "grid", "map", "query", "render", "simulate", "table"])
        for name in names:
            done = self.expect(self.run_leadline(name, "--help"), OK)
            self.assertIn(f"leadline {name} ", done.stdout.split("Example")[1])

    def test_standard_output_that_is_full(self):
        with open("/dev/full", "w") as full:
            self.expect(self.run_leadline("--help", stdout=full), OUTPUT, "standard output")


class MapWorks(Case):
    def test_results_and_statistics(self):
        done = self.expect(self.run_map("--json"), OK)
        self.assertEqual(sorted(os.listdir(self.out)), RESULTS)
        stats = json.loads((self.out / "stats.json").read_text())
        self.assertEqual(list(stats), STATS_KEYS)
        self.assertEqual(json.loads(done.stdout), stats)
        self.assertEqual(stats["pings"], 400)
        self.assertEqual(stats["rejected"], {})
        self.assertGreater(stats["voxel_updates"], 0)
        self.assertLessEqual(stats["max_voxels_per_ping"], stats["work_bound"])
        self.assertEqual(done.stderr, "")

    def test_rasters_are_esri_ascii_elevations(self):
        self.expect(self.run_map(), OK)
        lines = (self.out / "depth.asc").read_text().splitlines()
        head = dict(line.split() for line in lines[:6])
        self.assertEqual({k.lower(): float(v) for k, v in head.items()},
                         {"ncols": 16, "nrows": 16, "xllcorner": 0, "yllcorner": 0, "cellsize": 1,
                          "nodata_value": -9999})
        values = [float(v) for line in lines[6:] for v in line.split()]
        self.assertEqual(len(values), 256)
        known = [v for v in values if v != -9999]
        self.assertGreater(len(known), 200)
        for value in known:
            self.assertAlmostEqual(value, -14.0, delta=0.5)

    def test_the_origin_becomes_the_corner(self):
        self.config.write_text(CONFIG.replace("[0, 0, 10000]", "[-3500, 7250, 10000]"))
        self.write_rows([f"{i},{i % 12 - 3},{i % 14 + 8},2,0,0,0,0,90,12" for i in range(200)])
        self.expect(self.run_map(), OK)
        head = (self.out / "sigma.asc").read_text().lower()
        self.assertRegex(head, r"xllcorner\s+7\.25\b")
        self.assertRegex(head, r"yllcorner\s+-3\.5\b")

    def test_same_input_same_map(self):
        hashes = set()
        for name in ("a", "b"):
            self.out = self.dir / name
            hashes.add(json.loads(self.expect(self.run_map("--json"), OK).stdout)["map_hash"])
        self.assertEqual(len(hashes), 1)
        for name in ("depth.asc", "sigma.asc", "model.llm", "depth.png"):
            self.assertEqual((self.dir / "a" / name).read_bytes(), (self.dir / "b" / name).read_bytes())

    def test_columns_in_any_order_and_extra_ones(self):
        first = json.loads(self.expect(self.run_map("--json"), OK).stdout)["map_hash"]
        names = HEADER.split(",")
        lines = [",".join(reversed(row.split(","))) + ",hello" for row in rows()]
        self.write_rows(lines, ",".join(reversed(names)) + ",note")
        done = self.expect(self.run_map("--json"), OK, "ignored an extra column: \"note\"")
        self.assertEqual(json.loads(done.stdout)["map_hash"], first)

    def test_standard_input(self):
        text = self.pings.read_text()
        done = self.expect(self.run_leadline("map", "--pings", "-", "--config", self.config, "--out",
                                             self.out, "--json", stdin=text), OK)
        self.assertEqual(json.loads(done.stdout)["pings"], 400)

    def test_angles_are_wrapped(self):
        first = json.loads(self.expect(self.run_map("--json"), OK).stdout)["map_hash"]
        self.write_rows([row.replace(",0,0,0,0,90,", ",360,-720,3600000000,1080,450,") for row in rows()])
        self.assertEqual(json.loads(self.expect(self.run_map("--json"), OK).stdout)["map_hash"], first)

    def test_crlf_comments_blank_lines_and_byte_order_mark(self):
        first = json.loads(self.expect(self.run_map("--json"), OK).stdout)["map_hash"]
        text = self.pings.read_text().replace("\n", "\r\n# x\r\n\r\n")
        self.pings.write_bytes(b"\xef\xbb\xbf" + text.encode())
        self.assertEqual(json.loads(self.expect(self.run_map("--json"), OK).stdout)["map_hash"], first)


class BadPings(Case):
    def expect_counted(self, bad_row, reason, *parts):
        """The row is counted and described, and the map is the one without it; --strict stops."""
        good = rows()
        self.write_rows(good)
        clean = json.loads(self.expect(self.run_map("--json"), OK).stdout)
        shutil.rmtree(self.out)
        self.write_rows(good[:200] + [bad_row] + good[200:])
        done = self.expect(self.run_map("--json"), OK, *parts)
        stats = json.loads(done.stdout)
        self.assertEqual(stats["rejected"], {reason: 1})
        self.assertEqual(stats["pings"], 400)
        self.assertEqual(stats["map_hash"], clean["map_hash"])
        self.assertEqual(stats["voxel_updates"], clean["voxel_updates"])
        shutil.rmtree(self.out)
        if reason in ("range_below_min", "range_above_max"):
            self.expect(self.run_map("--strict"), OK)
            return
        self.expect(self.run_map("--strict"), INPUT, "pings.csv:202", *parts)
        self.assert_no_results()

    def test_malformed(self):
        self.expect_counted("199500,1,2,2,0,0,0,0,90,12..5", "malformed",
                            'pings.csv:202: column range_m: value "12..5": ')

    def test_missing(self):
        self.expect_counted("199500,1,,2,0,0,0,0,90,12", "missing", 'pings.csv:202: column y_m: value ""')

    def test_cut_row(self):
        self.expect_counted("199500,1,2,2,0,0", "missing", "pings.csv:202: column heading_deg")

    def test_nan(self):
        self.expect_counted("199500,1,2,nan,0,0,0,0,90,12", "not_finite", 'column z_m: value "nan"')

    def test_infinite(self):
        self.expect_counted("199500,1,2,2,0,0,0,0,90,-inf", "not_finite", 'column range_m: value "-inf"')

    def test_absurd(self):
        self.expect_counted("199500,1,2,1e9,0,0,0,0,90,12", "out_of_range", 'column z_m: value "1e9"')

    def test_negative_range(self):
        self.expect_counted("199500,1,2,2,0,0,0,0,90,-12", "out_of_range", 'value "-12"')

    def test_time_backwards(self):
        self.expect_counted("198999,1,2,2,0,0,0,0,90,12", "time_backwards", 'column time_us: value "198999"')

    def test_range_below_minimum(self):
        self.expect_counted("199500,1,2,2,0,0,0,0,90,0.4999", "range_below_min")

    def test_range_above_maximum(self):
        self.expect_counted("199500,1,2,2,0,0,0,0,90,60.0001", "range_above_max")

    def test_bytes_that_are_no_text(self):
        self.pings.write_bytes((HEADER + "\n").encode() + b"\x00\xff\x1b[2J,1\n" + "\n".join(rows()).encode() + b"\n")
        done = self.expect(self.run_map(), OK, "pings.csv:2: ")
        self.assertNotIn("\x1b", done.stderr)
        self.assertNotIn("\x00", done.stderr)

    def test_re_origin(self):
        self.write_rows(rows() + ["999999,4500000.5,500000,2,0,0,0,0,90,12"])
        self.expect(self.run_map(), INPUT, "pings.csv:402: column x_m", "re-origin")
        self.assert_no_results()

    def test_empty_file(self):
        self.pings.write_bytes(b"")
        self.expect(self.run_map(), INPUT, "pings.csv", "is empty")
        self.assert_no_results()

    def test_header_only(self):
        self.write_rows([])
        self.expect(self.run_map(), INPUT, "no row after the header")

    def test_no_usable_row(self):
        self.write_rows(["x,1,2,2,0,0,0,0,90,12", "1,nan,2,2,0,0,0,0,90,12"])
        self.expect(self.run_map(), INPUT, "no usable row among 2", "pings.csv:2: column time_us")
        self.assert_no_results()

    def test_no_row_within_the_range_limits(self):
        self.write_rows(["0,1,2,2,0,0,0,0,90,0.1", "1,1,2,2,0,0,0,0,90,99"])
        self.expect(self.run_map(), INPUT, "range_below_min 1", "range_above_max 1", "min_range_mm = 500")
        self.assert_no_results()

    def test_missing_column(self):
        self.write_rows(rows(), HEADER.replace("heading_deg", "heading"))
        self.expect(self.run_map(), INPUT, "column heading_deg is missing", '"heading"')

    def test_file_that_is_not_there(self):
        self.pings.unlink()
        self.expect(self.run_map(), INPUT, "pings.csv", "No such file")

    def test_folder_instead_of_a_file(self):
        self.pings.unlink()
        self.pings.mkdir()
        self.expect(self.run_map(), INPUT, "is a directory")


class BadConfiguration(Case):
    def expect_refused(self, text, *parts):
        self.config.write_text(text)
        self.expect(self.run_map(), USAGE, *parts)
        self.assertFalse(self.out.exists())

    def test_unknown_key_with_a_suggestion(self):
        self.expect_refused(CONFIG.replace("sigma_range_mm", "sigma_rnage_mm"),
                            "map.toml:8: [sonar] sigma_rnage_mm: unknown key", '"sigma_range_mm"')

    def test_zero_cells(self):
        self.expect_refused(CONFIG.replace("[16, 16, 8]", "[16, 0, 8]"), "map.toml:3: [grid] size[1] = 0")

    def test_zero_cell_size(self):
        self.expect_refused(CONFIG.replace("cell_mm = 1000", "cell_mm = 0"), "map.toml:2: [grid] cell_mm = 0")

    def test_grid_over_capacity(self):
        self.expect_refused(CONFIG.replace("[16, 16, 8]", "[4000, 4000, 1000]"), "capacity", "16000000000")

    def test_not_a_number(self):
        self.expect_refused(CONFIG.replace("sigma_range_mm = 200", "sigma_range_mm = nan"),
                            "map.toml:8: [sonar] sigma_range_mm = nan")

    def test_no_beam(self):
        self.expect_refused(CONFIG.replace("beam_half_angle_deg = 3\n", ""), "needs one beam description")

    def test_two_beams(self):
        self.expect_refused(CONFIG + "piston_diameter_mm = 80\nfrequency_hz = 1e5\n", "more than one beam")

    def test_unknown_rule(self):
        self.expect_refused(CONFIG + '[model]\nrule = "magic"\n', "weighted_mean", "log_odds")

    def test_other_schema_version(self):
        self.expect_refused("schema_version = 9\n" + CONFIG, "map.toml:1: schema_version = 9")

    def test_not_toml(self):
        self.expect_refused(CONFIG + "= 3\n", "map.toml:11: not valid TOML")

    def test_empty(self):
        self.expect_refused("", "[grid]")

    def test_file_that_is_not_there(self):
        self.config.unlink()
        self.expect(self.run_map(), USAGE, "map.toml", "No such file")

    def test_pattern_file_that_is_not_there(self):
        self.expect_refused(CONFIG.replace("beam_half_angle_deg = 3", 'pattern_file = "none.csv"'),
                            str(self.dir / "none.csv"))


class BadOutput(Case):
    def test_place_that_is_a_file(self):
        self.out.write_text("mine")
        self.expect(self.run_map(), OUTPUT, str(self.out))
        self.assertEqual(self.out.read_text(), "mine")

    def test_place_that_cannot_be_made(self):
        self.out = pathlib.Path("/proc/leadline")
        self.expect(self.run_map(), OUTPUT, "/proc/leadline")

    def test_disk_that_fills_up(self):
        # A file size limit stands in for it. Earlier results stay, nothing half-written is left.
        self.expect(self.run_map(), OK)
        before = {name: (self.out / name).read_bytes() for name in RESULTS}
        self.write_rows(rows(300))
        self.expect(self.run_map(limit_bytes=1500), OUTPUT, "File too large")
        after = {name: (self.out / name).read_bytes() for name in os.listdir(self.out)}
        self.assertEqual(after, before)

    def test_result_name_that_is_a_folder(self):
        (self.out / "depth.asc").mkdir(parents=True)
        self.expect(self.run_map(), OUTPUT, "depth.asc", "directory")
        self.assertEqual(os.listdir(self.out), ["depth.asc"])

    def test_killed_in_the_middle(self):
        # Pings come through a pipe that stays open: the run is in the middle of its work for sure.
        self.expect(self.run_map(), OK)
        before = {name: (self.out / name).read_bytes() for name in RESULTS}
        run = subprocess.Popen([LEADLINE, "map", "--pings", "-", "--config", str(self.config), "--out",
                                str(self.out)], stdin=subprocess.PIPE, stderr=subprocess.DEVNULL)
        run.stdin.write("\n".join([HEADER] + rows(20000)).encode())
        run.stdin.flush()
        run.send_signal(signal.SIGKILL)
        run.wait()
        run.stdin.close()
        for name in RESULTS:
            self.assertEqual((self.out / name).read_bytes(), before[name])
        self.expect(self.run_map(), OK)
        self.assertEqual(sorted(os.listdir(self.out)), RESULTS)

    def test_standard_output_that_is_full(self):
        with open("/dev/full", "w") as full:
            self.expect(self.run_map("--json", stdout=full), OUTPUT, "standard output")


class OtherCommands(Case):
    def raster(self, name, values):
        text = "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\nNODATA_value -9999\n"
        path = self.dir / name
        path.write_text(text + "{} {}\n{} {}\n".format(*values))
        return path

    def test_compare_reports_and_fails_by_its_limits(self):
        truth = self.raster("truth.asc", (-10, -10, -10, -10))
        estimate = self.raster("estimate.asc", (-10, -11, -10, -11))
        done = self.expect(self.run_leadline("compare", estimate, truth, "--json"), OK)
        self.assertIn("rmse", done.stdout)
        json.loads(done.stdout)
        self.expect(self.run_leadline("compare", estimate, truth, "--max-rmse", 1), OK)
        self.expect(self.run_leadline("compare", estimate, truth, "--max-rmse", 0.5), COMPARISON, "rmse")
        self.expect(self.run_leadline("compare", estimate, truth, "--min-coverage", 2), USAGE)

    def test_compare_refuses_what_it_cannot_read(self):
        truth = self.raster("truth.asc", (-10, -10, -10, "x"))
        self.expect(self.run_leadline("compare", truth, truth), INPUT, "truth.asc")
        self.expect(self.run_leadline("compare", "/nowhere.asc", truth), INPUT, "/nowhere.asc")

    def test_grid_and_its_errors(self):
        self.expect(self.run_leadline("grid", "--pings", self.pings, "--config", self.config, "--out",
                                      self.out), OK)
        self.assertIn("mean.asc", os.listdir(self.out))
        self.expect(self.run_leadline("grid", "--pings", self.pings, "--config", self.config, "--out",
                                      self.out, "--method", "gausian"), USAGE, "gausian")
        self.expect(self.run_leadline("grid", "--pings", "/nowhere.csv", "--config", self.config, "--out",
                                      self.out), INPUT, "/nowhere.csv")

    def test_render_and_its_errors(self):
        truth = self.raster("truth.asc", (-10, -11, -12, -13))
        picture = self.dir / "depth.png"
        self.expect(self.run_leadline("render", truth, "--view", "depth", "--out", picture), OK)
        self.assertEqual(picture.read_bytes()[:8], b"\x89PNG\r\n\x1a\n")
        self.expect(self.run_leadline("render", truth, "--view", "dept", "--out", picture), USAGE,
                    'did you mean "depth"?')
        self.expect(self.run_leadline("render", truth, "--view", "slice", "--axis", "up", "--out", picture),
                    USAGE, "north, east, down")
        self.expect(self.run_leadline("render", truth, "--view", "depth", "--out", "/dev/full"), OUTPUT,
                    "No space left")

    def test_simulate_feeds_map_and_compare(self):
        survey = self.dir / "survey"
        self.expect(self.run_leadline("simulate", "--preset", "plane_flat", "--out", survey), OK)
        self.expect(self.run_leadline("map", "--pings", survey / "pings.csv", "--config",
                                      survey / "map.toml", "--out", self.out), OK)
        self.expect(self.run_leadline("compare", self.out / "depth.asc", survey / "truth.asc", "--mask",
                                      survey / "touched.asc", "--sigma", self.out / "sigma.asc",
                                      "--max-rmse-cells", 1, "--min-coverage", 0.9), OK)
        self.expect(self.run_leadline("simulate", "--preset", "plane_flt", "--out", survey), USAGE,
                    "plane_flat")
        self.expect(self.run_leadline("simulate", "--terrain", "/nowhere.tif", "--out", survey), INPUT,
                    "/nowhere.tif")


if __name__ == "__main__":
    unittest.main()

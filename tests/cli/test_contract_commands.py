#!/usr/bin/env python3
"""The command line itself, and every command but map: exit codes and messages."""

import json
import os
import pathlib
import re
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from contract import COMPARISON, INPUT, OK, OUTPUT, USAGE, Case  # noqa: E402


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
        self.assertEqual(sorted(names), [
            "calibrate", "command", "compare", "config", "crosslines", "decode", "emulate", "export", "grid", "import",
            "key", "map", "monitor", "probe", "query", "receive", "render", "replay", "scene", "simulate", "store",
            "survey", "table"])
        for name in names:
            done = self.expect(self.run_leadline(name, "--help"), OK)
            self.assertIn(f"leadline {name} ", done.stdout.split("Example")[1])

    def test_standard_output_that_is_full(self):
        with open("/dev/full", "w") as full:
            self.expect(self.run_leadline("--help", stdout=full), OUTPUT, "standard output")


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

    def test_scene_feeds_map_and_compare(self):
        survey = self.dir / "survey"
        self.expect(self.run_leadline("scene", "--preset", "plane_flat", "--out", survey), OK)
        self.expect(self.run_leadline("map", "--pings", survey / "pings.csv", "--config",
                                      survey / "map.toml", "--out", self.out), OK)
        self.expect(self.run_leadline("compare", self.out / "depth.asc", survey / "truth.asc", "--mask",
                                      survey / "touched.asc", "--sigma", self.out / "sigma.asc",
                                      "--max-rmse-cells", 1, "--min-coverage", 0.9), OK)
        self.expect(self.run_leadline("scene", "--preset", "plane_flt", "--out", survey), USAGE,
                    "plane_flat")
        self.expect(self.run_leadline("scene", "--terrain", "/nowhere.tif", "--out", survey), INPUT,
                    "/nowhere.tif")

    def test_simulate_with_a_preset_is_a_scene(self):
        # As it was before scenes had a command of their own.
        folders = [self.dir / name for name in ("old", "new")]
        for command, folder in zip(("simulate", "scene"), folders):
            self.expect(self.run_leadline(command, "--preset", "plane_flat", "--seed", 3, "--set",
                                          "ping_count=200", "--out", folder), OK)
        for name in ("pings.csv", "map.toml", "truth.asc", "touched.asc"):
            self.assertEqual((folders[0] / name).read_bytes(), (folders[1] / name).read_bytes())


class SavedModel(Case):
    """query, render and table on what map and table left, whole and damaged."""

    def setUp(self):
        super().setUp()
        self.expect(self.run_map(), OK)

    def query(self, *arguments):
        return self.run_leadline("query", self.out, *arguments)

    def test_query_along_a_line(self):
        done = self.expect(self.query("--from", "8.5,8.5,10.5", "--to", "8.5,8.5,16.5", "--json"), OK)
        answer = json.loads(done.stdout)
        self.assertEqual(answer["verdict"], "occupied")
        self.assertAlmostEqual(answer["length_m"], 6.0)
        self.assertEqual(answer["runs"][0]["state"], "free")
        self.assertAlmostEqual(answer["first_occupied_m"], 3.5, delta=2.5)
        self.assertEqual(sum(answer["voxels"][s] for s in ("free", "occupied", "unknown")), 7)

    def test_query_in_free_water(self):
        done = self.expect(self.query("--from", "3,3,10.2", "--to", "12,12,10.8"), OK)
        self.assertEqual(done.stdout.split("\n")[0], "free")

    def test_query_outside_is_unknown(self):
        done = self.expect(self.query("--from", "-50,3,10.2", "--to", "-40,3,10.2"), OK)
        self.assertEqual(done.stdout.split("\n")[0], "unknown")

    def test_query_in_a_box(self):
        done = self.expect(self.query("--box", "--from", "0,0,10", "--to", "16,16,18", "--json"), OK)
        answer = json.loads(done.stdout)
        self.assertEqual(answer["verdict"], "occupied")
        self.assertEqual(answer["voxels"]["outside"], 0)
        self.assertEqual(sum(answer["voxels"][s] for s in ("free", "occupied", "unknown")), 16 * 16 * 8)

    def test_query_with_bad_points(self):
        self.expect(self.query("--from", "1,2", "--to", "1,2,3"), USAGE, "--from 1,2: ", "NORTH,EAST,DOWN")
        self.expect(self.query("--from", "1,2,x", "--to", "1,2,3"), USAGE, "--from 1,2,x")
        self.expect(self.query("--from", "1,2,3"), USAGE, "--to")

    def test_render_of_the_voxels(self):
        for view in ("slice", "histogram"):
            picture = self.dir / (view + ".png")
            self.expect(self.run_leadline("render", self.out, "--view", view, "--out", picture), OK)
            self.assertEqual(picture.read_bytes()[:8], b"\x89PNG\r\n\x1a\n")

    def damaged(self, change):
        model = self.out / "model.llm"
        model.write_bytes(change(model.read_bytes()))

    def expect_model_refused(self, *parts):
        self.expect(self.query("--from", "1,1,11", "--to", "1,1,12"), INPUT, "model.llm", *parts)
        self.expect(self.run_leadline("render", self.out, "--view", "histogram", "--out",
                                      self.dir / "h.png"), INPUT, "model.llm", *parts)
        self.assertFalse((self.dir / "h.png").exists())

    def test_cut_model(self):
        self.damaged(lambda bytes_: bytes_[:-100])
        self.expect_model_refused("is cut")

    def test_damaged_model(self):
        self.damaged(lambda bytes_: bytes_[:30000] + bytes([bytes_[30000] ^ 1]) + bytes_[30001:])
        self.expect_model_refused("is damaged")

    def test_model_of_another_version(self):
        self.damaged(lambda bytes_: bytes_[:4] + b"\x07" + bytes_[5:])
        self.expect_model_refused("version 7")

    def test_something_else_than_a_model(self):
        self.damaged(lambda _: b"hello")
        self.expect_model_refused("is not a saved model")

    def test_no_model_there(self):
        (self.out / "model.llm").unlink()
        self.expect(self.query("--from", "1,1,11", "--to", "1,1,12"), INPUT, "model.llm", "No such file")


class Tables(Case):
    def setUp(self):
        super().setUp()
        self.table = self.dir / "beam.llt"
        self.made = self.expect(self.run_leadline("table", "--config", self.config, "--out", self.table,
                                                  "--json"), OK)

    def test_a_table_reads_back_and_is_the_one_that_map_uses(self):
        shown = self.expect(self.run_leadline("table", "--show", self.table, "--json"), OK)
        self.assertEqual(json.loads(shown.stdout), json.loads(self.made.stdout))
        stats = json.loads(self.expect(self.run_map("--json"), OK).stdout)
        self.assertEqual(stats["table_crc"], json.loads(shown.stdout)["table_crc"])

    def test_the_report_states_the_worst_errors(self):
        done = self.expect(self.run_leadline("table", "--config", self.config), OK)
        self.assertIn("rror", done.stdout)
        self.assertIn("discarded", done.stdout)

    def expect_refused(self, change, *parts):
        self.table.write_bytes(change(self.table.read_bytes()))
        self.expect(self.run_leadline("table", "--show", self.table), INPUT, "beam.llt", *parts)

    def test_cut_table(self):
        self.expect_refused(lambda bytes_: bytes_[:1000])

    def test_empty_table(self):
        self.expect_refused(lambda _: b"")

    def test_table_of_another_version(self):
        self.expect_refused(lambda bytes_: bytes_[:4] + b"\x09" + bytes_[5:], "version")

    def test_damaged_table(self):
        self.expect_refused(lambda bytes_: bytes_[:5000] + bytes([bytes_[5000] ^ 1]) + bytes_[5001:])

    def test_usage(self):
        self.expect(self.run_leadline("table"), USAGE, "--config", "--show")
        self.expect(self.run_leadline("table", "--show", self.table, "--out", "x"), USAGE, "--out")
        self.expect(self.run_leadline("table", "--config", self.config, "--out", "/dev/full"), OUTPUT,
                    "No space left")

if __name__ == "__main__":
    unittest.main()

"""`leadline config`: what scripts rely on. What the block holds and how text is lifted: unit.firmware_config.migrate."""

import json
import os
import pathlib
import re
import shutil
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from contract import INPUT, OK, OUTPUT, USAGE, Case  # noqa: E402

VEHICLE = """\
# two tanks, one pinger
[survey]
id = 7
[grid]
cell_mm = 500
size = [32, 32, 16]
origin_mm = [0, 0, 0]
[[mount]]
name = "down"
table = "beam.llt"
[[port]]
uri = "serial:/dev/ttyUSB0:57600"
driver = "ping1d"
[[port]]
uri = "udp:@:9200"
driver = "nmea"
[link]
uri = "serial:/dev/ttyUSB1:9600"
baud = 9600
"""


class ConfigCommand(Case):
    def setUp(self):
        super().setUp()
        self.vehicle = self.dir / "vehicle.toml"
        self.vehicle.write_text(VEHICLE)
        self.block = self.dir / "vehicle.llb"
        self.expect(self.run_leadline("table", "--config", self.config, "--out", self.dir / "beam.llt"), OK)

    def compile(self, *more):
        return self.run_leadline("config", "compile", self.vehicle, "--out", self.block, *more)

    def test_compile_and_show(self):
        self.expect(self.compile("--session", 5), OK)
        told = json.loads(self.expect(self.run_leadline("config", "show", self.block, "--json"), OK).stdout)
        self.assertEqual(told["survey"]["session"], 5)
        self.assertEqual([port["baud"] for port in told["port"]], [57600, 0])
        self.assertEqual(told["block"]["link_baud"], 9600)
        self.assertEqual(told["block"]["bytes"], self.block.stat().st_size)
        self.assertEqual(len(told["table"]), 1)
        self.assertIn("cell_mm = 500", self.expect(self.run_leadline("config", "show", self.block), OK).stdout)

    def cycle(self):
        shown = self.expect(self.run_leadline("config", "show", self.block, "--json"), OK).stdout
        told = json.loads(shown)["model"]
        return told["extract_interval_s"], told["tile_budget"]

    def estimate(self, done):
        return [float(share) for share in re.findall(r"([0-9.]+) % of a Cortex-M7's 480 million", done.stderr)]

    def test_a_vehicle_without_files_extracts_in_passes_unless_told_otherwise(self):
        done = self.expect(self.compile(), OK)
        self.assertIn("[cycle] extract_interval_s = 1.5, since the file does not say", done.stderr)
        self.assertIn("[cycle] tile_budget = 1, since the file does not say", done.stderr)
        self.assertEqual(self.cycle(), (1.5, 1))
        self.assertEqual(len(self.estimate(done)), 1)
        most, has = re.search(r"at most ([0-9.]+) million instructions of a cycle, which has ([0-9.]+)",
                              done.stderr).groups()
        self.assertEqual(float(has), 9.6)
        self.assertGreater(float(most), 10)
        self.vehicle.write_text(VEHICLE + "[cycle]\nextract_interval_s = 0\ntile_budget = 3\n")
        told = self.expect(self.compile(), OK).stderr
        self.assertNotIn("does not say", told)
        self.assertNotIn("of a cycle", told)
        self.assertEqual(self.cycle(), (0, 3))

    def test_what_a_cortex_m7_cannot_carry_is_warned_of(self):
        # A wide beam twenty times a second over small cells.
        wide = self.config.read_text().replace("beam_half_angle_deg = 3", "beam_half_angle_deg = 12.5")
        self.config.write_text(wide)
        self.expect(self.run_leadline("table", "--config", self.config, "--out", self.dir / "beam.llt"), OK)
        heavy = VEHICLE.replace("cell_mm = 500", "cell_mm = 250").replace("[32, 32, 16]", "[128, 128, 100]")
        heavy = heavy.replace('driver = "ping1d"', 'driver = "ping1d"\ninterval_ms = 50')
        self.vehicle.write_text(heavy + "[cycle]\nextract_interval_s = 0\n")
        done = self.expect(self.compile(), OK)
        self.assertIn("vehicle.toml: warning: more than the 15 %", done.stderr)
        self.assertIn("extract_interval_s = 1.5 and tile_budget = 1 would make", done.stderr)
        alone, would = self.estimate(done)[0], self.estimate(done)[-1]
        self.assertGreater(alone, 50)
        self.vehicle.write_text(heavy)
        done = self.expect(self.compile(), OK)
        self.assertNotIn("warning", done.stderr)
        self.assertEqual(self.estimate(done), [would])
        # Beams of arrays: as many as the driver takes, or as many as one says.
        self.vehicle.write_text(heavy.replace('"ping1d"\ninterval_ms = 50', '"deltat83p"'))
        done = self.expect(self.compile(), OK)
        self.assertIn("interval_ms", done.stderr.split("warning")[1])
        self.assertLess(self.estimate(self.compile("--beams", 16))[0], self.estimate(done)[0] / 5)
        self.expect(self.compile("--beams", 0), USAGE, "--beams")

    def test_the_example_for_a_cortex_m7_is_one_that_it_carries(self):
        example = pathlib.Path(os.environ["LEADLINE_ROOT"]) / "firmware/m7/vehicle.example.toml"
        shutil.copy(example, self.vehicle)
        wide = self.config.read_text().replace("beam_half_angle_deg = 3", "beam_half_angle_deg = 12.5")
        self.config.write_text(wide)
        self.expect(self.run_leadline("table", "--config", self.config, "--out", self.dir / "ping1d.llt"), OK)
        done = self.expect(self.compile(), OK)
        self.assertNotIn("warning", done.stderr)
        self.assertNotIn("does not say", done.stderr)
        self.assertEqual(self.cycle(), (1.5, 1))
        told = json.loads(self.expect(self.run_leadline("config", "show", self.block, "--json"), OK).stdout)
        size = told["grid"]["size"]
        self.assertLessEqual(size[0] * size[1] * size[2], 131072)
        self.assertLessEqual(size[0] * size[1], 2560)
        self.assertEqual([size[0] % 16, size[1] % 16], [0, 0])

    def test_what_is_wrong_leaves_no_block(self):
        self.vehicle.write_text(VEHICLE.replace("cell_mm = 500", "cell_mm = 0"))
        self.expect(self.compile(), USAGE, "vehicle.toml:5: [grid] cell_mm = 0")
        self.vehicle.write_text(VEHICLE + "[navigation]\ntide_file = \"tide.csv\"\n")
        self.expect(self.compile(), USAGE, "tide_m")
        self.vehicle.write_text(VEHICLE.replace("beam.llt", "none.llt"))
        self.expect(self.compile(), INPUT, "none.llt")
        self.assertFalse(self.block.exists())
        self.vehicle.write_text(VEHICLE)
        self.expect(self.run_leadline("config", "compile", self.vehicle, "--out", self.dir / "no" / "x"), OUTPUT)

    def test_damaged_blocks_are_told(self):
        self.expect(self.compile(), OK)
        good = self.block.read_bytes()
        for bad in [b"", good[:-8], good[:50], b"LLB1", good[:300] + bytes([good[300] ^ 1]) + good[301:]]:
            self.block.write_bytes(bad)
            self.expect(self.run_leadline("config", "show", self.block), INPUT, "vehicle.llb")
        self.expect(self.run_leadline("config", "show", self.vehicle), INPUT, "no configuration block")

    def test_migrate(self):
        new = self.dir / "new.toml"
        done = self.expect(self.run_leadline("config", "migrate", self.vehicle, "--from", 0, "--out", new), OK)
        self.assertIn("voxel_budget = 0", done.stderr)
        text = new.read_text()
        self.assertTrue(set(VEHICLE.splitlines()) <= set(text.splitlines()))
        self.assertIn("schema_version = 1\n", text)
        # Each change is told, with the line that it is in.
        for number, line in enumerate(text.splitlines(), 1):
            if line in ("voxel_budget = 0", "schema_version = 1"):
                self.assertIn(f"new.toml:{number}: ", done.stderr)
        self.assertIn("schema version 0 to 1, 2 changes\n", done.stderr)
        again = self.expect(self.run_leadline("config", "migrate", new, "--out", "-"), OK)
        self.assertEqual(again.stdout, text)
        self.assertIn("schema version 1 to 1, 0 changes\n", again.stderr)
        # Keys that nobody knows are not carried along in silence.
        self.vehicle.write_text(VEHICLE + "colour = \"red\"\n")
        self.expect(self.run_leadline("config", "migrate", self.vehicle, "--out", self.dir / "x"), USAGE,
                    "colour")
        self.assertFalse((self.dir / "x").exists())
        self.expect(self.compile(), USAGE)
        self.vehicle.write_text("schema_version = 7\n" + VEHICLE)
        self.expect(self.run_leadline("config", "migrate", self.vehicle, "--out", "-"), USAGE, "7")

    def test_migrate_of_a_block(self):
        self.expect(self.compile(), OK)
        lifted = self.dir / "new.llb"
        self.expect(self.run_leadline("config", "migrate", self.block, "--out", lifted), OK)
        self.assertEqual(lifted.read_bytes(), self.block.read_bytes())


if __name__ == "__main__":
    unittest.main()

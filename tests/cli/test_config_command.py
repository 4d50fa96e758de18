"""`leadline config`: what scripts rely on. What the block holds and how text is lifted: unit.firmware_config.migrate."""

import json
import pathlib
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
        again = self.expect(self.run_leadline("config", "migrate", new, "--out", "-"), OK)
        self.assertEqual(again.stdout, text)
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

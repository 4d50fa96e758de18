#!/usr/bin/env python3
"""Whole flights that earlier programs recorded, tests/data/golden/flight_MAJOR.MINOR.lll.xz: what they said over the link
becomes the map that their vehicle had, and their log flies again. A file is never written anew; a new minor version, or a
new version of the configuration, adds one:

    leadline simulate --set north_count=32 --set east_count=32 --set line_spacing_m=8 --set settle_s=2 \\
      --set ping_interval_s=0.2 --set attitude_rate_hz=5 --set fix_rate_hz=1 --set pressure_rate_hz=2 \\
      --set run_out_m=0.5 --set start_s=2 --set speed_m_s=1.5 --out flight && xz -9e flight/survey.lll
"""

import json
import lzma
import os
import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from contract import COMPARISON, OK, Case  # noqa: E402

FOLDER = pathlib.Path(os.environ["LEADLINE_ROOT"]) / "tests/data/golden"
# Protocol of the file -> what its vehicle said in the end.
FLIGHTS = {
    # Configuration of version 1, a hello without names.
    "1.0": {"name": None, "cells_hash": "0xd0afe489557e1ecc", "known_cells": 615, "delta_cells": 986,
            "cycles": 735, "pings_in": 189},
    # Configuration of version 2.
    "1.1": {"name": "emulated", "cells_hash": "0x5768c68d413c5f19", "known_cells": 615,
            "delta_cells": 1021, "cycles": 735, "pings_in": 189},
}


class GoldenFlights(Case):
    def flight(self, version):
        path = self.dir / f"{version}.lll"
        path.write_bytes(lzma.decompress((FOLDER / f"flight_{version}.lll.xz").read_bytes()))
        return path

    def test_every_file_is_known(self):
        self.assertEqual(sorted(path.name for path in FOLDER.glob("flight_*")),
                         sorted(f"flight_{version}.lll.xz" for version in FLIGHTS))

    def test_the_link_gives_the_map_that_the_vehicle_had(self):
        for version, said in FLIGHTS.items():
            with self.subTest(version):
                log = self.flight(version)
                done = self.expect(self.run_leadline("receive", "--link", f"file:{log}", "--json"), OK)
                got = json.loads(done.stdout)
                self.assertIs(got["topside_equals_vehicle"], True)
                for key in ("cells_hash", "known_cells", "delta_cells"):
                    self.assertEqual(got[key], said[key], key)
                for key in ("damaged_frames", "malformed", "unknown_types", "incomplete_tiles"):
                    self.assertEqual(got[key], 0, key)
                self.assertEqual(got.get("survey_name"), said["name"])

    def test_the_log_flies_again(self):
        for version, said in FLIGHTS.items():
            with self.subTest(version):
                done = self.run_leadline("replay", self.flight(version), "--json")
                # Rules may have changed since, and with them the map; what the log holds has not.
                self.assertIn(done.returncode, (OK, COMPARISON), done.stderr)
                got = json.loads(done.stdout)
                for key in ("cycles", "pings_in"):
                    self.assertEqual(got[key], said[key], key)
                self.assertGreater(got["pings_fused"], 0)
                for key in ("damaged_places", "missing_cycles", "broken_cycles", "recorder_lost"):
                    self.assertEqual(got[key], 0, key)


if __name__ == "__main__":
    unittest.main()

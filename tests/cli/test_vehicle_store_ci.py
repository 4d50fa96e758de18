#!/usr/bin/env python3
"""A vehicle with a store: its map survives kills and restarts, may be larger than its window, and its logs
replay without the store."""

import json
import os
import pathlib
import subprocess
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from contract import LEADLINE, OK, USAGE, Case  # noqa: E402

VEHICLE = os.environ["LEADLINE_VEHICLE"]
PATIENCE_S = 180
# 24 x 24 metres of 0.25 m: 6 x 6 tiles.
FLIGHT = ["--set", "north_count=96", "--set", "east_count=96", "--set", "line_spacing_m=8", "--set",
          "settle_s=2"]


class Store(Case):
    def configure(self, log, window=None, more=()):
        self.flight = [*FLIGHT, *more]
        self.expect(self.run_leadline("emulate", *self.flight, "--write-config", self.dir, "--ports",
                                      self.dir / "ports", "--link", "udp:127.0.0.1:9", "--log", log), OK)
        self.toml = self.dir / "vehicle.toml"
        text = self.toml.read_text() + '\n[store]\npath = "map.llp"\n'
        self.toml.write_text(text + (f"window_tiles = {window}\n" if window else ""))

    def start(self):
        def run(*command):
            process = subprocess.Popen([*map(str, command)], stdout=subprocess.PIPE,
                                       stderr=subprocess.PIPE, text=True)
            self.addCleanup(process.kill)
            return process
        emulator = run(LEADLINE, "emulate", *self.flight, "--ports", self.dir / "ports", "--out", self.out,
                       "--lockstep", self.dir / "clock")
        vehicle = run(VEHICLE, "--config", self.toml, "--clock", f"lockstep:{self.dir}/clock", "--json")
        return emulator, vehicle

    def fly(self):
        emulator, vehicle = self.start()
        emulator.communicate(timeout=PATIENCE_S)
        output, errors = vehicle.communicate(timeout=PATIENCE_S)
        self.assertEqual(vehicle.returncode, OK, errors)
        return json.loads(output), errors

    def replay(self, log):
        done = self.expect(self.run_leadline("replay", self.dir / log), OK)
        self.assertIn("the same as when it flew", done.stdout)

    def test_a_map_survives_a_restart(self):
        self.configure("one.lll")
        summary, errors = self.fly()
        self.assertTrue(summary["stored"])
        self.assertGreater(summary["tiles_saved"], 10)
        self.assertEqual(summary["pings_without_tile"], 0)
        self.assertNotIn("resumes", errors)
        self.replay("one.lll")
        # The same flight again, onto the map of the first: more evidence in every tile.
        self.configure("two.lll")
        again, errors = self.fly()
        self.assertIn("resumes a map of", errors)
        self.assertGreater(again["tiles_loaded"], 10)
        self.assertTrue(again["stored"])
        self.assertNotEqual(again["map_hash"], summary["map_hash"])
        self.replay("two.lll")

    def test_a_killed_vehicle_resumes(self):
        self.configure("killed.lll")
        emulator, vehicle = self.start()
        store = self.dir / "map.llp"
        deadline = time.monotonic() + PATIENCE_S
        while not (store.exists() and store.stat().st_size > 300_000) and time.monotonic() < deadline:
            time.sleep(0.01)
        vehicle.kill()
        vehicle.communicate()
        emulator.kill()
        emulator.communicate()
        self.configure("resumed.lll")
        summary, errors = self.fly()
        self.assertIn("resumes a map of", errors)
        self.assertTrue(summary["stored"])
        self.replay("resumed.lll")

    def test_a_window_gives_the_map_of_one_big_grid(self):
        # Fish before the ground, which is heard behind them, to the sides: later returns wait for tiles as well.
        more = ["--set", "profile=true", "--set", "max_returns=3", "--set", "fish_fraction=0.5", "--set", "tilt_deg=40",
                "--set", "max_range_m=20"]
        maps = {}
        for window in (None, 12):
            (self.dir / "map.llp").unlink(missing_ok=True)
            self.configure(f"{window}.lll", window, more)
            summary, _ = self.fly()
            self.assertTrue(summary["stored"])
            done = self.expect(self.run_leadline("replay", self.dir / f"{window}.lll", "--out", self.dir / str(window)), OK)
            self.assertIn("the same as when it flew", done.stdout)
            maps[window] = [(self.dir / str(window) / name).read_text() for name in ["depth.asc", "sigma.asc"]]
        self.assertGreater(summary["tiles_evicted"], 0)
        self.assertGreater(summary["pings_mapped"], 20 * summary["pings_without_tile"])
        if summary["pings_without_tile"] == 0:  # a disk slower than the flight may cost pings
            self.assertEqual(maps[12], maps[None])

    def test_the_store_of_another_map_is_refused(self):
        self.configure("one.lll")
        self.fly()
        self.toml.write_text(self.toml.read_text().replace("cell_mm = 250", "cell_mm = 200"))
        done = subprocess.run([VEHICLE, "--config", self.toml], capture_output=True, text=True,
                              timeout=PATIENCE_S, check=False)
        self.assertEqual(done.returncode, USAGE, done.stderr)
        self.assertIn("pages of another map", done.stderr)


if __name__ == "__main__":
    unittest.main()

#!/usr/bin/env python3
"""A vehicle with a store: its map survives kills and restarts, may be larger than its window, and its logs
replay without the store."""

import json
import pathlib
import socket
import subprocess
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from contract import OK, OUTPUT, USAGE  # noqa: E402
from store_flight import PATIENCE_S, VEHICLE, StoreCase  # noqa: E402


class Store(StoreCase):
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
            (self.dir / "map.llp").resolve().unlink(missing_ok=True)
            self.configure(f"{window}.lll", window, more)
            summary, _ = self.fly()
            self.assertTrue(summary["stored"])
            # Virtual time waits for the disk, however slow it is.
            self.assertEqual((summary["pings_without_tile"], summary["returns_without_tile"]), (0, 0))
            done = self.expect(self.run_leadline("replay", self.dir / f"{window}.lll", "--out", self.dir / str(window)), OK)
            self.assertIn("the same as when it flew", done.stdout)
            maps[window] = [(self.dir / str(window) / name).read_text() for name in ["depth.asc", "sigma.asc"]]
        self.assertGreater(summary["tiles_evicted"], 0)
        self.assertEqual(maps[12], maps[None])

    def test_a_full_disk_costs_what_has_no_room_and_says_so(self):
        topside = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.addCleanup(topside.close)
        topside.bind(("127.0.0.1", 0))
        topside.setblocking(False)
        # 3 x 6 tiles, of which the window holds 9 and the disk 3.
        self.configure("full.lll", 9, ["--set", "north_count=48"], f"udp:127.0.0.1:{topside.getsockname()[1]}")
        text = self.toml.read_text()
        self.toml.write_text(text.replace("[log]", "# [log]").replace('path = "full.lll"', ""))
        emulator, vehicle = self.start(250_000)
        heard = b""
        while vehicle.poll() is None:
            try:
                heard += topside.recv(65536)
            except BlockingIOError:
                time.sleep(0.01)
        output, errors = vehicle.communicate()
        emulator.communicate()
        self.assertEqual(vehicle.returncode, OUTPUT, errors)
        self.assertIn("pages cannot be saved, mapping goes on", errors)
        self.assertIn(b"Store: the map cannot be saved", heard)
        summary = json.loads(output)
        self.assertFalse(summary["stored"])
        self.assertGreater(summary["saves_failed"], 0)
        self.assertGreater(summary["pings_without_tile"], 0)
        # What waits in vain does not cost those behind it, over tiles that are there.
        self.assertEqual(summary["pings_lost"]["shed"], 0)

    def refused(self, *words):
        done = subprocess.run([VEHICLE, "--config", self.toml], capture_output=True, text=True,
                              timeout=PATIENCE_S, check=False)
        self.assertEqual(done.returncode, USAGE, done.stderr)
        for word in words:
            self.assertIn(word, done.stderr)

    def test_what_is_no_store_of_this_map_is_refused_and_left_alone(self):
        self.configure("one.lll", more=["--set", "north_count=32", "--set", "east_count=32"])
        self.fly()
        text = self.toml.read_text()
        self.toml.write_text(text.replace("cell_mm = 250", "cell_mm = 200"))
        self.refused("map.llp", "pages of another map")
        # Somebody's other file, and one that was cut in the middle of a page.
        (self.dir / "dive.csv").write_text("time,depth\n1,2\n" * 9)
        self.toml.write_text(text.replace("map.llp", "dive.csv"))
        self.refused("dive.csv", "no store of a map")
        self.assertEqual((self.dir / "dive.csv").read_text(), "time,depth\n1,2\n" * 9)
        store = (self.dir / "map.llp").read_bytes()
        (self.dir / "map.llp").write_bytes(store[:100_000])
        self.toml.write_text(text)
        flown, errors = self.fly()
        self.assertIn("not whole", errors)
        self.assertTrue(flown["stored"])
        # Settings that cannot be, each at its line.
        for line, word in (('path = "one.lll"', "another file of this configuration"), ('path = "/dev/null"', "ordinary file"),
                           ('path = "map.llp"\nwindow_tiles = 8', "[store] window_tiles = 8"),
                           ('path = "map.llp"\nwindow_tiles = 4000', "[store] window_tiles = 4000: memory holds")):
            self.toml.write_text(text.replace('path = "map.llp"', line))
            after = self.toml.read_text().split("[store]")
            number = 1 + after[0].count("\n") + len(line.split("\n"))
            self.refused(word, *([] if "null" in line else [f"vehicle.toml:{number}: "]))


if __name__ == "__main__":
    unittest.main()

"""A vehicle with a store, flown by the emulator in virtual time.

Environment: LEADLINE, LEADLINE_VEHICLE. Standard library only.
"""

import json
import os
import pathlib
import resource
import subprocess

from contract import LEADLINE, OK, Case

VEHICLE = os.environ["LEADLINE_VEHICLE"]
PATIENCE_S = 180
# 24 x 24 metres of 0.25 m: 6 x 6 tiles.
FLIGHT = ["--set", "north_count=96", "--set", "east_count=96", "--set", "line_spacing_m=8", "--set",
          "settle_s=2"]


class StoreCase(Case):
    flight_settings = FLIGHT
    drain_s = 2
    patience_s = PATIENCE_S

    def setUp(self):
        super().setUp()
        # Virtual time waits for each page to be safe: a thousand a flight, on the build machine's disk or in memory.
        memory = pathlib.Path("/dev/shm")
        if memory.is_dir() and os.access(memory, os.W_OK):
            (self.dir / "map.llp").symlink_to(memory / f"{self.dir.name}.llp")
            self.addCleanup((memory / f"{self.dir.name}.llp").unlink, missing_ok=True)

    def configure(self, log, window=None, more=(), link="udp:127.0.0.1:9"):
        self.flight = [*self.flight_settings, *more]
        self.expect(self.run_leadline("emulate", *self.flight, "--write-config", self.dir, "--ports",
                                      self.dir / "ports", "--link", link, "--log", log), OK)
        self.toml = self.dir / "vehicle.toml"
        text = self.toml.read_text() + '\n[store]\npath = "map.llp"\n'
        self.toml.write_text(text + (f"window_tiles = {window}\n" if window else ""))

    def start(self, vehicle_limit_bytes=None):
        def limit():
            resource.setrlimit(resource.RLIMIT_FSIZE, (vehicle_limit_bytes, vehicle_limit_bytes))

        def run(*command):
            limited = vehicle_limit_bytes and command[0] == VEHICLE
            process = subprocess.Popen([*map(str, command)], stdout=subprocess.PIPE,
                                       stderr=subprocess.PIPE, text=True, preexec_fn=limit if limited else None)
            self.addCleanup(process.kill)
            return process
        emulator = run(LEADLINE, "emulate", *self.flight, "--ports", self.dir / "ports", "--out", self.out,
                       "--lockstep", self.dir / "clock")
        vehicle = run(VEHICLE, "--config", self.toml, "--clock", f"lockstep:{self.dir}/clock", "--json", "--drain-s", self.drain_s)
        return emulator, vehicle

    def fly(self):
        emulator, vehicle = self.start()
        emulator.communicate(timeout=self.patience_s)
        output, errors = vehicle.communicate(timeout=self.patience_s)
        self.assertEqual(vehicle.returncode, OK, errors)
        return json.loads(output), errors

    def replay(self, log):
        done = self.expect(self.run_leadline("replay", self.dir / log), OK)
        self.assertIn("the same as when it flew", done.stdout)

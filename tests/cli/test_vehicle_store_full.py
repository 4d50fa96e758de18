#!/usr/bin/env python3
"""A map ten times as large as the vehicle's window: the map of one big grid, with a fan, sharp turns and later returns;
and the whole of it at the topside after a tether that was cut in mid flight, while tiles left the window."""

import json
import pathlib
import select
import signal
import socket
import subprocess
import sys
import threading
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from contract import LEADLINE, OK  # noqa: E402
from store_flight import StoreCase  # noqa: E402

PATIENCE_S = 1200
# 15 x 15 tiles of 8 m, and lines so near that the fan reaches over the next ones.
SETTINGS = {"cell_m": 0.5, "north_count": 240, "east_count": 240, "line_spacing_m": 24, "max_range_m": 20, "altitude_m": 8,
            "speed_m_s": 2, "turn_speed_m_s": 2, "turn_rate_deg_s": 90, "run_out_m": 2, "settle_s": 5}
TILES, WINDOW = 225, 23


def settings(**values):
    return [word for key, value in values.items() for word in ("--set", f"{key}={value}")]


class Tether(threading.Thread):
    """UDP between a vehicle, which sends to `port`, and a topside; cut after some datagrams, mended after it lost some."""

    def __init__(self, topside_port, cut_after, mend_after):
        super().__init__(daemon=True)
        self.topside = ("127.0.0.1", topside_port)
        self.down, self.up = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        for side in (self.down, self.up):
            side.bind(("127.0.0.1", 0))
        self.port = self.down.getsockname()[1]
        self.cut_after, self.mend_after = cut_after, mend_after
        self.passed = self.lost = 0
        self.vehicle = None

    def whole(self):
        return self.passed < self.cut_after or self.lost >= self.mend_after

    def run(self):
        while True:
            for side in select.select([self.down, self.up], [], [])[0]:
                try:
                    data, sender = side.recvfrom(65536)
                    if side is self.up and self.whole() and self.vehicle:
                        self.down.sendto(data, self.vehicle)
                    elif side is self.down:
                        self.vehicle = sender
                        self.passed, self.lost = self.passed + self.whole(), self.lost + (not self.whole())
                        if self.whole():
                            self.up.sendto(data, self.topside)
                except OSError:
                    pass


class LargeMap(StoreCase):
    flight_settings = settings(**SETTINGS)
    drain_s = 600
    patience_s = PATIENCE_S

    def one_big_grid(self, **more):
        maps = {}
        for window in (None, WINDOW):
            (self.dir / "map.llp").resolve().unlink(missing_ok=True)
            self.configure(f"{window}.lll", window, settings(**more))
            summary, _ = self.fly()
            self.assertTrue(summary["stored"])
            self.assertEqual((summary["pings_without_tile"], summary["returns_without_tile"]), (0, 0))
            self.expect(self.run_leadline("replay", self.dir / f"{window}.lll", "--out", self.dir / str(window),
                                          timeout_s=PATIENCE_S), OK)
            maps[window] = [(self.dir / str(window) / name).read_text() for name in ["depth.asc", "sigma.asc"]]
        self.assertGreater(summary["tiles_evicted"], 2 * TILES)
        self.assertEqual(maps[WINDOW], maps[None])
        print(f"{more}: {TILES} tiles through {WINDOW}: {summary['tiles_loaded']} loaded, {summary['tiles_evicted']} evicted, "
              f"{summary['pings_mapped']} pings")

    def test_a_fan_and_sharp_turns(self):
        self.one_big_grid(ping360="true")

    def test_later_returns_beside_the_track(self):
        self.one_big_grid(profile="true", max_returns=3, fish_fraction=0.5, tilt_deg=40)

    def test_a_lost_tether(self):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        tether = Tether(port, cut_after=60, mend_after=250)
        tether.start()
        topside = subprocess.Popen([LEADLINE, "receive", "--link", f"udp:@:{port}", "--json"], stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True)
        self.addCleanup(topside.kill)
        self.configure("cut.lll", WINDOW, settings(ping360="true", line_spacing_m=12), f"udp:127.0.0.1:{tether.port}")
        summary, _ = self.fly()
        self.assertTrue(summary["drained"])
        self.assertGreaterEqual(tether.lost, tether.mend_after)
        # Far more tiles than the window holds left while nobody listened.
        self.assertGreater(summary["tiles_evicted"], 2 * TILES)
        time.sleep(0.5)
        topside.send_signal(signal.SIGINT)
        received = json.loads(topside.communicate(timeout=PATIENCE_S)[0])
        self.assertEqual(received["cells_hash"], summary["cells_hash"])
        print(f"tether: {tether.lost} datagrams lost, {received['known_cells']} cells at the topside, the vehicle's hash")


if __name__ == "__main__":
    unittest.main()

#!/usr/bin/env python3
"""`leadline import`: recordings at the ports of a vehicle, whose log replays like any other; and files of
finished soundings."""

import json
import os
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from contract import INPUT, LEADLINE, OK, USAGE  # noqa: E402

DATA = pathlib.Path(os.environ.get(
    "LEADLINE_DATA", pathlib.Path(os.environ["LEADLINE_ROOT"]).parent / "shared" / "data"))


def run(*arguments):
    return subprocess.run([LEADLINE, *map(str, arguments)], capture_output=True, timeout=600)


def ping1d_frame(number, distance_mm):
    """profile (1300): the scan reaches from 0 to 20 m, ten samples."""
    payload = struct.pack("<IHHIIIIH", distance_mm, 90, 100, number, 0, 20000, 3, 10) + bytes(10)
    frame = b"BR" + struct.pack("<HHBB", len(payload), 1300, 1, 0) + payload
    return frame + struct.pack("<H", sum(frame) & 0xFFFF)


def viewer_text(text):
    return struct.pack(">I", len(text)) + text.encode()


def viewer_log(frames):
    """(time of day in s, frame) as ping-viewer writes them."""
    out = viewer_text("PingViewer sensor log file") + struct.pack(">i", 1)
    for text in ("0123abc", "2026-01-02", "v2.4", "linux", "6.1"):
        out += viewer_text(text)
    out += struct.pack(">ii", 1, 1)
    for t_s, frame in frames:
        ms = round(t_s * 1000)
        stamp = f"{ms // 3600000:02}:{ms // 60000 % 60:02}:{ms // 1000 % 60:02}.{ms % 1000:03}"
        out += viewer_text(stamp) + struct.pack(">I", len(frame)) + frame
    return out


def sentence(text):
    check = 0
    for byte in text.encode():
        check ^= byte
    return f"${text}*{check:02X}\r\n".encode()


class ImportLog(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.path = pathlib.Path(self.folder.name)
        small = ["--set", "north_count=40", "--set", "east_count=40", "--set", "line_spacing_m=10",
                 "--set", "settle_s=2"]
        self.assertEqual(run("simulate", "--out", self.path / "sim", *small).returncode, OK)
        self.config = self.path / "sim" / "vehicle.toml"
        # Ports of that vehicle: three Ping1D heads, attitude, fix, pressure.
        self.frames = [(3600.0 + k / 10, ping1d_frame(k, 9000 + 10 * k)) for k in range(100)]
        (self.path / "sonar.bin").write_bytes(viewer_log(self.frames))
        lat_lon = self.config.read_text().split("[frame]")[1].split("\n")[1:3]
        lat, lon = (float(line.split("=")[1]) for line in lat_lon)
        self.write_raw("attitude.txt", "PASHR,120000.00,000.00,T,+00.00,+00.00,+00.00,0.1,0.1,0.1,1")
        self.write_raw("fix.txt", f"GPGGA,120000.00,{self.dms(abs(lat), 2)},{'NS'[lat < 0]},"
                       f"{self.dms(abs(lon), 3)},{'EW'[lon < 0]},4,12,0.5,1.0,M,0.0,M,,")
        self.write_raw("pressure.txt", "PRVAT,00.000,M,0012.00,dBar")
        self.records = ["--record", f"0={self.path / 'sonar.bin'}"]
        for port, name in ((3, "attitude"), (4, "fix"), (5, "pressure")):
            self.records += ["--record", f"{port}={self.path / name}.txt"]

    @staticmethod
    def dms(degrees, digits):
        return f"{int(degrees):0{digits}}{(degrees - int(degrees)) * 60:010.7f}"

    def write_raw(self, name, text):
        line = sentence(text)
        # About ten seconds of a line of 1000 bytes a second.
        (self.path / name).write_bytes(line * (10500 // len(line)))

    def imported(self, *more):
        return run("import", "--config", self.config, *self.records, "--byte-rate", "1000",
                   "--out", self.path / "survey.lll", *more)

    def test_log_replays_to_the_same_map(self):
        done = self.imported("--json")
        self.assertEqual(done.returncode, OK, done.stderr.decode())
        summary = json.loads(done.stdout)
        self.assertEqual(summary["pings_in"], len(self.frames))
        self.assertGreater(summary["pings_fused"], 80)
        self.assertEqual(summary["recorded_origin_us"], 3600 * 10**6)
        replay = run("replay", self.path / "survey.lll", "--json")
        self.assertEqual(replay.returncode, OK, replay.stderr.decode())
        self.assertEqual(json.loads(replay.stdout)["pings_fused"], summary["pings_fused"])
        first = (self.path / "survey.lll").read_bytes()
        self.assertEqual(self.imported().returncode, OK)
        self.assertEqual((self.path / "survey.lll").read_bytes(), first)

    def test_a_shift_moves_a_recording(self):
        # The head comes on a minute into the rest: timed pieces count from the earliest of them, so that a
        # second timed recording is needed to show it.
        self.records += ["--record", f"1={self.path / 'sonar.bin'}", "--shift", "1=60"]
        done = self.imported("--json")
        self.assertEqual(done.returncode, OK, done.stderr.decode())
        summary = json.loads(done.stdout)
        self.assertEqual(summary["pings_in"], 2 * len(self.frames))
        self.assertGreater(summary["flown_us"], 69 * 10**6)

    def test_bad_options_are_named(self):
        for more, text in ((["--record", "9=x"], "0 to 5"), (["--record", "x"], "N=..."),
                           (["--shift", "2=5"], "no --record"), (["--shift", "0=soon"], "seconds"),
                           (["--record", "1=" + str(self.path / "sonar.bin"),
                             "--shift", "1=1e10"], "--shift")):
            done = self.imported(*more)
            self.assertEqual(done.returncode, USAGE, more)
            self.assertIn(text, done.stderr.decode())
        self.assertFalse((self.path / "survey.lll").exists())
        done = self.imported("--record", "1=/no/such.bin")
        self.assertEqual(done.returncode, INPUT)
        self.assertEqual(run("import", "--out", self.path / "x").returncode, USAGE)


class ImportSoundings(unittest.TestCase):
    def test_a_day_on_a_lake(self):
        raw = DATA / "survey_lake_caputh_m9" / "raw"
        if not raw.exists():
            self.skipTest("survey_lake_caputh_m9 is not there")
        with tempfile.TemporaryDirectory() as folder:
            pings = pathlib.Path(folder) / "pings.csv"
            done = run("import", raw / "20250117161408.sum", "--out", pings)
            self.assertEqual(done.returncode, OK, done.stderr.decode())
            rows = pings.read_text().splitlines()
            # 1261 lines of the file, five beams each, less those that found nothing.
            self.assertEqual(len(rows), 6304)

    def test_other_files_are_refused(self):
        with tempfile.TemporaryDirectory() as folder:
            source = pathlib.Path(folder) / "a.sum"
            source.write_text("Sample #,Date/Time\n")
            done = run("import", source, "--out", pathlib.Path(folder) / "pings.csv")
            self.assertEqual(done.returncode, INPUT)
            self.assertIn("a.sum", done.stderr.decode())


if __name__ == "__main__":
    unittest.main()

#!/usr/bin/env python3
"""`leadline import` flown end to end on every container that it reads: a DeltaT's .83P beside a candump, a Surveyor's
.svlog beside a MAVLink .tlog, an R2Sonic's XTF. The devices' bytes are the emulators' own, wrapped as other programs
keep them; real recordings are flown besides where they are ($LEADLINE_DATA)."""

import json
import os
import pathlib
import re
import select
import socket
import struct
import subprocess
import sys
import threading
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from vehicle import GRID, LEADLINE, Case, nmea  # noqa: E402

DATA = pathlib.Path(os.environ.get(
    "LEADLINE_DATA", pathlib.Path(os.environ["LEADLINE_ROOT"]).parent / "shared" / "data"))
T0_US = 1_760_000_000_000_000  # of what is made here
SECONDS = 12
STILL = ["--swing", "0", "--bottom", "6", "--depth", "4"]


def run(*arguments):
    return subprocess.run([LEADLINE, *map(str, arguments)], capture_output=True, timeout=600, check=False)


class Containers(Case):
    def emulated(self, device, seconds=SECONDS):
        """What a device that talks by itself says."""
        path = self.dir / f"{device}.raw"
        done = run("emulate", device, "--port", f"file:{path}", "--seconds", seconds, "--speed", 20, *STILL)
        self.assertEqual(done.returncode, 0, done.stderr.decode())
        return path.read_bytes()

    def asked(self, device, model):
        """What a device says that waits to be asked, overheard between it and `probe`."""
        emulator = subprocess.Popen([LEADLINE, "emulate", device, "--model", model, "--port", "tcp:@:0", *STILL],
                                    stderr=subprocess.PIPE, text=True)
        self.addCleanup(emulator.communicate)
        self.addCleanup(emulator.kill)
        port = int(re.search(r"tcp:\S*?:(\d+)", emulator.stderr.readline()).group(1))
        said = bytearray()
        ear = socket.create_server(("127.0.0.1", 0))
        self.addCleanup(ear.close)

        def relay():
            asker, _ = ear.accept()
            with asker, socket.create_connection(("127.0.0.1", port)) as other:
                while True:
                    for ready in select.select([asker, other], [], [])[0]:
                        data = ready.recv(65536)
                        if not data:
                            return
                        if ready is other:
                            said.extend(data)
                        (asker if ready is other else other).sendall(data)
        thread = threading.Thread(target=relay, daemon=True)
        thread.start()
        done = run("probe", f"tcp:127.0.0.1:{ear.getsockname()[1]}", "--driver", device, "--ask", "--model", model,
                   "--seconds", 4, "--json")
        thread.join(10)
        self.assertEqual(done.returncode, 0, done.stderr.decode())
        return bytes(said)

    def write(self, name, data):
        (self.dir / name).write_bytes(data)
        return self.dir / name

    def fly(self, ports, *more):
        """Imports; `ports`: (driver, keys, recording). Returns the summary, and the decoded poses' count."""
        heads = {"deltat83p", "cerulean", "r2sonic", "ping1d"}
        text = (GRID + "[sonar]\nmax_range_mm = 30000\n[frame]\nlat = 54.3\nlon = 10.2\n"
                '[[mount]]\nname = "down"\ntable = "beam.llt"\n[link]\nuri = "udp:127.0.0.1:9"\n'
                '[log]\npath = "unused.lll"\n')
        records = []
        for number, (driver, keys, recording) in enumerate(ports):
            text += f'[[port]]\nuri = "udp:@:{9000 + number}"\ndriver = "{driver}"\n{keys}\n'
            text += 'mount = "down"\n' if driver in heads else ""
            records += ["--record", f"{number}={recording}"] if recording else []
        (self.dir / "import.toml").write_text(text)
        log = self.dir / "flown.lll"
        done = run("import", "--config", self.dir / "import.toml", *records, "--out", log, "--json", *more)
        self.assertEqual(done.returncode, 0, done.stderr.decode())
        replay = run("replay", log, "--out", self.dir / "map", "--json")
        self.assertEqual(replay.returncode, 0, replay.stderr.decode())
        self.assertIs(json.loads(replay.stdout)["same_as_flight"], True)
        return json.loads(done.stdout)

    def depths(self):
        """Of the cells that are known, metres below the zero of depth."""
        words = (self.dir / "map" / "depth.asc").read_text().split()
        head = {words[i].lower(): words[i + 1] for i in range(0, 12, 2)}
        return [float(word) for word in words[12:] if word != head["nodata_value"]]

    def check_bottom(self):
        depths = sorted(abs(depth) for depth in self.depths())
        self.assertGreater(len(depths), 20)
        # 6 m of water below a device that is 4 m down; within half a cell.
        self.assertAlmostEqual(depths[len(depths) // 2], 10.0, delta=0.25)

    def fixes(self):
        # A place, with the attitude and the pressure of a vehicle that is level, 4 m down.
        dbar = (101325 + 1029 * 9.80665 * 4) / 1e4
        one = (nmea("GPGGA,120000.00,5418.0000,N,01012.0000,E,4,12,0.5,1.0,M,0.0,M,,") +
               nmea(f"PRVAT,00.000,M,{dbar:09.4f},dBar") +
               nmea("PASHR,120000.00,045.00,T,+00.00,+00.00,+00.00,0.1,0.1,0.1,1"))
        return one

    def lines_at(self, rate_bytes_s):
        one = self.fixes()
        return one * (SECONDS * rate_bytes_s // len(one))

    def test_an_83p_beside_a_candump(self):
        sonar = self.write("line.83P", self.emulated("deltat83p"))
        frames = self.emulated("nmea2000")
        self.assertEqual(len(frames) % 16, 0)
        lines = []
        for i in range(len(frames) // 16):
            can_id, size, data = struct.unpack("<IB3x8s", frames[16 * i:16 * i + 16])
            t_s = T0_US / 1e6 + SECONDS * i / (len(frames) // 16)
            lines.append(f"({t_s:.6f}) can0 {can_id & 0x1FFFFFFF:08X}#{data[:size].hex().upper()}\n")
        candump = self.write("bus.log", "".join(lines).encode())
        rate = sonar.stat().st_size // SECONDS
        summary = self.fly([("deltat83p", "true_heading = true", sonar),
                            ("nmea2000", "true_heading = true", candump)],
                           "--byte-rate", rate)
        self.assertGreater(summary["pings_in"], 1000)
        self.assertGreater(summary["pings_fused"], summary["pings_in"] // 2)
        self.assertEqual(summary["recorded_origin_us"], T0_US)
        self.check_bottom()

    def test_an_svlog_beside_a_tlog(self):
        sonar = self.write("dive.svlog", self.asked("cerulean", "surveyor"))
        frames, tlog, t_us = self.emulated("mavlink"), b"", T0_US
        at, count = 0, 0
        while at < len(frames):
            self.assertEqual(frames[at], 0xFD)
            size = frames[at + 1] + (25 if frames[at + 2] & 1 else 12)
            tlog += struct.pack(">Q", T0_US + 20_000 * count) + frames[at:at + size]
            at, count = at + size, count + 1
        rate = max(sonar.stat().st_size // SECONDS, 1)
        place = nmea("GPGGA,120000.00,5418.0000,N,01012.0000,E,4,12,0.5,1.0,M,0.0,M,,")
        where = self.write("place.txt", place * (SECONDS * rate // len(place)))
        summary = self.fly([("cerulean", 'model = "surveyor"', sonar),
                            ("mavlink", "", self.write("dive.tlog", tlog)),
                            ("nmea", "", where)], "--byte-rate", rate)
        self.assertGreater(summary["pings_in"], 500)
        self.assertGreater(summary["pings_fused"], summary["pings_in"] // 2)
        self.assertEqual(summary["recorded_origin_us"], T0_US)
        self.check_bottom()

    def test_the_real_telemetry_log_flies(self):
        tlog = DATA / "ardusub_logs" / "testing_small.tlog"
        if not tlog.exists():
            self.skipTest("ardusub_logs is not there")
        summary = self.fly([("mavlink", "", tlog)])
        self.assertEqual(summary["pings_in"], 0)
        self.assertGreater(summary["recorded_bytes"], 1_000_000)
        self.assertGreater(summary["recorded_origin_us"], 1_600_000_000_000_000)

    def test_a_real_candump_flies(self):
        candump = DATA / "nmea2000_canboat" / "raw" / "candumpSample3.txt"
        if not candump.exists():
            self.skipTest("nmea2000_canboat is not there")
        summary = self.fly([("nmea2000", "", candump)])
        self.assertGreater(summary["recorded_bytes"], 10_000)

    def test_a_real_xtf_is_mapped_by_the_vehicle(self):
        xtf = DATA / "multibeam_r2sonic2026_sfbay" / "raw" / "first550pings.xtf"
        if not xtf.exists():
            self.skipTest("multibeam_r2sonic2026_sfbay is not there")
        summary = self.fly([("r2sonic", "", xtf)])
        # No position in what `import` takes of an XTF: every beam is accounted for, none has a pose.
        self.assertEqual(summary["pings_in"], 140_800)
        self.assertEqual(summary["pings_fused"], 0)


if __name__ == "__main__":
    unittest.main()

#!/usr/bin/env python3
"""Whole vehicles in real time on real ptys, UDP and TCP sockets and Modbus RTU, every device emulated by a program
of its own at ten times its rate, each of which is killed and started again at random: a pulled plug, a peer that is
gone. In the end every record is accounted for, and memory and descriptors are what they were.

LEADLINE_TRANSPORT_SOAK_S: how long (default 20, one vehicle with a device of each transport; from 60 on three
vehicles side by side with every emulated device). CAN and GPIO are tested in a user-mode kernel
(test_kernel_buses_ci.sh); here NMEA 2000's frames come as datagrams."""

import json
import os
import pathlib
import random
import signal
import socket
import subprocess
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from vehicle import GRID, LEADLINE, VEHICLE, Case  # noqa: E402

SECONDS = float(os.environ.get("LEADLINE_TRANSPORT_SOAK_S", "20"))
LONG = SECONDS >= 60
HEADS = {"ping1d", "ping360", "cerulean", "imagenex", "tritech", "deltat83p", "r2sonic", "wl3d"}

# Device, transport, keys of its port, options of its emulator. "asked" devices listen, others send.
MIXED = [
    ("ping1d", "pty", "interval_ms = 10", []),
    ("nmea", "pty", "", []),
    ("ping360", "udp asked", "", []),
    ("cerulean", "tcp", 'model = "surveyor"\ninterval_ms = 20', ["--model", "surveyor"]),
    ("r2sonic", "udp", "", []),
    ("pd0", "tcp", "", []),
    ("vectornav", "pty", "", []),
    ("keller", "modbus", "interval_ms = 20", []),
]
ASKED = [
    ("ping1d", "udp asked", "interval_ms = 10", []),
    ("nmea", "pty", "", []),
    ("ping360", "pty", "", []),
    ("cerulean", "tcp", 'model = "omniscan3d"\ninterval_ms = 20', ["--model", "omniscan3d"]),
    ("imagenex", "pty", 'model = "852_scanner"\ninterval_ms = 20', ["--model", "852_scanner"]),
    ("tritech", "pty", 'model = "imaging"', ["--model", "imaging"]),
    ("trax", "pty", "interval_ms = 20", []),
    ("keller", "modbus", "interval_ms = 20", []),
]
MULTIBEAMS = [
    ("deltat83p", "udp", "", []),
    ("nmea", "udp", "", []),
    ("r2sonic", "udp", "", []),
    ("wl3d", "udp", "", []),
    ("vectornav", "pty", "", []),
    ("xsens", "pty", "", []),
    ("tss1", "pty", "", []),
    ("pd0", "tcp", "", []),
]
BUSES = [
    ("ping1d", "pty", "interval_ms = 10", []),
    ("nmea", "tcp", "", []),
    ("wldvl", "tcp", "", []),
    ("mavlink", "udp", "", []),
    ("nmea2000", "udp", "", []),
]


def free_port(kind):
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def status_of(pid):
    """Resident KiB and open descriptors."""
    text = pathlib.Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    kib = next(int(line.split()[1]) for line in text.splitlines() if line.startswith("VmRSS:"))
    return kib, len(os.listdir(f"/proc/{pid}/fd"))


class Device:
    """An emulator that dies and comes back."""

    def __init__(self, name, transport, options, path, chance):
        self.name, self.chance, self.starts, self.link = name, chance, 0, path
        udp, tcp = (free_port(kind) for kind in (socket.SOCK_DGRAM, socket.SOCK_STREAM))
        here, there = {
            "pty": (f"pty:{path}", f"serial:{path}:115200"),
            "modbus": (f"pty:{path}", f"modbus-rtu:{path}:19200:8N1@1"),
            "udp": (f"udp:127.0.0.1:{udp}", f"udp:@:{udp}"),
            "udp asked": (f"udp:@:{udp}", f"udp:127.0.0.1:{udp}"),
            "tcp": (f"tcp:@:{tcp}", f"tcp:127.0.0.1:{tcp}"),
        }[transport]
        self.uri = there
        # Ten images a second are what a vehicle takes of a 3D-15 beside seven others; a hundred are 3 MB/s.
        speed = "1" if name == "wl3d" else "10"
        self.command = [LEADLINE, "emulate", name, "--port", here, "--speed", speed, *options]
        self.process, self.due = None, 0.0

    def step(self, now):
        if now < self.due:
            return
        if self.process is None:
            self.starts += 1
            seed = str(self.chance.randrange(1 << 30))
            self.process = subprocess.Popen([*self.command, "--seed", seed, "--drop", "0.00001", "--corrupt",
                                             "0.00001"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            self.due = now + self.chance.uniform(2.0, 20.0 if LONG else 8.0)
        else:
            self.stop()
            self.due = now + self.chance.uniform(0.05, 2.0)

    def stop(self):
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            self.process = None
            # The adapter's name goes with it: its number may be another pty's by now.
            self.link.unlink(missing_ok=True)


class Ship:
    def __init__(self, case, name, rows, seed):
        self.case, self.name = case, name
        chance = random.Random(seed)
        self.folder = case.dir / name
        self.folder.mkdir()
        (self.folder / "beam.llt").write_bytes((case.dir / "beam.llt").read_bytes())
        self.devices = [Device(device, transport, options, self.folder / f"{i}-{device}", chance)
                        for i, (device, transport, _, options) in enumerate(rows)]
        text = (GRID + "[sonar]\nmax_range_mm = 30000\n[frame]\nlat = 54.3\nlon = 10.2\n"
                '[[mount]]\nname = "down"\ntable = "beam.llt"\n'
                f'[link]\nuri = "udp:127.0.0.1:{case.topside.getsockname()[1]}"\n')
        for device, (driver, _, keys, _) in zip(self.devices, rows):
            text += f'[[port]]\nuri = "{device.uri}"\ndriver = "{driver}"\noptional = true\n{keys}\n'
            text += 'mount = "down"\n' if driver in HEADS else ""
        # A log in the short run, to be flown again; ten minutes of ten times everything are for no disk.
        text += "" if LONG else '[log]\npath = "survey.lll"\n'
        (self.folder / "vehicle.toml").write_text(text)
        self.said = open(self.folder / "said", "wb")
        case.addCleanup(self.said.close)
        self.process = subprocess.Popen([VEHICLE, "--config", str(self.folder / "vehicle.toml"), "--priority", "0",
                                         "--json"],
                                        stdout=subprocess.PIPE, stderr=self.said, text=True)
        case.processes.append(self.process)

    def settle(self):
        """Until it has the descriptors that it has without any device: twice the same number."""
        before = 0
        while before != (now := status_of(self.process.pid)[1]):
            self.case.assertIsNone(self.process.poll(), (self.folder / "said").read_text())
            before = now
            time.sleep(1.0)
        self.alone, self.most = now, now

    def step(self, now):
        for device in self.devices:
            device.step(now)
        self.case.assertIsNone(self.process.poll(), (self.folder / "said").read_text())
        self.most = max(self.most, status_of(self.process.pid)[1])

    def finish(self):
        for device in self.devices:
            device.stop()
        self.process.send_signal(signal.SIGINT)
        out, _ = self.process.communicate(timeout=180)
        self.case.assertEqual(self.process.returncode, 0, (self.folder / "said").read_text())
        summary = json.loads(out)
        for device, port in zip(self.devices, summary["ports"]):
            print(f"  {port['driver']:<10} {port['bytes']:>11} bytes {port['records']:>9} records "
                  f"{port['rejected']:>6} rejected {device.starts:>4} starts  {device.uri.split(':')[0]}")
        lost, outcomes = summary["pings_lost"], summary["pings"]
        print(f"  pings in {summary['pings_in']} = mapped {summary['pings_mapped']} + lost {sum(lost.values())} "
              f"(shed {lost['shed']}) + pending {summary['pings_pending']}; samples {summary['nav_samples']}; "
              f"cycles {summary['cycles']}, longest {summary['cycle_max_us'] / 1e3:.1f} ms")
        return summary

    def check(self, summary):
        equal = self.case.assertEqual
        records = sum(port["records"] for port in summary["ports"])
        equal(records, summary["pings_in"] + summary["nav_samples"] + summary["line_records"])
        equal(summary["pings_in"], summary["pings_mapped"] + sum(summary["pings_lost"].values())
              + summary["pings_pending"])
        equal(summary["pings_mapped"], sum(summary["pings"].values()))
        equal(summary["pings_pending"], 0)
        self.case.assertGreater(summary["pings_mapped"], 0)
        for device, port in zip(self.devices, summary["ports"]):
            self.case.assertGreater(port["records"], 0, device.name)
        if not LONG:
            replayed = subprocess.run([LEADLINE, "replay", str(self.folder / "survey.lll"), "--out",
                                       str(self.folder / "again"), "--json"], capture_output=True, text=True, check=False)
            equal(replayed.returncode, 0, replayed.stderr)
            equal(json.loads(replayed.stdout)["same_as_flight"], True, replayed.stdout)


class Soak(Case):
    def test_every_record_is_accounted_for_on_lines_that_break(self):
        rows = [("asked", ASKED), ("multibeams", MULTIBEAMS), ("buses", BUSES)] if LONG else [("mixed", MIXED)]
        ships = [Ship(self, name, devices, seed) for seed, (name, devices) in enumerate(rows, 1)]
        for ship in ships:
            for device in ship.devices:
                self.addCleanup(device.stop)
        for ship in ships:
            ship.settle()
        begin = time.monotonic()
        warm, report = {}, 60.0
        while (elapsed := time.monotonic() - begin) < SECONDS:
            for ship in ships:
                ship.step(time.monotonic())
            self.listen()
            self.received = b""
            if not warm and elapsed > SECONDS / 2 and elapsed > 10:
                warm = {ship.name: status_of(ship.process.pid) for ship in ships}
            if elapsed >= report:
                report += 60.0
                print(f"reached {elapsed:.0f} s: " + ", ".join(
                    f"{ship.name} %d KiB, %d descriptors" % status_of(ship.process.pid) for ship in ships), flush=True)
            time.sleep(0.02)
        for ship in ships:
            for device in ship.devices:
                device.stop()
        for ship in ships:
            patience = time.monotonic() + 20
            while status_of(ship.process.pid)[1] > ship.alone and time.monotonic() < patience:
                time.sleep(0.2)
        ends = {ship.name: status_of(ship.process.pid) for ship in ships}
        summaries = [(ship, ship.finish()) for ship in ships]
        for ship, summary in summaries:
            ship.check(summary)
        for ship in ships:
            (kib, descriptors), warm_kib = ends[ship.name], warm[ship.name][0]
            print(f"{ship.name}: memory {warm_kib} -> {kib} KiB; descriptors {ship.alone} without devices, at most "
                  f"{ship.most}, {descriptors} in the end")
            # Tiles of the map that are first written later are pages that are first touched later.
            self.assertLess(kib - warm_kib, 4096 + warm_kib // 20)
            self.assertLessEqual(descriptors, ship.alone)
            self.assertLessEqual(ship.most, ship.alone + len(ship.devices))
        print(f"{SECONDS:.0f} s, {sum(d.starts for ship in ships for d in ship.devices)} starts of devices")


if __name__ == "__main__":
    unittest.main()

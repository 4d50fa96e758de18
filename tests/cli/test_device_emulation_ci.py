#!/usr/bin/env python3
"""`leadline emulate DEVICE` played into a pty, a socket or a file, and what `leadline probe` and `leadline
decode` make of it: the scene's own values, through each device's protocol."""

import json
import math
import pathlib
import re
import select
import signal
import socket
import subprocess
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from contract import INPUT, LEADLINE, OK, USAGE, Case  # noqa: E402

PATIENCE_S = 180  # nothing here asserts how long something took

BOTTOM_M, DEPTH_M, ROLL_DEG, PITCH_DEG, HEADING_DEG, SPEED_M_S = 6.0, 12.0, 3.0, -2.0, 45.0, 0.5
STILL = ["--swing", 0, "--bottom", BOTTOM_M, "--depth", DEPTH_M, "--roll", ROLL_DEG, "--pitch",
         PITCH_DEG, "--heading", HEADING_DEG]
PRESSURE_PA = 101325 + 1029 * 9.80665 * DEPTH_M

ROLL, PITCH = math.radians(ROLL_DEG), math.radians(PITCH_DEG)


def down_part(forward, right, down):
    """Of a direction in the vehicle's frame: how much of it points down."""
    return (-math.sin(PITCH) * forward + math.sin(ROLL) * math.cos(PITCH) * right +
            math.cos(ROLL) * math.cos(PITCH) * down)


def across_m(angle_deg):
    """Range of a beam `angle_deg` to starboard from straight below."""
    angle = math.radians(angle_deg)
    return BOTTOM_M / down_part(0.0, math.sin(angle), math.cos(angle))


def body_velocity():
    """Level motion along the heading, in the vehicle's frame."""
    return [SPEED_M_S * math.cos(PITCH), SPEED_M_S * math.sin(PITCH) * math.sin(ROLL),
            SPEED_M_S * math.sin(PITCH) * math.cos(ROLL)]


# A record that the device has to bring, and its values: key, value, tolerance (half of the wire's step and
# what its formulas lose).
ATTITUDE = ("attitude", {"roll_deg": (ROLL_DEG, 0.06), "pitch_deg": (PITCH_DEG, 0.06)})
WITH_HEADING = ("attitude", {**ATTITUDE[1], "heading_deg": (HEADING_DEG, 0.06)})
PRESSURE = ("pressure", {"pressure_pa": (PRESSURE_PA, 60)})
VELOCITY = ("velocity", {"velocity_m_s": (body_velocity(), 0.002)})
SOUNDER = ("depth", {"depth_below_transducer_m": (BOTTOM_M, 0.006), "altitude_m": (BOTTOM_M, 0.006)})

TALKERS = {
    "deltat83p": [("fan", 0.04), WITH_HEADING],
    "r2sonic": [("fan", 0.001)],
    "wl3d": [("camera", 0.002)],
    "nmea": [WITH_HEADING, ("heading", {"heading_deg": (HEADING_DEG, 0.001)}), SOUNDER,
             ("altitude", {"altitude_m": (BOTTOM_M, 0.001), "pressure_pa": (PRESSURE_PA, 6)}),
             ("position", {"latitude_deg": (54.3, 0.001), "longitude_deg": (10.2, 0.001)})],
    "tss1": [ATTITUDE],
    "vectornav": [WITH_HEADING],
    "xsens": [WITH_HEADING],
    "wldvl": [VELOCITY, ("velocity", {"altitude_m": (BOTTOM_M, 0.01)})],
    "pd0": [VELOCITY, ("altitude", {"altitude_m": (BOTTOM_M, 0.03)}), WITH_HEADING,
            ("depth", {"depth_m": (DEPTH_M, 0.1)})],
    "nmea2000": [ATTITUDE, ("heading", {"heading_deg": (HEADING_DEG, 0.01)}), SOUNDER,
                 PRESSURE, ("position", {"latitude_deg": (54.3, 0.001)})],
    "mavlink": [WITH_HEADING, PRESSURE, ("altitude", {"altitude_m": (BOTTOM_M, 0.01)})],
}

# Devices that wait to be asked: (driver, model) -> what comes.
ASKED = {
    ("ping1d", None): [("sounder", 0.02)],
    ("ping360", None): [("scan", 0.03)],
    ("cerulean", "surveyor"): [("fan", 0.002), ATTITUDE],
    ("cerulean", "omniscan3d"): [("fan", 0.002), ATTITUDE],
    ("cerulean", "s500"): [("profile", 0.03)],
    ("imagenex", "852_sounder"): [("profile", 0.03)],
    ("imagenex", "881a"): [("scan", 0.05)],
    ("tritech", "imaging"): [("scan", 0.06)],
    ("trax", None): [WITH_HEADING],
    ("keller", None): [PRESSURE],
}


class Emulation(Case):
    def play(self, device, port, *options):
        """A device that plays until the test is over; its first words say where."""
        process = subprocess.Popen(
            [LEADLINE, "emulate", device, "--port", port, *map(str, options)],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.addCleanup(process.communicate)
        self.addCleanup(process.kill)
        ready, _, _ = select.select([process.stderr], [], [], PATIENCE_S)
        self.assertTrue(ready, "the emulator says nothing")
        said = process.stderr.readline()
        self.assertIn(f"emulate: {device} at ", said, said + (process.stderr.read() if not said else ""))
        return process, re.search(r" at (\S+?),? ?(waits .*)?$", said.strip()).group(1)

    def probe(self, uri, *options):
        done = self.run_leadline("probe", uri, "--json", *options)
        lines = [json.loads(line) for line in done.stdout.splitlines()]
        return done, [line for line in lines if line["record"] != "summary"], [
            line for line in lines if line["record"] == "summary"]

    # ---- What has to come

    def check_beams(self, pings, tolerance_m, enough, expected_m):
        beams = [(expected_m(ping, i), range_mm) for ping in pings
                 for i, range_mm in enumerate(ping["range_mm"]) if range_mm is not None]
        self.assertGreaterEqual(len(beams), enough)
        for expected, range_mm in beams:
            self.assertAlmostEqual(range_mm / 1e3, expected, delta=tolerance_m)

    def check_profiles(self, pings, tolerance_m, across):
        """The loudest sample of each ping that has an echo."""
        found = 0
        for ping in pings:
            samples = ping["samples"]
            if max(samples) < 2 * sorted(samples)[len(samples) // 2]:
                continue
            found += 1
            # A scanner's forward axis looks down.
            angle_deg = ping["azimuth_deg"] if across and ping["elevation_deg"] != 90 else 0.0
            heard_m = (ping["first_sample_mm"] + samples.index(max(samples)) * ping["sample_mm"]) / 1e3
            self.assertAlmostEqual(heard_m, across_m(angle_deg), delta=tolerance_m)
        return found

    def camera_m(self, ping, i):
        azimuth, elevation = math.radians(ping["azimuth_deg"][i]), math.radians(ping["elevation_deg"][i])
        # Its forward looks down, its up to the bow.
        return BOTTOM_M / down_part(-math.sin(elevation), math.cos(elevation) * math.sin(azimuth),
                                    math.cos(elevation) * math.cos(azimuth))

    def check_record(self, found, kind, values):
        mine = [record for record in found if record["record"] == kind]
        self.assertTrue(mine, f"no {kind} among {sorted({r['record'] for r in found})}")
        for record in mine:
            self.assertTrue(record["valid"], record)
            for key, (expected, tolerance) in values.items():
                pairs = zip(record[key], expected) if isinstance(expected, list) else [
                    (record[key], expected)]
                for value, wanted in pairs:
                    self.assertAlmostEqual(value, wanted, delta=tolerance, msg=f"{key} of {record}")

    def check(self, found, expectations):
        pings = [record for record in found if record["record"] == "ping"]
        for what, value in expectations:
            if what == "fan":
                self.check_beams(pings, value, 30, lambda ping, i: across_m(ping["angle_deg"][i]))
            elif what == "camera":
                self.check_beams(pings[:1], value, 10000, self.camera_m)
            elif what == "sounder":
                self.check_beams(pings, value, 3, lambda ping, i: across_m(0.0))
            elif what == "profile":
                self.assertGreaterEqual(self.check_profiles(pings, value, False), 3)
            elif what == "scan":
                self.assertGreaterEqual(self.check_profiles(pings, value, True), 1)
            else:
                self.check_record(found, what, value)

    # ---- Devices that talk by themselves

    def file_of(self, device, *options):
        path = self.dir / f"{device}.bin"
        self.expect(self.run_leadline("emulate", device, "--port", f"file:{path}", "--seconds", 4,
                                      "--speed", 50, *STILL, *options), OK)
        return path

    def test_talkers_are_recognised_with_their_values(self):
        for device, expectations in TALKERS.items():
            with self.subTest(device):
                path = self.file_of(device)
                # CAN frames have no mark of their own.
                named = ["--driver", device] if device == "nmea2000" else []
                done, found, summaries = self.probe(f"file:{path}", *named)
                self.expect(done, OK)
                self.assertEqual([summary["driver"] for summary in summaries], [device])
                self.assertEqual(summaries[0]["rejected"], {})
                self.check(found, expectations)

    def test_decode_reads_what_was_played(self):
        for device, expectations in TALKERS.items():
            if device == "nmea2000":  # decode wants candump
                continue
            with self.subTest(device):
                done = self.expect(self.run_leadline("decode", "--driver", device,
                                                     self.file_of(device), "--json"), OK)
                lines = [json.loads(line) for line in done.stdout.splitlines()]
                self.assertEqual(lines[-1]["rejected"], {})
                self.check(lines[:-1], expectations)

    def test_a_pty_live(self):
        link = self.dir / "imu"
        process, uri = self.play("vectornav", f"pty:{link}", *STILL)
        self.assertEqual(uri, f"serial:{link}")
        done, found, summaries = self.probe(uri, "--seconds", 1)
        self.expect(done, OK)
        self.assertEqual([summary["driver"] for summary in summaries], ["vectornav"])
        self.check(found, [WITH_HEADING])
        process.send_signal(signal.SIGINT)
        self.assertEqual(process.wait(PATIENCE_S), OK)
        self.assertIn("vectornav: ", process.stdout.read())
        self.assertFalse(link.is_symlink())

    def test_a_datagram_each(self):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as here:
            here.bind(("127.0.0.1", 0))
            here.settimeout(PATIENCE_S)
            self.play("r2sonic", f"udp:127.0.0.1:{here.getsockname()[1]}")
            for _ in range(3):
                packet = here.recv(65536)
                self.assertEqual(packet[:4], b"BTH0")
                self.assertEqual(int.from_bytes(packet[4:8], "big"), len(packet))

    def test_a_vehicle_that_moves(self):
        path = self.dir / "tss1.bin"
        self.expect(self.run_leadline("emulate", "tss1", "--port", f"file:{path}", "--seconds", 20,
                                      "--speed", 100, "--swing", 5), OK)
        _, found, _ = self.probe(f"file:{path}")
        rolls = [record["roll_deg"] for record in found]
        self.assertEqual(len(rolls), 400)
        self.assertAlmostEqual(max(rolls), 5.0, delta=0.05)
        self.assertAlmostEqual(min(rolls), -5.0, delta=0.05)

    # ---- Devices that wait

    def test_asked_devices_answer_with_their_values(self):
        for (device, model), expectations in ASKED.items():
            with self.subTest(f"{device} {model}"):
                modelled = ["--model", model] if model else []
                turns = expectations[0][0] == "scan"  # and takes its time for it
                process, uri = self.play(device, f"pty:{self.dir / device}", *STILL, *modelled,
                                         "--speed", 5 if turns else 1)
                done, found, summaries = self.probe(uri, "--driver", device, "--ask", "--seconds",
                                                    4 if turns else 1, *modelled)
                self.expect(done, OK, f"asking {device}")
                self.assertEqual([summary["driver"] for summary in summaries], [device])
                self.check(found, expectations)
                process.send_signal(signal.SIGTERM)
                self.assertEqual(process.wait(PATIENCE_S), OK)

    def test_one_that_waits_is_found_among_all(self):
        _, uri = self.play("keller", f"pty:{self.dir / 'tty'}", *STILL)
        done = self.run_leadline("probe", uri, "--seconds", 0.3)
        self.expect(done, INPUT, "nothing recognised", "--ask")
        _, uri = self.play("ping1d", "udp:@127.0.0.1:0", *STILL)
        done, found, summaries = self.probe(uri.replace("@", ""), "--ask", "--seconds", 1)
        self.expect(done, OK, "asking ping1d")
        self.assertIn("ping1d", [summary["driver"] for summary in summaries])
        self.check([record for record in found if record["driver"] == "ping1d"], [("sounder", 0.02)])

    # ---- Faults

    def test_faults_are_counted_at_both_ends(self):
        path = self.file_of("vectornav", "--drop", 0.002, "--corrupt", 0.002)
        whole = self.file_of("xsens").stat().st_size
        lossy = self.dir / "xsens.bin"
        lossy.unlink()
        done = self.run_leadline("emulate", "xsens", "--port", f"file:{lossy}", "--seconds", 4,
                                 "--speed", 50, "--drop", 0.01, *STILL)
        dropped = int(re.search(r"(\d+) dropped", done.stdout).group(1))
        self.assertEqual(lossy.stat().st_size, whole - dropped)
        self.assertGreater(dropped, 0)
        done, found, summaries = self.probe(f"file:{path}")
        self.expect(done, OK)
        mine = [summary for summary in summaries if summary["driver"] == "vectornav"][0]
        self.assertGreater(sum(mine["rejected"].values()) + mine["skipped_bytes"], 0)
        self.check([record for record in found if record["driver"] == "vectornav"], [WITH_HEADING])

    # ---- Usage

    def test_a_frame_by_chance_is_no_device(self):
        # A Keller bus's request (its serial number) among sentences; alone it is one.
        request = bytes.fromhex("fa4901a1a7")
        path = self.dir / "line.bin"
        path.write_bytes(b"$HCHDG,129.5,,,8.7,E*29\r\n" * 20 + request + b"$PRDID,-4.44,2.12,154.25*56\r\n")
        _, _, summaries = self.probe(f"file:{path}")
        self.assertEqual([summary["driver"] for summary in summaries], ["nmea"])
        path.write_bytes(request)
        _, _, summaries = self.probe(f"file:{path}")
        self.assertEqual([summary["driver"] for summary in summaries], ["keller"])

    def test_devices_and_options_that_do_not_exist(self):
        for arguments, parts in [
                (["vectornva", "--port", "pty:"], ["did you mean vectornav?"]),
                (["kongsberg", "--port", "pty:"], ["no emulated side", "ping1d", "mavlink"]),
                (["tss1"], ["--port"]),
                (["--port", "pty:"], ["--port", "DEVICE"]),
                (["tss1", "--port", "pty:", "--lockstep", "x"], ["--lockstep"]),
                (["tss1", "--port", "pty:", "--model", "x"], ["--model", "one kind"]),
                (["tritech", "--port", "pty:", "--model", "x"], ["imaging, profiler"]),
                (["tss1", "--port", "usb:1"], ["usb:1", "pty:"]),
                (["tss1", "--port", "can:can0"], ["nmea2000"]),
                (["keller", "--port", "modbus-rtu:/dev/ttyS0:9600:8N1@1"], ["master"]),
                (["tss1", "--port", "gpio:gpiochip0:1"], ["gpio"]),
                (["tss1", "--port", "pty:", "--bottom", -1], ["--bottom"]),
                (["tss1", "--port", "pty:", "--drop", 2], ["--drop"]),
                (["tss1", "--port", "pty:", "--speed", 0], ["--speed"])]:
            with self.subTest(arguments):
                self.expect(self.run_leadline("emulate", *arguments), USAGE, *parts)

    def test_ports_that_cannot_be_probed(self):
        nothing = self.dir / "zeros"
        nothing.write_bytes(bytes(1000))
        for arguments, code, parts in [
                (["usb:1"], USAGE, ["usb:1"]),
                (["gpio:gpiochip0:1:out"], USAGE, ["gpio"]),
                (["gpio:gpiochip0:1", "--driver", "nmea"], USAGE, ["nmea"]),
                (["modbus-tcp:127.0.0.1:502@1"], USAGE, ["--ask"]),
                (["file:x", "--ask"], USAGE, ["--ask"]),
                (["udp:@127.0.0.1:0", "--driver", "tss2"], USAGE, ["did you mean tss1?"]),
                (["udp:@127.0.0.1:0", "--driver", "tss1", "--ask"], USAGE, ["talks by itself"]),
                (["can:can0", "--driver", "tss1"], USAGE, ["tss1"]),
                (["udp:@127.0.0.1:0", "--seconds", -1], USAGE, ["--seconds"]),
                (["serial:/dev/nothing:9600"], INPUT, ["/dev/nothing"]),
                ([f"file:{nothing}"], INPUT, ["nothing recognised", "1000 bytes"]),
                (["udp:@127.0.0.1:0", "--seconds", 0.2], INPUT, ["0 bytes", "--ask"])]:
            with self.subTest(arguments):
                self.expect(self.run_leadline("probe", *arguments), code, *parts)


if __name__ == "__main__":
    unittest.main()

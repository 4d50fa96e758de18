#!/usr/bin/env python3
"""`leadline decode`: vectors of the device notes, what scripts rely on, and the real captures of the shared
data (skipped where they are not there)."""

import binascii
import csv
import json
import math
import os
import pathlib
import random
import struct
import subprocess
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from contract import INPUT, LEADLINE, OK, USAGE  # noqa: E402

ROOT = pathlib.Path(os.environ["LEADLINE_ROOT"])
DATA = pathlib.Path(os.environ.get("LEADLINE_DATA", ROOT.parent / "shared" / "data"))

# ping1d profile: distance 1000 mm, confidence 93, ten points (ping-protocol's own example).
PING1D = bytes.fromhex(
    "425224001405382de80300005d003f081c2ba602a00f0000b888000004000000"
    "0a0000010203040506070809de05")


def run(*arguments, stdin=b""):
    return subprocess.run([LEADLINE, "decode", *map(str, arguments)], input=stdin,
                          capture_output=True, timeout=600)


def records(driver, path, stdin=b""):
    done = run("--driver", driver, path, "--json", stdin=stdin)
    assert done.returncode == OK, done.stderr.decode()
    lines = [json.loads(line) for line in done.stdout.decode().splitlines()]
    assert lines[-1]["record"] == "summary"
    return lines[:-1], lines[-1]


def data(name):
    path = DATA / name
    if not path.exists():
        raise unittest.SkipTest(f"{name} is not there")
    return path


def rows(name):
    with data(name).open(newline="") as file:
        return list(csv.DictReader(file))


def of_kind(found, kind):
    return [record for record in found if record["record"] == kind]


class Decode(unittest.TestCase):
    def test_vector_of_a_ping(self):
        found, summary = records("ping1d", "-", PING1D * 3)
        self.assertEqual(len(found), 3)  # equal answers in a file are all there
        self.assertEqual(found[0]["record"], "ping")
        self.assertEqual(found[0]["range_mm"], [1000.0])
        self.assertIsNone(found[0]["t_us"])
        self.assertEqual((summary["frames"], summary["rejected"]), (3, {}))

    def test_damage_costs_its_frame_only(self):
        for lost in range(len(PING1D)):
            broken = PING1D[:lost] + PING1D[lost + 1:]
            found, summary = records("ping1d", "-", PING1D + broken + PING1D)
            self.assertEqual(len(found), 2, lost)
            self.assertEqual(summary["frames"], 2)
        found, summary = records("ping1d", "-", PING1D + PING1D[:30])
        self.assertEqual(len(found), 1)
        self.assertEqual(summary["rejected"], {"unfinished": 1})
        self.assertEqual(summary["skipped_bytes"], 30)
        self.assertEqual(records("ping1d", "-", b"")[1]["frames"], 0)

    def test_unavailable_is_null_and_not_valid(self):
        # PGN 127257 with a yaw that is not available, then with nothing available (canboat's vector).
        text = (b"(100.5) can0 09F11923#00FF7F1B002105FF\n"
                b"(100.6) can0 09F11923#00FF7FFF7FFF7FFF\n")
        found, summary = records("nmea2000", "-", text)
        self.assertEqual([record["record"] for record in found], ["attitude", "attitude"])
        self.assertEqual([record["t_us"] for record in found], [100500000, 100600000])
        self.assertEqual([record["valid"] for record in found], [True, False])
        self.assertAlmostEqual(found[0]["pitch_deg"], 0.155, places=3)
        self.assertAlmostEqual(found[0]["roll_deg"], 7.523, places=3)
        self.assertIsNone(found[0]["heading_deg"])
        for key in ("roll_deg", "pitch_deg", "yaw_deg", "heading_deg"):
            self.assertIsNone(found[1][key])
        self.assertEqual(summary["frames"], 2)

    def test_every_layout_of_can_text_with_and_without_times(self):
        for line, t_us in (("  can0  09F11923   [8]  00 FF 7F 1B 00 21 05 FF", None),
                           ("can0 09F11923#00FF7F1B002105FF", None),
                           ("<0x09f11923> [8] 00 ff 7f 1b 00 21 05 ff", None),
                           ("(12.5) can0 09F11923#00FF7F1B002105FF R", 12_500_000),
                           ("00:00:12.500 R 09F11923 00 FF 7F 1B 00 21 05 FF", 12_500_000),
                           ("1970-01-01 00:00:12.5,2,127257,35,255,7,00,ff,7f,1b,00,21,05", 12_500_000),
                           ("-,2,127257,35,255,7,00,ff,7f,1b,00,21,05", None),
                           ("12.5,2,127257,35,255,7,00,ff,7f,1b,00,21,05\r", 12_500_000)):
            with self.subTest(line):
                found, summary = records("nmea2000", "-", (line + "\n").encode() * 3)
                self.assertEqual((len(found), summary["frames"], summary["skipped_bytes"]), (3, 3, 0))
                for record in found:
                    self.assertEqual((record["record"], record["t_us"], record["valid"]), ("attitude", t_us, True))
                    self.assertAlmostEqual(record["roll_deg"], 7.523, places=3)

    def test_a_file_says_everything(self):
        """What a live vehicle drops: repeats, ranges of no confidence, what says no time, the housing's pressure."""
        def ping(number, payload):
            frame = b"BR" + struct.pack("<HHBB", len(payload), number, 1, 0) + payload
            return frame + struct.pack("<H", sum(frame))
        found, _ = records("ping1d", "-", ping(1211, struct.pack("<IB", 3210, 77)) + ping(
            1212, struct.pack("<IHHIIII", 1234, 0, 100, 7, 0, 5000, 3)))
        self.assertEqual([record["range_mm"] for record in found], [[3210.0], [1234.0]])
        self.assertEqual([record["quality"] for record in found], [[196], [0]])
        lines = (b"wrz,0.120,-0.400,2.000,y,1.30,1.855,1e-07;0;1.4;0;1.2;0;0.2;0;1e+09,7,14,123.00,1*50\r\n"
                 b"wrx,1075.51,0.000,0.000,0.000,2.707,-1.00,n,1*04\r\n")
        found, summary = records("wldvl", "-", lines)
        self.assertEqual([record["valid"] for record in found], [True, False])
        self.assertEqual(summary["repeats"], 0)
        body = b"\xff\x36\x07\x30\x10\x04" + struct.pack(">I", 101325)
        found, _ = records("xsens", "-", b"\xfa" + body + bytes([-sum(body) & 255]))
        self.assertEqual([record["pressure_pa"] for record in found], [101325])

    def test_heave_as_the_device_counts_it_and_down(self):
        # A maker's page's TSS1 line; 127252.
        found, _ = records("tss1", "-", b":00FFCA -0003F-0325  0319\r\n")
        self.assertEqual([(record["heave_m"], record["heave_down_m"]) for record in found], [(-0.03, 0.03)])
        self.assertAlmostEqual(found[0]["roll_deg"], -3.25, delta=0.01)
        self.assertAlmostEqual(found[0]["pitch_deg"], 3.19, delta=1e-5)
        found, _ = records("nmea2000", "-", b"(1.0) can0 0DF11423#00D7FFFFFFFFFFFF\n"
                                            b"(2.0) can0 0DF11423#000080FFFFFFFFFF\n")
        self.assertEqual([(record["heave_m"], record["valid"]) for record in found],
                         [(-0.41, True), (None, False)])

    def test_sigmas_where_the_device_states_them(self):
        found, _ = records("nmea", "-", b"$PASHR,164100190,138.24,T,+32.56,+48.49,+00.00,3.141,"
                                        b"3.141,35.000,1,0*17\r\n$PRDID,-4.44,2.12,154.25*56\r\n")
        for key, value in (("roll_sigma_deg", 3.141), ("pitch_sigma_deg", 3.141), ("heading_sigma_deg", 35)):
            self.assertAlmostEqual(found[0][key], value, delta=1e-4)
            self.assertNotIn(key, found[1])
        found, _ = records("wldvl", "-", b"wrp,49056.809,0.41,0.15,1.23,0.4,53.9,13.0,19.3,0*de\r\n")
        self.assertEqual(found[0]["position_sigma_m"], 0.4)

    def test_can_fd_is_told_from_damage(self):
        attitude = "00FF7F1B002105FF"
        found, summary = records("nmea2000", "-", (
            f"(1.0) can0 09F11923##1{attitude}\n(1.1) can0 09F11923##1{attitude * 2}\n"
            f"(1.2) can0 09F11923##1{attitude[1:]}\n(1.3) can0 09F11923#{attitude}\n").encode())
        self.assertEqual([record["t_us"] for record in found], [1000000, 1300000])
        self.assertEqual(summary["rejected"], {"bad_line": 1, "can_fd": 1})

    def test_depth_below_the_transducer_is_not_depth(self):
        # An echo sounder's, then that of an altimeter which knows the vehicle's depth as well.
        found, _ = records("nmea", "-", b"$SDDBT,,f,12.50,M,,F*00\r\n$SDDPT,3.6,0.0*52\r\n"
                                        b"$PRVAT,01.000,M,0010.022,dBar*39\r\n")
        self.assertEqual([record["record"] for record in found], ["depth", "depth", "altitude"])
        self.assertEqual([record.get("depth_below_transducer_m") for record in found], [12.5, 3.6, None])
        self.assertEqual([record["altitude_m"] for record in found], [12.5, 3.6, 1.0])
        self.assertFalse(any("depth_m" in record for record in found))
        self.assertEqual(found[2]["pressure_pa"], 100220)

    def test_trax_data(self):
        def frame(frame_id, payload):
            body = struct.pack(">HB", len(payload) + 5, frame_id) + payload
            return body + struct.pack(">H", binascii.crc_hqx(body, 0))
        # GetData is known (PNI's manual); its answer is heading, pitch, roll.
        self.assertEqual(frame(4, b"").hex(), "000504bf71")
        answer = frame(5, b"\x03" + b"".join(
            struct.pack(">Bf", component, value)
            for component, value in ((5, 271.25), (24, -1.5), (25, 12.75))))
        found, summary = records("trax", "-", answer + answer[:9] + answer)
        self.assertEqual(len(found), 2)
        for record in found:
            self.assertEqual((record["record"], record["heading_north"]), ("attitude", "magnetic"))
            for key, value in (("heading_deg", 271.25), ("pitch_deg", -1.5), ("roll_deg", 12.75)):
                self.assertAlmostEqual(record[key], value, delta=1e-5)
        self.assertEqual(summary["skipped_bytes"], 9)

    def test_a_recorded_pressure_bus_whoever_speaks(self):
        def crc(body):
            value = 0xFFFF
            for byte in body:
                value ^= byte
                for _ in range(8):
                    value = value >> 1 ^ (0xA001 if value & 1 else 0)
            return value
        def modbus(*body):
            return bytes(body) + struct.pack("<H", crc(bytes(body)))
        def maker(*body):
            return bytes(body) + struct.pack(">H", crc(bytes(body)))
        answer = modbus(7, 3, 8, *struct.pack(">ff", 1.25, 19.5))
        found, summary = records("keller", "-", modbus(7, 3, 1, 0, 0, 4) + answer + b"\x00" + answer)
        self.assertEqual([(record["pressure_pa"], record["temperature_degc"]) for record in found],
                         [(125000, 19.5)] * 2)
        self.assertEqual(summary["rejected"], {})
        reads = maker(250, 48) + maker(1, 48, 5, 20, 13, 33, 10, 1)
        for channel, value in ((1, 1.5), (4, 15.25), (1, 1.625)):
            reads += maker(1, 73, channel) + maker(1, 73, *struct.pack(">f", value), 0)
        found, summary = records("keller", "-", reads)
        self.assertEqual([record.get("pressure_pa", record.get("temperature_degc")) for record in found],
                         [150000, 15.25, 162500])
        self.assertEqual((summary["frames"], summary["rejected"]), (8, {}))

    def test_time_is_the_device_s_own_where_bytes_have_none(self):
        zda = b"$GPZDA,160012.71,11,03,2004,-1,00*7D\r\n"
        found, _ = records("nmea", "-", zda)
        self.assertEqual([record["t_us"] for record in found], [1079020812710000])
        gga = b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n"
        self.assertEqual([record["t_us"] for record in records("nmea", "-", gga)[0]], [None])

    def test_every_driver_reads_noise_and_finds_nothing(self):
        noise = random.Random(4).randbytes(20000)
        for driver in ("ping1d", "ping360", "cerulean", "deltat83p", "tritech", "r2sonic", "kongsberg",
                       "wl3d", "nmea", "tss1", "vectornav", "xsens", "trax", "wldvl", "pd0", "keller",
                       "nmea2000", "mavlink", "imagenex"):
            with self.subTest(driver):
                found, summary = records(driver, "-", noise)
                self.assertEqual((found, summary["driver"]), ([], driver))

    def test_text_is_a_line_a_record(self):
        done = run("--driver", "ping1d", "-", stdin=PING1D)
        lines = done.stdout.decode().splitlines()
        self.assertEqual(len(lines), 2)
        self.assertTrue(lines[0].startswith("ping "))
        self.assertIn("range_mm [1000.0]", lines[0])
        self.assertIn("1 frames", lines[1])

    def test_errors_name_what_they_are_about(self):
        done = run("--driver", "pign360", "x")
        self.assertEqual(done.returncode, USAGE)
        self.assertIn(b"did you mean ping360", done.stderr)
        done = run("--driver", "ping360", "/no/such/file")
        self.assertEqual(done.returncode, INPUT)
        self.assertIn(b"/no/such/file", done.stderr)
        self.assertEqual(run("--driver", "ping360", "/tmp").returncode, INPUT)


class RealCaptures(unittest.TestCase):
    def test_ping360_in_a_tank(self):
        found, summary = records(
            "ping360", data("ping360_sector_junayed/derived/frames.bin"))
        table = rows("ping360_sector_junayed/derived/pings.csv")
        self.assertEqual((len(found), summary["frames"], summary["rejected"]), (101, 101, {}))
        for row, record in zip(table, found):
            self.assertEqual(bytes(record["samples"]), bytes.fromhex(row["samples_hex"]))
            self.assertAlmostEqual(record["angle_deg"], 0.9 * int(row["angle_gradian"]), places=5)

    def nmea2000(self, capture, decoded):
        table = rows("nmea2000_canboat/derived/" + decoded)
        found, summary = records("nmea2000", data("nmea2000_canboat/" + capture))
        self.assertEqual(summary["rejected"], {})
        columns = {"attitude": ("attitude", {"v1": "yaw_deg", "v2": "pitch_deg", "v3": "roll_deg"}),
                   "heading": ("heading", {"v1": "heading_deg"}),
                   "rot": ("rates", {"v1": "yaw_rate_deg_s"}),
                   "heave": ("heave", {"v1": "heave_m"}),
                   "depth": ("depth", {"v1": "depth_below_transducer_m"})}
        for kind, (record, keys) in columns.items():
            expected = [row for row in table if row["kind"] == kind]
            got = of_kind(found, record)
            if kind != "heading" or expected:
                self.assertEqual(len(got), len(expected), kind)
            for row, line in zip(expected, got):
                self.assertEqual(line["t_us"], round(float(row["t_unix"]) * 1e6))
                for column, key in keys.items():
                    if row[column] == "" or line[key] is None:
                        self.assertEqual(row[column] == "", line[key] is None)
                    else:
                        self.assertAlmostEqual(float(row[column]), line[key], delta=1e-4)

    def test_candump_with_its_log_layout(self):
        self.nmea2000("raw/candumpSample3.txt", "candumpSample3.decoded.csv")

    def test_canboat_text(self):
        self.nmea2000("raw/furuno-130842-figure8-fast.raw",
                      "furuno-130842-figure8-fast.decoded.csv")
        self.nmea2000("raw/raymarine-ev1.raw", "raymarine-ev1.decoded.csv")

    def test_the_same_bus_in_both_layouts(self):
        one, _ = records("nmea2000", data("nmea2000_canboat/raw/dirona-actisense-serial.raw"))
        other, _ = records(
            "nmea2000", data("nmea2000_canboat/derived/dirona-actisense-serial.candump"))
        self.assertGreater(len(one), 20000)
        self.assertEqual(one, other)

    def test_telemetry_log(self):
        found, summary = records("mavlink", data("ardusub_logs/testing_small.tlog"))
        table = rows("ardusub_logs/testing_small_nav.csv")
        self.assertEqual(summary["container"], "MAVLink telemetry log")
        attitudes = of_kind(found, "attitude")
        expected = [row for row in table if row["kind"].startswith("attitude")]
        self.assertEqual(len(attitudes), len(expected))
        for row, record in zip(expected, attitudes):
            self.assertEqual(record["t_us"], round(float(row["t_unix"]) * 1e6))
            for column, key in {"v1": "roll_deg", "v2": "pitch_deg", "v3": "yaw_deg"}.items():
                self.assertAlmostEqual(math.degrees(float(row[column])), record[key], delta=0.01)

    def test_every_intact_ensemble_is_one_velocity(self):
        for capture in ("RDI_test01.000", "RiverPro_test01.PD0", "vmdas01_wh.ENX",
                        "winriver02_transect.PD0"):
            table = rows(f"adcp_dvl_pd0/derived/{capture.replace('.', '_')}_bt.csv")
            found, summary = records("pd0", data("adcp_dvl_pd0/raw/" + capture))
            velocities = of_kind(found, "velocity")
            self.assertEqual(len(velocities), len(table), capture)
            self.assertEqual(summary["frames"], len(table))
            for row, record in zip(table, velocities):
                self.assertEqual(record["valid"], record["velocity_m_s"] is not None)
                self.assertEqual(record["t_us"], round(float(row["t_unix"]) * 1e6))

    def test_multibeam_in_xtf(self):
        found, summary = records(
            "r2sonic", data("multibeam_r2sonic2026_sfbay/raw/first550pings.xtf"))
        self.assertEqual((len(found), summary["rejected"]), (550, {}))
        self.assertTrue(all(200 < len(record["range_mm"]) <= 256 for record in found))

    def test_multibeam_of_kongsberg(self):
        name = "all_a_y_m1333931979274893952"
        found, summary = records("kongsberg", data(f"multibeam_kongsberg_snippets/raw/{name}.all"))
        self.assertEqual(summary["rejected"], {})
        table = rows(f"multibeam_kongsberg_snippets/derived/{name}_beams.csv")
        # Bit 7 of the detection: nothing was found, the time is a guess.
        expected = [row for row in table if int(row["detection_info"]) < 128]
        pings = of_kind(found, "ping")
        beams = [(ping["sound_speed_m_s"], range_mm) for ping in pings for range_mm in ping["range_mm"]]
        self.assertEqual(len(beams), len(expected))
        for row, (speed_m_s, range_mm) in zip(expected, beams):
            self.assertAlmostEqual(float(row["sound_speed_mps"]), speed_m_s, delta=0.06)
            self.assertAlmostEqual(float(row["twtt_s"]) * speed_m_s * 500, range_mm, delta=1)
        self.assertEqual(len(of_kind(found, "attitude")), 101)
        self.assertTrue(all(record["valid"] for record in of_kind(found, "position")))


if __name__ == "__main__":
    unittest.main()

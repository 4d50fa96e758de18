#!/usr/bin/env python3
"""Every vector that the device notes call REAL and whose device has a driver, through `leadline decode`: each value
that the notes state, or that stands in the sentence, comes out. What is said to a head (requests, commands) and
checksums are in the codecs' own tests; the list of all is in hal/README.md."""

import decimal
import functools
import json
import operator
import os
import subprocess
import unittest

LEADLINE = os.environ["LEADLINE"]

PING1D_PROFILE = bytes.fromhex(
    "425224001405382de80300005d003f081c2ba602a00f0000b8880000040000000a0000010203040506070809de05")

# driver, bytes, then what the record says, in the order of the records
VECTORS = [
    ("ping1d", PING1D_PROFILE, [{
        "record": "ping", "range_mm": [1000], "confidence_percent": 93, "transmit_duration_us": 2111,
        "ping_number": 44444444, "scan_start_mm": 4000, "scan_length_mm": 35000, "gain_setting": 4,
        "samples": list(range(10))}]),
    ("nmea", b"$HCHDG,129.5,,,8.7,E*29\r\n$IIHDM,201.5,M*24\r\n", [
        {"record": "heading", "heading_deg": 129.5, "heading_north": "magnetic", "deviation_deg": None,
         "variation_deg": 8.7},
        {"record": "heading", "heading_deg": 201.5, "heading_north": "magnetic"}]),
    ("nmea", b"$PASHR,164100190,138.24,T,+32.56,+48.49,+00.00,3.141,3.141,35.000,1,0*17\r\n"
             b"$PRDID,-4.44,2.12,154.25*56\r\n", [
        {"record": "attitude", "utc_us": ((16 * 60 + 41) * 60) * 1000000 + 190000, "heading_deg": 138.24,
         "heading_north": "true", "roll_deg": 32.56, "pitch_deg": 48.49, "heave_m": 0, "roll_sigma_deg": 3.141,
         "pitch_sigma_deg": 3.141, "heading_sigma_deg": 35.0, "gps_quality": 1, "ins_status": 0},
        {"record": "attitude", "pitch_deg": -4.44, "roll_deg": 2.12, "heading_deg": 154.25}]),
    ("nmea", b"$PRVAT,00.115,M,0010.073,dBar*39\r\n$PRVAT,00.210,M,0007.497,Metres*3a\r\n", [
        {"record": "altitude", "altitude_m": 0.115, "pressure_pa": 100730},
        {"record": "altitude", "altitude_m": 0.21, "depth_m": 7.497}]),
    ("tss1", b":00FFCA -0003F-0325  0319\r\n", [{
        "record": "attitude", "heave_acceleration_m_s2": -0.03375, "horizontal_acceleration_m_s2": 0, "heave_m": -0.03,
        "status": "F", "roll_deg": -3.25, "pitch_deg": 3.19}]),
    ("vectornav", b"$VNYMR,-004.328,+001.357,+178.257,+00.2219,-00.0720,+00.4652,+00.226,-00.321,+10.043,"
                  b"-00.001188,+00.001866,-00.007661*6C\r\n"
                  b"$VNYMR,+100.949,-007.330,+000.715,-00.0049,-00.2449,+00.5397,-01.258,-00.100,-09.701,"
                  b"-00.000018,+00.001122,-00.000551*69\r\n$VNRRG,01,VN-200T-CR*31\r\n", [
        {"record": "attitude", "yaw_deg": -4.328, "pitch_deg": 1.357, "roll_deg": 178.257,
         "magnetic_field_gauss": [0.2219, -0.072, 0.4652], "acceleration_m_s2": [0.226, -0.321, 10.043],
         "roll_rate_deg_s": -0.068067, "pitch_rate_deg_s": 0.106914, "yaw_rate_deg_s": -0.438943},
        {"record": "attitude", "yaw_deg": 100.949, "pitch_deg": -7.33, "roll_deg": 0.715,
         "magnetic_field_gauss": [-0.0049, -0.2449, 0.5397], "acceleration_m_s2": [-1.258, -0.1, -9.701],
         "roll_rate_deg_s": -0.001031, "pitch_rate_deg_s": 0.064286, "yaw_rate_deg_s": -0.03157},
        {"record": "register", "valid": True, "register": 1, "values": ["VN-200T-CR"]}]),
    ("wldvl", b"wrz,0.120,-0.400,2.000,y,1.30,1.855,1e-07;0;1.4;0;1.2;0;0.2;0;1e+09,7,14,123.00,1*50\r\n"
              b"wru,0,0.070,1.10,-40,-95*9c\r\nwru,1,-0.500,1.25,-62,-104*f0\r\n"
              b"wrp,49056.809,0.41,0.15,1.23,0.4,53.9,13.0,19.3,0*de\r\n"
              b"wrx,1075.51,0.000,0.000,0.000,2.707,-1.00,n,1*04\r\nwrt,14.90,15.10,14.80,-1.00*53\r\n"
              b":BI,  +123,  -420, +2000,    +0,A\r\n", [
        {"record": "velocity", "valid": True, "velocity_m_s": [0.12, -0.4, 2], "altitude_m": 1.3, "fom_m_s": 1.855,
         "covariance_m2_s2": [1e-7, 0, 1.4, 0, 1.2, 0, 0.2, 0, 1e9], "time_of_validity_us": 7, "t_us": 7,
         "time_of_transmission_us": 14, "interval_ms": 123, "status": 1},
        {"record": "beams", "valid": True, "beam": [0], "beam_velocity_m_s": [0.07], "beam_distance_m": [1.1],
         "beam_rssi_dbm": [-40], "beam_nsd_dbm": [-95]},
        {"record": "beams", "valid": True, "beam": [1], "beam_velocity_m_s": [-0.5], "beam_distance_m": [1.25],
         "beam_rssi_dbm": [-62], "beam_nsd_dbm": [-104]},
        {"record": "position", "valid": True, "t_us": 49056809000, "position_north_east_down_m": [0.41, 0.15, 1.23],
         "position_sigma_m": 0.4, "roll_deg": 53.9, "pitch_deg": 13, "yaw_deg": 19.3, "status": 0},
        {"record": "velocity", "valid": False, "velocity_m_s": None, "altitude_m": None, "fom_m_s": 2.707,
         "interval_ms": 1075.51, "status": 1},
        {"record": "beams", "valid": True, "beam_distance_m": [14.9, 15.1, 14.8, None]},
        {"record": "velocity", "valid": True, "velocity_m_s": [0.123, -0.42, 2], "velocity_error_m_s": 0}]),
    ("nmea2000", b"(1.0) can0 0DF50B23#EDEF0100004CFFFF\n(2.0) can0 09F11923#00FF7F1B002105FF\n"
                 b"(3.0) can0 09F11223#89027F0000BA02FD\n", [
        {"record": "depth", "priority": 3, "pgn": 128267, "source": 0x23, "sequence_id": 237,
         "depth_below_transducer_m": 4.95, "transducer_offset_m": -0.18, "max_range_m": None},
        {"record": "attitude", "pgn": 127257, "sequence_id": 0, "yaw_deg": None, "pitch_deg": 0.155,
         "roll_deg": 7.523},
        {"record": "heading", "pgn": 127250, "sequence_id": 137, "heading_deg": 186.291, "heading_north": "magnetic",
         "deviation_deg": 0, "variation_deg": 3.999}]),
]


def decode(driver, data):
    done = subprocess.run([LEADLINE, "decode", "--driver", driver, "-", "--json"], input=data, capture_output=True,
                          check=True, timeout=600)
    lines = [json.loads(line) for line in done.stdout.decode().splitlines()]
    return lines[:-1], lines[-1]


def sentence(body):
    return f"${body}*{functools.reduce(operator.xor, body.encode()):02X}\r\n".encode()


class RealVectors(unittest.TestCase):
    def same(self, got, stated, where):
        if isinstance(stated, list):
            self.assertEqual(len(got), len(stated), where)
            for one, other in zip(got, stated):
                self.same(one, other, where)
        elif isinstance(stated, float):
            # Half a unit of the last digit that the notes state.
            decimals = max(0, -decimal.Decimal(repr(stated)).as_tuple().exponent)
            self.assertAlmostEqual(got, stated, delta=0.5 * 10 ** -decimals + 1e-12, msg=where)
        else:
            self.assertEqual(got, stated, where)

    def test_every_stated_value(self):
        for driver, data, expected in VECTORS:
            found, summary = decode(driver, data)
            self.assertEqual((len(found), summary["rejected"]), (len(expected), {}), driver)
            for record, stated in zip(found, expected):
                for key, value in stated.items():
                    self.assertIn(key, record, f"{driver} {stated}")
                    self.same(record[key], value, f"{driver} {key}")

    def test_what_is_not_available_is_null(self):
        found, _ = decode("nmea", b"".join(map(sentence, ("HCHDG,129.5,,,8.7,W", "SDDPT,3.6,-0.5,", "SDDPT,3.6,,"))))
        self.assertEqual(found[0]["variation_deg"], -8.7)
        self.assertEqual([record["transducer_offset_m"] for record in found[1:]], [-0.5, None])
        self.assertEqual([record["max_range_m"] for record in found[1:]], [None, None])
        found, _ = decode("nmea2000", b"(1.0) can0 09F11223#FF027FFF7FFF7FFD\n(2.0) can0 0DF50B23#FFEF010000FF7FFF\n")
        for key in ("deviation_deg", "variation_deg", "sequence_id"):
            self.assertIsNone(found[0][key])
        for key in ("transducer_offset_m", "max_range_m", "sequence_id"):
            self.assertIsNone(found[1][key])

    def test_reports_of_a_dvl_in_json(self):
        velocity = {"time": 106.3, "vx": 0.1, "vy": -0.2, "vz": 0.3, "fom": 0.002, "covariance": [[1, 2, 3], [4, 5, 6],
                    [7, 8, 9]], "altitude": 0.49, "transducers": [
                        {"id": 0, "velocity": 0.01, "distance": 0.58, "rssi": -30.4, "nsd": -89.1, "beam_valid": True},
                        {"id": 1, "velocity": 0, "distance": -1, "rssi": -90, "nsd": -89, "beam_valid": False}],
                    "velocity_valid": True, "status": 0, "format": "json_v3.1", "type": "velocity",
                    "time_of_validity": 1638191471563017, "time_of_transmission": 1638191471752336}
        position = {"ts": 49056.809, "x": 1.5, "y": 2.5, "z": 3.5, "std": 0.01, "roll": 1.25, "pitch": -2.5,
                    "yaw": 133.25, "type": "position_local", "status": 0, "format": "json_v3.1"}
        odd = dict(velocity, transducers=["x", 7], covariance="none")
        lines = "".join(json.dumps(line, separators=(",", ":")) + "\n" for line in (velocity, position, odd))
        found, _ = decode("wldvl", lines.encode())
        self.assertEqual(found[0]["covariance_m2_s2"], list(range(1, 10)))
        self.assertEqual(found[0]["beam_distance_m"], [0.58, None])
        self.assertEqual(found[0]["beam_velocity_m_s"], [0.01, 0])
        self.assertEqual((found[0]["fom_m_s"], found[0]["interval_ms"], found[0]["status"]), (0.002, 106.3, 0))
        self.assertEqual((found[1]["yaw_deg"], found[1]["roll_deg"], found[1]["status"]), (133.25, 1.25, 0))
        self.assertEqual(found[2]["covariance_m2_s2"], [None])
        self.assertNotIn("beam", found[2])


if __name__ == "__main__":
    unittest.main()

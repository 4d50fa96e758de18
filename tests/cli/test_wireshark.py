#!/usr/bin/env python3
"""The Wireshark dissector reads what proto/SPEC.md states: its vectors, as a capture, through tshark.

Skipped where there is no tshark (Debian: tshark).
"""
import json
import os
import pathlib
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from test_link_spec import as_bytes, as_lines, crc32c, fences  # noqa: E402

ROOT = pathlib.Path(os.environ.get("LEADLINE_ROOT", pathlib.Path(__file__).resolve().parents[2]))
LUA = ROOT / "host_tools" / "wireshark" / "leadline.lua"
TSHARK = shutil.which("tshark")


def cobs(data):
    out, block = bytearray(), bytearray()
    for byte in data:
        if byte == 0:
            out += bytes([len(block) + 1]) + block
            block = bytearray()
            continue
        block.append(byte)
        if len(block) == 254:
            out += b"\xff" + block
            block = bytearray()
    return bytes(out + bytes([len(block) + 1]) + block)


def frame(payload):
    return b"\0" + cobs(payload + struct.pack("<I", crc32c(payload))) + b"\0"


def capture(datagrams, port=9100):
    """A pcap file of UDP datagrams, raw IPv4."""
    data = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 101)
    for number, datagram in enumerate(datagrams):
        udp = struct.pack(">HHHH", 40000, port, 8 + len(datagram), 0) + datagram
        ip = struct.pack(">BBHHHBBH4s4s", 0x45, 0, 20 + len(udp), number, 0, 64, 17, 0,
                         bytes([127, 0, 0, 1]), bytes([127, 0, 0, 1]))
        data += struct.pack("<IIII", number, 0, len(ip + udp), len(ip + udp)) + ip + udp
    return data


@unittest.skipUnless(TSHARK, "tshark is not installed")
class Dissector(unittest.TestCase):
    def dissect(self, datagrams, *extra, port=9100):
        with tempfile.NamedTemporaryFile(suffix=".pcap") as file:
            file.write(capture(datagrams, port))
            file.flush()
            run = subprocess.run(
                [TSHARK, "-X", f"lua_script:{LUA}", "-r", file.name, "-T", "json",
                 "--no-duplicate-keys", "-J", "leadline", *extra],
                capture_output=True, text=True, timeout=120,
                env={**os.environ, "HOME": tempfile.gettempdir(), "LC_ALL": "C.UTF-8"})
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertNotIn("Lua", run.stderr.replace("lua_script", ""))
        return [packet["_source"]["layers"].get("leadline") for packet in json.loads(run.stdout)]

    def one(self, payload):
        layer = self.dissect([frame(payload)])[0]
        self.assertEqual(layer["leadline.crc_good"], "1")
        self.assertNotIn("_ws.expert", layer)
        return layer

    def test_hello(self):
        layer = self.one(as_bytes(fences("Vectors of the messages")[0]))
        self.assertEqual(layer["leadline.hello.survey_id"], str(0x1122334455667788))
        self.assertEqual(layer["leadline.hello.session"], "3")
        self.assertEqual(layer["leadline.hello.size_cells"], ["128", "96", "30"])
        self.assertEqual(layer["leadline.hello.origin_mm"], ["-1000", "0", "11000"])
        self.assertEqual(layer["leadline.hello.epsg"], "32632")
        self.assertEqual(layer["leadline.hello.survey_name"], "Kieler F\u00f6rde")
        self.assertEqual(layer["leadline.hello.vertical_datum"], "NHN")
        self.assertEqual(layer["leadline.hello.link_rate_bytes_s"], "4000")

    def test_status_and_brief(self):
        full, brief = (as_bytes(text) for text in fences("Vectors of the messages")[1:3])
        layer = self.one(full)
        self.assertEqual(layer["leadline.t_us"], "1000000")
        self.assertEqual(layer["leadline.status.position_mm"], ["12345", "-1", "5000"])
        self.assertEqual(layer["leadline.tiles_known"], "48")
        self.assertEqual(layer["leadline.cells_sent"], "20000")
        self.assertEqual(layer["leadline.swath.range_dm"], ["123", "130"])
        layer = self.one(brief)
        self.assertEqual(layer["leadline.swath.azimuth_bam8"], ["64", "192"])
        self.assertEqual(layer["leadline.swath.depression_bam8"], ["40", "41"])
        self.assertEqual(layer["leadline.brief.t_ms"], "1000")
        self.assertEqual(layer["leadline.brief.position_cm"], ["1234", "0", "500"])
        self.assertEqual(layer["leadline.tiles_dirty"], "3")

    def test_text(self):
        layer = self.one(as_bytes(fences("Vectors of the messages")[3]))
        self.assertEqual(layer["leadline.text.text"], "Tauchtiefe 12 m \u00fcber Grund")

    def test_tile_deltas(self):
        vectors = [as_bytes(text) for text in fences("Vectors of the tile delta")]
        layer = self.one(vectors[0])
        self.assertEqual(int(layer["leadline.survey_tag"], 16), 0x1234)
        self.assertEqual(layer["leadline.tile"], "7")
        layer = self.one(vectors[2])
        self.assertEqual(layer["leadline.tile"], ["7", "6"])

    def test_coarse_deltas(self):
        layer = self.one(as_bytes(fences("Coarse delta")[0]))
        self.assertEqual(int(layer["leadline.survey_tag"], 16), 0x1234)
        self.assertEqual(layer["leadline.tile"], "1")
        self.assertIn("leadline.delta.generation", json.dumps(layer))
        self.assertNotIn("leadline.delta.hash32", json.dumps(layer))
        self.assertIn("leadline.delta.body", json.dumps(layer))

    def test_requests_reports_and_digests(self):
        texts = fences("Vectors of the messages")
        resend = next(as_bytes(text) for text in texts if text.startswith("40"))
        layer = self.one(resend)
        self.assertEqual(layer["leadline.first"], ["0", "2", "1000"])
        self.assertEqual(layer["leadline.count"], ["1", "10", "1"])
        hello = next(as_bytes(text) for text in texts if text.startswith("41"))
        layer = self.one(hello)
        self.assertEqual((layer["leadline.hello.major"], layer["leadline.hello.minor"]), ("1", "1"))
        self.one(hello[:1])  # as minor 0 asked
        report, digest, both = (as_lines(text) for text in texts[-6:-3])
        layer = self.one(report[0])
        self.assertEqual((layer["leadline.report.asked"], layer["leadline.newest"]), ("1", str(0x203)))
        self.assertEqual([int(each) for each in layer["leadline.report.came"]], [0x203, 0x201, 0x200, 0x1F4])
        self.assertEqual(self.one(report[1])["leadline.newest"], str(0x203))
        hashes = self.one(digest[0])["leadline.digest.hash"]
        self.assertEqual([int(each, 16) for each in hashes], [0x01020304, 0xFFFFFFFE])
        layer = self.one(both[0])
        self.assertEqual((layer["leadline.first"], layer["leadline.count"]), ("300", "64"))
        layer = self.one(both[1])
        self.assertEqual((layer["leadline.tile"], layer["leadline.look.radius_tiles"]), ("300", "2"))

    def test_commands_answers_and_slices(self):
        command, _, others = fences("Vectors of the messages")[-3:]
        layer = self.one(as_bytes(command))
        self.assertEqual(int(layer["leadline.command.key_id"], 16), 0x7B712541)
        self.assertEqual((layer["leadline.command.vehicle"], layer["leadline.command.counter"]), ("3", "300"))
        self.assertEqual(layer["leadline.command.kind"], "3")
        self.assertEqual(layer["leadline.command.fields"], "01:80:25:00:00")
        self.assertTrue(layer["leadline.command.tag"].startswith("cc:92:90"))
        answer, part = as_lines(others)
        layer = self.one(answer)
        self.assertEqual((layer["leadline.command.counter"], layer["leadline.command.result"]), ("300", "2"))
        layer = self.one(part)
        self.assertEqual(layer["leadline.slice.first"], ["300", "5", "0"])
        self.assertEqual((layer["leadline.slice.rows"], layer["leadline.slice.columns"]), ("3", "20"))
        self.assertEqual((layer["leadline.slice.first_row"], layer["leadline.slice.row_count"]), ("1", "2"))

    def test_damage_is_shown_and_harms_nothing(self):
        brief = as_bytes(fences("Vectors of the messages")[2])
        whole = frame(brief)
        changed = bytearray(whole)
        changed[5] ^= 0x40
        cut = frame(brief[:9])
        layers = self.dissect([bytes(changed), cut, whole[:7], b"\0\0\0", frame(b"\x3f\x01"), whole])
        for layer in layers[:3]:
            self.assertIn("_ws.expert", json.dumps(layer))
        self.assertNotIn("_ws.expert", json.dumps(layers[4]))  # a newer minor's
        self.assertEqual(layers[5]["leadline.tiles_dirty"], "3")

    def test_several_frames_of_one_datagram_and_another_port(self):
        brief = frame(as_bytes(fences("Vectors of the messages")[2]))
        layer = self.dissect([brief + brief], "-d", "udp.port==5000,leadline", port=5000)[0]
        self.assertEqual(len(re.findall("leadline.brief.t_ms", json.dumps(layer))), 2)


if __name__ == "__main__":
    unittest.main()

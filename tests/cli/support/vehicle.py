"""Base of the tests that fly `leadline-vehicle`: devices on ptys, written from the protocols' descriptions,
and a reader of logs that shares no code with the product.

Environment: LEADLINE, LEADLINE_VEHICLE (the programs). Standard library only.
"""

import math
import os
import pathlib
import pty
import select
import shutil
import signal
import socket
import struct
import subprocess
import tempfile
import time
import tty
import unittest

LEADLINE = os.environ["LEADLINE"]
VEHICLE = os.environ["LEADLINE_VEHICLE"]

OK, INTERNAL, USAGE, INPUT, OUTPUT = 0, 1, 2, 3, 4
PATIENCE_S = 180  # for what takes a moment; nothing here asserts how long it took

GRID = "[grid]\ncell_mm = 500\nsize = [64, 64, 48]\norigin_mm = [-16000, -16000, 0]\n"
LATITUDE, LONGITUDE = 10.0, 20.0

HELLO, DELTA, STATUS, TEXT, BRIEF = 0x01, 0x02, 0x03, 0x04, 0x05
HEADER, CONFIG, TABLE, CHUNK, CYCLE, GAP, END = 0x80, 0x81, 0x82, 0x83, 0x84, 0x85, 0x86
ALARM_PORT_LOST, ALARM_RECORDER_LOST = 1 << 2, 1 << 4


# ---- Frames and logs ---------------------------------------------------------------------------

def _crc_table():
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = (byte >> 1) ^ (0x82F63B78 if byte & 1 else 0)
        table.append(byte)
    return table


_CRC = _crc_table()


def crc32c(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc = (crc >> 8) ^ _CRC[(crc ^ byte) & 0xFF]
    return crc ^ 0xFFFFFFFF


def cobs_decode(body):
    out = bytearray()
    at = 0
    while at < len(body):
        code = body[at]
        if at + code > len(body):
            return None
        out += body[at + 1:at + code]
        at += code
        if code < 0xFF and at < len(body):
            out.append(0)
    return bytes(out)


def frames(data):
    """Payloads of the intact frames, and how many bodies were not intact."""
    payloads, bad = [], 0
    *bodies, rest = data.split(b"\0")
    for body in bodies:
        if not body:
            continue
        raw = cobs_decode(body)
        if raw is None or len(raw) < 4 or crc32c(raw[:-4]) != struct.unpack("<I", raw[-4:])[0]:
            bad += 1
            continue
        payloads.append(raw[:-4])
    return payloads, bad + (1 if rest else 0)


def brief_fields(payload):
    """Of a brief, what the tests ask for."""
    at = 5

    def varint():
        nonlocal at
        value = shift = 0
        while True:
            byte, at = payload[at], at + 1
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value

    fields = {"t_ms": struct.unpack("<I", payload[1:5])[0], "alarms": varint()}
    at += 1  # pose_validity
    for _ in range(3):
        varint()  # position
    at += 4  # heading, sigma
    return fields | {name: varint() for name in ("pings_fused", "tiles_known", "tiles_dirty", "cells_sent")}


class Log:
    """A log as bytes, taken apart by proto/SPEC.md."""

    def __init__(self, path):
        self.records, self.bad = frames(pathlib.Path(path).read_bytes())
        self.types = [payload[0] for payload in self.records]

    def of(self, kind):
        return [payload for payload in self.records if payload[0] == kind]

    def cycles(self):
        """(number, t_us, room, chunk_count, flags)"""
        return [struct.unpack("<IqIHH", payload[1:]) for payload in self.of(CYCLE)]

    def end(self):
        names = ("t_us", "cycle_count", "map_hash", "cells_hash", "link_hash", "pings_in", "pings_fused", "pings_shed",
                 "pings_rejected", "cells_sent", "downlink_bytes")
        return dict(zip(names, struct.unpack("<qI9Q", self.of(END)[-1][1:])))

    def gaps(self):
        """(t_us, reason, lost_records, lost_bytes)"""
        return [struct.unpack("<qBIQ", payload[1:]) for payload in self.of(GAP)]

    def blob(self, kind):
        # All of them stand there twice.
        pieces = {payload[1:6]: payload[6:] for payload in self.of(kind)}
        assert len(self.of(kind)) == 2 * len(pieces)
        return b"".join(pieces.values())


# ---- Devices -----------------------------------------------------------------------------------

def nmea(body):
    checksum = 0
    for byte in body.encode():
        checksum ^= byte
    return f"${body}*{checksum:02X}\r\n".encode()


def ping_frame(message_id, payload, source=1):
    head = struct.pack("<2sHHBB", b"BR", len(payload), message_id, source, 0) + payload
    return head + struct.pack("<H", sum(head) & 0xFFFF)


class Ping1d:
    """Answers requests as the altimeter does; the bottom is `depth_mm` away."""

    def __init__(self, depth_mm=9000):
        self.depth_mm = depth_mm
        self.number = 0
        self.buffer = b""
        self.answers = 0
        self.state = {1203: struct.pack("<I", 1500000), 1204: struct.pack("<II", 0, 10000),
                      1205: b"\1", 1206: struct.pack("<H", 250), 1207: struct.pack("<I", 1),
                      1215: b"\1"}

    def take(self, data):
        """Bytes of the host; returns the bytes that the device says."""
        self.buffer += data
        out = b""
        while len(self.buffer) >= 10:
            at = self.buffer.find(b"BR")
            if at < 0:
                self.buffer = b""
                break
            self.buffer = self.buffer[at:]
            if len(self.buffer) < 10:
                break
            size, message = struct.unpack("<HH", self.buffer[2:6])
            if len(self.buffer) < 10 + size:
                break
            payload, self.buffer = self.buffer[8:8 + size], self.buffer[10 + size:]
            out += self.answer(message, payload)
        return out

    def answer(self, message, payload):
        setters = {1001: 1204, 1002: 1203, 1003: 1205, 1004: 1206, 1006: 1215}
        if message in setters:
            self.state[setters[message]] = payload
            return ping_frame(1, struct.pack("<H", message))
        if message == 1005:
            self.state[1207] = struct.pack("<I", payload[0])
            return ping_frame(1, struct.pack("<H", message))
        if message != 6:
            return b""
        wanted = struct.unpack("<H", payload)[0]
        if wanted == 5:
            return ping_frame(5, bytes([1, 0, 0, 0]))
        if wanted == 4:
            return ping_frame(4, bytes([1, 1, 3, 29, 0, 0]))
        if wanted == 1212:
            self.number += 1
            self.answers += 1
            start, length = struct.unpack("<II", self.state[1204])
            gain = struct.unpack("<I", self.state[1207])[0]
            return ping_frame(1212, struct.pack("<IHHIIII", self.depth_mm, 100, 115, self.number,
                                                start, length, gain))
        return ping_frame(wanted, self.state[wanted]) if wanted in self.state else b""


class Instruments:
    """Attitude, position and pressure of a vehicle that goes slowly north, 2 m down."""

    def __init__(self, interval_us=50_000):
        self.interval_us = interval_us
        self.due_us = None

    def say(self, t_us):
        self.due_us = t_us if self.due_us is None else self.due_us
        out = b""
        while self.due_us <= t_us:
            out += self.sentences(self.due_us)
            self.due_us += self.interval_us
        return out

    @staticmethod
    def sentences(t_us):
        seconds = t_us / 1e6 % 86400
        clock = f"{int(seconds // 3600):02d}{int(seconds // 60 % 60):02d}{seconds % 60:06.3f}"
        north_m = 0.2 * (seconds % 60)
        minutes = (LATITUDE + math.degrees(north_m / 6371000)) % 1 * 60
        position = f"{int(LATITUDE):02d}{minutes:09.6f},N,{int(LONGITUDE):03d}00.000000,E"
        # 2 m of sea water above one atmosphere, in dBar.
        pressure_dbar = (101325 + 2 * 1029 * 9.80665) / 1e4
        return (nmea(f"PASHR,{clock},0.00,T,0.00,0.00,0.00,0.100,0.100,0.200,1") +
                nmea(f"GPGGA,{clock},{position},4,12,0.8,0.0,M,0.0,M,,") +
                nmea(f"PRVAT,0000.000,M,{pressure_dbar:08.4f},dBar"))


class Pty:
    """A device's end of a pty under a name."""

    def __init__(self, link):
        self.link = link
        self.master = -1
        self.plug()

    def plug(self):
        self.master, slave = pty.openpty()
        tty.setraw(slave)
        os.set_blocking(self.master, False)
        # Held open, so that bytes written before the vehicle opens its end are kept, and raw.
        self.slave = slave
        os.symlink(os.ttyname(slave), self.link)

    def unplug(self):
        os.unlink(self.link)
        os.close(self.slave)
        os.close(self.master)
        self.master = -1

    def close(self):
        if self.master >= 0:
            self.unplug()

    def read(self, size=65536):
        try:
            return os.read(self.master, size) if self.master >= 0 else b""
        except (BlockingIOError, OSError):
            return b""

    def write(self, data):
        """How many bytes went out."""
        try:
            return os.write(self.master, data) if self.master >= 0 and data else 0
        except BlockingIOError:
            return 0


# ---- The test case -----------------------------------------------------------------------------

_table_bytes = None


def table_bytes():
    """The localization table of a narrow cone, made once per process."""
    global _table_bytes
    if _table_bytes is None:
        with tempfile.TemporaryDirectory() as folder:
            config = pathlib.Path(folder) / "map.toml"
            config.write_text(GRID + "[sonar]\nbeam_half_angle_deg = 3\nsigma_pointing_deg = 1\n"
                              "sigma_range_mm = 100\n")
            out = pathlib.Path(folder) / "beam.llt"
            subprocess.run([LEADLINE, "table", "--config", config, "--out", out], check=True,
                           capture_output=True)
            _table_bytes = out.read_bytes()
    return _table_bytes


class Case(unittest.TestCase):
    def setUp(self):
        self.dir = pathlib.Path(tempfile.mkdtemp(prefix="leadline-vehicle-"))
        self.addCleanup(shutil.rmtree, self.dir, ignore_errors=True)
        (self.dir / "beam.llt").write_bytes(table_bytes())
        self.config = self.dir / "vehicle.toml"
        self.log = self.dir / "survey.lll"
        self.processes = []
        self.addCleanup(self.kill_all)
        self.topside = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.topside.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        self.topside.bind(("127.0.0.1", 0))
        self.topside.setblocking(False)
        self.addCleanup(self.topside.close)
        self.received = b""
        self.write_config()

    def write_config(self, extra="", log=True, interval_ms=40):
        port = self.topside.getsockname()[1]
        self.config.write_text(
            GRID + "[sonar]\nmax_range_mm = 30000\n"
            f"[frame]\nlat = {LATITUDE}\nlon = {LONGITUDE}\n"
            "[navigation]\nmax_wait_ms = 300\n"
            "[[mount]]\nname = \"down\"\ntable = \"beam.llt\"\n"
            f"[[port]]\nuri = \"serial:{self.dir}/sonar\"\ndriver = \"ping1d\"\n"
            f"optional = true\ninterval_ms = {interval_ms}\n"
            f"[[port]]\nuri = \"serial:{self.dir}/nmea\"\ndriver = \"nmea\"\n"
            "optional = true\n"
            f"[link]\nuri = \"udp:127.0.0.1:{port}\"\nstatus_interval_s = 0.5\n" +
            ("[log]\npath = \"survey.lll\"\n" if log else "") + extra)

    def start(self, *arguments, **options):
        process = subprocess.Popen(
            [VEHICLE, "--config", str(self.config), "--json", *map(str, arguments)],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)
        self.processes.append(process)
        return process

    def kill_all(self):
        for process in self.processes:
            if process.poll() is None:
                process.kill()
            process.communicate()

    def run_vehicle(self, *arguments):
        done = subprocess.run([VEHICLE, *map(str, arguments)], capture_output=True, text=True,
                              timeout=PATIENCE_S, check=False)
        self.assertGreaterEqual(done.returncode, 0, f"killed: {done.stderr}")
        return done

    def expect(self, done, code, *parts):
        self.assertEqual(done.returncode, code, f"{done.args}\n{done.stderr}{done.stdout}")
        for part in parts:
            self.assertIn(part, done.stderr)
        if code != OK:
            self.assertIn("leadline-vehicle: error: ", done.stderr)
        return done

    def listen(self):
        """Takes what the link has brought."""
        while select.select([self.topside], [], [], 0)[0]:
            self.received += self.topside.recv(65536)
        return self.received

    def heard(self, *kinds):
        return [payload for payload in frames(self.listen())[0] if payload[0] in kinds]

    def stop(self, process, code=OK):
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=PATIENCE_S)
        self.assertEqual(process.returncode, code, err)
        return out, err

    def serve(self, process, sonar, instruments, sonar_pty, nmea_pty, until):
        """Plays the devices in real time until `until()` is true."""
        deadline = time.monotonic() + PATIENCE_S
        pending = b""
        while not until():
            self.assertIsNone(process.poll(), "the vehicle is gone")
            self.assertLess(time.monotonic(), deadline, "it never came to that")
            sonar_pty.write(sonar.take(sonar_pty.read()))
            pending += instruments.say(time.monotonic_ns() // 1000)
            pending = pending[nmea_pty.write(pending):][-65536:]
            self.listen()
            time.sleep(0.002)

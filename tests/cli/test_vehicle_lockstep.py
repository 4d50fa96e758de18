"""Virtual time: the emulator's side of the lockstep in Python. A flight takes as long as its arithmetic, and
the same inputs make the same map, the same frames and the same log, bit for bit."""

import json
import pathlib
import socket
import struct
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from vehicle import (  # noqa: E402
    CHUNK, CYCLE, DELTA, INPUT, OK, PATIENCE_S, Case, Instruments, Log, Ping1d, Pty)

PORTS, LINK = 16, 15
GRANT, ANSWER, FINISH = 1, 2, 3
MAGIC = 0x314B4C4C
MESSAGE = struct.Struct("<IIq16Q")


class Emulator:
    """Grants instants and plays both devices in virtual time."""

    def __init__(self, folder):
        self.ptys = [Pty(folder / "sonar"), Pty(folder / "nmea")]
        self.sonar, self.instruments = Ping1d(), Instruments()
        self.path = str(folder / "clock")
        self.listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.listener.bind(self.path)
        self.listener.listen(1)
        self.listener.settimeout(PATIENCE_S)
        self.peer = None
        self.written = [0] * PORTS
        self.taken = [0] * PORTS

    def accept(self):
        self.peer, _ = self.listener.accept()
        self.peer.settimeout(PATIENCE_S)

    def close(self):
        for end in [self.listener, self.peer, *self.ptys]:
            if end is not None:
                end.close()
        pathlib.Path(self.path).unlink(missing_ok=True)

    def put(self, port, data):
        written = self.ptys[port].write(data)
        assert written == len(data), "the pty is full: the vehicle reads nothing"
        self.written[port] += written

    def message(self, kind, t_us):
        self.peer.sendall(MESSAGE.pack(MAGIC, kind, t_us, *self.written))

    def answer(self):
        data = b""
        while len(data) < MESSAGE.size:
            piece = self.peer.recv(MESSAGE.size - len(data))
            if not piece:
                return None
            data += piece
        magic, kind, t_us, *counts = MESSAGE.unpack(data)
        assert magic == MAGIC and kind == ANSWER
        return t_us, counts

    def requests(self, port, total):
        """Exactly the bytes that the vehicle says it has written."""
        data = b""
        while self.taken[port] + len(data) < total:
            data += self.ptys[port].read(total - self.taken[port] - len(data))
        self.taken[port] += len(data)
        return data

    def step(self, t_us):
        self.put(1, self.instruments.say(t_us))
        self.message(GRANT, t_us)
        answer = self.answer()
        if answer is None:
            return False
        assert answer[0] == t_us
        self.put(0, self.sonar.take(self.requests(0, answer[1][0])))
        return True


class Lockstep(Case):
    def fly(self, name, steps, step_us=20_000, before=None):
        """A whole flight; returns its summary and its log."""
        folder = self.dir / name
        folder.mkdir()
        (folder / "beam.llt").write_bytes((self.dir / "beam.llt").read_bytes())
        self.config = folder / "vehicle.toml"
        here, self.dir = self.dir, folder
        self.write_config()
        self.dir = here
        emulator = Emulator(folder)
        self.addCleanup(emulator.close)
        process = self.start("--clock", f"lockstep:{emulator.path}")
        emulator.accept()
        for step in range(steps):
            if before is not None:
                before(emulator, step)
            self.assertTrue(emulator.step(1_000_000 + step * step_us), "the vehicle is gone")
            self.listen()
        emulator.message(FINISH, 0)
        out, err = process.communicate(timeout=PATIENCE_S)
        self.assertEqual(process.returncode, OK, err)
        return json.loads(out), Log(folder / "survey.lll"), err

    def test_the_same_flight_twice_is_the_same_flight(self):
        first, log, _ = self.fly("first", 1500)  # half a minute
        second, again, _ = self.fly("second", 1500)
        self.assertGreater(first["pings_mapped"], 300)
        self.assertGreater(first["cells_sent"], 50)
        for key in ["map_hash", "cells_hash", "pings_in", "pings_mapped", "cells_sent", "delta_bytes"]:
            self.assertEqual(first[key], second[key], key)
        self.assertEqual(log.bad, 0)
        # Up to the end of the flight; how long the link is listened to afterwards is real time.
        self.assertEqual(log.cycles()[:1500], again.cycles()[:1500])
        self.assertEqual([c[1] for c in log.cycles()[:1500]],
                         [1_000_000 + i * 20_000 for i in range(1500)])
        self.assertEqual(log.of(DELTA), again.of(DELTA))
        flown = {n: self.input_of(log, n) for n in (0, 1)}
        self.assertEqual(flown, {n: self.input_of(again, n) for n in (0, 1)})
        self.assertGreater(len(flown[0]), 500)

    @staticmethod
    def input_of(log, port):
        """(cycle, bytes) of one port: what the vehicle took, and when."""
        return [(p[1:5], p[5:13], p[14:]) for p in log.of(CHUNK) if p[13] == port]

    def test_exactly_what_was_granted_is_read(self):
        _, log, _ = self.fly("exact", 200)
        taken = sum(len(p[14:]) for p in log.of(CHUNK) if p[13] == 1)
        sentences = len(Instruments.sentences(0))
        self.assertEqual(taken % sentences, 0)
        # In every cycle the sentences of that instant, none early, none late.
        for payload in log.of(CHUNK):
            if payload[13] == 1:
                cycle = struct.unpack("<I", payload[1:5])[0]
                t_us = struct.unpack("<q", payload[5:13])[0]
                self.assertEqual(t_us, 1_000_000 + cycle * 20_000)
                self.assertEqual(len(payload[14:]) % sentences, 0)

    def test_a_plug_is_pulled_in_virtual_time(self):
        def pull(emulator, step):
            if step == 200:
                emulator.ptys[0].unplug()
            if step == 300:
                emulator.ptys[0].plug()
                emulator.sonar = Ping1d()
        summary, log, err = self.fly("pulled", 1200, before=pull)
        self.assertIn("sonar:115200: lost", err)
        self.assertEqual(log.bad, 0)
        answers = [struct.unpack("<I", p[1:5])[0] for p in log.of(CHUNK) if p[13] == 0]
        self.assertFalse([cycle for cycle in answers if 201 < cycle < 300])
        self.assertTrue([cycle for cycle in answers if cycle > 600])
        self.assertGreater(summary["pings_mapped"], 100)

    def test_an_emulator_that_dies_ends_the_flight_in_order(self):
        emulator = Emulator(self.dir)
        self.addCleanup(emulator.close)
        process = self.start("--clock", f"lockstep:{emulator.path}")
        emulator.accept()
        for step in range(50):
            self.assertTrue(emulator.step(step * 20_000))
        emulator.peer.close()
        _, err = process.communicate(timeout=PATIENCE_S)
        self.assertEqual(process.returncode, INPUT)
        self.assertIn(f"leadline-vehicle: error: lockstep:{emulator.path}: the other side is gone", err)
        log = Log(self.log)
        self.assertEqual(log.bad, 0)
        self.assertEqual(log.end()["cycle_count"], 50)
        self.assertEqual(len(log.of(CYCLE)), 50)

    def test_an_emulator_that_breaks_the_rules(self):
        for name, data in [("time", MESSAGE.pack(MAGIC, GRANT, -1, *[0] * 16)),
                           ("magic", MESSAGE.pack(1, GRANT, 1, *[0] * 16)),
                           ("kind", MESSAGE.pack(MAGIC, 9, 1, *[0] * 16))]:
            folder = self.dir / name
            folder.mkdir()
            emulator = Emulator(folder)
            process = self.start("--clock", f"lockstep:{emulator.path}", "--log", "")
            emulator.accept()
            emulator.message(GRANT, 1000)
            self.assertIsNotNone(emulator.answer())
            emulator.peer.sendall(data)
            _, err = process.communicate(timeout=PATIENCE_S)
            self.assertEqual(process.returncode, INPUT, name)
            self.assertIn("the other side breaks the protocol", err)
            emulator.close()

    def test_nobody_listens(self):
        process = self.start("--clock", f"lockstep:{self.dir}/nobody")
        _, err = process.communicate(timeout=PATIENCE_S)
        self.assertEqual(process.returncode, INPUT)
        self.assertIn("no emulator listens there", err)


if __name__ == "__main__":
    unittest.main()

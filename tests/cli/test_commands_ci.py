"""Commands with real programs over UDP: done once through a link that loses a third, and by nobody else."""

import hashlib
import json
import os
import pathlib
import random
import resource
import select
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from vehicle import (  # noqa: E402
    BRIEF, CYCLE, OK, PATIENCE_S, Case, Instruments, Log, Ping1d, Pty, brief_fields, crc32c, frames)

LEADLINE = os.environ["LEADLINE"]
REPLAY = pathlib.Path(os.environ["LEADLINE_BUILD"]) / "firmware" / "leadline-replay"
USAGE, OUTPUT, REFUSED, NO_ANSWER = 2, 4, 6, 7


def frame_of(payload):
    raw = payload + struct.pack("<I", crc32c(payload))
    out = bytearray()
    for block in raw.split(b"\0"):
        out += bytes([len(block) + 1]) + block
    return b"\0" + bytes(out) + b"\0"


class Relay(threading.Thread):
    """Between a program that speaks to `port` and the vehicle that was told `self.vehicle_side`. Loses frames."""

    def __init__(self, vehicle_side, loss):
        super().__init__(daemon=True)
        self.vehicle_side, self.loss, self.random = vehicle_side, loss, random.Random(5)
        self.program_side = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.program_side.bind(("127.0.0.1", 0))
        self.port = self.program_side.getsockname()[1]
        self.vehicle = self.program = None
        self.up, self.down, self.stopping = [], b"", False

    def run(self):
        while not self.stopping:
            for source in select.select([self.vehicle_side, self.program_side], [], [], 0.05)[0]:
                try:
                    data, sender = source.recvfrom(65536)
                except OSError:
                    continue
                lost = self.random.random() < self.loss
                if source is self.vehicle_side:
                    self.vehicle = sender
                    self.down += data
                    if self.program and not lost:
                        self.program_side.sendto(data, self.program)
                else:
                    self.program = sender
                    self.up += [data]
                    if self.vehicle and not lost:
                        self.vehicle_side.sendto(data, self.vehicle)

    def close(self):
        self.stopping = True
        self.join()
        self.program_side.close()


class Commands(Case):
    def setUp(self):
        super().setUp()
        self.key = self.dir / "command.key"
        self.leadline(OK, "key", "new", self.key, "--vehicle", "3")
        self.write_config(f"[commands]\nkey = \"{self.key}\"\nvehicle = 3\n")
        self.relay = None

    def leadline(self, code, *arguments):
        done = subprocess.run([LEADLINE, *map(str, arguments)], capture_output=True, text=True,
                              timeout=PATIENCE_S, check=False)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done

    def connect(self, loss=0.0):
        self.relay = Relay(self.topside, loss)
        self.relay.start()
        self.addCleanup(self.relay.close)

    def order(self, code, *arguments, key=None, timeout=60, link=None):
        done = self.leadline(code, "command", "--link", link or f"udp:127.0.0.1:{self.relay.port}", "--key",
                             key or self.key, "--timeout", timeout, "--json", *arguments)
        return json.loads(done.stdout)

    def wait_for(self, condition):
        deadline = time.monotonic() + PATIENCE_S
        while not condition():
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.02)

    def texts(self):
        return [payload[11:11 + payload[10]].decode() for payload in frames(self.relay.down)[0]
                if payload[0] == 4]

    def secret(self):
        lines = dict(line.split(" ", 1) for line in self.key.read_text().splitlines())
        return bytes.fromhex(lines["key"]), int(lines["id"], 16)

    def forge(self, counter, body, version=1, vehicle=3):
        key, key_id = self.secret()
        payload = struct.pack("<BBIHQ", 0x45, version, key_id, vehicle, counter) + body
        return payload + hashlib.blake2b(b"leadline command 1" + payload, key=key,
                                         digest_size=16).digest()

    def answers(self):
        return [struct.unpack("<IQB", payload[1:14]) for payload in frames(self.relay.down)[0]
                if payload[0] == 7]

    def test_a_flight_with_commands_through_a_bad_link_replays(self):
        sonar = Ping1d()
        self.connect(loss=0.3)
        process = self.start()
        said, failures = [], []

        def talk():
            try:
                self.wait_for(lambda: self.relay.vehicle is not None and sonar.answers > 20)
                for code, *words in [(OK, "stop"), (OK, "start"), (OK, "set", "max_tile_age_ms=300"),
                                     (REFUSED, "set", "min_range_mm=2000000000"), (REFUSED, "save"),
                                     (OK, "tiles", "0", "4"), (OK, "origin", "--at", "-16", "-16", "4"),
                                     (OK, "start", "--name", "F\u00f6rde"),
                                     (OK, "slice", "north", "--rows", "16", "--at", "0", "0", "9")]:
                    said.append(self.order(code, *words))
                before = sonar.answers
                self.wait_for(lambda: sonar.answers > before + 20)
            except Exception as error:  # noqa: BLE001: told by the main thread
                failures.append(error)
        talker = threading.Thread(target=talk)
        talker.start()
        self.fly(process, sonar, lambda: not talker.is_alive())
        talker.join()
        self.assertEqual(failures, [])
        self.assertEqual([each["result"] for each in said], ["done", "done", "done", "out_of_range", "not_here",
                                                             "done", "done", "done", "done"])
        self.assertEqual([each["counter"] for each in said[:8]], list(range(1, 9)))
        self.assertTrue(said[-1]["slice"]["complete"])
        out, _ = self.stop(process)
        summary = json.loads(out)
        self.assertGreater(summary["pings_mapped"], 20)
        # Without key and counter the log does the same again.
        self.key.unlink()
        done = self.leadline(OK, "replay", self.log, "--json", "--out", self.dir / "replay")
        self.assertEqual(json.loads(done.stdout)["map_hash"], summary["map_hash"])
        self.assertTrue(json.loads(done.stdout)["same_as_flight"])
        again = subprocess.run([REPLAY, self.log], capture_output=True, text=True, check=False)
        self.assertEqual(again.returncode, 0, again.stderr)
        self.assertIn("same_as_flight=true", again.stdout)
        self.assertIn(summary["map_hash"], again.stdout)
        # The maps lie where the last origin was, under the last name: the vehicle's, the one that went down, the model.
        self.leadline(OK, "receive", "--link", f"file:{self.log}", "--out", self.dir / "received")
        grids = {}
        for name in ["replay", "received"]:
            lines = (self.dir / name / "depth.asc").read_text().splitlines()
            grids[name] = dict(line.split() for line in lines[:6])
            self.assertEqual(float(grids[name]["xllcorner"]), -16.0, name)
            self.assertEqual(float(grids[name]["yllcorner"]), -16.0, name)
        self.assertEqual(grids["replay"], grids["received"])
        place = (self.dir / "replay" / "map.toml").read_text()
        self.assertIn("F\u00f6rde", place)
        self.assertRegex(place, r"origin_mm = \[-16000, -16000, 4000\]")

    def test_nobody_else_and_nothing_twice(self):
        self.connect()
        process = self.start()
        self.wait_for(lambda: self.relay.vehicle is not None)
        self.order(OK, "stop")
        self.order(OK, "start")
        recorded = list(self.relay.up)
        count = len(self.answers())
        other = self.dir / "other.key"
        self.leadline(OK, "key", "new", other, "--vehicle", "3")
        self.order(NO_ANSWER, "stop", key=other, timeout=2)
        self.wait_for(lambda: "Command refused: another key" in self.texts())
        # What was recorded; another version, another vehicle, a wrong tag.
        last = recorded[-1]
        bad = [frame_of(self.forge(9, bytes([2]), version=0)), frame_of(self.forge(9, bytes([2]), vehicle=4)),
               frame_of(self.forge(9, bytes([2]))[:-1] + b"\0")]
        for data in [each for each in recorded if each != last] + bad:
            self.topside.sendto(data, self.relay.vehicle)
        time.sleep(1.0)
        self.assertEqual(len(self.answers()), count)
        # The last one is answered, as before.
        self.topside.sendto(last, self.relay.vehicle)
        self.wait_for(lambda: len(self.answers()) > count)
        self.assertEqual(self.answers()[-1], self.answers()[count - 1])

        # A power cut between counter and effect: not done, and said so.
        counter = self.dir / "command.key.taken"
        taken = 1000
        order = self.forge(taken, bytes([2]))
        process.kill()
        process.communicate()
        counter.write_text("\n".join([
            "leadline-counter 1", f"key {self.secret()[1]:08X}", f"counter {taken}", f"tag {order[-16:].hex()}", ""]))
        process = self.start()
        self.relay.vehicle = None
        self.wait_for(lambda: self.relay.vehicle is not None)
        self.topside.sendto(frame_of(order), self.relay.vehicle)
        self.wait_for(lambda: self.answers()[-1][1:] == (taken, 7))
        count = len(self.answers())
        for data in recorded:  # and the old ones are still old
            self.topside.sendto(data, self.relay.vehicle)
        time.sleep(0.5)
        self.assertEqual(len(self.answers()), count)
        # The sender is behind now, is told so, and catches up.
        self.order(NO_ANSWER, "stop", timeout=2)
        self.wait_for(lambda: "Command refused: its counter was used before" in self.texts())
        self.leadline(OK, "key", "advance", self.key, "--by", "2000")
        self.order(OK, "stop")
        self.assertIn(f"counter {self.answers()[-1][1]}\n", counter.read_text())
        self.stop(process)

    def test_while_receive_or_monitor_have_the_link(self):
        self.connect()
        process = self.start()
        self.wait_for(lambda: self.relay.vehicle is not None)
        for words in [["receive", "--out", str(self.dir / "map")], ["monitor", "--http", "127.0.0.1:0"]]:
            shared = self.dir / words[0]
            holder = subprocess.Popen([LEADLINE, *words, "--link", f"udp:127.0.0.1:{self.relay.port}", "--share",
                                       str(shared)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
            self.addCleanup(holder.kill)
            self.wait_for(shared.is_socket)
            self.assertEqual(shared.stat().st_mode & 0o7777, 0o600)
            link = f"unix:{shared}"
            said = [self.order(code, *order, link=link) for code, *order in [
                (OK, "stop"), (OK, "start"), (REFUSED, "set", "min_range_mm=2000000000"),
                (OK, "slice", "north", "--rows", "16", "--at", "0", "0", "9")]]
            self.assertEqual([each["result"] for each in said], ["done", "done", "out_of_range", "done"])
            self.assertTrue(said[-1]["slice"]["complete"])
            # Who has no key gets nothing done here either.
            other = self.dir / f"{words[0]}.key"
            self.leadline(OK, "key", "new", other, "--vehicle", "3")
            self.order(NO_ANSWER, "stop", key=other, timeout=1, link=link)
            again = self.leadline(OUTPUT, *words, "--link", "udp:@127.0.0.1:0", "--share", shared)
            self.assertIn("in use", again.stderr)
            holder.send_signal(signal.SIGINT)
            self.assertEqual(holder.wait(PATIENCE_S), OK, holder.stderr.read())
            holder.stderr.close()
            self.assertFalse(shared.exists())
            self.order(NO_ANSWER, "stop", timeout=0.5, link=link)
        done = self.leadline(USAGE, "receive", "--link", f"file:{self.log}", "--share", self.dir / "no")
        self.assertIn("is no link to share", done.stderr)
        self.stop(process)

    def fly(self, process, sonar, until):
        """Devices on ptys until `until()`."""
        ptys = [Pty(self.dir / "sonar"), Pty(self.dir / "nmea")]
        for pty in ptys:
            self.addCleanup(pty.close)
        listen, self.listen = self.listen, lambda: None  # the relay has the socket
        self.serve(process, sonar, Instruments(), *ptys, until)
        self.listen = listen

    def test_saved_by_command_it_is_on_the_disk(self):
        self.config.write_text(self.config.read_text() + "[store]\npath = \"map.llp\"\n")
        self.connect()
        process = self.start()
        sonar = Ping1d()
        self.fly(process, sonar, lambda: sonar.answers > 60 and self.relay.vehicle is not None)
        self.assertEqual(self.order(OK, "stop")["result"], "done")
        self.assertEqual(self.order(OK, "save")["result"], "done")
        self.wait_until_sent(self.log)
        process.kill()  # as a power cut
        process.communicate()
        flown = self.known_cells(self.log)
        self.assertGreater(flown, 0)
        again = self.dir / "again.lll"
        self.config.write_text(self.config.read_text().replace("survey.lll", "again.lll"))
        process = self.start()
        self.relay.vehicle = None
        self.wait_for(lambda: self.relay.vehicle is not None)
        self.wait_until_sent(again)
        _, err = self.stop(process)
        self.assertIn("resumes a map of", err)
        self.assertEqual(self.known_cells(again), flown)

    def wait_until_sent(self, log):
        """Until nothing waits for the link, and the store has had its tile a cycle for all 16."""
        now_ms = brief_fields([each for each in frames(self.relay.down)[0] if each[0] == BRIEF][-1])["t_ms"]

        def sent():
            records = Log(log).records
            first = next((i for i, each in enumerate(records)
                          if each[0] == CYCLE and struct.unpack("<q", each[5:13])[0] >= now_ms * 1000), None)
            later = records[first:] if first is not None else []
            told = [brief_fields(each) for each in later if each[0] == BRIEF]
            return (sum(each[0] == CYCLE for each in later) >= 40 and bool(told) and
                    told[-1]["tiles_known"] > 0 and told[-1]["tiles_dirty"] == 0)

        self.wait_for(sent)

    def known_cells(self, log):
        return json.loads(self.leadline(OK, "receive", "--link", f"file:{log}", "--json").stdout)["known_cells"]

    def test_a_full_disk_for_the_counter_refuses_commands(self):
        self.connect()
        process = self.start()
        self.wait_for(lambda: self.relay.vehicle is not None)
        self.order(OK, "stop")
        taken = self.dir / "command.key.taken"
        before, answers = taken.read_text(), len(self.answers())
        # Nothing that the vehicle writes may be longer than that: neither counter nor log.
        limits = resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (16, resource.RLIM_INFINITY))
        self.order(NO_ANSWER, "start", timeout=2)
        self.assertEqual(taken.read_text(), before)
        self.assertEqual(len(self.answers()), answers)
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, limits)
        # With room again: the next command is taken, and the one before was never done.
        self.assertEqual(self.order(OK, "stop")["counter"], 3)
        self.assertIn("counter 3\n", taken.read_text())
        _, err = self.stop(process, OUTPUT)  # its log has a gap
        self.assertIn("commands are refused, their counter cannot be written: File too large", err)

    def test_keys_that_are_none_are_refused_with_what_to_do(self):
        self.connect()
        done = self.run_vehicle("--config", self.config, "--check-config")
        self.assertEqual(done.returncode, OK, done.stderr)
        self.assertIn(f"key = \"{self.key}\"", done.stdout)
        self.assertIn("commands: key", done.stderr)
        self.assertEqual(self.key.stat().st_mode & 0o7777, 0o600)
        text = self.key.read_text()
        flipped = "1" if text[-2] != "1" else "2"
        for content, mode, words in [
                (text, 0o644, "others may read"), (text, 0o660, "others may read"), ("", 0o600, "is no key"),
                (text[:-3] + "\n", 0o600, "is no key"), (text + "x", 0o600, "is no key"),
                (text[:-2] + flipped + "\n", 0o600, "damaged"), (text.replace("key 1", "key 2", 1), 0o600, "newer"),
                (text.replace("vehicle 3", "vehicle 0"), 0o600, "is no key"), ("x" * 5000, 0o600, "is no key")]:
            self.key.write_text(content)
            self.key.chmod(mode)
            done = self.run_vehicle("--config", self.config, "--check-config")
            self.assertEqual(done.returncode, USAGE, words)
            self.assertIn(words, done.stderr)
            done = self.leadline(USAGE, "command", "--link", f"udp:127.0.0.1:{self.relay.port}", "--key", self.key,
                                 "stop")
            self.assertIn(words, done.stderr)
        self.key.write_text(text.replace("vehicle 3", "vehicle 4"))
        done = self.run_vehicle("--config", self.config, "--check-config")
        self.assertIn("is the key of vehicle 4, this one is [commands] vehicle = 3", done.stderr)
        self.key.write_text(text)
        self.leadline(OUTPUT, "key", "new", self.key)
        taken = self.dir / "command.key.taken"
        for content, words in [("leadline-counter 1\n", "damaged"),
                               (taken.read_text().replace("key ", "key 1", 1)[:30], "damaged"),
                               (f"leadline-counter 1\nkey 00000001\ncounter 5\ntag {'0' * 32}\n", "another key")]:
            taken.write_text(content)
            done = self.run_vehicle("--config", self.config, "--check-config")
            self.assertEqual(done.returncode, USAGE)
            self.assertIn(words, done.stderr)


if __name__ == "__main__":
    unittest.main()

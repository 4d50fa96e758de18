"""Flights in real time over ptys and UDP: a whole one, pulled plugs, full disks, a killed vehicle."""

import json
import os
import pathlib
import resource
import signal
import struct
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from vehicle import (  # noqa: E402
    ALARM_PORT_LOST, ALARM_RECORDER_LOST, CHUNK, CONFIG, CYCLE, DELTA, END, GAP, HEADER, HELLO, OK, OUTPUT,
    BRIEF, PATIENCE_S, STATUS, TABLE, Case, Instruments, Log, Ping1d, Pty, brief_fields, crc32c)


def alarms_of(status):
    if status[0] == STATUS:
        return struct.unpack("<I", status[13:17])[0]
    return brief_fields(status)["alarms"]


class Flight(Case):
    def setUp(self):
        super().setUp()
        self.sonar, self.instruments = Ping1d(), Instruments()
        self.sonar_pty = Pty(self.dir / "sonar")
        self.nmea_pty = Pty(self.dir / "nmea")
        self.addCleanup(self.sonar_pty.close)
        self.addCleanup(self.nmea_pty.close)

    def play(self, process, until):
        self.serve(process, self.sonar, self.instruments, self.sonar_pty, self.nmea_pty, until)

    def raised(self, bit):
        """Whether the newest status has that alarm."""
        statuses = self.heard(STATUS, BRIEF)
        return bool(statuses) and bool(alarms_of(statuses[-1]) & bit)

    def test_a_whole_flight_is_mapped_sent_and_recorded(self):
        process = self.start()
        self.play(process, lambda: len(self.heard(DELTA)) >= 10)
        out, err = self.stop(process)
        summary = json.loads(out)
        self.assertGreater(summary["pings_mapped"], 10)
        self.assertGreater(summary["nav_samples"], 10)
        self.assertTrue(summary["drained"])
        self.assertEqual(summary["records_lost"], 0)
        for part in ["port 0 serial:", "port 1 serial:", "link udp:127.0.0.1:"]:
            self.assertIn(part, err)

        log = Log(self.log)
        self.assertEqual(log.bad, 0)
        self.assertEqual(summary["log_bytes"], self.log.stat().st_size)
        self.assertEqual(log.types[0], HEADER)
        self.assertEqual(log.types[-1], END)
        end = log.end()
        self.assertEqual(f"0x{end['map_hash']:016x}", summary["map_hash"])
        self.assertEqual(f"0x{end['cells_hash']:016x}", summary["cells_hash"])
        self.assertEqual(end["pings_in"], summary["pings_in"])
        self.assertEqual(end["cycle_count"], summary["cycles"])
        # Configuration and tables are in it, whole.
        header = log.records[0]
        config_crc, config_size, tables, table_crc, table_size = struct.unpack("<IIBII",
                                                                               header[41:58])
        config = log.blob(CONFIG)
        self.assertEqual((crc32c(config), len(config)), (config_crc, config_size))
        table = log.blob(TABLE)
        self.assertEqual(tables, 1)
        self.assertEqual((crc32c(table), len(table)), (table_crc, table_size))
        self.assertEqual(table, (self.dir / "beam.llt").read_bytes())
        # Every cycle with as many chunks as it says, in order, right before it.
        chunks = 0
        for number, payload in enumerate(p for p in log.records if p[0] in (CHUNK, CYCLE)):
            if payload[0] == CHUNK:
                chunks += 1
                continue
            cycle, _, _, count, _ = struct.unpack("<IqIHH", payload[1:])
            self.assertEqual(count, chunks, f"cycle {cycle}, record {number}")
            chunks = 0
        cycles = log.cycles()
        self.assertEqual([cycle[0] for cycle in cycles], list(range(summary["cycles"])))
        self.assertEqual(sorted(cycle[1] for cycle in cycles), [cycle[1] for cycle in cycles])
        # What went down the link is what the log has of it.
        sent = [payload for payload in log.records if payload[0] < 0x40]
        self.assertEqual(len(self.heard(HELLO)), len([p for p in sent if p[0] == HELLO]))
        self.assertEqual([p for k in (HELLO, DELTA, STATUS, BRIEF) for p in self.heard(k)],
                         [p for k in (HELLO, DELTA, STATUS, BRIEF) for p in sent if p[0] == k])

    def test_a_pulled_plug_is_reported_and_put_back(self):
        process = self.start()
        self.play(process, lambda: self.sonar.answers > 5)
        for _ in range(3):
            self.sonar_pty.unplug()
            self.play(process, lambda: self.raised(ALARM_PORT_LOST))
            self.sonar, before = Ping1d(), self.sonar.answers
            self.sonar_pty.plug()
            self.play(process, lambda: self.sonar.answers > 5)
            self.play(process, lambda: not self.raised(ALARM_PORT_LOST))
        _, err = self.stop(process)
        self.assertEqual(err.count("port 0 serial:%s/sonar:115200: lost" % self.dir), 3)
        self.assertEqual(err.count("port 0 serial:%s/sonar:115200: open" % self.dir), 4)
        self.assertNotIn("port 1 serial:%s/nmea:115200: lost" % self.dir, err)
        self.assertGreater(before, 0)

    def test_a_device_that_is_not_there_is_refused_unless_optional(self):
        self.sonar_pty.unplug()
        text = self.config.read_text().replace("optional = true\n", "")
        self.config.write_text(text)
        process = self.start()
        _, err = process.communicate(timeout=PATIENCE_S)
        self.assertEqual(process.returncode, 2)
        self.assertIn("port 0: \"serial:%s/sonar:115200\": No such file" % self.dir, err)
        self.config.write_text(text.replace("%s/sonar" % self.dir, str(self.dir)))
        process = self.start()
        _, err = process.communicate(timeout=PATIENCE_S)
        self.assertEqual(process.returncode, 2)
        self.assertIn("port 0: \"serial:%s:115200\": is a folder" % self.dir, err)

    def test_a_device_that_comes_later_and_one_that_never_does(self):
        self.nmea_pty.unplug()
        self.sonar_pty.unplug()
        process = self.start()
        self.play(process, lambda: self.raised(ALARM_PORT_LOST))
        self.nmea_pty.plug()
        self.play(process, lambda: len(self.heard(STATUS, BRIEF)) > 3)
        out, err = self.stop(process)
        self.assertIn("port 0 serial:%s/sonar:115200: not there yet: No such file" % self.dir, err)
        self.assertIn("port 1 serial:%s/nmea:115200: open" % self.dir, err)
        self.assertGreater(json.loads(out)["nav_samples"], 0)

    def test_a_flood_on_one_port_starves_no_other(self):
        self.instruments.interval_us = 100_000
        process = self.start()
        flood = b"$GPXXX," + b"x" * 4000

        def play_flooded():
            self.nmea_pty.write(flood)
            return self.sonar.answers > 40
        self.play(process, play_flooded)
        out, _ = self.stop(process)
        self.assertGreater(json.loads(out)["pings_in"], 20)
        self.assertEqual(json.loads(out)["records_lost"], 0)

    def test_a_full_disk_costs_records_and_nothing_else(self):
        limit = 120_000

        def limited():
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
        process = self.start(preexec_fn=limited)
        self.play(process, lambda: self.raised(ALARM_RECORDER_LOST))
        deltas = len(self.heard(DELTA))
        self.play(process, lambda: len(self.heard(DELTA)) > deltas + 3)  # the mapping goes on
        out, err = self.stop(process, OUTPUT)
        self.assertIn("not recorded from here on, mapping goes on: File too large", err)
        summary = json.loads(out)
        self.assertGreater(summary["records_lost"], 0)
        self.assertLessEqual(self.log.stat().st_size, limit)
        log = Log(self.log)
        self.assertEqual(log.bad, 0)  # whole frames up to the last that fitted
        # Cycles follow one another but where a gap says that they do not.
        last, marked = -1, False
        for payload in log.records:
            marked = marked or payload[0] == GAP
            if payload[0] == CYCLE:
                number = struct.unpack("<I", payload[1:5])[0]
                self.assertTrue(number == last + 1 or marked, f"{last} -> {number}")
                last, marked = number, False

    def test_a_disk_that_has_room_again_is_recorded_on_with_the_gap_marked(self):
        disk = self.dir / "disk"
        disk.mkdir()
        if os.geteuid() != 0 or os.system(f"mount -t tmpfs -o size=256k none {disk} 2>/dev/null") != 0:
            self.skipTest("cannot mount a small disk here")
        self.addCleanup(os.system, f"umount {disk}")
        ballast = disk / "ballast"
        ballast.write_bytes(bytes(100 * 1024))
        process = self.start("--log", disk / "survey.lll")
        self.play(process, lambda: self.raised(ALARM_RECORDER_LOST))
        ballast.unlink()
        self.play(process, lambda: not self.raised(ALARM_RECORDER_LOST))
        out, err = self.stop(process, OUTPUT)
        self.assertIn("mapping goes on: No space left on device", err)
        self.assertIn("recording again; ", err)
        log = Log(disk / "survey.lll")
        self.assertEqual(log.bad, 0)
        gaps = log.gaps()
        self.assertEqual([gap[1] for gap in gaps], [1] * len(gaps))
        self.assertEqual(sum(gap[2] for gap in gaps), json.loads(out)["records_lost"])
        self.assertEqual(log.types[-1], END)
        missing = sum(b - a - 1 for a, b in zip([c[0] for c in log.cycles()],
                                                [c[0] for c in log.cycles()][1:]))
        self.assertGreater(missing, 0)

    def test_a_device_that_takes_nothing_is_no_log(self):
        process = self.start("--log", "/dev/full")
        self.play(process, lambda: self.raised(ALARM_RECORDER_LOST) and self.heard(DELTA))
        out, err = self.stop(process, OUTPUT)
        self.assertIn("log /dev/full: not recorded from here on", err)
        self.assertEqual(json.loads(out)["log_bytes"], 0)

    def test_a_killed_vehicle_leaves_a_log_up_to_its_last_record(self):
        process = self.start()
        self.play(process, lambda: len(self.heard(DELTA)) >= 3)
        process.kill()
        process.communicate()
        log = Log(self.log)
        self.assertLessEqual(log.bad, 1)
        self.assertEqual(log.types[0], HEADER)
        self.assertEqual(log.of(END), [])
        numbers = [cycle[0] for cycle in log.cycles()]
        self.assertEqual(numbers, list(range(len(numbers))))
        self.assertGreater(len(log.of(DELTA)), 0)
        # The next start keeps it, and is another session.
        first_session = log.records[0][21:25]
        time.sleep(1.1)  # sessions are told apart by the second
        self.received, self.sonar = b"", Ping1d()
        process = self.start()
        self.play(process, lambda: self.sonar.answers > 0 and self.heard(STATUS))
        out, _ = self.stop(process)
        again = self.dir / "survey.1.lll"
        self.assertEqual(json.loads(out)["log"], str(again))
        self.assertNotEqual(Log(again).records[0][21:25], first_session)
        self.assertEqual(Log(self.log).cycles()[-1][0], numbers[-1])

    def test_sigterm_is_an_order_as_well_and_a_second_signal_cuts_it_short(self):
        self.write_config(log=False)
        process = self.start("--drain-s", "3600", "--link", "tcp:127.0.0.1:9")  # nobody there
        deadline = time.monotonic() + PATIENCE_S
        self.play(process, lambda: self.sonar.answers > 10)
        process.send_signal(signal.SIGTERM)
        while process.poll() is None:  # waits for the link, until it is told not to
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.2)
            process.send_signal(signal.SIGTERM)
        out, _ = process.communicate()
        self.assertEqual(process.returncode, OK)
        self.assertIsNone(json.loads(out)["log"])
        self.assertFalse(self.log.exists())

    def test_resend_requests_are_heard_and_answered(self):
        process = self.start()
        self.play(process, lambda: len(self.heard(DELTA)) >= 3)
        hello = self.heard(HELLO)[0]
        _, sender = self.wait_for_sender(process)
        tag = struct.unpack("<H", self.heard(DELTA)[0][1:3])[0]
        request = bytes([0x40]) + struct.pack("<H", tag) + bytes([1, 0, 15])  # tiles 0 .. 15
        frame = frame_of(request)
        self.assertTrue(hello)

        def answered():
            self.topside.sendto(frame, sender)
            statuses = self.heard(STATUS)
            return bool(statuses) and self.uplink_seen()
        self.play(process, answered)
        self.stop(process)
        uplink = [p for p in Log(self.log).of(CHUNK) if p[13] == 255]
        self.assertTrue(uplink)
        self.assertEqual(uplink[0][14:], frame)

    def wait_for_sender(self, process):
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline and process.poll() is None:
            try:
                data, sender = self.topside.recvfrom(65536)
                self.received += data
                return data, sender
            except BlockingIOError:
                time.sleep(0.01)
        self.fail("the vehicle says nothing")
        return None

    def uplink_seen(self):
        return any(p[13] == 255 for p in Log(self.log).of(CHUNK))


def frame_of(payload):
    """proto/SPEC.md, for payloads below 250 bytes."""
    raw = payload + struct.pack("<I", crc32c(payload))
    out = bytearray()
    for block in raw.split(b"\0"):
        out += bytes([len(block) + 1]) + block
    return b"\0" + bytes(out) + b"\0"


if __name__ == "__main__":
    unittest.main()

#!/usr/bin/env python3
"""The chain's commands - simulate, replay, receive, export, emulate - by what scripts rely on: exit codes,
messages, results, and what remains when one of them is killed."""

import json
import os
import pathlib
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from contract import COMPARISON, INPUT, LEADLINE, OK, OUTPUT, USAGE, Case  # noqa: E402
from vehicle import VEHICLE, crc32c  # noqa: E402

# Ten by ten metres in three lines: a minute and a half, flown in about a second.
SMALL = ["--set", "north_count=40", "--set", "east_count=40", "--set", "line_spacing_m=4",
         "--set", "settle_s=2"]
MAP = ["depth.asc", "depth.png", "depth.tif", "receive.json", "sigma.asc"]
DATUM = "sea surface"
PATIENCE_S = 180  # for what takes a moment; nothing here asserts how long it took


def cobs(data):
    out, block = bytearray(), bytearray()
    for byte in data:
        if byte:
            block.append(byte)
            if len(block) < 254:
                continue
            out += b"\xff" + block
        else:
            out += bytes([len(block) + 1]) + block
        block = bytearray()
    return bytes(out + bytes([len(block) + 1]) + block)


def uncobs(body):
    out, at = bytearray(), 0
    while at < len(body):
        code = body[at]
        out += body[at + 1:at + code] + (b"\0" if code != 255 and at + code < len(body) else b"")
        at += code
    return bytes(out)


def frame(payload):
    return b"\0" + cobs(payload + crc32c(payload).to_bytes(4, "little")) + b"\0"


def wait_for(condition, what):
    end = time.monotonic() + PATIENCE_S
    while not condition():
        if time.monotonic() > end:
            raise AssertionError(f"waited for {what}")
        time.sleep(0.02)


class Chain(Case):
    """One small flight for all tests of a class: simulate writes it once."""

    @classmethod
    def setUpClass(cls):
        cls.kept = tempfile.TemporaryDirectory(prefix="leadline-chain-")
        cls.addClassCleanup(cls.kept.cleanup)
        cls.flight = pathlib.Path(cls.kept.name) / "flight"
        subprocess.run([LEADLINE, "simulate", *SMALL, "--out", str(cls.flight)], check=True,
                       stdout=subprocess.DEVNULL, timeout=PATIENCE_S)
        cls.log = (cls.flight / "survey.lll").read_bytes()
        # The link's bytes alone, as a receiver hears them: frames of types below 0x40.
        cls.frames = [part for part in cls.log.split(b"\0") if part]

    def write(self, name, data):
        path = self.dir / name
        path.write_bytes(data)
        return path

    def downlink(self):
        """Frames of the log that went over the link, each with its delimiters."""
        kept = []
        for body in self.frames:
            # The type is the first byte behind the first COBS code (a type is never zero).
            if len(body) > 1 and body[1] < 0x40 and body[0] > 1:
                kept.append(b"\0" + body + b"\0")
        return kept

    def receive(self, data, *more):
        path = self.write("link.bin", data)
        return self.run_leadline("receive", "--link", f"file:{path}", "--out", self.out, "--json", *more)


class Simulate(Chain):
    def test_leaves_everything_that_other_commands_want(self):
        self.assertEqual(sorted(os.listdir(self.flight)), sorted([
            "beam.llt", "flight.json", "map.toml", "pings.csv", "survey.lll", "touched.asc",
            "truth.asc", "vehicle.toml"]))
        flight = json.loads((self.flight / "flight.json").read_text())
        self.assertIs(flight["topside_equals_vehicle"], True)
        self.assertIs(flight["drained"], True)
        self.expect(self.run_leadline("map", "--pings", self.flight / "pings.csv", "--config",
                                      self.flight / "map.toml", "--out", self.out), OK)
        self.expect(self.run_leadline("compare", self.out / "depth.asc", self.flight / "truth.asc",
                                      "--mask", self.flight / "touched.asc", "--max-rmse-cells", 1,
                                      "--min-coverage", 0.9), OK)

    def test_errors(self):
        self.expect(self.run_leadline("simulate", "--set", "altitud_m=3", "--out", self.out), USAGE,
                    "did you mean altitude_m")
        self.expect(self.run_leadline("simulate", "--terrain", "/nowhere.tif", "--out", self.out), INPUT,
                    "/nowhere.tif")
        self.expect(self.run_leadline("simulate", *SMALL, "--out", "/proc/leadline"), OUTPUT)
        self.expect(self.run_leadline("simulate", *SMALL, "--out", self.out, limit_bytes=20000), OUTPUT,
                    "File too large")
        self.assert_no_results()


class Returns(Case):
    def test_returns_behind_fish_are_mapped_and_replayed(self):
        found = {}
        for returns in (1, 3):
            out = self.dir / f"flight{returns}"
            self.expect(self.run_leadline(
                "simulate", *SMALL, "--set", "profile=true", "--set", "fish_fraction=0.5", "--set",
                f"max_returns={returns}", "--set", "quality_weight_percent=50", "--out", out), OK)
            self.assertIn(f"max_returns = {returns}\n", (out / "vehicle.toml").read_text())
            replay = self.expect(self.run_leadline("replay", out / "survey.lll", "--json"), OK)
            found[returns] = json.loads(replay.stdout)
            self.assertIs(found[returns]["same_as_flight"], True)
        # The same pings, of which more is in the map.
        self.assertEqual(found[1]["pings_fused"], found[3]["pings_fused"])
        self.assertNotEqual(found[1]["map_hash"], found[3]["map_hash"])
        self.expect(self.run_leadline("simulate", "--set", "max_returns=4", "--out", self.out), USAGE,
                    "max_returns")


class Replay(Chain):
    def test_says_the_hashes_and_writes_a_map(self):
        done = self.expect(self.run_leadline("replay", self.flight / "survey.lll", "--out", self.out), OK)
        self.assertRegex(done.stdout, r"^map_hash=0x[0-9a-f]{16} link_hash=0x[0-9a-f]{16} ")
        self.assertIn("the same as when it flew", done.stdout)
        self.assertEqual(done.stderr, "")
        self.assertEqual(sorted(os.listdir(self.out)), sorted([
            "depth.asc", "depth.png", "depth.tif", "map.toml", "model.llm", "pings.csv", "replay.json",
            "sigma.asc"]))
        self.assertEqual((self.out / "pings.csv").read_bytes(),
                         (self.flight / "pings.csv").read_bytes())
        # What it writes is what query and render read.
        self.expect(self.run_leadline("query", self.out, "--from", "1,1,11", "--to", "9,9,12"), OK)

    def test_truncated_logs(self):
        for share in (0.02, 0.3, 0.7, 0.999):
            path = self.write("cut.lll", self.log[:int(len(self.log) * share)])
            done = self.run_leadline("replay", path, "--json")
            if share < 0.1:
                self.assertIn(done.returncode, (OK, INPUT), done.stderr)
                continue
            self.expect(done, OK, "the log")
            self.assertIsNone(json.loads(done.stdout)["same_as_flight"])

    def test_a_log_with_a_hole_is_not_the_flight(self):
        hole = len(self.log) // 2
        path = self.write("hole.lll", self.log[:hole] + self.log[hole + 20000:])
        done = self.expect(self.run_leadline("replay", path), COMPARISON, "gap:", "cycles are missing",
                           "the log has gaps")
        self.assertIn("not the same", done.stdout)

    def test_errors(self):
        self.expect(self.run_leadline("replay", "/nowhere.lll"), INPUT, "/nowhere.lll")
        self.expect(self.run_leadline("replay", self.flight), INPUT)
        self.expect(self.run_leadline("replay", self.pings), INPUT, "no log")
        self.expect(self.run_leadline("replay"), USAGE)
        self.expect(self.run_leadline("replay", self.flight / "survey.lll", "--out", "/proc/x"), OUTPUT)


class Receive(Chain):
    def test_a_log_is_a_link(self):
        done = self.expect(self.run_leadline("receive", "--link", f"file:{self.flight}/survey.lll",
                                             "--out", self.out, "--json"), OK)
        result = json.loads(done.stdout)
        self.assertIs(result["topside_equals_vehicle"], True)
        self.assertEqual(result["incomplete_tiles"], 0)
        self.assertGreater(result["known_cells"], 1000)
        self.assertGreater(result["bytes_per_changed_cell"], 0)
        self.assertEqual(sorted(os.listdir(self.out)), MAP)
        self.assertEqual(json.loads((self.out / "receive.json").read_text())["cells_hash"],
                         result["cells_hash"])

    def test_names_and_work_come_over_the_link(self):
        result = json.loads(self.expect(self.receive(b"".join(self.downlink())), OK).stdout)
        self.assertEqual(result["survey_name"], "emulated")
        self.assertEqual(result["frame"]["vertical_datum"], DATUM)
        self.assertGreater(result["work_max_voxels"], 0)
        self.assertLess(result["work_max_voxels"], result["work_bound_voxels"])
        # The map carries them on, whatever it becomes.
        self.assert_named(self.out)
        # Nothing of the texts in a hello of minor 0: the map is the same, and says less.
        old = []
        for whole in self.downlink():
            payload = uncobs(whole[1:-1])[:-4]
            if payload[0] == 1:
                payload = payload[:2] + b"\0" + payload[3:86 + 4 * payload[85]]
            old.append(frame(payload))
        earlier = json.loads(self.expect(self.receive(b"".join(old)), OK).stdout)
        self.assertEqual(earlier["cells_hash"], result["cells_hash"])
        self.assertNotIn("survey_name", earlier)
        self.assertNotIn("vertical_datum", earlier["frame"])
        self.assertIn("vertical datum: not stated", self.exported(self.out))

    def exported(self, source):
        return self.expect(self.run_leadline("export", source, "--format", "xyz168", "--out", "-"),
                           OK).stdout

    def assert_named(self, source):
        text = self.exported(source)
        self.assertIn("vertical datum: " + DATUM, text)
        self.assertIn(", survey emulated\n", text)
        picture = self.dir / "again.tif"
        self.expect(self.run_leadline("export", source, "--format", "geotiff", "--out", picture), OK)
        self.assertIn(b"LEADLINE_SURVEY", picture.read_bytes())
        self.assertIn("vertical datum: " + DATUM, self.exported(picture))

    def test_logs_and_replays_are_named(self):
        self.assert_named(self.flight / "survey.lll")
        self.expect(self.run_leadline("replay", self.flight / "survey.lll", "--out", self.out), OK)
        self.assert_named(self.out)
        toml = (self.out / "map.toml").read_text()
        self.assertIn(f'vertical_datum = "{DATUM}"\n', toml)
        self.assertIn('[survey]\nname = "emulated"\n', toml)

    def test_the_link_alone_is_enough(self):
        done = self.expect(self.receive(b"".join(self.downlink()), "--compare-log",
                                        self.flight / "survey.lll"), OK)
        self.assertIs(json.loads(done.stdout)["topside_equals_vehicle"], True)

    def test_repeated_reordered_and_broken_frames(self):
        clean = json.loads(self.receive(b"".join(self.downlink())).stdout)
        frames = self.downlink()
        twice = [frame for frame in frames for _ in range(2)]
        swapped = [frames[k ^ 1] if k ^ 1 < len(frames) else frames[k] for k in range(len(frames))]
        noise = b"\x42\x52" + bytes(range(1, 256)) * 3
        for data in (b"".join(twice), b"".join(swapped), noise.join(frames)):
            result = json.loads(self.expect(self.receive(data), OK).stdout)
            self.assertEqual(result["cells_hash"], clean["cells_hash"])
        # A byte changed in every fourth frame costs those frames; what is left is right, and says what
        # it lacks.
        broken = [frame[:3] + bytes([frame[3] ^ 1]) + frame[4:] if k % 4 == 3 and k > 8 else frame
                  for k, frame in enumerate(frames)]
        result = json.loads(self.expect(self.receive(b"".join(broken)), OK).stdout)
        self.assertGreater(result["damaged_frames"], 0)
        self.assertLess(result["deltas"], clean["deltas"])
        done = self.expect(self.receive(b"".join(broken), "--compare-log", self.flight / "survey.lll"),
                           COMPARISON, "not the vehicle's")
        self.assertIs(json.loads(done.stdout)["topside_equals_vehicle"], False)

    def test_cut_anywhere(self):
        data = b"".join(self.downlink())
        for size in range(len(data) // 2, len(data) // 2 + 12):
            self.expect(self.receive(data[:size]), OK)

    def test_another_major_version(self):
        hello = bytes([1, 2]) + bytes(150)
        done = self.expect(self.receive(frame(hello)), INPUT, "version 2", "use the leadline")
        self.assertEqual(done.stdout, "")
        self.assert_no_results()

    def test_a_vehicle_of_another_major_is_told(self):
        process, link = self.start()
        link.settimeout(PATIENCE_S)
        link.send(frame(bytes([1, 2]) + bytes(150)))
        self.assertEqual(link.recv(100), frame(b"\x41\x01\x01"))
        process.communicate(timeout=PATIENCE_S)
        self.assertEqual(process.returncode, INPUT)

    def test_a_monitor_tells_both_and_waits_for_a_vehicle_of_its_own_major(self):
        errors = open(self.dir / "monitor.err", "w+")
        self.addCleanup(errors.close)
        process = subprocess.Popen([LEADLINE, "monitor", "--link", "udp:@127.0.0.1:0", "--http", "127.0.0.1:0", "--out",
                                    str(self.out)], stdout=subprocess.DEVNULL, stderr=errors, text=True)
        self.addCleanup(process.kill)
        said = (self.dir / "monitor.err").read_text
        wait_for(lambda: "the page is at" in said(), "the monitor")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
            link.connect(("127.0.0.1", int(said().split("listening at port ")[1].split()[0])))
            link.settimeout(PATIENCE_S)
            link.send(frame(bytes([1, 2]) + bytes(150)))
            self.assertEqual(link.recv(100), frame(b"\x41\x01\x01"))
            wait_for(lambda: "error: receive: the vehicle speaks version 2" in said(), "the reason")
            self.assertIsNone(process.poll())
            for part in self.downlink():
                link.send(part)
            wait_for(lambda: "cells of 250 mm" in said(), "the other vehicle")
        process.send_signal(signal.SIGINT)
        self.assertEqual(process.wait(timeout=PATIENCE_S), OK, said())
        self.assertTrue((self.out / "depth.asc").exists())

    def test_a_command_to_a_vehicle_of_another_major(self):
        key = self.dir / "command.key"
        self.expect(self.run_leadline("key", "new", key, "--vehicle", 1), OK)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
            vehicle.bind(("127.0.0.1", 0))
            vehicle.settimeout(PATIENCE_S)
            process = subprocess.Popen([LEADLINE, "command", "--link", f"udp:127.0.0.1:{vehicle.getsockname()[1]}", "--key",
                                        str(key), "stop"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
            self.addCleanup(process.kill)
            order, sender = vehicle.recvfrom(1000)
            self.assertEqual(order[2], 0x45)
            vehicle.sendto(frame(bytes([1, 2]) + bytes(150)), sender)
            while (word := vehicle.recv(1000)) == order:
                pass  # said again meanwhile
            self.assertEqual(word, frame(b"\x41\x01\x01"))
            out, err = process.communicate(timeout=PATIENCE_S)
        self.assertEqual((process.returncode, out), (INPUT, ""), err)
        self.assertIn("version 2", err)
        self.assertIn("use the leadline that belongs to the vehicle", err)

    # The first map's folder cannot be made; the second comes, is written, and the exit code tells.
    def test_a_map_that_ended_and_cannot_be_written_does_not_end_the_next(self):
        frames = self.downlink()
        hello = next(part for part in frames if part[2] == 1)
        payload = bytearray(uncobs(hello[1:-1])[:-4])
        payload[16] = 2  # its session
        self.out.mkdir()
        (self.out / "survey-1-session-0").write_text("in the way")
        done = self.receive(b"".join(frames) + frame(bytes(payload)))
        self.expect(done, OUTPUT, "the map that ended is not written", "survey-1-session-0", "a new map begins")
        self.assertEqual(json.loads(done.stdout)["session"], 2)
        self.assertTrue((self.out / "depth.asc").exists())

    def test_a_map_that_cannot_be_written_for_a_while(self):
        process, link = self.start("--every", "0.1")
        said = (self.dir / "receive.err").read_text
        for part in self.downlink():
            link.send(part)
        wait_for(lambda: (self.out / "receive.json").exists(), "the first map")
        self.out.rename(self.dir / "aside")
        self.out.write_text("in the way")
        wait_for(lambda: "error: the map is not written" in said(), "the error")
        self.out.unlink()
        wait_for(lambda: "the map is written again" in said(), "the map")
        self.assertEqual(said().count("error: the map is not written"), 1)
        self.out.rename(self.dir / "aside2")
        self.out.write_text("in the way")
        wait_for(lambda: said().count("error: the map is not written") == 2, "the error again")
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=PATIENCE_S)
        self.assertEqual(process.returncode, OUTPUT, said())
        self.assertGreater(json.loads(output)["known_cells"], 1000)

    def test_nothing_of_a_vehicle(self):
        self.expect(self.receive(b""), INPUT, "no map came")
        self.expect(self.receive(bytes(range(256)) * 50), INPUT, "no hello")
        self.expect(self.run_leadline("receive", "--link", "udp:@127.0.0.1:0", "--wait", 0.2), INPUT,
                    "no map came")

    def test_a_survey_that_was_not_asked_for(self):
        self.expect(self.receive(b"".join(self.downlink()), "--survey", 77), INPUT, "passed over",
                    "no map came")
        self.expect(self.receive(b"".join(self.downlink()), "--survey", 1), OK)

    def test_errors(self):
        self.expect(self.run_leadline("receive"), USAGE, "--link")
        self.expect(self.run_leadline("receive", "--link", "upd:@:9100"), USAGE, "upd")
        self.expect(self.run_leadline("receive", "--link", "file:/nowhere.bin"), INPUT, "/nowhere.bin")
        self.expect(self.run_leadline("receive", "--link", f"file:{self.dir}"), INPUT, "is a folder")
        self.expect(self.run_leadline("receive", "--link", "udp:@:0", "--survey", "-1"), USAGE, "--survey", "-1")
        self.expect(self.receive(b"".join(self.downlink()), "--compare-log", "/nowhere.lll"), INPUT,
                    "/nowhere.lll")
        self.assertTrue((self.out / "depth.tif").exists(), "a wrong log cost the map")
        missing = self.dir / "ttyMissing"
        self.expect(self.run_leadline("receive", "--link", f"serial:{missing}:115200", "--wait", 0.2), INPUT,
                    "ttyMissing:115200: not there yet: No such file", "no map came")
        self.expect(self.run_leadline("receive", "--link", f"serial:{self.dir}:115200"), INPUT, "is a folder")
        self.out = "/proc/leadline"
        self.expect(self.receive(b"".join(self.downlink())), OUTPUT, "/proc/leadline")

    def start(self, *more):
        """A receiver at a UDP port of its own choice."""
        errors = open(self.dir / "receive.err", "w+")
        self.addCleanup(errors.close)
        process = subprocess.Popen([LEADLINE, "receive", "--link", "udp:@127.0.0.1:0", "--out",
                                    str(self.out), "--json", *more], stdout=subprocess.PIPE,
                                   stderr=errors, text=True)
        self.addCleanup(process.kill)
        path = self.dir / "receive.err"
        wait_for(lambda: "listening at port" in path.read_text(), "the receiver")
        port = int(path.read_text().split("listening at port ")[1].split()[0])
        link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        link.connect(("127.0.0.1", port))
        self.addCleanup(link.close)
        return process, link

    def test_live_map_on_demand_then_at_the_end(self):
        process, link = self.start()
        for part in self.downlink():
            link.send(part)
        time.sleep(0.2)
        process.send_signal(signal.SIGUSR1)
        wait_for(lambda: (self.out / "receive.json").exists(), "the map on demand")
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=PATIENCE_S)
        self.assertEqual(process.returncode, OK)
        self.assertGreater(json.loads(output)["known_cells"], 1000)

    def test_killed_it_leaves_what_it_had_written(self):
        process, link = self.start("--every", "0.1")
        for part in self.downlink():
            link.send(part)
        wait_for(lambda: (self.out / "receive.json").exists(), "the first map")
        process.kill()
        process.communicate()
        left = {name for name in os.listdir(self.out) if not name.startswith(".")}
        self.assertEqual(sorted(left), MAP)
        json.loads((self.out / "receive.json").read_text())


class Export(Chain):
    def test_a_log_in_every_format(self):
        log = self.flight / "survey.lll"
        for name, start in (("m.tif", b"II*\0"), ("m.asc", b"ncols 40"), ("m.xyz", b"# leadline"),
                            ("m.ply", b"ply\nformat binary_little_endian")):
            self.expect(self.run_leadline("export", log, "--out", self.dir / name), OK)
            self.assertTrue((self.dir / name).read_bytes().startswith(start), name)
        soundings = [line.split() for line in (self.dir / "m.xyz").read_text().splitlines()
                     if line[0] not in "#"]
        # The flight's origin stands in its log: longitude, latitude, depth down, sigma.
        for longitude, latitude, depth, sigma in soundings:
            self.assertAlmostEqual(float(longitude), 7.89, delta=0.001)
            self.assertAlmostEqual(float(latitude), 54.18, delta=0.001)
            self.assertGreater(float(depth), 10)
            self.assertGreater(float(sigma), 0)
        done = self.expect(self.run_leadline("export", log, "--format", "xyz168", "--frame", "local",
                                             "--out", "-"), OK)
        self.assertIn("not georeferenced", done.stdout)
        self.assertLess(float(done.stdout.splitlines()[-1].split()[2]), -10)

    def test_what_is_left_of_a_log(self):
        """One whose beginning is lost still holds hellos and tiles; an empty one says that it has no map."""
        rest = self.write("rest.lll", self.log[20000:])
        self.expect(self.run_leadline("export", rest, "--out", self.dir / "rest.tif"), OK)
        self.expect(self.run_leadline("export", self.write("empty.lll", b""), "--out", self.dir / "none.tif"),
                    INPUT, "empty.lll: no map in it")

    def test_folders_of_receive_and_replay(self):
        received = self.dir / "received"
        replayed = self.dir / "replayed"
        self.expect(self.run_leadline("receive", "--link", f"file:{self.flight}/survey.lll", "--out",
                                      received), OK)
        self.expect(self.run_leadline("replay", self.flight / "survey.lll", "--out", replayed), OK)
        for folder in (received, replayed):
            done = self.expect(self.run_leadline("export", folder, "--format", "xyz162", "--out", "-"),
                               OK)
            self.assertIn("# longitude latitude", done.stdout)
        done = self.expect(self.run_leadline("export", replayed, "--layer", "voxels", "--out",
                                             self.dir / "v.ply"), OK)
        self.assertIn("occupied voxels, elevation in metres, positive up", done.stdout)
        done = self.expect(self.run_leadline("export", received, "--layer", "sigma", "--out",
                                             self.dir / "s.asc"), OK)
        self.assertIn("one standard deviation", done.stdout)
        self.assertNotIn("elevation", done.stdout)
        self.expect(self.run_leadline("export", received, "--layer", "voxels", "--out",
                                      self.dir / "v.ply"), INPUT, "model.llm")

    def test_errors(self):
        self.expect(self.run_leadline("export", "/nowhere", "--out", self.dir / "m.tif"), INPUT,
                    "/nowhere")
        self.expect(self.run_leadline("export", self.flight / "survey.lll", "--out", "m.dat"), USAGE,
                    "--format")
        self.expect(self.run_leadline("export", self.flight / "survey.lll", "--out", "/proc/m.tif"),
                    OUTPUT)
        self.expect(self.run_leadline("export", self.flight / "survey.lll", "--out", "/dev/full",
                                      "--format", "xyz162"), OUTPUT, "No space left")


class Emulate(Chain):
    def configure(self, *more):
        self.expect(self.run_leadline("emulate", *SMALL, "--write-config", self.dir, "--ports",
                                      self.dir / "ports", "--link", "udp:127.0.0.1:9", *more), OK)

    def start(self, *arguments, program=LEADLINE):
        process = subprocess.Popen([program, *map(str, arguments)], stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True)
        self.addCleanup(process.kill)
        return process

    def start_both(self):
        emulator = self.start("emulate", *SMALL, "--ports", self.dir / "ports", "--out", self.out,
                              "--lockstep", self.dir / "clock")
        vehicle = self.start("--config", self.dir / "vehicle.toml", "--clock",
                             f"lockstep:{self.dir}/clock", program=VEHICLE)
        return emulator, vehicle

    def finish(self, process, code):
        output, errors = process.communicate(timeout=PATIENCE_S)
        self.assertEqual(process.returncode, code, errors)
        return output, errors

    def test_the_vehicle_accepts_the_configuration(self):
        for more in ([], ["--udp", "127.0.0.1:19090"], ["--set", "ping360=true"]):
            self.configure(*more)
            subprocess.run([VEHICLE, "--config", str(self.dir / "vehicle.toml"), "--check-config"],
                           check=True, stdout=subprocess.DEVNULL, timeout=PATIENCE_S)

    def test_lockstep_gives_the_same_flight_twice(self):
        hashes = set()
        for name in ("first", "second"):
            self.configure("--log", f"{name}.lll")
            emulator, vehicle = self.start_both()
            self.finish(emulator, OK)
            self.finish(vehicle, OK)
            done = self.expect(self.run_leadline("replay", self.dir / f"{name}.lll"), OK)
            hashes.add(done.stdout.splitlines()[0])
        self.assertEqual(len(hashes), 1)
        self.assertEqual(sorted(os.listdir(self.out)), ["emulate.json", "touched.asc", "truth.asc"])

    def test_a_killed_vehicle_ends_the_emulator_with_a_message(self):
        self.configure()
        emulator, vehicle = self.start_both()
        wait_for(lambda: (self.dir / "survey.lll").exists() and
                 (self.dir / "survey.lll").stat().st_size > 100000, "the flight")
        vehicle.kill()
        vehicle.communicate()
        self.assertIn("waited for the vehicle", self.finish(emulator, INPUT)[1])
        self.assert_no_results()
        # What the vehicle had recorded replays.
        self.expect(self.run_leadline("replay", self.dir / "survey.lll"), OK)

    def test_a_killed_emulator_ends_the_vehicle_in_order(self):
        self.configure()
        emulator, vehicle = self.start_both()
        wait_for(lambda: (self.dir / "survey.lll").exists() and
                 (self.dir / "survey.lll").stat().st_size > 100000, "the flight")
        emulator.kill()
        emulator.communicate()
        self.finish(vehicle, INPUT)
        done = self.expect(self.run_leadline("replay", self.dir / "survey.lll"), OK)
        self.assertIn("the same as when it flew", done.stdout)

    def test_real_time_ends_in_order_when_told(self):
        emulator = self.start("emulate", *SMALL, "--ports", self.dir / "ports", "--out", self.out,
                              "--speed", 5)
        wait_for(lambda: (self.dir / "ports" / "pressure").is_symlink(), "the ports")
        time.sleep(0.3)
        emulator.send_signal(signal.SIGTERM)
        self.assertIn("flew", self.finish(emulator, OK)[0])
        self.assertIn("truth.asc", os.listdir(self.out))
        self.assertEqual(list((self.dir / "ports").iterdir()), [])

    def test_errors(self):
        self.expect(self.run_leadline("emulate", "--speed", 0), USAGE, "--speed")
        self.expect(self.run_leadline("emulate", "--udp", "nonsense"), USAGE, "--udp")
        self.expect(self.run_leadline("emulate", "--set", "altitude_m=0"), USAGE, "altitude_m")
        self.expect(self.run_leadline("emulate", *SMALL, "--ports", "/proc/leadline"), OUTPUT)
        self.expect(self.run_leadline("emulate", *SMALL, "--ports", self.dir / "p", "--lockstep",
                                      "/nowhere/clock"), USAGE, "/nowhere/clock")
        self.expect(self.run_leadline("emulate", *SMALL, "--ports", self.dir / "p", "--lockstep",
                                      self.dir / "clock", "--wait", 0.1), INPUT, "waited for the vehicle")
        self.expect(self.run_leadline("emulate", "--write-config", "/proc/leadline"), OUTPUT)


if __name__ == "__main__":
    unittest.main()

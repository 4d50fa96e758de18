#!/usr/bin/env python3
"""The store of surveys by what scripts rely on: what `receive --store` leaves when it is killed, when the
disk is full and when it comes again; list, show, export, merge and difference."""

import json
import pathlib
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from contract import INPUT, LEADLINE, OK, OUTPUT, USAGE, Case  # noqa: E402

PATIENCE_S = 180
KILLS = 12
# Ten by ten metres in three lines.
SMALL = ["--set", "north_count=40", "--set", "east_count=40", "--set", "line_spacing_m=4",
         "--set", "settle_s=2"]


class Sender:
    """A vehicle's log, which holds its downlink, over and over on a TCP port, a little at a time."""

    def __init__(self, data, pieces=400, pause_s=0.004):
        self.socket = socket.create_server(("127.0.0.1", 0))
        self.port = self.socket.getsockname()[1]
        self.data, self.piece, self.pause_s = data, len(data) // pieces, pause_s
        self.closed = False
        self.sent = 0  # pieces, since the beginning
        threading.Thread(target=self.serve, daemon=True).start()

    def serve(self):
        while not self.closed:
            try:
                connection, _ = self.socket.accept()
                with connection:
                    for at in range(0, len(self.data), self.piece):
                        connection.sendall(self.data[at:at + self.piece])
                        self.sent += 1
                        time.sleep(self.pause_s)
                    while connection.recv(4096):
                        pass
            except OSError:
                pass

    def close(self):
        self.closed = True
        self.socket.close()


class Store(Case):
    @classmethod
    def setUpClass(cls):
        cls.flights = pathlib.Path(tempfile.mkdtemp(prefix="leadline-store-"))
        cls.logs = []
        for seed in (1, 2):
            folder = cls.flights / str(seed)
            subprocess.run([LEADLINE, "simulate", "--out", folder, "--seed", str(seed), *SMALL],
                           check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            cls.logs.append(folder / "survey.lll")

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.flights, ignore_errors=True)

    def setUp(self):
        super().setUp()
        self.store = self.dir / "surveys.lls"

    def receive(self, log, *more, code=OK, limit_bytes=None):
        done = self.run_leadline("receive", "--link", f"file:{log}", "--json", *more,
                                 limit_bytes=limit_bytes)
        self.expect(done, code)
        return done

    def show(self, survey):
        done = self.expect(self.run_leadline("store", "show", survey, "--json"), OK)
        return json.loads(done.stdout)

    def test_killed_at_any_moment_it_resumes(self):
        wanted = json.loads(self.receive(self.logs[0]).stdout)
        sender = Sender(self.logs[0].read_bytes())
        self.addCleanup(sender.close)
        random.seed(7)
        known = 0
        for kill in range(KILLS):
            before = sender.sent
            process = self.start("receive", "--link", f"tcp:127.0.0.1:{sender.port}", "--store", self.store)
            # After so much of the map has come, and a moment; the last one after something is in the store.
            pieces = random.randint(0, 400)
            self.wait_for(lambda: sender.sent >= before + pieces, pause_s=0.01)
            time.sleep(random.uniform(0.0, 1.2))
            if kill == KILLS - 1:
                self.wait_for(lambda: self.known(self.store) > 0)
            process.send_signal(signal.SIGKILL)
            process.communicate(timeout=PATIENCE_S)
            if not self.store.exists():
                continue
            listed = json.loads(
                self.expect(self.run_leadline("store", "list", self.store, "--json"), OK).stdout)
            self.assertLessEqual(len(listed), 1)
            if listed:
                shown = self.show(self.store)
                self.assertEqual(shown["damaged_tiles"], 0)
                self.assertGreaterEqual(shown["known_cells"], known)
                known = shown["known_cells"]
        self.assertGreater(known, 0)
        # What is missing comes from the log in the end.
        done = self.receive(self.logs[0], "--store", self.store)
        self.assertIn("resumed from", done.stderr)
        self.assertEqual(json.loads(done.stdout)["cells_hash"], wanted["cells_hash"])
        self.assertEqual(self.show(self.store)["cells_hash"], wanted["cells_hash"])

    def start(self, *words):
        process = subprocess.Popen([LEADLINE, *map(str, words)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                                   text=True)
        self.addCleanup(process.kill)
        return process

    def wait_for(self, condition, pause_s=0.2):
        deadline = time.monotonic() + PATIENCE_S
        while not condition():
            self.assertLess(time.monotonic(), deadline)
            time.sleep(pause_s)

    def known(self, store):
        listed = self.run_leadline("store", "list", store, "--json") if store.exists() else None
        surveys = json.loads(listed.stdout) if listed and listed.returncode == OK else []
        return surveys[0]["known_cells"] if surveys else 0

    def test_a_watched_map_is_kept_too_and_a_late_guest_gets_it(self):
        wanted = json.loads(self.receive(self.logs[0]).stdout)
        sender = Sender(self.logs[0].read_bytes(), pause_s=0.008)
        self.addCleanup(sender.close)
        shared = self.dir / "link.sock"

        def watch():
            return self.start("monitor", "--link", f"tcp:127.0.0.1:{sender.port}", "--http", "127.0.0.1:0", "--store",
                              self.store, "--share", shared)
        process = watch()
        self.wait_for(lambda: self.known(self.store) > 0)
        process.kill()
        process.communicate()
        process = watch()
        self.wait_for(lambda: self.known(self.store) == wanted["known_cells"])
        # The vehicle has said everything: what a guest gets now is what the monitor has.
        own = self.dir / "guest.lls"
        guest = self.start("receive", "--link", f"unix:{shared}", "--store", own)
        self.wait_for(lambda: self.known(own) == wanted["known_cells"])
        guest.send_signal(signal.SIGINT)
        guest.communicate(timeout=PATIENCE_S)
        self.assertEqual(self.show(own)["cells_hash"], wanted["cells_hash"])
        process.send_signal(signal.SIGINT)
        errors = process.communicate(timeout=PATIENCE_S)[1]
        self.assertEqual(process.returncode, OK, errors)
        self.assertIn("monitor: resumed from", errors)
        self.assertEqual(self.show(self.store)["cells_hash"], wanted["cells_hash"])
        self.expect(self.run_leadline("monitor", "--link", f"file:{self.logs[0]}", "--store", self.store), USAGE,
                    "is played")

    def test_a_full_disk_costs_the_store_only(self):
        # The limit is on the size of every file: the first map has room in the store's log, the second none.
        both = self.dir / "both.lll"
        both.write_bytes(self.logs[0].read_bytes() + self.logs[1].read_bytes())
        wanted = [json.loads(self.receive(log).stdout)["cells_hash"] for log in self.logs]
        done = self.receive(both, "--store", self.store, code=OUTPUT, limit_bytes=45000)
        self.assertIn("surveys.lls", done.stderr)
        self.assertEqual(json.loads(done.stdout)["cells_hash"], wanted[1])
        self.assertEqual(self.show(self.store)["cells_hash"], wanted[0])
        # With room again it is whole.
        self.receive(both, "--store", self.store)
        self.assertEqual([self.show(f"{self.store}#{n}")["cells_hash"] for n in (1, 2)], wanted)

    def test_surveys_are_kept_apart_merged_and_compared(self):
        for log in self.logs:
            self.receive(log, "--store", self.store)
        listed = json.loads(
            self.expect(self.run_leadline("store", "list", self.store, "--json"), OK).stdout)
        self.assertEqual([survey["number"] for survey in listed], [1, 2])
        text = self.expect(self.run_leadline("store", "list", self.store), OK).stdout
        self.assertIn("#2", text)
        one, two = f"{self.store}#1", f"{self.store}#2"

        self.expect(self.run_leadline("store", "merge", one, two, "--into", self.store, "--name",
                                      "both", "--out", self.dir / "merged"), OK)
        # A survey cannot be merged with itself, nor unnoticed with what it is part of.
        self.expect(self.run_leadline("store", "merge", one, self.logs[0], "--into", self.store), INPUT, "count twice",
                    "surveys.lls, survey 1")
        done = self.expect(self.run_leadline("store", "merge", two, f"{self.store}#3", "--out", self.dir / "again"), OK)
        self.assertIn("warning: ", done.stderr)
        self.assertIn("counts twice", done.stderr)
        merged = self.show(f"{self.store}#3")
        self.assertEqual((merged["vertical_datum"], self.show(one)["vertical_datum"]), ("sea surface", "sea surface"))
        self.assertEqual((merged["kind"], merged["name"]), ("merged", "both"))
        self.assertGreaterEqual(merged["known_cells"],
                                max(self.show(one)["known_cells"], self.show(two)["known_cells"]))
        # Two looks at one bottom: nearer to the truth than the worse of the two.
        truth = self.flights / "1" / "truth.asc"
        rmse = []
        for survey in (one, two, f"{self.store}#3"):
            self.expect(self.run_leadline("export", survey, "--out", self.dir / "s.asc"), OK)
            done = self.expect(self.run_leadline("compare", self.dir / "s.asc", truth, "--json"), OK)
            rmse.append(json.loads(done.stdout)["rmse_m"])
        self.assertLess(rmse[2], max(rmse[0], rmse[1]))
        for name in ["depth.asc", "sigma.asc", "depth.tif", "depth.png", "disputed.asc"]:
            self.assertTrue((self.dir / "merged" / name).exists(), name)

        done = self.expect(self.run_leadline("store", "difference", one, two, "--out",
                                             self.dir / "changes", "--json"), OK)
        difference = json.loads(done.stdout)
        self.assertGreater(difference["compared_cells"], 500)
        for name in ["change.asc", "significance.asc", "change.png", "difference.json"]:
            self.assertTrue((self.dir / "changes" / name).exists(), name)
        self.expect(self.run_leadline("store", "difference", one, one), OK)

        self.expect(self.run_leadline("store", "export", one, "--out", self.dir / "s.geojson"), OK)
        self.expect(self.run_leadline("render", two, "--out", self.dir / "pictures"), OK)
        self.assertTrue((self.dir / "pictures" / "uncertainty.png").exists())

    def test_errors(self):
        self.receive(self.logs[0], "--store", self.store)
        none = self.dir / "none.lls"
        self.expect(self.run_leadline("store", "list", none), INPUT, "none.lls")
        self.expect(self.run_leadline("store", "show", f"{self.store}#9"), INPUT, "no survey 9")
        self.expect(self.run_leadline("store", "merge", self.store, self.store), USAGE, "--into")
        self.expect(self.run_leadline("store", "merge", self.store, "--into", none), USAGE, "two maps")
        self.expect(self.run_leadline("store", "difference", self.store, self.store, "--significance",
                                      "0"), USAGE, "--significance")
        self.expect(self.run_leadline("receive", "--link", f"file:{self.logs[0]}", "--store",
                                      "/proc/s.lls"), OUTPUT, "/proc/s.lls")
        self.expect(self.run_leadline("monitor", f"{self.store}#9"), INPUT, "no survey 9")
        self.expect(self.run_leadline("monitor", none), INPUT, "none.lls")
        self.expect(self.run_leadline("monitor"), USAGE, "--link URI")
        for option in (["--out", self.dir / "map"], ["--speed", "2"], ["--budget", "200"], ["--store", none],
                       ["--share", self.dir / "socket"]):
            self.expect(self.run_leadline("monitor", self.store, *option), USAGE, option[0])
        none.write_bytes(b"x" * 4096)
        self.expect(self.run_leadline("receive", "--link", f"file:{self.logs[0]}", "--store", none),
                    OUTPUT, "none.lls")


if __name__ == "__main__":
    unittest.main()

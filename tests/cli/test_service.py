"""`leadline-vehicle` under a service manager: ready and alive is said by completed cycles, and to whom it says nothing there
is nobody."""

import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from contract import LEADLINE, OK, Case  # noqa: E402

VEHICLE = os.environ["LEADLINE_VEHICLE"]
TOML = pathlib.Path(os.environ["LEADLINE_ROOT"], "tests/data/small_vehicle.toml")


class Service(Case):
    def setUp(self):
        super().setUp()
        shutil.copy(TOML, self.dir / "vehicle.toml")
        subprocess.run([LEADLINE, "table", "--config", self.config, "--out", self.dir / "beam.llt"], check=True,
                       stdout=subprocess.DEVNULL)
        self.manager = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.addCleanup(self.manager.close)
        self.manager.bind(str(self.dir / "notify"))
        self.manager.settimeout(180)

    def start(self, **environment):
        process = subprocess.Popen([VEHICLE, "--config", self.dir / "vehicle.toml", "--drain-s", "0"],
                                   env=dict(os.environ, **environment), stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL)
        self.addCleanup(process.kill)
        return process

    def heard(self):
        return self.manager.recv(4096).decode().strip()

    def test_signs_of_life(self):
        process = self.start(NOTIFY_SOCKET=str(self.dir / "notify"), WATCHDOG_USEC="400000")
        self.assertEqual([self.heard() for _ in range(4)], ["READY=1"] + ["WATCHDOG=1"] * 3)
        # A program that stands still gives no sign.
        process.send_signal(signal.SIGSTOP)
        os.waitpid(process.pid, os.WUNTRACED)  # it stands
        self.manager.setblocking(False)
        try:
            while True:
                self.heard()
        except BlockingIOError:
            pass
        time.sleep(1)
        with self.assertRaises(BlockingIOError):
            self.heard()
        self.manager.settimeout(180)
        process.send_signal(signal.SIGCONT)
        self.assertEqual(self.heard(), "WATCHDOG=1")
        process.send_signal(signal.SIGTERM)
        self.assertEqual(process.wait(180), OK)
        said = []
        self.manager.setblocking(False)
        try:
            while True:
                said.append(self.heard())
        except BlockingIOError:
            pass
        self.assertIn("STOPPING=1", said)

    def test_without_a_watchdog_only_ready(self):
        process = self.start(NOTIFY_SOCKET=str(self.dir / "notify"))
        self.assertEqual(self.heard(), "READY=1")
        process.send_signal(signal.SIGTERM)
        self.assertEqual(self.heard(), "STOPPING=1")
        self.assertEqual(process.wait(180), OK)


if __name__ == "__main__":
    unittest.main()

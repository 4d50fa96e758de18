"""A flight whose link loses 30 %, reorders 5 % and doubles 5 % of the datagrams, both ways, between the real programs: in
the end the topside has the vehicle's map, cell by cell."""

import json
import pathlib
import random
import select
import signal
import socket
import subprocess
import sys
import threading
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from vehicle import DELTA, LEADLINE, OK, PATIENCE_S, Case, Instruments, Ping1d, Pty, frames  # noqa: E402

LOSS, REORDER, DOUBLE = 0.30, 0.05, 0.05
REPORT = 0x42
LONGEST_HOLD_S = 0.2  # of a late datagram that nothing follows


class Way:
    """One direction: what becomes of a datagram hangs on the seed and on its number alone."""

    def __init__(self, seed):
        self.random = random.Random(seed)
        self.late = []  # [datagrams that still go before, until when, data]
        self.lost = self.reordered = self.doubled = 0
        self.payloads = []  # that came in

    def take(self, data):
        """The datagrams that arrive now."""
        self.payloads += frames(data)[0]
        lost, late, twice = (self.random.random() < share for share in (LOSS, REORDER, DOUBLE))
        followers = self.random.randint(1, 3)
        out = []
        if lost:
            self.lost += 1
        else:
            copies = [data] * (2 if twice else 1)
            self.doubled += 1 if twice else 0
            if late:
                self.late.append([followers, time.monotonic() + LONGEST_HOLD_S, copies])
            else:
                out = copies
                for each in self.late:
                    each[0] -= 1
                    self.reordered += 1 if each[0] == 0 else 0
        return out + self.due()

    def due(self):
        now = time.monotonic()
        out = [data for left, until, copies in self.late if left <= 0 or until <= now for data in copies]
        self.late = [each for each in self.late if each[0] > 0 and each[1] > now]
        return out


class Relay(threading.Thread):
    """Between the vehicle, which was told of `vehicle_side`, and the receiver at `port`."""

    def __init__(self, vehicle_side, port, seed):
        super().__init__(daemon=True)
        self.vehicle_side, self.receiver = vehicle_side, ("127.0.0.1", port)
        self.receiver_side = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.receiver_side.bind(("127.0.0.1", 0))
        self.down, self.up = Way(seed), Way(seed + 1)
        self.vehicle, self.stopping = None, False

    def run(self):
        while not self.stopping:
            ready = select.select([self.vehicle_side, self.receiver_side], [], [], 0.05)[0]
            down, up = self.down.due(), self.up.due()
            for source in ready:
                try:
                    data, sender = source.recvfrom(65536)
                except OSError:
                    continue  # the other end is not there (any more)
                if source is self.vehicle_side:
                    self.vehicle = sender
                    down += self.down.take(data)
                else:
                    up += self.up.take(data)
            for data in down:
                self.receiver_side.sendto(data, self.receiver)
            for data in up if self.vehicle else []:
                self.vehicle_side.sendto(data, self.vehicle)

    def close(self):
        self.stopping = True
        self.join()
        self.receiver_side.close()


class BadLink(Case):
    def receive(self):
        """The receiver, and the port that it has."""
        process = subprocess.Popen(
            [LEADLINE, "receive", "--link", "udp:@127.0.0.1:0", "--out", self.dir / "topside", "--json"],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.processes.append(process)
        for line in process.stderr:
            if "listening at port" in line:
                return process, int(line.rsplit(" ", 1)[1])
        self.fail("the receiver does not listen")
        return None

    def test_the_topside_has_the_vehicles_map_in_the_end(self):
        receiver, port = self.receive()
        relay = Relay(self.topside, port, seed=3)
        relay.start()
        self.addCleanup(relay.close)
        # Small frames, so that there are many to lose.
        text = self.config.read_text().replace("[link]\n", "[link]\nmtu_bytes = 256\nrate_bytes_s = 4000\nmax_tile_age_s = 0.05\n")
        self.config.write_text(text)
        sonar, instruments = Ping1d(), Instruments()
        ptys = [Pty(self.dir / "sonar"), Pty(self.dir / "nmea")]
        for pty in ptys:
            self.addCleanup(pty.close)
        vehicle = self.start("--drain-s", PATIENCE_S / 2)
        listen, self.listen = self.listen, lambda: None  # the relay has the socket

        def enough():
            # A bottom that goes up and down: changes all the time.
            sonar.depth_mm = 8000 + sonar.answers * 137 % 4000
            # And a line that has done all that it is said to do.
            return (sum(payload[0] == DELTA for payload in list(relay.down.payloads)) >= 15 and
                    len(relay.up.payloads) >= 12 and relay.down.lost > 0 and relay.up.lost > 0 and
                    relay.down.reordered + relay.up.reordered > 0 and
                    relay.down.doubled + relay.up.doubled > 0)
        self.serve(vehicle, sonar, instruments, *ptys, enough)
        self.listen = listen
        out, _ = self.stop(vehicle)
        receiver.send_signal(signal.SIGINT)
        topside_out, err = receiver.communicate(timeout=PATIENCE_S)
        self.assertEqual(receiver.returncode, OK, err)
        summary, topside = json.loads(out), json.loads(topside_out)
        self.assertTrue(summary["drained"])
        self.assertGreater(summary["pings_mapped"], 10)
        self.assertEqual(topside["cells_hash"], summary["cells_hash"])
        self.assertGreater(topside["deltas"], 0)
        # The link was as bad as it is said to be, and both ends spoke.
        for way in (relay.down, relay.up):
            self.assertGreater(way.lost, 0)
        self.assertGreater(relay.down.reordered + relay.up.reordered, 0)
        self.assertGreater(relay.down.doubled + relay.up.doubled, 0)
        self.assertTrue(any(payload[0] == REPORT for payload in relay.up.payloads))


if __name__ == "__main__":
    unittest.main()

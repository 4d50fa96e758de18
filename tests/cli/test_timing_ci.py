"""What Linux has to do with a cycle: real time is asked for and reported, --timing tells what was observed,
and between the last byte taken and the first frame handed to the link the kernel is not called."""

import json
import pathlib
import re
import shutil
import subprocess
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from vehicle import DELTA, OK, VEHICLE, Case, Instruments, Ping1d, Pty  # noqa: E402

TAKES = {"ppoll", "read", "recvfrom", "recvmsg", "recv"}
GIVES = {"sendto", "sendmsg", "send", "write"}


class Timing(Case):
    def setUp(self):
        super().setUp()
        self.sonar, self.instruments = Ping1d(), Instruments()
        self.sonar_pty = Pty(self.dir / "sonar")
        self.nmea_pty = Pty(self.dir / "nmea")
        self.addCleanup(self.sonar_pty.close)
        self.addCleanup(self.nmea_pty.close)

    def fly(self, process, deltas):
        self.serve(process, self.sonar, self.instruments, self.sonar_pty, self.nmea_pty,
                   lambda: len(self.heard(DELTA)) >= deltas)
        return self.stop(process)

    def test_what_was_observed_is_told(self):
        out, err = self.fly(self.start("--timing"), 2)
        summary = json.loads(out)
        self.assertRegex(err, r"leadline-vehicle: memory (locked|not locked: .+), "
                              r"(SCHED_FIFO 20|ordinary scheduling: .+)\n")
        self.assertEqual(summary["memory_locked"], "memory locked" in err)
        self.assertEqual(summary["scheduling"], "fifo 20" if "SCHED_FIFO" in err else "other")
        timing = summary["timing"]
        for name in ["cycle", "slip"]:
            self.assertGreater(sum(count for _, count in timing[name]["below_us"]), 0)
            ends = [end for end, _ in timing[name]["below_us"]]
            self.assertLess(timing[name]["largest_observed_us"], ends[-1])
        self.assertEqual(sum(count for _, count in timing["cycle"]["below_us"]), summary["cycles"])

    def test_no_priority_is_asked_for_when_none_is_wanted(self):
        _, err = self.fly(self.start("--priority", "0"), 1)
        self.assertRegex(err, r"memory (locked|not locked: .+), ordinary scheduling\n")

    def test_the_kernel_is_not_called_between_taking_a_ping_and_queueing_its_deltas(self):
        if shutil.which("strace") is None:
            self.skipTest("strace is not installed")
        trace = self.dir / "trace"
        tried = subprocess.run(["strace", "-o", "/dev/null", "true"], capture_output=True, text=True,
                               check=False)
        if tried.returncode != OK:
            self.skipTest(f"strace may not trace here: {tried.stderr.strip()}")
        process = subprocess.Popen(
            ["strace", "-f", "-o", str(trace), VEHICLE, "--config", str(self.config), "--json"],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.processes.append(process)
        self.serve(process, self.sonar, self.instruments, self.sonar_pty, self.nmea_pty,
                   lambda: len(self.heard(DELTA)) >= 3)
        lines = [line.split(None, 1) for line in trace.read_text(errors="replace").splitlines()]
        main = lines[0][0]
        calls = [match.group(1) for pid, call in lines if pid == main
                 for match in [re.match(r"(\w+)\(", call)] if match]
        flown = calls[calls.index("ppoll"):]
        gaps = [(before, call) for before, call in zip(flown, flown[1:]) if call == "sendto"]
        self.assertGreater(len(gaps), 5)
        for before, call in gaps:
            self.assertIn(before, TAKES | GIVES, f"{before} before {call}")
        # And so for what devices are asked: the first that a cycle gives out follows what it took.
        for before, call in zip(flown, flown[1:]):
            if call in GIVES and before not in GIVES | TAKES:
                self.fail(f"{before} before {call}")
        # strace ends with the vehicle.
        vehicle = int(main)
        subprocess.run(["kill", "-INT", str(vehicle)], check=True)
        process.communicate(timeout=180)


if __name__ == "__main__":
    unittest.main(verbosity=2)

"""What Linux has to do with a cycle: real time is asked for and reported, --timing tells what was observed,
and between the last byte taken and the first frame handed to the link the kernel is not called."""

import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from vehicle import DELTA, OK, PATIENCE_S, VEHICLE, Case, Instruments, Ping1d, Pty  # noqa: E402

WAITS = {"ppoll"}
TAKES = {"read", "recvfrom", "recvmsg", "recv"}
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
            # In the last class that has any: each begins where the one below it ends, at half its own end.
            end = timing[name]["below_us"][-1][0]
            self.assertLess(timing[name]["largest_observed_us"], end)
            self.assertGreaterEqual(timing[name]["largest_observed_us"], end // 2)
        self.assertEqual(sum(count for _, count in timing["cycle"]["below_us"]), summary["cycles"])
        # Cycles of the end, which only empty the link, are not begun by the clock.
        self.assertLessEqual(sum(count for _, count in timing["slip"]["below_us"]), summary["cycles"])

    def test_no_priority_is_asked_for_when_none_is_wanted_and_nothing_told_that_nobody_asked(self):
        out, err = self.fly(self.start("--priority", "0"), 1)
        self.assertRegex(err, r"memory (locked|not locked: .+), ordinary scheduling\n")
        self.assertNotIn("timing", json.loads(out))

    def test_the_text_ends_with_the_largest_observed(self):
        process = subprocess.Popen([VEHICLE, "--config", str(self.config), "--timing"],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.processes.append(process)
        out, _ = self.fly(process, 1)
        head, *_, last = out[out.index("timing of "):].splitlines()
        self.assertRegex(head, r"^timing of \d+ cycles; largest observed, not a bound")
        self.assertRegex(last, r"^ *largest observed +\d+ +\d+$")

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
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)
        self.processes.append(process)
        # Who kills strace alone leaves the vehicle, and waits for it.
        self.addCleanup(lambda: process.poll() is None and os.killpg(process.pid, signal.SIGKILL))
        self.serve(process, self.sonar, self.instruments, self.sonar_pty, self.nmea_pty,
                   lambda: len(self.heard(DELTA)) >= 3)
        # strace ends with the vehicle, whose thread its first line is of.
        subprocess.run(["kill", "-INT", trace.read_text(errors="replace").split(None, 1)[0]], check=True)
        process.communicate(timeout=PATIENCE_S)
        text = trace.read_text(errors="replace")
        self.assertIn("--- SIGINT", text)
        lines = [line.split(None, 1) for line in text[:text.index("--- SIGINT")].splitlines()]
        main = lines[0][0]
        calls = [match.groups() for pid, *rest in lines if pid == main for call in rest
                 for match in [re.match(r"(\w+)\((\w*)", call)] if match]
        # Answers of a Ping1D begin so.
        sonar = re.search(r'\bread\((\d+), "BR', text).group(1)
        flown = calls[[name for name, _ in calls].index("ppoll"):]
        # Files that bytes are taken from, or sent on: devices and the link. A line written elsewhere is a call like any.
        lines_of = {fd for name, fd in flown if name in TAKES or name == "sendto"}
        self.assertIn(sonar, lines_of)
        self.assertFalse(lines_of & {"1", "2"})
        frames, after_a_ping, heard = 0, 0, False
        for before, (name, fd) in zip(flown, flown[1:]):
            heard = heard or (name, fd) == ("read", sonar)
            if name in GIVES and fd in lines_of:
                frames += name == "sendto"
                after_a_ping += heard
                heard = False
                taken = before[0] in WAITS or (before[0] in TAKES | GIVES and before[1] in lines_of)
                self.assertTrue(taken, f"{before} before {name}({fd}")
        self.assertGreater(frames, 5)
        self.assertGreater(after_a_ping, 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)

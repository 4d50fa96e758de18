"""The image that flies a Cortex-M7 (firmware/m7, leadline-m7), in real time on QEMU's board: devices at its UARTs, a map on its
link; and what its failures leave behind. They are made from outside, by QEMU's gdb server writing instructions into the image
that flies, so that nothing of the tests is in it: an undefined instruction, an address that is not there, a stack that runs
over, a cycle that never ends, and one whose fault handler never ends either.

An instruction takes 8 ns of the board's time, however slow this machine is: the watchdog counts the same.
Environment: LEADLINE, LEADLINE_VEHICLE, LEADLINE_ROOT. Standard library only.
"""

import os
import pathlib
import select
import signal
import socket
import struct
import subprocess
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "support"))
from vehicle import DELTA, HELLO, LEADLINE, Case, Instruments, Ping1d, frames  # noqa: E402

ROOT = pathlib.Path(os.environ["LEADLINE_ROOT"])
IMAGE = ROOT / "build/cortex-m7/firmware/leadline-m7.elf"
SKIPPED = 77
PATIENCE_S = 180  # for what takes some seconds on an idle machine; nothing here asserts how long it took

# Thumb: what is written over the first instructions of a function.
UNDEFINED = bytes.fromhex("00de")          # udf #0
NOT_THERE = bytes.fromhex("4ff000400068")  # mov.w r0, #0x80000000; ldr r0, [r0]
ENDLESS = bytes.fromhex("fee7")            # b .
RUN_OVER = bytes.fromhex("2de9f04ffce7")   # push {r4-r11, lr}; b to it


def symbols():
    table = {}
    for line in subprocess.run(["arm-none-eabi-nm", "-C", IMAGE], check=True, capture_output=True,
                               text=True).stdout.splitlines():
        address, _, name = line.split(" ", 2)
        table[name.split("(")[0]] = int(address, 16) & ~1
    return table


class Gdb:
    """The board stands still while one of these is open. GDB's remote protocol, as much as is needed of it."""

    def __init__(self, path):
        self.line = socket.socket(socket.AF_UNIX)
        self.line.settimeout(PATIENCE_S)
        self.line.connect(str(path))
        self.ask("?")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.ask("D")
        self.line.close()

    def byte(self):
        byte = self.line.recv(1)
        assert byte, "QEMU is gone"
        return byte

    def packet(self):
        while self.byte() != b"$":
            pass
        answer = b""
        while (byte := self.byte()) != b"#":
            answer += byte
        self.byte(), self.byte()
        self.line.sendall(b"+")
        return answer.decode()

    def ask(self, words):
        self.line.sendall(f"${words}#{sum(words.encode()) & 0xFF:02x}".encode())
        answer = self.packet()
        while answer.startswith("T") and words != "?":  # that it stopped, said unasked
            answer = self.packet()
        assert not answer.startswith("E"), f"{words}: {answer}"
        return answer

    def read(self, address, size):
        return bytes.fromhex(self.ask(f"m{address:x},{size:x}"))

    def write(self, address, data):
        assert self.ask(f"M{address:x},{len(data):x}:{data.hex()}") == "OK"


class Flight(Case):
    def setUp(self):
        super().setUp()
        block = self.dir / "vehicle.llb"
        subprocess.run([LEADLINE, "config", "compile", self.config, "--out", block], check=True,
                       capture_output=True)
        names = ["sonar", "nmea", "link", "gdb"]
        options = []
        for name in names:
            options += ["-chardev", f"socket,id={name},path={self.dir / name},server=on,wait=off"]
        for line in ["chardev:sonar", "chardev:nmea", "null", "null", "chardev:link"]:
            options += ["-serial", line]
        self.words = open(self.dir / "qemu.txt", "w+", encoding="utf-8")
        self.addCleanup(self.words.close)
        self.board = subprocess.Popen([ROOT / "toolchain/m7.sh", "fly", block, *options, "-gdb", "chardev:gdb"],
                                      stdout=self.words, stderr=self.words)
        self.processes.append(self.board)
        self.lines = {name: self.connected(name) for name in names[:3]}
        self.sonar, self.instruments = Ping1d(), Instruments()
        self.unsent = {name: b"" for name in self.lines}
        self.link_bytes = b""
        self.symbols = symbols()

    def connected(self, name):
        line = socket.socket(socket.AF_UNIX)
        self.addCleanup(line.close)
        deadline = time.monotonic() + PATIENCE_S
        while True:
            try:
                line.connect(str(self.dir / name))
                line.setblocking(False)
                return line
            except (FileNotFoundError, ConnectionRefusedError):
                self.words.seek(0)
                self.assertIsNone(self.board.poll(), self.words.read())
                self.assertLess(time.monotonic(), deadline, "no board")
                time.sleep(0.02)

    def say(self, name, data):
        self.unsent[name] += data
        try:
            self.unsent[name] = self.unsent[name][self.lines[name].send(self.unsent[name]):]
        except BlockingIOError:
            pass

    def fly(self, until):
        """Plays the devices until `until()` is true."""
        deadline = time.monotonic() + PATIENCE_S
        while not until():
            self.assertIsNone(self.board.poll(), "the board is gone")
            self.assertLess(time.monotonic(), deadline, "it never came to that")
            for name in select.select([self.lines["sonar"], self.lines["link"]], [], [], 0.02)[0]:
                data = name.recv(65536)
                if name is self.lines["link"]:
                    self.link_bytes += data
                elif data:
                    self.say("sonar", self.sonar.take(data))
            self.say("nmea", self.instruments.say(time.monotonic_ns() // 1000))

    def since_hello(self, number):
        """Frames behind the first hello of the `number`th session that the link has told of."""
        sessions, kept = [], []
        for payload in frames(self.link_bytes)[0]:
            if payload[0] == HELLO:
                session = payload[16:20]
                if session not in sessions:
                    sessions.append(session)
            if len(sessions) >= number:
                kept.append(payload)
        return kept

    def maps(self, number):
        """Whether session `number` has sent some of its map."""
        return sum(payload[0] == DELTA for payload in self.since_hello(number)) >= 2

    def drawn(self):
        """What a receiver makes of all that came: its words and the folder of its results."""
        (self.dir / "link.bin").write_bytes(self.link_bytes)
        done = subprocess.run([LEADLINE, "receive", "--link", f"file:{self.dir / 'link.bin'}", "--out",
                               self.dir / "map"], check=True, capture_output=True, text=True)
        return done.stdout + done.stderr, self.dir / "map"

    def halted(self):
        return Gdb(self.dir / "gdb")

    def told(self, core):
        """What toolchain/m7_record.py makes of the memory that outlives a restart."""
        dump = self.dir / "record.bin"
        address, size = subprocess.run([ROOT / "toolchain/m7_record.py", "where", IMAGE], check=True,
                                       capture_output=True, text=True).stdout.split()
        dump.write_bytes(core.read(int(address, 0), int(size)))
        return subprocess.run([ROOT / "toolchain/m7_record.py", "show", IMAGE, dump], check=True,
                              capture_output=True, text=True).stdout

    def test_it_maps_and_outlives_its_failures(self):
        cycle = "leadline::firmware::Vehicle::cycle"
        self.fly(lambda: self.maps(1))
        with self.halted() as core:
            self.assertIn("starts 1, 0 after a failure\nno failure\n", self.told(core))
        # what is written, and what the record has to say of it
        failures = [
            ("an undefined instruction", {cycle: UNDEFINED},
             ["usage fault", f"pc .* {cycle}", "status .* undefined instruction", "cycle [1-9]"]),
            ("an address that is not there", {cycle: NOT_THERE},
             ["bus fault", f"pc .* {cycle}", "address 0x80000000"]),
            ("a stack that runs over", {cycle: RUN_OVER}, ["bus fault|hard fault", "status "]),
            ("a cycle without end", {cycle: ENDLESS}, ["watchdog", f"pc .* {cycle}", "cycle [1-9]"]),
            ("a fault handler without end", {cycle: UNDEFINED, "leadline_fault": ENDLESS},
             ["without a record"]),
        ]
        for number, (name, writes, words) in enumerate(failures, start=1):
            with self.subTest(name):
                with self.halted() as core:
                    for function, instructions in writes.items():
                        core.write(self.symbols[function], instructions)
                self.fly(lambda: self.maps(number + 1))  # it starts over, by itself, and maps anew
                with self.halted() as core:
                    told = self.told(core)
                for word in [f"starts {number + 1}, {number} after a failure", *words]:
                    self.assertRegex(told, word)
        words, folder = self.drawn()
        self.assertEqual(words.count("Started over after a failure"), len(failures), words)
        self.assertNotIn("Clock went back", words)
        # Every session is a map of its own, the first one and those of five starts.
        self.assertEqual(len(list(folder.rglob("receive.json"))), 1 + len(failures), words)
        for line in (folder / "depth.asc").read_text().splitlines()[-64:]:
            for depth in line.split():
                self.assertTrue(float(depth) < 0 or 10.0 < float(depth) < 12.0, depth)


if __name__ == "__main__":
    done = subprocess.run([ROOT / "toolchain/setup.sh", "--m7", "--dry-run"], stdout=subprocess.DEVNULL, check=False)
    if done.returncode != 0:
        print("*skipped*: the compiler for bare metal or QEMU is not installed (toolchain/setup.sh --m7)")
        sys.exit(SKIPPED)
    subprocess.run([ROOT / "toolchain/m7.sh", "build", "leadline-m7"], check=True)
    unittest.main()

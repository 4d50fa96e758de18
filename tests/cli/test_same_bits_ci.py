"""The same logs on every target: random logs (tests/property/test_random_logs.cpp) through toolchain/replay-on.sh, whose
hashes of map, link bytes and link cells have to be those that the flight had here.

Environment: LEADLINE_ROOT, LEADLINE_BUILD; LEADLINE_SAME_BITS_COUNT (logs, default 100), LEADLINE_SAME_BITS_SEED,
LEADLINE_SAME_BITS_TARGETS (default: all below). A target whose compiler or emulator is not installed is skipped with the
reason (toolchain/setup.sh --clang --cross, toolchain/m7.sh). Standard library only.
"""

import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(os.environ["LEADLINE_ROOT"])
BUILD = pathlib.Path(os.environ["LEADLINE_BUILD"])
COUNT = os.environ.get("LEADLINE_SAME_BITS_COUNT", "100")
SEED = os.environ.get("LEADLINE_SAME_BITS_SEED", "20261122")
# Target -> what it needs of this machine.
NEEDS = {
    "native": [],
    "gcc-O0": [],
    "scalar": [],
    "clang": ["clang++-14"],
    "aarch64": ["aarch64-linux-gnu-g++", "qemu-aarch64-static"],
    "armhf": ["arm-linux-gnueabihf-g++", "qemu-arm-static"],
    "cortex-m7": ["arm-none-eabi-g++", "qemu-system-arm"],
    "armhf-v7a": ["arm-linux-gnueabihf-g++", "qemu-arm-static"],
    "gcc-O3-native": [],
    "clang-O0": ["clang++-14"],
}
# armhf-v7a: what the package is.
DEFAULT = "native gcc-O0 clang aarch64 armhf-v7a cortex-m7"
LINE = re.compile(r"^map_hash=0x[0-9a-f]{16} link_hash=0x[0-9a-f]{16} cells_hash=0x[0-9a-f]{16} "
                  r"same_as_flight=(true|false|unknown)")
SKIPPED = 77


def cpu_s():
    usage = os.times()
    return usage.children_user + usage.children_system


def make_logs(folder):
    environment = dict(os.environ, LEADLINE_RANDOM_LOGS=str(folder), LEADLINE_RANDOM_LOG_COUNT=COUNT)
    done = subprocess.run([BUILD / "tests/property.random_logs", "--seed", SEED], env=environment,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    print(done.stdout)
    if done.returncode != 0:
        sys.exit("the logs were not made")
    return sorted(folder.glob("*.lll"))


def differing(target, logs):
    """Names of the logs that come to something else there, with what was said."""
    done = subprocess.run([ROOT / "toolchain/replay-on.sh", target, *logs], stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, text=True, check=False)
    lines = done.stdout.splitlines()
    if len(lines) != len(logs) or not all(LINE.match(line) for line in lines):
        return [f"{len(lines)} lines for {len(logs)} logs, exit code {done.returncode}: "
                f"{done.stdout[-400:]} {done.stderr[-2000:]}"]
    wrong = [f"{log.name}: {line}" for log, line in zip(logs, lines) if LINE.match(line)[1] != "true"]
    if not wrong and done.returncode != 0:
        wrong = [f"exit code {done.returncode}: {done.stderr[-2000:]}"]
    return wrong


def main():
    ran, bad = 0, 0
    with tempfile.TemporaryDirectory(prefix="leadline-random-logs-") as name:
        logs = make_logs(pathlib.Path(name))
        for target in os.environ.get("LEADLINE_SAME_BITS_TARGETS", DEFAULT).split():
            missing = [tool for tool in NEEDS[target] if shutil.which(tool) is None]
            if missing:
                print(f"{target}: *skipped*: {', '.join(missing)} not installed")
                continue
            start, start_cpu = time.monotonic(), cpu_s()
            wrong = differing(target, logs)
            ran += 1
            print(f"{target}: {len(logs)} logs, {len(wrong)} differ "
                  f"({cpu_s() - start_cpu:.0f} s of CPU, {time.monotonic() - start:.0f} s, build included)")
            for each in wrong[:5]:
                print("  " + each)
            bad += len(wrong)
            if wrong:  # what differs is to be looked at
                kept = BUILD / "same-bits-failed"
                shutil.copytree(name, kept, dirs_exist_ok=True)
                print(f"  logs kept in {kept}")
            sys.stdout.flush()
    if bad:
        sys.exit(1)
    if ran == 0:
        sys.exit(SKIPPED)


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""The link between the real programs over a bad line of a real kernel, in that kernel's own time.

usage: toolchain/link_kernel.py [--rates BAUD,...] [--runs N] [--build DIR] [--json]
  --rates BAUD,...  lines, 10 bits a byte (default 1200,9600,115200)
  --runs N          runs a rate (default 4)
  --build DIR       where leadline and leadline-vehicle are (default build/release)
  --json            one JSON object a run instead of the table

A survey is flown and kept in the vehicle's store. Then, for every run, Linux starts as a plain process
(toolchain/user_mode_kernel.sh) with three machines in it: `leadline-vehicle` with that map and no devices, a line, and
`leadline receive`, which starts with nothing while the vehicle has been there for a while. The vehicle's and the topside's
network cards send at the rate of the line (netem; 5 ms each way); the line between loses 30 % of the packets, lets 5 % arrive
behind later ones and 5 % twice, each way. Counted: bytes of UDP payload that each side sent, and seconds of the guest's
clock, from the start of `receive` until it had the map that the vehicle ends with, by hash. It is asked for its map now and then,
each time 6 % later: so much the figures may be too large. In the end the vehicle is stopped, and both programs' own last
words must agree. Waiting costs nothing: the guest's clock jumps over it (time-travel=inf-cpu), and work takes none of its
time. What is lost is the kernel's own luck: no run comes again.

Exit code 0: every run ended with equal maps; 1: one did not; 77: *skipped* (no kernel, or this machine lets none start).
"""

import argparse
import ctypes
import json
import os
import pathlib
import re
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
LOSS, LATE, TWICE = 30, 5, 5  # percent
DELAY_MS = 5
FRAME_BYTES = 160  # about; what is late comes two such frames later
ETHERNET_IP_UDP_BYTES = 42
IP_UDP_BYTES = 28
LEAST_BYTES = 2500  # no map of the survey comes with fewer
QUIET_S = 2
SURVEY = ["--set", "north_count=96", "--set", "east_count=96", "--set", "line_spacing_m=8", "--set", "settle_s=2"]
SETTLE_S = 10  # the vehicle alone, until all its tiles are in memory
MOST_S = 3600
PORT = 9100


# ---- In the guest: the first process of its kernel ---------------------------------------------------------------------

def shell(*words):
    subprocess.run([str(word) for word in words], check=True)


def machines(job):
    """Two machines and a line between them: vehicle 10.0.1.1 -- 10.0.1.2 line 10.0.2.2 -- 10.0.2.1 topside."""
    ends = [("vehicle", "va", "la", 1), ("topside", "tb", "lb", 2)]
    for name in ("vehicle", "line", "topside"):
        shell("ip", "netns", "add", name)
    for name, card, other, net in ends:
        shell("ip", "link", "add", card, "netns", name, "address", f"02:00:00:00:0{net}:01", "type", "veth", "peer", "name",
              other, "netns", "line", "address", f"02:00:00:00:0{net}:02")
        for where, device, number, peer in ((name, card, 1, 2), ("line", other, 2, 1)):
            shell("ip", "-n", where, "address", "add", f"10.0.{net}.{number}/24", "dev", device)
            shell("ip", "-n", where, "link", "set", device, "up")
            # Nobody asks who is there: those packets would be lost as well.
            shell("ip", "-n", where, "neighbour", "add", f"10.0.{net}.{peer}", "lladdr", f"02:00:00:00:0{net}:0{peer}",
                  "dev", device, "nud", "permanent")
        shell("ip", "-n", name, "link", "set", "lo", "up")
        shell("ip", "-n", name, "route", "add", "default", "via", f"10.0.{net}.2")
        shell("tc", "-n", name, "qdisc", "add", "dev", card, "root", "netem", "limit", 10000, "delay", f"{DELAY_MS}ms",
              "rate", f"{job['baud'] * 8 // 10}bit", -ETHERNET_IP_UDP_BYTES)
        if job["lossy"]:
            late_ms = max(1, round(2 * FRAME_BYTES * 10_000 / job["baud"]))
            # `reorder`: the share that does not wait.
            shell("tc", "-n", "line", "qdisc", "add", "dev", other, "root", "netem", "limit", 10000, "delay", f"{late_ms}ms",
                  "reorder", f"{100 - LATE}%", "loss", f"{LOSS}%", "duplicate", f"{TWICE}%")
    shell("ip", "netns", "exec", "line", "sh", "-c", "echo 1 >/proc/sys/net/ipv4/ip_forward")


def sent_bytes(machine):
    """UDP payload that a machine has sent, up to a constant (what it said by ICMP before anybody listened)."""
    text = subprocess.run(["ip", "netns", "exec", machine, "cat", "/proc/net/netstat", "/proc/net/snmp"], check=True,
                          capture_output=True, text=True).stdout

    def value(group, name):
        lines = [line.split() for line in text.splitlines() if line.startswith(group + ":")]
        return int(lines[1][lines[0].index(name)])
    return value("IpExt", "OutOctets") - IP_UDP_BYTES * value("Udp", "OutDatagrams")


def start(machine, *words):
    return subprocess.Popen(["ip", "netns", "exec", machine, *map(str, words)], stdin=subprocess.DEVNULL,
                            stdout=subprocess.PIPE, stderr=open(f"/mnt/{machine}.err", "w"), text=True)


def stop(process):
    process.send_signal(signal.SIGINT)
    return json.loads(process.communicate()[0] or "null")


def topside_hash(receiver):
    """What the topside's map is now; None before it has one."""
    receiver.send_signal(signal.SIGUSR1)
    time.sleep(0.001)  # of the guest's time, in which work takes none
    try:
        return json.loads(pathlib.Path("/mnt/topside/receive.json").read_text()).get("cells_hash")
    except (FileNotFoundError, json.JSONDecodeError):
        return None


def watch(receiver, from_s):
    """(seconds, bytes down, bytes up, hash) from `from_s` on, until the hash has been the same for half as long again as
    it took, and QUIET_S."""
    begin, down, up = time.monotonic(), sent_bytes("vehicle"), sent_bytes("topside")
    seen, changed_s, wait_s = [], 0.0, from_s
    while not seen or seen[-1][0] < min(MOST_S, changed_s * 1.5 + QUIET_S):
        time.sleep(wait_s)
        now_s = time.monotonic() - begin
        known = topside_hash(receiver)
        if known is None or not seen or known != seen[-1][3]:
            changed_s = now_s
        seen.append((round(now_s, 3), sent_bytes("vehicle") - down, sent_bytes("topside") - up, known))
        wait_s = now_s * 0.06
    return seen


def guest(job):
    for kind, where in (("proc", "/proc"), ("sysfs", "/sys"), ("tmpfs", "/mnt"), ("tmpfs", "/run")):
        shell("mount", "-t", kind, "none", where)
    os.mkdir("/run/netns")
    os.environ.update(TMPDIR="/mnt", HOME="/mnt")
    for name in ("vehicle.toml", "beam.llt", "map.llp"):
        shutil.copy(pathlib.Path(job["flight"]) / name, "/mnt")
    config = pathlib.Path("/mnt/vehicle.toml")
    config.write_text(re.sub(r"(?m)^rate_bytes_s = .*", f"rate_bytes_s = {job['baud'] // 10}", config.read_text()))
    machines(job)
    vehicle = start("vehicle", job["vehicle"], "--config", config, "--link", f"udp:10.0.2.1:{PORT}", "--log", "", "--json",
                    "--drain-s", MOST_S)
    time.sleep(SETTLE_S)
    receiver = start("topside", job["leadline"], "receive", "--link", f"udp:@:{PORT}", "--out", "/mnt/topside", "--json")
    seen = watch(receiver, job["from_s"])
    summary, topside = stop(vehicle), stop(receiver)
    equal = [each for each in seen if each[3] == summary["cells_hash"]]
    first = equal[0] if equal else (None, None, None)
    return {"baud": job["baud"], "lossy": job["lossy"], "seconds": first[0], "bytes_down": first[1], "bytes_up": first[2],
            "looks": len(seen), "known_tiles": topside["known_tiles"], "drained": summary["drained"],
            "hash_equal": summary["cells_hash"] == topside["cells_hash"]}


def first_process():
    print("GUEST-STARTED", flush=True)
    try:
        job = json.loads(pathlib.Path(os.environ["LEADLINE_LINK_JOB"]).read_text())
        os.environ["PATH"] = "/usr/sbin:/usr/bin:/sbin:/bin"
        print("GUEST-RESULT " + json.dumps(guest(job)), flush=True)
    except Exception as error:  # whatever it is: the guest ends, and says why
        print(f"GUEST-ERROR {error!r}", flush=True)
        for file in pathlib.Path("/mnt").glob("*.err"):
            print(file.name, file.read_text(), flush=True)
    os.sync()
    ctypes.CDLL(None).reboot(0x4321FEDC)  # off
    time.sleep(60)


# ---- Outside ----------------------------------------------------------------------------------------------------------

def skip(why):
    print(f"*skipped*: {why}")
    sys.exit(77)


def fly(leadline, vehicle, folder):
    """36 tiles, in lockstep; the map stays in the vehicle's store."""
    subprocess.run([leadline, "emulate", *SURVEY, "--write-config", folder, "--ports", folder / "ports", "--link", "udp:127.0.0.1:9"],
                   check=True, stdout=subprocess.DEVNULL)
    config = folder / "vehicle.toml"
    config.write_text(config.read_text() + '\n[store]\npath = "map.llp"\n')
    clock = folder / "clock"
    devices = subprocess.Popen([leadline, "emulate", *SURVEY, "--ports", folder / "ports", "--out", folder / "out", "--lockstep", clock],
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    subprocess.run([vehicle, "--config", config, "--log", "", "--clock", f"lockstep:{clock}"], check=True,
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    devices.wait()


class Kernel:
    def __init__(self, path, work, flight, leadline, vehicle):
        self.path, self.work = path, work
        self.job = {"flight": str(flight), "leadline": str(leadline), "vehicle": str(vehicle)}

    def run(self, baud, lossy, least_s):
        """`least_s`: it will hardly be there before. Each look at the topside's map costs half a second of processor time."""
        job = self.work / "job.json"
        job.write_text(json.dumps({**self.job, "baud": baud, "lossy": lossy, "from_s": least_s}))
        done = subprocess.run(
            [self.path, "mem=512M", "rootfstype=hostfs", "rootflags=/", "ro", f"init={pathlib.Path(__file__).resolve()}",
             "time-travel=inf-cpu", "time-travel-start=1700000000", f"LEADLINE_LINK_JOB={job}", "quiet", "con=null",
             "con0=fd:0,fd:1"],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace", check=False,
            env={**os.environ, "HOME": str(self.work), "TMPDIR": str(self.work)})
        found = re.search(r"^GUEST-RESULT (.*?)\r?$", done.stdout, re.M)
        if found:
            return json.loads(found.group(1))
        if "GUEST-STARTED" not in done.stdout:
            skip("this machine does not let a user-mode kernel start:\n" + done.stdout)
        sys.exit("link_kernel: the guest did not get to its end:\n" + done.stdout)


def table(rows):
    print("| baud | B0 | bytes, of ideal: mean, largest, within | up of down, largest, within | time, of ideal: mean, largest, "
          "within | equal |\n|---|---|---|---|---|---|")
    for baud, lossless_bytes, runs in rows:
        equal = [run for run in runs if run["seconds"] is not None]
        kept = 1 - LOSS / 100
        of_bytes = [run["bytes_down"] * kept / lossless_bytes for run in equal]
        up = [run["bytes_up"] / run["bytes_down"] for run in equal]
        of_time = [run["seconds"] * kept * baud / 10 / lossless_bytes for run in equal]

        def column(values, most, digits):
            if not values:
                return "-"
            within = sum(value <= most for value in values)
            mean = f"{statistics.mean(values):.2f}, " if digits == 2 else ""
            return f"{mean}{max(values):.{digits}f}, {within} of {len(runs)}"
        print(f"| {baud:,} | {lossless_bytes:,} | {column(of_bytes, 1.3, 2)} | {column(up, 0.1, 3)} | {column(of_time, 1.5, 2)} | "
              f"{sum(run['hash_equal'] for run in runs)} of {len(runs)} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rates", default="1200,9600,115200")
    parser.add_argument("--runs", type=int, default=4)
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build/release")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    kernel = subprocess.run([ROOT / "toolchain/user_mode_kernel.sh", "--print-path"], check=True, capture_output=True,
                            text=True).stdout.strip()
    if not os.access(kernel, os.X_OK):
        skip("no kernel with bad lines and time of its own: toolchain/user_mode_kernel.sh builds one")
    for tool in ("ip", "tc"):
        if not shutil.which(tool, path="/usr/sbin:/usr/bin:/sbin:/bin"):
            skip(f"no {tool}: apt-get install iproute2")
    leadline, vehicle = (options.build.resolve() / name for name in ("host_tools/leadline", "firmware/leadline-vehicle"))
    for program in (leadline, vehicle):
        if not os.access(program, os.X_OK):
            sys.exit(f"link_kernel: {program} has not been built")
    rows = []
    with tempfile.TemporaryDirectory(prefix="leadline-link-") as name:
        work = pathlib.Path(name)
        flight = work / "flight"
        fly(leadline, vehicle, flight)
        inside = Kernel(kernel, work, flight, leadline, vehicle)
        for baud in map(int, options.rates.split(",")):
            lossless = inside.run(baud, False, LEAST_BYTES * 10 / baud)
            if lossless["seconds"] is None:
                sys.exit(f"link_kernel: no equal maps without loss: {lossless}")
            ideal_s = lossless["bytes_down"] / (1 - LOSS / 100) * 10 / baud
            runs = []
            for _ in range(options.runs):
                run = inside.run(baud, True, ideal_s * 0.9)
                run["lossless_bytes"] = lossless["bytes_down"]
                runs.append(run)
                if options.json:
                    print(json.dumps(run), flush=True)
            rows.append((baud, lossless["bytes_down"], runs))
    if not options.json:
        table(rows)
    sys.exit(0 if all(run["hash_equal"] and run["seconds"] is not None for _, _, runs in rows for run in runs) else 1)


if __name__ == "__main__":
    first_process() if os.getpid() == 1 else main()

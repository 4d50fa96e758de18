#!/usr/bin/env python3
"""Shows what a Cortex-M7 that failed has left in the memory that outlives its restart (firmware/m7/fault_record.hpp).

usage: toolchain/m7_record.py where IMAGE        address and size of it, to be dumped with a debugger
       toolchain/m7_record.py show IMAGE DUMP    in words; IMAGE is the one that failed, and names functions

With GDB: dump binary memory DUMP ADDRESS ADDRESS+SIZE. Exit code 0: shown, 1: the dump holds no such thing, 2: usage.
"""

import pathlib
import struct
import subprocess
import sys

TOOLS = "arm-none-eabi-"
KEPT = "leadline::firmware::m7::(anonymous namespace)::kept"
RECORD = struct.Struct("<16I")
COUNTS = struct.Struct("<3I")
FIELDS = ("magic", "cause", "r0", "r1", "r2", "r3", "r12", "lr", "pc", "psr", "sp", "status", "address", "detail", "cycle",
          "crc")
MAGIC = 0x31464C4C
CAUSES = {
    2: "the watchdog: no cycle was completed", 3: "hard fault", 4: "memory fault", 5: "bus fault", 6: "usage fault",
    0x100: "no configuration that can be read", 0x101: "the vehicle refuses its configuration",
    0x102: "a restart without a record: the watchdog's second bite, or the reset line",
}
# CFSR, ARM DDI0403 B3.2.15.
STATUS = {
    0: "no instructions there (MPU)", 1: "no data there (MPU)", 3: "memory fault unstacking", 4: "memory fault stacking",
    5: "memory fault of the floating-point state", 7: "address known (memory)", 8: "instructions from a bus fault",
    9: "precise bus fault", 10: "imprecise bus fault", 11: "bus fault unstacking", 12: "bus fault stacking",
    13: "bus fault of the floating-point state", 15: "address known (bus)", 16: "undefined instruction",
    17: "invalid state", 18: "invalid exception return", 19: "no coprocessor", 24: "unaligned access",
    25: "division by zero",
}


def crc32c(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ (0x82F63B78 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


def symbols(image):
    """(address, size, name), by address."""
    text = subprocess.run([TOOLS + "nm", "-C", "-S", image], check=True, stdout=subprocess.PIPE, text=True).stdout
    rows = (line.split(" ", 3) for line in text.splitlines() if line.count(" ") >= 3)
    return sorted((int(row[0], 16) & ~1, int(row[1], 16), row[3]) for row in rows)


def kept_at(image):
    for address, size, name in symbols(image):
        if name == KEPT:
            return address, size
    sys.exit(f"m7_record: {image}: no {KEPT} in it")


def function_at(table, address):
    for begin, size, name in table:
        if begin <= address < begin + size:
            return f" {name.split('(')[0]} + {address - begin}"
    return ""


def show(image, dump):
    data = pathlib.Path(dump).read_bytes()
    if len(data) != RECORD.size + COUNTS.size:
        sys.exit(f"m7_record: {dump}: {len(data)} bytes, not the {RECORD.size + COUNTS.size} of a record")
    starts, faults, counts_crc = COUNTS.unpack(data[RECORD.size:])
    if crc32c(data[RECORD.size:-4]) != counts_crc:
        sys.exit(f"m7_record: {dump}: checksum of the counts does not hold: memory as after power-on")
    print(f"starts {starts}, {faults} after a failure")
    record = dict(zip(FIELDS, RECORD.unpack(data[:RECORD.size])))
    # A start that has taken the record inverts its magic.
    taken = record["magic"] == MAGIC ^ 0xFFFFFFFF
    if taken:
        data = struct.pack("<I", MAGIC) + data[4:]
    if not taken and record["magic"] != MAGIC or crc32c(data[:RECORD.size - 4]) != record["crc"]:
        print("no failure")
        return
    table = symbols(image)
    print(f"last failure: {CAUSES.get(record['cause'], 'exception %d' % record['cause'])}"
          f"{'' if taken else ' (not yet reported)'}")
    for name in ("pc", "lr"):
        print(f"{name} 0x{record[name]:08x}{function_at(table, record[name] & ~1)}")
    for name in ("sp", "psr", "r0", "r1", "r2", "r3", "r12"):
        print(f"{name} 0x{record[name]:08x}")
    bits = [words for bit, words in STATUS.items() if record["status"] >> bit & 1]
    print(f"status 0x{record['status']:08x} {', '.join(bits)}")
    print(f"address 0x{record['address']:08x}\ndetail 0x{record['detail']:08x}\ncycle {record['cycle']}")


def main():
    if len(sys.argv) == 2 and sys.argv[1] in ("-h", "--help"):
        print(__doc__)
        return 0
    if len(sys.argv) == 3 and sys.argv[1] == "where":
        address, size = kept_at(sys.argv[2])
        print(f"0x{address:08x} {size}")
        return 0
    if len(sys.argv) == 4 and sys.argv[1] == "show":
        show(sys.argv[2], sys.argv[3])
        return 0
    print(__doc__, file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main())

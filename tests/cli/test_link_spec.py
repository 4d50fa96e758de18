#!/usr/bin/env python3
"""A second implementation of the link, from proto/SPEC.md alone: decodes the vectors that stand there.

Reads its tables (start values, schema) out of the SPEC too, so that a table that was changed in one place only
is noticed. What it decodes is checked against values stated in words beside the vectors.
"""
import hashlib
import os
import pathlib
import re
import struct
import unittest

ROOT = pathlib.Path(os.environ.get("LEADLINE_ROOT", pathlib.Path(__file__).resolve().parents[2]))
SPEC = (ROOT / "proto" / "SPEC.md").read_text(encoding="utf-8")
NEIGHBOURS = [(0, -1, 128), (-1, 0, 128), (-1, -1, 32), (-1, 1, 32), (0, -2, 8), (-2, 0, 8),
              (-1, -2, 8), (-1, 2, 8), (-2, -1, 8), (-2, 1, 8), (-2, -2, 4), (-2, 2, 4)]
LEVELS = [3, 5, 7, 10, 14, 20, 28, 44, 72, 160]
MAX_DEPTH = 524288
DIGEST_OF_TWO = 0xD9D65743


def section(title):
    """Text under a heading, up to the next one of the same or a higher level."""
    match = re.search(rf"^(#+) {re.escape(title)}$", SPEC, re.M)
    rest = SPEC[match.end():]
    following = re.search(rf"^#{{1,{len(match.group(1))}}} ", rest, re.M)
    return rest[:following.start()] if following else rest


def fences(title):
    return re.findall(r"^```\n(.*?)^```", section(title), re.M | re.S)


def as_bytes(text):
    return bytes(int(pair, 16) for pair in text.split())


def as_lines(text):
    return [as_bytes(line) for line in text.splitlines()]


def number(data):
    return int.from_bytes(data, "little")


def varint(data, at):
    """Value, and where the next field begins."""
    value, shift = 0, 0
    while True:
        value |= (data[at] & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if data[at - 1] < 0x80:
            return value, at


def crc32c(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x82F63B78 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


def fnv1a(data, value=14695981039346656037):
    for byte in data:
        value = (value ^ byte) * 1099511628211 % 2**64
    return value


def tile_hash(cells):
    return fnv1a(b"".join(cell.to_bytes(4, "little") for cell in cells))


def fold(value):
    return value >> 32 ^ value & 0xFFFFFFFF


def start_models():
    models, name = {}, None
    for line in fences("Tile model")[0].splitlines():
        if line.startswith(" "):
            models[name] += [[128 * int(pair, 16)] * 2 for pair in line.split()]
        else:
            name = line
            models[name] = []
    return models


class RangeDecoder:
    def __init__(self, body):
        self.body = body + bytes(4)
        self.length = len(body)
        self.low, self.range, self.at = 0, 0xFFFFFFFF, 4
        self.code = int.from_bytes(self.body[:4], "big")

    def shift(self):
        while self.range < 1 << 24:
            byte = self.body[self.at] if self.at < len(self.body) else 0
            self.code = (self.code << 8 | byte) & 0xFFFFFFFF
            self.low = self.low << 8 & 0xFFFFFFFF
            self.range <<= 8
            self.at += 1

    def bit(self, model):
        share = (self.range >> 15) * (sum(model) // 2)
        one = self.code < share
        if one:
            self.range = share
            model[0] += (32704 - model[0]) >> 4
            model[1] += (32704 - model[1]) >> 7
        else:
            self.code -= share
            self.low = (self.low + share) & 0xFFFFFFFF
            self.range -= share
            model[0] -= (model[0] - 64) >> 4
            model[1] -= (model[1] - 64) >> 7
        self.shift()
        return one

    def raw(self, count):
        self.range >>= count
        value = min(self.code // self.range, (1 << count) - 1)
        self.code -= value * self.range
        self.low = (self.low + value * self.range) & 0xFFFFFFFF
        self.shift()
        return value

    def ended_well(self):
        end = -(-self.low // 2**32) * 2**32
        if end >= self.low + self.range:
            end = -(-self.low // 2**24) * 2**24
        return self.at >= self.length and (self.low + self.code) % 2**32 == end % 2**32


class TileDecoder:
    """Cells of one tile after the other."""

    def __init__(self, body):
        self.coder, self.models = RangeDecoder(body), start_models()
        self.depth, self.code = 0, 8

    def bit(self, name, index=0):
        return self.coder.bit(self.models[name][index])

    def tile(self, count):
        mask = self.mask(count)
        cells, predictions = {}, {}
        for n, e in sorted(mask):
            cells[n, e] = self.cell(n, e, mask, cells, predictions)
        return cells

    def mask(self, left):
        mask = set()
        for index in range(256):
            if left == 0:
                break
            n, e = divmod(index, 16)
            cells_left = 256 - index
            p = sum(bit for bit, at in ((1, (n, e - 1)), (2, (n - 1, e)), (4, (n - 1, e + 1)),
                                        (8, (n - 1, e - 1))) if at in mask)
            d = (0 if 16 * left < cells_left else 1 if 4 * left < cells_left else
                 2 if 4 * left < 3 * cells_left else 3)
            if left == cells_left or self.bit("mask", 16 * d + p):
                mask.add((n, e))
                left -= 1
        return mask

    def cell(self, n, e, mask, cells, predictions):
        sides = [(n, e - 1), (n - 1, e)]
        if self.bit("unknown", sum(at in mask and cells[at] is None for at in sides)):
            return None
        seen = [(dn, de, g, cells[n + dn, e + de]) for dn, de, g in NEIGHBOURS
                if cells.get((n + dn, e + de))]
        touching = [(2 if i < 2 else 1, (n + dn, e + de)) for i, (dn, de, _)
                    in enumerate(NEIGHBOURS[:4]) if cells.get((n + dn, e + de))]
        code = self.sigma([(w, cells[at][0]) for w, at in touching])
        flags = int(self.bit("multi_surface", sum(
            1 for at in sides if cells.get(at) and cells[at][1] & 1)))
        if self.bit("other_flags"):
            flags |= self.coder.raw(2) << 1
        errors = [(w, abs(cells[at][2] - predictions[at])) for w, at in touching
                  if at in predictions]
        depth, predicted = self.depth_of(1 + code // 2, seen, errors)
        if seen:
            predictions[n, e] = predicted
        self.depth, self.code = depth, code
        return code, flags, depth

    def sigma(self, near):
        w = sum(weight for weight, _ in near)
        s = sum(weight * code for weight, code in near)
        if w == 0:
            expected, c = self.code, 13
        else:
            expected = (2 * s + w) // (2 * w)
            codes = [code for _, code in near]
            off = 4 * (s - expected * w)
            lean = 0 if off < -w else 2 if off > w else 1
            c = 12 if w < 3 else 3 * min(max(codes) - min(codes), 3) + lean
        if self.bit("sigma_same", c):
            return expected
        up = self.bit("sigma_up", c)
        m = 1
        while self.bit("sigma_more", 6 * c + min(m, 6) - 1):
            m += 1
        return expected + m if up else expected - m

    def predict(self, seen):
        if not seen:
            return self.depth
        first = seen[0][3][2]
        S = Sn = Se = Sz = Snz = Sez = Sne = 0
        Snn = See = 1
        for n, e, g, cell in seen:
            z = cell[2] - first
            S, Sn, Se, Sz = S + g, Sn + g * n, Se + g * e, Sz + g * z
            Snz, Sez, Sne = Snz + g * n * z, Sez + g * e * z, Sne + g * n * e
            Snn, See = Snn + g * n * n, See + g * e * e
        A, B, C = Snn * See - Sne * Sne, Se * Sne - Sn * See, Sn * Sne - Snn * Se
        at = (Sz * A + Snz * B + Sez * C) // (S * A + Sn * B + Se * C)
        return min(max(first + at, 0), MAX_DEPTH)

    def depth_of(self, shift, seen, errors):
        step = 1 << shift
        predicted = self.predict(seen)
        expected = (predicted + step // 2) // step
        beyond = predicted - expected * step
        fraction = min(8 * abs(beyond) // step, 3)
        if not seen:
            level = 13
        elif not errors:
            level = 12 if len(seen) < 3 else 11
        else:
            v = sum(weight for weight, _ in errors)
            mean = 16 * sum(weight * error for weight, error in errors) // v // step
            level = sum(limit <= mean for limit in LEVELS)
        if self.bit("depth_same", 4 * level + fraction):
            return expected * step, predicted
        toward = self.bit("depth_toward", 4 * level + fraction)
        m = 1
        while m <= 10 and self.bit("depth_more", 10 * level + m - 1):
            m += 1
        if m == 11:
            x = 0
            while self.bit("exponent_more", x):
                x += 1
            high = self.coder.raw(max(x - 10, 0))
            m = 10 + (1 << x | high << min(x, 10) | self.coder.raw(min(x, 10)))
        up = toward == (beyond >= 0)
        return (expected + (m if up else -m)) * step, predicted


def varint(data, at):
    value = shift = 0
    while True:
        byte = data[at]
        at += 1
        value |= (byte & 127) << shift
        shift += 7
        if byte < 128:
            return value, at


def decode_delta(payload):
    """[(tile, generation, hash32, {cell index: word})] and the survey tag; a coarse delta has None for the hash."""
    assert payload[0] in (2, 9)
    headers, at, tile = [], 4, 0
    for _ in range(payload[3]):
        code, at = varint(payload, at)
        tile += -(code + 1 >> 1) if code & 1 else code >> 1
        generation, at = varint(payload, at)
        hash32 = None
        if payload[0] == 2:
            hash32 = int.from_bytes(payload[at:at + 4], "little")
            at += 4
        headers.append((tile, generation, hash32, payload[at] + 1))
        at += 1
    decoder = TileDecoder(payload[at:])
    tiles = []
    for tile, generation, hash32, count in headers:
        words = {16 * n + e: 0 if cell is None else cell[0] + 1 | cell[1] << 5 | cell[2] << 8
                 for (n, e), cell in decoder.tile(count).items()}
        tiles.append((tile, generation, hash32, words))
    assert decoder.coder.ended_well()
    return int.from_bytes(payload[1:3], "little"), tiles


def sigma_lists():
    return [[int(word) for word in re.findall(r"\d+", block)] for block in fences("Cells")[:2]]


def code_cell(depth, sigma, flag):
    k = sum(limit <= sigma for limit in sigma_lists()[1])
    step = 1 << 1 + k // 2
    return k + 1 | flag << 5 | (depth + step // 2) // step * step << 8


def the_tile():
    cells = [code_cell(1000 + 10 * (i // 16) + 7 * (i % 16) + 37 * i % 13, 900 + 53 * i % 300,
                       int(i % 16 == 3)) for i in range(256)]
    cells[100] = 0
    return cells


class Frame(unittest.TestCase):
    def test_vectors_unpack_to_their_payload(self):
        rows = re.findall(r"^\| (\(none\)|`[0-9A-F ]+`) \| `(00 [0-9A-F ]+)` \|$", SPEC, re.M)
        self.assertEqual(len(rows), 3)
        for payload, frame in rows:
            payload = b"" if payload == "(none)" else as_bytes(payload.strip("`"))
            frame = as_bytes(frame)
            self.assertEqual((frame[0], frame[-1]), (0, 0))
            raw, at, body = b"", 0, frame[1:-1]
            while at < len(body):
                code = body[at]
                raw += body[at + 1:at + code] + (b"\0" if code != 255 else b"")
                at += code
            raw = raw[:-1]
            self.assertEqual(raw[:-4], payload)
            self.assertEqual(int.from_bytes(raw[-4:], "little"), crc32c(payload))


class Cells(unittest.TestCase):
    def test_lists_follow_their_formula(self):
        sigmas, limits = sigma_lists()
        self.assertEqual(sigmas, [round(64 * 2**(k / 2)) for k in range(31)])
        self.assertEqual(limits, [int(-(-64 * 2**(k / 2 + 0.25) // 1)) for k in range(30)])

    def test_vectors(self):
        self.assertEqual(code_cell(1000, 1024, 0), 0x0003E009)
        self.assertEqual(code_cell(1000, 1448, 1), 0x0003E02A)

    def test_hashes(self):
        unknown, one = [0] * 256, [0x0003E009] + [0] * 255
        hashes = tile_hash(unknown), tile_hash(one)
        link = fnv1a(b"".join(value.to_bytes(8, "little") for value in hashes))
        words = re.findall(r"`([0-9A-F]{8,16})`", section("Tiles and hashes"))
        self.assertEqual(words, ["%016X" % hashes[0], "%08X" % fold(hashes[0]), "0003E009",
                                 "%016X" % hashes[1], "%08X" % fold(hashes[1]), "%016X" % link])


class Delta(unittest.TestCase):
    def setUp(self):
        self.vectors = [as_bytes(text) for text in fences("Vectors of the tile delta")]
        self.assertEqual(len(self.vectors), 3)

    def test_range_coder(self):
        self.assertIn("`FE 98 1D`; fast = 7178, slow = 14708", SPEC)
        decoder, model = RangeDecoder(as_bytes("FE 98 1D")), [16384, 16384]
        self.assertEqual("".join("01"[decoder.bit(model)] for _ in range(16)), "0000000010000000")
        self.assertEqual(decoder.raw(6), 0x2A)
        self.assertEqual(model, [7178, 14708])
        self.assertTrue(decoder.ended_well())

    def test_one_cell(self):
        tag, tiles = decode_delta(self.vectors[0])
        cells = [0x0003E009] + [0] * 255
        self.assertEqual(tag, 0x1234)
        self.assertEqual(tiles, [(7, 300, fold(tile_hash(cells)), {0: 0x0003E009})])

    def test_whole_tile(self):
        cells = the_tile()
        tiles = decode_delta(self.vectors[1])[1]
        self.assertEqual(tiles, [(7, 300, fold(tile_hash(cells)), dict(enumerate(cells)))])

    def test_two_tiles(self):
        cells = the_tile()
        tiles = decode_delta(self.vectors[2])[1]
        self.assertEqual(tiles, [
            (7, 1, fold(tile_hash(cells)), {i: cells[i] for i in (17, 18, 34)}),
            (6, 2, fold(tile_hash([0] * 256)), {255: 0})])


class CoarseDelta(unittest.TestCase):
    def test_vector(self):
        tag, tiles = decode_delta(as_bytes(fences("Coarse delta")[0]))
        cells = {i: code_cell(1000 + 40 * (i // 16) + 28 * (i % 16) + 37 * i % 13, 900, 0)
                 for i in range(256) if i % 16 < 8}
        self.assertEqual((tag, tiles), (0x1234, [(1, 5, None, cells)]))


class Messages(unittest.TestCase):
    def test_commands_and_answers_have_the_tags_that_are_stated(self):
        key = bytes(range(32))

        def mac(label, data=b""):
            return hashlib.blake2b(label.encode() + data, key=key, digest_size=16).digest()
        command, kinds, others = fences("Vectors of the messages")[-3:]
        packet = as_bytes(command)
        kind, version, key_id, vehicle, counter = struct.unpack("<BBIHQ", packet[:16])
        self.assertEqual((kind, version, vehicle, counter), (0x45, 1, 3, 300))
        self.assertEqual(key_id, struct.unpack("<I", mac("leadline key id 1")[:4])[0])
        self.assertEqual(packet[-16:], mac("leadline command 1", packet[:-16]))
        self.assertEqual(packet[16:-16], bytes([3, 1]) + struct.pack("<i", 9600))
        self.assertEqual([body[0] for body in as_lines(kinds)], [1, 2, 3, 4, 5, 6, 7])
        answer, part = as_lines(others)
        _, said_key, said_counter, result = struct.unpack("<BIQB", answer[:14])
        self.assertEqual((said_key, said_counter, result), (key_id, 300, 2))
        self.assertEqual(answer[14:], mac("leadline answer 1", struct.pack(
            "<IHQB", key_id, vehicle, counter, result))[:8])
        # Runs of the slice: level in the low half, length less one above it, a varint behind 15.
        self.assertEqual(part[-6:], bytes([0xF0, 0x04, 0x60, 0x31, 0x0F, 0x78]))
        self.assertEqual(part[:7], struct.pack("<BHI", 8, 0x1234, 300))

    def test_schema_hash_stands_in_hello_and_text(self):
        schema = fences("Schema")[0]
        stated = re.search(r"fences, each ended by one line feed: `([0-9A-F]{8})`", SPEC).group(1)
        self.assertEqual("%08X" % crc32c(schema.encode()), stated)
        hello = as_bytes(fences("Vectors of the messages")[0])
        self.assertEqual("%08X" % int.from_bytes(hello[4:8], "little"), stated)

    def test_survey_tag(self):
        hello = as_bytes(fences("Vectors of the messages")[0])
        self.assertEqual(crc32c(hello[8:20]) & 0xFFFF, 0xEB54)

    def test_hello_of_both_minors(self):
        hello = as_bytes(fences("Vectors of the messages")[0])
        self.assertEqual((hello[1], hello[2]), (1, 1))

        def texts(payload):
            at = 86 + 4 * payload[85]
            found = []
            while payload[2] >= 1 and len(found) < 2:
                size = payload[at]
                found.append(payload[at + 1:at + 1 + size].decode("utf-8"))
                at += 1 + size
            self.assertEqual(payload[at:], b"\xa0\x0f\0\0" if payload[2] >= 1 else b"")
            return found

        self.assertEqual(texts(hello), ["Kieler F\u00f6rde", "NHN"])
        least = 86 + 4 * hello[85]
        self.assertEqual(texts(hello[:2] + b"\0" + hello[3:least]), [])
        # What the text says of the least MTU: delimiters, COBS code and CRC are the frame's share.
        self.assertEqual(128 - 2 - 1 - 4 - (86 + 4 + 2 + 4), 25)

    def test_messages_of_a_bad_tether(self):
        report, digest, both = (as_lines(text) for text in fences("Vectors of the messages")[-6:-3])
        type_, tag, reach, newest = struct.unpack("<BHBH", report[0][:6])
        self.assertEqual((type_, tag, reach >> 7, newest), (0x42, 0x1234, 1, 0x0203))
        self.assertEqual(len(report[0]), 6 + reach % 128)
        came = [newest - 8 * at - bit for at, byte in enumerate(report[0][6:]) for bit in range(8) if byte >> bit & 1]
        self.assertEqual(came, [0x0203, 0x0201, 0x0200, 0x01F4])
        self.assertEqual(struct.unpack("<BHH", report[1]), (0x0A, 0x1234, 0x0203))

        first, at = varint(digest[0], 3)
        log2, count = digest[0][at], digest[0][at + 1]
        self.assertEqual((digest[0][0], first, log2, count), (0x06, 300, 2, 2))
        hashes = [number(digest[0][at + 2 + 4 * k:at + 6 + 4 * k]) for k in range(count)]
        self.assertEqual(hashes, [0x01020304, 0xFFFFFFFE])

        first, at = varint(both[0], 3)
        less, at = varint(both[0], at)
        self.assertEqual((both[0][0], first, first + less, at), (0x43, 300, 363, len(both[0])))
        tile, at = varint(both[1], 3)
        self.assertEqual((both[1][0], tile, both[1][at], at + 1), (0x44, 300, 2, len(both[1])))

    def test_digest_of_two_tiles(self):
        # The rule, on the hashes that the cells' vectors state.
        hashes = [0x8EF0F502, 0xF9E17E01]
        value = fnv1a(b"".join(each.to_bytes(4, "little") for each in hashes))
        self.assertEqual(fold(value), DIGEST_OF_TWO)
        self.assertIn("`%08X`" % DIGEST_OF_TWO, section("Digest"))

    def test_brief_and_full_status_agree(self):
        full, brief = (as_bytes(text) for text in fences("Vectors of the messages")[1:3])
        at = 5

        def varint():
            nonlocal at
            value, shift = 0, 0
            while True:
                byte = brief[at]
                value |= (byte & 0x7F) << shift
                at, shift = at + 1, shift + 7
                if byte < 0x80:
                    return value

        self.assertEqual(brief[0], 0x05)
        t_us, alarms = int.from_bytes(full[1:9], "little"), int.from_bytes(full[13:17], "little")
        self.assertEqual(int.from_bytes(brief[1:5], "little"), t_us // 1000)
        self.assertEqual(varint(), alarms)
        self.assertEqual(brief[at], full[25])
        at += 1
        codes = [varint() for _ in range(3)]
        self.assertEqual([-(code + 1) // 2 if code % 2 else code // 2 for code in codes],
                         [1234, 0, 500])
        self.assertEqual(brief[at:at + 4], full[44:46] + b"\x09\x00")
        at += 4
        self.assertEqual([varint() for _ in range(4)], [0, 48, 3, 20000])
        # The swath: two beams, at the end of both.
        self.assertEqual(brief[at:], b"\x02\x40\x28\x7b\xc0\x29\x82\x01")
        self.assertEqual(full[-8:], brief[at:])


if __name__ == "__main__":
    unittest.main()

#!/usr/bin/env python3
"""NMEA of a vehicle that stands still: for a head that was recorded in a tank, without any navigation.

usage: still.py LATITUDE LONGITUDE SENTENCES > FILE    (both as NMEA prints them: 5954.0000,N)

Heading north, level, at the surface; attitude, pressure and position in turn.
"""
import sys


def sentence(body):
    check = 0
    for byte in body.encode():
        check ^= byte
    return f"${body}*{check:02X}\r\n"


def main():
    latitude, longitude, count = sys.argv[1], sys.argv[2], int(sys.argv[3])
    for i in range(count):
        clock = f"12{i // 4800 % 60:02d}{i % 4800 / 80:05.2f}"
        sys.stdout.write(sentence(f"PASHR,{clock},0.00,T,0.00,0.00,0.00,0.01,0.01,0.01,1,0"))
        sys.stdout.write(sentence("PRVAT,00.000,M,0010.132,dBar"))
        sys.stdout.write(sentence(f"GPGGA,{clock},{latitude},{longitude},4,12,0.5,0.0,M,0.0,M,,"))


main()

"""Bytes of flight and sports loggers, written by hand after their specifications."""

import binascii
import math
import struct

FIX = ((49.0, 8.4, 110.5), (49.0001, 8.4001, 111.0), (49.0002, 8.4002, 111.5))
UNIX_S = 1_777_627_812  # 2026-05-01 09:30:12


def igc(rows=FIX, datum="ELL", date="010526", start=(9, 30, 12)):
    """An IGC file with a record a second; validity V for the last one."""
    lines = ["AXXX001vgps", f"HFDTEDATE:{date},01", f"HFALGALTGPS:{datum}", "I013638FXA"]
    second = start[0] * 3600 + start[1] * 60 + start[2]
    for k, (latitude, longitude, height) in enumerate(rows):
        clock = "".join(
            f"{part:02}"
            for part in ((second + k) % 86400 // 3600, (second + k) // 60 % 60, (second + k) % 60)
        )
        place = ""
        for angle, width, sides in ((latitude, 2, "NS"), (longitude, 3, "EW")):
            degrees, minutes = divmod(round(abs(angle) * 60000), 60000)
            place += f"{degrees:0{width}}{minutes:05}{sides[angle < 0]}"
        lines.append(f"B{clock}{place}A{100:05}{round(height):05}005")
    return "\r\n".join([*lines, "LXXXend", ""]).encode()


def fit(rows=FIX, unix_s=UNIX_S, bare=1):
    """A FIT file of records with position, altitude, accuracy and time, and some without a position."""
    fields = ((253, 4, 0x86), (0, 4, 0x85), (1, 4, 0x85), (78, 4, 0x86), (31, 1, 0x02))
    body = struct.pack("<BBBHB", 0x40, 0, 0, 20, len(fields)) + b"".join(
        struct.pack("BBB", *one) for one in fields
    )
    fit_s = unix_s - 631065600
    for k, (latitude, longitude, altitude) in enumerate(rows):
        semi = [round(angle * 2**31 / 180) for angle in (latitude, longitude)]
        body += struct.pack("<BIiiIB", 0, fit_s + k, *semi, round((altitude + 500) * 5), 3)
    body += struct.pack("<BIiiIB", 0, fit_s + 99, 0x7FFFFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 0xFF) * bare
    head = struct.pack("<BBHI4s", 14, 0x20, 2132, len(body), b".FIT")
    head += struct.pack("<H", _crc(head))
    return head + body + struct.pack("<H", _crc(head + body))


def _crc(data):
    table = (0x0000, 0xCC01, 0xD801, 0x1400, 0xF001, 0x3C00, 0x2800, 0xE401)
    table += (0xA001, 0x6C00, 0x7800, 0xB401, 0x5000, 0x9C01, 0x8801, 0x4400)
    crc = 0
    for byte in data:
        for nibble in (byte & 0xF, byte >> 4):
            crc = (crc >> 4) ^ table[crc & 0xF] ^ table[nibble]
    return crc


def ulog(rows=FIX, unix_s=UNIX_S, old=False, step_s=1.0):
    """A ULog file of sensor_gps messages, the last one without a fix; ``old`` names of fields before 1.14."""
    if old:
        name = "vehicle_gps_position"
        layout = "uint64_t timestamp;uint64_t time_utc_usec;int32_t lat;int32_t lon;int32_t alt_ellipsoid;"
    else:
        name = "sensor_gps"
        layout = "uint64_t timestamp;uint64_t time_utc_usec;double latitude_deg;double longitude_deg;"
        layout += "double altitude_ellipsoid_m;"
    layout += "float eph;float epv;float hdop;uint8_t fix_type;uint8_t satellites_used;"
    data = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
    data += _ulog_message(b"B", bytes(40)) + _ulog_message(b"F", f"{name}:{layout}".encode())
    data += _ulog_message(b"A", struct.pack("<BH", 0, 0) + name.encode())
    for k, (latitude, longitude, height) in enumerate((*rows, rows[-1])):
        fix_type = 6 if k < len(rows) else 0
        place = (latitude, longitude, height)
        packed = struct.pack("<3i", *(round(x * s) for x, s in zip(place, (1e7, 1e7, 1e3), strict=True)))
        packed = packed if old else struct.pack("<3d", *place)
        values = struct.pack("<QQ", 1000 + k, round((unix_s + k * step_s) * 1e6)) + packed
        values += struct.pack("<3fBB", 0.5, 0.8, 0.9, fix_type, 14)
        data += _ulog_message(b"D", struct.pack("<H", 0) + values)
    return data


def _ulog_message(kind, body):
    return struct.pack("<H", len(body)) + kind + body


def tlog(rows=FIX, unix_s=UNIX_S, ellipsoid=True):
    """A telemetry log of GPS_RAW_INT, the last one without a fix, as pymavlink packs it."""
    from pymavlink.dialects.v20 import common as mavlink

    link, data = mavlink.MAVLink(None, srcSystem=1, srcComponent=1), b""
    for k, (latitude, longitude, height) in enumerate((*rows, rows[-1])):
        message = mavlink.MAVLink_gps_raw_int_message(
            1000 * k,  # since the autopilot started
            6 if k < len(rows) else 1,
            round(latitude * 1e7),
            round(longitude * 1e7),
            round(height * 1e3),
            90,
            120,
            0,
            0,
            14,
            round(height * 1e3) if ellipsoid else 0,
            20,
            30,
        )
        data += struct.pack(">Q", (unix_s + k) * 1_000_000) + message.pack(link)
    return data


def dataflash(rows=FIX, unix_s=UNIX_S):
    """A dataflash log of GPS messages: format messages, then the positions."""
    layout = (b"GPS", b"QBBIHBcLLeffffB", b"TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U")
    size = 3 + struct.calcsize("<QBBIHBhiiiffffB")
    head = b"\xa3\x95\x80"
    data = head + struct.pack("<BB4s16s64s", 128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    data += head + struct.pack("<BB4s16s64s", 130, size, *layout)
    week, second = divmod(unix_s + 18 - 315964800, 604800)  # 18 leap seconds since 2017
    for k, (latitude, longitude, height) in enumerate(rows):
        place = round(latitude * 1e7), round(longitude * 1e7), round(height * 100)
        data += b"\xa3\x95\x82" + struct.pack(
            "<QBBIHBhiiiffffB", 1000 * k, 0, 4, (second + k) * 1000, week, 12, 95, *place, 0, 0, 0, 0, 1
        )
    return data


def sbf(rows=FIX, unix_s=UNIX_S, covariance=True, mode=4, up_cm=6):
    """An SBF log of PVTGeodetic and PosCovGeodetic, the last epoch without a fix."""
    week, second = divmod(unix_s + 18 - 315964800, 604800)
    data = b""
    for k, (latitude, longitude, height) in enumerate((*rows, rows[-1])):
        head = struct.pack("<IH", (second + k) * 1000, week)
        error, kind = (0, mode) if k < len(rows) else (3, 0)
        place = *(math.radians(angle) for angle in (latitude, longitude)), height
        body = head + struct.pack("<BB3df3ff", kind, error, *place, 48.0, 0, 0, 0, -2e10)
        body += struct.pack("<dfBBBBHHIBBHHHHB", 0, 0, 0, 19, 14, 0, 0, 150, 0, 0, 1, 0, 10, 4, up_cm, 0)
        body += bytes(1)
        data += _sbf_block(4007, 2, body)
        if covariance:
            variances = struct.pack("<10f", 1e-4, 4e-4, 9e-4, 0.0, 1e-4, *[0.0] * 5)
            data += _sbf_block(5906, 0, head + struct.pack("<BB", kind, error) + variances)
    return data


def _sbf_block(number, revision, body):
    body += bytes(-(len(body) + 8) % 4)
    checked = struct.pack("<HH", number | revision << 13, len(body) + 8) + body
    return b"$@" + struct.pack("<H", binascii.crc_hqx(checked, 0)) + checked


def novatel(rows=FIX, unix_s=UNIX_S, kind="NARROW_INT"):
    """A NovAtel log of BESTPOSA, the last epoch without a fix; heights are above a geoid 48.2 m high."""
    week, second = divmod(unix_s + 18 - 315964800, 604800)
    data = b"<OK\r\n[COM1]"
    for k, (latitude, longitude, height) in enumerate((*rows, rows[-1])):
        status = f"SOL_COMPUTED,{kind}" if k < len(rows) else "INSUFFICIENT_OBS,NONE"
        head = f"BESTPOSA,COM1,0,83.5,FINESTEERING,{week},{second + k}.000,02400000,cdba,16809"
        place = f"{latitude:.11f},{longitude:.11f},{height - 48.2:.4f},48.2000,WGS84"
        body = f'{head};{status},{place},0.0200,0.0100,0.0300,"7",1.500,0.000,18,14,14,13,00,21,7f,37'
        # CRC-32 that begins with 0 and is not inverted
        checked = binascii.crc32(body.encode(), 0xFFFFFFFF) ^ 0xFFFFFFFF
        data += f"#{body}*{checked:08x}\r\n".encode()
    return data

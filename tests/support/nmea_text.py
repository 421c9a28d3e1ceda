"""NMEA sentences as a receiver writes them."""


def sentence(body: str) -> str:
    """``$body*hh`` with its checksum."""
    checksum = 0
    for byte in body.encode():
        checksum ^= byte
    return f"${body}*{checksum:02X}\r\n"


def with_checksums(text: str) -> str:
    """The same sentences with the checksums that belong to them."""
    return "".join(sentence(line[1:].split("*")[0]) for line in text.splitlines())


def gga(
    clock: str, *, quality: object = 4, alt: str = "116.0", separation: str = "47.9", talker: str = "GN"
) -> str:
    """A fix at 49.011 N, 8.4165 E; ellipsoidal height 163.9 m."""
    place = "4900.6600000,N,00824.9900000,E"
    return sentence(f"{talker}GGA,{clock},{place},{quality},14,0.80,{alt},M,{separation},M,1.5,0000")


def gst(clock: str) -> str:
    """Sigmas: north 0.02, east 0.01, up 0.03 m."""
    return sentence(f"GNGST,{clock},,,,,0.02,0.01,0.03")


def zda(clock: str, day: int, month: int, year: int) -> str:
    """The date."""
    return sentence(f"GNZDA,{clock},{day:02},{month:02},{year},00,00")


def rmc(clock: str, date: str, status: str = "A") -> str:
    """The date as ddmmyy."""
    return sentence(f"GPRMC,{clock},{status},4900.66,N,00824.99,E,0.004,77.52,{date},,,A")

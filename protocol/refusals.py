"""Why a packet is refused: one class per reason, each building its own sentence from values, in order of checking."""

from __future__ import annotations


class BadPacket(ValueError):
    """A packet that is refused. `reason` is the class's short name, for counters and conformance vectors."""

    reason = "bad"


class TooShort(BadPacket):
    reason = "too_short"

    def __init__(self, size: int) -> None:
        super().__init__(f"packet: {size} bytes, expected at least 12 (header and CRC)")


class TooLong(BadPacket):
    reason = "too_long"

    def __init__(self, size: int) -> None:
        super().__init__(f"packet: {size} bytes, expected at most 250")


class BadCrc(BadPacket):
    reason = "crc"

    def __init__(self, packet: bytes) -> None:
        sent = int.from_bytes(packet[-4:], "little")
        super().__init__(f"packet: CRC {sent:#010x} does not fit its {len(packet)} bytes (damaged, or another layout)")


class BadVersion(BadPacket):
    reason = "version"

    def __init__(self, version: int, expected: int) -> None:
        super().__init__(f"packet: header version {version}, expected {expected}")


class UnknownType(BadPacket):
    reason = "type"

    def __init__(self, type_: int) -> None:
        super().__init__(f"packet: type {type_:#04x} is unknown; known: 0x01 to 0x05, 0x81 to 0x85")


class BadLength(BadPacket):
    reason = "length"

    def __init__(self, type_: int, size: int, expected: int | str) -> None:
        super().__init__(f"packet of type {int(type_):#04x}: {size} bytes, expected {expected}")


class BadValue(BadPacket):
    reason = "value"

    def __init__(self, type_: int, field: str, value: object, expected: str) -> None:
        super().__init__(f"packet of type {int(type_):#04x}: {field} is {value!r}, expected {expected}")


class CannotPack(ValueError):
    """A frame that no packet can carry; a bug of the sender or a number beyond the wire's range."""

    def __init__(self, frame: object, why: object) -> None:
        super().__init__(f"cannot pack {frame!r}: {why}")

"""The calibration tool's side of XCP at a serial line: as much as the firmware understands.

Frames are a length, the packet, and the sum of both, a byte each (XCP on SxI). In codegen/cortex_m7
xcp.h lists the commands.
"""

import struct
from collections.abc import Callable

from qpmpc.codegen.c_compiler import CodegenError

POSITIVE = 0xFF
ERRORS = {
    0x20: "command unknown",
    0x21: "syntax",
    0x22: "out of range",
    0x24: "access denied",
}


class XcpError(CodegenError):
    """The target refuses a command, or does not answer."""


def framed(packet: bytes) -> bytes:
    """Return a packet with its length before and the sum behind it."""
    body = bytes([len(packet)]) + packet
    return body + bytes([sum(body) & 0xFF])


class XcpMaster:
    """A connection to one target.

    Parameters
    ----------
    exchange : sends a frame and returns what came back
    """

    def __init__(self, exchange: Callable[[bytes], bytes]) -> None:
        self._exchange = exchange

    def command(self, packet: bytes) -> bytes:
        """Send a command; returns the answer after its first byte.

        Raises
        ------
        XcpError
            If the target refuses it, or the answer is damaged or missing.
        """
        found = self._exchange(framed(packet))
        if len(found) < 3 or found != framed(found[1:-1]):
            raise XcpError(f"XCP: no answer to {packet.hex(' ')}")
        code, rest = found[1], found[2:-1]
        if code != POSITIVE:
            reason = ERRORS.get(rest[0] if rest else -1, f"error {rest.hex()}")
            raise XcpError(f"XCP: {packet.hex(' ')} refused: {reason}")
        return rest

    def connect(self) -> None:
        """CONNECT; the target must send its lowest byte first, as this side does."""
        answer = self.command(b"\xff\x00")
        if answer[1] & 1:
            raise XcpError("XCP: the target is big-endian")

    def disconnect(self) -> None:
        """DISCONNECT."""
        self.command(b"\xfe")

    def read(self, address: int, size: int) -> bytes:
        """SHORT_UPLOAD."""
        return self.command(struct.pack("<BBBBI", 0xF4, size, 0, 0, address))

    def write(self, address: int, data: bytes) -> None:
        """SET_MTA, then DOWNLOAD."""
        self.command(struct.pack("<BBBBI", 0xF6, 0, 0, 0, address))
        self.command(bytes([0xF0, len(data)]) + data)

"""Lines of a board's log as the program writes them, for tests that have no board."""

from collections.abc import Sequence
from zlib import crc32

IDENTITY = "0123456789abcdef"


def line(body: str) -> str:
    """A line with its checksum."""
    text = f"QPMPC1,{body}"
    return f"{text}*{crc32(text.encode()):08x}\r\n"


def bodies(seconds: int = 5, unit: str = "cycles", hz: int = 480_000_000) -> list[str]:
    """A whole run, without checksums; each second takes one tick more than the last."""
    return [
        f"start,{IDENTITY},0.1.0,mh-qp,f32,{seconds},{unit},{hz},my board",
        "depart,30,2000000",
        *(f"step,{k},400{k},180000{k},42c80000,1,0,0" for k in range(seconds)),  # 100 W
        "end,67840,2344,632,60000,70000",
    ]


def text_of(lines: Sequence[str]) -> str:
    """A log of these lines."""
    return "".join(line(body) for body in lines)

"""What a scan heard in a few bytes: numbers of landmarks, strengths, ages."""

import struct
from array import array
from collections.abc import Callable, Sequence

from homsense_service.records import StoredReading

_HEAD = struct.Struct("<IBB")
_NONE, _SMALL, _EXACT = 0, 1, 2
_UNSAID = -128
_NAN = float("nan")


def packed(readings: Sequence[StoredReading], number_of: Callable[[str], int]) -> bytes:
    """Return readings as bytes.

    Parameters
    ----------
    readings : sequence of StoredReading
        What was heard.
    number_of : callable
        Returns the number of a landmark, below 2**32.

    Returns
    -------
    bytes
        5 a landmark when strengths are whole numbers and ages 0.
    """
    numbers = array("I", [number_of(reading.landmark) for reading in readings])
    strengths, ages = [r.rssi_dbm for r in readings], [r.age_s for r in readings]
    kind, told = _packed_strengths(strengths)
    old = _EXACT if any(ages) else _NONE
    head = _HEAD.pack(len(numbers), kind, old)
    return b"".join((head, numbers.tobytes(), told, array("d", ages).tobytes() if old else b""))


def unpacked(body: bytes, name_of: Callable[[int], str]) -> tuple[StoredReading, ...]:
    """Return the readings that were packed.

    Parameters
    ----------
    body : bytes
        From `packed`.
    name_of : callable
        Returns the landmark of a number.

    Returns
    -------
    tuple of StoredReading
        Equal to what was packed.
    """
    count, kind, old = _HEAD.unpack_from(body)
    numbers = landmark_numbers(body)
    place = _HEAD.size + 4 * count
    strengths: Sequence[float | None] = [None] * count
    if kind == _SMALL:
        small = array("b", body[place : place + count])
        strengths = [None if value == _UNSAID else float(value) for value in small]
        place += count
    elif kind == _EXACT:
        exact = array("d", body[place : place + 8 * count])
        strengths = [None if value != value else value for value in exact]  # noqa: PLR0124
        place += 8 * count
    ages = array("d", body[place : place + 8 * count]) if old else [0.0] * count
    names = map(name_of, numbers)
    return tuple(map(StoredReading, names, strengths, ages))


def landmark_numbers(body: bytes) -> Sequence[int]:
    """Return the numbers of the landmarks that were packed."""
    count, _, _ = _HEAD.unpack_from(body)
    return array("I", body[_HEAD.size : _HEAD.size + 4 * count])


def _packed_strengths(strengths: Sequence[float | None]) -> tuple[int, bytes]:
    if not any(strength is not None for strength in strengths):
        return _NONE, b""
    said = [strength for strength in strengths if strength is not None]
    if all(value.is_integer() and _UNSAID < value < -_UNSAID for value in map(float, said)):
        whole = [_UNSAID if value is None else int(value) for value in strengths]
        return _SMALL, array("b", whole).tobytes()
    exact = [_NAN if value is None else value for value in strengths]
    return _EXACT, array("d", exact).tobytes()

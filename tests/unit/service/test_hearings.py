"""What may be heard of a scan depends on the site, so each way is tried."""

from dataclasses import replace

import pytest
from homsense_service.registering import HEARINGS, of_each_hearing
from support.corridors import Building

from homsense import Hearing, InvalidInputError, Reading, RegisteredComplex, register_crowd


def test_a_crowd_that_hears_only_weak_transmitters_is_placed() -> None:
    building = Building.of(3)
    weak = [
        replace(
            scan,
            readings=tuple(
                Reading(reading.landmark, -81.0 + ((reading.rssi_dbm or 0.0) + 38.0) / 4.0)
                for reading in scan.readings
            ),
        )
        for scan in building.crowd(1, walks=14)
    ]

    def attempt(number: int, hearing: Hearing) -> RegisteredComplex:
        assert HEARINGS[number] == hearing
        return register_crowd(weak, building.free_space, hearing=hearing)

    (found,) = of_each_hearing(attempt)
    assert found.hearing == HEARINGS[-1]
    weak = weak[:2]
    with pytest.raises(InvalidInputError, match="too few"):
        of_each_hearing(attempt)

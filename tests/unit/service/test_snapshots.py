"""A session that is read from its snapshot is the one that was written."""

from homsense_service.journaling import resumed, snapshot
from homsense_service.runs import Course, Run, Step
from homsense_service.sensors import Measured, Sensor
from homsense_service.versions import MapVersion
from support.corridors import Building

import homsense
from homsense.backend import NUMPY

DOCUMENT = {"type": "FeatureCollection", "frame": "local", "features": []}


def test_what_the_last_scan_resembled_is_kept_over_steps_and_snapshots() -> None:
    building = Building.of(0)
    version = MapVersion(DOCUMENT, building.site_map, building.free_space, "digest")
    config = homsense.LocalizerConfig(particles=50)
    height = homsense.HeightMap.geometric(building.site_map, 20.0, cell_m=5.0)
    localizer = homsense.Localizer(
        building.site_map, (height,), config, free_space=building.free_space
    )
    run = Run(version, 0.0, Sensor(), localizer)
    forward = homsense.Delta(1.0)
    course = Course.begun(run, 1)
    assert course.fix.level is None
    heard = Measured(sighting=homsense.Sighting((4, 9), (2, 7)))
    course = course.onward(Step(1, None, forward), heard, lambda: NUMPY)
    for seq in (2, 3):
        course = course.onward(Step(seq, None, forward), None, lambda: NUMPY)
        again = resumed(snapshot(course), run)
        assert again is not None
        assert again.fix.level == course.fix.level == 7
        assert again.fix.digest == course.fix.digest
    nothing = Measured(sighting=homsense.Sighting((), ()))
    assert course.onward(Step(4, None, forward), nothing, lambda: NUMPY).fix.level == 0

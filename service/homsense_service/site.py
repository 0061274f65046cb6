"""A site in memory: map, complex and what is derived from them."""

import hashlib
import threading
from collections import OrderedDict, deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import chain, islice
from typing import Any, Literal

import homsense
from homsense.engine import Engine, fastest
from homsense.likelihood import CodeLikelihood
from homsense.scan import Heard
from homsense_service.background import Builder
from homsense_service.checkpoints import Digested, sensing
from homsense_service.errors import MapMissingError
from homsense_service.expecting import Expecting, Learnt, Question, WalkedCrowd
from homsense_service.floors import RankingFloors
from homsense_service.names import Names
from homsense_service.pseudonyms import canonical
from homsense_service.records import NumberedScan, SiteConfig, StoredReading, StoredScan
from homsense_service.registering import Registering
from homsense_service.sensors import Measured, Sensor, check_simulated, simulated_sensor
from homsense_service.settings import Settings
from homsense_service.versions import ComplexVersion, MapVersion

_SENSE_CACHE = 4096
_COUNTED = 200
_LIKELIHOODS = 16


class Site:
    """A mapped place. Reading needs no lock: versions are immutable and replaced whole."""

    def __init__(
        self,
        name: str,
        config: SiteConfig,
        settings: Settings,
        engine: Callable[[], Engine] = fastest,
        builder: Builder | None = None,
    ) -> None:
        self.name = name
        self.config = config
        self.revision = 1
        self.map: MapVersion | None = None
        self.replacing = threading.Lock()
        self.writing = threading.Lock()
        self._settings = settings
        self._engine = engine
        self._sample: dict[bytes, frozenset[str]] = {}
        self.complex = self._nothing(generation=0)
        self._sensed: OrderedDict[
            tuple[frozenset[str], frozenset[str], tuple[int, ...], bool],
            list[homsense.LocalHomology],
        ] = OrderedDict()
        self._heights: dict[tuple[Any, ...], homsense.HeightMap] = {}
        self._profiles: dict[tuple[int, ...], homsense.Profiles] = {}
        own_builder = builder or Builder(engine)
        self.expecting = Expecting(own_builder)
        self.registering = Registering(own_builder)
        self.ranking_floors = RankingFloors(own_builder)
        self.tracked = 0
        self.through = 0
        self._inbox: deque[NumberedScan] = deque()
        self._codes: tuple[tuple[homsense.HeightMap, ...], homsense.CodeMap] | None = None
        self._reachable: tuple[MapVersion, float, homsense.FreeSpace] | None = None
        self._likelihoods: OrderedDict[
            tuple[object, ...], tuple[object, object, homsense.Likelihood | None]
        ] = OrderedDict()
        self._caching = threading.Lock()
        self._deriving = threading.Lock()

    def take_over(self, built: "Site") -> None:
        """Replace what the scans were made into by what another made of the same log.

        The caller holds `writing`.
        """
        digested = built.digested()
        following = replace(digested.complex, generation=self.complex.generation + 1)
        self.config = built.config
        self.resume(replace(digested, complex=following), max(self.through, built.through))
        self._profiles = {}
        with self._caching:
            self._sensed.clear()

    def resume(self, digested: Digested, through: int) -> None:
        """Go on from what the scans up to a number were made into."""
        self.complex, self._sample = digested.complex, dict(digested.sample)
        self.tracked, self.through = digested.tracked, through

    def digested(self) -> Digested:
        """Return what the scans up to `through` were made into; the caller holds `writing`."""
        return Digested(self.complex, self._sample, self.tracked)

    def receive(self, committed: Sequence[NumberedScan]) -> None:
        """Take note of scans that are on disk, in the order of the log."""
        self._inbox.extend(committed)

    def catch_up(self, now_s: float) -> ComplexVersion:
        """Join the scans that were received into the complex; the caller holds `writing`."""
        waiting = [self._inbox.popleft() for _ in range(len(self._inbox))]
        return self.take_in(waiting, now_s)

    def take_in(self, scans: Iterable[NumberedScan], now_s: float) -> ComplexVersion:
        """Join the next scans of the log into the complex, each once."""
        fresh = [entry for entry in scans if entry.number > self.through]
        if fresh:
            self.through = fresh[-1].number
        return self.absorb([entry.scan for entry in fresh], now_s)

    def _nothing(self, generation: int) -> ComplexVersion:
        empty = homsense.WitnessFiltration(self.config.quorum, self._engine())
        return ComplexVersion(homsense.EpochFiltration(empty), 0, Names(), generation)

    def readings(self, stored: Iterable[StoredReading]) -> list[homsense.Reading]:
        """Return readings whose identifiers compare as the site's configuration says."""
        key = self.config.landmark_key
        return [homsense.Reading(canonical(r.landmark, key), r.rssi_dbm, r.age_s) for r in stored]

    def visible(self, stored: Iterable[StoredReading]) -> frozenset[str]:
        """Return the landmarks that count as visible under the site's configuration."""
        key = self.config.landmark_key
        return frozenset(canonical(name, key) for name in self.in_view(stored))

    def in_view(self, readings: Iterable[Heard]) -> frozenset[str]:
        """Return the same, named as the readings name them."""
        return homsense.visible_landmarks(
            readings, min_rssi_dbm=self.config.min_rssi_dbm, max_age_s=self.config.max_age_s
        )

    def absorb(self, scans: Sequence[StoredScan], now_s: float) -> ComplexVersion:
        """Join scans that still count into the complex; the caller holds `writing`."""
        observations = [self.visible(scan.readings) for scan in scans]
        self._keep_sample(scans, observations)
        self.tracked += sum(scan.track is not None for scan in scans)
        now = self.complex
        before = now.epochs.run_by(self._engine())
        first, current = self._epochs_that_count(now_s)
        kept = before.since(first)
        seen = [
            (min(epoch, current), scan.device, visible)
            for scan, visible in zip(scans, observations, strict=True)
            if (epoch := self._epoch(scan.observed_at)) >= first
        ]
        grown = kept.with_observations(seen)
        depth = self.config.quorum
        changed = grown.merged.level(depth) is not before.merged.level(depth)
        suspects, known = now.doubts
        if changed and self.config.quarantine and suspects is not None:
            suspects = suspects.joined_by(chain(*observations)) if kept is before else None
        self.complex = ComplexVersion(
            grown,
            now.number + len(scans),
            now.devices.joined_by(scan.device for scan in scans),
            now.generation + changed,
            suspects,
            known,
        )
        return self.complex

    def _epoch(self, moment_s: float) -> int:
        return 0 if self.config.retention is None else int(moment_s // self.config.retention[0])

    def _epochs_that_count(self, now_s: float) -> tuple[int, int]:
        """Return the first and the current one; later scans count as current."""
        current = self._epoch(now_s)
        count = 1 if self.config.retention is None else self.config.retention[1]
        return current + 1 - count, current

    def _keep_sample(
        self, scans: Sequence[StoredScan], observations: Sequence[frozenset[str]]
    ) -> None:
        """Keep the scans with the smallest hashes: uniform, and the same in any order."""
        limit = self._settings.calibration_scans
        fresh = {
            _hashed(scan): seen for scan, seen in zip(scans, observations, strict=True) if seen
        }
        is_full = len(self._sample) >= limit
        if fresh and not (is_full and min(fresh) > next(reversed(self._sample))):
            sample = self._sample | fresh
            self._sample = {key: sample[key] for key in sorted(sample)[:limit]}

    def sense(
        self, visible: frozenset[str], hops: tuple[int, ...], *, lasting: bool = False
    ) -> list[homsense.LocalHomology]:
        """Return the local homology of a visible set, counted once until it can have changed."""
        current = self.complex
        grown = current.landmark_complex.run_by(self._engine())
        left_out = current.left_out
        key = (grown.names(grown.numbers(visible - left_out)), left_out, hops, lasting)
        found = self._sensed.get(key)
        if found is None or not all(level.holds_in(grown) for level in found):
            found = homsense.sense_local_homology(
                grown, key[0], hops, lasting=lasting, without=left_out
            )
        with self._caching:
            self._sensed[key] = found
            self._sensed.move_to_end(key)
            while len(self._sensed) > _SENSE_CACHE:
                self._sensed.popitem(last=False)
        return found

    def sense_within(
        self, visible: frozenset[str], r_pseudo_m: Sequence[float]
    ) -> list[homsense.LocalHomology]:
        """Return the local homology within some pseudo-distances."""
        current = self.complex
        grown = current.landmark_complex.run_by(self._engine())
        return homsense.sense_within(
            grown, visible, r_pseudo_m, self.config.s_max_m, without=current.left_out
        )

    def sense_raw(
        self, visible: frozenset[str], levels: Sequence[homsense.LocalHomology]
    ) -> list[homsense.LocalHomology]:
        """Return the same neighborhoods in the complex of all that any device has seen."""
        raw = self.complex.raw.run_by(self._engine())
        hops = [level.hops for level in levels if level.hops is not None]
        if hops:
            return homsense.sense_local_homology(raw, visible, hops)
        radii = [level.r_pseudo_m for level in levels if level.r_pseudo_m is not None]
        return homsense.sense_within(raw, visible, radii, self.config.s_max_m)

    def require_map(self) -> MapVersion:
        """Return the map or raise `MapMissingError`."""
        if self.map is None:
            message = f"the site {self.name!r} has no map; put one first"
            raise MapMissingError(message)
        return self.map

    def profiles(self, hops: tuple[int, ...]) -> homsense.Profiles:
        """Return the holes near each landmark of the complex as it is now."""
        current = self.complex
        known = self._profiles.get(hops)
        grown = current.landmark_complex.run_by(self._engine())
        if known is None:
            found = homsense.Profiles(grown, hops, current.left_out)
        else:
            found = known.onward(grown, current.left_out)
        self._profiles[hops] = found
        return found

    def measure(
        self,
        stored: Sequence[StoredReading],
        sensor: Sensor,
        before: tuple[frozenset[str], ...] = (),
    ) -> Measured:
        """Return what a sensor makes of a scan and of those that were seen before it."""
        readings, detection = self.readings(stored), sensor.detection
        seen = (*before, self.in_view(readings)) if sensor.hops else ()
        visible = detection.in_view(seen)
        holes = self._count(visible, sensor) if visible else None
        kept = seen[len(seen) + 1 - detection.scans :]
        if sensor.registered is None:
            return Measured(holes, seen=kept)
        return Measured(holes, sensor.registered.likelihood.complex.sighting(readings), kept)

    def _count(self, visible: frozenset[str], sensor: Sensor) -> tuple[float, ...] | None:
        """Return the holes near a visible set; None when the complex knows none of it."""
        if sensor.expected == "simulated":
            return self.profiles(sensor.hops).mean_holes(visible)
        levels = self.sense(visible, sensor.hops)
        return tuple(level.holes for level in levels) if levels[0].n_landmarks else None

    def sensor(
        self,
        hops: Sequence[int] | None = None,
        expected: Literal["simulated", "geometric"] | None = None,
    ) -> Sensor:
        """Return how sessions measure now; a site with few scans is geometric."""
        wanted, detection = hops or self.config.hops, self.config.detection
        enough = len(self._sample) >= self._settings.expectation_scans
        if (expected or self.config.expected) == "geometric" or not enough:
            near_and_far = tuple(wanted or self.config.near_and_far)
            with self._deriving:
                heights = tuple(self._height(radius) for radius in near_and_far)
            return Sensor(near_and_far, "geometric", heights, detection=detection)
        check_simulated(wanted or ())
        sensor = simulated_sensor(self.learnt(), wanted, self.profiles)
        return replace(sensor, detection=detection)

    def learnt(self) -> Learnt:
        """Return what the site knows about its sensor, when it is simulated."""
        return self.expecting.learnt(self.question(), self._settings.expectation_wait_s)

    def gains(self, learnt: Learnt) -> tuple[float, ...]:
        """Return how the counts of this site compare with what it expects."""
        sensor = simulated_sensor(learnt, self.config.hops, self.profiles)
        return () if sensor.noise is None else sensor.noise.gains

    def question(self) -> Question:
        """Return what the expectation depends on."""
        now = self.complex
        return Question(
            self.require_map(),
            self._sample,
            now.landmark_complex.n_landmarks,
            now.number,
            self.in_view,
            self.profiles,
            self._walked_crowd,
            sensing(self.config),
        )

    def _walked_crowd(self) -> WalkedCrowd | None:
        """Return where the crowd walks, if it has a place on the map beyond doubt."""
        crowd = self.registering.current
        if crowd is None or self.map is None or crowd.map_digest != self.map.digest:
            return None
        if crowd.complex.registration.is_doubtful:
            return None
        return WalkedCrowd(crowd.walked_xy, crowd.sample, crowd.sample_xy, crowd.names)

    def code_map(
        self, reachable: homsense.FreeSpace, heights: tuple[homsense.HeightMap, ...]
    ) -> homsense.CodeMap:
        """Return height maps as one look-up table."""
        with self._deriving:
            known = self._codes
            if known is None or known[0] != heights or known[1].free_space is not reachable:
                self._codes = known = heights, homsense.CodeMap.of(reachable, heights)
            return known[1]

    def likelihood(
        self, reachable: homsense.FreeSpace, sensor: Sensor, noise: homsense.Noise
    ) -> homsense.Likelihood | None:
        """Return what weighs the measurements of a sensor, one for all who measure alike."""
        key = (id(reachable), tuple(map(id, sensor.heights)), noise, id(sensor.registered))
        known = self._likelihoods.get(key)
        if known is None:
            known = reachable, sensor, self._likelihood(reachable, sensor, noise)
            with self._caching:
                self._likelihoods[key] = known
                while len(self._likelihoods) > _LIKELIHOODS:
                    self._likelihoods.popitem(last=False)
        return known[2]

    def _likelihood(
        self, reachable: homsense.FreeSpace, sensor: Sensor, noise: homsense.Noise
    ) -> homsense.Likelihood | None:
        counting = None
        if sensor.hops:
            counting = CodeLikelihood(self.code_map(reachable, sensor.heights), noise)
        if sensor.registered is None:
            return counting
        place = sensor.registered.likelihood
        return place if counting is None else homsense.JointLikelihood(place, counting)

    def reachable(
        self, version: MapVersion, tolerance_m: float | None = None
    ) -> homsense.FreeSpace:
        """Return where devices are looked for: free space, and a little behind its walls."""
        if tolerance_m is None:
            tolerance_m = self.config.wall_tolerance_m
        if not tolerance_m:
            return version.free_space
        with self._deriving:
            known = self._reachable
            if known is None or known[0] is not version or known[1] != tolerance_m:
                widened = version.free_space.widened(tolerance_m)
                self._reachable = known = version, tolerance_m, widened
            return known[2]

    def _height(self, hops: int) -> homsense.HeightMap:
        current, config = self.require_map(), self.config
        generation = self.complex.generation if config.r_geo_m is None else None
        key = (current.digest, config, generation, hops)
        if key not in self._heights:
            self._heights = {k: v for k, v in self._heights.items() if k[:3] == key[:3]}
            self._heights[key] = homsense.HeightMap.geometric(
                current.site_map,
                self._r_geo(current, hops),
                cell_m=self._settings.height_cell_m,
                distance=config.distance,
            )
        return self._heights[key]

    def _r_geo(self, current: MapVersion, hops: int) -> float:
        """Return the radius that is set, or calibrated, or as far as the hops can reach."""
        config = self.config
        if config.r_geo_m is not None and hops in config.near_and_far:
            return config.r_geo_m[config.near_and_far.index(hops)]
        counts = self._calibration_counts(hops)
        if not any(counts):
            return max(1, hops) * config.s_max_m
        return homsense.calibrate_r_geo(current.site_map, current.free_space, counts)

    def _calibration_counts(self, hops: int) -> list[int]:
        levels = tuple(sorted({*self.config.near_and_far, hops}))
        at = levels.index(hops)
        some = islice(self._sample.values(), _COUNTED)
        return [self.sense(visible, levels)[at].holes for visible in some]


def _hashed(scan: StoredScan) -> bytes:
    key = f"{scan.device}\0{scan.scan_id}".encode()
    return hashlib.blake2b(key, digest_size=16).digest()

"""The rim towards zenoh: who sends what, and which device it concerns."""

import asyncio
import json
import logging
import time
from collections.abc import Callable
from functools import partial
from typing import NamedTuple
from weakref import WeakValueDictionary

import zenoh

import homsense
from homsense_service.bridge.device import Desk, Device
from homsense_service.bridge.devices import Devices
from homsense_service.bridge.encodings import Stamp, stamp_of
from homsense_service.bridge.keyspace import METHODS, KeySpace
from homsense_service.bridge.lanes import Job, Lane, Workers
from homsense_service.bridge.opening import OpenIn, Opening
from homsense_service.bridge.outputs import Events, Output
from homsense_service.bridge.presence import Presence
from homsense_service.bridge.requests import Request
from homsense_service.errors import (
    BodyTooLargeError,
    MethodNotFoundError,
    OverloadError,
    ServiceError,
    TokenError,
)
from homsense_service.keys import KeyRing
from homsense_service.limiting import RateLimit
from homsense_service.metrics import Metrics
from homsense_service.operations import Operations
from homsense_service.problems import kind_of
from homsense_service.records import Binding
from homsense_service.settings import Settings
from homsense_service.streams import Streams

_log = logging.getLogger(__name__)

WORKERS, OPENERS = 8, 64
TICK_S = 0.5
AGAIN_S = 5.0


class House(NamedTuple):
    """What all rims of the service share.

    Parameters
    ----------
    operations : Operations
        What the service does.
    keys : KeyRing
        Who may.
    rate_limit : RateLimit
        How often.
    streams : Streams
        Readers of poses.
    metrics : Metrics
        What an operator watches.
    """

    operations: Operations
    keys: KeyRing
    rate_limit: RateLimit
    streams: Streams
    metrics: Metrics


class Bridge:
    """Devices on a zenoh network.

    Parameters
    ----------
    network : zenoh.Session
        Closed with the bridge.
    house : House
        What it shares with REST.
    settings : Settings
        Prefix and limits.
    """

    def __init__(self, network: zenoh.Session, house: House, settings: Settings) -> None:
        self._network, self._house, self._settings = network, house, settings
        self._loop = asyncio.get_running_loop()
        self._keys = keys = KeySpace(settings.zenoh_prefix)
        self._clock = time.monotonic
        self._workers = Workers(WORKERS, "device")
        self._openers = Workers(OPENERS, "opening")
        self._doors: WeakValueDictionary[str, Lane] = WeakValueDictionary()
        self._opening = Opening(house.operations, house.keys, settings)
        self._events = Events(network, keys, self._clock)
        self._devices = Devices(house.operations.bindings(), self._made, self._events.tell)
        self._desk = Desk(
            house.operations,
            self._workers,
            self._clock,
            self._later,
            self._took,
            self._lost,
            self._events.tell,
            self._devices.forget,
        )
        kinds = ("motion", *METHODS)
        self._counts = {kind: house.metrics.inputs.labels(kind) for kind in kinds}
        self._listeners: dict[str, Callable[[Device, bytes], None]] = {}
        house.streams.listeners.append(self._publish)
        self._token = network.liveliness().declare_token(keys.service(str(network.zid())))
        network.declare_subscriber(keys.of_device("*", "imu"), self._on_motion)
        network.declare_subscriber(keys.of_device("*", "scan"), self._on_scan)
        network.declare_queryable(keys.rpc("*", "*"), self._on_query)
        network.liveliness().declare_subscriber(keys.alive("*"), self._on_alive, history=True)
        self._ticking = asyncio.create_task(self._tick())

    def close(self) -> None:
        """Leave the network; what waits is not on disk and was not acknowledged."""
        self._ticking.cancel()
        self._house.streams.listeners.remove(self._publish)
        self._network.close()  # type: ignore[no-untyped-call]
        self._openers.close()
        self._workers.close()

    def _made(self, binding: Binding) -> Device:
        output = Output(self._network, self._keys, binding.device)
        settings = self._settings
        presence = Presence(self._clock(), settings.zenoh_silence_s, settings.zenoh_grace_s)
        return Device(binding, self._desk, output, presence)

    def _on_motion(self, sample: zenoh.Sample) -> None:
        self._counts["motion"].inc()
        found = self._admitted(sample)
        if found is not None:
            device, stamp = found
            device.move(stamp.number, str(sample.encoding), sample.payload.to_bytes())

    def _on_scan(self, sample: zenoh.Sample) -> None:
        self._counts["scan"].inc()
        found = self._admitted(sample)
        if found is not None:
            device, stamp = found
            device.hear(stamp.number, sample.payload.to_bytes())

    def _admitted(self, sample: zenoh.Sample) -> tuple[Device, Stamp] | None:
        """Return the device of a message and its stamp; tell the device when it is refused."""
        key = str(sample.key_expr)
        name = self._keys.device_of(key)
        if name is None:
            self._house.metrics.refused.labels("wildcard").inc()
            _log.warning("a message to %s names no device", key)
            return None
        try:
            attachment = sample.attachment
            stamp = stamp_of(None if attachment is None else attachment.to_bytes())
            return self._checked(name, stamp, len(sample.payload))
        except ServiceError as error:
            code = kind_of(error).code
            self._house.metrics.refused.labels(code).inc()
            self._events.tell(name, code, str(error))
            return None

    def _checked(self, name: str, stamp: Stamp | None, size: int) -> tuple[Device, Stamp]:
        self._check_size(size)
        device = self._devices.get(name)
        sound = device.check(stamp)
        if not self._house.keys.has(device.binding.key):
            message = "the key that has opened the session is no longer good"
            raise TokenError(message)
        device.presence.heard(self._clock())
        return device, sound

    def _check_size(self, size: int) -> None:
        most = self._settings.zenoh_max_bytes
        if size > most:
            message = f"the message has {size} bytes, the limit is {most}"
            raise BodyTooLargeError(message)

    def _on_query(self, query: zenoh.Query) -> None:
        request = Request(query)
        try:
            self._ask(request)
        except Exception as error:  # noqa: BLE001 - whoever asks is answered
            self._house.metrics.refused.labels(kind_of(error).code).inc()
            self._workers.submit(partial(request.refuse, error))

    def _ask(self, request: Request) -> None:
        name = self._keys.device_of(request.key)
        if request.method not in METHODS or name is None:
            message = f"{request.key} is no request of a device: {', '.join(METHODS)}"
            raise MethodNotFoundError(message)
        self._counts[request.method].inc()
        if request.method == "open":
            self._house.rate_limit.hit(f"device {name}")
            self._check_size(len(request.payload))
            door = self._door(name)
            let_in = partial(self._let_in, name, request.payload)
            if not door.post(partial(request.settle, let_in)):
                message = "too many devices wait to be let in"
                raise OverloadError(message)
            return
        stamp = stamp_of(request.attachment)
        device, sound = self._checked(name, stamp, len(request.payload))
        if request.method == "close":
            self._workers.submit(partial(request.settle, partial(self._close, device)))
        else:
            device.ask(request, sound.number)

    def _door(self, name: str) -> Lane:
        """Return where a device waits to be let in, behind nobody but itself."""
        return self._doors.setdefault(name, Lane(self._openers))

    def _let_in(self, name: str, payload: bytes) -> bytes:
        """Open a session, in a thread of its own: a site may have to learn something first."""
        asked = OpenIn.model_validate_json(payload)
        binding = self._opening.bound(name, asked, self._devices.binding(name))
        self._devices.adopt(binding)
        return self._opening.answer(binding)

    def device(self, name: str) -> Device:
        """Return a device or raise `DeviceNotFoundError`."""
        return self._devices.get(name)

    def listen(self, name: str, take: Callable[[Device, bytes], None]) -> None:
        """Tell somebody of the poses of a device."""
        self._listeners[name] = take

    def tell(self, name: str, code: str, detail: str) -> None:
        """Tell a device what went wrong."""
        self._events.tell(name, code, detail)

    def let_in_known(self, name: str, asked: OpenIn, opened: Callable[[int], None]) -> None:
        """Open a session for a device that the operator has named, as soon as its site can.

        Parameters
        ----------
        name : str
            Of the device.
        asked : OpenIn
            What it is to have.
        opened : callable
            Told the number of its last input.
        """

        def attempt() -> None:
            try:
                binding = self._opening.granted(name, asked, self._devices.binding(name))
                self._devices.adopt(binding)
                number = self._house.operations.sessions.get(binding.session).fix.seq
            except (ServiceError, homsense.HomsenseError) as error:
                _log.warning("%s has no session yet: %s", name, error)
                self._later(AGAIN_S, again)
            else:
                opened(number)

        def again() -> None:
            self._door(name).post(attempt)

        again()

    def _close(self, device: Device) -> bytes:
        self._house.operations.sessions.close(device.session)
        self._house.streams.end(device.session)
        self._devices.forget(device.name)
        return json.dumps({"session": device.session, "closed": True}).encode()

    def _took(self, session: str, steps: int, frame: bytes) -> None:
        self._house.metrics.steps.inc(steps)
        self._house.streams.publish(session, frame)

    def _publish(self, session: str, frame: bytes) -> None:
        device = self._devices.of_session(session)
        if device is None:
            return
        try:
            device.publish(frame)
            listener = self._listeners.get(device.name)
            if listener is not None:
                listener(device, frame)
        except Exception:  # noqa: BLE001 - the step itself is on disk
            _log.exception("a pose of %s was not sent", device.name)

    def _lost(self, name: str, count: int) -> None:
        self._house.metrics.lost_inputs.inc(count)
        self._events.tell(name, "gap", f"{count} inputs never came", lost=count)

    def _later(self, seconds: float, job: Job) -> None:
        try:
            self._loop.call_soon_threadsafe(self._loop.call_later, seconds, job)
        except RuntimeError:
            _log.debug("the service stops; nothing is done later")

    def _on_alive(self, sample: zenoh.Sample) -> None:
        name = self._keys.device_of(str(sample.key_expr))
        device = None if name is None else self._devices.present(name)
        if device is None:
            return
        if sample.kind == zenoh.SampleKind.DELETE:
            device.presence.vanished(self._clock())
        else:
            device.presence.appeared(self._clock())

    async def _tick(self) -> None:
        """Look after devices that come and go."""
        while True:
            await asyncio.sleep(TICK_S)
            counted = self._devices.look(self._clock())
            self._house.metrics.devices.labels("online").set(counted["online"])
            self._house.metrics.devices.labels("offline").set(counted["offline"])

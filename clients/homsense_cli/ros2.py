"""``homsense ros2 check``: what a ROS 2 graph looks like beside a mapping file."""

import time
from collections.abc import Iterator
from pathlib import Path

import zenoh
from homsense_client.streaming import connect
from homsense_service.ros2.graph import HASHES, NO_HASH, TOKENS, Endpoint, endpoint_of
from homsense_service.ros2.mapping import Mapping, read_mapping
from rich.console import Console


def run_check(mapping: Path, endpoints: list[str], wait_s: float, console: Console) -> bool:
    """Explain what is seen of each robot of a mapping; tell whether all is well.

    Parameters
    ----------
    mapping : pathlib.Path
        The mapping file.
    endpoints : list of str
        Of the robots' routers.
    wait_s : float
        How long messages are counted, seconds.
    console : rich.console.Console
        Where findings go.

    Returns
    -------
    bool
        False when a topic is not there, has another type, or brings no message.
    """
    wanted = read_mapping(mapping)
    with connect(*endpoints) as network:
        seen = list(_endpoints(network.session, wanted.domain))
        counts = _counted(network.session, wanted, wait_s)
    console.print(
        f"{wanted.dialect}, domain {wanted.domain}: {len(seen)} publishers and subscriptions"
    )
    sound = True
    for robot in wanted.robots:
        console.print(f"robot {robot.device} on site {robot.site}")
        for topic, kind in robot.inputs().items():
            wrong = _finding(topic, kind, seen, counts[topic], wanted)
            sound &= wrong is None
            told = wrong or f"{counts[topic] / wait_s:.1f} messages a second"
            console.print(f"  {'--' if wrong else 'ok'} {topic} ({kind}): {told}")
        for topic, kind in robot.outputs().items():
            readers = [e.node for e in seen if e.kind == "MS" and e.topic == topic]
            others = [e.type_name for e in seen if e.topic == topic and e.type_name != kind]
            told = f"read by {', '.join(readers)}" if readers else "nobody reads it yet"
            if others:
                sound, told = False, f"others say that its type is {others[0]}"
            console.print(f"  {'--' if others else 'ok'} {topic} ({kind}): {told}")
    return sound


def _endpoints(session: zenoh.Session, domain: int) -> Iterator[Endpoint]:
    for reply in session.liveliness().get(f"{TOKENS}/{domain}/**", timeout=2.0):
        found = None if reply.ok is None else endpoint_of(str(reply.ok.key_expr))
        if found is not None:
            yield found


def _counted(session: zenoh.Session, wanted: Mapping, wait_s: float) -> dict[str, int]:
    counts: dict[str, int] = {}
    subscriptions = []
    for robot in wanted.robots:
        for topic, kind in robot.inputs().items():
            counts[topic] = 0

            def count(_sample: zenoh.Sample, topic: str = topic) -> None:
                counts[topic] += 1

            key = wanted.graph.any_version(topic, kind)
            subscriptions.append(session.declare_subscriber(key, count))
    time.sleep(wait_s)
    return counts


def _finding(
    topic: str, kind: str, seen: list[Endpoint], count: int, wanted: Mapping
) -> str | None:
    """Return what is wrong with a topic that a robot is to publish."""
    publishers = [e for e in seen if e.kind == "MP" and e.topic == topic]
    if not publishers and wanted.dialect == "rmw_zenoh":
        other = sorted(e.topic for e in seen if e.kind == "MP" and e.type_name == kind)
        hint = f"; {kind} is published on {', '.join(other)}" if other else ""
        return f"nobody publishes it{hint}"
    for publisher in publishers:
        if publisher.type_name != kind:
            return f"{publisher.node} publishes {publisher.type_name}"
        known = {f"RIHS01_{HASHES[kind]}", NO_HASH}
        if publisher.hashed not in known:
            return f"{publisher.node} has another version of the type: {publisher.hashed}"
    if count == 0:
        return "there is a publisher, but no message came" if publishers else "no message came"
    return None

"""Who may put and ask what on the network itself: zenoh's access control, one rule set a device.

The token of a session already keeps strangers out of a stream. This keeps them from the keys,
too, and binds the name of a device to its certificate or password. zenoh reads it at its start.
"""

from collections.abc import Sequence
from typing import Any

from homsense_service.bridge.keyspace import KeySpace, is_device

IDENTITIES = {"certificate": "cert_common_names", "password": "usernames"}
"""What a device is known by, and what zenoh calls it."""

SERVICE = "homsense-service"


def access_control(
    devices: Sequence[str], prefix: str, by: str, *, names_service: bool
) -> dict[str, Any]:
    """Return the `access_control` of a router, or of a service that listens itself.

    Parameters
    ----------
    devices : sequence of str
        Names of the devices; each is also the common name of its certificate, or its user name.
    prefix : str
        Of all keys.
    by : str
        What a device is known by, one of the values of `IDENTITIES`.
    names_service : bool
        Whether the service comes in like a device, under the name `homsense-service`; true for a
        router.

    Returns
    -------
    dict
        Everything else is denied.

    Raises
    ------
    ValueError
        If a device cannot have its name.
    """
    for name in devices:
        if not is_device(name):
            message = f"device: {name!r} is not 1 to 64 letters, digits, '_', '.' and '-'"
            raise ValueError(message)
    keys = KeySpace(prefix)
    rules_of = {name: _rules(name, keys) for name in devices}
    rules = [rule for found in rules_of.values() for rule in found]
    subjects = [{"id": name, by: [name]} for name in devices]
    policies = [
        {"rules": [rule["id"] for rule in found], "subjects": [name]}
        for name, found in rules_of.items()
    ]
    if names_service:
        everything = [
            "put", "delete", "declare_subscriber", "query", "declare_queryable", "reply",
            "liveliness_token", "liveliness_query", "declare_liveliness_subscriber",
        ]  # fmt: skip
        rules.append(_rule(SERVICE, everything, ["ingress", "egress"], [f"{keys.root}/**"]))
        subjects.append({"id": SERVICE, by: [SERVICE]})
        policies.append({"rules": [SERVICE], "subjects": [SERVICE]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def _rules(name: str, keys: KeySpace) -> list[dict[str, Any]]:
    """Return what a device may do."""
    sent = [keys.of_device(name, what) for what in ("imu", "scan")]
    received = [keys.of_device(name, what) for what in ("pose", "particles", "event")]
    rpc = keys.rpc(name, "*")
    service = [keys.of_device("*", "imu"), keys.of_device("*", "scan"), keys.rpc("*", "*")]
    declared = ["declare_subscriber", "declare_queryable"]
    return [
        _rule(f"{name} sends", ["put"], ["ingress"], sent),
        _rule(f"{name} asks", ["query"], ["ingress"], [rpc]),
        _rule(f"{name} is answered", ["reply"], ["egress"], [rpc]),
        _rule(f"{name} reads", ["declare_subscriber"], ["ingress"], received),
        _rule(f"{name} receives", ["put"], ["egress"], received),
        _rule(f"{name} lives", ["liveliness_token"], ["ingress"], [keys.alive(name)]),
        _rule(f"{name} finds the service", declared, ["egress"], service),
    ]


def _rule(name: str, messages: list[str], flows: list[str], keys: list[str]) -> dict[str, Any]:
    return {
        "id": name,
        "permission": "allow",
        "messages": messages,
        "flows": flows,
        "key_exprs": keys,
    }

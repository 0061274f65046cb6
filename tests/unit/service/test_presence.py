"""Who is there: tokens and messages come over lanes of their own, in any order."""

from homsense_service.bridge.presence import DEBOUNCE_S, Presence


def of_a_device() -> Presence:
    """Return the presence of a device that is silent after 5 s and gone 60 s later."""
    return Presence(0.0, silence_s=5.0, grace_s=60.0)


def test_a_message_that_is_handled_after_the_end_of_the_token_brings_nobody_back() -> None:
    presence = of_a_device()
    presence.vanished(1.0)
    presence.heard(1.1)
    assert presence.state(1.0 + DEBOUNCE_S) == "offline"
    assert presence.state(61.0 + DEBOUNCE_S) == "gone"


def test_a_device_that_streams_on_without_a_token_is_there() -> None:
    presence = of_a_device()
    presence.vanished(1.0)
    presence.heard(1.0 + DEBOUNCE_S)
    assert presence.state(2.0) == "online"


def test_a_device_that_connects_again_never_was_away() -> None:
    presence = of_a_device()
    presence.vanished(1.0)
    presence.appeared(1.2)
    assert presence.state(1.0 + DEBOUNCE_S) == "online"

"""Devices that stream over zenoh, into the same sessions as over REST."""

"""The localization service: REST around `homsense`, with a store in one directory."""

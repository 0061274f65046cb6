"""The ``homsense`` command; the only package that may import all the others."""

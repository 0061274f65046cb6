"""Compiled code that is kept on disk."""

from types import ModuleType

import numpy as np
import pytest

from homsense.compiled.jit import fingerprint


@pytest.mark.parametrize(
    ("before", "after"),
    [(8, 9), (0.5, 0.68), ((0, 1), (1, 0)), (np.int32(1), np.int32(2)), (np.eye(2), np.eye(3))],
)
def test_code_with_another_constant_is_other_code(before: object, after: object) -> None:
    module = ModuleType("kernels")
    found = []
    for constant in (before, after):
        module.__dict__["_CONSTANT"] = constant
        found.append(fingerprint(module))
    assert found[0] != found[1]

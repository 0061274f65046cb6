"""The OpenAPI document as a contract: requests made from it, answers held against it."""

import fuzz
from contract import run


def test_answers_are_as_the_document_says() -> None:
    done = run(examples=3, seed=2)
    assert done.returncode == 0, done.stdout[-6000:]
    assert "operations returned only 401" not in done.stdout


def test_malformed_inputs_crash_no_parser() -> None:
    fuzzed = fuzz.run(2000)
    assert sum(fuzzed.told.values()) >= 2000
    assert {200, 400, 422} <= fuzzed.told.keys()

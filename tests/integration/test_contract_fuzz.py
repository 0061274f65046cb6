"""The OpenAPI document as a contract: requests made from it, answers held against it."""

from contract import run


def test_answers_are_as_the_document_says() -> None:
    done = run(examples=5, seed=2)
    assert done.returncode == 0, done.stdout[-6000:]
    assert "operations returned only 401" not in done.stdout

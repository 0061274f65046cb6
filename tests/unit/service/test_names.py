"""Names that only come: each version sees those that were there, whoever goes on from it."""

import json

from homsense_service.names import Names
from hypothesis import given
from hypothesis import strategies as st

words = st.lists(st.sampled_from("abcdefgh"), max_size=5)


@given(additions=st.lists(st.tuples(st.integers(0, 9), words), max_size=10))
def test_a_version_is_the_set_that_it_was_made_as(
    additions: list[tuple[int, list[str]]],
) -> None:
    versions, models = [Names()], [frozenset[str]()]
    for number, more in additions:
        base = number % len(versions)
        versions.append(versions[base].joined_by(more))
        models.append(models[base].union(more))
    for version, model in zip(versions, models, strict=True):
        assert (len(version), frozenset(version)) == (len(model), model)


@given(words)
def test_names_come_back_from_a_document(given_names: list[str]) -> None:
    names = Names().joined_by(given_names)
    assert set(Names().joined_by(json.loads(json.dumps(sorted(names))))) == set(names)

"""Files that hold a map, and files that do not."""

import gzip
import json
from pathlib import Path

import pytest
from homsense_cli.maps import read_map

SQUARE = {"type": "Polygon", "coordinates": [[[0, 0], [6, 0], [6, 6], [0, 6], [0, 0]]]}


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("[1, 2]", "is not a map"),
        ('{"type": "Point", "coordinates": [1, 2]}', "is not a map"),
        ("{1", "is not JSON"),
    ],
)
def test_what_is_not_a_map_is_refused_by_name(content: str, reason: str, tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    path.write_text(content)
    with pytest.raises(ValueError, match=f"plan.json {reason}"):
        read_map(path)


def test_a_map_may_be_packed(tmp_path: Path) -> None:
    path = tmp_path / "plan.json.gz"
    path.write_bytes(gzip.compress(json.dumps(SQUARE).encode()))
    assert read_map(path) == SQUARE

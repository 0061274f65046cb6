"""What the README shows is what happens."""

import re
from pathlib import Path

import pytest
from homsense_cli.local_service import local_service

README = Path(__file__).parents[2] / "README.md"


def test_every_python_block_of_the_readme_prints_what_it_says(
    capsys: pytest.CaptureFixture[str],
) -> None:
    blocks = re.findall(r"```python\n(.*?)```", README.read_text(), flags=re.DOTALL)
    assert len(blocks) == 2
    with local_service() as url:
        for block in blocks:
            capsys.readouterr()
            exec(compile(block.replace("http://127.0.0.1:8080", url), str(README), "exec"), {})
            promised = re.findall(r"  # ([^:\n]*?)(?::.*)?$", block, flags=re.MULTILINE)
            assert capsys.readouterr().out.splitlines() == promised

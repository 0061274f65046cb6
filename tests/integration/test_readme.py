"""What the README shows is what happens."""

import json
import re
from pathlib import Path

import pytest
from homsense_cli.local_service import free_port, local_service

README = Path(__file__).parents[2] / "README.md"


def test_every_python_block_of_the_readme_prints_what_it_says(
    capsys: pytest.CaptureFixture[str],
) -> None:
    blocks = re.findall(r"```python\n(.*?)```", README.read_text(), flags=re.DOTALL)
    assert len(blocks) == 3
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with local_service(zenoh_listen=json.dumps([endpoint])) as url:
        here = {"http://127.0.0.1:8080": url, "tcp/127.0.0.1:7447": endpoint}
        for block in blocks:
            capsys.readouterr()
            code = re.sub("|".join(here), lambda found: here[found[0]], block)
            exec(compile(code, str(README), "exec"), {})
            promised = re.findall(r"  # ([^:\n]*?)(?::.*)?$", block, flags=re.MULTILINE)
            assert capsys.readouterr().out.splitlines() == promised

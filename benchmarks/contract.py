"""Requests made from the OpenAPI document against a service, and answers held against it.

schemathesis makes them: every operation, boundary values, wrong types, missing members, wrong
keys, sequences of operations. Exits with its exit code.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import httpx
from homsense_cli.local_service import start
from homsense_cli.stored import add_key

HOUSE = [[0, 0], [30, 0], [30, 30], [0, 30], [0, 0]]
CONFIGURATION = """
[auth.openapi.HTTPBearer]
bearer = "{token}"

# What makes no sense together, or is another version, cannot be said in a schema.
[checks.positive_data_acceptance]
expected-statuses = ["2xx", "3xx", 401, 403, 404, 409, 412, 422, 429, "5xx"]

# What a site is still learning is answered with 503 and Retry-After.
[checks.not_a_server_error]
expected-statuses = ["2xx", "3xx", "4xx", 503]

# A bad scan is told and dropped; it does not spoil its batch.
[[operations]]
include-path = "/v1/sites/{{site}}/scans"
checks.negative_data_rejection.enabled = false
"""


def run(examples: int, seed: int) -> subprocess.CompletedProcess[str]:
    """Return what schemathesis says.

    Parameters
    ----------
    examples : int
        Most of each operation.
    seed : int
        Of the requests.

    Returns
    -------
    subprocess.CompletedProcess
        Exit code 0 when nothing was found.
    """
    with tempfile.TemporaryDirectory() as directory:
        data, configuration = Path(directory, "data"), Path(directory, "schemathesis.toml")
        token = add_key(data, "boss", ["admin"], None)
        configuration.write_text(CONFIGURATION.format(token=token))
        with start(data, engine="python", expectation_wait_s=0.1) as url:
            headers = {"authorization": f"Bearer {token}"}
            with httpx.Client(base_url=url, headers=headers) as client:
                client.put("/v1/sites/0", json={"hops": [1]})
                square = {"type": "Polygon", "coordinates": [HOUSE], "frame": "local"}
                client.put("/v1/sites/0/map", json=square)
            command = [
                *(str(Path(sys.executable).with_name("schemathesis")), "--config-file"),
                *(str(configuration), "run", f"{url}/openapi.json", "--seed", str(seed)),
                *("--max-examples", str(examples), "--exclude-path-regex", "events$|/keys"),
                "--no-color",
            ]
            return subprocess.run(
                command, check=False, text=True, capture_output=True, env={**os.environ, "CI": "1"}
            )


def main() -> int:
    """Print what was found and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--examples", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    done = run(given.examples, given.seed)
    found = re.search(r"(\d+) generated", done.stdout)
    if done.returncode or found is None:
        print(done.stdout[-8000:], done.stderr[-2000:])
    else:
        told = json.dumps({"requests": int(found[1]), "seed": given.seed, "found": 0})
        print(f"contract: {told}")
    return done.returncode


if __name__ == "__main__":
    sys.exit(main())

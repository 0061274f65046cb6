"""What stays is not looked at again; what goes is still found."""

import signal
import subprocess
import sys
from pathlib import Path

SETTLED = """
import gc, weakref
from homsense_service.garbage import settle

class Ring: pass

before = len(gc.get_objects())
settle()
assert gc.get_freeze_count() > 0.9 * before
assert len(gc.get_objects()) < 0.1 * before
ring = Ring()
ring.itself = ring
gone = weakref.ref(ring)
del ring
gc.collect()
assert gone() is None
"""

SERVED = """
import gc, os, signal, sys, threading, time
from pathlib import Path
from homsense_service.server import serve
from homsense_service.settings import Settings

def stop():
    while not gc.get_freeze_count():
        time.sleep(0.05)
    os.kill(os.getpid(), signal.SIGTERM)

threading.Thread(target=stop, daemon=True).start()
serve(Settings(data=Path(sys.argv[1]), port=0, engine="python"))
"""


def run(script: str, *arguments: str) -> int:
    return subprocess.run(
        [sys.executable, "-c", script, *arguments], check=False, timeout=60
    ).returncode


def test_what_is_there_is_left_alone_and_a_later_ring_is_found() -> None:
    assert run(SETTLED) == 0


def test_a_service_that_has_started_is_settled(tmp_path: Path) -> None:
    assert run(SERVED, str(tmp_path)) == -signal.SIGTERM

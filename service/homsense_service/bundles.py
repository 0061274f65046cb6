"""A document and some arrays as bytes, and back."""

import io
import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

_DOCUMENT = "document"


def bundled(document: object, arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Return a document and arrays as one piece.

    Parameters
    ----------
    document : object
        What JSON can say; numbers keep every bit.
    arrays : mapping of str to ndarray
        By name.

    Returns
    -------
    bytes
        In numpy's own format, without pickles.
    """
    text = np.frombuffer(json.dumps(document).encode(), np.uint8)
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **{_DOCUMENT: text}, **arrays)
    return buffer.getvalue()


def unbundled(body: bytes) -> tuple[Any, dict[str, NDArray[Any]]]:
    """Return the document and the arrays.

    Parameters
    ----------
    body : bytes
        From `bundled`.

    Returns
    -------
    document : object
        As JSON has it: tuples have become lists.
    arrays : dict of str to ndarray
        By name.
    """
    with np.load(io.BytesIO(body), allow_pickle=False) as found:
        arrays = {name: found[name] for name in found.files}
    return json.loads(arrays.pop(_DOCUMENT).tobytes()), arrays

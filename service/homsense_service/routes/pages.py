"""Long lists in pages: each says where the next one begins."""

import base64
import binascii
from collections.abc import Sequence
from typing import Annotated

from fastapi import Query

from homsense_service.errors import CursorError

LimitParam = Annotated[int, Query(ge=1, le=1000, description="Entries of a page.")]
CursorParam = Annotated[
    str | None, Query(max_length=400, description="`next` of the page before.")
]


def page(names: Sequence[str], limit: int, cursor: str | None) -> tuple[list[str], str | None]:
    """Return one page of sorted names, and the cursor of the next page.

    Parameters
    ----------
    names : sequence of str
        All of them.
    limit : int
        Entries of a page.
    cursor : str, optional
        Of this page; the first one when absent.

    Returns
    -------
    names : list of str
        In order. What is added or deleted between two pages changes no other entry.
    next : str, optional
        None on the last page.

    Raises
    ------
    CursorError
        If the cursor is none of ours.
    """
    after = "" if cursor is None else _decoded(cursor)
    rest = sorted(name for name in names if name > after)
    shown = rest[:limit]
    more = len(rest) > limit
    return shown, base64.urlsafe_b64encode(shown[-1].encode()).decode() if more else None


def _decoded(cursor: str) -> str:
    try:
        return base64.b64decode(cursor.encode(), altchars=b"-_", validate=True).decode()
    except (binascii.Error, UnicodeError, ValueError):
        message = "cursor: it is none that was given out"
        raise CursorError(message) from None

"""Entity tags: answers say which version they show, requests say which one they mean."""

import re
from typing import Annotated

from fastapi import Depends, Header

from homsense_service.revisions import Expected

_TAG = re.compile(r'(W/)?"([^"]*)"')
_HINT = 'Versions from `ETag`, such as `"3"`, or `*`.'


def tagged(version: str) -> str:
    """Return the entity tag of a version."""
    return f'"{version}"'


async def expected(
    if_match: Annotated[str | None, Header(description=_HINT, max_length=2000)] = None,
    if_none_match: Annotated[str | None, Header(description=_HINT, max_length=2000)] = None,
) -> Expected:
    """Return which versions a request is meant for; a missing header leaves all of them."""

    def is_meant(version: str | None) -> bool:
        if if_match is not None and not _lists(if_match, version, weakly=False):
            return False
        return if_none_match is None or not _lists(if_none_match, version, weakly=True)

    return is_meant


ExpectedDep = Annotated[Expected, Depends(expected)]


def _lists(header: str, version: str | None, *, weakly: bool) -> bool:
    if version is None:
        return False
    if header.strip() == "*":
        return True
    return any(tag == version and (weakly or not weak) for weak, tag in _TAG.findall(header))

"""API keys, over REST for those who have one with the scope admin."""

from typing import Annotated

from fastapi import APIRouter, Path

from homsense_service import schemas
from homsense_service.keys import KeyRing, new_key
from homsense_service.routes.access import (
    CallerDep,
    KeysDep,
    OperationsDep,
    needs,
    problems,
)

router = APIRouter(prefix="/v1/keys", tags=["keys"], dependencies=[needs("admin")])


@router.get("", summary="List all keys", responses=problems(422))
def list_keys(operations: OperationsDep, caller: CallerDep) -> schemas.KeyList:
    """Return every key by name, without the keys themselves."""
    caller.check_everywhere()
    return schemas.KeyList(keys=[schemas.KeyOut.of(found) for found in operations.known_keys()])


@router.post("", status_code=201, summary="Make a key", responses=problems(400, 409, 413, 422))
def make_key(
    wanted: schemas.KeyIn, operations: OperationsDep, caller: CallerDep, ring: KeysDep
) -> schemas.NewKeyOut:
    """Make a key; the answer is the only time that it is told."""
    caller.check_everywhere()
    token, record = new_key(wanted.name, wanted.scopes, wanted.sites, operations.now_s())
    operations.add_key(record)
    _take(ring, operations)
    return schemas.NewKeyOut(key=token, **schemas.KeyOut.of(record).model_dump())


@router.delete("/{name}", status_code=204, summary="Delete a key", responses=problems(404, 422))
def delete_key(
    name: Annotated[str, Path(max_length=64)],
    operations: OperationsDep,
    caller: CallerDep,
    ring: KeysDep,
) -> None:
    """Let a key be good for nothing from now on."""
    caller.check_everywhere()
    operations.delete_key(name)
    _take(ring, operations)


def _take(ring: KeyRing, operations: OperationsDep) -> None:
    ring.replace(operations.known_keys())

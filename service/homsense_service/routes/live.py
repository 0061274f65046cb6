"""Live poses: server-sent events, and a websocket that also takes steps."""

import asyncio
import contextlib
import logging
from collections.abc import AsyncIterator
from functools import partial

import anyio
from fastapi import APIRouter, Request, WebSocket
from fastapi.responses import StreamingResponse
from pydantic import ValidationError
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import State
from starlette.types import Receive, Scope, Send

from homsense import HomsenseError
from homsense_service import schemas
from homsense_service.answers import invalid_request, known_problem
from homsense_service.errors import OverloadError, ServiceError
from homsense_service.operations import Operations
from homsense_service.problems import INTERNAL, MALFORMED_JSON, problem
from homsense_service.rendering_poses import pose_json
from homsense_service.routes.access import SessionParam, admit, needs, problems
from homsense_service.streams import Reader, Streams

router = APIRouter(prefix="/v1/sessions/{session}", tags=["sessions"])

_log = logging.getLogger(__name__)

KEEP_ALIVE_S = 15.0
POLICY_VIOLATION, TRY_AGAIN_LATER, GOING_AWAY = 1008, 1013, 1001


@router.get(
    "/events",
    dependencies=[needs("localize")],
    summary="Live poses",
    response_class=StreamingResponse,
    responses={
        200: {"content": {"text/event-stream": {}}, "description": "Events `pose`."},
        **problems(404, 422),
    },
)
async def get_events(session: SessionParam, request: Request) -> StreamingResponse:
    """Stream the poses of a session as server-sent events, the present one first.

    A reader that is too slow misses poses, and is cut off when it misses too many.
    """
    streams: Streams = request.app.state.streams
    _check_room(streams)
    operations: Operations = request.app.state.operations
    found = await run_in_threadpool(operations.sessions.get, session)
    with contextlib.ExitStack() as leaving:
        reader = leaving.enter_context(streams.reading(session))
        first = await run_in_threadpool(found.answered, partial(pose_json, found))
        return _Events(_events(reader, first), leaving.pop_all())


class _Events(StreamingResponse):
    """Server-sent events, whose reader leaves however they end.

    The iterator cannot see to that: where a reader stands still it is left where it is.
    """

    def __init__(self, events: AsyncIterator[bytes], leaving: contextlib.ExitStack) -> None:
        super().__init__(events, media_type="text/event-stream")
        self._leaving = leaving

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send them."""
        with self._leaving:
            await super().__call__(scope, receive, send)


async def _events(reader: Reader, first: bytes) -> AsyncIterator[bytes]:
    yield _event(first)
    while True:
        try:
            async with asyncio.timeout(KEEP_ALIVE_S):
                frame = await reader.next()
        except TimeoutError:
            yield b": alive\n\n"
            continue
        if frame is None:
            return
        yield _event(frame)


def _event(frame: bytes) -> bytes:
    return b"event: pose\ndata: " + frame + b"\n\n"


@router.websocket("/stream")
async def stream(websocket: WebSocket, session: str) -> None:
    """Send the poses of a session; a message ``{"steps": [...]}`` is a request of its own."""
    state = websocket.app.state
    try:
        admit(websocket, "localize")
        _check_room(state.streams)
        found = await run_in_threadpool(state.operations.sessions.get, session)
    except ServiceError as error:
        await websocket.accept()
        await websocket.send_json(known_problem(error))
        later = isinstance(error, OverloadError)
        await websocket.close(TRY_AGAIN_LATER if later else POLICY_VIOLATION)
        return
    await websocket.accept()
    sending = asyncio.Lock()
    with state.streams.reading(session) as reader:
        first = await run_in_threadpool(found.answered, partial(pose_json, found))
        await websocket.send_text(first.decode())
        async with anyio.create_task_group() as both:
            both.start_soon(_take, websocket, session, sending, both.cancel_scope)
            both.start_soon(_give, websocket, reader, sending, both.cancel_scope)
        with contextlib.suppress(RuntimeError):
            await websocket.close(GOING_AWAY)


async def _give(
    websocket: WebSocket, reader: Reader, sending: asyncio.Lock, both: anyio.CancelScope
) -> None:
    """Send poses until the session ends or the reader stands still."""
    try:
        while (frame := await reader.next()) is not None:
            async with sending:
                await websocket.send_text(frame.decode())
    finally:
        both.cancel()


async def _take(
    websocket: WebSocket, session: str, sending: asyncio.Lock, both: anyio.CancelScope
) -> None:
    """Take steps until the other side has gone."""
    state = websocket.app.state
    while (message := await websocket.receive())["type"] != "websocket.disconnect":
        given = message.get("text") or message.get("bytes") or b""
        told = await run_in_threadpool(_answered, state, session, given)
        if told is not None:
            async with sending:
                await websocket.send_json(told)
    both.cancel()


def _answered(state: State, session: str, given: str | bytes) -> object | None:
    """Take steps; return a problem, or None when the pose goes out to all readers."""
    operations: Operations = state.operations
    try:
        batch = schemas.StepsIn.model_validate_json(given)
        frame = operations.take_steps(session, batch.steps, pose_json)
    except ValidationError as error:
        found = error.errors(include_url=False, include_input=False, include_context=False)
        if any(entry["type"] == "json_invalid" for entry in found):
            return problem(MALFORMED_JSON, "the message cannot be read as JSON")
        return invalid_request(found)
    except (ServiceError, HomsenseError) as error:
        return known_problem(error)
    except Exception:  # noqa: BLE001 - the connection outlives one failure
        _log.exception("a message to session %s failed", session)
        return problem(INTERNAL, "the failure was logged")
    state.metrics.steps.inc(len(batch.steps))
    state.streams.publish(session, frame)
    return None


def _check_room(streams: Streams) -> None:
    """Raise `OverloadError` when there are too many readers."""
    if len(streams) >= streams.most:
        message = f"there are {streams.most} readers of live poses already"
        raise OverloadError(message)

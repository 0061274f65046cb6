"""The errors of the SDK; every one derives from `ClientError`."""

from typing import Any


class ClientError(Exception):
    """The root of the tree; never raised itself."""


class TransportError(ClientError):
    """The service could not be reached, or the answer broke off."""


class ConnectError(TransportError):
    """No connection to the service."""


class RequestTimeoutError(TransportError):
    """The service did not answer in time."""


class ContractError(ClientError):
    """The answer is not what the contract says."""


class ResponseError(ClientError):
    """The service answered with a problem.

    Parameters
    ----------
    status : int
        HTTP status.
    problem : dict
        The RFC 9457 body; empty when there was none.
    """

    def __init__(self, status: int, problem: dict[str, Any]) -> None:
        self.status = status
        self.problem = problem
        self.code = str(problem.get("code", ""))
        super().__init__(f"{status} {self.code}: {problem.get('detail', 'no detail')}")


class InvalidRequestError(ResponseError):
    """400, 413 or 422: the request is at fault."""


class NotFoundError(ResponseError):
    """404: no such site or session."""


class ConflictError(ResponseError):
    """409: the request does not fit the state of the site or session."""


class UnavailableError(ResponseError):
    """429 or 5xx, after all retries."""

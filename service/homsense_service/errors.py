"""The errors of the service; `problems.py` says how each is answered."""


class ServiceError(Exception):
    """The root of the tree; never raised itself."""


class UnauthorizedError(ServiceError):
    """Nobody knows who calls."""


class TokenError(ServiceError):
    """The token of a device is not the one of its session."""


class DeviceNotFoundError(ServiceError):
    """No device of this name streams into a session.

    Parameters
    ----------
    device : str
        The name.
    """

    def __init__(self, device: str) -> None:
        super().__init__(f"device {device!r} has no session; open one")


class MethodNotFoundError(ServiceError):
    """Devices cannot ask for this."""


class BodyTooLargeError(ServiceError):
    """A message is larger than the service reads."""


class ForbiddenError(ServiceError):
    """The key is not good for this."""


class RateLimitError(ServiceError):
    """Too many requests in too little time.

    Parameters
    ----------
    message : str
        For people.
    retry_after_s : int
        When there may be more, seconds.
    """

    def __init__(self, message: str, retry_after_s: int) -> None:
        super().__init__(message)
        self.retry_after_s = retry_after_s


class PortableError(ServiceError, ValueError):
    """A file holds no site, or not all of it."""


class SiteExistsError(ServiceError):
    """A site has this name already."""


class KeyNotFoundError(ServiceError):
    """No key has this name."""


class KeyExistsError(ServiceError):
    """A key has this name already."""


class CursorError(ServiceError):
    """A page is asked for that nobody has told of."""


class SiteNotFoundError(ServiceError):
    """No site has this name, as far as the caller is concerned.

    Parameters
    ----------
    site : str
        The name.
    """

    def __init__(self, site: str) -> None:
        super().__init__(f"there is no site {site!r}")


class SessionNotFoundError(ServiceError):
    """No session has this identifier, as far as the caller is concerned; it may be closed.

    Parameters
    ----------
    session : str
        The identifier.
    """

    def __init__(self, session: str) -> None:
        super().__init__(f"there is no session {session!r}")


class MapMissingError(ServiceError):
    """The site has no map yet."""


class PreconditionError(ServiceError):
    """What is to be changed is not what the caller has seen."""


class SequenceConflictError(ServiceError):
    """A step number lies in the past and its first answer is not the one asked for."""


class IdempotencyError(ServiceError):
    """The name of a request stands for another request."""


class CapacityError(ServiceError):
    """The service holds as many sessions as it may."""


class OverloadError(ServiceError):
    """More is asked of the service than it can do now."""


class ExpectationPendingError(ServiceError):
    """What the sensor counts on this map is still being simulated."""


class ExpectationFailedError(ServiceError):
    """What the sensor counts on this map cannot be simulated."""


class RegistrationPendingError(ServiceError):
    """The crowd of the site is still being placed on the map."""


class RegistrationFailedError(ServiceError):
    """The crowd of the site finds no place on the map."""


class StoreError(ServiceError):
    """The data directory cannot be used."""

"""Settings; the only reader of the environment."""

import os
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

from pydantic import Field, SecretStr, ValidationInfo, field_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

_ENDPOINTS = tuple(
    f"OTEL_EXPORTER_OTLP_{signal}ENDPOINT" for signal in ("", "TRACES_", "METRICS_")
)


class Settings(BaseSettings):
    """What an operator can set, by environment variables with the prefix ``HOMSENSE_``."""

    model_config = SettingsConfigDict(env_prefix="HOMSENSE_")

    data: Path = Field(default=Path("data"), description="Directory of the store.")
    host: str = Field(default="127.0.0.1", description="Address to listen on.")
    port: int = Field(default=8080, ge=0, le=65535, description="Port; 0 takes a free one.")
    max_body_bytes: int = Field(
        default=32 * 2**20, ge=1024, description="Largest request body, before and after gzip."
    )
    open_access: bool = Field(
        default=False, description="Serve anybody beyond loopback although there are no keys."
    )
    zenoh_listen: list[str] = Field(
        default=[], description="Endpoints where devices reach the service without any router."
    )
    zenoh_connect: list[str] = Field(default=[], description="Endpoints of zenoh routers.")
    zenoh_config: Path | None = Field(
        default=None,
        description="A zenoh configuration file (JSON5), for TLS, passwords and access control.",
    )
    zenoh_prefix: str = Field(
        default="homsense",
        pattern=r"^[A-Za-z0-9_.-]+(/[A-Za-z0-9_.-]+)*$",
        description="What all keys begin with.",
    )
    zenoh_max_bytes: int = Field(
        default=262_144, ge=1024, description="Largest message of a device."
    )
    zenoh_silence_s: float = Field(
        default=5.0, gt=0.0, description="A device that is silent for so long is offline, seconds."
    )
    zenoh_grace_s: float = Field(
        default=60.0,
        gt=0.0,
        description="A device that is offline for so long leaves the memory, seconds.",
    )
    ros2_mapping: Path | None = Field(
        default=None, description="A file (TOML) that says which ROS 2 robots there are."
    )
    cors_origins: list[str] = Field(
        default=[], description="Origins whose pages may call, a JSON list; none by default."
    )
    requests_per_minute: int = Field(
        default=60_000, ge=0, description="Of one key, or one address without keys; 0: no limit."
    )
    max_pending_requests: int = Field(
        default=256, ge=1, description="Requests that may wait for their answers at once."
    )
    max_readers: int = Field(
        default=1000, ge=1, description="Readers of live poses at once; then 503."
    )
    max_particles: int = Field(default=200_000, ge=1, description="Particles of one session.")
    max_map_positions: int = Field(default=500_000, ge=3, description="Positions in one map.")
    hash_key: SecretStr | None = Field(
        default=None,
        description="Landmarks and devices are kept under keyed hashes; 16 to 64 bytes.",
    )
    max_landmarks_per_scan: int = Field(
        default=4096, ge=1, description="Readings in one scan; more are refused."
    )
    engine: Literal["auto", "python", "numba"] = Field(
        default="auto",
        description="What counts holes: numba once it is compiled, the reference, or numba only.",
    )
    max_sessions: int = Field(default=1000, ge=1, description="Live sessions at once.")
    session_sleep_s: float = Field(
        default=600.0,
        gt=0.0,
        description="A session that is idle for so long leaves the memory, seconds; it wakes "
        "when it is asked for.",
    )
    session_expiry_s: float = Field(
        default=604_800.0,
        gt=0.0,
        description="A session that is idle for so long, or since the start, is closed, seconds.",
    )
    expectation_scans: int = Field(
        default=50, ge=1, description="Scans from which on counts are expected by simulation."
    )
    expectation_wait_s: float = Field(
        default=20.0,
        ge=0.0,
        description="Longest wait of a new session for what the site has to learn, seconds.",
    )
    registration_scans: int = Field(
        default=200,
        ge=1,
        description="Scans with tracks from which on a session finds itself among the crowd.",
    )
    calibration_scans: int = Field(
        default=1500, ge=1, description="Scans that a site learns its radio and radii from."
    )
    check_scans: int = Field(
        default=20_000,
        ge=1,
        description="Scans that the self-checks of a site look at, evenly over its log.",
    )
    cell_m: float = Field(default=2.0, gt=0.0, description="Resolution of the walls, metres.")
    height_cell_m: float = Field(
        default=4.0, gt=0.0, description="Resolution of the height maps, metres."
    )

    telemetry: bool = Field(
        default=False,
        description="Export traces and metrics of requests over OTLP, to where the standard "
        "variable OTEL_EXPORTER_OTLP_ENDPOINT says; needs the extra homsense[telemetry].",
    )

    @field_validator("ros2_mapping")
    @classmethod
    def _has_a_network(cls, given: Path | None, info: ValidationInfo) -> Path | None:
        reached = info.data.get("zenoh_listen") or info.data.get("zenoh_connect")
        if given is not None and not reached:
            message = "needs zenoh_listen or zenoh_connect, over which robots are reached"
            raise ValueError(message)
        return given

    @field_validator("telemetry")
    @classmethod
    def _can_be_sent(cls, given: bool) -> bool:  # noqa: FBT001 - pydantic's signature
        if given and not find_spec("opentelemetry.sdk"):
            message = "needs the extra homsense[telemetry]"
            raise ValueError(message)
        if given and not any(os.environ.get(name) for name in _ENDPOINTS):
            message = f"needs {_ENDPOINTS[0]}"
            raise ValueError(message)
        return given

    @field_validator("hash_key")
    @classmethod
    def _is_a_key(cls, given: SecretStr | None) -> SecretStr | None:
        if given is not None and not 16 <= len(given.get_secret_value().encode()) <= 64:  # noqa: PLR2004
            message = "must have 16 to 64 bytes"
            raise ValueError(message)
        return given

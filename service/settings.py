"""Settings of the service, from the environment (`MODALBASE_PORT`, `MODALBASE_DATABASE_URL` …) and the command line."""

from __future__ import annotations

from ipaddress import IPv4Network, IPv6Network, ip_network
from pathlib import Path
from typing import Literal

import platformdirs
from pydantic import Field, PositiveFloat, PositiveInt, field_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

MIB = 1024 * 1024


def default_data_folder() -> Path:
    """The user's data folder of this operating system, such as `~/.local/share/modalbase`."""
    return Path(platformdirs.user_data_dir("modalbase", appauthor=False))


class Settings(BaseSettings):
    """Everything an operator can set; each field is the environment variable `MODALBASE_<FIELD>`."""

    model_config = SettingsConfigDict(env_prefix="MODALBASE_", extra="ignore", frozen=True)

    database_url: str | None = Field(
        default=None,
        repr=False,  # holds a password
        description="PostgreSQL 18 server, `postgresql://user:password@host/database`; without it the embedded one",
    )
    data: Path = Field(default_factory=default_data_folder, description="folder of the embedded database")
    host: str = Field(default="127.0.0.1", description="address that the API listens on")
    port: int = Field(default=8000, ge=0, le=65535, description="port that the API listens on")
    log_format: Literal["console", "json"] = "console"
    log_level: Literal["debug", "info", "warning", "error"] = "info"

    database_pool: PositiveInt = Field(default=10, description="database connections a process keeps")
    json_limit_bytes: PositiveInt = Field(default=16 * MIB, description="largest JSON body")
    upload_limit_bytes: PositiveInt = Field(default=1024 * MIB, description="largest uploaded file")

    event_streams: PositiveInt = Field(default=500, description="streams of events that an API process keeps open")

    worker_concurrency: PositiveInt = Field(default=1, description="jobs that one worker process runs at a time")
    job_threads: PositiveInt = Field(default=1, description="threads of the linear algebra of one job")
    job_memory_bytes: PositiveInt = Field(default=4096 * MIB, description="memory that one job may take")
    job_wall_seconds: PositiveFloat = Field(default=3600.0, description="time that one job may take")
    job_lease_seconds: PositiveFloat = Field(default=30.0, description="silence after which a worker counts as dead")
    project_job_limit: PositiveInt | None = Field(
        default=None, description="jobs of one project that run at a time, over all workers; no limit by default"
    )
    job_drain_seconds: PositiveFloat = Field(
        default=20.0, description="time that running jobs get when a worker is told to end"
    )

    monitor_sweep_seconds: PositiveFloat = Field(default=30.0, description="pause between two looks at every monitor")
    campaign_settle_seconds: float = Field(
        default=30.0, ge=0, description="time without additions after which a campaign counts as complete"
    )
    webhook_networks: str = Field(
        default="",
        description="networks beside public addresses that webhooks may go to, such as `10.1.0.0/16, ::1/128`",
    )
    delivery_pause_seconds: PositiveFloat = Field(
        default=5.0, description="pause before a message is sent again; each next one is 4 times longer"
    )
    smtp_host: str | None = Field(
        default=None, description="server that takes mail of alarms; without it there is none"
    )
    smtp_port: int = Field(default=587, ge=1, le=65535)
    smtp_security: Literal["starttls", "tls", "none"] = "starttls"
    smtp_user: str | None = None
    smtp_password: str | None = Field(default=None, repr=False)
    smtp_from: str = Field(default="modalbase@localhost", description="sender of mail")

    @field_validator("webhook_networks")
    @classmethod
    def _networks(cls, value: str) -> str:
        _parse_networks(value)
        return value

    @property
    def allowed_networks(self) -> tuple[IPv4Network | IPv6Network, ...]:
        """`webhook_networks`, read."""
        return _parse_networks(self.webhook_networks)


def _parse_networks(value: str) -> tuple[IPv4Network | IPv6Network, ...]:
    return tuple(ip_network(part.strip()) for part in value.split(",") if part.strip())

"""Settings of the service, from the environment (`MODALBASE_PORT`, `MODALBASE_DATABASE_URL` …),
files, and the command line.
"""

import os
from ipaddress import IPv4Network, IPv6Network, ip_network
from pathlib import Path
from typing import Literal

import platformdirs
from pydantic import Field, PositiveFloat, PositiveInt, ValidationInfo, field_validator
from pydantic.fields import FieldInfo
from pydantic_settings import BaseSettings, PydanticBaseSettingsSource, SettingsConfigDict

MIB = 1024 * 1024


def default_data_folder() -> Path:
    """The user's data folder of this operating system, such as `~/.local/share/modalbase`."""
    return Path(platformdirs.user_data_dir("modalbase", appauthor=False))


class SettingsFileError(ValueError):
    """A file that a setting names cannot be used; the message names the variable."""


class _Files(PydanticBaseSettingsSource):
    """Values from the files that `MODALBASE_<FIELD>_FILE` name."""

    def get_field_value(self, field: FieldInfo, field_name: str) -> tuple[str | None, str, bool]:
        """Value, name, and that it is plain text."""
        del field
        variable = f"MODALBASE_{field_name.upper()}"
        file = os.environ.get(f"{variable}_FILE")
        if file is None:
            return None, field_name, False
        if variable in os.environ:
            raise SettingsFileError(f"both {variable} and {variable}_FILE are set; unset one")
        try:
            return Path(file).read_text(encoding="utf-8").strip(), field_name, False
        except (OSError, UnicodeDecodeError) as error:
            raise SettingsFileError(f"{variable}_FILE: cannot read {file}: {error}") from error

    def __call__(self) -> dict[str, str]:
        """Every value that there is."""
        values = (
            (name, self.get_field_value(field, name)[0])
            for name, field in self.settings_cls.model_fields.items()
        )
        return {name: value for name, value in values if value is not None}


class Settings(BaseSettings):
    """Everything an operator can set.

    Each field is the environment variable `MODALBASE_<FIELD>`, or the content of the file that
    `MODALBASE_<FIELD>_FILE` names, which suits passwords.
    """

    model_config = SettingsConfigDict(env_prefix="MODALBASE_", extra="ignore", frozen=True)

    database_password: str | None = Field(
        default=None,
        repr=False,
        description="password of `database_url`, which then needs none: a file's, say",
    )
    database_url: str | None = Field(
        default=None,
        repr=False,  # holds a password
        description=(
            "PostgreSQL 18 server, `postgresql://user:password@host/database`; without it the"
            " embedded one"
        ),
    )
    data: Path = Field(
        default_factory=default_data_folder, description="folder of the embedded database"
    )
    host: str = Field(default="127.0.0.1", description="address that the API listens on")
    port: int = Field(default=8000, ge=0, le=65535, description="port that the API listens on")
    allowed_hosts: str = Field(
        default="",
        description=(
            "names that requests may ask for the service by, such as `modalbase.lab.example,"
            " *.lab.example`; `host` and this machine's own are always among them. Empty: any name"
        ),
    )
    log_format: Literal["console", "json"] = Field(
        default="console", description="lines to read, or `json` for machines"
    )
    log_level: Literal["debug", "info", "warning", "error"] = Field(
        default="info",
        description="least severe line that is logged: `debug`, `info`, `warning`, `error`",
    )

    access_log: bool = Field(
        default=True, description="a line in the log for each request; `modalbase up`: none"
    )

    docs: bool = Field(
        default=True, description="serve the guide, the documentation page and the OpenAPI document"
    )
    pages: bool = Field(default=True, description="serve the pages for the browser, below `/ui/`")
    laboratory: str = Field(
        default="",
        description="name of the laboratory on top of reports, until it is stated on its page; empty: none",
    )
    laboratory_address: str = Field(default="", description="its address; lines end with `;`")
    laboratory_logo: Path | None = Field(
        default=None, description="its logo, a PNG or JPEG file of 1 MiB at most"
    )
    metrics: bool = Field(default=True, description="serve `/metrics`, which asks for no key")

    database_pool: PositiveInt = Field(
        default=10,
        description=(
            "requests that an API process answers at a time: as many database connections and"
            " threads"
        ),
    )
    request_queue: PositiveInt = Field(
        default=1000, description="requests that may wait for one of these places"
    )
    request_wait_seconds: PositiveFloat = Field(
        default=20.0, description="time that a request waits at most"
    )
    uploads: PositiveInt = Field(
        default=100, description="bodies over 64 KiB that an API process receives at a time"
    )
    key_requests_a_second: PositiveInt = Field(
        default=200, description="requests of one API key, to one API process"
    )
    key_bytes_an_hour: PositiveInt = Field(
        default=64 * 1024 * MIB, description="bytes that one API key may send"
    )
    key_failures_a_minute: PositiveInt = Field(
        default=60, description="wrong keys that one address may try"
    )
    json_limit_bytes: PositiveInt = Field(default=16 * MIB, description="largest JSON body")
    upload_limit_bytes: PositiveInt = Field(default=1024 * MIB, description="largest uploaded file")
    import_wait_seconds: PositiveFloat = Field(
        default=30.0,
        description=(
            "time that `POST …/records` and `POST …/frfs` wait until their file is read; then 202"
        ),
    )
    project_quota_bytes: PositiveInt = Field(
        default=102400 * MIB, description="bytes that one project may store"
    )

    event_streams: PositiveInt = Field(
        default=500, description="streams of events that an API process keeps open"
    )

    worker_concurrency: PositiveInt = Field(
        default=1, description="jobs that one worker process runs at a time"
    )
    job_threads: PositiveInt = Field(
        default=1, description="threads of the linear algebra of one job"
    )
    job_memory_bytes: PositiveInt = Field(
        default=4096 * MIB, description="memory that one job may take"
    )
    job_wall_seconds: PositiveFloat = Field(
        default=3600.0, description="time that one job may take"
    )
    job_lease_seconds: PositiveFloat = Field(
        default=30.0, description="silence after which a worker counts as dead"
    )
    project_job_limit: PositiveInt | None = Field(
        default=None,
        description="jobs of one project that run at a time, over all workers; no limit by default",
    )
    job_drain_seconds: PositiveFloat = Field(
        default=20.0, description="time that running jobs get when a worker shall end"
    )

    monitor_sweep_seconds: PositiveFloat = Field(
        default=30.0, description="pause between two looks at every monitor"
    )
    retention_sweep_seconds: PositiveFloat = Field(
        default=600.0, description="pause between two looks at what retention rules delete"
    )
    campaign_settle_seconds: float = Field(
        default=30.0,
        ge=0,
        description="time without additions after which a campaign counts as complete",
    )
    webhook_networks: str = Field(
        default="",
        description=(
            "networks beside public addresses that webhooks may go to, such as `10.1.0.0/16,"
            " ::1/128`"
        ),
    )
    webhook_ports: str = Field(
        default="80, 443, 8080, 8443",
        description="ports that webhooks may go to, such as `443, 8000-8999`",
    )
    delivery_pause_seconds: PositiveFloat = Field(
        default=5.0,
        description="pause before a message is sent again; each next one is 4 times longer",
    )
    smtp_host: str | None = Field(
        default=None, description="server that takes mail of alarms; without it there is none"
    )
    smtp_port: int = Field(default=587, ge=1, le=65535, description="its port")
    smtp_security: Literal["starttls", "tls", "none"] = Field(
        default="starttls", description="how the line to it is encrypted: `starttls`, `tls`, `none`"
    )
    smtp_user: str | None = Field(
        default=None, description="name to log in with; without it nobody logs in"
    )
    smtp_password: str | None = Field(
        default=None, repr=False, description="password to log in with"
    )
    smtp_from: str = Field(default="modalbase@localhost", description="sender of mail")

    @field_validator("database_url")
    @classmethod
    def _with_password(cls, value: str | None, info: ValidationInfo) -> str | None:
        password = info.data.get("database_password")
        if value is None or password is None:
            return value
        # a tenth of a second to load, in every command that has settings
        from sqlalchemy import make_url
        from sqlalchemy.exc import ArgumentError

        try:
            return make_url(value).set(password=password).render_as_string(hide_password=False)
        except ArgumentError:
            return value  # who connects says what is wrong with it

    @field_validator("laboratory_logo")
    @classmethod
    def _picture(cls, value: Path | None) -> Path | None:
        if value is None:
            return None
        try:
            with value.open("rb") as file:
                content = file.read(MIB + 1)
        except OSError as error:
            raise ValueError(f"cannot read {value}: {error.strerror}") from error
        if len(content) > MIB or not content.startswith((b"\x89PNG\r\n", b"\xff\xd8\xff")):
            raise ValueError(f"{value} is no PNG or JPEG of 1 MiB at most")
        return value

    @field_validator("webhook_networks")
    @classmethod
    def _networks(cls, value: str) -> str:
        _parse_networks(value)
        return value

    @classmethod
    def settings_customise_sources(  # noqa: D102  pydantic's
        cls,
        settings_cls: type[BaseSettings],
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,
        dotenv_settings: PydanticBaseSettingsSource,
        file_secret_settings: PydanticBaseSettingsSource,
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        del dotenv_settings, file_secret_settings
        return init_settings, env_settings, _Files(settings_cls)

    @field_validator("webhook_ports")
    @classmethod
    def _ports(cls, value: str) -> str:
        _parse_ports(value)
        return value

    @property
    def known_hosts(self) -> tuple[str, ...]:
        """`allowed_hosts`, read, with `host`; empty where any name will do."""
        names = [
            part.strip().lower().strip("[]")
            for part in self.allowed_hosts.split(",")
            if part.strip()
        ]
        return (*names, self.host.lower()) if names else ()

    @property
    def allowed_ports(self) -> tuple[range, ...]:
        """`webhook_ports`, read."""
        return _parse_ports(self.webhook_ports)

    @property
    def allowed_networks(self) -> tuple[IPv4Network | IPv6Network, ...]:
        """`webhook_networks`, read."""
        return _parse_networks(self.webhook_networks)


def _parse_networks(value: str) -> tuple[IPv4Network | IPv6Network, ...]:
    return tuple(ip_network(part.strip()) for part in value.split(",") if part.strip())


def _parse_ports(value: str) -> tuple[range, ...]:
    ranges = []
    for part in filter(None, map(str.strip, value.split(","))):
        first, _, last = part.partition("-")
        if not first.isdecimal() or (last and not last.isdecimal()):
            raise ValueError(f"{part!r} is no port and no range of ports such as 8000-8999")
        ranges.append(range(int(first), int(last or first) + 1))
    return tuple(ranges)

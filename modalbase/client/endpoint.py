"""Which service, and with which key: what is stated, the environment, a saved profile, the service
that runs here.
"""

import json
import os
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

import platformdirs

from modalbase.client.errors import ClientError, Exit

KEY_FILE = "operator-key"
"""In a data folder: the key that `modalbase up` made for the folder's owner."""

HERE = "runs on this machine"
NO_SERVICE = (
    "no service runs here and no API key is stated: start a service with `modalbase up`, or save"
    " address and key of another with `modalbase login URL`"
)
NO_KEY = (
    "no API key: set MODALBASE_API_KEY, or save one with `modalbase login` (`modalbase keys create"
    " --name NAME` makes one)"
)


@dataclass(frozen=True)
class Endpoint:
    """A service and a key for it.

    Attributes:
        url: such as `http://127.0.0.1:8000`, without a slash at its end.
        key: an API key.
        source: where both come from, for messages.
    """

    url: str
    key: str
    source: str


def find_endpoint(url: str | None = None, key: str | None = None) -> Endpoint:
    """The service and key to use.

    The address is, in this order, `url`, MODALBASE_URL, that of the saved profile, that of the one
    `modalbase up` which runs on this machine for this user. The key is `key`, MODALBASE_API_KEY,
    that of the profile where it is for this address, that in the data folder of the service which
    runs here at this address.

    Args:
        url: of the service.
        key: API key.

    Raises:
        ClientError: no service or no key is found, several services run here, or what is stated
            cannot be right.
    """
    profile, here = _profile(), running_here()
    environment = os.environ.get("MODALBASE_URL", "").strip()
    if url:
        address, source = url, "stated"
    elif environment:
        address, source = environment, "MODALBASE_URL"
    elif profile is not None:
        address, source = profile.url, profile.source
    else:
        address, source = _only(here), HERE
    address = checked_url(address)
    if key is None:
        keys = [
            os.environ.get("MODALBASE_API_KEY", ""),
            _key_of(profile, address),
            _local_key(here, address),
        ]
        key = next((one for one in keys if one.strip()), "")
        if not key and not here and source == HERE:
            raise ClientError(NO_SERVICE, Exit.USAGE)
    return Endpoint(address, checked_key(key), source)


def checked_url(url: str) -> str:
    """The URL of a service without a slash at its end.

    Raises:
        ClientError: it is none.
    """
    if urlsplit(url).scheme not in ("http", "https") or not urlsplit(url).hostname:
        raise ClientError(f"{url!r} is no URL such as http://127.0.0.1:8000", Exit.USAGE)
    return url.rstrip("/")


def checked_key(key: str) -> str:
    """A key that can go in a header.

    Raises:
        ClientError: there is none, or it holds what no key has.
    """
    if not (bare := key.strip()):
        raise ClientError(NO_KEY, Exit.USAGE)
    if not (bare.isascii() and bare.isprintable()):
        raise ClientError(
            "the API key holds characters that no key has; is MODALBASE_API_KEY whole?", Exit.USAGE
        )
    return bare


def save_profile(url: str, key: str) -> Path:
    """Keep an address and its key for the commands and scripts of this user; the file is readable
    by them alone.
    """
    file = profile_file()
    file.parent.mkdir(parents=True, exist_ok=True)
    write_private(file, json.dumps({"url": checked_url(url), "key": checked_key(key)}) + "\n")
    return file


def profile_file() -> Path:
    """Where the profile is kept: MODALBASE_PROFILE, or `modalbase/profile.json` in the user's
    folder of configurations.
    """
    named = os.environ.get("MODALBASE_PROFILE")
    return (
        Path(named)
        if named
        else Path(platformdirs.user_config_dir("modalbase", appauthor=False)) / "profile.json"
    )


def write_private(file: Path, text: str) -> None:
    """Write a file that nobody but its owner may read, whole or not at all."""
    new = file.with_name(f"{file.name}.{os.getpid()}.new")
    new.unlink(missing_ok=True)
    with os.fdopen(
        os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8"
    ) as stream:
        stream.write(text)
    new.replace(file)


def notes_folder() -> Path:
    """Where each `modalbase up` of this user leaves a note of itself."""
    return Path(platformdirs.user_state_dir("modalbase", appauthor=False)) / "running"


def running_here() -> dict[str, Path | None]:
    """Address of each `modalbase up` that runs here for this user, to its data folder; None where
    it has none.
    """
    folders: dict[str, Path | None] = {}
    for file in sorted(notes_folder().glob("*.json")):
        try:
            note = json.loads(file.read_text(encoding="utf-8"))
            url, data, pid = str(note["url"]), note["data"], int(note["pid"])
        except (OSError, ValueError, TypeError, KeyError):
            continue  # it has just ended, or is another version's
        if _alive(pid):
            folders[url] = None if data is None else Path(data)
    return folders


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:  # it lives and is another's
        return True
    return True


def _profile() -> Endpoint | None:
    file = profile_file()
    try:
        saved = json.loads(file.read_text(encoding="utf-8"))
        return Endpoint(str(saved["url"]).rstrip("/"), str(saved["key"]), str(file))
    except FileNotFoundError:
        return None
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise ClientError(
            f"cannot read the profile {file}: {error}; `modalbase login` writes it anew", Exit.USAGE
        ) from None


def _only(here: dict[str, Path | None]) -> str:
    if len(here) > 1:
        raise ClientError(
            f"{len(here)} services run here: {', '.join(here)}; state which one", Exit.USAGE
        )
    return next(iter(here), "http://127.0.0.1:8000")


def _key_of(profile: Endpoint | None, url: str) -> str:
    return profile.key if profile is not None and profile.url == url else ""


def _local_key(here: dict[str, Path | None], url: str) -> str:
    data = here.get(url)
    if data is None:
        return ""
    try:
        return (data / KEY_FILE).read_text(encoding="utf-8")
    except OSError:  # another user's folder, or a service whose keys were made by hand
        return ""

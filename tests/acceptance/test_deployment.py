"""What is deployed: wheel and source archive, and docker-compose.yml without containers."""

import http.client
import json
import os
import re
import shutil
import signal
import socket
import ssl
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import httpx
import psycopg
import pytest
import trustme
import yaml
from packaging.requirements import Requirement

from service.app.demo.run import Laboratory
from service.app.supervisor import LocalService
from tests.support.command import modalbase, modalbase_here
from tests.support.laboratory import Done
from tests.support.servers import password_server
from tests.support.waiting import PATIENCE, until

ROOT = Path(__file__).parents[2]
COMPOSE: dict[str, Any] = yaml.safe_load((ROOT / "docker-compose.yml").read_text())
SERVICES: dict[str, Any] = COMPOSE["services"]
DOCKERFILE = (ROOT / "Dockerfile").read_text().replace("\\\n", "")
LAST_STAGE = DOCKERFILE[DOCKERFILE.rindex("FROM ") :]


class Deployment:
    """Runs services of the compose file as processes of this machine.

    Attributes:
        places: what stands in the compose file, and what is there in its place.
    """

    def __init__(self, folder: Path, places: dict[str, str]) -> None:
        self.folder, self.places = folder, places

    def put(self, words: str) -> str:
        for there, here in self.places.items():
            words = words.replace(there, here)
        return words

    def environment(self, service: str) -> dict[str, str]:
        """The image's environment, then the service's; and nothing of ours."""
        image = dict(
            word.split("=", 1)
            for line in re.findall(r"^ENV (.*)$", LAST_STAGE, re.M)
            for word in line.split()
        )
        variables = {**image, **SERVICES[service].get("environment", {})}
        own = {name: self.put(str(value)) for name, value in variables.items()}
        scratch = self.folder / service
        scratch.mkdir(exist_ok=True)
        path = f"{Path(sys.executable).parent}:/usr/bin:/bin"
        # in place of 30: a worker is killed
        ours = {"OPENBLAS_NUM_THREADS": "1", "MODALBASE_JOB_LEASE_SECONDS": "5"}
        return own | ours | {"PATH": path, "TMPDIR": str(scratch), "HOME": str(scratch)}

    def command(self, service: str) -> list[str]:
        image = re.findall(r"^CMD (\[.*\])$", LAST_STAGE, re.M)[-1]
        words: list[str] = SERVICES[service].get("command") or json.loads(image)
        return [str(Path(sys.executable).with_name(words[0])), *words[1:]]

    @contextmanager
    def running(self, service: str, *more: str) -> Iterator[subprocess.Popen[bytes]]:
        with (self.folder / f"{service}.log").open("ab") as log:
            process = subprocess.Popen(
                [*self.command(service), *more],
                env=self.environment(service),
                stdout=log,
                stderr=log,
                cwd=self.folder,
            )
        try:
            yield process
        finally:
            process.send_signal(signal.SIGTERM)
            process.wait(PATIENCE)


@pytest.fixture
def deployment(short_folder: Path, server: str) -> Iterator[Deployment]:
    assert server  # which made the account that PostgreSQL runs as where root tests
    folder = short_folder / "deployment"
    secrets = folder / "secrets"
    secrets.mkdir(parents=True)
    short_folder.chmod(0o755)
    password = "pass word/@:1"
    (secrets / "database_password").write_text(password + "\n")
    with password_server(short_folder / "server", "modalbase", "placeholder", "modalbase") as port:
        with psycopg.connect(
            host="127.0.0.1",
            port=port,
            user="modalbase",
            password="placeholder",
            dbname="modalbase",
        ) as connection:
            connection.execute(f"ALTER USER modalbase PASSWORD '{password}'")
        yield Deployment(
            folder, {"@database/": f"@127.0.0.1:{port}/", "/run/secrets/": f"{secrets}/"}
        )
    shutil.rmtree(folder)


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as free:
        return int(free.getsockname()[1])


@pytest.mark.long
def test_the_compose_file_s_services_do_the_main_job(deployment: Deployment) -> None:
    """Migrate, API, two workers, proxy; the worker that runs the update is killed, and the other
    one ends the job.
    """
    subprocess.run(
        deployment.command("migrate"),
        env=deployment.environment("migrate"),
        check=True,
        timeout=PATIENCE,
    )
    port = free_port()
    with ExitStack() as stack:
        stack.enter_context(deployment.running("api", "--port", str(port)))
        workers = [stack.enter_context(deployment.running("worker")) for _ in range(2)]
        check = json.loads(re.findall(r"HEALTHCHECK.* CMD (\[.*\])", LAST_STAGE)[0])
        check[0], check[2] = sys.executable, check[2].replace(":8000/", f":{port}/")
        until(lambda: listens(port), "an API that listens")
        until(
            lambda: subprocess.run(check, capture_output=True, check=False).returncode == 0,
            "a healthy API",
        )
        create = [
            str(Path(sys.executable).with_name("modalbase")),
            "keys",
            "create",
            "--name",
            "me",
        ]
        key = subprocess.check_output(create, env=deployment.environment("api"), text=True).strip()
        authority, base = trustme.CA(), f"http://127.0.0.1:{port}"
        if shutil.which("nginx"):
            base = stack.enter_context(proxy(deployment, port, authority))
        trusted = ssl.create_default_context()
        authority.configure_trust(trusted)
        client = stack.enter_context(
            httpx.Client(
                base_url=base,
                headers={"Authorization": f"Bearer {key}"},
                verify=trusted,
                timeout=60,
                trust_env=False,
            )
        )
        killed: list[int] = []

        def kill_who_updates(_stage: str, _share: float) -> None:
            """At the first sight of the update; its worker is known by its process id in the job's
            row.
            """
            if not killed and (pid := updating(deployment)) is not None:
                next(worker for worker in workers if worker.pid == pid).kill()
                killed.append(pid)

        result = Laboratory(client).update_beam(kill_who_updates)
        assert result["parameters"]
        assert killed, "the update ended before it was seen"
        if base.startswith("https"):
            look_at_the_proxy(client, trusted)


def listens(port: int) -> bool:
    with socket.socket() as line:
        return line.connect_ex(("127.0.0.1", port)) == 0


def updating(deployment: Deployment) -> int | None:
    url = deployment.put(SERVICES["api"]["environment"]["MODALBASE_DATABASE_URL"])
    password = Path(
        deployment.put(SERVICES["api"]["environment"]["MODALBASE_DATABASE_PASSWORD_FILE"])
    ).read_text()
    with psycopg.connect(url, password=password.strip()) as connection:
        row = connection.execute(
            "SELECT worker FROM jobs WHERE kind = 'update' AND state = 'running'"
        ).fetchone()
    return None if row is None else int(row[0].split(":")[1])


@contextmanager
def proxy(deployment: Deployment, api: int, authority: trustme.CA) -> Iterator[str]:
    """nginx with the deployment's own configuration, at free ports."""
    certificate, secrets = authority.issue_cert("127.0.0.1"), deployment.folder / "secrets"
    certificate.private_key_pem.write_to_path(secrets / "tls_key")
    certificate.cert_chain_pems[0].write_to_path(secrets / "tls_certificate")
    plain, tls = free_port(), free_port()
    words = (ROOT / "deploy" / "nginx.conf").read_text()
    for there, here in {
        "/tmp/": f"{deployment.folder}/",
        "/run/secrets/": f"{secrets}/",
        "api:8000": f"127.0.0.1:{api}",
        "listen 8080": f"listen 127.0.0.1:{plain}",
        "listen 8443": f"listen 127.0.0.1:{tls}",
    }.items():
        assert there in words
        words = words.replace(there, here)
    (deployment.folder / "nginx.conf").write_text(words)
    process = subprocess.Popen(
        ["nginx", "-c", str(deployment.folder / "nginx.conf"), "-g", "daemon off;"]
    )
    try:
        until(lambda: answers(f"http://127.0.0.1:{plain}/"), "the proxy")
        moved = httpx.get(f"http://127.0.0.1:{plain}/docs", trust_env=False, timeout=60)
        assert (moved.status_code, moved.headers["location"]) == (308, "https://127.0.0.1/docs")
        yield f"https://127.0.0.1:{tls}"
    finally:
        process.terminate()
        process.wait(PATIENCE)


def answers(url: str) -> bool:
    try:
        return httpx.get(url, trust_env=False).status_code == 308
    except httpx.TransportError:
        return False


def look_at_the_proxy(client: httpx.Client, trusted: ssl.SSLContext) -> None:
    assert client.get("/metrics").status_code == 404
    docs = client.get("/docs")
    assert docs.headers["strict-transport-security"] == "max-age=31536000"
    assert "script-src 'self'" in docs.headers["content-security-policy"]
    at = client.base_url
    connection = http.client.HTTPSConnection(at.host, at.port, context=trusted, timeout=60)
    connection.putrequest("POST", "/api/v1/projects")
    connection.putheader("Content-Length", str(2 * 1024**3))  # which is not sent
    connection.endheaders()
    assert connection.getresponse().status == 413
    connection.close()


def test_containers_are_closed_as_far_as_they_can_be() -> None:
    """Not root, nothing to write to, no capability, no way to the database from outside, no
    password in the file.
    """
    assert re.search(r"^USER modalbase$", LAST_STAGE, re.M)
    for name, service in SERVICES.items():
        assert service["read_only"] is True, name
        assert service["cap_drop"] == ["ALL"], name
        assert service["security_opt"] == ["no-new-privileges:true"], name
        assert service["networks"], name
        assert "ports" not in service or name == "proxy"
    assert SERVICES["database"]["user"] == "postgres"
    assert COMPOSE["networks"]["store"]["internal"] is True
    assert {name for name, service in SERVICES.items() if "outside" in service["networks"]} == {
        "worker",
        "proxy",
    }
    for service in SERVICES.values():
        for name, value in service.get("environment", {}).items():
            assert "PASSWORD" not in name or (
                name.endswith("_FILE") and str(value).startswith("/run/secrets/")
            )
    assert "secrets/" in (ROOT / ".gitignore").read_text().split()
    assert "secrets" in (ROOT / ".dockerignore").read_text().split()


@pytest.mark.parametrize(
    ("lock", "extras"),
    [("requirements.lock", ("server",)), ("requirements-dev.lock", ("server", "dev"))],
)
def test_what_is_installed_is_locked_by_its_digest_and_is_what_we_ask_for(
    lock: str, extras: tuple[str, ...]
) -> None:
    """A name stands twice where one version does not serve every Python."""
    entries = re.split(r"^(?=[a-z0-9-]+==)", (ROOT / lock).read_text(), flags=re.M)
    assert entries[0] == ""
    locked = [Requirement(entry.split("\\")[0].strip()) for entry in entries[1:]]
    assert all("--hash=sha256:" in entry for entry in entries[1:])
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    asked = [
        *project["dependencies"],
        *(line for extra in extras for line in project["optional-dependencies"][extra]),
    ]
    for wanted in map(Requirement, asked):
        if wanted.name != "modalbase":
            pinned = [one for one in locked if one.name == wanted.name.lower()]
            assert pinned, wanted
            versions = [specifier.version for one in pinned for specifier in one.specifier]
            assert all(wanted.specifier.contains(version) for version in versions), wanted


def test_one_resolution_serves_the_image_and_the_tests() -> None:
    service, tests = (
        set(re.findall(r"^[a-z0-9-]+==[^\\\n]+", (ROOT / lock).read_text(), re.M))
        for lock in ("requirements.lock", "requirements-dev.lock")
    )
    assert service < tests
    assert "--require-hashes" in DOCKERFILE
    assert "--no-deps" in DOCKERFILE


# --- the wheel and the source archive
# -----------------------------------------------------------------------------------

LIGHT = {"httpx", "numpy", "platformdirs", "rich", "typer"}


def test_the_wheel_has_four_packages_and_nothing_else(built: tuple[Path, Path]) -> None:
    with zipfile.ZipFile(built[0]) as wheel:
        names = wheel.namelist()
        metadata = wheel.read(next(name for name in names if name.endswith("METADATA"))).decode()
    tops = {name.split("/")[0] for name in names if not name.split("/")[0].endswith(".dist-info")}
    assert tops == {"fecore", "migrations", "modalbase", "service"}
    assert {"modalbase/client/routes.json", "service/pages/static/paper_beam.uff"} <= set(names)
    assert {
        "service/pages/guide/pages/index.md",
        "service/pages/guide/pages/decisions/queue.md",
    } <= set(names)
    assert any(name.endswith("licenses/LICENSE") for name in names)
    required = [
        line.split(":")[1]
        for line in metadata.splitlines()
        if line.startswith("Requires-Dist") and "extra" not in line
    ]
    assert {line.split(">")[0].split("=")[0].split("<")[0].strip() for line in required} == LIGHT


def test_the_source_archive_builds_the_same_packages(built: tuple[Path, Path]) -> None:
    with tarfile.open(built[1]) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {
        "pyproject.toml",
        "README.md",
        "LICENSE",
        "modalbase/__init__.py",
        "service/pages/static/paper_beam.uff",
    } <= names


def test_the_demonstration_shows_what_it_found(
    service: LocalService, demo: Done, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Over a service that runs already, and the update that was made there; without a report."""
    key = demo.api.headers["Authorization"].split()[1]
    running = SimpleNamespace(url=service.url, new_key=lambda _: key)
    monkeypatch.setattr("service.app.demo.run.LocalService", lambda *_, **__: nullcontext(running))
    monkeypatch.setattr(Laboratory, "update_beam", lambda _: demo.result)
    monkeypatch.setattr("service.app.demo.run._report", lambda *_: "report.pdf")
    assert_the_papers_values(modalbase_here("demo", "--json"))


@pytest.mark.long
def test_the_wheel_alone_runs_in_a_laboratorys_own_folder_and_leaves_nothing_running(
    unpacked: Path, laboratory: Path, tmp_path: Path
) -> None:
    """The folder's `signal.py` is no reason to stop, its `service.py` nothing to run, in no
    process. Its short forms are the demonstration above, and `test_up.py`, from the wheel in such a
    folder.
    """
    mark = f"demo-test-{os.getpid()}"
    around = {"PYTHONPATH": str(unpacked), "HOME": str(tmp_path), "MODALBASE_TEST_MARK": mark}
    assert_the_papers_values(modalbase("demo", "--json", cwd=laboratory, **around))
    until(
        lambda: not _processes_with(mark),
        "the end of all that it started",
        lambda: _processes_with(mark),
    )


def assert_the_papers_values(ended: subprocess.CompletedProcess[str]) -> None:
    assert ended.returncode == 0, ended.stderr
    result = json.loads(ended.stdout)  # the document and nothing else
    rows = {row["name"]: row for row in result["parameters"]}
    # the paper's; docs/results.md
    assert rows["Ex"]["estimate"] == pytest.approx(31.66e9, rel=0.005)
    assert rows["Gxy"]["estimate"] == pytest.approx(6.30e9, rel=0.02)
    assert not rows["Ey"]["identifiable"]
    assert any("rayleigh" in warning for warning in result["warnings"])
    assert "The demonstration takes a cantilever" in ended.stderr
    assert "updated parameters" in ended.stderr
    assert "the paper's own measured damping, not its print" in " ".join(ended.stderr.split())
    assert "next: modalbase up" in ended.stderr


def _processes_with(mark: str) -> list[str]:
    """Processes whose environment carries the mark: whatever the demonstration started and did not
    end.
    """
    left = []
    for process in Path("/proc").iterdir():
        if process.name.isdigit() and int(process.name) != os.getpid():
            try:
                if mark.encode() in (process / "environ").read_bytes():
                    left.append((process / "cmdline").read_text())
            except OSError:
                continue  # it ended meanwhile, or is not ours
    return left

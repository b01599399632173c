"""Users and API keys of a service: one's own keys, and for administrators those of others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import datetime
from http import HTTPStatus
from typing import Any

from modalbase.client.errors import ClientError
from modalbase.objects.thing import Access


class People(Access):
    """Whom a service knows."""

    def users(self, **narrowed: Any) -> list[dict[str, Any]]:
        """All users, for administrators.

        Args:
            narrowed: to the one of a `name`.

        Raises:
            ClientError: the key is no administrator's.
        """
        return list(self.connection.pages("users", **narrowed))

    def set_disabled(self, name: str, disabled: bool) -> None:
        """Disable a user, whose keys then open nothing, or enable one again.

        Raises:
            ClientError: there is no such user, or the key is no administrator's.
        """
        users = self.users(name=name)
        if not users:
            raise ClientError(f"there is no user {name!r}; `modalbase users list` shows all")
        verb = "disable" if disabled else "enable"
        self.connection.call("POST", f"users/{users[0]['id']}/{verb}")

    def new_api_key(
        self, name: str, scopes: Sequence[str] = (), expires_at: datetime | None = None
    ) -> str:
        """Another key of the user whose key the laboratory has.

        Args:
            name: of the key.
            scopes: of `read`, `write`, `jobs` and `admin`; all by default.
            expires_at: when it ends; None never.
        """
        body: dict[str, Any] = {"name": name}
        if scopes:
            body["scopes"] = list(scopes)
        if expires_at is not None:
            body["expires_at"] = expires_at.isoformat()
        return str(self.connection.post("api-keys", body)["key"])

    def api_keys(self) -> Iterator[tuple[dict[str, Any], dict[str, Any] | None]]:
        """Every key with its user, for an administrator; one's own, without one, for anybody
        else.
        """
        try:
            users = self.users()
        except ClientError as error:
            if error.status != HTTPStatus.FORBIDDEN:
                raise
            yield from ((key, None) for key in self.connection.pages("api-keys"))
            return
        for user in users:
            keys = self.connection.pages(f"users/{user['id']}/api-keys")
            yield from ((key, user) for key in keys)

    def revoke_api_key(self, prefix: str) -> None:
        """Revoke the key of a prefix.

        Raises:
            ClientError: one sees no such key.
        """
        for key, user in self.api_keys():
            if key["prefix"] == prefix:
                below = f"users/{user['id']}/" if user else ""
                self.connection.call("DELETE", f"{below}api-keys/{key['id']}")
                return
        raise ClientError(
            f"no key that one may see has the prefix {prefix}; `modalbase keys list` shows all"
        )

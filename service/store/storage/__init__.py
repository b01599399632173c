"""How much a project stores, and how much it may."""

from service.store.storage.operations import StorageOwner, book, require_room

__all__ = ["StorageOwner", "book", "require_room"]

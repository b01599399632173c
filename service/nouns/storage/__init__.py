"""How much a project stores, and how much it may."""

from service.nouns.storage.operations import book, require_room

__all__ = ["book", "require_room"]

"""The guide below `/guide`: the pages of `docs`, which the wheel carries, as HTML without scripts that asks no other host."""

from __future__ import annotations

from service.show.guide.routes import router

__all__ = ["router"]

"""Models that users send: a deck is read, and the structure's next version is that model."""

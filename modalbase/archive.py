"""What an archive of campaigns is called and counted by; `docs/archives.md` describes it."""

FORMAT = 1
"""Version of the layout."""
MANIFEST = "manifest.json"
"""The member that lists all others, with bytes and SHA-256 of each."""
CRATE = "ro-crate-metadata.json"
"""The member that says the same for catalogues, with the day on which it was written."""

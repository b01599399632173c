"""Routes of recordings of responses."""

from service.nouns.recordings.operations import describe_all, recording_for
from service.nouns.recordings.schemas import RecordingOut
from service.platform.access import api_router
from service.platform.access.nouns import NounRoutes

router = api_router(tags=["recordings"])

nouns = NounRoutes(router, recording_for, RecordingOut, describe_all, "recordings", "recording_id")

nouns.listing(
    "list_recordings", "Recordings of responses to loads that nobody measured, of a campaign."
)
nouns.getting(
    "get_recording", "A recording of responses: its channels, and what its half spectra are."
)

"""Routes of processings."""

from service.nouns.records.schemas import CampaignProcessingIn, ProcessingOut
from service.platform.access import api_router
from service.platform.queue.routes import JobRoutes
from service.tasks.process.task import PROCESSINGS, start_processing

router = api_router(tags=["records"])

of_jobs = JobRoutes(
    router,
    PROCESSINGS,
    ProcessingOut,
    "processing_id",
    lambda _, rows: [{"result": row.document} for row in rows],
)


of_jobs.creating(
    "start_processing",
    "Queue a processing: hits are judged, the good ones become FRFs; recordings of responses become"
    " half spectra. `{}` is a body.",
    CampaignProcessingIn,
    start_processing,
    status=202,
)
of_jobs.listing("list_processings", "Processings of a campaign, newest first.", 20)
of_jobs.getting(
    "get_processing",
    "How far a processing is, how it judged every hit, and which FRFs rest on which records.",
)

"""A purge while jobs wait and run: they end as cancelled at once, in one line, and the worker goes on to others."""

from sqlalchemy import text

from benchmarks.jobs_floor import Floor, floor
from benchmarks.soak_backup import RECIPE, Laboratory, hits_of_a_point
from service.app.demo import paper
from service.jobs.child import PURGED
from service.jobs.tables import Job

PRIOR = {"posterior": "mcmc"}  # takes long enough to be purged while it runs


def busy_laboratory(here: Floor, lab: Laboratory) -> set[str]:
    """Ids of jobs of a campaign of which one runs and the others wait."""
    modes = lab.post(f"campaigns/{lab.campaign}/mode-sets", {"name": "published", "modes": paper.MODES})["id"]
    first = lab.send_file(lab.campaign)
    here.until(lambda: lab.ended(first), "the import")
    lab.post(f"campaigns/{lab.campaign}/records", hits_of_a_point())
    long = lab.post(f"campaigns/{lab.campaign}/update-jobs", {**RECIPE, **PRIOR, "mode_set": modes})["id"]
    here.until(lambda: job(here, long).state == "running", "an update that runs")
    waiting = [
        lab.post(f"campaigns/{lab.campaign}/{what}", body)["id"]
        for what, body in (("update-jobs", {}), ("identifications", {}), ("processings", {}))
    ]
    both = [{"campaign_id": campaign} for campaign in (lab.campaign, lab.new_campaign())]
    joint = lab.post("update-jobs", {"joint": True, "jobs": both})["joint"]["id"]
    other = lab.post(f"campaigns/{lab.campaign}/imports", content=paper.uff_file())["id"]
    return {long, *waiting, joint, other}


def job(here: Floor, key: str) -> Job:
    return next(job for job in here.jobs() if str(job.id) == key)


def test_a_purge_ends_the_jobs_of_what_it_removes() -> None:
    with floor() as here, here.client("soak") as client:
        here.modalbase("worker", worker_concurrency=1)
        kept = Laboratory(client)
        lab = Laboratory(client)
        jobs = busy_laboratory(here, lab)
        client.delete(f"campaigns/{lab.campaign}").raise_for_status()
        lab.post(f"campaigns/{lab.campaign}/purge")
        here.until(lambda: all(job.finished_at for job in here.jobs()), "the end of every job")
        ended = {str(job.id): (job.state, job.message, job.error) for job in here.jobs()}
        assert {key: ended[key] for key in jobs} == dict.fromkeys(jobs, ("cancelled", PURGED.detail, None))

        lab = Laboratory(client)
        jobs = busy_laboratory(here, lab)
        client.delete(f"projects/{lab.project}").raise_for_status()
        lab.post(f"projects/{lab.project}/purge")
        assert jobs.isdisjoint(str(job.id) for job in here.jobs())
        file = kept.send_file(kept.campaign)
        here.until(lambda: kept.ended(file), "another project's job, in the place of the purged one")
        assert client.get(file).json()["status"] == "succeeded"
        with here.sessions() as session:
            assert session.scalar(text("SELECT count(*) FROM procrastinate_jobs")) == 0
        log = here.log.read_text()
        assert "Traceback" not in log
        assert "internal" not in log

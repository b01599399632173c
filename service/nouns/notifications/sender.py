"""Sending what is in the outbox: claimed, sent outside any transaction, then noted; tried again
later where it failed.

A worker that dies between sending and noting sends the message again: receivers see at least one
copy, and recognise copies by their `webhook-id`, which a message keeps through all its attempts and
replays.

Each receiver is sent to on its own, one message at a time, and each project has a share: a receiver
that is slow delays nobody's messages but its own.

An attempt to deliver a message is its channel's `send`. Every attempt ends within a time that is
fixed.
"""

import asyncio
import random
import threading
from collections import Counter
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from typing import Self
from uuid import UUID

import structlog
from anyio import to_thread
from sqlalchemy import Text, cast, func, select
from sqlalchemy.dialects.postgresql import distinct_on
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from service.nouns.notifications.channels import CHANNELS
from service.nouns.notifications.channels.channel import Outcome, Receiver
from service.nouns.notifications.tables import Delivery, Webhook
from service.platform.db.engine import Sessions
from service.platform.settings import Settings

log = structlog.stdlib.get_logger("modalbase.delivery")

TOTAL_SECONDS = 20.0  # of an attempt, whatever the receiver does
ATTEMPTS = 8
GROWTH = 4.0  # of the pause between attempts
# after which a message that somebody took and did not note is sent again
CLAIM_SECONDS = 1.5 * TOTAL_SECONDS
LOOK_SECONDS = 1.0  # between two looks at what others have put into the outbox
AT_ONCE = 64  # attempts of a process
OF_A_PROJECT = 8  # of them
PATIENCE_SECONDS = 5.0  # that attempts under way get when the process ends


async def deliver(delivery: Delivery, receiver: Receiver, settings: Settings) -> Outcome:
    """Try once to bring a message to its receiver."""
    try:
        async with asyncio.timeout(TOTAL_SECONDS):
            return await CHANNELS[delivery.channel].send(delivery, receiver, settings)
    except TimeoutError:
        return Outcome(None, f"the receiver took longer than {TOTAL_SECONDS:g} s")


_RECEIVER = func.coalesce(cast(Delivery.webhook_id, Text), Delivery.recipient)


class Sender:
    """Sends what is due, in a thread of its own; a context manager. Any number may run."""

    def __init__(self, sessions: Sessions, settings: Settings) -> None:
        self._sessions, self._settings = sessions, settings
        self._loop = asyncio.new_event_loop()
        self._woken, self._ending = asyncio.Event(), False
        # receivers that are being sent to, and whose they are
        self._under_way: dict[str, UUID] = {}
        self._thread = threading.Thread(target=self._run, daemon=True, name="sender")

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_error: object) -> None:
        self._ending = True
        self.wake()
        self._thread.join()

    def wake(self) -> None:
        """Look at the outbox now, for there may be something to send."""
        with suppress(RuntimeError):  # the thread has ended
            self._loop.call_soon_threadsafe(self._woken.set)

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._serve())

    async def _serve(self) -> None:
        attempts: set[asyncio.Task[None]] = set()
        while not self._ending:
            self._woken.clear()
            for delivery, receiver in await self._claimed():
                attempt = asyncio.create_task(self._attempt(delivery, receiver))
                attempts.add(attempt)
                attempt.add_done_callback(attempts.discard)
            with suppress(TimeoutError):
                async with asyncio.timeout(LOOK_SECONDS):
                    await self._woken.wait()
        if attempts:
            await asyncio.wait(attempts, timeout=PATIENCE_SECONDS)

    async def _claimed(self) -> list[tuple[Delivery, Receiver]]:
        try:
            claimed = await to_thread.run_sync(self._claim)
        except SQLAlchemyError as error:
            log.warning(
                "the database does not answer; trying again", error=str(error).split("\n", 1)[0]
            )
            return []
        for delivery, _ in claimed:
            self._under_way[_receiver(delivery)] = delivery.project_id
        return claimed

    def _claim(self) -> list[tuple[Delivery, Receiver]]:
        """Take the oldest due message of each receiver that is free: nobody else takes it while it
        is being sent.
        """
        with self._sessions.begin() as session:
            now = datetime.now(UTC)
            first = _RECEIVER.label("receiver"), Delivery.id, Delivery.project_id, Delivery.due_at
            heads = (
                select(*first)
                .ext(distinct_on(_RECEIVER))
                .where(
                    Delivery.state == "waiting",
                    Delivery.due_at <= now,
                    _RECEIVER.not_in(list(self._under_way)),
                )
                .order_by(_RECEIVER, Delivery.due_at, Delivery.id)
                .subquery()
            )
            rows = session.execute(
                select(heads.c.id, heads.c.project_id).order_by(heads.c.due_at)
            ).all()
            chosen = self._fair([(row.id, row.project_id) for row in rows])
            due = session.scalars(
                select(Delivery)
                .where(Delivery.id.in_(chosen), Delivery.state == "waiting", Delivery.due_at <= now)
                .with_for_update(skip_locked=True)
            ).all()
            for delivery in due:
                delivery.attempts += 1
                delivery.due_at = now + timedelta(seconds=CLAIM_SECONDS)
            return [(delivery, _where(session, delivery)) for delivery in due]

    def _fair(self, heads: list[tuple[UUID, UUID]]) -> list[UUID]:
        """As many as may be sent now, no project more than its share."""
        busy, chosen = Counter(self._under_way.values()), list[UUID]()
        for key, project_id in heads:
            if busy[project_id] < OF_A_PROJECT and busy.total() < AT_ONCE:
                busy[project_id] += 1
                chosen.append(key)
        return chosen

    async def _attempt(self, delivery: Delivery, receiver: Receiver) -> None:
        try:
            outcome = await deliver(delivery, receiver, self._settings)
            again = await to_thread.run_sync(self._note, delivery, outcome)
            if again is not None:
                self._loop.call_later(again, self._woken.set)
        except SQLAlchemyError as error:
            log.warning(
                "a delivery could not be noted; it is sent again",
                error=str(error).split("\n", 1)[0],
            )
        except Exception:
            log.exception(
                "a delivery met an unexpected error; it is tried again", delivery=str(delivery.id)
            )
        finally:
            self._under_way.pop(_receiver(delivery), None)
            self._woken.set()

    def _note(self, delivery: Delivery, outcome: Outcome) -> float | None:
        """Write down what became of an attempt. Seconds until the next one, where there is one."""
        pause = None
        with self._sessions.begin() as session:
            row = session.get(Delivery, delivery.id, with_for_update=True)
            if row is None or row.attempts != delivery.attempts:
                # the webhook is gone, or somebody else took the message because this took too long
                return None
            row.last_status, row.last_error = outcome.status, outcome.error
            if outcome.error is None:
                row.state, row.delivered_at = "delivered", datetime.now(UTC)
            elif row.attempts >= ATTEMPTS:
                row.state = "failed"
            else:
                pause = (
                    self._settings.delivery_pause_seconds
                    * GROWTH ** (row.attempts - 1)
                    * random.uniform(1.0, 1.2)
                )
                row.due_at = datetime.now(UTC) + timedelta(seconds=pause)
        log.info(
            "delivery",
            delivery=str(row.id),
            event_type=row.event,
            state=row.state,
            attempt=row.attempts,
            error=outcome.error,
        )
        return pause


def _receiver(delivery: Delivery) -> str:
    return str(delivery.webhook_id) if delivery.webhook_id is not None else str(delivery.recipient)


def _where(session: Session, delivery: Delivery) -> Receiver:
    """Where a message goes now: a webhook's URL, or the address that it was written for."""
    if delivery.webhook_id is None:
        return Receiver(str(delivery.recipient))
    hook = session.get_one(Webhook, delivery.webhook_id)
    return Receiver(hook.url, hook.secret)

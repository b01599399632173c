"""The laboratory: its row, what clients see of it, and the routes."""

from typing import Annotated

from fastapi import Depends, Response
from pydantic import Field
from sqlalchemy import select
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.nouns.attachments.operations import media_type
from service.platform.access import CurrentUser, SessionDep, SettingsDep, User, api_router, audit
from service.platform.access.users import require_administrator
from service.platform.db.base import Base, Identified, one_at_a_time
from service.platform.errors import Invalid, NotFound, PayloadTooLarge
from service.platform.settings import MIB, Settings
from service.platform.web import RequestModel, StrictModel, Text, example
from service.platform.web.openapi import BINARY, reads
from service.platform.web.uploads import UploadDep

LOGOS = ("image/png", "image/jpeg")

router = api_router(tags=["laboratory"])


class Laboratory(Identified, Base):
    """The laboratory of this service, once somebody stated it: one row."""

    __tablename__ = "laboratory"

    name: Mapped[str]
    address: Mapped[str]
    logo: Mapped[bytes | None] = mapped_column(deferred=True)


class LaboratoryIn(RequestModel):
    """The laboratory as an administrator states it."""

    model_config = example(name="Institute of Lightweight Structures", address="Test hall 3\nTown")

    name: str = Field("", max_length=200, description="empty: reports name none")
    address: Text = Field("", description="lines")


class LaboratoryOut(StrictModel):
    """The laboratory: as it was stated here, or else as the operator's settings state it."""

    name: str = Field(description="on top of reports; empty: none")
    address: str = Field(description="lines")
    logo: bool = Field(description="whether `GET /laboratory/logo` answers one")


def _stored(session: Session) -> Laboratory | None:
    return session.scalars(select(Laboratory).limit(1)).one_or_none()


def laboratory_of(session: Session, settings: Settings) -> LaboratoryOut:
    """The laboratory as reports show it."""
    if (row := _stored(session)) is not None:
        return LaboratoryOut(name=row.name, address=row.address, logo=row.logo is not None)
    lines = [line.strip() for line in settings.laboratory_address.split(";")]
    logo = settings.laboratory_logo is not None
    return LaboratoryOut(name=settings.laboratory, address="\n".join(lines), logo=logo)


def logo_of(session: Session, settings: Settings) -> bytes | None:
    """Its logo, PNG or JPEG; None without one."""
    if (row := _stored(session)) is not None:
        return row.logo
    file = settings.laboratory_logo
    return None if file is None else file.read_bytes()


def _changed(session: Session, user: User, settings: Settings) -> Laboratory:
    """The row, made of the settings where there is none yet.

    Raises:
        Forbidden: the user is no administrator.
    """
    one_at_a_time(session, "laboratory")
    row = _stored(session)
    if row is None:
        before = laboratory_of(session, settings)
        logo = logo_of(session, settings)
        row = Laboratory(name=before.name, address=before.address, logo=logo)
        session.add(row)
        session.flush()
    audit(session, user, "laboratory.change", "laboratory", row.id)
    return row


def _administrator(user: CurrentUser) -> User:
    require_administrator(user)
    return user


Administrator = Annotated[User, Depends(_administrator)]


@router.get("/laboratory")
def get_laboratory(session: SessionDep, user: CurrentUser, settings: SettingsDep) -> LaboratoryOut:
    """The laboratory that reports are of."""
    del user  # whoever has a key
    return laboratory_of(session, settings)


@router.put("/laboratory")
def put_laboratory(
    body: LaboratoryIn, session: SessionDep, user: Administrator, settings: SettingsDep
) -> LaboratoryOut:
    """State name and address; for administrators."""
    row = _changed(session, user, settings)
    row.name, row.address = body.name.strip(), body.address.strip()
    session.flush()
    return laboratory_of(session, settings)


@router.get("/laboratory/logo", response_class=Response)
def get_laboratory_logo(session: SessionDep, user: CurrentUser, settings: SettingsDep) -> Response:
    """The logo, PNG or JPEG."""
    del user
    if (logo := logo_of(session, settings)) is None:
        raise NotFound("logo of the laboratory")
    return Response(logo, media_type=media_type(logo))


@router.put(
    "/laboratory/logo",
    openapi_extra=reads({"application/octet-stream": BINARY}),
)
def put_laboratory_logo(
    sent: UploadDep, session: SessionDep, user: Administrator, settings: SettingsDep
) -> LaboratoryOut:
    """Send the logo, PNG or JPEG of 1 MiB at most; for administrators."""
    if sent.file.size > MIB:
        raise PayloadTooLarge(f"the logo has {sent.file.size} bytes, at most {MIB}")
    logo = sent.file.path.read_bytes()
    if media_type(logo) not in LOGOS:
        raise Invalid("", "the logo is no PNG or JPEG")
    row = _changed(session, user, settings)
    row.logo = logo
    session.flush()
    return laboratory_of(session, settings)


@router.delete("/laboratory/logo", status_code=204)
def delete_laboratory_logo(session: SessionDep, user: Administrator, settings: SettingsDep) -> None:
    """Have no logo on reports; for administrators."""
    _changed(session, user, settings).logo = None

"""The one place where errors become HTTP: RFC 9457 problem details with a JSON pointer for each
fault.
"""

from collections.abc import Callable, Mapping, Sequence
from http import HTTPStatus
from typing import Any

import structlog
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from sqlalchemy.exc import DataError, IntegrityError, OperationalError
from sqlalchemy.exc import TimeoutError as NoConnectionFree
from starlette.exceptions import HTTPException

from fecore.errors import FecoreError, InputError
from service.platform import errors as e
from service.platform.logs import current_request_id
from service.platform.web.json_body import wording

STATUS: dict[type[e.ServiceError], int] = {
    e.NotFound: HTTPStatus.NOT_FOUND,
    e.Unauthorized: HTTPStatus.UNAUTHORIZED,
    e.Forbidden: HTTPStatus.FORBIDDEN,
    e.Conflict: HTTPStatus.CONFLICT,
    e.Gone: HTTPStatus.GONE,
    e.Invalid: HTTPStatus.UNPROCESSABLE_ENTITY,
    e.PayloadTooLarge: HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
    e.UnsupportedMediaType: HTTPStatus.UNSUPPORTED_MEDIA_TYPE,
    e.NotAcceptable: HTTPStatus.NOT_ACCEPTABLE,
    e.PreconditionFailed: HTTPStatus.PRECONDITION_FAILED,
    e.PreconditionRequired: HTTPStatus.PRECONDITION_REQUIRED,
    e.TooSlow: HTTPStatus.REQUEST_TIMEOUT,
    e.TooManyRequests: HTTPStatus.TOO_MANY_REQUESTS,
    e.Unavailable: HTTPStatus.SERVICE_UNAVAILABLE,
}

log = structlog.stdlib.get_logger("modalbase.http")


def problem(
    status: int,
    detail: str,
    faults: Sequence[e.Fault] = (),
    headers: Mapping[str, str] | None = None,
    *,
    confirmable: bool = False,
) -> JSONResponse:
    """A problem document (RFC 9457) with the id of the request.

    Args:
        status: of HTTP; its phrase is the title.
        detail: what is wrong and what to do, in one sentence.
        faults: each with a JSON pointer into the body, or the name of the parameter or header.
        headers: such as `Retry-After`.
        confirmable: the same with `confirm=true` is taken.
    """
    body: dict[str, Any] = {
        "type": "about:blank",
        "title": HTTPStatus(status).phrase,
        "status": status,
        "detail": detail,
        "request_id": current_request_id(),
    }
    if faults:
        body["errors"] = [{"pointer": fault.pointer, "detail": fault.detail} for fault in faults]
    if confirmable:
        body["confirmable"] = True
    return JSONResponse(
        body, status, headers=dict(headers or {}), media_type="application/problem+json"
    )


def add_problem_handlers(app: FastAPI) -> None:
    """Have every error of the app answered as a problem; unexpected ones are the middleware's."""
    for kind, handler in HANDLERS.items():
        app.add_exception_handler(kind, handler)


def problem_of(error: Exception) -> JSONResponse | None:
    """The answer to an error that is raised before the app has the request; None where nobody
    expected it.
    """
    handler = next((HANDLERS[kind] for kind in type(error).__mro__ if kind in HANDLERS), None)
    return None if handler is None else handler(Request({"type": "http"}), error)


def _service_error(_: Request, error: Exception) -> JSONResponse:
    status = next((STATUS[kind] for kind in type(error).__mro__ if kind in STATUS), 500)
    faults = error.faults if isinstance(error, e.Invalid) else ()
    headers = {"WWW-Authenticate": "Bearer"} if status == 401 else {}
    if isinstance(error, e.Later):
        headers["Retry-After"] = str(error.retry_after)
    return problem(status, str(error), faults, headers, confirmable=isinstance(error, e.Unusual))


def _core_error(_: Request, error: Exception) -> JSONResponse:
    """The core names a field by dots; here it is a pointer, in the detail too."""
    if not isinstance(error, InputError):
        return problem(422, str(error))
    invalid = e.Invalid(e.pointer(error.field.split(".")), error.message)
    return problem(422, str(invalid), invalid.faults)


def _validation_error(request: Request, error: Exception) -> JSONResponse:
    """FastAPI's own validation. A path that cannot name anything names nothing: 404."""
    assert isinstance(error, RequestValidationError)
    errors = error.errors()
    if any(fault["loc"][0] == "path" for fault in errors):
        return problem(
            404, "no such thing: " + "; ".join(f"{f['loc'][-1]}: {f['msg']}" for f in errors)
        )
    body = getattr(request.scope.get("route"), "body_field", None)
    kind = None if body is None else body.field_info.annotation
    faults = [
        e.Fault(_location(fault["loc"]), wording(fault, kind, fault["loc"][1:]))
        for fault in errors[: e.MOST_FAULTS]
    ]
    invalid = e.Invalid(faults, count=len(errors))
    return problem(422, str(invalid), invalid.faults)


def _http_exception(request: Request, error: Exception) -> JSONResponse:
    """The framework's own; what its router says is said so that a person can go on."""
    assert isinstance(error, HTTPException)
    detail = str(error.detail)
    if detail == HTTPStatus.NOT_FOUND.phrase:
        detail = f"no such address: {request.url.path}; /docs lists all that there are"
    elif detail == HTTPStatus.METHOD_NOT_ALLOWED.phrase:
        allowed = (error.headers or {}).get("Allow", "another method")
        detail = (
            f"{request.method} is not possible at this address, {allowed} is; /docs lists all that"
            " there are"
        )
    return problem(error.status_code, detail, headers=error.headers)


def _data_error(_: Request, error: Exception) -> JSONResponse:
    """A value that got past the models and that PostgreSQL cannot hold."""
    log.warning("value refused by the database", error=str(error))
    return problem(
        422,
        "a value is beyond what the database can hold: out of range, or text with a NUL character",
    )


def _integrity_error(_: Request, error: Exception) -> JSONResponse:
    log.warning("conflict in the database", error=str(error))
    return problem(
        409,
        "the request contradicts what is stored, or what another request stored at the same moment",
    )


def _operational_error(_: Request, error: Exception) -> JSONResponse:
    log.error("database does not answer", error=str(error))
    return problem(503, "the database does not answer; try again", headers={"Retry-After": "2"})


def _location(loc: Sequence[Any]) -> str:
    """Pydantic's location: a pointer into the body, or a parameter's name."""
    return e.pointer(loc[1:]) if loc[0] == "body" else ".".join(str(step) for step in loc[1:])


HANDLERS: dict[type[Exception], Callable[[Request, Exception], JSONResponse]] = {
    e.ServiceError: _service_error,
    FecoreError: _core_error,
    RequestValidationError: _validation_error,
    HTTPException: _http_exception,
    DataError: _data_error,
    IntegrityError: _integrity_error,
    OperationalError: _operational_error,
    NoConnectionFree: _operational_error,
}
"""What answers each kind of error."""

# One image, two roles: the API (default) and the worker (`modalbase worker`). The database is PostgreSQL 18 elsewhere.
FROM python:3.13-slim AS build
WORKDIR /src
COPY pyproject.toml README.md LICENSE ./
COPY fecore fecore
COPY service service
COPY migrations migrations
RUN python -m venv /opt/modalbase && /opt/modalbase/bin/pip install --no-cache-dir .

FROM python:3.13-slim
RUN useradd --create-home --uid 10001 modalbase
COPY --from=build /opt/modalbase /opt/modalbase
ENV PATH=/opt/modalbase/bin:$PATH MODALBASE_HOST=0.0.0.0 MODALBASE_PORT=8000 MODALBASE_LOG_FORMAT=json
USER modalbase
WORKDIR /home/modalbase
EXPOSE 8000
HEALTHCHECK --interval=10s --timeout=5s --start-period=20s \
  CMD ["python", "-c", "import urllib.request; urllib.request.urlopen('http://127.0.0.1:8000/readyz', timeout=4)"]
CMD ["modalbase", "serve"]

# One image, two roles: the API (default) and the worker. The database is PostgreSQL 18 elsewhere.
FROM python:3.13-slim AS build
WORKDIR /src
# The versions of requirements.lock and no others, each with its SHA-256; then modalbase alone.
COPY requirements.lock ./
RUN python -m venv /opt/modalbase && /opt/modalbase/bin/pip install --no-cache-dir --require-hashes --requirement requirements.lock
COPY pyproject.toml README.md LICENSE ./
COPY fecore fecore
COPY modalbase modalbase
COPY service service
COPY docs docs
COPY migrations migrations
RUN /opt/modalbase/bin/pip install --no-cache-dir --no-deps --no-build-isolation .

FROM python:3.13-slim
RUN useradd --create-home --uid 10001 modalbase && install --directory --owner modalbase --mode 700 /scratch
COPY --from=build /opt/modalbase /opt/modalbase
ENV PATH=/opt/modalbase/bin:$PATH PYTHONSAFEPATH=1 MODALBASE_HOST=0.0.0.0 MODALBASE_PORT=8000 MODALBASE_LOG_FORMAT=json
USER modalbase
WORKDIR /home/modalbase
EXPOSE 8000
HEALTHCHECK --interval=10s --timeout=5s --start-period=20s \
  CMD ["python", "-c", "import urllib.request; urllib.request.urlopen('http://127.0.0.1:8000/readyz', timeout=4)"]
CMD ["modalbase", "serve"]

# vgps as an unprivileged user: docker build -t vgps . && docker run --rm --network none -v "$PWD:/data" vgps smooth walk --out run
FROM python:3.12-slim-bookworm AS build
COPY --from=ghcr.io/astral-sh/uv:0.9 /uv /bin/uv
WORKDIR /src
COPY pyproject.toml uv.lock README.md LICENSE ./
ENV UV_PROJECT_ENVIRONMENT=/opt/vgps UV_LINK_MODE=copy UV_COMPILE_BYTECODE=0
RUN uv sync --locked --no-dev --no-install-project
COPY vgps vgps
COPY factors factors
RUN uv sync --locked --no-dev --no-editable \
 && find /opt/vgps -name tests -type d -prune -exec rm -r {} + \
 && find /opt/vgps -name '*.pyi' -delete

FROM python:3.12-slim-bookworm
COPY --from=build /opt/vgps /opt/vgps
RUN useradd --create-home --uid 1000 vgps
USER vgps
ENV PATH=/opt/vgps/bin:$PATH PYTHONDONTWRITEBYTECODE=1 MPLCONFIGDIR=/tmp/matplotlib
WORKDIR /data
ENTRYPOINT ["vgps"]
CMD ["--help"]

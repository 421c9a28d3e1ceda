# vgps as an unprivileged user, who may be any: README.md shows how to run it without network on a read-only file system.
# More formats: docker build --build-arg EXTRAS="--extra ros --extra logs" -t vgps .
FROM python:3.12-slim-bookworm AS build
COPY --from=ghcr.io/astral-sh/uv:0.9 /uv /bin/uv
WORKDIR /src
COPY pyproject.toml uv.lock README.md LICENSE ./
ARG EXTRAS=""
ENV UV_PROJECT_ENVIRONMENT=/opt/vgps UV_LINK_MODE=copy
RUN uv sync --locked --no-dev $EXTRAS --no-install-project
COPY vgps vgps
COPY factors factors
RUN uv sync --locked --no-dev $EXTRAS --no-editable \
 && find /opt/vgps -name tests -type d -prune -exec rm -r {} + \
 && find /opt/vgps -name '*.pyi' -delete \
 && python -m compileall -q -j 0 /opt/vgps/lib

FROM python:3.12-slim-bookworm
RUN useradd --create-home --uid 1000 vgps \
 && install -d -o vgps -g vgps /data \
 && python -m compileall -q /usr/local/lib
COPY --from=build /opt/vgps /opt/vgps
USER vgps
ENV PATH=/opt/vgps/bin:$PATH PYTHONDONTWRITEBYTECODE=1 MPLCONFIGDIR=/tmp/matplotlib
WORKDIR /data
ENTRYPOINT ["vgps"]
CMD ["--help"]

# docker build --tag calfsocket .
# docker run --rm --user "$(id -u)" --volume "$PWD/results:/results" calfsocket [COMMAND ...]
#
# The first stage is also the image that ./in-debian13 uses on machines that are not Debian.

FROM debian:trixie-slim AS debian13
ARG DEBIAN_FRONTEND=noninteractive
COPY debian-packages.txt /tmp/
RUN apt-get update \
    && sed 's/#.*//' /tmp/debian-packages.txt | xargs apt-get install --yes --no-install-recommends \
    && rm -rf /var/lib/apt/lists/*

FROM debian13
# Also for a user unknown here (--user): a home that anyone may write, for the compile caches.
# The sources belong to root: pytest keeps no cache beside them.
ENV HOME=/home/calf PYTEST_ADDOPTS="-p no:cacheprovider"
RUN useradd --create-home calf && install --directory --mode 1777 /results
WORKDIR /opt/calfsocket
COPY . .
RUN python3 -m compileall -q calfsocket forms meshes
USER calf
ENTRYPOINT ["/opt/calfsocket/debian13-environment"]
CMD ["python3", "-m", "calfsocket", "--out", "/results"]
# Compiles the forms, so that no run of the image waits for it.
RUN ./debian13-environment python3 -m calfsocket precompile && chmod --recursive a+rwX "$HOME"

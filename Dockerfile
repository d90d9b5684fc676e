# brickwalk in a container. The first stage builds it; the second has the program and what it loads when it runs.
#
#   docker build -t brickwalk .
#   docker run --rm -v "$PWD:/data" brickwalk scene city -o city.bricks
#   docker run --rm -v "$PWD:/data" brickwalk walk city.bricks -o out
#   docker run --rm -v "$PWD:/data" -p 127.0.0.1:7878:7878 brickwalk serve city.bricks --bind 0.0.0.0
#
# Without a GPU the processor renders. For an NVIDIA GPU add `--gpus all`, for others `--device /dev/dri`. With
# `--build-arg VULKAN=` the image is smaller by some 300 MB and renders on the processor alone.

FROM rust:1.95-bookworm AS builder
WORKDIR /brickwalk
COPY . .
RUN cargo install --locked --path . --root /opt/brickwalk && strip /opt/brickwalk/bin/brickwalk

FROM debian:bookworm-slim
# The loader, and drivers for AMD, Intel and software Vulkan. That of NVIDIA comes from the host.
ARG VULKAN="libvulkan1 mesa-vulkan-drivers"
RUN if [ -n "$VULKAN" ]; then \
        apt-get update && \
        DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends $VULKAN && \
        rm -rf /var/lib/apt/lists/*; \
    fi
ENV NVIDIA_DRIVER_CAPABILITIES=graphics,utility
COPY --from=builder /opt/brickwalk/bin/brickwalk /usr/local/bin/
COPY README.md LICENSE-MIT LICENSE-APACHE /usr/share/doc/brickwalk/
WORKDIR /data
ENTRYPOINT ["brickwalk"]
CMD ["--help"]

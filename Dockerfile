# vines in a container: the program with the libraries of its FMUs, and the live bench.
#   docker build -t vines .
#   docker run --rm -v "$PWD/out:/results/out" vines vines identify       any command; results in out/
#   docker run --rm -p 127.0.0.1:8080:8080 vines                       the live bench, at http://127.0.0.1:8080
FROM node:20-bookworm-slim AS node

FROM rust:1.95-bookworm AS build
COPY --from=node /usr/local/ /usr/local/
# The target of the live bench.
RUN rustup target add wasm32-unknown-unknown
WORKDIR /vines
COPY . .
RUN scripts/install --prefix /installed && scripts/live --out /installed/share/vines/live

FROM python:3.12-slim-bookworm
COPY --from=build /installed/ /usr/local/
WORKDIR /results
CMD ["python3", "-m", "http.server", "--directory", "/usr/local/share/vines/live", "8080"]

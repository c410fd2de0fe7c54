# The programs in an image: the simulator, and by another entry point the viewer, the agent or ciberrato-grade.
#
#     docker build -t ciberrato .
#     docker run --rm -p 127.0.0.1:6000:6000/udp -p 127.0.0.1:6000:6000/tcp ciberrato --lab maze --grid maze

FROM python:3.12-slim AS wheel
WORKDIR /source
COPY . .
RUN python -m pip wheel --no-cache-dir --no-deps --wheel-dir /wheel .

FROM python:3.12-slim AS installed
COPY --from=wheel /wheel /wheel
# Compiled here, as the user below cannot write there.
RUN python -m venv /opt/ciberrato \
    && /opt/ciberrato/bin/python -m pip install --no-cache-dir --compile /wheel/*.whl \
    && /opt/ciberrato/bin/python -m pip uninstall --yes pip

FROM python:3.12-slim
COPY --from=installed /opt/ciberrato /opt/ciberrato
RUN useradd --uid 1000 --create-home robot && install -d -o robot /runs
# What is computed once is kept where runs are; the rest of the file system may be read-only.
ENV PATH=/opt/ciberrato/bin:$PATH PYTHONUNBUFFERED=1 CIBERRATO_CACHE=/runs/.cache MPLCONFIGDIR=/tmp/matplotlib
USER 1000
WORKDIR /runs
EXPOSE 6000/udp 6000/tcp 6080/tcp
STOPSIGNAL SIGINT
# All that comes into a container comes from outside it; who may send is told by the ports that are published.
ENTRYPOINT ["ciberrato-simulator", "--bind", "0.0.0.0"]
CMD ["--lab", "maze", "--grid", "maze"]

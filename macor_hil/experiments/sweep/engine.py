"""Engines of a sweep: processes of this machine, or the workers of a dask cluster.

A cluster is what a site has already: a scheduler started by hand, on Slurm or in the
cloud. Trials are pure functions of settings and seed, so that it does not matter who does them.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import joblib
from khepera_protocol.extras import how_to_install

from macor_hil.errors import MacorError

_PATIENCE = "10s"


@contextmanager
def engine(cluster: str | None) -> Iterator[None]:
    """Let joblib work on a cluster meanwhile; None leaves everything on this machine.

    Args:
        cluster: address of a dask scheduler.

    Raises:
        MacorError: dask is not installed, or no scheduler answers there.
    """
    if cluster is None:
        yield
        return
    try:
        from distributed import Client
    except ImportError:
        raise MacorError(
            f"dask is not installed; install the extra 'cluster' with: {how_to_install('cluster')}"
        ) from None
    try:
        client = Client(cluster, timeout=_PATIENCE)
    except (OSError, ValueError) as error:
        raise MacorError(
            f"no dask scheduler answers at {cluster}: {error}; start one with: dask scheduler"
        ) from None
    with client, joblib.parallel_config(backend="dask", wait_for_workers_timeout=60):
        yield

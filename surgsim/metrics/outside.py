"""Metrics of other packages, through the entry-point group `surgsim.metrics`."""

import importlib
import multiprocessing
import re
import sys
from collections.abc import Collection

from surgsim.errors import SurgsimError, told
from surgsim.metrics.metric import Metric
from surgsim.plugins import Offer, offers

GROUP = "surgsim.metrics"
_NAME = re.compile(r"[a-z][a-z0-9_]{0,63}")


def outside_metrics(shipped: Collection[str]) -> dict[str, Metric]:
    """Name to every metric of another package that loads; standard error says which do not.

    Args:
        shipped: Names that are taken.
    """
    found: dict[str, Metric] = {}
    for name, offer in offers(GROUP).items():
        try:
            found[name] = load_metric(offer, shipped)
        except SurgsimError as error:
            if multiprocessing.parent_process() is None:  # workers need not say it again
                print(f"surgsim: {error}; it is not computed", file=sys.stderr)
    return found


def load_metric(offer: Offer, shipped: Collection[str]) -> Metric:
    """The metric that an entry point names.

    Raises:
        SurgsimError: If it does not load, is no `Metric`, or has another name than its entry point.
    """
    called = f"metric '{offer.name}' {offer.origin}"
    if offer.name in shipped:
        raise SurgsimError(f"{called}: the name is that of a shipped metric")
    module, _, attribute = offer.place.partition(":")
    try:
        found = getattr(importlib.import_module(module), attribute)
    except Exception as error:
        raise SurgsimError(f"{called} does not load: {told(error)}") from error
    if not isinstance(found, Metric):
        raise SurgsimError(f"{called} ({offer.place}) is not a surgsim.metrics.metric.Metric")
    if found.name != offer.name or not _NAME.fullmatch(offer.name):
        raise SurgsimError(
            f"{called} calls itself '{found.name}': it must have the name of its entry point, lower-case "
            f"letters, digits and underscores"
        )
    return found

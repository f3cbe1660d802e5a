"""Instrument estimators: where the instrument really is, beside where the nominal model has it."""

from surgsim.catalog import Catalog

INSTRUMENT_ESTIMATORS = Catalog(
    "instrument estimator",
    "surgsim.instrument_estimators",
    {
        "nominal": f"{__name__}.nominal:NominalInstrumentConfig",
        "tracked": f"{__name__}.tracked:TrackedInstrumentConfig",
    },
)

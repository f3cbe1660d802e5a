"""Props: things in the patient that the instrument meets."""

from surgsim.catalog import Catalog

PROPS = Catalog(
    "prop",
    "surgsim.props",
    {
        "contact_wall": "surgsim.plant.props.contact_wall:ContactWallConfig",
        "peg_board": "surgsim.plant.props.peg_board:PegBoardConfig",
    },
)

"""The options that say where an adjustment's weights come from."""

from dataclasses import replace
from typing import Annotated

import typer

from photogrammetry.network import Network, Reweight
from rig.errors import BadInputError

ReweightOption = Annotated[
    bool,
    typer.Option(
        "--reweight", help="estimate the weights of images and survey from the residuals, group by group (D.3)"
    ),
]
PaperOption = Annotated[bool, typer.Option("--paper", help="estimate the weights by D5 as the paper prints it")]


def with_weights(network: Network, *, reweight: bool, paper: bool) -> Network:
    """The network with the weights that the options ask for; its own wish if they ask for nothing.

    Raises:
        BadInputError: they ask for two things at once.
    """
    if reweight and paper:
        raise BadInputError("--reweight and --paper estimate the weights in two different ways: choose one")
    if not (reweight or paper):
        return network
    return replace(network, reweight=Reweight.PAPER if paper else Reweight.HELMERT)

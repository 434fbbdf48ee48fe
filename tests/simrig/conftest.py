import pytest

from rig.settings.file import CONFIG
from simrig.world.scenario import Scenario, load_scenario


@pytest.fixture(scope="session")
def training() -> Scenario:
    return load_scenario(CONFIG / "scenarios" / "training.toml")


@pytest.fixture(scope="session")
def calm(training: Scenario) -> Scenario:
    """The training session without noise and snow."""
    image = training.image.model_copy(update={"noise_sigma": 0.0, "snow_flakes": 0})
    return training.model_copy(update={"image": image})

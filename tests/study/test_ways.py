"""Keys of which a table of a study holds one: what `--set` makes room for."""

from inercal.faces.studies.rig_errors import MAKE
from inercal.faces.studies.starting import DISTRIBUTIONS


def test_setting_a_distribution_takes_the_place_of_every_other():
    assert set(MAKE) == set(DISTRIBUTIONS)

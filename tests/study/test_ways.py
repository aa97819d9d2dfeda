"""Keys of which a table of a study holds one: what `--set` makes room for."""

from inercal.faces.studies.starting import DISTRIBUTIONS, POSITIONS
from inercal.foundation.keys import keys_of
from inercal.foundation.rigs.plans import StatedPositions
from inercal.foundation.rigs.stated import DISTRIBUTIONS as MAKE


def test_setting_a_distribution_takes_the_place_of_every_other():
    assert set(MAKE) == set(DISTRIBUTIONS)


def test_setting_one_way_to_state_positions_takes_the_place_of_every_other():
    assert [key.name or field.name for field, key in keys_of(StatedPositions)] == [*POSITIONS]

"""What a study leaves out of a recording."""

import pytest

from inercal.faces.studies.imu import imu_study
from inercal.foundation.errors import StudyError
from inercal.systems.imu.settings import Exclusion
from rows import for_each


@for_each(
    ("exclude", "sentence"),
    [
        (["pose 0"], "pose 0"),
        (["turn 3"], "turn 3"),
        (["9 s .. 5 s"], "9 s .. 5 s"),
        (["9 .. 12"], "9"),
        ([7], "7"),
    ],
)
def test_what_cannot_be_left_out_gets_a_sentence(exclude, sentence):
    with pytest.raises(StudyError, match=r"imu\.exclude") as caught:
        imu_study({"imu": {"exclude": exclude}}, "study.toml")
    assert sentence in caught.value.message


def test_a_study_leaves_out_times_and_poses():
    study = imu_study(
        {"site": {"gravity": "9.81 m/s^2"}, "imu": {"exclude": ["249 s .. 4.3 min", "pose 12"]}}, "study.toml"
    )
    assert study.exclude == Exclusion(((249.0, 258.0),), (12,))

"""Studies as `inercal new` writes them, filled in: anywhere in the north."""

from functools import partial

from pydantic import create_model

from inercal.faces.studies.load import load_study
from inercal.faces.studies.tables import Stated
from inercal.faces.studies.template import template
from inercal.foundation._toml import Strict, check
from inercal.foundation.errors import StudyError
from inercal.systems.listed import SYSTEMS

SITE = ("site.latitude=45(26) deg", "site.height=0(300) m")


def filled(kind, *paths, overrides=(), **more):
    """A new study of that kind with a site."""
    return template(kind, *paths, overrides=[*SITE, *overrides], **more)


FILL = [each for key in SITE for each in ("--set", key)]
"""Options of `inercal new` that fill in a site."""


load_turntable_study = partial(load_study, SYSTEMS["turntable"])
"""Settings of the study of a turntable, as those of the other systems."""


def table_read(settings, keys):
    """Settings of one table with these keys."""
    file = create_model("File", __base__=Strict, table=(Stated[settings], ...))
    return check(file, {"table": keys}, "study", StudyError).table

"""Studies as `inercal new` writes them, filled in: anywhere in the north."""

from inercal.studies.template import template

SITE = ("site.latitude=45(26) deg", "site.height=0(300) m")


def filled(kind, *paths, overrides=(), **more):
    """A new study of that kind with a site."""
    return template(kind, *paths, overrides=[*SITE, *overrides], **more)


FILL = [each for key in SITE for each in ("--set", key)]
"""Options of `inercal new` that fill in a site."""

"""Estimators on streams that break off, for the tests of this folder."""

from inercal.faces.stream.run import run


def lines_out(estimator, lines, saving=None, kill=None):
    """What is written for a stream; in the midst of the row numbered ``kill`` the process dies."""
    if kill is not None:
        whole = estimator.step

        def step(state, sample):
            if sample.row == kill:
                raise RuntimeError
            return whole(state, sample)

        estimator.step = step
    out = []
    try:
        run(estimator, lines, out.append, saving)
    except RuntimeError:
        assert kill is not None
    return out

"""A lab.toml with some keys spoiled: a certificate that is valid, or one sentence."""

import copy
import tomllib

from certified import DAY, LAB
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lxml import etree
from made import result

from inercal.foundation._toml import check
from inercal.foundation.errors import InputError
from inercal.laboratory.certificate.lab import LabFile
from inercal.laboratory.certificate.schema import fault
from inercal.laboratory.certificate.written import certificate

WHOLE = {
    **tomllib.loads(LAB),
    "equipment": {
        "table": {"name": "table", "certificate": "K-1", "valid_until": "2027-01-01", "budget": []}
    },
    "specification": {"decision": "guard band", "K1_x": ["-1", "1"]},
}
KEYS = [(table, key) for table, inner in WHOLE.items() if isinstance(inner, dict) for key in inner] + [
    ("persons",),
    ("parrot",),
]
SCALARS = st.one_of(
    st.none().map(lambda _: []), st.booleans(), st.integers(-3, 10**25), st.floats(), st.text(max_size=8), st.dates(),
    st.sampled_from(["?", "inf", "nan degC", "1e400 %", "-300 degC", "1(9)e300 degC"]),
    st.sampled_from([" ", "2026-13-01", "<&>", "risk 2 %"]),
    st.lists(st.text(max_size=3), max_size=3), st.dictionaries(st.sampled_from(["name", "x"]), st.text(max_size=3)),
)  # fmt: skip


@settings(derandomize=True, deadline=None, suppress_health_check=list(HealthCheck), database=None)
@given(st.lists(st.tuples(st.sampled_from(KEYS), SCALARS), min_size=1, max_size=3))
def test_a_certificate_or_one_sentence(spoils):
    data = copy.deepcopy(WHOLE)
    for path, value in spoils:
        place = data
        for part in path[:-1]:
            place = place[part] if isinstance(place.get(part), dict) else {}
        place[path[-1]] = value
    try:
        made = certificate([result()], check(LabFile, data, "lab.toml", InputError), "C-1", DAY)
    except InputError as error:
        said = str(error)
        assert "\n" not in said
        assert len(said) < 1000
        assert "does not meet the schema" not in said
    else:
        assert fault(etree.fromstring(made)) is None

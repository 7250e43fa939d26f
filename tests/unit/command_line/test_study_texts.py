"""Values in the text of a configuration are those that YAML reads."""

import yaml
from hypothesis import given
from hypothesis import strategies as st

from ankleloop.command_line.study_texts import dump

PRINTED = st.characters(min_codepoint=32, max_codepoint=0x2FFF, blacklist_categories=["Cs", "Cc"])
# Characters of what YAML takes for something else: numbers, null, flags, comments, keys, lists.
SUSPECT = st.text("yesnoulTRF012.e-+: #,[]{}~ ()/_", max_size=12)
VALUES = st.one_of(
    st.text(PRINTED, max_size=30),
    SUSPECT,
    st.floats(allow_nan=False, allow_infinity=False),
    st.integers(-(10**9), 10**9),
    st.booleans(),
    st.none(),
)


@given(VALUES)
def test_every_value_is_read_as_it_was(value):
    assert yaml.safe_load(f"key: {dump(value)}  # remark\n") == {"key": value}
    assert yaml.safe_load(f"key: {{list: {dump([value, value])}}}\n") == {"key": {"list": [value, value]}}

"""Files of the configuration: nothing that YAML changes or leaves out passes without a word."""

import pytest
import yaml

from ankleloop_lab.checking import ConfigError
from ankleloop_workflow.config.files import check_config_file, find_key


@pytest.fixture
def check_text(tmp_path):
    """Check a file of this text."""

    def check(text, name="config.yaml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        check_config_file(path)

    return check


@pytest.mark.parametrize("written", ["012", "1_2", "1:30", "0x1F"])
def test_numbers_that_yaml_reads_otherwise_are_refused(check_text, written):
    """The oracle is YAML itself: what it makes of the number is not what Python makes of the same letters."""
    assert isinstance(yaml.safe_load(written), (int, float))
    assert str(yaml.safe_load(written)) != written
    with pytest.raises(ConfigError, match=r"line 2: YAML reads .* in quotes if it is text"):
        check_text(f"b: x\na: {written}\n")
    check_text(f"a: '{written}'\n")


@pytest.mark.parametrize("written", ["7", "1.0", "13:30", "no", "2020-01-01", "null"])
def test_keys_that_yaml_does_not_read_as_text_are_refused(check_text, written):
    assert list(yaml.safe_load(f"{written}: x")) != [written]
    with pytest.raises(
        ConfigError, match=r"config.yaml, line 2: YAML reads the key .* as .*: put it in quotes"
    ):
        check_text(f"files:\n  {written}: x\n")
    check_text(f"files:\n  '{written}': x\n")


def test_the_place_of_a_key_is_that_of_the_last_file_with_it(tmp_path):
    first, second = tmp_path / "first.yaml", tmp_path / "second.yaml"
    first.write_text(
        "base: &base\n  trials: 3\nstudies:\n  s:\n    <<: *base\n    seed: 1\n", encoding="utf-8"
    )
    second.write_text("studies:\n  s:\n    seed: 2\n", encoding="utf-8")
    assert find_key(["studies", "s", "seed"], [first, second]) == f"{second}, line 3"
    assert find_key(["studies", "s", "trials"], [first, second]) == f"{first}, line 2"
    assert find_key(["studies", "s", "trails"], [first, second]) == f"{second}, line 2"
    assert find_key(["run"], [first, second]) == ""
    assert find_key([], [first, second]) == ""

"""Files that a command writes are refused with the options of the command."""

import click
import pytest

from ankleloop.command_line.outputs import check_outputs

REMEDY = "--overwrite replaces it."


def refusal(*paths, **options):
    """What the command says about files that it does not write."""
    with pytest.raises(click.UsageError) as caught:
        check_outputs(paths, REMEDY, **options)
    return caught.value.message


def test_a_file_that_exists_is_refused_with_the_options_of_the_command(tmp_path):
    existing, absent, empty = (tmp_path / name for name in ("a.csv", "b.csv", "c.csv"))
    existing.write_text("irreplaceable")
    empty.touch()
    assert refusal(absent, empty, existing, overwrite=False) == f"{existing}: the file exists already. {REMEDY}"
    check_outputs([absent, empty, existing], REMEDY, overwrite=True)
    check_outputs([absent, empty], REMEDY, overwrite=False)


def test_a_link_to_no_file_is_refused(tmp_path):
    link = tmp_path / "a.csv"
    link.symlink_to("nowhere.csv")
    assert REMEDY in refusal(link, overwrite=False)


@pytest.mark.parametrize("overwrite", [False, True])
def test_options_that_do_not_help_are_not_named(tmp_path, overwrite):
    recording = tmp_path / "a.csv"
    recording.write_text("irreplaceable")
    text = refusal(recording, overwrite=overwrite, inputs=iter([recording]))
    assert "the file is being read" in text
    assert "overwrite" not in text
    assert "there is no folder" in refusal(tmp_path / "nowhere" / "a.csv", overwrite=overwrite)

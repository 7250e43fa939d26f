import pytest

from ankleloop.plotting.diagrams import closed_loop_diagram, parallel_cascade_diagram
from ankleloop.plotting.style import save_figure


def texts(figure):
    return [text for text in figure.axes[0].texts if text.get_text()]


@pytest.mark.parametrize(
    ("draw", "said"),
    [
        (parallel_cascade_diagram, ("intrinsic stiffness", "$K + Bs + Is^2$", "reflex stiffness", "$TQ$ [N·m]")),
        (closed_loop_diagram, ("INP [rad]", "actuator", "H_{imp}", "voluntary", "TQ [N·m]", "impedance controller")),
    ],
)
def test_blocks_and_signals_are_named(draw, said):
    words = " ".join(text.get_text() for text in texts(draw()))
    assert all(word in words for word in said)


@pytest.mark.parametrize("draw", [parallel_cascade_diagram, closed_loop_diagram])
def test_nothing_overlaps_or_leaves_the_page(draw):
    figure = draw()
    figure.canvas.draw()
    boxes = [text.get_window_extent() for text in texts(figure)]
    page = figure.bbox
    for k, box in enumerate(boxes):
        assert page.x0 <= box.x0
        assert box.x1 <= page.x1
        assert page.y0 <= box.y0
        assert box.y1 <= page.y1
        assert not any(box.overlaps(other) for other in boxes[k + 1 :])


def test_the_same_drawing_gives_the_same_bytes(tmp_path):
    for name in ("first", "second"):
        save_figure(closed_loop_diagram(), tmp_path / name, endings=(".png", ".pdf", ".svg"))
    for end in (".png", ".pdf", ".svg"):
        first, second = ((tmp_path / f"{name}{end}").read_bytes() for name in ("first", "second"))
        assert first == second
        assert len(first) > 3_000
    assert b"<image" not in (tmp_path / "first.svg").read_bytes()  # vectors only

from ankleloop.replication.captions import circumstances, quantity
from ankleloop.simulation import Simulation, parameter_table


def test_every_parameter_has_a_name_and_its_unit():
    for name, entry in parameter_table().items():
        words, unit = quantity(name)
        assert "_" not in words
        assert unit == entry["unit"]


def test_circumstances_name_what_a_reader_must_know():
    settings = Simulation().flat()
    text = circumstances(settings)
    for said in (
        "trials of 50 s",
        "reflex gain 13",
        "10 dB",
        "5 % of the clean net torque",
        "closed loop",
        "250 N·m/rad",
    ):
        assert said in text
    other = circumstances({**settings, "snr_db": None, "voluntary": 0.0, "closed_loop": False})
    for said in ("no measurement noise", "no voluntary torque", "open loop"):
        assert said in other


def test_what_is_varied_is_left_out():
    text = circumstances(Simulation().flat(), ["reflex_gain", "load_stiffness"])
    assert "reflex gain" not in text
    assert "load" not in text
    assert "actuator" in text

from ankleloop.replication.captions import describe_settings, label_setting
from ankleloop.simulation.settings import SimulationSettings


def test_every_setting_has_a_name_and_its_unit():
    for name in SimulationSettings.model_fields:
        label, unit = label_setting(name)
        assert "_" not in label
        assert unit == SimulationSettings.unit(name)


def test_description_of_the_settings():
    settings = SimulationSettings.defaults()
    text = describe_settings(settings)
    for phrase in (
        "trials of 50 s",
        "reflex gain 13",
        "10 dB",
        "5 % of the clean net torque",
        "closed loop",
        "250 N·m/rad",
    ):
        assert phrase in text
    other = describe_settings({**settings, "snr_db": None, "voluntary": 0.0, "closed_loop": False})
    for phrase in ("no measurement noise", "no voluntary torque", "open loop"):
        assert phrase in other


def test_varied_settings_are_left_out():
    text = describe_settings(SimulationSettings.defaults(), ["reflex_gain", "load_stiffness"])
    assert "reflex gain" not in text
    assert "load" not in text
    assert "actuator" in text

import pytest

LOOPBACK = (
    "[multicast]\nResolveScope = machine\n[lab]\nKnownPeers = {127.0.0.1}\n[log]\nlevel = -3\n"
)
UNITS = {"angle": "deg", "torque": "N.m", "command": "deg", "fz": "N"}


@pytest.fixture(scope="session")
def lsl(tmp_path_factory):
    """The library of the Lab Streaming Layer, on this machine alone, also in processes that a test starts."""
    config = tmp_path_factory.mktemp("lsl") / "lsl.cfg"
    config.write_text(LOOPBACK)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("LSLAPICFG", str(config))
        lsl = pytest.importorskip("pylsl", exc_type=(ImportError, OSError, RuntimeError))
        outlet = lsl.StreamOutlet(lsl.StreamInfo("probe", source_id="probe"))
        if not lsl.resolve_byprop("name", "probe", timeout=5.0):
            pytest.skip("no stream of the Lab Streaming Layer is seen on this machine's loopback.")
        del outlet
        yield lsl


@pytest.fixture
def new_outlet(lsl):
    """Make an outlet with labels and units."""

    def new_outlet(name, labels=("angle", "torque", "command"), source="rig"):
        info = lsl.StreamInfo(name, "Joint", len(labels), 1000.0, "double64", source)
        info.set_channel_labels(list(labels))
        info.set_channel_units([UNITS[label] for label in labels])
        return lsl.StreamOutlet(info)

    return new_outlet

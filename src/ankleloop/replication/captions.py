"""Words for captions: what a parameter is called, and under which circumstances a study was made."""

from ankleloop.simulation import parameter_table

__all__ = ["circumstances", "labelled", "quantity", "setting"]

NAMES = {
    "reflex_gain": "reflex gain",
    "voluntary": "relative voluntary torque",
    "load_stiffness": "stiffness of the load",
    "load_inertia": "inertia of the load",
    "load_viscosity": "viscosity of the load",
    "snr_db": "signal-to-noise ratio",
    "closed_loop": "loop",
}


def quantity(name):
    """Readable name and unit of a simulation parameter.

    Parameters
    ----------
    name : str
        One of `ankleloop.simulation.parameter_table`.

    Returns
    -------
    tuple of str
        Name and unit.

    Examples
    --------
    >>> quantity("reflex_gain"), quantity("actuator_frequency")
    (('reflex gain', 'N·m·s/rad'), ('actuator frequency', 'Hz'))
    """
    return NAMES.get(name, name.replace("_", " ")), parameter_table()[name]["unit"]


def labelled(name, value):
    """A simulation parameter's value with its unit, as a reader wants it.

    Parameters
    ----------
    name : str
        One of `ankleloop.simulation.parameter_table`.
    value : float
        Its value.

    Returns
    -------
    str

    Examples
    --------
    >>> labelled("load_stiffness", 250.0), labelled("actuator_damping", 0.8)
    ('250 N·m/rad', '0.8')
    """
    unit = quantity(name)[1]
    return f"{value:g}" if unit == "1" else f"{value:g} {unit}"


def setting(parameters):
    """Load, reflex gain and voluntary torque of a point, short enough for the title of a panel.

    Parameters
    ----------
    parameters : dict
        Parameters of the simulation by name.

    Returns
    -------
    str

    Examples
    --------
    >>> from ankleloop.simulation import Simulation
    >>> setting(Simulation().flat())
    'load 1.1/7.1/250, gain 13, voluntary 5 %'
    """
    load = "/".join(f"{parameters[f'load_{name}']:g}" for name in ("inertia", "viscosity", "stiffness"))
    return f"load {load}, gain {parameters['reflex_gain']:g}, voluntary {100 * parameters['voluntary']:g} %"


def circumstances(settings, varied=()):
    """What holds for every trial of a study, in one phrase.

    Parameters
    ----------
    settings : dict
        Parameters of the simulation by name.
    varied : sequence of str
        Parameters that differ between points; they are left out.

    Returns
    -------
    str

    Examples
    --------
    >>> from ankleloop.simulation import Simulation
    >>> circumstances(Simulation().flat(), varied=["voluntary"]).split("; ")[1]
    'reflex gain 13 N·m·s/rad'
    """
    load = ("load_inertia", "load_viscosity", "load_stiffness")
    noise, voluntary = settings["snr_db"], settings["voluntary"]
    phrases = {
        ("duration",): f"trials of {settings['duration']:g} s",
        ("reflex_gain",): f"reflex gain {settings['reflex_gain']:g} N·m·s/rad",
        ("snr_db",): "no measurement noise"
        if noise is None
        else f"measurement noise at {noise:g} dB in the recorded torque",
        ("voluntary",): f"voluntary torque {100 * voluntary:g} % of the clean net torque (sd)"
        if voluntary
        else "no voluntary torque",
        ("closed_loop",): "closed loop" if settings["closed_loop"] else "open loop",
        load: "load {:g} kg·m², {:g} N·m·s/rad, {:g} N·m/rad".format(*(settings[name] for name in load)),
        ("actuator_frequency", "actuator_damping"): (
            f"actuator {settings['actuator_frequency']:g} Hz, damping {settings['actuator_damping']:g}"
        ),
    }
    said = [text for names, text in phrases.items() if not set(names) & set(varied)]
    if "voluntary" in varied:
        said.append("relative voluntary torque is its sd over that of the clean net torque")
    return "; ".join(said)

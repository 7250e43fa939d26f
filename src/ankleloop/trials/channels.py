"""Names of the variables of a trial, with their units."""

# Unit and long name of each variable that the library writes.
VARIABLES = {
    "time": ("s", "time from the first sample"),
    "position": ("rad", "joint position"),
    "torque": ("N·m", "net torque, opposing stretch"),
    "reference": ("rad", "position command to the servo"),
    "torque_intrinsic": ("N·m", "true intrinsic torque"),
    "torque_reflex": ("N·m", "true reflex torque"),
    "torque_voluntary": ("N·m", "true voluntary torque"),
    "torque_noise": ("N·m", "true torque measurement noise"),
    "stiffness_true": ("N·m/rad", "true intrinsic stiffness"),
    "viscosity_true": ("N·m·s/rad", "true intrinsic viscosity"),
    "reflex_gain_true": ("N·m·s/rad", "true reflex gain"),
    "phase": ("1", "phase of the cycle"),
    "schedule": ("1", "scheduling variable"),
}
CHANNELS = ("position", "torque", "reference")
TRUE_TORQUES = tuple(name for name in VARIABLES if name.startswith("torque_"))
